"""What moves at the tip in the coordinates of a basis."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.model import ReducedModel

Array = npt.NDArray[np.float64]


def tips_of(model: ReducedModel, shapes: Array | None = None) -> Array:
    """Return the unknowns at the tip of shapes, a local dof array a column, of the basis if None; (components, m)."""
    shapes = model.V if shapes is None else shapes
    columns = [model.system.structure.tip_values(column.copy()) for column in shapes.T]
    return np.array(columns).reshape(shapes.shape[1], len(model.system.structure.components)).T


def largest(model: ReducedModel, tips: Array) -> float:
    """Return the largest length of displacement vectors of the tip (n, components), m."""
    moves = [name.startswith("u") for name in model.system.structure.components]
    return float(np.linalg.norm(tips[:, moves], axis=1).max(initial=0.0))
