"""How much memory a computation needs at its height. No dolfinx in it."""

from __future__ import annotations

import ctypes
import gc
import resource
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

#: Signals that end a study.
SIGNALS = (signal.SIGINT, signal.SIGTERM)

#: Where Linux says what a process has in memory, now and at most, and where the latter is set back by writing 5.
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def release() -> None:
    """Give back what is no longer used: the last system is large and full of cycles."""
    with held_back():
        gc.collect()
    trim = getattr(
        ctypes.CDLL(None), "malloc_trim", None
    )  # of glibc: it keeps what was freed, and the next one uses it
    if trim is not None:
        trim(0)


@contextmanager
def held_back() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait: what they raise is lost in the finalisers that a collection runs."""
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


class PeakMemory:
    """The height of the memory of this process since `restart`, above what it had at first.

    Where the system cannot set its mark back, the height is that since the process began.
    """

    def __init__(self) -> None:
        release()
        self.base = _status("VmRSS") or 0.0

    def restart(self) -> None:
        """Begin anew."""
        release()
        try:
            RESET.write_text("5", encoding="ascii")
        except OSError:
            return

    def height(self) -> float:
        """Return bytes."""
        height = _status("VmHWM")
        if height is None:
            height = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return max(height - self.base, 0.0)


def _status(name: str) -> float | None:
    """Return a number of bytes that Linux keeps of this process, None elsewhere."""
    try:
        lines = STATUS.read_text(encoding="ascii").splitlines()
        return 1024.0 * float(next(line for line in lines if line.startswith(f"{name}:")).split()[1])
    except (OSError, StopIteration, ValueError, IndexError):
        return None
