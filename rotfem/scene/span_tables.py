"""Tables over the span: numbers, points of the section, matrices or loads, as rows, functions or files of a scene.

A table is ((x, value), …) with x (m) strictly increasing from 0; it is linear in between, entry by entry. One of a load
may start anywhere and jump. A file stands for one table, for a section with a column for each property, or for a blade.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from rotfem.scene.blades.deck import Asked, keys_of
from rotfem.scene.files import ROW_BYTES, Reader, as_table, existing_file, read_header, read_rows, read_text
from rotfem.scene.signals import arguments
from rotfem.scene.table import did_you_mean, problem, problems_at
from rotfem.scene.values import (
    Matrix,
    as_increasing_rows,
    as_number,
    as_rows,
    as_symmetric_matrix,
    as_vector,
    limits_in,
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
        with problems_at("", None, f"row {number}: "):
            out.append((as_number(row[0]), entry(row[1])))
        if len(out) > 1 and out[-1][0] <= out[-2][0]:
            raise problem("", None, f"x must increase strictly; row {number}: {out[-1][0]:g} ≤ {out[-2][0]:g}")
    if out[0][0] != 0.0:
        raise problem("", None, f"the table must start at x = 0, not at {out[0][0]:g}")
    return tuple(out)


# --- in files ---------------------------------------------------------------------------------------------------------

#: Keys of a section that hold matrices, and points.
MATRICES, POINTS = ("stiffness", "mass"), ("mass_center", "shear_center", "tension_center")

#: Keys of a section that are texts, or numbers that cannot vary.
NO_TABLES = ("shape", "from", "format", "body", "precone")

Rows: TypeAlias = list[list[Any]]


def with_tables(data: Any, info: ValidationInfo, keys: Sequence[str] | None) -> Any:
    """Return the table [structure] with the rows of files in the place of their paths.

    Raise if a file is not there or not such a table, naming line and column, or a key is given twice.
    """
    if not isinstance(data, Mapping):
        return data
    out = {key: _table_at(key, key, value, info) if key in (keys or ()) else value for key, value in data.items()}
    section = out.get("section")
    if not isinstance(section, Mapping):
        return out
    out["section"] = section = _section_tables(section, info)
    if keys is None and (given := [key for key in ("from", "format") if key in section]):
        raise problem(f"section.{given[0]}", section[given[0]], "is only of a spatial_beam")
    if "from" in section:
        with _problems_of("section.from"):
            path = existing_file(section["from"], info)
        without = {key: value for key, value in out.items() if key != "section"}
        with _problems_of("section.from", of_file=True):
            return keys_of(path, Asked(without, section, (info.context or {}).get("hints", [])))
    if "format" in section:
        raise problem("section.format", section["format"], "has no meaning without section.from")
    return out


def _section_tables(section: Mapping[str, Any], info: ValidationInfo) -> dict[str, Any]:
    out = {
        key: value if key in NO_TABLES else _table_at(f"section.{key}", key, value, info)
        for key, value in section.items()
        if key != "file"
    }
    if "file" not in section:
        return out
    with _problems_of("section.file"):
        columns = _columns(section["file"], info)
    for key in columns:
        if key in out:
            raise problem(f"section.{key}", None, "given twice; section.file has a column of it too")
    return columns | out


def is_path(value: Any) -> bool:
    """Return whether a value names a file: any text that is no name of a file is left to who wants a number."""
    return isinstance(value, Path) or (isinstance(value, str) and re.search(r"\.[A-Za-z]\w*$", value) is not None)


@contextmanager
def _problems_of(key: str, of_file: bool = False) -> Iterator[None]:
    """Let problems belong to a key; of a file only those that name none themselves."""
    try:
        yield
    except PydanticCustomError as error:
        context: dict[str, Any] = error.context or {"value": None}
        named = context.get("key") if of_file else None
        raise problem(named or key, context["value"], error.message()) from None


def _table_at(path: str, key: str, value: Any, info: ValidationInfo) -> Any:
    """Return the rows of the file that a value names, x and a number, a point or a matrix; else the value itself."""
    if not is_path(value):
        return value
    with _problems_of(path):
        return _rows(key, value, info)


def _rows(key: str, value: Any, info: ValidationInfo) -> Rows:
    path, text = _text(value, info)
    rows = read_rows(text, path)
    widths = {"x, value": 2}
    if key in POINTS or key == "line":
        widths = {"x, y, z": 3}
    elif key in MATRICES:
        widths = {"x and 36 entries row by row": 37, "x and 21 entries of the upper triangle row by row": 22}
    line, first = next(iter(rows.items()))
    if len(first) not in widths.values():
        raise problem("", str(path), f"line {line} has {len(first)} columns; must be {', or '.join(widths)}")
    return [[row[0], _matrix(row[1:])] if key in MATRICES else list(row) for row in rows.values()]


def _text(value: Any, info: ValidationInfo) -> tuple[Path, str]:
    path, limits = existing_file(value, info), limits_in(info)
    text = read_text(path, 4 * ROW_BYTES * limits.rows)  # a row may have a 6×6 matrix in it
    limits.check("rows", text.count("\n"), value=str(path))
    return path, text


def _matrix(entries: Sequence[float]) -> list[list[float]]:
    """Return a matrix (6, 6) of its 36 entries, or of the 21 of its upper triangle."""
    if len(entries) == 36:
        M = np.reshape(entries, (6, 6))
    else:
        M = np.zeros((6, 6))
        M[np.triu_indices(6)] = entries
        M += np.triu(M, 1).T
    return [list(map(float, row)) for row in M]


def _columns(value: Any, info: ValidationInfo) -> dict[str, Any]:
    """Return the properties of a section from a file whose header names its columns."""
    path, text = _text(value, info)
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
