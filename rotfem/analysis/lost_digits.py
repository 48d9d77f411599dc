"""How far round-off of the stiffness can have put off the displacements of a linear theory.

K is summed once, and what rounding did to it stays: the work that its forces do on a displacement q is off by up to
|qᵀ δK q|, and so is, relative to qᵀ K q, the compliance. Nonlinear theories evaluate their forces at every state from
strains, whose round-off is another one each time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.theories import richest
from rotfem.numerics.bounds import RoundOff
from rotfem.numerics.eigenproblem import Pencil

Array = npt.NDArray[np.float64]

#: Relative error bound from which it is warned of.
NOTICED = 1e-2

#: Largest error bound that is told as a number.
KNOWN = 1.0


def lost_digits(system: Any, q: Array) -> float:
    """Return a bound of the relative error that round-off of K makes in a state of a linear theory; 0 of others.

    Args:
        system: equations of motion of the structure, hub held, with the time of the state set.
        q: the state, a local dof array.
    """
    if not system.linear:
        return 0.0
    system.set_state(q)
    K = system.matrix(1.0, 0.0, 0.0, 1.0)
    pencil = Pencil(K, K, K)
    X = q[: K.getLocalSize()[0], None].astype(complex)
    local = float(np.real(np.sum(X * pencil.apply(K, X))))
    work = abs(system.comm.allreduce(local) if system.comm.size > 1 else local)
    return float(RoundOff(pencil).stiffness(X, X)[0]) / work if work > 0.0 else 0.0


def said_of(bound: float) -> str:
    """Return what is to be said of an error bound; empty of one that is small."""
    if not bound > NOTICED:
        return ""
    how = f"by up to {100 * bound:.2g} %" if bound < KNOWN else "beyond recognition"
    return (
        f"unreliable: round-off may have changed the displacements {how}, as axial or shear stiffness outweighs what "
        f'bends; fewer elements, cells less oblong, or model.theory = "{richest().name}", which sums its strains anew '
        "in every iteration"
    )
