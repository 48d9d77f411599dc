"""Tables over the span of a section: numbers, points or matrices, as rows or files of a scene.

A table is ((x, value), …) with x (m) strictly increasing from 0; it is linear in between, entry by entry. A file stands
for one table, or has a column for each property of a section.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import GetCoreSchemaHandler, PlainValidator, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from rotfem.scene.files import as_table, read_header, read_rows, table_text
from rotfem.scene.table import did_you_mean, problem, problems_at
from rotfem.scene.values import (
    UPPER,
    Bounds,
    Matrix,
    Profile,
    as_number,
    as_symmetric_matrix,
    as_vector,
    symmetric_matrices,
)

# --- of points and matrices of a section ------------------------------------------------------------------------------

Point: TypeAlias = tuple[float, float]
PointTable: TypeAlias = tuple[tuple[float, Point], ...]
MatrixTable: TypeAlias = tuple[tuple[float, Matrix], ...]


def as_point_or_table(value: Any) -> Point | PointTable:
    """Return a point (y, z) in m, or a table of points from rows [x, y, z] or [x, [y, z]]; raise on anything else."""
    shape = "a point [y, z], or a table [[x, y, z], …]"
    if not isinstance(value, list | tuple) or not value:
        raise problem("", value, f"must be {shape}")
    if not isinstance(value[0], list | tuple):
        return _as_point(value)
    rows = [(row[0], row[1:]) if isinstance(row, list | tuple) and len(row) == 3 else row for row in value]
    return _as_table(rows, _as_point, shape)


def as_matrix_or_table(value: Any, *, definite: bool) -> Matrix | MatrixTable:
    """Return a symmetric 6×6 matrix, or a table of them from rows; raise on anything else.

    A row is [x, matrix], or has x and the 36 entries row by row, or the 21 of the upper triangle.
    """

    def entry(matrix: Any) -> Matrix:
        return as_symmetric_matrix(matrix, 6, definite=definite)

    first = value[0] if isinstance(value, list | tuple) and value else None
    if isinstance(first, list | tuple) and len(first) in (2, *FLAT):
        rows = [[row[0], _matrix(as_vector(row[1:], (21, 36)))] if len(first) in FLAT else row for row in value]
        return _as_table(rows, entry, "a table [[x, matrix], …]")
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
        with problems_at("", None, f"row {number}: "):
            out.append((as_number(row[0]), entry(row[1])))
        if len(out) > 1 and out[-1][0] <= out[-2][0]:
            raise problem("", None, f"x must increase strictly; row {number}: {out[-1][0]:g} ≤ {out[-2][0]:g}")
    if out[0][0] != 0.0:
        raise problem("", None, f"the table must start at x = 0, not at {out[0][0]:g}")
    return tuple(out)


# --- in files ---------------------------------------------------------------------------------------------------------

#: Numbers of columns of rows that have a matrix in them: x and its entries.
FLAT = (22, 37)

#: Keys of a section that hold matrices, and points.
MATRICES, POINTS = ("stiffness", "mass"), ("mass_center", "shear_center", "tension_center")


def is_path(value: Any) -> bool:
    """Return whether a value names a file: any text that is no name of a file is left to who wants a number."""
    return isinstance(value, Path) or (isinstance(value, str) and re.search(r"\.[A-Za-z]\w*$", value) is not None)


@dataclass(frozen=True)
class FromFile:
    """As an annotation of a type: the path of a file may stand in the place of rows.

    Attributes:
        columns: numbers of columns that are allowed.
        shape: how such rows are written, for messages.
    """

    columns: tuple[int, ...]
    shape: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_before_validator_function(self, handler(source))

    def __call__(self, value: Any, info: ValidationInfo) -> Any:
        """Return the rows of the file that a value names; else the value."""
        return as_table(value, info, self.columns, self.shape) if is_path(value) else value


OF_FILE = FromFile((2,), "a table [[x, value], …]")
PositiveProfile = Annotated[Profile, PlainValidator(Bounds(gt=0.0).profile), OF_FILE]
NonNegativeProfile = Annotated[Profile, PlainValidator(Bounds(ge=0.0).profile), OF_FILE]
AnyProfile = Annotated[Profile, PlainValidator(Bounds().profile), OF_FILE]


def _matrix(entries: Sequence[float]) -> list[list[float]]:
    """Return a matrix (6, 6) of its 36 entries, or of the 21 of its upper triangle."""
    M = np.reshape(entries, (6, 6)) if len(entries) == 36 else symmetric_matrices(entries)
    return [list(map(float, row)) for row in M]


def file_columns(value: Any, info: ValidationInfo) -> dict[str, Any]:
    """Return the properties of a section from a file whose header names its columns."""
    path, text = table_text(value, info)
    names = read_header(text)
    if not names or names[0] != "x":
        first = f' "{names[0]}"' if names else ""
        raise problem("", str(path), f"its first row must name the columns, x first, not{first or ' numbers'}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise problem("", str(path), f'column "{twice}" stands twice')
    table = np.array(list(read_rows(text, path).values()))
    x, column = table[:, 0].tolist(), dict(zip(names, table.T, strict=True))
    del column["x"]
    out: dict[str, Any] = {}
    entries = {key: [f"{key}_{place}" for place in UPPER] for key in MATRICES}
    entries |= {key: [f"{key}_y", f"{key}_z"] for key in POINTS}
    for key, parts in entries.items():
        given = {name: column.pop(name) for name in parts if name in column}
        if given:
            values = np.stack([given.get(name, np.zeros(len(x))) for name in parts], axis=-1)
            out[key] = [[at, _matrix(v) if key in MATRICES else v.tolist()] for at, v in zip(x, values, strict=True)]
    for name in column:
        if name.startswith(tuple(f"{key}_" for key in entries)) and name != "mass_per_length":
            hint = did_you_mean(name, [part for parts in entries.values() for part in parts])
            raise problem("", str(path), f'unknown column "{name}"; {hint}upper triangles only, as stiffness_12')
    return out | {name: np.stack([x, values], axis=-1).tolist() for name, values in column.items()}
