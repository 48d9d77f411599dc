"""Modes of a large linear system over a range of speeds, by a basis of its modes at a few of them.

With the M-orthonormal columns V of modes at some speeds, (λ² M + λ C + K) x = 0 becomes the small problem of VᵀMV, VᵀCV
and VᵀKV, whose pieces (of Omega, Omega², …) are projected once. It keeps symmetry and skewness, so it is a pencil like
the full one. The basis grows until full solutions at speeds between agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from rotfem.analysis.modal import ModalAnalysis, Spinning
from rotfem.numerics.damped import quadratic
from rotfem.numerics.eigenproblem import Eigenpairs, Pencil, RoundOff, relative
from rotfem.numerics.projection import orthonormal, summed, times

Array = npt.NDArray[Any]

#: Unknowns from which, and speeds from which, a basis saves time.
LARGE, MANY = 8000, 3

#: Accepted relative difference of a frequency from that of the full system; most full solutions in the search for it.
AGREEMENT, MOST = 1e-6, 9


def worth_while(analysis: ModalAnalysis, speeds: Sequence[float]) -> bool:
    """Return whether a basis is possible (a linear theory, a fixed hub) and saves time."""
    return (
        analysis.system.linear and not analysis.free and analysis.system.A.getSize()[0] >= LARGE and len(speeds) >= MANY
    )


class SmallPencil(Pencil):
    """A pencil of so few unknowns that all its eigenvalues are computed; double ones, as of a disk, do no harm then."""

    def _right(self, M: Any, C: Any, K: Any, count: int, target: float) -> tuple[Array, Array, Array]:
        """Return (λ, x, backward error) of the pairs nearest to the target, by LAPACK."""
        m, c, k = (A.getValues(range(A.getSize()[0]), range(A.getSize()[1])) for A in (M, C, K))
        values, x, _ = quadratic(m, c, k, target)
        wanted = min(2 * count + 2, 2 * len(k) - 2)
        values, x = values[:wanted], x[:, :wanted]
        sizes = np.array([np.linalg.norm(a) for a in (k, c, m)])
        powers = np.array([np.ones_like(values), values, values**2])
        residual = np.linalg.norm((k @ x) * powers[0] + (c @ x) * powers[1] + (m @ x) * powers[2], axis=0)
        return values, x, residual / (sizes @ np.abs(powers))


class ReducedAnalysis(ModalAnalysis):
    """Modal analysis of a linear theory in a basis of its own modes; eigenvectors are in its coordinates.

    Args:
        full: the compiled scene, of a linear theory.

    Attributes:
        checks: speeds of full solutions with the largest relative difference of a frequency found there.
    """

    def __init__(self, full: ModalAnalysis):
        self.full = full
        self.problem, self.about, self.comm, self.newton = full.problem, full.about, full.comm, full.newton
        self.system, self.model, self.structure, self.free = full.system, full.model, full.structure, full.free
        self.seconds, self._unit, self.mesh_by_shape = full.seconds, full._unit, False
        self.estimates, self.past_limits, self.fixed = full.estimates, full.past_limits, full.fixed
        self.checks: list[dict[str, float]] = []
        self._columns: list[Array] = []

    def prepare(self, first: float, last: float, count: int) -> None:
        """Build the basis for speeds from first to last (rad/s) and `count` modes; middle speeds are checked.

        Raises:
            ComputationError: a full solution failed.
        """
        for speed in (first, last):
            self._add(self._solve(speed, count))
        self._project()
        gaps = [(first, last)]
        while gaps and len(self.checks) + 2 < MOST:
            low, high = gaps.pop(0)
            middle = 0.5 * (low + high)
            exact = self._solve(middle, count)
            error = self._difference(middle, exact, count)
            self.checks.append({"speed": middle, "difference": error})
            if error > AGREEMENT:
                self._add(exact)
                self._project()
                gaps += [(low, middle), (middle, high)]

    def report(self) -> dict[str, Any]:
        """Return what a summary says of the basis: columns, and the checks."""
        return {"reduced_basis": {"columns": self.V.shape[1], "checks": self.checks}}

    def _solve(self, speed: float, count: int) -> Eigenpairs:
        return self.full.at(speed, count, keep=False).pairs

    def _difference(self, speed: float, exact: Eigenpairs, count: int) -> float:
        reduced = self.at(speed, count).pairs.values
        n = min(count, len(reduced), len(exact.values))
        return float(np.max(np.abs(reduced[:n] - exact.values[:n]) / np.abs(exact.values[:n]), initial=0.0))

    def _add(self, pairs: Eigenpairs) -> None:
        for x in pairs.right.T:
            self._columns += [x.real, x.imag] if np.max(np.abs(x.imag)) > 0 else [x.real]

    def _project(self) -> None:
        """Make the columns M-orthonormal and project every piece."""
        system = self.system
        self._index = [i for i, p in enumerate(system.pieces) if p.kind in "MCK"]
        pieces = [system.pieces[i] for i in self._index]
        masses = [p.operator for p in pieces if p.kind == "M"]

        def massed(X: Array) -> Any:
            return sum(times(M, X) for M in masses)

        self.V = orthonormal(self.comm, np.array(self._columns).T, massed)
        self.mass = massed(self.V)
        products = [times(p.operator, self.V) for p in pieces]
        self._pieces = [(p, summed(self.comm, self.V.T @ PV)) for p, PV in zip(pieces, products, strict=True)]
        self._grams = np.array([[summed(self.comm, A.T @ B) for B in products] for A in products])
        self._metric = summed(self.comm, self.V.T @ self.V)
        self._norms = [float(p.operator.norm()) for p in pieces]
        self._round_off = RoundOff(Pencil(*system.mass_damping_stiffness(keep=False)))

    def at(self, speed: float, count: int, start: Spinning | None = None, keep: bool = True) -> Spinning:
        """Return the eigenpairs of the basis at a speed (see `ModalAnalysis.at`), with errors in the full system."""
        system = self.system
        zero = system.zeros()
        c = system.coefficients(system.motion.at_speed(speed))[self._index]
        small = {kind: np.zeros((self.V.shape[1],) * 2) for kind in "MCK"}
        for ci, (p, matrix) in zip(c, self._pieces, strict=True):
            small[p.kind] += ci * matrix
        pencil = SmallPencil(*(PETSc.Mat().createAIJ(m.shape, csr=_csr(m), comm=MPI.COMM_SELF) for m in small.values()))
        pairs = pencil.solve(min(count, self.V.shape[1] - 1))
        pairs.errors = self._backward_errors(pairs, c)
        n = np.diag(pencil.gram(pairs.left, pairs.values, pairs.right, pairs.values))
        lost = self._round_off.stiffness(self.V @ pairs.left, self.V @ pairs.right)
        pairs.bounds = relative(lost / np.maximum(np.abs(n * pairs.values), 1e-300)) + pairs.bounds
        pencil.owner = self
        return Spinning(speed, zero, pencil, pairs, pencil)

    def right(self, spinning: Spinning) -> Array:
        """Return the eigenvectors in the unknowns of the mesh."""
        return self.V @ spinning.pairs.right

    def mass_times(self, spinning: Spinning) -> Array:
        """Return M times the eigenvectors."""
        return np.asarray(self.mass @ spinning.pairs.right)

    def _backward_errors(self, pairs: Eigenpairs, c: Array) -> Array:
        """Return the normwise backward errors of the lifted eigenpairs in the full system, shape (m,).

        Norms of full vectors are taken by products of the columns, so nothing below 1e-8 is seen.
        """
        power = {"M": 2, "C": 1, "K": 0}
        out = np.empty(len(pairs.values))
        for j, (lam, x) in enumerate(zip(pairs.values, pairs.right.T, strict=True)):
            factors = np.array([ci * lam ** power[p.kind] for ci, (p, _) in zip(c, self._pieces, strict=True)])
            residual = np.einsum("i,k,a,ikab,b->", factors.conj(), factors, x.conj(), self._grams, x).real
            size = float(np.abs(factors) @ self._norms) * np.sqrt((x.conj() @ self._metric @ x).real)
            out[j] = np.sqrt(max(residual, 0.0)) / size
        return out


def _csr(m: Array) -> tuple[Array, Array, Array]:
    n = len(m)
    return np.arange(n + 1, dtype=np.int32) * n, np.tile(np.arange(n, dtype=np.int32), n), m.ravel()
