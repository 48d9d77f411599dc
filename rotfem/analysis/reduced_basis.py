"""Modes between speeds: a small pencil over speed, in a basis of modes at a few of them.

With the columns V of modes at some speeds, (λ² M + λ C + K) x = 0 becomes the small problem of VᵀMV, VᵀCV and VᵀKV,
which keeps symmetry and skewness. Over the speed Ω these are the polynomials through what they are at some nodes
(Lagrange):

- About an equilibrium that is the same at all speeds, as in a linear theory and of a shaft in the fixed frame, they are
  of second degree in Ω, so three nodes make them exact. The basis grows until full solutions at speeds between agree,
  and all modes of a diagram are those of one model (`over_range`).
- Elsewhere two speeds that are solved, and those next to them, are the nodes (`between`). K is a polynomial
  of Ω² then, as the centrifugal force that the equilibrium follows.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from numpy.linalg import norm
from scipy.linalg import eigh

from rotfem.analysis.modal import ModalAnalysis, Spinning, product
from rotfem.errors import ComputationError
from rotfem.numerics.eigenproblem import BACKWARD_TOLERANCE, Eigenpairs, Pencil, RoundOff, backward_errors, relative
from rotfem.numerics.linear import ROUNDED, unknown_scale
from rotfem.numerics.projection import spanned, summed, times
from rotfem.numerics.ritz import MORE, TINY, heavily_damped, quadratic, smoothest

Array = npt.NDArray[Any]

#: Speeds from which a basis saves time: it takes three full solutions at least.
MANY = 3

#: Least parts of vectors in the basis over a range, whose square is left in eigenvalues; equilibria that are one.
PARTS, EQUAL_EQUILIBRIA = 1e-8, 1e-12

#: Modes of a model beyond those that are known at its speeds: those that a branch may pass through.
FURTHER = 3


class SmallPencil(Pencil):
    """A pencil of arrays, of which all eigenvalues are computed; double ones, as of a disk, do no harm then.

    Of a conservative one with K = L Lᵀ positive definite and M = Rᵀ R, z = (Lᵀ x, λ R x) is an eigenvector of the skew
    matrix [[−L⁻¹ C L⁻ᵀ, −Hᵀ], [H, 0]], H = R L⁻ᵀ, its eigenvalue 1/λ (Tisseur & Meerbergen 2001, section 3.7): all λ
    are imaginary, to the last digit, and left vectors are right ones.

    Args:
        M, C, K: square arrays.
        asymmetries: of the full system, how far M and K are from symmetric and C from skew.
    """

    def __init__(self, M: Array, C: Array, K: Array, asymmetries: dict[str, float]):
        self.asymmetries = asymmetries
        if self.conservative:  # what a projection lacks of symmetry is round-off
            M, C, K = 0.5 * (M + M.T), 0.5 * (C - C.T), 0.5 * (K + K.T)
        self.M, self.C, self.K = M, C, K
        self.comm = MPI.COMM_SELF

    def apply(self, A: Any, X: Array) -> Array:
        """Return A X."""
        return product(A, X)

    def solve(self, count: int, target: float = 0.0) -> Eigenpairs:
        """Return the pairs of smallest |λ| (see `Pencil.solve`), their errors those of the small problem."""
        found = self._skew(count) if self.conservative else None
        values, x, y = found or quadratic(self.M, self.C, self.K, target)
        first = np.arange(min(2 * count + 2, len(values)))
        if self.damped and heavily_damped(values[first][self.stiff(x[:, first])]):
            size = float(norm(self.K, np.inf))
            more = min(2 * count, count + MORE)
            values, x, y = smoothest((values, x, y), (self.M, self.C, self.K), more, size)
        else:
            telling = (values.real >= 0.0) | (not self.conservative)
            upper = np.flatnonzero((values.imag > 0.0) | ((values.imag == 0.0) & telling))
            order = upper[np.argsort(np.abs(values[upper]), kind="stable")[:count]]
            values, x, y = values[order], x[:, order], y[:, order]
        MX, CX, KX = np.split(product(np.vstack([self.M, self.C, self.K]), x), 3)
        n = np.sum(y.conj() * (2 * values * MX + CX), axis=0)
        residual = values**2 * MX + values * CX + KX
        lost = np.sum(np.abs(y) * np.abs(residual), axis=0) + self._rounded(y, x)
        off = lost / np.maximum(np.abs(n * values), 1e-300)
        return Eigenpairs(values, x, y, off, relative(off))

    def _rounded(self, y: Array, x: Array) -> Array:
        """Return a bound of |y^H δK x| by round-off for the columns of y and x."""
        sizes = np.sqrt(np.abs(np.diag(self.K)))
        return np.asarray(ROUNDED * (sizes @ np.abs(y)) * (sizes @ np.abs(x)))

    def stiff(self, X: Array) -> Array:
        """Return of which columns of X round-off leaves the sign of x^H K x (see `Pencil.stiff`)."""
        energy = np.sum(X.conj() * product(self.K, X), axis=0)
        return np.asarray(np.abs(energy) > self._rounded(X, X))

    def _skew(self, count: int) -> tuple[Array, Array, Array] | None:
        """Return the first (λ, x, y) with positive imaginary parts; None where K is not positive definite."""
        try:
            inverse = np.linalg.inv(np.linalg.cholesky(self.K))
        except np.linalg.LinAlgError:
            return None
        squares, vectors = np.linalg.eigh(self.M)
        there = squares > len(inverse) * np.finfo(float).eps * squares[-1]
        H, n = (vectors[:, there] * np.sqrt(squares[there])).T @ inverse.T, len(inverse)
        S = np.zeros((n + len(H),) * 2, dtype=complex)  # i times the skew matrix, whose lower triangle is read
        S.imag[:n, :n], S.imag[n:, :n] = inverse @ self.C @ inverse.T, -H
        last = min(count, len(H)) - 1
        m, z = eigh(S, subset_by_index=[0, last], driver="evr", overwrite_a=True, check_finite=False)
        x = inverse.T @ z[:n]
        x = x / norm(x, axis=0)
        return -1j / m, x, x


class SpeedModel:
    """The modes over speed of a small pencil, whose matrices are polynomials of speed.

    The basis V is orthonormal in unknowns of comparable size, W its dual one, WᵀV = 1.

    Args:
        analysis: of the modes.
        vectors: complex ones that the basis spans with their conjugates, owned rows (n, m).
        nodes: speed (rad/s) and pencil of each place that the polynomials go through.
        even: whether K is a polynomial of Ω², or else of Ω.
        count: number of modes.
        least: parts of vectors that the basis may lack.

    Attributes:
        lift: V, and M V at the first node.
        checks: speeds of full solutions, with the largest relative difference of a frequency there.
        rest: equilibrium of all speeds, if it is one.
    """

    def __init__(
        self,
        analysis: ModalAnalysis,
        vectors: Array,
        nodes: Iterable[tuple[float, Pencil]],
        even: bool,
        count: int,
        least: float = 1e-10,
    ):
        self.analysis, self.count, self._even = analysis, count, even
        self.rest: Array = np.empty(0)
        self.checks: list[dict[str, float]] = []
        speeds, matrices, self._asymmetries = list[float](), list[list[Array]](), dict.fromkeys("MCK", 0.0)
        for speed, pencil in nodes:
            if not speeds:
                scale = unknown_scale(pencil.M, pencil.K, 1.0).array[:, None]
                inner = spanned(pencil.comm, np.hstack([vectors.real, vectors.imag]) / scale, least)
                self.comm, V, self._dual = pencil.comm, scale * inner, inner / scale
            products = [times(A, V) for A in (pencil.M, pencil.C, pencil.K)]
            if not speeds:
                self.lift = (V, products[0])
            speeds.append(speed)
            self._overdamped = pencil.overdamped
            matrices.append([summed(pencil.comm, V.T @ AV) for AV in products])
            self._asymmetries = {k: max(x, pencil.asymmetries[k]) for k, x in self._asymmetries.items()}
        self._speeds: Array = np.array(speeds)
        self._matrices: Array = np.array(matrices)

    def _at(self, speed: float) -> Array:
        """Return M, C and K at a speed, (3, m, m)."""

        def weights(at: float, places: Array) -> Array:
            apart, there = places[:, None] - places, np.tile(at - places, (len(places), 1))
            np.fill_diagonal(apart, 1.0)
            np.fill_diagonal(there, 1.0)
            return np.asarray(np.prod(there / apart, axis=1))

        plain = weights(speed, self._speeds)
        squared = weights(speed**2, self._speeds**2) if self._even else plain
        return np.asarray(np.einsum("ki,ikab->kab", [plain, plain, squared], self._matrices))

    def _pencil(self, speed: float) -> SmallPencil:
        M, C, K = self._at(speed)
        pencil = SmallPencil(M, C, K, self._asymmetries)
        pencil.overdamped = self._overdamped
        return pencil

    def modes(self, speed: float, count: int = 0) -> Spinning:
        """Return modes at a speed (rad/s), their vectors in the basis; by default some more than the model is of."""
        pencil, count = self._pencil(speed), count or self.count + FURTHER
        try:
            pairs = pencil.first(count)
        except ComputationError:  # K is singular: aim beside zero
            least = np.min(np.abs(np.linalg.eigvals(np.linalg.solve(pencil.M, pencil.K)))[1:])
            pairs = pencil.first(count, 0.1 * float(np.sqrt(least)))
        return Spinning(self.analysis, speed, self.rest, pencil, pairs, pencil, lift=self.lift)

    def singular(self, low: float, high: float) -> Array:
        """Return the speeds between two at which K is singular, increasing; K is taken to be linear in Ω² there."""
        left, right = (self._at(speed)[2] for speed in (low, high))
        shares = np.linalg.eigvals(np.linalg.solve(left, left - right))  # 1/share: det(left + share (right − left)) = 0
        shares = np.array([1.0 / x.real for x in shares if abs(x.imag) < 1e-9 * abs(x) and x.real > 1.0])
        return np.sort(np.sqrt(low**2 + shares * (high**2 - low**2)))

    def inside(self, s: Spinning) -> Spinning:
        """Return modes with their vectors in the basis."""
        if s.lift is self.lift:
            return s
        right, left = (summed(self.comm, product(self._dual.T, v)) for v in (s.right, s.lifted(s.pairs.left)))
        pairs, pencil = replace(s.pairs, right=right, left=left), self._pencil(s.speed)
        return Spinning(self.analysis, s.speed, s.q, pencil, pairs, pencil, lift=self.lift)


def between(solved: Sequence[Spinning], neighbours: Sequence[Spinning]) -> SpeedModel:
    """Return the model between two speeds that are solved; it has their modes, but for round-off in K.

    Args:
        solved: modes at both speeds and at those solved between, by speed.
        neighbours: modes at the speeds next to them, of which those of the same sign are nodes too.
    """
    low, high = solved[0].speed, solved[-1].speed
    # Left vectors of a conservative pencil are conjugate right ones, unless λ is real.
    further = [s.pairs.left[:, (s.pairs.values.imag == 0.0) | (not s.pencil.conservative)] for s in solved]
    vectors = np.hstack([*(s.pairs.right for s in solved), *further])
    nodes = {s.speed: s.pencil for s in (*solved, *neighbours) if s.speed * (low + high) >= 0.0}
    return SpeedModel(
        solved[0].analysis, vectors, nodes.items(), low * high >= 0.0, max(len(s.pairs.values) for s in solved)
    )


def over_range(analysis: ModalAnalysis, speeds: Sequence[float], count: int) -> SpeedModel | None:
    """Return a model of all modes at some speeds (rad/s) where that is possible and saves time, else None.

    It is possible about one equilibrium of all speeds, with supports that are the same at all, and a fixed hub. The
    basis begins with the modes at both ends, and grows until frequencies halfway between known speeds are those of the
    full system to 1e-6.
    """
    system, first, last = analysis.system, speeds[0], speeds[-1]
    supports = analysis.model.frame.of_supports.values()
    if analysis.free or len(speeds) < MANY or not (system.linear or analysis.fixed):
        return None
    if any(not np.array_equal(of(first), of(speed)) for of in supports for speed in speeds):
        return None
    columns, checks, gaps = list[Array](), list[dict[str, float]](), [(first, last)]

    def solved(speed: float, start: Spinning | None = None) -> Spinning:
        found = analysis.at(speed, count, start, keep=False)
        columns.append(found.pairs.right[:, :count])
        if not found.pencil.conservative:
            columns.append(found.pairs.left[:, :count])
        return found

    def model() -> SpeedModel:
        nodes = ((speed, analysis.pencils(speed, rest, keep=False)[0]) for speed in (first, 0.5 * (first + last), last))
        out = SpeedModel(analysis, np.hstack(columns), nodes, False, count, PARTS)
        out.rest = rest
        return out

    start = solved(first)
    rest = start.q
    moved = system.size(solved(last, start).q - rest)
    if moved > EQUAL_EQUILIBRIA or analysis.mixed.used:  # whose digits the model does not keep
        return None
    found = model()
    while gaps and len(checks) < 7:
        low, high = gaps.pop(0)
        middle = 0.5 * (low + high)
        exact, near = solved(middle, start).pairs, found.modes(middle, count).pairs
        n = min(count, len(near.values), len(exact.values))
        apart = np.abs(near.resolved[:n] - exact.resolved[:n]) / np.maximum(np.abs(exact.values[:n]), TINY)
        error = float(np.max(apart, initial=0.0))
        checks.append({"speed": middle, "difference": error})
        found = model()
        gaps += [(low, middle), (middle, high)] if error > 1e-6 else []
    found.checks = checks
    return None if gaps else found


def with_errors(found: Spinning) -> Spinning | None:
    """Return modes of a model over a range, with their errors in the full system; None where these are too large."""
    analysis = found.analysis
    pencil = analysis.pencils(found.speed, found.q, keep=False)[0]
    pencil.asymmetries = found.pencil.asymmetries
    values, right, left = found.pairs.values, found.right, found.lifted(found.pairs.left)
    values, bounds = RoundOff(pencil).corrected(values, left, right)
    errors = backward_errors(pencil, values, right)
    if np.max(errors) > BACKWARD_TOLERANCE:
        return None
    found.pairs = replace(found.pairs, values=values, bounds=bounds, errors=errors)
    separated = replace(found, pencil=pencil)
    analysis.separate(separated)
    return found
