"""How much memory a computation needs at its height. No dolfinx in it."""

from __future__ import annotations

import ctypes
import gc
import resource
from pathlib import Path

from rotfem.commands.signals import held_back

#: Where Linux says what a process has in memory, now and at most, and where the latter is set back by writing 5.
STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def release() -> None:
    """Give back what is no longer used: the last system is large and full of cycles."""
    with held_back():  # what a signal raises is lost in the finalisers that a collection runs
        gc.collect()
    trim = getattr(
        ctypes.CDLL(None), "malloc_trim", None
    )  # of glibc: it keeps what was freed, and the next one uses it
    if trim is not None:
        trim(0)


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
