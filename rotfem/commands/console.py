"""One command from its start to its exit status: who speaks, where results go, what an error prints.

Exit status 0 done, 2 bad input, 3 the computation failed, 130 interrupted.
"""

from __future__ import annotations

import io
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from contextvars import ContextVar
from importlib.util import find_spec
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NoReturn

from rotfem.commands.interrupts import together
from rotfem.commands.result_folder import ResultFolder, Writer
from rotfem.errors import ComputationError, InputError, OutputError, SceneError, printable
from rotfem.results.files import json_text

#: Seconds that mpirun is given to pass on what was printed.
PASSED_ON = 0.2

#: Seconds after which a computation says how far it is where there is no bar; again after twice the time, and so on.
LONG = 10.0


#: Whether commands run on this process alone, whatever others mpirun has started.
ALONE: ContextVar[bool] = ContextVar("ALONE", default=False)

#: Where to find out what is to be done without FEniCSx.
MISSING = "FEniCSx is not here (there is no module {}); see docs/installation.md"


def missing() -> str:
    """Return the message where a module of FEniCSx is missing; empty where none is."""
    names = ("mpi4py", "petsc4py", "slepc4py", "dolfinx")
    return next((MISSING.format(name) for name in names if find_spec(name) is None), "")


class _Alone:
    """The communicator of a process where there is no MPI."""

    rank, size = 0, 1

    def bcast(self, value: Any) -> Any:
        """Return what is sent to all."""
        return value


class Session:
    """One command under one set of flags: speaks on rank 0 only, and turns errors into messages and exit status.

    Args:
        as_json: print the summary on stdout as JSON and nothing else there.
        quiet: print errors only.
        debug: let tracebacks through.
    """

    def __init__(self, as_json: bool, quiet: bool, debug: bool):
        self.comm: Any = _Alone()
        with suppress(ImportError):  # some commands do without FEniCSx
            from mpi4py import MPI

            self.comm = MPI.COMM_SELF if ALONE.get() else MPI.COMM_WORLD
        self.as_json, self.quiet, self.debug = as_json, quiet, debug
        self.first = self.comm.rank == 0
        self._folder: ResultFolder | None = None
        self._made: list[Path] = []

    def __enter__(self) -> Session:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")  # not every terminal has every letter
        signal.signal(signal.SIGTERM, _interrupt)
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if self._folder is not None:
            self._folder.close(error)
        if error is not None:
            self._tidy()
        self._pass_on()
        if error is None or (self.debug and not isinstance(error, SystemExit)):
            return
        if isinstance(error, InputError | OutputError):
            self._end(str(error), 2)
        if isinstance(error, ComputationError):
            self._end(f"the computation failed: {error}", 3)
        if isinstance(error, MemoryError):
            self._end("the computation failed: there is not enough memory; use fewer elements, or fewer modes", 3)
        if isinstance(error, KeyboardInterrupt):
            if not together(self.comm, error):
                self._leave("interrupted", 130)
            self._end("interrupted", 130)
        if self.comm.size > 1 and not isinstance(error, SystemExit):
            # A rank that fails alone would leave the others waiting for it.
            import traceback

            traceback.print_exception(kind, error, trace)
            self.comm.Abort(1)

    def _pass_on(self) -> None:
        """Wait until mpirun has passed on what was printed: what follows on stderr would go astray with it."""
        if self.comm.size > 1 and self.first:
            sys.stdout.flush()
            sleep(PASSED_ON)

    def _end(self, message: str, status: int) -> NoReturn:
        if self.first:
            print(f"rotfem: {message}", file=sys.stderr)
        raise SystemExit(status) from None

    def _leave(self, message: str, status: int) -> NoReturn:
        """End this process at once: the others may be waiting for it, or gone, so that it must not wait for them."""
        if self.first:
            print(f"rotfem: {message}", file=sys.stderr, flush=True)
        os._exit(status)

    def _tidy(self) -> None:
        """Remove the folders that this command made, the innermost first, as far as they are empty."""
        for made in self._made:
            try:
                made.rmdir()
            except OSError:
                return

    def folder(self, path: Path, command: str, inputs: Sequence[Path]) -> ResultFolder:
        """Return the result folder, made and locked; say so if the command before was killed there.

        Raises:
            OutputError: it is not to be written (see `rotfem.results.result_set.ResultSet`).
        """
        if self.first:
            self._made = [p for p in (path, *path.parents) if not os.path.exists(p)]  # Path.exists may raise
        self._folder = ResultFolder(self.comm, path, command, inputs)
        if self._folder.set is not None and self._folder.set.before and not self.quiet:
            print(f"warning: {self._folder.set.before}", file=sys.stderr)
        return self._folder

    def check_writable(self, option: str, path: Path, inputs: Sequence[Path]) -> None:
        """See that the file of an option can be written, before anything is computed, and is none that was read.

        Raises:
            SceneError: it cannot.
        """
        from rotfem.results.files import unwritable

        reason = self.comm.bcast(unwritable(path, inputs) if self.first else None)
        if reason:
            raise SceneError("command line", option, str(path), reason)

    def progress(self, title: str) -> ProgressBar:
        """Return the progress bar: on a terminal only, and only where the command may speak."""
        speaks = self.first and not self.quiet and not self.as_json
        return ProgressBar(title, speaks and sys.stderr.isatty(), speaks)

    def hint(self, unwanted: bool) -> Callable[[str], None] | None:
        """Return what prints advice on stderr, rank 0 only; None where it is not wanted."""
        if unwanted or self.quiet:
            return None
        return lambda line: print(f"hint: {line}", file=sys.stderr) if self.first else None

    def write(self, result: Any, plots: bool, further: Sequence[Writer] = ()) -> None:
        """Write a result and its figures; print its summary if --json asks for it.

        Args:
            result: the result.
            plots: whether its figures are wanted.
            further: what else is to be written.

        Raises:
            OutputError: a file cannot be written; those that can are.
            SceneError: something further cannot be made.
        """
        assert self._folder is not None
        problems = self._folder.write(result, plots, further)
        self.print_json(result.summary)
        for warning in result.summary["warnings"]:
            if self.first and not self.quiet:
                print(f"warning: {warning}", file=sys.stderr)
        if problems:
            raise problems[0]

    def print_json(self, summary: dict[str, Any]) -> None:
        """Print a summary if --json asks for it."""
        if self.first and self.as_json:
            sys.stdout.write(json_text(summary))
            self._pass_on()

    def say(self, lines: list[str]) -> None:
        """Print what was done."""
        if self.first and not (self.quiet or self.as_json):
            print("\n".join(map(printable, lines)))


