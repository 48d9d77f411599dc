"""What the pieces of a linear theory do at the clamp, of the unknowns near it alone."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.equations.modal_damping import EFFECT as DAMPING
from rotfem.equations.model import Model
from rotfem.numerics import compat
from rotfem.structures.root_reaction import RootReaction

if TYPE_CHECKING:
    from rotfem.equations.pieces import Piece

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


class AtClamp:
    """Says what an operator, its clamp not held, does in the unit motions of the clamp, of this process.

    Args:
        model: the terms that operators are of.
        clamped: local numbers of the clamped unknowns.
        root: unit motions of the clamp.
    """

    def __init__(self, model: Model, clamped: npt.NDArray[Any], root: RootReaction):
        self._model, self._V = model, model.structure.V
        self._work = compat.create_vector(self._V)
        fixed = np.zeros((len(root.weights), 1), dtype=bool)
        fixed[clamped] = True
        self._motions = self._moved(np.where(fixed, root.weights, 0.0))
        self._turns = self._moved(np.where(fixed, 0.0, root.weights))  # of its hinges
        damping = model.mechanics.damping
        by_mass = damping.mass is not None or bool(damping.models)
        self._others = self._moved(np.where(fixed, 0.0, root.carried())) if by_mass else None

    def _moved(self, columns: Array) -> tuple[Any, Array]:
        """Return the rows that motions (owned rows, a column each) move, global numbers, and what these are there."""
        rows = np.flatnonzero(np.any(columns != 0.0, axis=1))
        first = self._work.getOwnershipRange()[0]
        return PETSc.IS().createGeneral((first + rows).astype(PETSc.IntType), comm=self._work.comm), columns[rows]

    def of_vector(self, b: Any) -> Array:
        """Return one number for each motion."""
        rows, motions = self._motions
        return np.asarray(b.array[rows.getIndices() - b.getOwnershipRange()[0]] @ motions)

    def of_matrix(self, A: Any, of: Collection[str]) -> Array:
        """Return a row for each owned unknown.

        Args:
            A: PETSc matrix.
            of: terms that it is of (see `Piece`).
        """
        if any(self._model.acting[n].at_root for n in of if n in self._model.acting):
            return -self._times(A, self._turns)
        if DAMPING in of and self._others is not None:  # the hub takes up what strains do not (see `hub_damping`)
            return -self._times(A, self._others)
        return self._times(A, self._motions)

    def _times(self, A: Any, moved: tuple[Any, Array]) -> Array:
        """Return Aᵀ times motions, owned rows; only the rows of A that they move are multiplied."""
        rows, motions = moved
        there = A.createSubMatrix(rows)
        motion = there.createVecs()[1]
        out = np.zeros((len(self._work.array), motions.shape[1]))
        for column, values in zip(out.T, motions.T, strict=True):
            motion.array[:] = values
            there.multTranspose(motion, self._work)
            column[:] = self._work.array
        return out


class ClampRows:
    """Sums of pieces in the unit motions of the clamp (see `rotfem.structures.root_reaction`), of this process.

    Args:
        pieces: all of them.
        motions: number of unit motions.
    """

    def __init__(self, pieces: Sequence[Piece], motions: int):
        self._motions = motions
        kinds = {kind: [i for i, p in enumerate(pieces) if p.kind == kind] for kind in "MCKf"}
        self._kinds: dict[str, Index] = {kind: np.array(index, dtype=np.int64) for kind, index in kinds.items()}
        parts = [pieces[i].at_root for i in self._kinds["f"]]
        self._loads = np.array(parts).reshape(len(parts), motions)
        #: For each kind the unknowns that act on the clamp, and what each piece makes of them.
        self._near: dict[str, tuple[Index, Array]] = {}
        for kind in "KCM":
            rows = [pieces[i].at_root for i in self._kinds[kind]]
            whole = np.array(rows).reshape(len(rows), -1, motions) if rows else np.zeros((0, 0, motions))
            near = np.flatnonzero(np.any(whole != 0.0, axis=(0, 2)))
            self._near[kind] = near, whole[:, near].reshape(len(rows), len(near) * motions)

    def tangents(self, c: Array, unknowns: int) -> tuple[Array, Array, Array]:
        """Return the derivatives of these forces to q, v and a, each (unknowns, motions), at factors of all pieces."""
        out = np.zeros((3, unknowns, self._motions))
        for part, kind in zip(out, "KCM", strict=True):
            near, products = self._near[kind]
            part[near] = (c[self._kinds[kind]] @ products).reshape(len(near), self._motions)
        return out[0], out[1], out[2]

    def __call__(self, c: Array, state: tuple[Array, ...]) -> Array:
        """Return the forces of the clamp, (motions,).

        Args:
            c: factors of all pieces.
            state: local dof arrays of q, v, a.
        """
        out: Array = c[self._kinds["f"]] @ self._loads
        for kind, x in zip("KCM", state, strict=True):
            near, products = self._near[kind]
            out = out + x[near] @ (c[self._kinds[kind]] @ products).reshape(len(near), self._motions)
        return out
