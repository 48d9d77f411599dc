"""Modes over a range of speeds, by a basis of modes at a few of them.

In a linear theory, with the columns V of modes at some speeds, orthonormal in the stiffness at rest,
(λ² M + λ C + K) x = 0 becomes the small problem of VᵀMV, VᵀCV and VᵀKV, whose pieces (of Omega, Omega², …) are
projected once. It keeps symmetry and skewness, so it is a pencil like the full one. The basis grows until full
solutions at speeds between agree. In the other theories the pencil is interpolated between two speeds that are solved,
to see which modes are one and where a solution is worth its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from numpy.linalg import norm
from scipy.linalg import eigh

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.errors import ComputationError
from rotfem.numerics.eigenproblem import Eigenpairs, Pencil, RoundOff, relative
from rotfem.numerics.linear import ROUNDED, unknown_scale
from rotfem.numerics.projection import dense, orthonormal, spanned, summed, times
from rotfem.numerics.ritz import heavily_damped, quadratic

Array = npt.NDArray[Any]

#: Speeds from which a basis saves time: it takes three full solutions at least.
MANY = 3

#: Modes between two speeds beyond those that are known at both: those that a branch may pass through.
FURTHER = 3

#: Entries of lifted eigenvectors that are computed together: some ten arrays of 16 MB.
TOGETHER = 1_000_000


def in_basis(analysis: ModalAnalysis, speeds: Sequence[float], count: int) -> ReducedAnalysis | None:
    """Return the analysis in a basis where that is possible and saves time, else None.

    It is possible of a linear theory in the rotating frame with a fixed hub.
    """
    if not analysis.system.linear or analysis.free or analysis.fixed is not None or len(speeds) < MANY:
        return None
    reduced = ReducedAnalysis(analysis)
    return reduced if reduced.prepare(speeds[0], speeds[-1], count) else None


def product(A: Array, X: Array) -> Array:
    """Return A X of real A and complex X; numpy would make A complex first."""
    return np.asarray((A @ np.ascontiguousarray(X, dtype=complex).view(np.float64)).view(np.complex128))


class ProjectedPieces:
    """The matrices of a linear theory, M, C, K = Σ cₚ (piece p), in a basis V: VᵀMV, VᵀCV and VᵀKV.

    Attributes:
        kinds: "M", "C", "K" ↦ numbers of the pieces of that kind.
        products: numbers of the pieces ↦ their products with the basis, owned rows (n, m).
        small: "M", "C", "K" ↦ projected pieces (p, m, m).
    """

    def __init__(self, system: Any):
        self.system = system
        self.kinds = {kind: [i for i, p in enumerate(system.pieces) if p.kind == kind] for kind in "MCK"}
        self.products: dict[int, Array] = {}
        self.small: dict[str, Array] = {}

    def project(self, V: Array) -> None:
        """Project all pieces on a basis, owned rows (n, m)."""
        comm, m = self.system.comm, V.shape[1]
        matrices = [i for numbers in self.kinds.values() for i in numbers]
        self.products = {i: times(self.system.pieces[i].operator, V) for i in matrices}
        for kind, numbers in self.kinds.items():
            projected = [summed(comm, V.T @ self.products[i]) for i in numbers]
            self.small[kind] = np.array(projected).reshape(len(projected), m, m)

    def operators(self, c: Array) -> tuple[Array, Array, Array]:
        """Return M, C and K (n, m, m) from the factors of all pieces (n, pieces)."""
        M, C, K = (np.asarray(np.tensordot(c[:, self.kinds[k]], self.small[k], 1)) for k in "MCK")
        return M, C, K


class SmallPencil(Pencil):
    """A pencil of arrays, of which all eigenvalues are computed; double ones, as of a disk, do no harm then.

    Of a conservative one with K = L Lᵀ positive definite and M = Rᵀ R, z = (Lᵀ x, λ R x) is an eigenvector of the skew
    matrix [[−L⁻¹ C L⁻ᵀ, −Hᵀ], [H, 0]], H = R L⁻ᵀ, its eigenvalue 1/λ (Tisseur & Meerbergen 2001, section 3.7): all λ
    are imaginary, to the last digit, and left vectors are right ones.

    Args:
        M, C, K: square arrays.
        root: R.
        asymmetries: of the full system, how far M and K are from symmetric and C from skew.
    """

    def __init__(self, M: Array, C: Array, K: Array, root: Array, asymmetries: dict[str, float]):
        self.asymmetries = asymmetries
        if self.conservative:  # what a projection lacks of symmetry is round-off
            M, C, K = 0.5 * (M + M.T), 0.5 * (C - C.T), 0.5 * (K + K.T)
        self.M, self.C, self.K, self._root = M, C, K, root
        self.comm, self.spectrum_error = MPI.COMM_SELF, None

    def apply(self, A: Any, X: Array) -> Array:
        """Return A X."""
        return product(A, X)

    def solve(self, count: int, target: float = 0.0) -> Eigenpairs:
        """Return the pairs of smallest |λ| (see `Pencil.solve`), their errors those of the small problem."""
        found = self._skew(count) if self.conservative else None
        values, x, y = found or quadratic(self.M, self.C, self.K, target)
        first = np.arange(min(2 * count + 2, len(values)))
        if self.damped and heavily_damped(values[first][self.stiff(x[:, first])]):
            whole = (dense(MPI.COMM_SELF, A).convert("aij") for A in (self.M, self.C, self.K))
            return Pencil(*whole).solve(count, target)
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
        H, n = self._root @ inverse.T, len(inverse)
        S = np.zeros((n + len(H),) * 2, dtype=complex)  # i times the skew matrix, whose lower triangle is read
        S.imag[:n, :n], S.imag[n:, :n] = inverse @ self.C @ inverse.T, -H
        last = min(count, len(H)) - 1
        m, z = eigh(S, subset_by_index=[0, last], driver="evr", overwrite_a=True, check_finite=False)
        x = inverse.T @ z[:n]
        x = x / norm(x, axis=0)
        return -1j / m, x, x


def root_of(M: Array) -> Array:
    """Return R, M = Rᵀ R, of a symmetric matrix; as many rows as M has eigenvalues that are not round-off."""
    squares, vectors = np.linalg.eigh(M)
    there = squares > len(M) * np.finfo(float).eps * squares[-1]
    return np.asarray((vectors[:, there] * np.sqrt(squares[there])).T)


class ReducedAnalysis(ModalAnalysis):
    """Modal analysis of a linear theory in a basis of its own modes; eigenvectors are in its coordinates.

    Args:
        full: the compiled scene, of a linear theory.

    Attributes:
        checks: speeds of full solutions with the largest relative difference of a frequency found there.
    """

    is_model = True

    def __init__(self, full: ModalAnalysis):
        self.full = full
        self.basis = ProjectedPieces(full.system)
        self.checks: list[dict[str, float]] = []
        self._columns: list[Array] = []
        self._asymmetries: dict[str, float] = {}

    def __getattr__(self, name: str) -> Any:
        """Return what the analysis of the full system has under a name."""
        return getattr(self.full, name)

    def prepare(self, first: float, last: float, count: int) -> bool:
        """Build the basis for speeds from first to last (rad/s) and `count` modes; return whether the checks agree.

        It grows until frequencies halfway between known speeds are those of the full system to 1e-6.
        """
        for speed in (first, last):
            self._add(self._solve(speed, count))
        self._count = count
        if self.full.kept.used:  # which the pieces do not keep
            return False
        self._project()
        gaps = [(first, last)]
        while gaps and len(self.checks) < 7:
            low, high = gaps.pop(0)
            middle = 0.5 * (low + high)
            exact = self._solve(middle, count)
            found = self.at(middle, count).pairs.values
            n = min(count, len(found), len(exact.values))
            error = float(np.max(np.abs(found[:n] - exact.values[:n]) / np.abs(exact.values[:n]), initial=0.0))
            self.checks.append({"speed": middle, "difference": error})
            self._add(exact)
            self._project()
            gaps += [(low, middle), (middle, high)] if error > 1e-6 else []
        return not gaps

    def report(self) -> dict[str, Any]:
        """Return what a summary says of the basis: columns, and the checks."""
        return {"reduced_basis": {"columns": self.V.shape[1], "checks": self.checks}}

    def _solve(self, speed: float, count: int) -> Eigenpairs:
        exact = self.full.at(speed, count, keep=False)
        for name, value in exact.pencil.asymmetries.items():
            self._asymmetries[name] = max(value, self._asymmetries.get(name, 0.0))
        return exact.pairs

    def _add(self, pairs: Eigenpairs) -> None:
        for x in pairs.right.T:
            self._columns += [x.real, x.imag] if np.max(np.abs(x.imag)) > 0 else [x.real]

    def _project(self) -> None:
        """Make the columns orthonormal and project every piece."""
        system, basis = self.system, self.basis
        # In the inertia instead, directions that have none would be lost.
        self.V = orthonormal(self.comm, np.array(self._columns).T, lambda X: times(system.material, X))
        basis.project(self.V)
        self._index = [i for kind in "MCK" for i in basis.kinds[kind]]
        self.mass = np.sum([basis.products[i] for i in basis.kinds["M"]], axis=0)
        self._root = root_of(basis.small["M"].sum(axis=0))
        stacked = np.hstack([basis.products[i] for i in self._index])
        self._grams = summed(self.comm, stacked.T @ stacked)
        self._metric = summed(self.comm, self.V.T @ self.V)
        self._norms = [float(system.pieces[i].operator.norm()) for i in self._index]
        self._round_off = RoundOff(Pencil(*system.mass_damping_stiffness(keep=False)))

    def at(
        self, speed: float, count: int, start: Spinning | None = None, keep: bool = True, near: Array | None = None
    ) -> Spinning:
        """Return the eigenpairs of the basis at a speed (see `ModalAnalysis.at`), with errors in the full system."""
        return self.at_all([speed], count)[0]

    def ends(self, first: Spinning, last: Spinning) -> tuple[Spinning, Spinning]:
        """Return the modes at two speeds as `between` has them."""
        return first, last

    def between(self, speed: float) -> Spinning:
        """Return some more modes of the basis at a speed (rad/s), without their errors in the full system."""
        return self._small([speed], self._count + FURTHER)[0]

    def _small(self, speeds: Sequence[float], count: int) -> list[Spinning]:
        """Return the eigenpairs of the basis at some speeds, with errors of the small problem."""
        zero, motion, out = self.system.zeros(), self.system.motion, []
        c = np.array([self.system.coefficients(motion.at_speed(speed)) for speed in speeds])
        for speed, M, C, K in zip(speeds, *self.basis.operators(c), strict=True):
            pencil = SmallPencil(M, C, K, self._root, self._asymmetries)
            pencil.owner = self
            pairs = pencil.solve(min(count, self.V.shape[1] - 1))
            out.append(Spinning(speed, zero, pencil, pairs, pencil))
        return out

    def at_all(self, speeds: Sequence[float], count: int) -> list[Spinning]:
        """Return what `at` does at several speeds, with the errors of all pairs in one go."""
        part = max(1, TOGETHER // (count * self.system.material.getSize()[0]))
        if len(speeds) > part:
            return [s for i in range(0, len(speeds), part) for s in self.at_all(speeds[i : i + part], count)]
        out = self._small(speeds, count)
        c = np.array([self.system.coefficients(self.system.motion.at_speed(speed)) for speed in speeds])
        numbers = [len(s.pairs.values) for s in out]
        values, right, left = (np.hstack([getattr(s.pairs, n) for s in out]) for n in ("values", "right", "left"))
        errors = self._backward_errors(values, right, np.repeat(c[:, self._index], numbers, axis=0).T)
        X = product(self.V, right)
        lost = self._round_off.stiffness(X if out[0].pencil.conservative else product(self.V, left), X)
        slopes = np.hstack([s.own.diagonal() for s in out])
        bounds, ends = relative(lost / np.maximum(np.abs(slopes * values), 1e-300)), np.cumsum(numbers)[:-1]
        for s, own, bound in zip(out, np.split(errors, ends), np.split(bounds, ends), strict=True):
            s.pairs.errors, s.pairs.bounds = own, bound + s.pairs.bounds
        return out

    def right(self, spinning: Spinning) -> Array:
        """Return the eigenvectors in the unknowns of the mesh."""
        return product(self.V, spinning.pairs.right)

    def mass_times(self, spinning: Spinning) -> Array:
        """Return M times the eigenvectors."""
        return product(self.mass, spinning.pairs.right)

    def _backward_errors(self, values: Array, right: Array, c: Array) -> Array:
        """Return the normwise backward errors of lifted eigenpairs in the full system, shape (m,).

        Norms of full vectors are taken by products of the columns, so nothing below 1e-8 is seen.
        """
        power = np.repeat([2, 1, 0], [len(self.basis.kinds[kind]) for kind in "MCK"])
        factors = c * values ** power[:, None]
        parts = (factors[:, None, :] * right).reshape(-1, len(values))
        residual = np.sum(parts.conj() * product(self._grams, parts), axis=0).real
        lengths = np.sum(right.conj() * product(self._metric, right), axis=0).real
        return np.asarray(np.sqrt(np.maximum(residual, 0.0) / lengths) / (self._norms @ np.abs(factors)))


class Between:
    """Modes between two speeds that are solved, by interpolation of the pencil in a basis of the modes at both.

    M and C are polynomials of the speed Ω through what they are at the nodes, K is one of Ω², as the centrifugal force
    that the equilibrium follows (Lagrange). At both ends it has the modes that were solved, but
    for round-off in K.

    Args:
        both: the modes at the ends.
        nodes: all that the polynomials go through; both ends among them, and no two speeds of different sign.
        square: whether K is a polynomial of Ω², or else of Ω.
    """

    def __init__(self, both: tuple[Spinning, Spinning], nodes: Sequence[Spinning], square: bool = True):
        pencil, self._square = both[0].pencil, square
        self._scale = unknown_scale(pencil.M, pencil.K, 1.0).array[:, None]
        # Left vectors of a conservative pencil are conjugate right ones, unless λ is real.
        further = [s.pairs.left[:, (s.pairs.values.imag == 0.0) | (not pencil.conservative)] for s in both]
        vectors = np.hstack([*(s.pairs.right for s in both), *further]) / self._scale
        self._comm, self._V = pencil.comm, spanned(pencil.comm, np.hstack([vectors.real, vectors.imag]))
        self._speeds = np.array([s.speed for s in nodes])
        X = self._scale * self._V
        self._matrices = np.array(
            [[summed(self._comm, X.T @ times(A, X)) for A in (p.M, p.C, p.K)] for p in (s.pencil for s in nodes)]
        )
        self._asymmetries = {name: max(s.pencil.asymmetries[name] for s in both) for name in "MCK"}
        self._count = max(len(s.pairs.values) for s in both) + FURTHER

    def _pencil(self, speed: float) -> SmallPencil:
        def weights(at: float, places: Array) -> Array:
            apart = places[:, None] - places
            np.fill_diagonal(apart, 1.0)
            there = np.tile(at - places, (len(places), 1))
            np.fill_diagonal(there, 1.0)
            return np.asarray(np.prod(there / apart, axis=1))

        plain = weights(speed, self._speeds)
        squared = weights(speed**2, self._speeds**2) if self._square else plain
        M, C, K = (
            np.tensordot(w, A, 1) for w, A in zip((plain, plain, squared), self._matrices.swapaxes(0, 1), strict=True)
        )
        return SmallPencil(M, C, K, root_of(0.5 * (M + M.T)), self._asymmetries)

    def ends(self, first: Spinning, last: Spinning) -> tuple[Spinning, Spinning]:
        """Return the modes at both ends as `between` has them."""
        return self._inside(first), self._inside(last)

    def _coordinates(self, X: Array) -> Array:
        return np.asarray(summed(self._comm, product(self._V.T, X / self._scale)))

    def _inside(self, s: Spinning) -> Spinning:
        right, left = (self._coordinates(v) for v in (s.pairs.right, s.pairs.left))
        pairs, pencil = s.pairs, self._pencil(s.speed)
        return Spinning(s.speed, s.q, pencil, Eigenpairs(pairs.values, right, left, pairs.errors, pairs.bounds), pencil)

    def between(self, speed: float) -> Spinning:
        """Return some more modes of the interpolated pencil at a speed (rad/s)."""
        pencil, count = self._pencil(speed), self._count
        try:
            pairs = pencil.solve(count)
        except ComputationError:  # K is singular: aim beside zero
            least = np.min(np.abs(np.linalg.eigvals(np.linalg.solve(pencil.M, pencil.K)))[1:])
            pairs = pencil.solve(count, 0.1 * float(np.sqrt(least)))
        return Spinning(speed, np.empty(0), pencil, pairs, pencil)
