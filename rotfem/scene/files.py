"""Tables over time and files named in a scene, resolved against the scene's directory."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from pydantic import ValidationInfo

from rotfem.scene.limits import limits_in
from rotfem.scene.reading import Unreadable, note, read_bytes
from rotfem.scene.values import Array, Matrix, are_numbers, as_increasing_rows, problem, rows_of

#: Bytes of a table, at most, for each row that it may have.
ROW_BYTES = 400

#: Characters of a cell that a message shows. A file may be anything that can be read here, and so a secret.
SHOWN_CELL = 12


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
        found, there = path.is_file(), path.exists()
    except (OSError, ValueError) as error:
        raise problem("", str(value), f"must be the path of a file: {error}") from None
    if not found:
        what = "is no regular file" if there else "file not found"
        raise problem("", str(value), f"{what} (looked for {path})")
    note(path)
    return path


class Reader(Protocol):
    """What makes a table of rows and refuses those that are none, as `as_increasing_rows` does."""

    def __call__(self, value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = ...) -> Matrix:
        """Return the rows."""


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
    return as_table(value, info, columns, shape, as_increasing_rows)


def as_table(value: Any, info: ValidationInfo, columns: Sequence[int], shape: str, read: Reader) -> Matrix:
    """Return the rows of a table that a reader accepts (see `as_time_table`)."""
    limits = limits_in(info)
    if not isinstance(value, str | Path):
        if isinstance(value, list | tuple):
            limits.check("rows", len(value), value=value)
        return read(value, columns, shape)
    path = existing_file(value, info)
    text = read_text(path, ROW_BYTES * limits.rows)
    limits.check("rows", text.count("\n"), value=str(path))
    table = quick_rows(text) if read is as_increasing_rows else None
    if table is not None and table.shape[1] in columns and len(table) > 1 and np.all(table[1:, 0] > table[:-1, 0]):
        return rows_of(table)
    by_line = read_rows(text, path)
    lines = tuple(by_line)
    return read(tuple(by_line.values()), columns, shape, lambda row: f"line {lines[row - 1]}")


def read_text(path: Path, most: int) -> str:
    """Return the text of a table.

    Args:
        path: file with comma-separated columns.
        most: bytes that it may have.

    Raises:
        PydanticCustomError: it cannot be read as text, or has more.
    """
    try:
        text = read_bytes(path, most).decode("utf-8-sig")
    except Unreadable as error:
        raise problem("", str(path), f"cannot be read: {error.reason}") from None
    except UnicodeDecodeError as error:
        raise problem("", str(path), f"cannot be read: byte {error.start} is not UTF-8 text") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def quick_rows(text: str) -> Array | None:
    """Return the rows of a table of finite numbers, shape (n, columns); None where `read_rows` has to look closer."""
    lines = text.split("\n")
    top = next((i for i, line in enumerate(lines) if _cells(line)), len(lines))
    first = _cells(lines[top]) if top < len(lines) else []
    rows = lines[top + all(_number(cell) is None for cell in first) :]
    if not any(first) or not all(map(str.isascii, rows)) or any("_" in row for row in rows):
        return None
    try:
        with warnings.catch_warnings(action="error"):
            table = np.loadtxt(rows, delimiter=",", ndmin=2)
    except (ValueError, UserWarning):
        return None
    return table if len(first) == table.shape[1] and are_numbers(table) else None


def read_rows(text: str, path: Path) -> dict[int, tuple[float, ...]]:
    """Return number of the line ↦ row of a table of finite numbers, all of one length.

    `#` starts a comment. The first row may be a header, and is one if none of its cells is a number.

    Args:
        text: content of the file, lines ended by line feeds.
        path: the file, for errors.

    Raises:
        PydanticCustomError: it holds anything else or nothing, naming the line and the column.
    """
    rows: dict[int, tuple[float, ...]] = {}
    width, top = 0, 0  # columns of the first row, and its line
    for number, line in enumerate(text.split("\n"), start=1):
        cells = _cells(line)
        if not cells:
            continue
        values = [_number(cell) for cell in cells]
        if not top:
            width, top = len(cells), number
            if any(cells) and all(value is None for value in values):
                continue
        for column, (cell, value) in enumerate(zip(cells, values, strict=True), start=1):
            if value is None or not math.isfinite(value):
                short = len(cell) <= SHOWN_CELL and cell.isprintable()
                what = f'"{cell}"' if short else f"a text of {len(cell)} characters"
                reason = f"line {number}, column {column}: {what} must be a finite number"
                raise problem("", str(path), f"{reason} (only the first row may be a header, one without any number)")
        if len(cells) != width:
            raise problem("", str(path), f"line {number} has {len(cells)} columns; must be {width}, as in line {top}")
        rows[number] = tuple(value for value in values if value is not None)
    if not rows:
        raise problem("", str(path), "has no row of numbers")
    return rows


def read_header(text: str) -> list[str]:
    """Return the cells of the first row, if none of them is a number; else nothing."""
    first = next((cells for line in text.split("\n") if (cells := _cells(line))), [])
    return first if all(_number(cell) is None for cell in first) else []


def _cells(line: str) -> list[str]:
    """Return the cells of a line, none of one that is empty but for a comment."""
    content = line.split("#", 1)[0].strip()
    return [cell.strip() for cell in content.split(",")] if content else []


def _number(cell: str) -> float | None:
    """Return the number in a cell, None if there is none."""
    if not cell.isascii() or "_" in cell:  # which Python takes for digits and between them
        return None
    try:
        return float(cell)
    except ValueError:
        return None
