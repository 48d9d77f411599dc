"""What gmsh is to do, tried in a process of its own first: it may crash, never end or want all memory."""

from __future__ import annotations

import os
import resource
import signal
import warnings
from collections.abc import Callable

#: Signals that libraries catch to print where they were.
_CAUGHT = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGALRM, signal.SIGTERM)

#: What the process says at the end of its work.
DONE = b"\0done"


def mishap(work: Callable[[], object], seconds: float, memory: float) -> str | None:
    """Return how a process ends badly that does the work, or what an exception in it says; None where it comes through.

    Args:
        work: what is tried; nothing of it is left in this process.
        seconds: time that it may take.
        memory: bytes that it may need beyond what this process has.
    """
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
        told, tell = os.pipe()
        child = os.fork()  # beside threads of libraries: of locks that they hold, the end of the time is the end
    if child == 0:
        try:
            _behave(seconds, memory)
            work()
        except BaseException as error:
            os.write(tell, str(error).encode("utf-8", "replace")[:2000])  # less than a pipe holds
        else:
            os.write(tell, DONE)
        finally:
            os._exit(0)
    os.close(tell)
    with os.fdopen(told, "rb") as pipe:
        said = pipe.read()
    _, code = os.waitpid(child, 0)
    if os.WIFSIGNALED(code) and os.WTERMSIG(code) == signal.SIGALRM:
        return f"gmsh does not come to an end with it in {seconds:.0f} s"
    if code or not said:
        return "its numbers and counts cannot be right: gmsh crashes with it"
    return None if said == DONE else said.decode("utf-8", "replace")


def _behave(seconds: float, memory: float) -> None:
    """Leave this process no way to disturb another one, or to go on for ever."""
    for number in _CAUGHT:
        signal.signal(number, signal.SIG_DFL)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    with open("/proc/self/statm", encoding="ascii") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (int(now + memory), resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.setitimer(signal.ITIMER_REAL, seconds)
