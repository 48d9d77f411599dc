"""A linear theory in a basis of few shapes: q = V η, and every piece of its equations as a small matrix.

The projected equations are those of the structure between the columns of V (Qu 2004, Model Order Reduction Techniques,
chapter 2),

    Vᵀ(M V η̈ + C V η̇ + K V η + f) = 0,    M, C, K, f = Σ cₚ(t) (piece p),

with VᵀK₀V = 1, K₀ the stiffness of the strains. The energies follow from the same pieces: T = ½ q̇·M q̇ + T1 + T0, where
the centrifugal force is ∂T0/∂q and that of Euler's acceleration Ω̇ d(∂T1/∂q̇)/dΩ.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.equations.pieces import PRESTRESS
from rotfem.numerics.linear import MIDDLE, DirectSolver, combine, restrained, symmetric
from rotfem.numerics.projection import orthonormal, summed, times, with_ghosts

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


class ReducedModel:
    """Pieces of a linear theory in a basis that is orthonormal in strain energy and can grow.

    Args:
        system: equations of a linear theory, the hub held.
        active: numbers of the pieces with a factor that is ever other than zero.

    Attributes:
        V: basis, local dof arrays with their ghosts, shape (n, m).
        kinds: "M", "C", "K", "f" ↦ numbers of the active pieces of that kind.
        products: numbers of the matrices ↦ their products with the basis, owned rows (n, m).
        small: "M", "C", "K" ↦ projected pieces (p, m, m), "f" ↦ (p, m).
    """

    def __init__(self, system: Any, active: Index):
        self.system, self.comm = system, system.comm
        space = system.V.dofmap
        self.owned = slice(0, space.index_map.size_local * space.index_map_bs)
        pieces = [(int(i), system.pieces[int(i)]) for i in active]
        self.kinds = {kind: [i for i, p in pieces if p.kind == kind] for kind in "MCKf"}
        loads = [system.pieces[i].operator.array[self.owned] for i in self.kinds["f"]]
        self.loads: Array = np.array(loads).reshape(len(loads), self.owned.stop)
        self.take(np.empty((len(system.zeros()), 0)))

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.V.shape[1]

    # --- the basis ---------------------------------------------------------------------------------------------------

    def grow(self, columns: Array, most: int | None = None, least: float = 0.0, motion: Array | None = None) -> int:
        """Add to the basis what columns span outside it, the largest shapes first; return how many.

        A column is distinguished from round-off where it has 1e-15 of its energy outside, the squared error of a
        solution with a stiffness of condition 1e8.

        Args:
            columns: local dof arrays, shape (n, k).
            most: number of shapes that are added; all if None.
            least: size that a shape must have outside the basis, as a part of the motion: in the root of its strain
                energy, or at the tip, which may have little of it.
            motion: coordinates (n, m) of the motion; without it the size is the root of the energy.
        """
        X, V = columns[self.owned], self.V[self.owned]
        whole = np.asarray(summed(self.comm, np.einsum("ij,ij->j", X, self._strained(X))))
        for _ in range(2):
            X = X - V @ summed(self.comm, self._strained(V).T @ X)
        gram = summed(self.comm, X.T @ self._strained(X))
        energies, turns = np.linalg.eigh(0.5 * (gram + gram.T))
        sure = energies > 1e-15 * float(whole.max(initial=0.0))
        sizes, X = np.sqrt(energies[sure]), X @ turns[:, sure]
        parts = sizes
        if motion is not None:
            levers = self.system.structure.lever
            at_tip = np.linalg.norm(levers[:, None] * self.tips(with_ghosts(self.system.V, X)), axis=0)
            parts = sizes / np.linalg.norm(motion, axis=1).max(initial=1e-300)
            parts += at_tip / max(self.largest(motion @ self.tips().T), 1e-300)
        keep = np.flatnonzero(parts > least)
        keep = keep[np.argsort(-parts[keep], kind="stable")][:most]
        if not len(keep):
            return 0
        new = np.hstack([V, X[:, keep] / sizes[keep]])
        self.take(with_ghosts(self.system.V, orthonormal(self.comm, new, self._strained)))
        return len(keep)

    def take(self, V: Array) -> None:
        """Take a basis (n, m), and project all pieces on it."""
        self.V, owned, m = V, V[self.owned], V.shape[1]
        matrices = [i for kind in "MCK" for i in self.kinds[kind]]
        self.products = {i: times(self.system.pieces[i].operator, owned) if m else owned for i in matrices}
        self.small: dict[str, Array] = {"f": np.asarray(summed(self.comm, self.loads @ owned))}
        for kind in "MCK":
            projected = [summed(self.comm, owned.T @ self.products[i]) for i in self.kinds[kind]]
            self.small[kind] = np.array(projected).reshape(len(projected), m, m)

    def _strained(self, X: Array) -> Array:
        """Return K₀ X of owned rows, forces of the strains."""
        return times(self.system.material, X) if X.shape[1] else X

    def coordinates(self, shape: Array) -> Array:
        """Return the coordinates (m,) of a shape (local dof array) in the span of the basis."""
        return np.asarray(summed(self.comm, self._strained(self.V[self.owned]).T @ shape[self.owned]))

    # --- the equations -----------------------------------------------------------------------------------------------

    def operators(self, c: Array) -> tuple[Array, Array, Array]:
        """Return M, C and K (n, m, m) from the factors of all pieces (n, pieces)."""
        M, C, K = (np.asarray(np.tensordot(c[:, self.kinds[k]], self.small[k], 1)) for k in "MCK")
        return M, C, K

    def load(self, c: Array) -> Array:
        """Return f (n, m) likewise."""
        return np.asarray(c[:, self.kinds["f"]] @ self.small["f"])

    def residual(self, c: Array) -> Callable[[Array, Array, Array], Array]:
        """Return M a + C v + K q + f (n, m) as a function of q, v and a (n, m), from the factors (n, pieces)."""
        (M, C, K), f = self.operators(c), self.load(c)
        return lambda q, v, a: f + sum(np.einsum("nij,nj->ni", A, x) for A, x in ((M, a), (C, v), (K, q)))

    def residuals(self, c: Array, q: Array, v: Array, a: Array) -> Array:
        """Return M V a + C V v + K V q + f of the full system at k instants, owned rows (n, k).

        Args:
            c: factors of all pieces, (k, pieces).
            q: coordinates, (k, m).
            v: rates.
            a: accelerations.
        """
        out = (c[:, self.kinds["f"]] @ self.loads).T
        for kind, x in (("M", a), ("C", v), ("K", q)):
            for i in self.kinds[kind]:
                out += self.products[i] @ (c[:, i, None] * x).T
        return np.asarray(out)

    def stiffness(self, c: Array) -> DirectSolver:
        """Return a solver with the full stiffness, hinges held, from the factors of all pieces (pieces,)."""
        pieces = self.system.pieces
        there = [i for i in self.kinds["K"] if c[i] != 0.0]
        strains = [i for i, p in enumerate(pieces) if p.kind == "K" and "internal" in p.of and PRESTRESS not in p.of]
        if there == strains and np.all(c[there] == 1.0):
            solver: DirectSolver = self.system.material_solver
            return solver
        A = self.system.A.duplicate()
        combine(A, [pieces[i].operator for i in there], c[there])
        if self.system.structure.released:
            restrained(A, self.system.structure.hinged_unknowns())
        return DirectSolver(A, symmetric=A.getSize()[0] > MIDDLE and symmetric(A))

    def solve(self, solver: DirectSolver, right: Array) -> Array:
        """Return the solutions (local dof arrays (n, k)) with right-hand sides of owned rows, (n, k)."""
        return with_ghosts(self.system.V, solver.solve_all(right))

    # --- outputs -----------------------------------------------------------------------------------------------------

    def tips(self, shapes: Array | None = None) -> Array:
        """Return the unknowns at the tip of shapes, local dof arrays (n, m), or of the basis; (components, m)."""
        shapes = self.V if shapes is None else shapes
        columns = [self.system.structure.tip_values(column.copy()) for column in shapes.T]
        return np.array(columns).reshape(shapes.shape[1], len(self.system.structure.components)).T

    def largest(self, tips: Array) -> float:
        """Return the largest displacement of the tip of its unknowns (n, components), rotations times a radius, m."""
        return float(np.linalg.norm(tips * self.system.structure.lever, axis=1).max(initial=0.0))

    def of_spin(self, effect: str, degree: int) -> tuple[Array, Array]:
        """Return f (m,) and K (m, m) of an effect at unit speed or rate about the axis, without prestress.

        That of Euler's acceleration is ∂T1/∂q̇ and its derivative by q, the centrifugal one −∂T0/∂q and that of it.

        Args:
            effect: its name.
            degree: in which it depends on the speed, or the rate.
        """
        axis, out = self.system.motion.axis, (np.zeros(self.size), np.zeros((self.size,) * 2))
        components = axis[2:] if self.system.structure.planar else axis
        for kind, sum_ in zip("fK", out, strict=True):
            for place, i in enumerate(self.kinds[kind]):
                piece = self.system.pieces[i]
                if effect in piece.of and PRESTRESS not in piece.of and len(piece.key) == degree:
                    sum_ += np.prod([components[j] for _, j in piece.key]) * self.small[kind][place]
        return out
