"""Values of options of the command line: what is read, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer

from rotfem.errors import SceneError
from rotfem.units import split_unit

#: Units of a time ↦ s.
UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


def seconds_of(text: str | float, file: str = "", key: str = "cost --budget") -> float:
    """Return seconds from a number, or text such as "60s", "2min", "1h".

    Args:
        text: what was given.
        file: name for error messages.
        key: what it was given for.

    Raises:
        SceneError: it is neither, or not greater than 0.
    """
    found = re.fullmatch(r"\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*(s|min|h|)\s*", str(text))
    try:
        value = float(found[1]) * UNITS[found[2]] if found else 0.0
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e9:
        raise SceneError(file, key, text, "must be a time greater than 0, such as 60s, 2min or 1h")
    return value


def as_path(text: str) -> Path:
    """Return the path that an option gives."""
    if not text or "\0" in text:
        raise typer.BadParameter("must be a path, not an empty text")
    return Path(text)


def folder_name(scene: str) -> str:
    """Return the name of the folder of a scene's results: the scene's own, if that is the name of one."""
    if scene in ("", ".", ".."):
        raise SceneError("command line", "-o", None, f'must be given for a scene of the name "{scene}"')
    return scene


def listed(option: str, text: str | None, kind: Callable[[str], Any]) -> list[Any] | None:
    """Return the values of an option such as "2,3"; None where it is not given."""
    if text is None:
        return None
    try:
        return [kind(part.strip()) for part in text.split(",")]
    except ValueError:
        what = "integers" if kind is int else "numbers"
        raise SceneError("command line", option, text, f"must be {what} separated by commas") from None


def speeds_of(option: str, text: str, number: int) -> list[float]:
    """Return so many speeds (rad/s) of an option such as "6.9:12.1rpm"."""
    try:
        numbers, unit = split_unit(text)
        speeds = [float(part) * unit for part in numbers.split(":")]
        if len(speeds) == number:
            return speeds
    except ValueError:
        pass
    allowed = {1: "a speed, rad/s or as 12.1rpm", 2: "two speeds low:high, rad/s or as 6.9:12.1rpm"}[number]
    raise SceneError("command line", option, text, f"must be {allowed}")
