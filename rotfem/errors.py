"""The two errors a user can meet: a scene that is not valid, and a computation that failed."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

_LONGEST_VALUE = 72


class Problem(NamedTuple):
    """One thing wrong with a scene.

    Attributes:
        key: dotted path of the key, e.g. `structure.length`; empty if the whole file is meant.
        value: what the scene holds there; None if the key is absent or has no value worth showing.
        allowed: what is wrong and what would be right.
    """

    key: str
    value: Any
    allowed: str

    def __str__(self) -> str:
        if not self.key:
            return self.allowed
        if self.value is None:
            return f"{self.key}: {self.allowed}"
        return f"{self.key} = {show(self.value)}: {self.allowed}"


class InputError(ValueError):
    """Something a user gave cannot be computed with.

    Attributes:
        key: dotted path of what is meant, as a scene calls it.
        value: what was given there; None if there is nothing to show.
        allowed: what is wrong with it and what is allowed.
    """

    def __init__(self, key: str, value: Any, allowed: str) -> None:
        super().__init__(key, value, allowed)
        self.key = key
        self.value = value
        self.allowed = allowed

    def __str__(self) -> str:
        return str(Problem(self.key, self.value, self.allowed))


@contextmanager
def input_of(file: str) -> Iterator[None]:
    """Say of which scene file an `InputError` is.

    Args:
        file: name of the file as errors show it.

    Raises:
        SceneError: in the place of an `InputError` that names no file.
    """
    try:
        yield
    except SceneError:
        raise
    except InputError as error:
        raise SceneError(file, error.key, error.value, error.allowed) from None


class SceneError(InputError):
    """A scene, or an override of it, is not valid.

    Attributes:
        file: file name of the scene (or the name given to it in Python).
        key: dotted path of the first offending key; empty if the whole file is meant.
        value: what the scene holds there; None if there is nothing to show.
        allowed: what is wrong with it and what is allowed.
        others: further problems found in the same pass.
    """

    def __init__(
        self, file: str, key: str = "", value: Any = None, allowed: str = "", others: Sequence[Problem] = ()
    ) -> None:
        # All arguments go to the base class so that the error survives pickling (between MPI ranks).
        Exception.__init__(self, file, key, value, allowed, tuple(others))
        self.file = file
        self.key = key
        self.value = value
        self.allowed = allowed
        self.others = tuple(others)

    @property
    def problems(self) -> tuple[Problem, ...]:
        """All problems, the first one first."""
        return (Problem(self.key, self.value, self.allowed), *self.others)

    def __str__(self) -> str:
        first, *others = self.problems
        if not others:
            return f"{self.file}: {first}"
        return "\n".join([f"{self.file}: {first} (and {len(others)} more)", *(f"  {problem}" for problem in others)])


class ComputationError(RuntimeError):
    """A computation on a valid scene failed.

    Attributes:
        what: what failed, e.g. "Newton's method did not converge in 25 iterations".
        time: time at which it failed (s), or None outside a time history.
        advice: what to try; may be empty.
    """

    def __init__(self, what: str, time: float | None = None, advice: str = "") -> None:
        super().__init__(what, time, advice)
        self.what = what
        self.time = time
        self.advice = advice

    def __str__(self) -> str:
        message = self.what if self.time is None else f"{self.what} at t = {self.time:.6g} s"
        return f"{message}; {self.advice}" if self.advice else message


class OutputError(OSError):
    """A result cannot be written.

    Attributes:
        path: file or folder that was to be written.
        reason: why it could not be.
    """

    def __init__(self, path: object, reason: str) -> None:
        super().__init__(path, reason)
        self.path = path
        self.reason = reason

    def __str__(self) -> str:
        return f"output {self.path}: cannot be written: {self.reason}; choose a writable folder with -o DIR"


def show(value: Any) -> str:
    """Return a value as it would stand in a TOML file, in one line of readable length; a path in full, to be found."""
    text = _full_text(value)
    if isinstance(value, Path):
        return text
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"


def shown(path: str | Path) -> Path:
    """Return a path as it is found from the working directory, relative where that is shorter."""
    return Path(min(str(path), os.path.relpath(path), key=len))


def _full_text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_full_text, value))}]"
    try:
        return " ".join(repr(value).split())
    except ValueError:  # Python refuses to print integers of several thousand digits
        return f"<{type(value).__name__}>"
