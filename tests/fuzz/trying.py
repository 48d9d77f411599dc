"""What every mutant is held to: an answer in time, of finite numbers, or an error that says what is wrong."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

import rotfem
from rotfem.errors import InputError
from tests.finite import check_finite

#: Seconds of the processor that a validation and a computation of two elements may take.
VALIDATION, COMPUTATION = 5, 60


class Endless(Exception):
    """Not ended in time."""


@contextmanager
def within(seconds: int) -> Iterator[None]:
    """Interrupt what takes longer, as soon as Python has a say; a machine with other work to do takes no time of it."""

    def late(signum: int, frame: Any) -> NoReturn:
        raise Endless(f"not ended in {seconds} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def check_message(error: InputError) -> None:
    """See that an error of input says what is meant in lines of readable length, without the steering of a terminal."""
    lines = str(error).split("\n")
    assert error.allowed
    assert all(line.isprintable() for line in lines)
    assert len(str(error)) < 20_000


def outcome(compute: Callable[[], Any]) -> str:
    """Return "done", "refused" or "failed"; anything else is raised."""
    with within(COMPUTATION):
        try:
            result = compute()
        except InputError as error:
            check_message(error)
            return "refused"
        except rotfem.ComputationError as error:
            return "failed" if error.what else "silent"
    assert result.status == "done"
    for name in ("history", "shape", "rows"):
        check_finite(getattr(result, name, None), name)
    check_finite({key: value for key, value in result.summary.items() if key not in ("scene", "timings")}, "summary")
    return "done"
