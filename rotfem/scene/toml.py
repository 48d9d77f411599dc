"""From a TOML file and overrides to a plain dictionary, and from validation errors to one readable error."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from rotfem.errors import Problem, SceneError, show
from rotfem.scene.values import did_you_mean

# Names that validation puts into the path of an error to say which kind of table it tried.
_TAGS = {
    "structure": {"planar_beam", "spatial_beam", "plate"},
    "motion": {"constant", "spin_up", "table", "torque", "callable"},
    "mesh": {"beam", "plate"},
}
_KEY = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


def read_toml(path: Path) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        SceneError: the file is missing, cannot be read or is not valid TOML, saying where.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
        return tomllib.loads(text)
    except FileNotFoundError:
        reason = "no such file"
    except IsADirectoryError:
        reason = "is a directory; a scene is a TOML file"
    except OSError as error:
        reason = f"cannot be read: {error.strerror or error}"
    except UnicodeDecodeError as error:
        reason = f"not valid TOML: byte {error.start} is not UTF-8 text"
    except tomllib.TOMLDecodeError as error:
        reason = f"not valid TOML: {error}"
    except (RecursionError, ValueError) as error:  # nesting without end; a path with a null character
        reason = f"cannot be read: {error}"
    raise SceneError(str(path), allowed=reason) from None


def parse_override(file: str, override: str) -> tuple[str, Any]:
    """Return key and value of an override such as `model.theory=linear`.

    The value is read as TOML where that is possible and is a string otherwise.

    Raises:
        SceneError: it is not of the form `table.key=value`.
    """
    key, equals, text = (part.strip() for part in override.partition("="))
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


def to_builtin(value: Any) -> Any:
    """Return the value with NumPy arrays and numbers, at any depth, as lists and Python numbers."""
    if isinstance(value, Mapping):
        return {str(key): to_builtin(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [to_builtin(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value


def scene_error(file: str, error: ValidationError) -> SceneError:
    """Return the problems found by validation as one error."""
    first, *others = [_problem(dict(details)) for details in error.errors(include_url=False)]
    return SceneError(file, *first, others)


def _problem(details: dict[str, Any]) -> Problem:
    path = list(details["loc"])
    if len(path) > 1 and path[1] in _TAGS.get(str(path[0]), ()):
        del path[1]
    context: dict[str, Any] = details.get("ctx", {})
    value, kind = details["input"], details["type"]
    if kind == "scene":
        if context["key"]:
            path.append(context["key"])
            value = context["value"]
        elif context["value"] is None:
            value = None
        reason = context["reason"]
    elif kind in ("literal_error", "union_tag_invalid"):
        names = re.findall(r"'([^']*)'", context.get("expected") or context.get("expected_tags", ""))
        if kind == "union_tag_invalid":
            path.append("type")
            value = value.get("type") if isinstance(value, Mapping) else value
        reason = f"{did_you_mean(value, names)}allowed: {', '.join(show(name) for name in names)}"
    elif kind == "union_tag_not_found":
        path.append("type")
        value, reason = None, f"required key is missing; allowed: {', '.join(map(show, sorted(_TAGS[str(path[0])])))}"
    elif kind in ("model_type", "model_attributes_type", "dict_type"):
        reason = "must be a table of key = value pairs"
    elif kind == "bool_type":
        reason = "must be true or false"
    else:
        message = str(details["msg"])
        reason = message[0].lower() + message[1:]
    if isinstance(value, Mapping):
        value = None  # a whole table says nothing that its key does not
    return Problem(".".join(str(part) for part in path), value, reason)


def apply_overrides(file: str, data: dict[str, Any], overrides: Sequence[str]) -> dict[str, Any]:
    """Return a copy of the scene's tables with the overrides applied in order.

    Raises:
        SceneError: an override is malformed or leads through something that is not a table.
    """
    for override in overrides:
        data = set_key(file, data, *parse_override(file, override))
    return data
