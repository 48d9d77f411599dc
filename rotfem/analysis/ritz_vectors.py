"""A few shapes that span what moves the tip: Lanczos vectors of a tangent that start from unit forces at the tip.

What the tip shows of a motion are the modes that have a displacement there, and these are what the Krylov space of
K⁻¹ M from unit forces at the tip holds, the lowest first; the others follow as if they had no mass (load-dependent Ritz
vectors: Wilson, Yuan & Dickens 1982).
"""

from __future__ import annotations

from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg
from petsc4py import PETSc

from rotfem.numerics.linear import DirectSolver

Array = npt.NDArray[np.float64]

#: Vectors from a force along the structure, of which two leave its lowest frequency 5 % off, and from one across it.
ALONG, ACROSS = 3, 6

#: Part of its length a vector must keep when the others are taken out of it.
DEPENDENT = 1e-6


class RitzVectors:
    """Columns V with Vᵀ M V = 1 and Vᵀ K V diagonal, in the locally owned unknowns of a structure.

    Args:
        system: equations of the structure, its hub held.
        M: mass matrix, clamped unknowns 0.
        K: stiffness matrix, clamped unknowns 1.
        shift: K + shift M (1/s²) is what forces are divided by; must be regular.

    Attributes:
        V: shape (n, r).
        massed: M V.
        squares: diagonal of Vᵀ K V, 1/s², increasing.
        stiffness: Vᵀ K V, (r, r), of which only the symmetric part is diagonal.
        tip: displacement of the tip of each column, shape (d, r), on every rank.
        shift: as it was given.
        made: squares of the columns as they were made.
        block: number of unknowns of a node.
    """

    def __init__(self, system: Any, M: Any, K: Any, shift: float):
        self.comm: Any = system.comm
        self.block, self.shift = int(system.V.dofmap.index_map_bs), shift
        self._x, self._y = M.createVecs()
        A = K.copy()
        A.axpy(shift, M, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self.V: Array
        self.massed: Array
        self.V, self.massed = self._spanned(system, M, DirectSolver(A))
        self.tip: Array = self._at_tip(system)
        self.stiffness: Array
        self.squares: Array
        self.turn_to(K)
        self.made = self.squares

    def turn_to(self, K: Any) -> None:
        """Combine the columns so that another K near by is diagonal, with the mass that they have."""
        stiffness = self.product(K)
        self.squares, turn = np.linalg.eigh(_symmetric(stiffness))
        self._combine(stiffness, turn, self.massed)

    def turned_to(self, M: Any, K: Any, shift: float) -> RitzVectors:
        """Return combinations of the columns with which another M and K near by are diagonal."""
        out = copy(self)
        out.shift, (out._x, out._y) = shift, M.createVecs()
        massed = out._all_times(M)
        stiffness, mass = out.sum(np.array([out.V.T @ out._all_times(K), out.V.T @ massed]))
        out.squares, turn = scipy.linalg.eigh(_symmetric(stiffness), _symmetric(mass))
        out._combine(stiffness, turn, massed)
        return out

    def sum(self, local: Array) -> Array:
        """Return the sum over all ranks."""
        return local if self.comm.size == 1 else np.asarray(self.comm.allreduce(local))

    def times(self, A: Any, x: Array) -> Array:
        """Return A x of owned unknowns."""
        self._x.array[:] = x
        A.mult(self._x, self._y)
        return np.array(self._y.array)

    def product(self, A: Any) -> Array:
        """Return Vᵀ A V, shape (r, r)."""
        return self.sum(self.V.T @ self._all_times(A))

    def _all_times(self, A: Any) -> Array:
        """Return A V."""
        x, y, out = self._x.array, self._y.array, np.empty_like(self.V)
        for i, column in enumerate(self.V.T):
            x[:] = column
            A.mult(self._x, self._y)
            out[:, i] = y
        return out

    def _combine(self, stiffness: Array, turn: Array, massed: Array) -> None:
        """Combine the columns, of which Vᵀ K V and M V are given."""
        self.stiffness = turn.T @ stiffness @ turn
        self.V, self.massed, self.tip = self.V @ turn, massed @ turn, self.tip @ turn

    def _spanned(self, system: Any, M: Any, solver: DirectSolver) -> tuple[Array, Array]:
        """Return the columns before they are combined, orthonormal with M, and M times them."""
        moves = [i for i, name in enumerate(system.structure.unknowns) if name.startswith("u")]
        V, massed = np.empty((2, ALONG + ACROSS * len(moves), self._x.getLocalSize()))
        forces, r = {i: self._force(system, i) for i in moves}, 0
        for step in range(ACROSS):
            block = [i for i in forces if i > 0 or step < ALONG]
            if not block:  # all directions are spanned
                break
            X = np.array([self._solved(solver, forces[i], system.clamped) for i in block])
            MX = np.array([self.times(M, x) for x in X])
            sizes = self.sum(np.einsum("ij,ij->i", X, MX))
            forces = {}
            for i, x, Mx, size in zip(block, X, MX, sizes, strict=True):
                for _ in range(2):
                    other = self.sum(massed[:r] @ x)
                    x, Mx = x - other @ V[:r], Mx - other @ massed[:r]
                left = float(self.sum(np.array(x @ Mx)))
                if not left > DEPENDENT**2 * size:  # nothing is left of it without the others
                    continue
                V[r], massed[r] = x / np.sqrt(left), Mx / np.sqrt(left)
                forces[i], r = massed[r], r + 1
        return np.ascontiguousarray(V[:r].T), np.ascontiguousarray(massed[:r].T)

    def _at_tip(self, system: Any) -> Array:
        """Return the displacement of the tip of every column, (d, r)."""
        values, names = system.structure.tip_values, system.structure.unknowns
        dofs = [values.dofs.start + i for i, name in enumerate(names) if name.startswith("u")]
        out: Array = np.zeros((len(dofs), self.V.shape[1]))
        if self.comm.rank == values.owner:
            out[:] = self.V[dofs]
        if self.comm.size > 1:
            self.comm.Bcast(out, root=values.owner)
        return out

    def _force(self, system: Any, component: int) -> Array:
        """Return a unit force at the tip, owned unknowns."""
        values, out = system.structure.tip_values, np.zeros(self._x.getLocalSize())
        if self.comm.rank == values.owner:
            out[values.dofs.start + component] = 1.0
        return out

    def _solved(self, solver: DirectSolver, b: Array, clamped: Any) -> Array:
        self._x.array[:] = b
        self._x.array[clamped] = 0.0
        solver.solve(self._x, self._y)
        return np.array(self._y.array)


def _symmetric(A: Array) -> Array:
    return 0.5 * (A + A.T)
