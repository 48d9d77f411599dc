"""What a study may take, time in all and memory of one computation, and what one takes. No dolfinx in it."""

from __future__ import annotations

import ctypes
import gc
import os
import re
import resource
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time
from typing import Any

from mpi4py import MPI

from rotfem.commands.cost.settings import Setting
from rotfem.commands.signals import held_back
from rotfem.errors import SceneError

#: Default time of a study, s.
DEFAULT_QUICK, DEFAULT_FULL = 120.0, 1200.0

#: Part of the free memory that one computation may be predicted to need.
MEMORY_SHARE = 0.6

UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


def seconds_of(text: str | float, file: str = "", key: str = "cost --budget") -> float:
    """Return seconds from a number, or text such as "60s", "2min", "1h".

    Args:
        text: what was given.
        file: name for error messages.
        key: what it was given for.

    Raises:
        SceneError: it is neither, or not greater than 0.
    """
    found = re.fullmatch(r"\s*([0-9.]+(?:e[+-]?[0-9]+)?)\s*(s|min|h|)\s*", str(text))
    try:
        value = float(found[1]) * UNITS[found[2]] if found else 0.0
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e9:
        raise SceneError(file, key, text, "must be a time greater than 0, such as 60s, 2min or 1h")
    return value


def free_memory() -> float:
    """Return the memory (bytes) that can be had without swapping; infinite where the system does not say."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return float(next(line for line in lines if line.startswith("MemAvailable:")).split()[1]) * 1024
    except (OSError, StopIteration, ValueError, IndexError):
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return float("inf")


def cpu_time() -> float:
    """Return the CPU time (s) of this process and of what it called, such as compilers."""
    called = os.times()
    return process_time() + called.children_user + called.children_system


@dataclass
class Budget:
    """What is left of the time of a study, and what it did not do for want of time or memory.

    Attributes:
        seconds: CPU time that the study may take in all, compilation included; what other programs take is not counted.
        comm: MPI communicator; the clock of rank 0 counts, so that all decide alike.
        memory: bytes that all ranks together may be predicted to need.
        refused: what was not computed: setting, reason, predicted CPU time (s) and memory (bytes).
    """

    seconds: float
    comm: MPI.Comm
    started: float = field(default_factory=lambda: cpu_time())
    memory: float = field(init=False)
    refused: list[dict[str, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.memory = self.comm.bcast(MEMORY_SHARE * free_memory())

    def left(self) -> float:
        """Return the time left, s."""
        return float(self.comm.bcast(self.seconds - (cpu_time() - self.started)))

    def allows(self, setting: Setting, predicted: Mapping[str, float | None]) -> bool:
        """Return whether a setting may be computed, and keep what is refused.

        None may take more than half of the time left, so that there is always as much for what follows from it.

        Args:
            setting: what is to be computed.
            predicted: its `cpu` time (s) and `memory` (bytes), None where nothing is known of them.
        """
        left, time, memory = self.left(), predicted["cpu"], predicted["memory"]
        if memory is not None and memory > self.memory:
            why = f"would need about {memory / 1e9:.2g} GB of {self.memory / 1e9:.2g} GB allowed"
        elif left <= 0.0 or (time is not None and time > left / 2):
            known = "" if time is None else f"would take about {time:.2g} s, "
            why = f"{known}{max(left, 0.0):.2g} s of the budget are left"
        else:
            return True
        entry = {"setting": setting.key(), "why": why, "time": time, "memory": memory}
        if all(other["setting"] != entry["setting"] for other in self.refused):
            self.refused.append(entry)
        return False

    def summary(self) -> dict[str, Any]:
        """Return what a summary says of it."""
        return {"seconds": self.seconds, "used": self.seconds - self.left(), "refused": self.refused}


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
