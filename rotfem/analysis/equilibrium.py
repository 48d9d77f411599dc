"""Relative equilibria: the steady state of a constant spin, and the static shape of a tip displacement.

Speed and loads are raised together in steps. Whether the equilibrium is stable is asked of the result
(`rotfem.analysis.stability`).

Round-off of the stiffness may spoil a linear solution. K is summed once, and what rounding did to it stays: the work of
its forces on a displacement q is in error by up to |qᵀ δK q|, and so is, relative to qᵀ K q, the compliance. Nonlinear
theories evaluate their forces at every state from strains, whose round-off is another one each time.
"""

from __future__ import annotations

from collections.abc import Callable
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
from rotfem.numerics.linear import DirectSolver, negative_count
from rotfem.numerics.newton import REACH, Newton
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

    Speed and loads are raised together (on hinges the loads at the full speed), in one step where Newton allows and in
    smaller ones where not; the state is left in the system's functions. With a `start`, the equilibrium at a nearby
    speed, the whole load is applied at once. `notes` receives remarks on the way.
    """
    notes = [] if notes is None else notes
    growth = LoadFactors(omega)
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


def _compliance_lost(system: System, growth: LoadFactors) -> bool:
    """Return whether round-off of the stiffness is all of what the load does to the structure before it grows."""
    q = growth.begin(system)
    growth.set(system, 1.0)
    system.set_state(q)
    K, load = system.matrix(1.0, 0.0, 0.0, 1.0), system.residual()
    try:
        return rounded_compliance(system, K, system.local(DirectSolver(K).solve(load))) >= LOST
    except ComputationError:
        return False


def _grown(system: System, growth: LoadFactors, newton: Newton, notes: list[str]) -> Array:
    """Return the equilibrium at full load that the growing load leads to, in a nonlinear theory."""
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


@dataclass(frozen=True)
class LoadFactors:
    """What grows on the way to an equilibrium: with its share s the square of the speed and the loads, linearly.

    A hinge has no stiffness before the spin is there: then it grows first, and the loads at the full speed.

    Attributes:
        omega: full speed, rad/s.
        spin: shares of Ω² at s = 0 and s = 1.
        load: shares of loads, gravity and base acceleration at s = 0 and s = 1.
        springs: stiffness of the root's springs (N·m/rad) at s = 0 and s = 1, where that changes.
        start: the equilibrium at s = 0; undeformed if None.
    """

    omega: float
    spin: tuple[float, float] = (0.0, 1.0)
    load: tuple[float, float] = (0.0, 1.0)
    springs: tuple[tuple[Any, float, float], ...] = ()
    start: Raised | None = None

    def speed(self, share: float) -> float:
        """Return the speed (rad/s) at a share."""
        part = self.spin[0] + share * (self.spin[1] - self.spin[0])
        if part < 0.0 and self.omega != 0.0:
            raise ComputationError("the square of the speed would have to be negative")
        return float(np.sqrt(max(part, 0.0))) * self.omega

    def set(self, system: System, share: float) -> None:
        """Write speed, loads and springs of a share into a system."""
        for constant, first, last in self.springs:
            constant.value = first + share * (last - first)
        loads = self.load[0] + share * (self.load[1] - self.load[0])
        system.set_time(0.0, system.motion.at_speed(self.speed(share)), loads)

    def begin(self, system: System) -> Array:
        """Return the equilibrium at s = 0, rotations counted as they were there."""
        system.count_rotations_from(None if self.start is None else self.start.reference)
        return system.zeros() if self.start is None else self.start.q.copy()

    def where(self, share: float) -> str:
        """Return a share of the load in words, with its speed where that grows."""
        speed = f" ({speed_text(self.speed(share), 4)})" if self.omega and self.spin[0] != self.spin[1] else ""
        return f"{share:.6g} of the load{speed}"


def raised(system: System, growth: LoadFactors, newton: Newton) -> Raised:
    """Return the equilibrium at full load, in one step or by halved ones.

    Where there are several equilibria, a step may end at any of them. So a step is halved, too, where an increment of
    Newton's method was beyond its tangent, where the step turns back on the one before, or where the stiffness gets a
    negative eigenvalue (Sylvester): then it has passed a critical point, or left the path. What remains of that at the
    smallest step is a bifurcation of the path itself, beyond which it is unstable and no further ones are looked for.
    """
    q, done, share, least = growth.begin(system), 0.0, 1.0, 1.0
    reference, critical, before = system.reference, None, None
    while done < 1.0:
        target, afresh = min(1.0, done + share), False
        try:
            new = balance(system, growth, target, q, newton)
            wandered = newton.wandered
            negative = negative_count(system.tangent(1.0, 0.0, 0.0)[0], sure=True) or 0
            new = counted(system, growth, target, new, newton)
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
            raise _ended(system, growth, q, done, failure, reference)
        system.count_rotations_from(reference)
        if afresh:
            q = recounted(system, q)
            reference = system.reference
    system.structure.check_range(q)
    return Raised(np.asarray(q), reference, critical, least)


def _ended(
    system: System, growth: LoadFactors, q: Array, done: float, failure: str, reference: Any
) -> ComputationError:
    """Return the error of a load that could be raised no further than to a share, with the equilibrium q there."""
    system.count_rotations_from(reference)
    system.set_state(q)
    stretch = system.model.stretches()[1]
    why = f"beyond it the structure snaps, or there is none ({failure})"
    if stretch >= 2.0:
        why = f"it is stretched to {stretch:.3g} times its length there, and ever farther by more load"
    what = f"no steady state at {speed_text(growth.omega)}: the last equilibrium was at {growth.where(done)}; {why}"
    return ComputationError(what, advice=less(system))


def on_hinges(system: System, omega: float, newton: Newton) -> LoadFactors:
    """Return how the load of a structure grows whose root is free to turn: from an equilibrium that holds its hinges.

    At q = 0 a hinge without a spring has no stiffness: it comes of the tension that the spin makes, and of loads where
    nothing spins. So springs hold the root first, and let it go; the loads grow at the full speed.
    """
    springs = [spring.stiffness for spring in system.structure.springs()]
    given = [float(constant.value) for constant in springs]
    load = 0.0 if omega else 1.0

    def between(first: float, last: float) -> tuple[tuple[Any, float, float], ...]:
        return tuple((k, max(own, first), max(own, last)) for k, own in zip(springs, given, strict=True))

    q = LoadFactors(0.0).begin(system)
    LoadFactors(0.0).set(system, 0.0)
    system.set_state(q)
    stiff = float(
        system.tangent(1.0, 0.0, 0.0)[0].norm(norm_type=3)
    )  # the largest sum of a row: far above that of a turn
    try:
        start = raised(system, LoadFactors(omega, load=(0.0, load), springs=between(stiff, stiff)), newton)
        turn = float(
            system.comm.allreduce(np.max(np.abs(start.q[system.structure.hinged_unknowns()]), initial=0.0), MPI.MAX)
        )
        soft = min(1.0, turn / 0.1) * stiff  # which lets the root swing by 0.1 rad when they let go
        start = raised(system, LoadFactors(omega, (1.0, 1.0), (load, load), between(soft, 0.0), start), newton)
    except ComputationError:
        return LoadFactors(omega)
    finally:
        for constant, own in zip(springs, given, strict=True):
            constant.value = own
    return LoadFactors(omega, (1.0, 1.0), (load, 1.0), start=start)


def counted(system: System, growth: LoadFactors, share: float, q: Array, newton: Newton) -> Array:
    """Return a balanced state, where its rotations are large counted from a shape near it and balanced again."""
    system.check_reach(q)
    turns = system.structure.turns
    if turns is None or not turns.is_due(q):
        return q
    return balance(system, growth, share, recounted(system, q), newton)


def balance(
    system: System, growth: LoadFactors, share: float, guess: Array, newton: Newton, *, checked: bool = True
) -> Array:
    """Solve F(q, 0, 0) = 0 by Newton's method at a share of speed squared and loads."""
    growth.set(system, share)
    q = guess.copy()

    def correction(before: Array | None) -> Array:
        b = system.residual()
        return system.local(DirectSolver(system.tangent(1.0, 0.0, 0.0, before)[0]).solve(b))

    increment = limited(system, q, correction)
    if system.linear:
        if not np.isfinite(increment(True)[0]) or (system.structure.hinges and conditioning(system, q) >= LOST):
            raise ComputationError(f"no steady state at {speed_text(growth.omega)}: the stiffness is singular")
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
