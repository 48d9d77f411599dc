"""Equilibria at a share of speed squared and loads, and the way to the full load in steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.conditioning import KNOWN, conditioning
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import richest
from rotfem.numerics.linear import DirectSolver, negative_count
from rotfem.numerics.newton import REACH, Newton
from rotfem.structures.reference_rotation import BeyondReach
from rotfem.units import speed_text

Array = npt.NDArray[np.float64]

#: Smallest step, as a part of the whole load: within it bends the path of a column with an imperfection of 3e-7 of its
#: buckling load. One that a regular equilibrium asks for.
SMALLEST_SHARE, REGULAR_SHARE = 1e-5, 1e-3


def less(system: System) -> str:
    """Return what helps where there is no equilibrium: another theory only where there is one that holds farther."""
    exact = system.model.theory.exact
    return "a lower speed or load, " + (
        "or a stiffer section" if exact else f"a stiffer section, or {richest_advice()}"
    )


def richest_advice() -> str:
    """Return the advice to take the theory that holds for any deflection."""
    return f'model.theory = "{richest().name}", which holds at large deflection'


def recounted(system: Any, q: Array, change: Array | None = None) -> tuple[Array, Array]:
    """Return a shape q (local dof array) and a small change of it with rotations that are counted from q itself."""
    q, rate = q.copy(), np.zeros_like(q) if change is None else change.copy()
    system.count_rotations_from(system.structure.turns.reset(q, rate, [np.zeros_like(q)]))
    return q, rate


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
            q, _ = recounted(system, q)
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
    return balance(system, growth, share, recounted(system, q)[0], newton)


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
        if not np.isfinite(increment(True)[0]) or (system.structure.hinges and conditioning(system, q) >= KNOWN):
            raise ComputationError(f"no steady state at {speed_text(growth.omega)}: the stiffness is singular")
        newton.iterations += 1
    else:
        newton.solve(increment, lambda: system.size(q))
        if checked:
            check_inside_out(system)
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


def check_inside_out(system: System) -> None:
    """Refuse a state that is set in a system and turned inside out."""
    if not system.linear and system.model.inside_out():
        raise ComputationError("Newton met a state that is turned inside out (an axial strain below −1)")
