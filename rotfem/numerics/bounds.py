"""How far the eigenvalues of a pencil can be from those of the exact one, by what round-off did to it; no physics.

To first order a change of the matrices moves a simple eigenvalue by

    δλ = −y^H (λ² δM + λ δC + δK) x / n,   n = y^H (2λ M + C) x

(Tisseur 2000, section 2.2). The solver's part is the residual r = (λ² M + λ C + K) x; −y^H r/n is taken off, which
leaves what is of second order in |y|ᵀ|r|/|n λ|.

What rounding did to K when it was assembled, no backward error shows. An entry of K is a sum over quadrature points of
products that the diagonal bounds, |Σ B_i D B_j| ≤ √(K_ii K_jj), so its error is a few units of round-off of that, and
not of what is left of it. Entries of one row err at random, rows alike in all elements: squares are summed along a row,
and rows are added up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

if TYPE_CHECKING:
    from rotfem.numerics.eigenproblem import Pencil

Array = npt.NDArray[Any]

#: Units of round-off in an entry of an assembled matrix, in those of √(K_ii K_jj): sums over quadrature points.
ROUNDED = 2 * float(np.finfo(np.float64).eps)

#: Largest bound that is told; what is above it is not known at all.
LARGEST = 1e6

#: What is left of the residual's part once it is taken off: at most this times its square, of isolated modes.
SECOND = 10.0

#: Relative distance of λ² within which two eigenvalues are one, or a conjugate pair.
SAME_MODE = 1e-3

#: Part of an eigenvalue above which a correction says that its vectors are none.
TRUSTED = 1e-4


class RoundOff:
    """Round-off of the matrices of a pencil, as it acts on pairs of vectors.

    Args:
        pencil: M, C and K.
        sizes: √ of the stiffness that entries are sums of, one for each owned unknown; by default √|K_ii|.
        factors: part of K whose entries are no sums, but rounded relative to themselves, a PETSc matrix; None without.
    """

    def __init__(self, pencil: Pencil, sizes: Array | None = None, factors: Any = None):
        self.pencil, self.factors = pencil, factors
        self.sizes = np.sqrt(np.abs(pencil.K.getDiagonal().array)) if sizes is None else sizes

    def stiffness(self, Y: Array, X: Array) -> Array:
        """Return a bound of |y^H δK x| for the columns of Y and X (owned unknowns), over all ranks, shape (m,)."""
        squares = (self.sizes[:, None] * np.abs(X)) ** 2
        rows = self.sizes[:, None] * np.sqrt(self._along_rows(squares))
        if self.factors is not None:
            rows += np.real(self.pencil.apply(self.factors, np.abs(X).astype(complex)))
        return ROUNDED * self._sum((np.abs(Y) * rows).sum(axis=0))

    def _along_rows(self, values: Array) -> Array:
        """Return for every row the sum of values (n, m) over the columns that K has entries in."""
        K = self.pencil.K
        indptr, indices, data = K.getValuesCSR()
        if self.pencil.comm.size == 1:
            return np.asarray(csr_array((np.ones(len(data)), indices, indptr), shape=K.getSize()) @ values)
        ones = K.duplicate()
        ones.setValuesCSR(indptr, indices, np.ones(len(data)))
        ones.assemble()
        return np.real(self.pencil.apply(ones, values.astype(complex)))

    def _sum(self, local: Array) -> Array:
        return np.asarray(self.pencil.comm.allreduce(local) if self.pencil.comm.size > 1 else local)

    def corrected(self, values: Array, left: Array, right: Array) -> tuple[Array, Array]:
        """Return (λ, bound of |δλ|/|λ|): the eigenvalues without the residual's part, and how far they can be off.

        With left vectors the correction −y^H r/n makes the error of λ one of second order in that of the vectors.
        """
        p = self.pencil
        MX, CX, KX = (p.apply(A, right) for A in (p.M, p.C, p.K))
        n = self._sum(np.sum(left.conj() * (2 * values * MX + CX), axis=0))
        residual = values**2 * MX + values * CX + KX
        with np.errstate(divide="ignore", invalid="ignore"):
            step = -self._sum(np.sum(left.conj() * residual, axis=0)) / n
            values = np.where(np.abs(step) < TRUSTED * np.abs(values), values + step, values)
            residual = values**2 * MX + values * CX + KX
            inertia = np.abs(values) ** 2 * np.abs(MX) + np.abs(values) * np.abs(CX)
            size = np.abs(n * values)
            solved = self._sum(np.sum(np.abs(left) * np.abs(residual), axis=0)) / size
            rounded = (self.stiffness(left, right) + self._sum(np.sum(np.abs(left) * ROUNDED * inertia, axis=0))) / size
            first_order = rounded + solved * np.minimum(1.0, SECOND * solved / isolation(values))
        return values, relative(np.where(np.isfinite(first_order), first_order, np.inf))


def isolation(values: Array) -> Array:
    """Return the distance of every λ² from the next one, relative to |λ²|, shape (m,); large for a small λ."""
    squares = values**2
    distance = np.minimum(*(np.abs(squares[:, None] - other[None, :]) for other in (squares, squares.conj())))
    distance[distance <= SAME_MODE * np.abs(squares)[:, None]] = np.inf
    return np.asarray(distance.min(axis=1) / np.maximum(np.abs(squares), np.finfo(float).tiny))


def relative(first_order: Array) -> Array:
    """Return how far λ can be off, relative to |λ|, by a first-order estimate of it.

    Where λ² is what is perturbed, by a part t of it, λ moves by 1 − √(1 − t), and past t = 1, where it changes from a
    frequency to a growth, by √t. The first-order estimate is t/2.
    """
    t = 2 * first_order
    return np.where(t < 1.0, 1.0 - np.sqrt(np.maximum(1.0 - t, 0.0)), np.sqrt(np.minimum(t, LARGEST**2)))
