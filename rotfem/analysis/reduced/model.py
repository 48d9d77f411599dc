"""A linear theory between the columns of a basis: V (n, m) with q = V η, and every piece as a small matrix."""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from rotfem.equations.pieces import PRESTRESS
from rotfem.numerics.eigenproblem import is_symmetric
from rotfem.numerics.linear import MIDDLE, DirectSolver, combine
from rotfem.numerics.projection import orthonormal, summed, times

Array = npt.NDArray[np.float64]

#: Condition of the masses from which some motion has none to speak of: its frequency is 3e4 times the lowest.
SINGULAR = 1e9
Index = npt.NDArray[np.int64]

#: Part of its energy that a shape must have beside those of the basis, to be told from round-off: what a solution with
#: a stiffness of condition 1e8 is off, squared.
BESIDE = 1e-15


class ReducedModel:
    """Pieces of a linear theory in a basis that is orthonormal in strain energy, V·K₀V = 1, and can grow.

    Args:
        system: equations of a linear theory, the hub held.
        active: numbers of the pieces that are ever there.

    Attributes:
        V: basis, local dof arrays with their ghosts, shape (n, m).
        kinds: "M", "C", "K", "f" ↦ numbers of the active pieces of that kind.
        small: "M", "C", "K" ↦ projected pieces (p, m, m), "f" ↦ (p, m).
    """

    def __init__(self, system: Any, active: Index):
        self.system, self.comm = system, system.comm
        space = system.V.dofmap
        self.owned = slice(0, space.index_map.size_local * space.index_map_bs)
        pieces = [(int(i), system.pieces[int(i)]) for i in active]
        self.kinds = {kind: [i for i, p in pieces if p.kind == kind] for kind in "MCKf"}
        self.V: Array = np.empty((len(system.zeros()), 0))
        owned = self.V[self.owned]
        self._products = {i: owned for kind in "MCK" for i in self.kinds[kind]}
        self._strained = owned
        loads = [system.pieces[i].operator.array[self.owned] for i in self.kinds["f"]]
        self._loads = np.array(loads).reshape(len(loads), self.owned.stop)
        self.small: dict[str, Array] = {kind: np.empty((len(self.kinds[kind]), 0, 0)) for kind in "MCK"}
        self.small["f"] = np.empty((len(self.kinds["f"]), 0))
        self._ghosted = fem.Function(system.V)

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.V.shape[1]

    def energy_product(self, X: Array) -> Array:
        """Return K₀ X of owned rows: forces of the strains."""
        return times(self.system.material, X)

    def energies(self, X: Array) -> Array:
        """Return twice the strain energy of each column (owned rows)."""
        return np.asarray(summed(self.comm, np.einsum("ij,ij->j", X, self.energy_product(X))))

    def grow(self, columns: Array, most: int | None = None, least: float = 0.0) -> int:
        """Add to the basis what columns span beside it, those with the largest energy first; return how many.

        Args:
            columns: local dof arrays, shape (n, k).
            most: number of shapes that are added; all if None.
            least: twice the strain energy that a shape has to have beside the basis.
        """
        X, V = columns[self.owned], self.V[self.owned]
        whole = self.energies(X)
        for _ in range(2):
            X = X - V @ summed(self.comm, self._strained.T @ X)
        gram = summed(self.comm, X.T @ self.energy_product(X))
        energies, turns = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = np.flatnonzero(energies > max(least, BESIDE * float(whole.max(initial=0.0))))[::-1][:most]
        if not len(keep):
            return 0
        X = X @ (turns[:, keep] / np.sqrt(energies[keep]))
        new = orthonormal(self.comm, X - V @ summed(self.comm, self._strained.T @ X), self.energy_product)
        self._append(new)
        return new.shape[1]

    def _append(self, new: Array) -> None:
        self.V = np.hstack([self.V, self._with_ghosts(new)])
        self._strained = np.hstack([self._strained, self.energy_product(new)])
        V = self.V[self.owned]
        for i, old in self._products.items():
            self._products[i] = np.hstack([old, times(self.system.pieces[i].operator, new)])
        m = self.size
        for kind in "MCK":
            projected = [summed(self.comm, V.T @ self._products[i]) for i in self.kinds[kind]]
            self.small[kind] = np.array(projected).reshape(-1, m, m)
        self.small["f"] = np.asarray(summed(self.comm, self._loads @ V))

    def _with_ghosts(self, columns: Array) -> Array:
        """Return local dof arrays (n, k) of columns of owned rows."""
        if self.comm.size == 1:
            return columns
        out, function = np.empty((len(self.V), columns.shape[1])), self._ghosted.x
        for column, x in zip(out.T, columns.T, strict=True):
            function.array[self.owned] = x
            function.scatter_forward()
            column[:] = function.array
        return out

    def turned(self, turns: Array) -> ReducedModel:
        """Return the model in fewer columns V T, from orthonormal columns T (m, k) of coordinates."""
        out = copy(self)
        out.V, out._strained = self.V @ turns, self._strained @ turns
        out._products = {i: product @ turns for i, product in self._products.items()}
        out.small = {kind: turns.T @ self.small[kind] @ turns for kind in "MCK"}
        out.small["f"] = self.small["f"] @ turns
        return out

    def operators(self, c: Array) -> tuple[Array, Array, Array, Array]:
        """Return M, C, K (n, m, m) and f (n, m) from the factors of all pieces (n, pieces)."""
        M, C, K = (np.asarray(np.tensordot(c[:, self.kinds[k]], self.small[k], 1)) for k in "MCK")
        return M, C, K, c[:, self.kinds["f"]] @ self.small["f"]

    def accelerations(self, c: Array, q: Array, v: Array) -> Array:
        """Return the accelerations (n, m) that keep the reduced equations at coordinates and rates (n, m)."""
        M, C, K, f = self.operators(c)
        force = f + np.einsum("nij,nj->ni", C, v) + np.einsum("nij,nj->ni", K, q)
        if self.size and np.linalg.cond(M[0]) > SINGULAR:  # what has no mass has no force of inertia either
            return np.asarray(-np.einsum("nij,nj->ni", np.linalg.pinv(M, 1 / SINGULAR, hermitian=True), force))
        return -np.linalg.solve(M, force[:, :, None])[:, :, 0]

    def residuals(self, c: Array, q: Array, v: Array, a: Array) -> Array:
        """Return M a + C v + K q + f of the full system at k instants, owned rows (n, k).

        Args:
            c: factors of all pieces, (k, pieces).
            q: coordinates, (k, m).
            v: rates.
            a: accelerations.
        """
        out = (c[:, self.kinds["f"]] @ self._loads).T
        for kind, x in (("M", a), ("C", v), ("K", q)):
            for i in self.kinds[kind]:
                out += self._products[i] @ (c[:, i, None] * x).T
        return np.asarray(out)

    def forces(self, kind: str, c: Array) -> Array:
        """Return M V, C V or K V of the full system from the factors of all pieces (pieces,), owned rows (n, m)."""
        zero = np.zeros_like(self.V[self.owned])
        return np.asarray(sum((c[i] * self._products[i] for i in self.kinds[kind]), zero))

    def product(self, number: int) -> Array:
        """Return the matrix of a piece times V, owned rows (n, m)."""
        return self._products[number]

    def stiffness(self, c: Array) -> DirectSolver:
        """Return a solver with the stiffness of the full system, from the factors of all pieces (pieces,)."""
        pieces = self.system.pieces
        there = [i for i in self.kinds["K"] if c[i] != 0.0]
        strains = [i for i, p in enumerate(pieces) if p.kind == "K" and "internal" in p.of and PRESTRESS not in p.of]
        if there == strains and np.all(c[there] == 1.0) and not self.system.structure.hinges:
            solver: DirectSolver = self.system.material_solver
            return solver
        A = self.system.A.duplicate()
        combine(A, [pieces[i].operator for i in there], c[there])
        return DirectSolver(A, symmetric=A.getSize()[0] > MIDDLE and is_symmetric(A))

    def solve(self, solver: DirectSolver, right: Array) -> Array:
        """Return the solutions (local dof arrays (n, k)) with right-hand sides of owned rows, (n, k)."""
        return self._with_ghosts(solver.solve_all(right))

    def load(self, c: Array) -> Array:
        """Return f of the full system, owned rows."""
        return np.asarray(c[self.kinds["f"]] @ self._loads)

    def coordinates(self, shape: Array) -> Array:
        """Return the coordinates (m,) of a shape (local dof array) in the span of the basis."""
        return np.asarray(summed(self.comm, self.energy_product(self.V[self.owned]).T @ shape[self.owned]))
