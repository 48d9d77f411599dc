"""Tables over the span whose values are numbers, points of the section or matrices: read, and evaluated along the beam.

A table is ((x, value), …) with x (m) strictly increasing from 0; it is linear in between, entry by entry.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from rotfem.scene.files import Reader, as_table
from rotfem.scene.signals import arguments
from rotfem.scene.values import (
    Array,
    Matrix,
    as_increasing_rows,
    as_number,
    as_rows,
    as_symmetric_matrix,
    as_vector,
    problem,
)

#: A table, or a function in its place.
Over: TypeAlias = Matrix | Callable[..., Any]


@dataclass(frozen=True)
class Kind:
    """What the vectors of a load are.

    Attributes:
        sizes: numbers of components that are allowed.
        columns: how rows of components are written, for messages.
        padded: number of components that vectors are filled up to with zeros.
    """

    sizes: tuple[int, ...]
    columns: tuple[str, ...]
    padded: int = 0

    def vector(self, value: Any) -> tuple[float, ...]:
        """Return components; raise if they are none. A number will do where one is allowed."""
        if 1 in self.sizes and not (isinstance(value, list | tuple) and len(self.sizes) > 1):
            return (as_number(value),)
        return self._filled(as_vector(value, self.sizes))

    def rows(self, over: tuple[str, ...], value: Any, info: ValidationInfo) -> Over:
        """Return rows (what they are over, components), or the function of the same that stands in their place."""
        names = ", ".join(over)
        if callable(value):
            if arguments(value) != len(over):
                raise problem("", value, f"must be a function f({names}); it takes {arguments(value)} arguments")
            function: Callable[..., Any] = value
            return function
        shape = "a table " + " or ".join(f"[[{names}, {columns}], …]" for columns in self.columns)
        table = as_table(value, info, [len(over) + size for size in self.sizes], shape, READERS[over])
        return tuple((*row[: len(over)], *self._filled(row[len(over) :])) for row in table)

    def _filled(self, vector: tuple[float, ...]) -> tuple[float, ...]:
        return (*vector, *(0.0,) * (self.padded - len(vector)))


FORCE = Kind((2, 3), ("f1, f2", "f1, f2, f3"), padded=3)
MOMENT = Kind((1, 3), ("m", "m1, m2, m3"))
PRESSURE = Kind((1,), ("p",))


def span_rows(
    value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format
) -> Matrix:
    """Return rows (x, …) with x (m) not decreasing, at least two; one x may stand in two of them: a jump."""
    rows = as_rows(value, columns, shape, row_name)
    x = [row[0] for row in rows]
    if len(rows) < 2 or x[0] == x[-1]:
        raise problem("", value, f"must be {shape} with at least two rows at different x")
    for i, (before, after) in enumerate(pairwise(x), start=2):
        if after < before:
            raise problem("", value, f"the first column must not decrease; {row_name(i)}: {after:g} < {before:g}")
    most = max(Counter(x).items(), key=lambda item: item[1])
    if most[1] > 2:
        raise problem("", value, f"x = {most[0]:g} stands in {most[1]} rows; must be in one, or in two, where it jumps")
    return rows


def grid_rows(
    value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format
) -> Matrix:
    """Return rows (x, t, …), sorted, in which every x (m), at least two, stands with every t (s), at least two."""
    rows = as_rows(value, columns, shape, row_name)
    found: dict[tuple[float, float], int] = {}
    for i, (x, t, *_) in enumerate(rows, start=1):
        if (x, t) in found:
            raise problem("", value, f"{row_name(i)} gives x = {x:g}, t = {t:g} again, after {row_name(found[x, t])}")
        found[x, t] = i
    stations, times = (sorted({pair[k] for pair in found}) for k in (0, 1))
    if len(stations) < 2 or len(times) < 2:
        raise problem("", value, f"must be {shape} with at least two x and two t")
    missing = next(((x, t) for x in stations for t in times if (x, t) not in found), None)
    if missing is not None:
        raise problem("", value, f"has no row for x = {missing[0]:g}, t = {missing[1]:g}; must have every t at every x")
    return tuple(sorted(rows))


#: What a table is over ↦ what reads its rows.
READERS: dict[tuple[str, ...], Reader] = {("t",): as_increasing_rows, ("x",): span_rows, ("x", "t"): grid_rows}


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
