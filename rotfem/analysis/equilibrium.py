"""Relative equilibria: the steady state of a constant spin, and the static shape of a tip displacement.

Speed and loads are raised together in steps. Whether the equilibrium is stable is asked of the result
(`rotfem.analysis.stability`).

Round-off of the stiffness may spoil a linear solution. K is summed once, and what rounding did to it stays: the work of
its forces on a displacement q is in error by up to |qᵀ δK q|, and so is, relative to qᵀ K q, the compliance. Nonlinear
theories evaluate their forces at every state from strains, whose round-off is another one each time.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.equations.compiled import compile_system
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.loads import Load, Loads, Shapes, Term
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import richest
from rotfem.numerics.eigenproblem import Pencil, RoundOff
from rotfem.numerics.linear import SMALL, DirectSolver, negative_count, symmetric
from rotfem.numerics.newton import REACH, Newton
from rotfem.numerics.projection import sparse_part
from rotfem.structures.reference_rotation import BeyondReach
from rotfem.units import speed_text

Array = npt.NDArray[np.float64]

#: Smallest step, as a part of the whole load: within it bends the path of a column with an imperfection of 3e-7 of its
#: buckling load. One that a regular equilibrium asks for.
SMALLEST_SHARE, REGULAR_SHARE = 1e-5, 1e-3

#: Bound of the relative error by round-off from which it is warned of, and the largest that is given as a number.
ROUNDED_OFF, LOST = 1e-2, 1.0


def steady_state(
    system: System,
    omega: float,
    newton: Newton,
    start: Array | None = None,
    notes: list[str] | None = None,
) -> Array:
    """Return q (local dof array) with F(q, 0, 0) = 0 at constant speed: the equilibrium in the rotating frame.

    Speed and loads are raised together, in one step where Newton allows and in smaller ones where not; the loads at the
    full speed on hinges, and where tension by spin is all the stiffness there is, as of a tether. The state is left in
    the functions of the system. With a `start`, the equilibrium at a speed nearby, the whole load is applied at once;
    `notes` receives remarks on the way.
    """
    notes = [] if notes is None else notes
    loose = ", ".join(hinge.name for hinge in system.structure.hinges.values() if hinge.stiffness == 0.0)
    if start is not None:
        with suppress(ComputationError):
            return counted(system, omega, balance(system, omega, 1.0, start, newton), newton)
    try:
        if system.linear:
            return balance(system, omega, 1.0, system.zeros(), newton)
        return let_go(system, omega, newton) if loose else _grown(system, omega, newton, notes)
    except ComputationError as error:
        if loose:
            raise ComputationError(
                f"nothing holds the root's hinge ({loose}): no steady state at {speed_text(omega)}: the load turns it, "
                f"and no equilibrium was found that it turns to ({error.what})",
                advice=f"structure.root.{loose.partition(',')[0]}_stiffness, a speed whose tension holds it, "
                f"or {less(system)}",
            ) from error
        if system.linear or not _compliance_lost(system, omega):
            raise
        why = "round-off decides, as axial or shear stiffness outweighs what bends beyond its digits"
        advice = "stiffnesses closer to each other, or fewer elements"
        raise ComputationError(f"{error.what}; {why}", error.time, advice) from error


def _compliance_lost(system: System, omega: float) -> bool:
    """Return whether round-off of the stiffness is all of what the load does to the structure before it grows."""
    system.count_rotations_from(None)
    set_load(system, omega, 1.0)
    system.set_state(system.zeros())
    K, load = system.matrix(1.0, 0.0, 0.0, 1.0), system.residual()
    try:
        return rounded_compliance(system, K, system.local(DirectSolver(K).solve(load))) >= LOST
    except ComputationError:
        return False


def _grown(system: System, omega: float, newton: Newton, notes: list[str]) -> Array:
    """Return the equilibrium at full load that the growing load leads to, in a nonlinear theory."""
    try:
        found = raised(system, omega, newton)
    except Unbegun as error:
        try:
            return _loaded_at_speed(system, omega, newton)
        except ComputationError:
            raise error from None
    if found.least < REGULAR_SHARE:
        if _compliance_lost(system, omega):
            raise ComputationError(f"no steady state at {speed_text(omega)}: steps of the load were cut for ever")
        system.count_rotations_from(found.reference)
        set_load(system, omega, 1.0)
        system.set_state(found.q)
    if found.critical is not None:
        notes.append(f"the stiffness gets a negative eigenvalue at {found.critical:.6g} of the load: a bifurcation")
    return found.q


def check_steady(problem: Problem) -> None:
    """Refuse what has no steady state in the rotating frame: gravity across the spin axis, which turns in it."""
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
    system.check_inside_out()
    return x[:-1], float(x[-1])


# --- steps of the load ------------------------------------------------------------------------------------------------


def less(system: System) -> str:
    """Return what helps where there is no equilibrium: another theory only where there is one that holds farther."""
    exact = system.model.theory.exact
    return "a lower speed or load, " + (
        "or a stiffer section" if exact else f"a stiffer section, or {richest_advice()}"
    )


def richest_advice() -> str:
    """Return the advice to take the theory that holds for any deflection."""
    return f'model.theory = "{richest().name}", which holds at large deflection'


def recounted(system: System, q: Array) -> Array:
    """Return a shape q (local dof array) with rotations that are counted from it."""
    assert system.structure.turns is not None
    q = q.copy()
    system.count_rotations_from(system.structure.turns.reset(q, np.zeros_like(q), []))
    return q


@dataclass
class Raised:
    """Where a growing load has led.

    Attributes:
        q: the equilibrium at full load, a local dof array.
        reference: what its rotations are counted from.
        critical: first share of the load at which the stiffness gets a negative eigenvalue; None without one.
        least: smallest step that was tried, as a part of the whole load.
    """

    q: Array
    reference: Any
    critical: float | None = None
    least: float = 1.0


class Unbegun(ComputationError):
    """No share of the load has an equilibrium that is found from the undeformed structure."""


def set_load(system: System, omega: float, share: float) -> None:
    """Write a share of the load into a system: of the square of a speed (rad/s), and of loads and gravity."""
    system.set_time(0.0, system.motion.at_speed(float(np.sqrt(share)) * omega), share)


def _loaded_at_speed(system: System, omega: float, newton: Newton) -> Array:
    """Return the stable equilibrium at full load that is next to that at full speed without loads.

    Tension by spin may be all the stiffness there is, as of a tether: then a small load at a small speed moves it far.
    """
    system.count_rotations_from(None)
    alone = Newton(newton.tolerance, newton.max_iterations)  # how a stretch converges says nothing of bending
    q = balance(system, omega, 0.0, system.zeros(), alone, spun=True)
    q = balance(system, omega, 1.0, q, newton)
    if newton.wandered or negative_count(system.tangent(1.0, 0.0, 0.0)[0], sure=True) != 0:
        raise ComputationError("the equilibrium is not next to that without loads, or not stable")
    return counted(system, omega, q, newton)


def raised(system: System, omega: float, newton: Newton) -> Raised:
    """Return the equilibrium at full load, in one step or by halved ones.

    Where there are several equilibria, a step may end at any of them. So a step is halved, too, where an increment of
    Newton's method was beyond its tangent, where the step turns back on the one before, or where the stiffness gets a
    negative eigenvalue (Sylvester): then it has passed a critical point, or left the path. What remains of that at the
    smallest step is a bifurcation of the path itself, beyond which it is unstable and no further ones are looked for.
    """
    system.count_rotations_from(None)
    q, done, share, least = system.zeros(), 0.0, 1.0, 1.0
    reference, critical, before = system.reference, None, None
    while done < 1.0:
        target, afresh = min(1.0, done + share), False
        try:
            new = balance(system, omega, target, q, newton)
            wandered = newton.wandered
            negative = negative_count(system.tangent(1.0, 0.0, 0.0)[0], sure=True) or 0
            new = counted(system, omega, new, newton, target)
        except BeyondReach as error:
            turns = system.structure.turns
            failure, afresh = error.what, turns is not None and turns.reached(q) > 0.3
        except ComputationError as error:
            failure = error.what
        else:
            moved = system.size(system.structure.total(new)) > newton.tolerance  # else it has one state at all speeds
            crossed = moved and critical is None and negative > 0
            way = new - q if system.reference is reference else None
            turned = way is not None and before is not None and system.product(way, before) < 0.0
            if not wandered and (not (crossed or turned) or share < 2 * SMALLEST_SHARE):
                critical = target if crossed else critical
                q, done, share, reference, before = new, target, 2 * share, system.reference, way
                continue
            failure = "the next one is not near it"
        share /= 2
        least = min(least, share)
        if share < SMALLEST_SHARE:
            raise _ended(system, omega, q, done, failure, reference)
        system.count_rotations_from(reference)
        if afresh:
            q = recounted(system, q)
            reference = system.reference
    if least < 1.0:  # what is known of increments at other loads has ended the iterations there
        q = balance(system, omega, 1.0, q, Newton(newton.tolerance, newton.max_iterations))
    system.structure.check_range(q)
    return Raised(np.asarray(q), reference, critical, least)


def _ended(system: System, omega: float, q: Array, done: float, failure: str, reference: Any) -> ComputationError:
    """Return the error of a load that could be raised no further than to a share, with the equilibrium q there."""
    system.count_rotations_from(reference)
    system.set_state(q)
    stretch = system.model.stretches()[1]
    why = f"beyond it the structure snaps, or there is none ({failure})"
    if stretch >= 2.0:
        why = f"it is stretched to {stretch:.3g} times its length there, and ever farther by more load"
    where = f" ({speed_text(float(np.sqrt(done)) * omega, 4)})" * bool(omega)
    what = f"no steady state at {speed_text(omega)}: the last equilibrium was at {done:.6g} of the load{where}; {why}"
    return (ComputationError if done else Unbegun)(what, advice=less(system))


#: Powers of ten by which springs that hold hinges weaken before they let go, and the smallest step of the power.
LET_GO, SMALLEST_POWER = 12.0, 1e-2


def let_go(system: System, omega: float, newton: Newton) -> Array:
    """Return the equilibrium of a structure whose root is free to turn: springs hold its hinges, weaken, and let go.

    At q = 0 a hinge without a spring has no stiffness: it comes of the tension by spin and loads.
    """
    springs = [spring.stiffness for spring in system.structure.springs()]
    given = [float(constant.value) for constant in springs]

    def hold(stiffness: float) -> None:
        for constant, own in zip(springs, given, strict=True):
            constant.value = max(own, stiffness)

    system.count_rotations_from(None)
    set_load(system, omega, 0.0)
    system.set_state(system.zeros())
    stiff = float(system.tangent(1.0, 0.0, 0.0)[0].norm(norm_type=3))  # largest sum of a row: far above that of a turn
    power, step = 0.0, 1.0
    try:
        hold(stiff)
        q = raised(system, omega, newton).q
        while power < LET_GO:
            reference, weaker = system.reference, power + step
            hold(stiff * 10.0**-weaker if weaker < LET_GO else 0.0)
            try:
                q = counted(system, omega, balance(system, omega, 1.0, q, newton), newton)
                power, step = weaker, min(2 * step, 1.0)
            except ComputationError:
                step /= 2
                if step < SMALLEST_POWER:
                    raise
                system.count_rotations_from(reference)
        return q
    finally:
        hold(0.0)


def counted(system: System, omega: float, q: Array, newton: Newton, share: float = 1.0) -> Array:
    """Return a balanced state, where its rotations are large counted from a shape near it and balanced again."""
    system.check_reach(q)
    turns = system.structure.turns
    if turns is None or not turns.is_due(q):
        return q
    return balance(system, omega, share, recounted(system, q), newton)


def balance(
    system: System, omega: float, share: float, guess: Array, newton: Newton, checked: bool = True, spun: bool = False
) -> Array:
    """Solve F(q, 0, 0) = 0 by Newton's method at a share of the load, with `spun` of that but the speed."""
    set_load(system, omega, share)
    if spun:
        system.set_time(0.0, system.motion.at_speed(omega), share)
    q = guess.copy()

    solver: DirectSolver | None = None

    def correction(before: Array | None) -> Array:
        nonlocal solver
        b, A = system.residual(), system.tangent(1.0, 0.0, 0.0, before)[0]
        solver = solver or DirectSolver(A, symmetric=sparse_part(A).getSize()[0] > SMALL and symmetric(A))
        solver.refresh(A)
        return system.local(solver.solve(b))

    increment = limited(system, q, correction)
    if system.linear:
        if not np.isfinite(increment(True)[0]) or (system.structure.hinges and conditioning(system, q) >= LOST):
            raise ComputationError(f"no steady state at {speed_text(omega)}: the stiffness is singular")
        newton.iterations += 1
    else:
        newton.solve(increment, lambda: system.size(q))
        if checked:
            system.check_inside_out()
    return q


