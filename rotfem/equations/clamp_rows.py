"""What the pieces of a linear theory do at the clamp, of the unknowns near it alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from rotfem.equations.pieces import Piece

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


class ClampRows:
    """Sums of pieces in the unit motions of the clamp (see `rotfem.structures.root_reaction`), of this process.

    Args:
        pieces: all of them.
        kinds: "M", "C", "K", "f" ↦ numbers of the pieces of that kind.
        motions: number of unit motions.
    """

    def __init__(self, pieces: Sequence[Piece], kinds: Mapping[str, Sequence[int]], motions: int):
        self._motions = motions
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
