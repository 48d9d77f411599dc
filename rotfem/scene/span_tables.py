"""Tables over the span: numbers, points of the section, matrices or loads, as rows, functions or files of a scene.

A table is ((x, value), …) with x (m) strictly increasing from 0; it is linear in between, entry by entry. One of a load
may start anywhere and jump. A file stands for one table, for a section with a column for each property, or for a blade.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import GetCoreSchemaHandler, PlainValidator, ValidationInfo
from pydantic_core import CoreSchema, core_schema

from rotfem.scene.files import Check, as_table, read_header, read_rows, table_text
from rotfem.scene.signals import arguments
from rotfem.scene.table import did_you_mean, problem, problems_at
from rotfem.scene.values import (
    Bounds,
    Matrix,
    Profile,
    as_number,
    as_symmetric_matrix,
    as_vector,
    check_increasing,
)

#: A table, or a function in its place.
Over: TypeAlias = Matrix | Callable[..., Any]


# --- of loads ---------------------------------------------------------------------------------------------------------


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
        table = as_table(value, info, [len(over) + size for size in self.sizes], shape, CHECKS[over])
        return tuple((*row[: len(over)], *self._filled(row[len(over) :])) for row in table)

    def _filled(self, vector: tuple[float, ...]) -> tuple[float, ...]:
        return (*vector, *(0.0,) * (self.padded - len(vector)))


FORCE = Kind((2, 3), ("f1, f2", "f1, f2, f3"), padded=3)
MOMENT = Kind((1, 3), ("m", "m1, m2, m3"))
PRESSURE = Kind((1,), ("p",))


def check_span(rows: Matrix, value: Any, shape: str, row_name: Callable[[int], str]) -> None:
    """Refuse rows (x, …) whose x (m) decreases, or does not change; one x may stand in two of them: a jump."""
    x = [row[0] for row in rows]
    if len(rows) < 2 or x[0] == x[-1]:
        raise problem("", value, f"must be {shape} with at least two rows at different x")
    for i, (before, after) in enumerate(pairwise(x), start=2):
        if after < before:
            raise problem("", value, f"the first column must not decrease; {row_name(i)}: {after:g} < {before:g}")
    most = max(Counter(x).items(), key=lambda item: item[1])
    if most[1] > 2:
        raise problem("", value, f"x = {most[0]:g} stands in {most[1]} rows; must be in one, or in two, where it jumps")


def check_grid(rows: Matrix, value: Any, shape: str, row_name: Callable[[int], str]) -> None:
    """Refuse rows (x, t, …) unless every x (m), at least two, stands with every t (s), at least two."""
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


#: What a table is over ↦ what checks its rows.
CHECKS: dict[tuple[str, ...], Check] = {("t",): check_increasing, ("x",): check_span, ("x", "t"): check_grid}


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
    if len(entries) == 36:
        M = np.reshape(entries, (6, 6))
    else:
        M = np.zeros((6, 6))
        M[np.triu_indices(6)] = entries
        M += np.triu(M, 1).T
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
    entries = {key: [f"{key}_{i + 1}{j + 1}" for i, j in zip(*np.triu_indices(6), strict=True)] for key in MATRICES}
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
