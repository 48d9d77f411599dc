"""Tables over time and files named in a scene, resolved against the scene's directory."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BeforeValidator, ValidationInfo

from rotfem.errors import SceneError, printable, show
from rotfem.scene.table import problem
from rotfem.units import is_quantity

#: Files that have been read, in order; those that a scene consists of are the ones since its reading began.
READ: list[Path] = []


class Unreadable(Exception):
    """A file cannot be read; its words say why."""


def read_bytes(path: Path) -> bytes:
    """Return the content of a file."""
    READ.append(path.absolute())
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise Unreadable("no such file") from None
    except IsADirectoryError:
        raise Unreadable("is a directory; a scene is a TOML file") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise Unreadable(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_text(path: Path) -> str:
    """Return the content of a text file in UTF-8."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Unreadable(f"cannot be read: byte {error.start} is not UTF-8 text") from None


_KEY = re.compile(r"[A-Za-z0-9_-]+(\.([A-Za-z0-9_-]+|\*))*")


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file."""
    try:
        return tomllib.loads(read_text(path))
    except Unreadable as error:
        reason = str(error)
    except ValueError as error:  # a slip, or an integer of thousands of digits
        reason = f"not valid TOML: {printable(str(error))}"
    raise SceneError(str(path), allowed=reason) from None


def parse_override(file: str, override: str) -> tuple[str, Any]:
    """Return key and value of an override such as `model.theory=linear`; the value is TOML, or else a string."""
    key, equals, text = (part.strip() for part in override.partition("="))
    if not equals or not text or not _KEY.fullmatch(key):
        raise SceneError(file, allowed=f"override {show(override)} must have the form table.key=value")
    try:
        parsed = tomllib.loads(f"value = {text}")
    except ValueError:  # a syntax error, or a number beyond what Python reads
        return key, text
    # More than one key means that the text holds a line break: no single TOML value.
    return key, parsed["value"] if set(parsed) == {"value"} else text


def set_keys(file: str, data: dict[str, Any], changes: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return a copy of nested tables with dotted keys set, one after the other, or removed if the value is None.

    Missing tables on the way are created; a number names an entry of a list, from 0, and * all of them. Raise a
    SceneError of the file where a part of a path is neither a table nor an entry of a list.
    """
    for key, value in changes:
        parts = key.split(".")
        data = _set(file, data, key, parts, 0, value)
    return data


def _set(file: str, given: Any, key: str, parts: Sequence[str], depth: int, value: Any) -> Any:
    """Return a copy of a table or list with what is at a path below it set."""
    if depth == len(parts):
        return value
    part: Any = parts[depth]
    if isinstance(given, list | tuple) and part == "*":
        return [_set(file, entry, key, parts, depth + 1, value) for entry in given]
    if isinstance(given, list | tuple) and part.isdigit() and int(part) < len(given):
        out: Any = list(given)
        out[int(part)] = _set(file, out[int(part)], key, parts, depth + 1, value)
        return out
    if not isinstance(given, Mapping):
        why = f"has no entry {part}" if isinstance(given, list | tuple) else "is not a table"
        raise SceneError(file, ".".join(parts[:depth]), given, f"{why}, so {key} cannot be set")
    out = dict(given)
    below = _set(file, out.get(part, {}), key, parts, depth + 1, value)
    if below is None:
        out.pop(part, None)
    else:
        out[part] = below
    return out


def to_builtin(value: Any) -> Any:
    """Return a value with NumPy arrays and numbers, at any depth, as lists and Python numbers."""
    if isinstance(value, Mapping):
        return {str(name): to_builtin(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_builtin(entry) for entry in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def apply_overrides(file: str, data: dict[str, Any], overrides: Sequence[str]) -> dict[str, Any]:
    """Return a copy of the scene's tables with overrides (see `parse_override`) applied in order."""
    return set_keys(file, data, [parse_override(file, override) for override in overrides])


def existing_file(value: Any, info: ValidationInfo) -> Path:
    """Return the absolute path of a file named in the scene, from its directory, which the context of `info` holds."""
    if not isinstance(value, str | Path) or not str(value):
        raise problem("", value, "must be the path of a file")
    directory = Path((info.context or {}).get("directory", "."))
    path = (directory / value).resolve()
    if not path.is_file():
        what = "is no regular file" if path.exists() else "file not found"
        raise problem("", str(value), f"{what} (looked for {path})")
    READ.append(path)
    return path


def read_rows(value: Any, info: ValidationInfo) -> Any:
    """Return the rows of the CSV file at a path, and any other value as it is."""
    if not is_path(value):
        return value
    return read_table(existing_file(value, info))[1]


def is_path(value: Any) -> bool:
    """Return whether a value names a file: a text that is no number, with or without a unit."""
    return isinstance(value, Path) or (isinstance(value, str) and not is_quantity(value) and number_in(value) is None)


#: An annotation of the type of rows: the path of a CSV file may stand in their place.
FROM_FILE = BeforeValidator(read_rows)


def read_table(path: Path) -> tuple[list[str], list[tuple[float, ...]]]:
    """Return the names of the columns, if the first row has no number, and the rows of a CSV file; # is a comment."""
    try:
        lines = read_text(path).splitlines()
    except Unreadable as error:
        raise problem("", str(path), str(error)) from None
    header, rows = list[str](), list[tuple[float, ...]]()
    for number, line in enumerate(lines, start=1):
        if not (content := line.split("#", 1)[0].strip()):
            continue
        cells = [cell.strip() for cell in content.split(",")]
        values = tuple(math.nan if (value := number_in(cell)) is None else value for cell in cells)
        width = len(header or (*rows, values)[0])
        if not header and not rows and all(number_in(cell) is None for cell in cells):
            header = cells
        elif not all(map(math.isfinite, values)) or len(values) != width:
            wanted = f"{width} finite number{'s' * (width > 1)}"
            why = f"line {number} must be {wanted}; only the first row may be a header, without any"
            raise problem("", str(path), why)
        else:
            rows.append(values)
    if not rows:
        raise problem("", str(path), "has no row of numbers")
    return header, rows


def number_in(cell: str) -> float | None:
    """Return the number in a cell, None if there is none."""
    if not cell.isascii() or "_" in cell:  # which Python takes for digits and between them
        return None
    try:
        return float(cell)
    except ValueError:
        return None
