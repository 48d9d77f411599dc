"""The quadratic eigenproblem (λ² M + λ C + K) x = 0 with its left vectors, by SLEPc PEP; no physics.

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

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from slepc4py import SLEPc

from rotfem.errors import ComputationError
from rotfem.numerics.linear import (
    ROUNDED,
    SMALL,
    DirectSolver,
    balanced,
    least_frequency,
    power_of_two,
    transposed,
    unknown_scale,
    use_direct_solver,
)
from rotfem.numerics.projection import sparse_part, summed, times
from rotfem.numerics.ritz import MORE, damped_pairs, gyroscopic_pairs, heavily_damped, quadratic

Array = npt.NDArray[Any]

#: Relative bound of the error of λ above which it is bounded once more, by another factor.
DIGITS_LOST = 1e-5


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
        return np.asarray(ROUNDED * summed(self.pencil.comm, (np.abs(Y) * rows).sum(axis=0)))

    def _along_rows(self, values: Array) -> Array:
        """Return for every row the sum of values (n, m) over the columns that K has entries in."""
        if self.pencil.comm.size > 1:
            return np.real(self.pencil.apply(self._ones, values))
        block = self.pencil.K.getBlockSize()
        nodes = values.reshape(-1, block, values.shape[1]).sum(axis=1)
        return np.repeat(self._ones @ nodes, block, axis=0)

    @cached_property
    def _ones(self) -> Any:
        """One for each entry of K; on one process for each two nodes that it has any of."""
        K = self.pencil.K
        if self.pencil.comm.size > 1:
            ones = K.duplicate()
            indptr, indices, data = K.getValuesCSR()
            ones.setValuesCSR(indptr, indices, np.ones(len(data)))
            ones.assemble()
            return ones
        from scipy.sparse import csr_array  # slow to load, and most commands solve no eigenproblem

        block, (indptr, indices) = K.getBlockSize(), K.getRowIJ()
        lengths = np.diff(indptr)
        nodes = indices[np.repeat(np.arange(len(lengths)) % block == 0, lengths)] // block  # in the first row of each
        starts = np.append(0, np.cumsum(lengths[::block]))
        new = np.diff(nodes, prepend=-1) != 0
        new[starts[:-1]] = True
        return csr_array((np.ones(np.count_nonzero(new)), nodes[new], np.append(0, np.cumsum(new))[starts]))

    def corrected(self, values: Array, left: Array, right: Array) -> tuple[Array, Array]:
        """Return (λ, bound of |δλ|/|λ|): the eigenvalues without the residual's part, and how far they can be off.

        With left vectors the correction −y^H r/n makes the error of λ one of second order in that of the vectors.
        """
        p = self.pencil
        MX, CX, KX = (p.apply(A, right) for A in (p.M, p.C, p.K))
        n = summed(p.comm, np.sum(left.conj() * (2 * values * MX + CX), axis=0))
        residual = values**2 * MX + values * CX + KX
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # λ may be zero
            step = -summed(p.comm, np.sum(left.conj() * residual, axis=0)) / n
            near = np.abs(step) < 1e-4 * np.abs(values)  # farther: no eigenvectors
            values = np.where(near, values + step, values)
            residual = values**2 * MX + values * CX + KX
            inertia = np.abs(values) ** 2 * np.abs(MX) + np.abs(values) * np.abs(CX)
            size = np.abs(n * values)
            solved = summed(p.comm, np.sum(np.abs(left) * np.abs(residual), axis=0)) / size
            rounded = (
                self.stiffness(left, right) + summed(p.comm, np.sum(np.abs(left) * ROUNDED * inertia, axis=0))
            ) / size
            # Of the residual's part, where it is taken off, at most ten times its square is left of isolated modes.
            left_over = solved * np.where(near, np.minimum(1.0, 10.0 * solved / isolation(values)), 1.0)
            if np.any(left_over > DIGITS_LOST):  # residuals of stiff directions: ten times their energy is left
                left_over = np.where(near, np.minimum(left_over, 10.0 * self._energies(residual) / size), left_over)
        first_order = np.where(np.isfinite(rounded + left_over), rounded + left_over, np.inf)
        return values, relative(first_order)

    def _energies(self, residual: Array) -> Array:
        """Return |r^H K⁻¹ r| of residuals, infinite where K is singular."""
        p = self.pencil
        (_, _, K), d = balanced(p.M, p.C, p.K, 1.0, p.unknowns)
        r = d[:, None] * residual
        try:
            solver = DirectSolver(K, pivots=p.pivots)
            x = solver.solve_all(r.real) + 1j * solver.solve_all(r.imag)
        except ComputationError:
            return np.full(r.shape[1], np.inf)
        return np.asarray(np.abs(summed(p.comm, np.sum(r.conj() * x, axis=0))))


def isolation(values: Array) -> Array:
    """Return the distance of every λ² from the next one, relative to |λ²|, shape (m,); large for a small λ."""
    squares = values**2
    distance = np.minimum(*(np.abs(squares[:, None] - other[None, :]) for other in (squares, squares.conj())))
    distance[distance <= 1e-3 * np.abs(squares)[:, None]] = np.inf  # they are one, or a conjugate pair
    return np.asarray(distance.min(axis=1) / np.maximum(np.abs(squares), np.finfo(float).tiny))


def relative(first_order: Array) -> Array:
    """Return how far λ can be off, relative to |λ|, by a first-order estimate of it.

    Where λ² is what is perturbed, by a part t of it, λ moves by 1 − √(1 − t), and past t = 1, where it changes from a
    frequency to a growth, by √t, up to 1e6 (unknown). The first-order estimate is t/2.
    """
    t = 2 * first_order
    return np.where(t < 1.0, 1.0 - np.sqrt(np.maximum(1.0 - t, 0.0)), np.sqrt(np.minimum(t, 1e12)))


def mirrored(values: Array, right: Array) -> Array:
    """Return the left vectors of a conservative pencil, y^H (λ² M + λ C + K) = 0: y(λ) = x(−λ̄).

    Two pairs of one pencil are bi-orthogonal, y_i^H [(λ_i + λ_j) M + C] x_j = 0 for λ_i ≠ λ_j. That follows from the
    two linearised problems (Tisseur & Meerbergen 2001, sections 3.4 and 3.6).
    """
    return _pick(right, values, -values.conj())


def matched(values: Array, others: Array, vectors: Array) -> Array:
    """Return the left vectors from the right ones of the transposed pencil: y(λ) = conj of its vector at λ."""
    return _pick(vectors, others, values).conj()


def _pick(vectors: Array, values: Array, wanted: Array) -> Array:
    """Return the vectors of the values nearest to the wanted ones, each once: double values have two vectors."""
    distance = np.abs(values[None, :] - wanted[:, None])
    index = np.argmin(distance, axis=1)
    if len(np.unique(index)) < len(index):
        from scipy.optimize import linear_sum_assignment  # slow to load

        rows, columns = linear_sum_assignment(distance)
        index[rows] = columns
    return vectors[:, index]


#: Largest accepted backward error of an eigenpair; one above it is an error, not a row.
BACKWARD_TOLERANCE = 1e-8

#: Part of the median |λ| below which an eigenvalue counts as zero where zero is an eigenvalue.
ZERO_EIGENVALUE = 1e-3

#: Relative distance at which two eigenvalues count as equal, or a real part as zero.
EQUAL_EIGENVALUES = 1e-6


@dataclass
class Eigenpairs:
    """Eigenvalues with right and left vectors, one column each, of the locally owned unknowns.

    Attributes:
        values: λ, shape (m,), 1/s; of a conjugate pair the one with positive imaginary part.
        right: x, shape (n_local, m), complex.
        left: y, shape (n_local, m), complex.
        errors: normwise backward errors, shape (m,).
        bounds: bound of the error of λ by round-off, relative to |λ|, shape (m,) (see `rotfem.numerics.eigenproblem`).
    """

    values: Array
    right: Array
    left: Array
    errors: Array
    bounds: Array

    @property
    def resolved(self) -> Array:
        """λ, shape (m,); zero where it is so to round-off."""
        return np.where(self.bounds < 1.0, self.values, 0.0)

    @property
    def overdamped(self) -> Array:
        """Which of them do not vibrate but die away, shape (m,)."""
        real = np.abs(self.values.imag) <= EQUAL_EIGENVALUES * np.abs(self.values)
        return np.asarray(real & (self.values.real < 0.0) & (self.bounds < 1.0))

    def select(self, index: Array) -> Eigenpairs:
        """Return the pairs of an index array, in its order."""
        vectors = self.right[:, index], self.left[:, index]
        return Eigenpairs(self.values[index], *vectors, self.errors[index], self.bounds[index])


def repeated(values: Array, bounds: Array) -> list[list[int]]:
    """Return the indices of eigenvalues (sorted by size) in groups of those that are one."""
    sizes = np.abs(values)
    off = bounds * sizes
    one = np.abs(values[1:] - values[:-1]) <= np.maximum(EQUAL_EIGENVALUES * sizes[1:], off[1:] + off[:-1])
    out = [[0]] if len(values) else []
    for i, same in enumerate(one.tolist(), start=1):
        out[-1].append(i) if same else out.append([i])
    return out


def separate(pencil: Pencil, pairs: Eigenpairs, vectors: tuple[Array, Array], tell: Callable[..., Array]) -> None:
    """Choose the vectors of eigenvalues that are one, in place: orthogonal in M, and eigenvectors of another operator.

    Without C, and with M and K symmetric, all right vectors are made real, of unit mass. Left ones follow, so that
    y_i^H [(λ_i + λ_j) M + C] x_j is 1 or 0.

    Args:
        pencil: M, C and K.
        pairs: whose vectors may be coordinates in a real basis.
        vectors: right and left ones of the pencil.
        tell: (X, M X) ↦ X^H M A X of a symmetric operator M A that tells vectors apart, over all ranks, (m, m).
    """
    right, left = vectors
    standing = pencil.conservative and pencil.C.norm(PETSc.NormType.INFINITY) == 0.0
    for group in (np.array(g) for g in repeated(pairs.values, pairs.bounds) if standing or len(g) > 1):
        X, x, m = right[:, group], pairs.right[:, group], len(group)
        if standing:
            parts = np.hstack([X.real, X.imag])
            sizes, turns = np.linalg.eigh(summed(pencil.comm, parts.T @ times(pencil.M, parts)))
            turns = turns[:, -m:] / np.sqrt(sizes[-m:])
            X, x = parts @ turns, np.hstack([x.real, x.imag]) @ turns
        MX = pencil.apply(pencil.M, X)
        unit = np.linalg.inv(np.linalg.cholesky(summed(pencil.comm, X.conj().T @ MX)))
        V = unit.conj().T @ np.linalg.eigh(unit @ tell(X, MX) @ unit.conj().T)[1]
        lam = np.where(pairs.bounds[group] < 1.0, pairs.values[group], 1j)  # of zero any other one
        Y = np.linalg.pinv(pencil.gram(left[:, group], lam, X @ V, lam)).conj().T
        pairs.right[:, group], pairs.left[:, group] = x @ V, pairs.left[:, group] @ Y


def backward_errors(pencil: Pencil, values: Array, X: Array) -> Array:
    """Return the normwise backward errors of eigenpairs, ‖(λ² M + λ C + K) x‖ / [(|λ|² ‖M‖ + |λ| ‖C‖ + ‖K‖) ‖x‖]."""
    matrices, powers = (pencil.M, pencil.C, pencil.K), np.array([values**2, values, np.ones_like(values)])
    residual = sum(power * pencil.apply(A, X) for A, power in zip(matrices, powers, strict=True))
    norms = np.array([A.norm(PETSc.NormType.INFINITY) for A in matrices])
    squares = summed(pencil.comm, np.array([np.sum(np.abs(Y) ** 2, axis=0) for Y in (residual, X)]))
    return np.asarray(np.sqrt(squares[0] / squares[1]) / (norms @ np.abs(powers)))


def basis_of(wanted: int, unknowns: int) -> int:
    """Return how many vectors the basis of SLEPc's solver has for so many eigenvalues of 2n, n the unknowns."""
    return min(max(3 * wanted, wanted + 20), 2 * unknowns)


