"""The signals that ask a program to end, and places that they must not end it in. Nothing is imported for it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

#: Ctrl-C, and what ends a process politely.
SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def held_back() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait where what they raise would be lost, or taken for something else."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[tuple[int, FrameType | None]] = []
    before = {n: signal.signal(n, lambda number, frame: heard.append((number, frame))) for n in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for first, frame in heard[:1]:
        handler = before[signal.Signals(first)]
        if callable(handler):
            handler(first, frame)
        elif handler == signal.SIG_DFL:
            signal.raise_signal(first)
