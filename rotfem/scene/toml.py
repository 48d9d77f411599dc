"""From a TOML file and overrides to a plain dictionary."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotfem.errors import SceneError, printable, show
from rotfem.scene.reading import Unreadable, read_bytes

#: Bytes of a scene file, at most.
LARGEST_SCENE = 50_000_000

#: Tables and lists within each other, at most; the deepest that a scene has is six: rows with a matrix in a table.
DEEPEST = 30

#: Types of values that nothing is nested in.
PLAIN = frozenset((bool, int, float, str))

_KEY = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        SceneError: the file is missing, cannot be read or is not valid TOML, saying where.
    """
    try:
        text = read_bytes(path, LARGEST_SCENE).decode("utf-8-sig")
        return tomllib.loads(text)
    except Unreadable as error:
        reason = error.reason
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


def set_key(file: str, data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """Return a copy of nested tables with one key set, or removed if the value is None.

    Args:
        file: name for error messages.
        data: nested dictionaries; not changed.
        key: dotted path; missing tables on the way are created.
        value: new value.

    Raises:
        SceneError: a part of the path is not a table.
    """
    *parents, last = key.split(".")
    result = table = dict(data)
    for depth, parent in enumerate(parents, start=1):
        below = table.get(parent, {})
        if not isinstance(below, Mapping):
            raise SceneError(file, ".".join(parents[:depth]), below, f"is not a table, so {key} cannot be set")
        table[parent] = dict(below)
        table = table[parent]
    if value is None:
        table.pop(last, None)
    else:
        table[last] = value
    return result


def check_depth(file: str, data: Any) -> None:
    """Refuse tables and lists that are nested deeper than a scene can be.

    Raises:
        SceneError: they are; names the key they are in.
    """
    for key, value in data.items():
        level, depth = [value], 0
        while level := [entry for one in level for entry in _entries(one) if type(entry) not in PLAIN]:
            depth += 1
            if depth > DEEPEST:
                raise SceneError(file, str(key), allowed=f"is nested more than {DEEPEST} deep")


def _entries(value: Any) -> Iterable[Any]:
    """Return what is in a table or list; nothing of anything else."""
    if isinstance(value, list | tuple):
        return value
    return value.values() if isinstance(value, Mapping) else ()


def encodable(text: str) -> str:
    """Return a text that UTF-8 can hold: what a command line gives in other bytes is shown as such."""
    return text.encode("utf-8", "backslashreplace").decode()


def to_builtin(value: Any) -> Any:
    """Return the value with NumPy arrays and numbers, at any depth, as lists and Python numbers."""
    if isinstance(value, Mapping):
        return {encodable(str(key)): to_builtin(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_builtin(entry) for entry in value]
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value


def apply_overrides(file: str, data: dict[str, Any], overrides: Sequence[str]) -> dict[str, Any]:
    """Return a copy of the scene's tables with the overrides applied in order.

    Raises:
        SceneError: an override is malformed or leads through something that is not a table.
    """
    for override in overrides:
        data = set_key(file, data, *parse_override(file, override))
    return data
