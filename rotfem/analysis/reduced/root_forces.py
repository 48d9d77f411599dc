"""Forces of the clamp in the coordinates of a basis: those of the full residual at the motion that the basis gives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]


def root_forces(model: ReducedModel, c: Array, states: dict[str, Array]) -> Array:
    """Return what the hub does in the unit motions of the clamp (see `RootReaction`), shape (n, motions).

    Args:
        model: the reduced model.
        c: factors of all pieces, (n, pieces).
        states: "K", "C", "M" ↦ coordinates, their rates and accelerations, (n, m).
    """
    pieces, V = model.system.pieces, model.V[model.owned]
    parts = [pieces[i].at_root for i in model.kinds["f"]]
    constant = np.array(parts).reshape(len(parts), len(model.system.root.names))
    out: Array = c[:, model.kinds["f"]] @ np.asarray(summed(model.comm, constant))
    for kind, x in states.items():
        for i in model.kinds[kind]:
            out += c[:, [i]] * (x @ np.asarray(summed(model.comm, V.T @ pieces[i].at_root)))
    return out
