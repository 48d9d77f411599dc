"""Files that stand for tables over the span: one for each key, or one with a column for each property of a section."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationInfo
from pydantic_core import PydanticCustomError

from rotfem.scene.blades.formats import Asked, keys_of
from rotfem.scene.files import ROW_BYTES, existing_file, read_header, read_rows, read_text
from rotfem.scene.limits import limits_in
from rotfem.scene.problems import did_you_mean
from rotfem.scene.values import problem

#: Keys of a section that hold matrices, and points.
MATRICES, POINTS = ("stiffness", "mass"), ("mass_center", "shear_center", "tension_center")

#: Keys of a section that are texts, or numbers that cannot vary.
NO_TABLES = ("shape", "from", "format", "body", "precone")

#: What the name of a file ends with.
_ENDING = re.compile(r"\.[A-Za-z]\w*$")

#: Bytes of a row with a 6×6 matrix in it, at most, for each row that a table may have.
MATRIX_ROW_BYTES = 4 * ROW_BYTES

Rows = list[list[Any]]


def with_tables(data: Any, info: ValidationInfo, keys: Sequence[str] | None) -> Any:
    """Return the table [structure] with the rows of files in the place of their paths.

    Args:
        data: the table as it is given; what is no table is returned as it is.
        info: validation info; its context holds the scene's directory.
        keys: of the table itself that may be paths; those of its section all may, but names. None of a planar beam,
            which no blade file is one of.

    Raises:
        PydanticCustomError: a file is not there or not such a table, naming line and column; a key is given twice.
    """
    if not isinstance(data, Mapping):
        return data
    out = dict(data)
    for key in keys or ():
        if is_path(out.get(key)):
            out[key] = _named(key, lambda key=key: _rows(key, out[key], info))
    section = out.get("section")
    if not isinstance(section, Mapping):
        return out
    out["section"] = section = _section_tables(section, info)
    if keys is None and (given := [key for key in ("from", "format") if key in section]):
        raise problem(f"section.{given[0]}", section[given[0]], "is only of a spatial_beam")
    if "from" in section:
        path = _named("section.from", lambda: existing_file(section["from"], info))
        without = {key: value for key, value in out.items() if key != "section"}
        asked = Asked(without, section, (info.context or {}).get("hints", []))
        return _located(lambda: keys_of(path, asked))
    if "format" in section:
        raise problem("section.format", section["format"], "has no meaning without section.from")
    return out


def _section_tables(section: Mapping[str, Any], info: ValidationInfo) -> dict[str, Any]:
    out = {key: value for key, value in section.items() if key != "file"}
    for key, value in out.items():
        if key not in NO_TABLES and is_path(value):
            out[key] = _named(f"section.{key}", lambda key=key, value=value: _rows(key, value, info))
    if "file" not in section:
        return out
    columns: dict[str, Any] = _named("section.file", lambda: _columns(section["file"], info))
    for key in columns:
        if key in out:
            raise problem(f"section.{key}", None, "given twice; section.file has a column of it too")
    return columns | out


def is_path(value: Any) -> bool:
    """Return whether a value names a file: any text that is no name of a file is left to who wants a number."""
    return isinstance(value, Path) or (isinstance(value, str) and _ENDING.search(value) is not None)


def _named(key: str, read: Any) -> Any:
    """Return what is read; a problem with it belongs to the key."""
    try:
        return read()
    except PydanticCustomError as error:
        context = error.context or {}
        raise problem(key, context.get("value"), context.get("reason", error.message())) from None


def _located(read: Any) -> Any:
    """Return what is read; a problem that names no key is one of the file that section.from names."""
    try:
        return read()
    except PydanticCustomError as error:
        context = error.context or {}
        raise problem(context.get("key") or "section.from", context.get("value"), context["reason"]) from None


def _rows(key: str, value: Any, info: ValidationInfo) -> Rows:
    """Return the rows of a table over the span from the file of one key: x and a number, a point or a matrix."""
    path, text = _text(value, info)
    rows = read_rows(text, path)
    widths = {"x, value": 2}
    if key in POINTS or key == "line":
        widths = {"x, y, z": 3}
    elif key in MATRICES:
        widths = {"x and 36 entries row by row": 37, "x and 21 entries of the upper triangle row by row": 22}
    line, first = next(iter(rows.items()))
    if len(first) not in widths.values():
        allowed = ", or ".join(widths)
        raise problem("", str(path), f"line {line} has {len(first)} columns; must be {allowed}")
    if key in MATRICES:
        return [[row[0], _matrix(row[1:])] for row in rows.values()]
    return [list(row) for row in rows.values()]


def _text(value: Any, info: ValidationInfo) -> tuple[Path, str]:
    path, limits = existing_file(value, info), limits_in(info)
    text = read_text(path, MATRIX_ROW_BYTES * limits.rows)
    limits.check("rows", text.count("\n"), value=str(path))
    return path, text


def _matrix(entries: Sequence[float]) -> list[list[float]]:
    """Return a matrix (6, 6) of its 36 entries, or of the 21 of its upper triangle."""
    M = np.zeros((6, 6))
    if len(entries) == 36:
        M[:] = np.reshape(entries, (6, 6))
    else:
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
    for key in POINTS:
        y, z = (column.pop(f"{key}_{axis}", None) for axis in "yz")
        if y is not None or z is not None:
            zero = np.zeros(len(x))
            points = np.stack([zero if y is None else y, zero if z is None else z], axis=-1)
            out[key] = [[at, point] for at, point in zip(x, points.tolist(), strict=True)]
    for key in MATRICES:
        entries = {name: column.pop(name) for name in _entries(key) if name in column}
        if entries:
            rows = np.stack([entries.get(name, np.zeros(len(x))) for name in _entries(key)], axis=-1)
            out[key] = [[at, _matrix(row)] for at, row in zip(x, rows, strict=True)]
    for name in column:
        if name.startswith(tuple(f"{key}_" for key in (*MATRICES, *POINTS))) and name not in _SCALARS:
            hint = did_you_mean(name, [*_entries("stiffness"), *_entries("mass"), *(f"{p}_y" for p in POINTS)])
            raise problem("", str(path), f'unknown column "{name}"; {hint}upper triangles only, as stiffness_12')
    return out | {name: np.stack([x, values], axis=-1).tolist() for name, values in column.items()}


#: Properties whose names begin like those of matrices.
_SCALARS = ("mass_per_length",)


def _entries(key: str) -> list[str]:
    """Return the names of the columns of a matrix, its upper triangle row by row."""
    return [f"{key}_{i + 1}{j + 1}" for i, j in zip(*np.triu_indices(6), strict=True)]
