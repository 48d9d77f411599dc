"""Tables over time and files named in a scene, resolved against the scene's directory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo

from rotfem.scene.values import Matrix, as_increasing_rows, problem


def existing_file(value: Any, info: ValidationInfo) -> Path:
    """Return the absolute path of a file named in the scene.

    Args:
        value: the path, relative to the scene's directory or absolute.
        info: validation info; its context holds that directory.

    Raises:
        PydanticCustomError: it is not a string, or there is no such file.
    """
    if not isinstance(value, str | Path) or not str(value):
        raise problem("", value, "must be the path of a file")
    directory = Path((info.context or {}).get("directory", "."))
    try:
        path = (directory / value).resolve()
        found = path.is_file()
    except (OSError, ValueError) as error:
        raise problem("", str(value), f"must be the path of a file: {error}") from None
    if not found:
        raise problem("", str(value), f"file not found (looked for {path})")
    return path


def as_time_table(value: Any, info: ValidationInfo, columns: Sequence[int], shape: str) -> Matrix:
    """Return rows (t, …) with t (s) strictly increasing, at least two.

    Args:
        value: the rows, or the path of a CSV file holding them.
        info: validation info; its context holds the scene's directory.
        columns: allowed numbers of columns.
        shape: the expected form in words, for the error message.

    Raises:
        PydanticCustomError: it is not such a table, or the file cannot be read; of a file it names the line.
    """
    if not isinstance(value, str | Path):
        return as_increasing_rows(value, columns, shape)
    rows = read_csv(existing_file(value, info))
    lines = tuple(rows)
    return as_increasing_rows(tuple(rows.values()), columns, shape, lambda row: f"line {lines[row - 1]}")


def read_csv(path: Path) -> dict[int, tuple[float, ...]]:
    """Return number of the line ↦ row of a CSV file of finite numbers, all of one length.

    `#` starts a comment. The first row may be a header, and is one if none of its cells is a number.

    Args:
        path: file with comma-separated columns.

    Raises:
        PydanticCustomError: it cannot be read or holds anything else or nothing, naming the line and the cell.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise problem("", str(path), f"cannot be read: {error}") from None
    rows: dict[int, tuple[float, ...]] = {}
    width, top = 0, 0  # columns of the first row, and its line
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.split("#", 1)[0].strip()
        if not content:
            continue
        cells = [cell.strip() for cell in content.split(",")]
        values = [_number(cell) for cell in cells]
        if not top:
            width, top = len(cells), number
            if any(cells) and all(value is None for value in values):
                continue
        for column, (cell, value) in enumerate(zip(cells, values, strict=True), start=1):
            if value is None or not math.isfinite(value):
                reason = f'line {number}, column {column}: "{cell}" must be a finite number'
                raise problem("", str(path), f"{reason} (only the first row may be a header, one without any number)")
        if len(cells) != width:
            raise problem("", str(path), f"line {number} has {len(cells)} columns; must be {width}, as in line {top}")
        rows[number] = tuple(value for value in values if value is not None)
    if not rows:
        raise problem("", str(path), "has no row of numbers")
    return rows


def _number(cell: str) -> float | None:
    """Return the number in a cell, None if there is none."""
    try:
        return float(cell)
    except ValueError:
        return None
