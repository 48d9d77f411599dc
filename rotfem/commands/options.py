"""Values of options of the command line: what is read, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer

from rotfem.errors import SceneError


def as_path(text: str) -> Path:
    """Return the path that an option gives.

    Raises:
        BadParameter: it is empty, which would mean the working directory, or no path.
    """
    if not text or "\0" in text:
        raise typer.BadParameter("must be a path, not an empty text")
    return Path(text)


def folder_name(scene: str) -> str:
    """Return the name of the folder of a scene's results: the scene's own, if that is the name of one.

    Raises:
        SceneError: it is not.
    """
    if scene in ("", ".", ".."):
        raise SceneError("command line", "-o", None, f'must be given for a scene of the name "{scene}"')
    return scene


def listed(option: str, text: str | None, kind: Callable[[str], Any]) -> list[Any] | None:
    """Return the values of an option such as "2,3"; None where it is not given.

    Raises:
        SceneError: they are not of the kind.
    """
    if text is None:
        return None
    try:
        return [kind(part.strip()) for part in text.split(",")]
    except ValueError:
        what = "integers" if kind is int else "numbers"
        raise SceneError("command line", option, text, f"must be {what} separated by commas") from None
