"""Ctrl-C and SIGTERM: in a march obeyed between steps, by all ranks."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from rotfem.errors import Stopped

if TYPE_CHECKING:
    from mpi4py import MPI

#: Ctrl-C, and what ends a process politely.
SIGNALS = (signal.SIGINT, signal.SIGTERM)


def together(comm: MPI.Comm, stop: KeyboardInterrupt) -> bool:
    """Return whether all ranks have been interrupted at the same place; otherwise the others may be anywhere."""
    return comm.size == 1 or isinstance(stop, Stopped)


class Interrupts:
    """Context in which Ctrl-C and SIGTERM wait for the end of a step. A second one on one process does not wait.

    Args:
        alone: whether there is one process; several must stop at the same step.

    Attributes:
        asked: whether a signal has come.
    """

    def __init__(self, alone: bool):
        self.asked, self._alone = False, alone
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._hear) for number in SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _hear(self, number: int, frame: FrameType | None) -> None:
        if self.asked and self._alone:
            raise KeyboardInterrupt
        self.asked = True
