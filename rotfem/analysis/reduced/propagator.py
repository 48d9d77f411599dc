"""Exact solution of M a + C v + K q + f(t) = 0 with constant matrices, where f is a polynomial between two times.

With x = (q, v), ẋ = A x + g(t) and A = X Λ X⁻¹, the modal coordinates z = X⁻¹ x of an interval of length h follow

    z(t + h) = e^{λh} z(t) + Σ_d h d! φ_{d+1}(λh) g_d,    f(t + τh) = Σ_d f_d τ^d,

with φ_{d+1}(z) = (φ_d(z) − 1/d!)/z and φ_0 = exp (Hochbruck & Ostermann 2010, eq. 2.11).
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial

import numpy as np
import numpy.typing as npt

from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

#: Where what drives the system is read in an interval: cubics through these are what is solved for exactly.
POINTS = np.array([0.0, 0.5 * (1 - np.sqrt(0.2)), 0.5 * (1 + np.sqrt(0.2)), 1.0])
_CUBIC = np.linalg.inv(np.vander(POINTS, increasing=True))

#: How far a cubic may be off what it stands for, relative to the largest value, and halvings that make it so.
CLOSE, HALVINGS = 1e-9, 8

#: |z| below which φ is summed as its power series, and the terms of that.
NEAR, TERMS = 1.0, 20

#: Digits to which the lengths of intervals agree that are solved as one; those of rows do, but for rounding.
ALIKE = 12

#: Condition of the eigenvectors from which modal coordinates lose too many digits.
DEPENDENT = 1e9


class Propagator:
    """The exact solution of equations with constant matrices.

    Args:
        M, C, K: shape (m, m).

    Raises:
        ComputationError: the modes are too nearly dependent for modal coordinates.
    """

    def __init__(self, M: Array, C: Array, K: Array):
        self.size = m = len(M)
        inverse = np.linalg.inv(M)
        A = np.block([[np.zeros((m, m)), np.eye(m)], [-inverse @ K, -inverse @ C]])
        # in units in which rates are as large as coordinates
        unit = np.concatenate([np.ones(m), np.full(m, np.sqrt(np.linalg.norm(K) / np.linalg.norm(M)))])
        self.values, vectors = np.linalg.eig(A * (unit / unit[:, None]))
        if np.linalg.cond(vectors) > DEPENDENT:
            raise ComputationError("the modes of the reduced model are nearly dependent")
        self._in = np.linalg.inv(vectors) / unit
        self._out = unit[:, None] * vectors
        self._forced = -self._in[:, m:] @ inverse

    def solve(self, grid: Array, forces: Array, q: Array, v: Array) -> tuple[Array, Array]:
        """Return coordinates and rates (n + 1, m) at the times of a grid.

        Args:
            grid: times between which the force is a cubic, (n + 1,), s.
            forces: coefficients f_d of the cubics, shape (n, 4, m).
            q: coordinates at the first time, (m,).
            v: rates there, (m,).
        """
        h = np.diff(grid)
        z = np.empty((len(grid), 2 * self.size), dtype=complex)
        z[0] = self._in @ np.concatenate([q, v])
        _, one, same = np.unique(np.round(h / h.max(), ALIKE), return_index=True, return_inverse=True)
        phi = [values[same] for values in functions(h[one, None] * self.values, len(POINTS))]
        driven = forces @ self._forced.T
        added = sum(h[:, None] * factorial(d) * phi[d + 1] * driven[:, d] for d in range(len(POINTS)))
        growth = phi[0]
        for k in range(len(h)):
            z[k + 1] = growth[k] * z[k] + added[k]
        x = (z @ self._out.T).real
        return x[:, : self.size], x[:, self.size :]


def functions(z: Complex, most: int) -> list[Complex]:
    """Return φ_0 … φ_most at the entries of an array."""
    near = np.abs(z) < NEAR
    safe = np.where(near, 1.0, z)
    small = np.where(near, z, 0.0)
    out = [np.exp(z)]
    for k in range(most):
        series = sum(small**j / factorial(j + k + 1) for j in range(TERMS))
        out.append(np.where(near, series, (out[k] - 1 / factorial(k)) / safe))
    return out


def cubics(factors: Callable[[Array], Array], nodes: Callable[..., Array], grid: Array) -> tuple[Array, Array, float]:
    """Return a refined grid, coefficients of cubics on it that stand for functions of time, and how far they are off.

    Args:
        factors: times (n,) ↦ values (n, k).
        nodes: (begin, end, shares) ↦ times of shares of intervals (n, shares).
        grid: times between which the functions are smooth.

    Returns:
        Grid (n + 1,), coefficients (n, 4, k), relative error.
    """
    shares = np.append(POINTS, [0.5])
    off = 0.0
    for halving in range(HALVINGS + 1):
        begin, end = grid[:-1], grid[1:]
        t = nodes(begin, end, shares)
        values = factors(t.ravel()).reshape(len(begin), len(shares), -1)
        coefficients = np.einsum("dj,njk->ndk", _CUBIC, values[:, :-1])
        middle = np.einsum("d,ndk->nk", 0.5 ** np.arange(len(POINTS)), coefficients)
        size = np.maximum(np.abs(values).max(axis=(0, 1)), 1e-300)
        each = np.max(np.abs(middle - values[:, -1]) / size, axis=1, initial=0.0)
        off = float(each.max(initial=0.0))
        if off <= CLOSE or halving == HALVINGS:
            break
        far = each > CLOSE
        grid = np.union1d(grid, 0.5 * (begin[far] + end[far]))
    return grid, coefficients, off