def limited(
    system: System, x: Array, correction: Callable[[Array | None], Array], soon: int = 4
) -> Callable[[bool], tuple[float, bool]]:
    """Return an iteration of Newton's method, which corrects x by no more than REACH and returns the size."""
    n = len(system.q.x.array)
    before, followed = x[:n].copy(), 0

    def increment(renewed: bool = True) -> tuple[float, bool]:
        nonlocal before, followed
        system.set_state(x[:n])
        change = correction(before if followed >= soon else None)
        size, before, followed = float(system.size(change[:n])), x[:n].copy(), followed + 1
        x[:] += change if system.linear or not size > REACH else change * (REACH / size)
        system.set_state(x[:n])
        return size, False

    return increment


# --- round-off of the stiffness ---------------------------------------------------------------------------------------


def conditioning(system: System, q: Array, time: float = np.inf) -> float:
    """Return a bound of the relative error that round-off of K makes in a state of a linear theory; 0 of others."""
    if not system.linear:
        return 0.0
    system.set_state(q)
    return rounded_compliance(system, system.matrix(1.0, 0.0, 2.0 / time**2, 1.0), q)


def rounded_compliance(system: System, K: Any, q: Array) -> float:
    """Return |qᵀ δK q| / qᵀ K q of a displacement q, with a bound of the round-off δK of a stiffness."""
    pencil = Pencil(K, K, K)
    X = q[: K.getLocalSize()[0], None].astype(complex)
    local = float(np.real(np.sum(X * pencil.apply(K, X))))
    work = abs(system.comm.allreduce(local) if system.comm.size > 1 else local)
    return float(RoundOff(pencil).stiffness(X, X)[0]) / work if work > 0.0 else 0.0


def rounding_message(bound: float) -> str:
    """Return a warning of an error bound; empty of one that is small."""
    if not bound > ROUNDED_OFF:
        return ""
    how = f"by up to {100 * bound:.2g} %" if bound < LOST else "beyond recognition"
    return (
        f"unreliable: round-off may have changed the displacements {how}, as axial or shear stiffness outweighs what "
        f'bends; fewer elements, cells less oblong, or model.theory = "{richest().name}", which sums its strains anew '
        "in every iteration"
    )