def dense_pairs(M: Array, C: Array, K: Array, wanted: int, target: float) -> tuple[Array, Array, Array]:
    """Return (λ, x, backward error) of the eigenvalues of a small pencil that are nearest to a target.

    Those of unknowns without mass and damping are left out. A Krylov space that is to be the whole space breaks down
    before it is.
    """
    moves = np.any(M != 0.0, axis=1)
    finite = 2 * np.count_nonzero(moves) + np.count_nonzero(np.any(C != 0.0, axis=1) & ~moves)
    values, X, _ = (part[..., : min(wanted, finite)] for part in quadratic(M, C, K, target))
    if not len(values):
        raise ComputationError("the pencil has no finite eigenvalues")
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows has no small error
        sizes = [np.linalg.norm(A) for A in (M, C, K)]
        residual = np.linalg.norm(M @ X * values**2 + C @ X * values + K @ X, axis=0)
        errors = residual / (np.abs(values) ** 2 * sizes[0] + np.abs(values) * sizes[1] + sizes[2])
    return values, X, np.where(np.isfinite(errors), errors, 1.0)


class Pencil:
    """M, C and K of small motions about an equilibrium (PETSc matrices, clamped unknowns 0, 0 and 1).

    Args:
        M: mass, C: gyroscopic and damping (it may be `PlusLowRank`), K: stiffness matrix.

    Attributes:
        owner: kept alive with the matrices.
        factor: solver with K where its factor is kept; before, one with a matrix of its pattern; or None.
        overdamped: number of overdamped pairs that are expected among others of a shaft; None of other structures.
    """

    factor: DirectSolver | None = None
    overdamped: int | None = None

    def __init__(self, M: Any, C: Any, K: Any):
        self.M, self.C, self.K = M, C, K
        self.owner: Any = None
        self.comm: MPI.Comm = M.comm.tompi4py()
        self._smallest = 1.0
        #: Unit of λ in the eigensolver, 1/s, a power of two: numbers of order one keep all digits. None: not known yet.
        self.unit: float | None = None
        #: What the entries of K are sums of, and entries that are none (see `rotfem.numerics.eigenproblem.RoundOff`).
        self.sizes: Array | None = None
        self.factors: Any = None
        #: Scale of the unknowns, powers of two (None: that of the diagonal), and whether a factor needs pivots.
        self.unknowns: Any = None
        self.pivots = False
        #: Whether inaccurate pairs are refused.
        self._judged = True
        #: Time of factorisations, s.
        self.factored = 0.0

    def apply(self, A: Any, X: Array) -> Array:
        """Return A X for complex columns X, or a vector, of locally owned unknowns."""
        columns = X.reshape(len(X), -1)
        parts, m = times(sparse_part(A), np.hstack([columns.real, columns.imag])), columns.shape[1]
        out = (parts[:, :m] + 1j * parts[:, m:]).reshape(X.shape)
        return out if sparse_part(A) is A else out + np.asarray(A.added(X))

    def gram(self, Y: Array, lam: Array, X: Array, mu: Array) -> Array:
        """Return y_i^H [(λ_i + μ_j) M + C] x_j for all i, j, over all ranks."""
        local = np.stack([Y.conj().T @ self.apply(self.M, X), Y.conj().T @ self.apply(self.C, X)])
        mass, gyroscopic = summed(self.comm, local)
        return np.asarray((lam[:, None] + mu[None, :]) * mass + gyroscopic)

    @cached_property
    def asymmetries(self) -> dict[str, float]:
        """Estimates of relative ‖M − Mᵀ‖, ‖C + Cᵀ‖ and ‖K − Kᵀ‖ (Frobenius).

        They are those by four random vectors r of normal distribution: the mean of ‖A r‖² is the square of the norm of
        A, that of (sᵀA r)² too.
        """
        d = (unknown_scale(self.M, self.K, 1.0) if self.unknowns is None else self.unknowns).array[:, None]
        R = d * np.random.default_rng(self.comm.rank).standard_normal((len(d), 4))  # scaled, as units would say else
        out = {}
        for name, A, sign in zip("MCK", (self.M, self.C, self.K), (-1.0, 1.0, -1.0), strict=True):
            AR = times(A, R)
            mixed, size = summed(self.comm, R.T @ AR), summed(self.comm, float(np.sum((d * AR) ** 2)) / 4)
            apart = np.sum(np.triu(mixed + sign * mixed.T, 1) ** 2) / 6
            out[name] = float(np.sqrt(apart / size)) if size > 0.0 else 0.0
        return out

    @cached_property
    def conservative(self) -> bool:
        """Whether M and K are symmetric and C skew to round-off, so that left vectors are right vectors of −λ̄."""
        return all(value < 1e-10 for value in self.asymmetries.values())

    def scale(self) -> float:
        """Return the least |λ|."""
        return float(np.min(np.abs(self._right(self.M, sparse_part(self.C), self.K, 1, 0.0)[0])))

    def solve(self, count: int, target: float = 0.0) -> Eigenpairs:
        """Return at least `count` pairs (fewer if there are no more) of smallest |λ|, sorted by |λ|.

        A double zero, as of a hinge without a spring, is one of them, though round-off may part it into ±λ.
        """
        try:
            pairs = self._solve(count, target)
        except ComputationError:  # K is singular or nearly so (a critical speed, a rigid-body mode): aim beside zero
            pairs = self._solve(count, 0.1 * self._smallest)
        lam = pairs.values
        opposite = np.abs(lam[1:] + lam[:-1]) < ZERO_EIGENVALUE * np.abs(lam[1:])
        return pairs.select(np.flatnonzero(np.append(True, ~opposite | (pairs.bounds[1:] < 1.0))[: len(lam)]))

    def first(self, count: int, target: float = 0.0) -> Eigenpairs:
        """Return pairs as `solve` does; of a shaft `count` of them are not overdamped, and those that are come last."""
        if self.overdamped is None:
            return self.solve(count, target)
        pairs = self.solve(count + self.overdamped, target)
        with suppress(ComputationError):  # where further ones are inaccurate, there are no more
            while (over := int(np.sum(pairs.overdamped))) > self.overdamped:
                pairs = self.solve(count + over, target)
                self.overdamped = over
        pairs.values[pairs.overdamped] = pairs.values.real[pairs.overdamped]
        return pairs.select(np.argsort(pairs.overdamped, kind="stable"))

    def _solve(self, count: int, target: float) -> Eigenpairs:
        if sparse_part(self.C) is not self.C:  # SLEPc's solver takes sparse matrices alone
            return self._damped(count, target)
        try:
            values, right, errors = self._right(self.M, self.C, self.K, count, target)
        except ComputationError:
            if self.damped:
                return self._damped(count, target)
            raise
        unit = power_of_two(float(np.median(np.abs(values))))
        if float(np.max(errors)) > 1e-10 and not 0.25 <= unit / (self.unit or unit) <= 4.0:
            self.unit = unit
            values, right, errors = self._right(self.M, self.C, self.K, count, target)
        sizes = np.abs(values)
        moving = sizes[sizes > ZERO_EIGENVALUE * np.max(sizes)]  # but for several motions that nothing holds
        self._smallest = float(np.median(moving if 0 < len(moving) < len(sizes) - 2 else sizes))
        small = ZERO_EIGENVALUE * self._smallest if target > 0.0 else 0.0
        if self.damped and heavily_damped(values[self.stiff(right) & (np.abs(values) > small)]):
            return self._damped(count, target)
        if self.conservative:
            left = mirrored(values, right)
        else:
            M, C, K = (transposed(A) for A in (self.M, self.C, self.K))
            left = matched(values, *self._right(M, C, K, count, target)[:2])
        # Of ± pairs of real eigenvalues of a conservative pencil, the growing one determines both; zeros have any sign.
        telling = (values.real >= 0.0) | (not self.conservative) | (np.abs(values) <= small)
        upper = (values.imag > 0.0) | ((values.imag == 0.0) & telling)
        pairs = self._checked(values[upper], (right[:, upper], left[:, upper]), errors[upper], small)
        return pairs.select(np.argsort(np.abs(pairs.values), kind="stable"))

    @cached_property
    def damped(self) -> bool:
        """Whether C has a symmetric part."""
        return self.asymmetries["C"] > 1e-10

    def stiff(self, X: Array) -> Array:
        """Return of which columns of X round-off leaves the sign of x^H K x, shape (m,)."""
        energy = summed(self.comm, np.sum(X.conj() * self.apply(self.K, X), axis=0))
        return np.asarray(np.abs(energy) > RoundOff(self, self.sizes, self.factors).stiffness(X, X))

    def _damped(self, count: int, target: float) -> Eigenpairs:
        """Return pairs in the order of the undamped frequencies of their shapes (see `rotfem.numerics.ritz`)."""
        C = sparse_part(self.C)  # what it has of low rank is symmetric
        gyroscopic = transposed(C)
        gyroscopic.aypx(-1.0, C)
        gyroscopic.scale(0.5)
        undamped = Pencil(self.M, gyroscopic, self.K)
        undamped._judged = False  # they only begin the basis
        shapes = undamped.solve(count + MORE, target).right
        self.unit, self._smallest = undamped.unit or 1.0, undamped._smallest
        matrices, d = balanced(self.M, self.C, self.K, self.unit)
        start, more = shapes / d[:, None], min(2 * count, count + MORE)
        values, right, left, errors = damped_pairs(matrices, start, more, target / self.unit)
        vectors = d[:, None] * right, d[:, None] * left
        return self._checked(self.unit * values, vectors, errors, ZERO_EIGENVALUE * self.unit if target > 0.0 else 0.0)

    def _checked(self, values: Array, vectors: tuple[Array, Array], errors: Array, small: float) -> Eigenpairs:
        """Return pairs with their bounds, from right and left vectors."""
        right, left = vectors
        # A double zero eigenvalue (a rigid-body mode) is known beforehand, and never met to full accuracy.
        worst = float(np.max(errors[np.abs(values) > small], initial=0.0))
        if worst > BACKWARD_TOLERANCE and self._judged:
            raise ComputationError(
                f"an eigenpair has the backward error {worst:.1e}, above {BACKWARD_TOLERANCE:.0e}",
                advice="fewer modes.count or another mesh",
            )
        values, bounds = RoundOff(self, self.sizes, self.factors).corrected(values, left, right)
        return Eigenpairs(values, right, left, errors, bounds)

    def _right(self, M: Any, C: Any, K: Any, count: int, target: float) -> tuple[Array, Array, Array]:
        """Return (λ, x, backward error) of the pairs nearest to the target, both signs of the imaginary part."""
        unit = self.unit or 1.0
        if target == 0.0 and K.getSize()[0] > SMALL and not self.pivots and self.conservative:
            with suppress(ComputationError):  # where round-off is too large for it, or K is singular
                return self._by_blocks(count)
        self.factor = None
        matrices, d = balanced(M, C, K, unit, self.unknowns)
        values, right, errors = self._nearest(*matrices, count, target / unit)
        return (self.unit or 1.0) * values, d[:, None] * right, errors

    def _by_blocks(self, count: int) -> tuple[Array, Array, Array]:
        """Return (λ, x, backward error) of the slowest pairs of a large conservative pencil; keeps the factor of K."""
        started, solver = perf_counter(), self.factor or DirectSolver(self.K, symmetric=True)
        self.factor = None
        solver.refresh(self.K)
        solver.factorise()
        self.factored += perf_counter() - started
        scale = unknown_scale(self.M, self.K, 1.0).array
        out = gyroscopic_pairs((self.M, self.C, self.K), scale, solver, count)
        self.factor = solver
        return out

    def _nearest(self, M: Any, C: Any, K: Any, count: int, target: float) -> tuple[Array, Array, Array]:
        """Return (λ, x, backward error) nearest to the target, of balanced matrices, which may change."""
        n = K.getSize()[0]
        wanted = min(2 * count + 2, 2 * n - 2)
        if self.comm.size == 1 and basis_of(wanted, n) == 2 * n:
            return dense_pairs(M[:, :], C[:, :], K[:, :], wanted, target)
        symmetric = target == 0.0 and self.conservative
        pep = self._solver(M, C, K, wanted, target)
        st = pep.getST()
        if symmetric:
            K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        use_direct_solver(st.getKSP(), n, symmetric, self.pivots)
        started = perf_counter()
        try:
            pep.setUp()
            self.factored += perf_counter() - started
            if self.unit is None and target == 0.0:
                # P(0) = K is factorised in any unit of time, so the inertia of its factor costs nothing more.
                lowest = least_frequency(M, K, st.getKSP())
                self.unit = float(power_of_two(2 * count * lowest)) if lowest > 0.0 else 1.0
                C.scale(self.unit)
                M.scale(self.unit**2)
            pep.solve()
            return self._found(pep, K, count, wanted)
        except ComputationError:
            raise
        except Exception as error:
            raise ComputationError(f"the eigensolver failed: {error}", advice="a slightly different speed") from None
        finally:
            pep.destroy()

    @staticmethod
    def _solver(M: Any, C: Any, K: Any, wanted: int, target: float) -> Any:
        """Return SLEPc's solver for so many eigenvalues nearest to the target."""
        pep = SLEPc.PEP().create(K.comm)
        pep.setOperators([K, C, M])
        pep.setProblemType(SLEPc.PEP.ProblemType.GENERAL)
        pep.setType(SLEPc.PEP.Type.TOAR)
        pep.setDimensions(wanted, basis_of(wanted, K.getSize()[0]))
        pep.setTarget(target)
        pep.setWhichEigenpairs(SLEPc.PEP.Which.TARGET_MAGNITUDE)
        pep.setTolerances(1e-11, 300)
        pep.getST().setType(SLEPc.ST.Type.SINVERT)
        return pep

    @staticmethod
    def _found(pep: Any, K: Any, count: int, wanted: int) -> tuple[Array, Array, Array]:
        """Return (λ, x, backward error) of all pairs that have converged."""
        found = pep.getConverged()
        if found < min(count, wanted):
            raise ComputationError(
                f"the eigensolver found {found} of {wanted} eigenvalues", advice="fewer modes.count or another mesh"
            )
        values, vectors, errors = list[complex](), list[Array](), list[float]()
        real, imaginary = K.createVecs()
        for i in range(found):
            value = complex(pep.getEigenpair(i, real, imaginary))
            if values and value.imag != 0.0 and value == values[-1].conjugate():  # conjugate pairs stand together
                vectors.append(vectors[-1].conj())
                errors.append(errors[-1])
            else:
                vectors.append(real.array + 1j * imaginary.array)
                errors.append(pep.computeError(i, SLEPc.PEP.ErrorType.BACKWARD))
            values.append(value)
        return np.array(values), np.array(vectors).T.copy(), np.array(errors)
