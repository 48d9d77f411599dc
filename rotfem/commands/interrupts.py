"""Ctrl-C and SIGTERM: in a march obeyed between steps, by all ranks; while modules are imported held back."""

from __future__ import annotations

import gc
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any, Self

from rotfem.errors import Stopped

if TYPE_CHECKING:
    from mpi4py import MPI

#: Ctrl-C, and what ends a process politely.
SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def importing() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait, as in the middle of an import what they raise becomes any error.

    No garbage is collected: what is imported stays, and is seen no more.
    """
    heard: list[tuple[int, FrameType | None]] = []
    main = threading.current_thread() is threading.main_thread()
    before = {n: signal.signal(n, lambda *given: heard.append(given)) for n in SIGNALS if main}
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
        for number, handler in before.items():
            signal.signal(number, handler)
    for first, frame in heard[:1]:
        handler = before[signal.Signals(first)]
        if callable(handler):
            handler(first, frame)
        elif handler == signal.SIG_DFL:
            signal.raise_signal(first)


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
