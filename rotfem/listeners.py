"""What hears of a computation while it goes on, the time that it takes, and who computes it where there is no MPI."""

from __future__ import annotations

import os
from collections.abc import Callable
from time import process_time
from types import SimpleNamespace

#: In the place of an MPI communicator where there is one process.
ONE_PROCESS = SimpleNamespace(rank=0, size=1, bcast=lambda value: value, allgather=lambda value: [value])

#: Takes the share of the work done, between 0 and 1.
Progress = Callable[[float], None]

#: Takes one line of advice.
Hint = Callable[[str], None]


def silent(heard: object) -> None:
    """Take a hint or a share and say nothing."""


def cpu_time() -> float:
    """Return the CPU time (s) of this process and of what it called, such as compilers."""
    called = os.times()
    return process_time() + called.children_user + called.children_system


def computing() -> float:
    """Return the CPU time (s) so far, without that of compilation."""
    return cpu_time() - Compiling.seconds


class Compiling:
    """What compilation of forms has taken so far.

    Attributes:
        seconds: CPU time on this process, s.
    """

    seconds = 0.0
