"""Equilibria at a share of speed squared and loads, and the way to the full load in steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.turning import reached, recounted
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import richest
from rotfem.numerics.linear import DirectSolver, Increment
from rotfem.numerics.newton import REACH, Newton
from rotfem.structures.datum import BeyondReach

Array = npt.NDArray[np.float64]

#: Newton iterations after which the stresses of the last correction are worth compiling a tangent with.
SOON = 4

#: A continuation that must cut its steps below this share of the whole has met a limit point.
SMALLEST_SHARE = 1e-3

#: Part of their range from which rotations are counted afresh where the next step of the load leads out of it.
NEAR = 0.3


def less(system: System) -> str:
    """Return what helps where there is no equilibrium: another theory only where there is one that holds farther."""
    exact = system.model.theory.exact
    return "a lower speed or load, " + (
        "or a stiffer section" if exact else f"a stiffer section, or {richest_advice()}"
    )


def richest_advice() -> str:
    """Return the advice to take the theory that holds for any deflection."""
    return f'model.theory = "{richest().name}", which holds at large deflection'


@dataclass
class Raised:
    """Where a growing load has led.

    Attributes:
        q: the equilibrium at full load, a local dof array.
        datum: what its rotations are counted from.
        sure: whether it is the one of the growing load; not, where Newton's method wandered to it.
    """

    q: Array
    datum: Any
    sure: bool = True


def raised(system: System, omega: float, newton: Newton) -> Raised:
    """Return the equilibrium at full load, in one step or by halved ones.

    Where there are several equilibria, a way that wanders may end at any of them. Then smaller steps are taken, whose
    ways do not, and where the load cannot be raised by them, the first equilibrium that was found is returned.

    Raises:
        ComputationError: none was found; says how far the load got.
    """
    datum: Any = None
    system.count_rotations_from(datum)
    q, done, share = system.zeros(), 0.0, 1.0
    other: Raised | None = None
    while done < 1.0:
        target = min(1.0, done + share)
        try:
            new = balance(system, omega, target, q, newton)
            wandered = newton.wandered
            new = counted(system, omega, target, new, newton)
        except BeyondReach as error:
            failure, afresh = error.what, reached(system, q) > NEAR
        except ComputationError as error:
            failure, afresh = error.what, False
        else:
            if not wandered:
                q, done, share, datum = new, target, 1.5 * share, system.datum
                continue
            failure, afresh = "Newton's way was a long one", False
            if other is None and target == 1.0:
                other = Raised(new, system.datum, False)
        share /= 2
        if share < SMALLEST_SHARE:
            if other is not None:
                return other
            raise ComputationError(
                f"no steady state at {omega:g} rad/s: the last equilibrium was at {done:.3g} of the load "
                f"({np.sqrt(done) * omega:.4g} rad/s); {failure}",
                advice=less(system),
            )
        system.count_rotations_from(datum)
        if afresh:
            q, _ = recounted(system, q)
            datum = system.datum
    system.structure.check_range(q)
    return Raised(np.asarray(q), datum)


def from_held_root(system: System, omega: float, newton: Newton) -> Array | None:
    """Return the equilibrium with hinges that the spin holds, from that of a root held by springs; None if it fails.

    At q = 0 a hinge without a spring has no stiffness: it comes of the tension that the spin makes.

    Args:
        system: equations of motion of a nonlinear theory, the hub held.
        omega: speed, rad/s.
        newton: iteration control.
    """
    constants = [spring.stiffness for spring in system.structure.springs()]
    given = [float(constant.value) for constant in constants]
    system.count_rotations_from(None)
    system.set_time(0.0, system.motion.at_speed(0.0), 0.0)
    system.set_state(system.zeros())
    A, _ = system.tangent(1.0, 0.0, 0.0)
    held = float(A.norm(norm_type=3))  # the largest sum of a row: far above the stiffness of a turn
    try:
        for constant, own in zip(constants, given, strict=True):
            constant.value = max(own, held)
        q = raised(system, omega, newton).q
        for constant, own in zip(constants, given, strict=True):
            constant.value = own
        return balance(system, omega, 1.0, q, newton)
    except ComputationError:
        return None
    finally:
        for constant, own in zip(constants, given, strict=True):
            constant.value = own


def counted(system: System, omega: float, share: float, q: Array, newton: Newton) -> Array:
    """Return a balanced state, where its rotations are large counted from a shape near it and balanced again.

    Raises:
        BeyondReach: they have changed too much since the last equilibrium.
        ComputationError: the state could not be balanced again.
    """
    system.check_reach(q)
    turns = system.structure.turns
    if turns is None or not turns.is_due(q):
        return q
    return balance(system, omega, share, recounted(system, q)[0], newton)


def balance(
    system: System, omega: float, share: float, guess: Array, newton: Newton, *, looked_at: bool = True
) -> Array:
    """Solve F(q, 0, 0) = 0 by Newton's method with loads, base acceleration and omega² multiplied by share.

    Args:
        system: equations of motion, the hub held.
        omega: speed, rad/s.
        share: factor of the loads.
        guess: where to start, a local dof array.
        newton: iteration control.
        looked_at: whether a state that is turned inside out is refused.
    """
    motion = system.motion.at_speed(np.sqrt(share) * omega)
    system.set_time(0.0, motion, share)
    q, dx = guess.copy(), Increment(system.V)
    before, followed = q.copy(), 0

    def increment() -> float:
        nonlocal before, followed
        system.set_state(q)
        b = system.residual()
        A, _ = system.tangent(1.0, 0.0, 0.0, before if followed >= SOON else None)
        dq = dx.solve(DirectSolver(A), b)
        size, before, followed = float(system.size(dq)), q.copy(), followed + 1
        q[:] += dq if system.linear or not size > REACH else dq * (REACH / size)
        system.set_state(q)
        return size

    if system.linear:
        if not np.isfinite(increment()):
            raise ComputationError("the stiffness is singular")
        newton.iterations += 1
    else:
        newton.solve(increment, lambda: system.size(q))
        if looked_at and system.model.inside_out():
            raise ComputationError("Newton met a state that is turned inside out (an axial strain below −1)")
    return q
