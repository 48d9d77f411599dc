"""Tables over the span whose values are numbers, points of the section or matrices: read, and evaluated along the beam.

A table is ((x, value), …) with x (m) strictly increasing from 0; it is linear in between, entry by entry.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic_core import PydanticCustomError

from rotfem.scene.values import Array, Matrix, as_number, as_symmetric_matrix, as_vector, problem

Point: TypeAlias = tuple[float, float]
PointTable: TypeAlias = tuple[tuple[float, Point], ...]
MatrixTable: TypeAlias = tuple[tuple[float, Matrix], ...]


def is_table(value: object) -> bool:
    """Return whether a validated value is a table over the span, not one number, point or matrix for all of it."""
    return isinstance(value, tuple) and isinstance(value[0], tuple) and len(value[0]) == 2


def evaluate_table(value: Any, x: npt.ArrayLike) -> Array:
    """Return a validated value at positions x (m), any shape (…): shape (…, *shape of the value)."""
    positions = np.asarray(x, dtype=np.float64)
    if not is_table(value):
        entry = np.asarray(value, dtype=np.float64)
        return np.broadcast_to(entry, (*positions.shape, *entry.shape)).copy()
    knots = np.array([row[0] for row in value])
    entries = np.array([row[1] for row in value], dtype=np.float64)
    columns = entries.reshape(len(knots), -1).T
    values = np.stack([np.interp(positions, knots, column) for column in columns], axis=-1)
    return np.asarray(values.reshape(*positions.shape, *entries.shape[1:]))


def as_point_or_table(value: Any) -> Point | PointTable:
    """Return a point (y, z) in m, or a table of points from rows [x, y, z] or [x, [y, z]]; raise on anything else."""
    shape = "a point [y, z], or a table [[x, y, z], …]"
    if not isinstance(value, list | tuple) or not value:
        raise problem("", value, f"must be {shape}")
    if not isinstance(value[0], list | tuple):
        return _as_point(value)
    rows = [
        (row[0], row[1:]) if isinstance(row, list | tuple) and len(row) == 3 else row  # one row for each x
        for row in value
    ]
    return _as_table(rows, _as_point, shape)


def as_matrix_or_table(value: Any, *, definite: bool) -> Matrix | MatrixTable:
    """Return a symmetric 6×6 matrix, or a table of them from rows [x, matrix]; raise on anything else."""

    def entry(matrix: Any) -> Matrix:
        return as_symmetric_matrix(matrix, 6, definite=definite)

    first = value[0] if isinstance(value, list | tuple) and value else None
    if isinstance(first, list | tuple) and len(first) == 2:
        return _as_table(value, entry, "a table [[x, matrix], …]")
    return entry(value)


def _as_point(value: Any) -> Point:
    y, z = as_vector(value, (2,))
    return y, z


def _as_table(value: Sequence[Any], entry: Callable[[Any], Any], shape: str) -> tuple[tuple[float, Any], ...]:
    """Return the table of rows (x, value), each value read by `entry`."""
    if len(value) < 2:
        raise problem("", value, f"must be {shape} with at least two rows")
    out: list[tuple[float, Any]] = []
    for number, row in enumerate(value, start=1):
        if not isinstance(row, list | tuple) or len(row) != 2:
            raise problem("", None, f"must be {shape}; row {number} is none")
        try:
            x = as_number(row[0])
            out.append((x, entry(row[1])))
        except PydanticCustomError as error:
            raise problem("", None, f"row {number}: {error.message()}") from None
        if len(out) > 1 and x <= out[-2][0]:
            raise problem("", None, f"x must increase strictly; row {number}: {x:g} ≤ {out[-2][0]:g}")
    if out[0][0] != 0.0:
        raise problem("", None, f"the table must start at x = 0, not at {out[0][0]:g}")
    return tuple(out)
