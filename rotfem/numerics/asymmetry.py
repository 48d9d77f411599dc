"""How far the matrices of a pencil are from symmetric, and from skew ones; no physics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rotfem.numerics.balance import balanced
from rotfem.numerics.linear import SMALL, transposed
from rotfem.numerics.low_rank import sparse_part

if TYPE_CHECKING:
    from rotfem.numerics.eigenproblem import Pencil

#: Random vectors by which norms of large matrices are estimated.
PROBES = 4

#: Relative asymmetry that is round-off of assembly.
ROUND_OFF = 1e-14


def asymmetries(pencil: Pencil) -> dict[str, float]:
    """Return relative ‖M − Mᵀ‖, ‖C + Cᵀ‖ and ‖K − Kᵀ‖ (Frobenius).

    Of large matrices, and of one with a part of low rank, they are estimates from a few random signs r: the mean of
    ‖A r‖² is the norm's square.
    """
    out = {}
    matrices = pencil.M, pencil.C, pencil.K
    with balanced(*matrices, scale=pencil.unknowns):  # else the unit of length would say which entries count
        for name, A, sign in zip("MCK", matrices, (-1.0, 1.0, -1.0), strict=True):
            distance, size = (_distance(A, sign), A.norm()) if sparse_part(A) is A else _by_probes(A, sign)
            out[name] = distance / size if size > 0 else 0.0
    return out


def is_symmetric(A: Any) -> bool:
    """Return whether a PETSc matrix is symmetric to round-off, by random probes."""
    distance, size = _by_probes(A, -1.0)
    return distance <= ROUND_OFF * size


def _distance(A: Any, sign: float) -> float:
    """Return ‖Aᵀ + sign A‖."""
    if A.getSize()[0] > SMALL:
        return _by_probes(A, sign)[0]
    D = transposed(A)
    D.axpy(sign, A)
    return float(D.norm())


def _by_probes(A: Any, sign: float) -> tuple[float, float]:
    """Return estimates of ‖Aᵀ + sign A‖ and ‖A‖."""
    r, y = A.createVecs()
    z, squares, random = y.duplicate(), np.zeros(2), np.random.default_rng(A.comm.rank)
    for _ in range(PROBES):
        r.array[:] = random.choice([-1.0, 1.0], r.getLocalSize())
        A.mult(r, y)
        A.multTranspose(r, z)
        size = y.norm()
        z.axpy(sign, y)
        squares += z.norm() ** 2, size**2
    distance, size = np.sqrt(squares / PROBES)
    return float(distance), float(size)
