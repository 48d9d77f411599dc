"""Tables over time and files named in a scene, resolved against the scene's directory."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo

from rotfem.quantities import Matrix, as_increasing_rows, problem


def existing_file(value: Any, info: ValidationInfo) -> Path:
    """Returns the absolute path of a file named in the scene.

    Args:
        value: The path, relative to the scene's directory or absolute.
        info: Validation info; its context holds that directory.

    Raises:
        PydanticCustomError: If it is not a string, or there is no such file.
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
    """Returns rows (t, …) with t (s) strictly increasing, at least two.

    Args:
        value: The rows, or the path of a CSV file holding them.
        info: Validation info; its context holds the scene's directory.
        columns: Allowed numbers of columns.
        shape: The expected form in words, for the error message.

    Raises:
        PydanticCustomError: If it is not such a table, or the file cannot be read.
    """
    rows = read_csv(existing_file(value, info)) if isinstance(value, str | Path) else value
    return as_increasing_rows(rows, columns, shape)


def read_csv(path: Path) -> list[list[float]]:
    """Returns the rows of a CSV file of numbers; ``#`` starts a comment, and the first row may be a header.

    Args:
        path: File with comma-separated columns.

    Raises:
        PydanticCustomError: If it cannot be read or holds anything else, naming the line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise problem("", str(path), f"cannot be read: {error}") from None
    rows: list[list[float]] = []
    header_possible = True
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.split("#", 1)[0].strip()
        if not content:
            continue
        try:
            rows.append([float(cell) for cell in content.split(",")])
        except ValueError:
            if not header_possible:
                raise problem("", str(path), f"line {number} is not numbers separated by commas: {content}") from None
        header_possible = False
    return rows
