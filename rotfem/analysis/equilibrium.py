"""Relative equilibria: the steady state of a constant spin, and the static shape of a tip displacement.

Speed and loads are raised together in steps (`rotfem.analysis.load_steps`). Whether the equilibrium is stable is asked
of the result (`rotfem.analysis.stability`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.conditioning import KNOWN, rounded_compliance
from rotfem.analysis.load_steps import (
    REGULAR_SHARE,
    SMALLEST_SHARE,
    LoadFactors,
    balance,
    check_inside_out,
    counted,
    less,
    limited,
    on_hinges,
    raised,
    richest_advice,
)
from rotfem.equations.compiled import compile_system
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.loads import Load, Loads, Shapes, Term
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.newton import Newton
from rotfem.units import speed_text

Array = npt.NDArray[np.float64]


def steady_state(
    system: Any,
    omega: float,
    newton: Newton,
    start: Array | None = None,
    notes: list[str] | None = None,
) -> Array:
    """Return q (local dof array) with F(q, 0, 0) = 0 at constant speed: the equilibrium in the rotating frame.

    Speed and loads are raised together (on hinges the loads at the full speed), in one step where Newton allows and in
    smaller ones where not; the state is left in the system's functions. Where that ends at no minimum of the energy, or
    not at all, the path of equilibria is followed (`rotfem.analysis.equilibrium`): Newton may have left it.

    Args:
        system: equations of motion.
        omega: speed, rad/s.
        newton: iteration control.
        start: first guess, the equilibrium at a nearby speed; the whole load is then applied at once.
        notes: receives remarks on the way.

    Raises:
        ComputationError: no equilibrium was reached; says how far the load got.
    """
    notes = [] if notes is None else notes
    system, growth = system.held, LoadFactors(omega)
    loose = [hinge.name for hinge in system.structure.hinges.values() if hinge.stiffness == 0.0]
    if start is not None:
        try:
            return counted(system, growth, 1.0, balance(system, growth, 1.0, start, newton), newton)
        except ComputationError:
            pass
    if loose and not system.linear:
        growth = on_hinges(system, omega, newton)
    try:
        if system.linear:
            return balance(system, growth, 1.0, system.zeros(), newton)
        return _grown(system, growth, newton, notes)
    except ComputationError as error:
        lost = not system.linear and _compliance_lost(system, growth)
        if lost and not loose:
            why = "round-off decides, as axial or shear stiffness outweighs what bends beyond its digits"
            advice = "stiffnesses closer to each other, or fewer elements"
            raise ComputationError(f"{error.what}; {why}", error.time, advice) from error
        if not (loose and (lost or growth.start is None)):
            raise
        raise ComputationError(
            f"nothing holds the root's hinge ({', '.join(loose)}): no steady state at {speed_text(omega)}: "
            "the load turns it, and no equilibrium was found that it turns to",
            advice=f"structure.root.{loose[0]}_stiffness, a speed whose tension holds it, or {less(system)}",
        ) from error


def _compliance_lost(system: Any, growth: LoadFactors) -> bool:
    """Return whether round-off of the stiffness is all of what the load does to the structure before it grows."""
    q = growth.begin(system)
    growth.set(system, 1.0)
    system.set_state(q)
    K, load = system.matrix(1.0, 0.0, 0.0, 1.0), system.residual()
    try:
        return rounded_compliance(system, K, system.local(DirectSolver(K).solve(load))) >= KNOWN
    except ComputationError:
        return False


def _grown(system: Any, growth: LoadFactors, newton: Newton, notes: list[str]) -> Array:
    """Return the equilibrium at full load that the growing load leads to, in a nonlinear theory.

    Raises:
        ComputationError: none was found; says how far the load got.
    """
    found = raised(system, growth, newton)
    if found.least < REGULAR_SHARE:
        if _compliance_lost(system, growth):
            raise ComputationError(
                f"no steady state at {speed_text(growth.omega)}: steps of the load were cut for ever"
            )
        system.count_rotations_from(found.reference)
        growth.set(system, 1.0)
        system.set_state(found.q)
    if found.critical is not None:
        notes.append(f"the stiffness gets a negative eigenvalue at {found.critical:.6g} of the load: a bifurcation")
    return found.q


def check_steady(problem: Problem) -> None:
    """Refuse what has no steady state in the rotating frame: gravity that turns with it.

    Raises:
        InputError: gravity has a component across the spin axis while the frame spins.
    """
    if problem.gravity_turns:
        raise InputError(
            "loads.gravity",
            list(problem.loads.gravity),
            "gravity across the spin axis turns in the rotating frame, so there is no steady state; give [time], or "
            "gravity along motion.axis, or leave gravity out of model.effects",
        )


def static_tip_shape(problem: Problem, displacement: float, newton: Newton, comm: MPI.Comm = MPI.COMM_WORLD) -> Array:
    """Return q (local dof array) of the beam at rest under the tip force F_2 that gives u_2(L) = displacement (m).

    The tip is led there in one step where Newton allows, and in smaller ones where not.

    Raises:
        ComputationError: no equilibrium with this displacement was found; says how far the tip was led.
    """
    unit = Load("dead", (Term(Shapes.uniform([(0.0, 1.0, 0.0)])),))
    still, force = Motion.constant_speed(0.0), Loads(named={"tip_force": unit})
    resting = problem.replace(frame="rotating", effects=(), motion=still, loads=force, terms={}, outputs={})
    system = compile_system(resting, comm, moving=False)
    q: Array = system.zeros()
    F, done, share = 0.0, 0.0, 1.0
    while done < 1.0:
        target = min(1.0, done + share)
        try:
            q, F = _led(system, target * displacement, q, F, newton)
        except ComputationError as error:
            share /= 2
            if share < SMALLEST_SHARE:
                raise ComputationError(
                    f"no static shape with a tip displacement of {displacement:g} m: the tip was led to "
                    f"{done * displacement:.4g} m; {error.what}",
                    advice="a smaller initial.tip_displacement"
                    + ("" if problem.theory.exact else f", or {richest_advice()}"),
                ) from None
            continue
        done = target
        share *= 1.5
    return q


def _led(system: System, displacement: float, q: Array, F: float, newton: Newton) -> tuple[Array, float]:
    """Return (q, F) of the equilibrium with u_2(L) = displacement (m), from that of another displacement."""
    tip, x = system.structure.tip_values, np.append(q, F)

    def correction(before: Array | None) -> Array:
        q, F = x[:-1], float(x[-1])
        system.set_time(0.0, load_factor=F + 1.0)
        loaded = system.residual().copy()
        system.set_time(0.0, load_factor=F)
        residual = system.residual()
        loaded.axpy(-1.0, residual)
        solver = DirectSolver(system.tangent(1.0, 0.0, 0.0, before)[0])
        dq, per_force = system.local(solver.solve(residual)), system.local(solver.solve(loaded))
        if tip(per_force)[1] == 0.0:
            raise ComputationError("a force at the tip does not move it by anything above round-off")
        dF = (displacement - tip(q)[1] - tip(dq)[1]) / tip(per_force)[1]
        return np.append(dq + dF * per_force, dF)

    newton.solve(limited(system, x, correction, soon=0), lambda: float(system.size(x[:-1])))
    check_inside_out(system)
    return x[:-1], float(x[-1])
