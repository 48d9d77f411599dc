"""Matrices of a pencil in units in which all numbers are of order one; no physics.

With x = D x̂ and λ = u λ̂ the pencil (λ² M + λ C + K) x = 0 becomes that of u² D M D, u D C D and D K D. D makes the
diagonal of K one, whatever the unknowns are measured in, which for a definite K is within a small factor of the best
condition a diagonal can give (van der Sluis 1969). All factors are powers of two, so that nothing is rounded.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def power_of_two(x: Any) -> Any:
    """Return the power of two nearest to each positive number."""
    return 2.0 ** np.round(np.log2(x))


def unknown_scale(M: Any, K: Any, unit: float) -> Any:
    """Return D as a PETSc vector of powers of two: 1/√K_ii, and of an unknown without stiffness 1/(u √M_ii)."""
    d, mass = K.getDiagonal(), M.getDiagonal()
    size = np.abs(d.array)
    size = np.where(size > 0.0, size, unit**2 * np.abs(mass.array))
    d.array[:] = power_of_two(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))
    return d


def balanced(M: Any, C: Any, K: Any, unit: float = 1.0, scale: Any = None) -> tuple[tuple[Any, Any, Any], Array]:
    """Return new matrices u² D M D, u D C D and D K D, and the owned part of D."""
    d = unknown_scale(M, K, unit) if scale is None else scale
    M, C, K = M.copy(), C.copy(), K.copy()
    for A, factor in ((M, unit**2), (C, unit), (K, 1.0)):
        A.diagonalScale(d, d)
        A.scale(factor)
    return (M, C, K), d.array.copy()


def least_frequency(M: Any, K: Any, ksp: Any) -> float:
    """Return about the least |ω| of K x = ω² M x, by two steps of inverse iteration; 0 if M is zero."""
    x, f = K.createVecs()
    y = x.duplicate()
    x.array[:] = np.random.default_rng(x.comm.rank).standard_normal(x.getLocalSize())
    square = 0.0
    for _ in range(2):
        M.mult(x, f)
        size = f.norm()
        if not np.isfinite(size) or size == 0.0:
            return 0.0
        f.scale(1.0 / size)
        ksp.solve(f, x)
        M.mult(x, y)
        kinetic = float(x.dot(y))
        square = abs(float(x.dot(f)) / kinetic) if kinetic != 0.0 else 0.0
    return float(np.sqrt(square)) if np.isfinite(square) else 0.0
