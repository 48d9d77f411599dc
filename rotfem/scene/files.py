"""Tables over time and files named in a scene, resolved against the scene's directory."""

from __future__ import annotations

import math
import os
import re
import select
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from pydantic import ValidationInfo

from rotfem.errors import SceneError, printable, show
from rotfem.scene.table import problem
from rotfem.scene.values import Matrix, as_rows, limits_in

#: What a pipe may keep one waiting (s) before it has anything to say.
PATIENCE = 10.0

#: Files that a scene which is being read consists of; None where they are not recorded.
_read: ContextVar[list[Path] | None] = ContextVar("read", default=None)


@contextmanager
def noted_files() -> Iterator[list[Path]]:
    """Give a list that the paths of all files are in which are read in the meantime."""
    files, before = list[Path](), _read.get()
    token = _read.set(files)
    try:
        yield files
    finally:
        _read.reset(token)
        if before is not None:
            before += files


def note(path: Path) -> None:
    """Take note of a file that is read."""
    files = _read.get()
    if files is not None:
        files.append(path.absolute())


class Unreadable(Exception):
    """A file cannot be read; its words say why."""


def read_bytes(path: Path, most: int) -> bytes:
    """Return the content of a file or a pipe.

    Raises:
        Unreadable: there is none, it is a directory, it has more than `most` bytes, or nothing comes out of a pipe.
    """
    note(path)
    content = bytearray()
    try:
        # A pipe without a writer would block here.
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
            if not select.select([file], [], [], PATIENCE)[0]:
                raise Unreadable(f"nothing can be read from it: no byte came in {PATIENCE:g} s")
            os.set_blocking(file.fileno(), True)
            while len(content) <= most and (piece := file.read(1 << 20)):
                content += piece
    except FileNotFoundError:
        raise Unreadable("no such file") from None
    except IsADirectoryError:
        raise Unreadable("is a directory; a scene is a TOML file") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise Unreadable(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > most:
        raise Unreadable(f"is larger than {most} bytes")
    return bytes(content)


#: Bytes of a file that is no table, at most.
LARGEST = 50_000_000

#: Tables and lists within each other, at most; the deepest that a scene has is six: rows with a matrix in a table.
DEEPEST = 30

_KEY = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        SceneError: the file is missing, cannot be read or is not valid TOML, saying where.
    """
    try:
        return tomllib.loads(read_bytes(path, LARGEST).decode("utf-8-sig"))
    except Unreadable as error:
        reason = str(error)
    except UnicodeDecodeError as error:
        reason = f"not valid TOML: byte {error.start} is not UTF-8 text"
    except tomllib.TOMLDecodeError as error:
        reason = f"not valid TOML: {printable(str(error))}"
    except RecursionError:
        reason = f"tables or lists are nested more than {DEEPEST} deep"
    except ValueError as error:  # an integer of thousands of digits
        reason = f"cannot be read: {printable(str(error))}"
    raise SceneError(str(path), allowed=reason) from None


def parse_override(file: str, override: str) -> tuple[str, Any]:
    """Return key and value of an override such as `model.theory=linear`.

    The value is read as TOML where that is possible and is a string otherwise.

    Raises:
        SceneError: it is not of the form `table.key=value`.
    """
    key, equals, text = (part.strip() for part in encodable(override).partition("="))
    if not equals or not text or not _KEY.fullmatch(key):
        raise SceneError(file, allowed=f"override {show(override)} must have the form table.key=value")
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):  # a syntax error, or a number or nesting beyond what Python reads
        return key, text
    # More than one key means that the text holds a line break: no single TOML value.
    return key, parsed["value"] if set(parsed) == {"value"} else text


def set_keys(file: str, data: dict[str, Any], changes: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return a copy of nested tables with dotted keys set, one after the other, or removed if the value is None.

    Missing tables on the way are created; raise a SceneError of the file where a part of a path is not a table.
    """
    for key, value in changes:
        *parents, last = key.split(".")
        data = table = dict(data)
        for depth, parent in enumerate(parents, start=1):
            below = table.get(parent, {})
            if not isinstance(below, Mapping):
                raise SceneError(file, ".".join(parents[:depth]), below, f"is not a table, so {key} cannot be set")
            table[parent] = table = dict(below)
        if value is None:
            table.pop(last, None)
        else:
            table[last] = value
    return data


def encodable(text: str) -> str:
    """Return a text that UTF-8 can hold: what a command line gives in other bytes is shown as such."""
    return text.encode("utf-8", "backslashreplace").decode()


def to_builtin(file: str, key: str, value: Any, depth: int = 0) -> Any:
    """Return what stands at a key with NumPy arrays and numbers, at any depth, as lists and Python numbers.

    Raise a SceneError of the file where tables and lists are nested deeper than a scene can be.
    """
    if depth > DEEPEST:
        raise SceneError(file, key, allowed=f"is nested more than {DEEPEST} deep")
    if isinstance(value, Mapping):
        return {encodable(str(name)): to_builtin(file, key, entry, depth + 1) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_builtin(file, key, entry, depth + 1) for entry in value]
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value


def apply_overrides(file: str, data: dict[str, Any], overrides: Sequence[str]) -> dict[str, Any]:
    """Return a copy of the scene's tables with overrides (see `parse_override`) applied in order."""
    return set_keys(file, data, [parse_override(file, override) for override in overrides])


def existing_file(value: Any, info: ValidationInfo) -> Path:
    """Return the absolute path of a file named in the scene, from its directory, which the context of `info` holds."""
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


#: What refuses rows, as `check_increasing` does.
Check: TypeAlias = Callable[[Matrix, Any, str, Callable[[int], str]], None]


def as_table(
    value: Any, info: ValidationInfo, columns: Sequence[int], shape: str, check: Check | None = None
) -> Matrix:
    """Return the rows of a table, or of the CSV file at a path, if they pass a check; messages name the line there."""
    name: Callable[[int], str] = "row {}".format
    if isinstance(value, str | Path):
        path, text = table_text(value, info)
        by_line = read_rows(text, path)
        lines, value = tuple(by_line), tuple(by_line.values())

        def name(row: int) -> str:
            return f"line {lines[row - 1]}"

    elif isinstance(value, list | tuple):
        limits_in(info).check("rows", len(value), value=value)
    rows = as_rows(value, columns, shape, name)
    if check is not None:
        check(rows, value, shape, name)
    return rows


def table_text(value: Any, info: ValidationInfo) -> tuple[Path, str]:
    """Return the path of a file that a scene names and its text, of no more rows than the scene's limits allow."""
    path, limits = existing_file(value, info), limits_in(info)
    text = read_text(path, 1600 * limits.rows)  # bytes: a row may have a 6×6 matrix in it
    limits.check("rows", text.count("\n"), value=str(path))
    return path, text


def read_text(path: Path, most: int) -> str:
    """Return the text of a table of comma-separated columns; raise if it is none, or has more than `most` bytes."""
    try:
        text = read_bytes(path, most).decode("utf-8-sig")
    except Unreadable as error:
        raise problem("", str(path), f"cannot be read: {error}") from None
    except UnicodeDecodeError as error:
        raise problem("", str(path), f"cannot be read: byte {error.start} is not UTF-8 text") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_rows(text: str, path: Path) -> dict[int, tuple[float, ...]]:
    """Return number of the line ↦ row of a table of finite numbers, all of one length.

    `#` starts a comment. The first row may be a header, and is one if none of its cells is a number. Raise if the text,
    with lines ended by line feeds, holds anything else or nothing, naming the file at `path`, line and column.
    """
    rows: dict[int, tuple[float, ...]] = {}
    width, top = 0, 0  # columns of the first row, and its line
    for number, line in enumerate(text.split("\n"), start=1):
        cells = _cells(line)
        if not cells:
            continue
        values = [number_in(cell) for cell in cells]
        if not top:
            width, top = len(cells), number
            if any(cells) and all(value is None for value in values):
                continue
        for column, (cell, value) in enumerate(zip(cells, values, strict=True), start=1):
            if value is None or not math.isfinite(value):
                reason = f"line {number}, column {column}: {shown_cell(cell)} must be a finite number"
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
    return first if all(number_in(cell) is None for cell in first) else []


def _cells(line: str) -> list[str]:
    """Return the cells of a line, none of one that is empty but for a comment."""
    content = line.split("#", 1)[0].strip()
    return [cell.strip() for cell in content.split(",")] if content else []


def shown_cell(cell: str) -> str:
    """Return a cell as a message shows it: a file may be anything that can be read here, and so a secret."""
    return f'"{cell}"' if len(cell) <= 12 and cell.isprintable() else f"a text of {len(cell)} characters"


def number_in(cell: str) -> float | None:
    """Return the number in a cell, None if there is none."""
    if not cell.isascii() or "_" in cell:  # which Python takes for digits and between them
        return None
    try:
        return float(cell)
    except ValueError:
        return None
