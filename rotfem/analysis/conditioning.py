"""What round-off of the stiffness may do to the displacements of a linear theory.

K is summed once, and what rounding did to it stays: the work of its forces on a displacement q is in error by up to
|qᵀ δK q|, and so is, relative to qᵀ K q, the compliance. Nonlinear theories evaluate their forces at every state from
strains, whose round-off is another one each time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import ComputationError
from rotfem.mechanics.theories import richest
from rotfem.numerics.eigenproblem import Pencil, RoundOff

Array = npt.NDArray[np.float64]

#: Bound of the relative error by round-off from which it is warned of, and the largest that is given as a number.
DIGITS, KNOWN = 1e-2, 1.0


class Farthest:
    """Remembers the largest state of a motion of a linear theory.

    Args:
        system: equations of motion.

    Attributes:
        seen: largest component of displacements over the length or of rotations (rad), time (s) and state.
    """

    def __init__(self, system: Any):
        self.system = system
        self.seen: tuple[float, float, Array] = (-1.0, 0.0, system.zeros())

    def __call__(self, q: Array, t: float) -> None:
        """Take note of a state (local dof array) of time t (s)."""
        if not self.system.linear:
            return
        size = float(np.max(self.system.sizes(q), initial=0.0))
        if size > 1.02 * self.seen[0]:  # so that not every state of a growing motion is copied
            self.seen = (size, t, np.array(q))

    def warning(self) -> str:
        """Return the warning of what round-off may have done to the largest state; empty if that is little."""
        size, t, q = self.seen
        if size < 0.0:
            return ""
        system = self.system.held
        state, time = [x.x.array.copy() for x in (system.q, system.v, system.a)], system.time
        system.set_time(t)
        try:
            return said_of(conditioning(system, q[: len(state[0])], t or np.inf))
        except ComputationError:
            return ""
        finally:
            system.set_time(time)
            system.set_state(*state)


def conditioning(system: Any, q: Array, time: float = np.inf) -> float:
    """Return a bound of the relative error that round-off of K makes in a state of a linear theory; 0 of others."""
    if not system.linear:
        return 0.0
    system.set_state(q)
    return rounded_compliance(system, system.matrix(1.0, 0.0, 2.0 / time**2, 1.0), q)


def rounded_compliance(system: Any, K: Any, q: Array) -> float:
    """Return |qᵀ δK q| / qᵀ K q of a displacement q, with a bound of the round-off δK of a stiffness."""
    pencil = Pencil(K, K, K)
    X = q[: K.getLocalSize()[0], None].astype(complex)
    local = float(np.real(np.sum(X * pencil.apply(K, X))))
    work = abs(system.comm.allreduce(local) if system.comm.size > 1 else local)
    return float(RoundOff(pencil).stiffness(X, X)[0]) / work if work > 0.0 else 0.0


def said_of(bound: float) -> str:
    """Return a warning of an error bound; empty of one that is small."""
    if not bound > DIGITS:
        return ""
    how = f"by up to {100 * bound:.2g} %" if bound < KNOWN else "beyond recognition"
    return (
        f"unreliable: round-off may have changed the displacements {how}, as axial or shear stiffness outweighs what "
        f'bends; fewer elements, cells less oblong, or model.theory = "{richest().name}", which sums its strains anew '
        "in every iteration"
    )