class ProgressBar:
    """Progress on stderr; calls are free where it is off.

    Args:
        title: text before the bar.
        on: whether to draw it.
        speaks: whether lines may be printed.
    """

    def __init__(self, title: str, on: bool, speaks: bool):
        self._bar: Any = None
        self._title = title
        self._on, self._speaks = on, speaks
        self._started = monotonic()
        self._due, self._last = self._started + LONG, (0.0, -1.0)

    def says(self, line: str) -> None:
        """Print a line, above the bar if there is one."""
        if self._bar is not None:
            self._bar.console.print(line, markup=False, highlight=False)
        elif self._speaks:
            print(line, file=sys.stderr, flush=True)

    def __enter__(self) -> Callable[[float], None]:
        if not self._on:
            return self._tell if self._speaks else lambda share: None
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        columns = (TextColumn(self._title), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._bar.start()
        task = self._bar.add_task("", total=1.0)
        return lambda share: self._bar.update(task, completed=share)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _tell(self, share: float) -> None:
        """Print how far a long computation is and how long it will still take, by its pace since the last such line."""
        now = monotonic()
        since, before = self._last
        if before < 0.0:  # compilation is over
            self._due, self._last = max(self._due, now + LONG / 2), (now, share)
            return
        if now < self._due or not before < share < 1.0:
            return
        left = (1.0 - share) * (now - since) / (share - before)
        self._due, self._last = self._started + 2 * (now - self._started), (now, share)
        self.says(f"{self._title}: {100 * share:.3g} % after {now - self._started:.0f} s, about {left:.3g} s to go")


def _interrupt(signum: int, frame: object) -> NoReturn:
    raise KeyboardInterrupt
