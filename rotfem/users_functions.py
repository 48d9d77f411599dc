"""Functions that a user gives: what they raise, or return of another kind, is an `InputError` with their traceback."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError

Array = npt.NDArray[np.float64]


@contextmanager
def called(key: str, what: str) -> Iterator[None]:
    """Let what a user's function raises be an error of a key."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(key, None, f"{what} raised {type(error).__name__}: {error}") from error


@contextmanager
def of_unknowns(components: Sequence[str]) -> Iterator[None]:
    """Let an error of a user's function that takes an entry too far say what the unknowns are."""
    try:
        yield
    except (IndexError, ValueError) as error:  # UFL's
        if "out of bounds" in str(error):
            error.args = (f"{error} q has {len(components)} entries ({', '.join(components)})",)
        raise


def number_of(function: Callable[..., Any], key: str, of: str) -> Callable[..., float]:
    """Return a user's function that returns a number; it raises an InputError where the other one does not."""
    one = checked(function, key, 1, of)

    def at(*arguments: Any) -> float:
        with suppress(Exception):
            if isinstance(value := function(*arguments), float) and math.isfinite(value):
                return value
        return float(one(*arguments)[0])  # it says what is wrong

    return at


def checked(function: Callable[..., Any], key: str, size: int, of: str, planar: bool = False) -> Callable[..., Array]:
    """Return a user's function that returns an array (size,), of two components with a third one, and nothing else."""
    needed = "a number" if size == 1 else f"{size} numbers"

    def at(*arguments: Any) -> Array:
        try:
            value: Array = np.array(function(*arguments), dtype=np.float64, ndmin=1).ravel()
        except Exception as error:
            why = f"must return {needed}; raised {type(error).__name__}: {error}"
            raise _refused(key, of, arguments, why) from error
        if value.size == 2 and size == 3:
            value = np.array([value[0], value[1], 0.0])
        if value.size == 3 and size == 1 and not np.any(value[:2]):  # a moment about axis 3
            value = value[2:]
        if value.size != size:
            raise _refused(key, of, arguments, f"must return {needed}, not {value.size} of them")
        if not all(map(math.isfinite, value)):
            raise _refused(key, of, arguments, f"returned {value}; must return finite numbers")
        if planar and size == 3 and value[2] != 0.0:
            raise _refused(key, of, arguments, f"returned {value}; the third component must be 0 for a planar_beam")
        return value

    return at


def _refused(key: str, of: str, arguments: tuple[Any, ...], why: str) -> InputError:
    at = ", ".join(f"{x:g}" if isinstance(x, float | int) else str(x) for x in arguments)
    return InputError(key, None, f"the function of {of}, at {at}, {why}")
