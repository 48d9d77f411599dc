"""Tables over the span of a section: points or matrices as rows, and files with a column for each property.

A table is ((x, value), …) with x (m) strictly increasing from 0; it is linear in between, entry by entry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag, ValidationInfo

from rotfem.scene.files import FROM_FILE, existing_file, read_table
from rotfem.scene.table import did_you_mean, problem, unit
from rotfem.scene.values import (
    UPPER,
    Number,
    Rows,
    T,
    check_increasing,
    check_start,
    check_symmetric,
    is_table,
    symmetric_matrices,
)

#: Keys of a section that hold matrices, and points.
MATRICES, POINTS = ("stiffness", "mass"), ("mass_center", "shear_center", "tension_center")

Point = tuple[Number, Number]
#: A point (y, z) or a matrix for the whole span, or rows (x, point or matrix).
OverSpan = Annotated[
    Annotated[T, Tag("<one>")] | Annotated[tuple[tuple[Number, T], ...], Tag("<rows>")],
    Discriminator(lambda value: "<rows>" if is_table(value) else "<one>"),
    AfterValidator(lambda value: check_start(check_increasing(value)) if is_table(value) else value),
]


def _points(value: Any) -> Any:
    """Return rows [x, y, z] as [x, [y, z]]."""
    return _split(value, {3: lambda point: point})


def _matrices(value: Any) -> Any:
    """Return rows of x and the 36 entries of a matrix row by row, or the 21 of its upper triangle, as [x, matrix]."""
    return _split(value, {37: _matrix, 22: _matrix})


def _split(value: Any, ways: Mapping[int, Callable[[Any], Any]]) -> Any:
    if not isinstance(value, list | tuple):
        return value
    rows = [row if isinstance(row, list | tuple) else () for row in value]
    return [(row[0], ways[len(row)](row[1:])) if len(row) in ways else value[i] for i, row in enumerate(rows)]


def _matrix(entries: Sequence[Any]) -> list[list[Any]]:
    """Return a matrix (6, 6) of its 36 entries, or of the 21 of its upper triangle."""
    at = np.arange(36).reshape(6, 6) if len(entries) == 36 else symmetric_matrices(np.arange(21)).astype(int)
    return [[entries[i] for i in row] for row in at]


def symmetric(size: int, definite: bool) -> AfterValidator:
    """Return what refuses matrices, of a table too, that are not symmetric and positive definite or semidefinite."""

    def check(value: Any) -> Any:
        for x, matrix in value if is_table(value) else [(None, value)]:
            check_symmetric(matrix, size, definite, "" if x is None else f"at x = {x:g} it ")
        return value

    return AfterValidator(check)


Center = Annotated[OverSpan[Point], unit("m"), BeforeValidator(_points), FROM_FILE]
Matrices = Annotated[OverSpan[Rows], BeforeValidator(_matrices), FROM_FILE]


def file_columns(value: Any, info: ValidationInfo) -> dict[str, Any]:
    """Return the properties of a section from a file whose header names its columns."""
    path = existing_file(value, info)
    names, rows = read_table(path)
    if not names or names[0] != "x":
        first = f' "{names[0]}"' if names else ""
        raise problem("", str(path), f"its first row must name the columns, x first, not{first or ' numbers'}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise problem("", str(path), f'column "{twice}" stands twice')
    column = dict(zip(names, np.array(rows).T.tolist(), strict=True))
    x = column.pop("x")
    out: dict[str, Any] = {}
    entries = {key: [f"{key}_{place}" for place in UPPER] for key in MATRICES}
    entries |= {key: [f"{key}_y", f"{key}_z"] for key in POINTS}
    for key, parts in entries.items():
        given = {name: column.pop(name) for name in parts if name in column}
        if given:
            out[key] = list(zip(x, *(given.get(name, [0.0] * len(x)) for name in parts), strict=True))
    for name in column:
        if name.startswith(tuple(f"{key}_" for key in entries)) and name != "mass_per_length":
            hint = did_you_mean(name, [part for parts in entries.values() for part in parts])
            raise problem("", str(path), f'unknown column "{name}"; {hint}upper triangles only, as stiffness_12')
    return out | {name: list(zip(x, values, strict=True)) for name, values in column.items()}
