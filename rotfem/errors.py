"""The errors a user can meet: a scene that is not valid, a computation that failed or was stopped, a full disk."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

#: Characters of a value or a key that a message shows, and problems that it lists.
_LONGEST_VALUE, _MOST_PROBLEMS = 72, 20


class Fault(NamedTuple):
    """One thing wrong with a scene.

    Attributes:
        key: dotted path of the key, e.g. `structure.length`; empty if the whole file is meant.
        value: what the scene holds there; None if the key is absent or has no value that can be shown.
        allowed: what is wrong and what would be right.
    """

    key: str
    value: Any
    allowed: str

    def __str__(self) -> str:
        allowed = "\n".join(map(printable, self.allowed.split("\n")))
        if not self.key:
            return allowed
        key = printable(_cut(self.key, _LONGEST_VALUE))
        return f"{key}: {allowed}" if self.value is None else f"{key} = {show(self.value)}: {allowed}"


class InputError(ValueError):
    """Something a user gave cannot be computed with.

    Attributes:
        key: dotted path of what is meant, as a scene calls it.
        value: what was given there; None if there is nothing to show.
        allowed: what is wrong with it and what is allowed.
    """

    def __init__(self, key: str, value: Any, allowed: str) -> None:
        super().__init__(key, value, allowed)
        self.key, self.value, self.allowed = key, value, allowed

    def __str__(self) -> str:
        return str(Fault(self.key, self.value, self.allowed))


@contextmanager
def input_of(file: str) -> Iterator[None]:
    """Say of which scene file, by its name, an `InputError` is."""
    try:
        yield
    except SceneError:
        raise
    except InputError as error:
        raise SceneError(file, error.key, error.value, error.allowed) from error.__cause__


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
        self, file: str, key: str = "", value: Any = None, allowed: str = "", others: Sequence[Fault] = ()
    ) -> None:
        super().__init__(key, value, allowed)
        self.file, self.others = file, tuple(others)
        # All arguments are kept so that the error survives pickling (between MPI ranks).
        self.args = (file, key, value, allowed, self.others)

    @property
    def problems(self) -> tuple[Fault, ...]:
        """All problems, the first one first."""
        return (Fault(self.key, self.value, self.allowed), *self.others)

    def __str__(self) -> str:
        first, *others = self.problems
        file = printable(self.file)
        if not others:
            return f"{file}: {first}"
        return "\n".join(
            [f"{file}: {first} (and {len(others)} more)", *(f"  {problem}" for problem in others[:_MOST_PROBLEMS])]
        )


class ComputationError(RuntimeError):
    """A computation on a valid scene failed.

    Attributes:
        what: what failed, e.g. "Newton's method did not converge in 25 iterations".
        time: time at which it failed (s), or None outside a time history.
        advice: what to try; may be empty.
        result: what was computed until then; None if nothing was.
    """

    def __init__(self, what: str, time: float | None = None, advice: str = "") -> None:
        super().__init__(what, time, advice)
        self.what, self.time, self.advice = what, time, advice
        self.result: Any = None

    def __str__(self) -> str:
        message = self.what if self.time is None else f"{self.what} at t = {self.time:.6g} s"
        return f"{message}; {self.advice}" if self.advice else message


class Stopped(KeyboardInterrupt):
    """A computation was interrupted where all ranks agree, so that what they do together can still be done.

    Attributes:
        result: what was computed until then; None if nothing was.
    """

    def __init__(self, result: Any = None) -> None:
        super().__init__()
        self.result = result


class OutputError(OSError):
    """A result cannot be written.

    Attributes:
        path: file or folder that was to be written.
        reason: why it could not be.
    """

    def __init__(self, path: object, reason: str) -> None:
        super().__init__(path, reason)
        self.path, self.reason = path, reason

    def __str__(self) -> str:
        return f"output {self.path}: cannot be written: {self.reason}; choose another folder with -o DIR"


def show(value: Any) -> str:
    """Return a value as it would stand in a TOML file, in one line of readable length; a path in full, to be found."""
    text = printable(_full_text(value))
    return text if isinstance(value, Path) else _cut(text, _LONGEST_VALUE)


def printable(text: str) -> str:
    """Return a text in one line, without characters that steer a terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(path: str | Path) -> Path:
    """Return a path as it is found from the working directory, relative where that is shorter."""
    return Path(min(str(path), os.path.relpath(path), key=len))


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 1] + "…"


def _full_text(value: Any) -> str:
    """Return a value in full, but for what `show` cuts off in any case: of a large table only the beginning."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_full_text, value[:_LONGEST_VALUE]))}]"
    return " ".join(repr(value).split())
