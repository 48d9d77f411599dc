"""One command from its start to its exit status: who speaks, where results go, what an error prints.

Exit status 0 done, 2 bad input, 3 the computation failed, 130 interrupted.
"""

from __future__ import annotations

import gc
import io
import logging
import os
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from textwrap import wrap
from time import sleep
from typing import TYPE_CHECKING, Any, NoReturn

from rotfem import units
from rotfem.commands.interrupts import together
from rotfem.errors import ComputationError, InputError, OutputError, SceneError, printable
from rotfem.listeners import ONE_PROCESS

if TYPE_CHECKING:
    from rotfem.results.result import Result
    from rotfem.results.result_set import ResultFolder, Writer
    from rotfem.scene import Scene


def folded(text: str, at_terminal: bool) -> str:
    """Return a text with its lines folded to the width of the terminal; as it is where there is none."""
    if not at_terminal:
        return text
    width = shutil.get_terminal_size().columns
    folds: dict[str, Any] = {"subsequent_indent": "  ", "break_long_words": False, "break_on_hyphens": False}
    return "\n".join("\n".join(wrap(x, width, **folds)) if len(x) > width else x for x in text.split("\n"))


class Session:
    """One command under one set of flags: speaks on rank 0 only, and turns errors into messages and exit status.

    It prints JSON of the summary and nothing else on stdout, errors only if it is quiet, and tracebacks to debug.

    Attributes:
        comm: processes of the command.
        bar: progress of the computation.
        scene: what it computes, of a verb on a scene.
        results: folder where its results go, of those that have one.
        hint: receives advice; None where none is wanted.
        report: whether report.html is wanted.
    """

    scene: Scene
    results: ResultFolder
    hint: Callable[[str], None] | None = None
    report = False

    def __init__(self, as_json: bool = False, quiet: bool = False, debug: bool = False, no_plots: bool = False):
        self.comm: Any = ONE_PROCESS
        with suppress(ImportError):  # some commands do without FEniCSx, and so without MPI
            from mpi4py import MPI

            self.comm = MPI.COMM_WORLD
        self.as_json, self.quiet, self.debug, self.plots = as_json, quiet, debug, not no_plots
        self.first = self.comm.rank == 0
        self.bar = ProgressBar()
        self._warned, self._shown = 0, False

    def __enter__(self) -> Session:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")  # not every terminal has every letter
        self._unit = units.SPEED.set("rad/s")
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.bar.stop()
        units.SPEED.reset(self._unit)
        if hasattr(self, "results"):
            self.results.close(error)
        self._pass_on()
        if error is None or (self.debug and not isinstance(error, SystemExit)):
            return
        if isinstance(error, InputError | OutputError):
            self._end(str(error), 2)
        if isinstance(error, ComputationError):
            self._end(f"the computation failed: {error}{self._kept()}", 3)
        if isinstance(error, MemoryError):
            self._end("the computation failed: there is not enough memory; use fewer elements, or fewer modes", 3)
        if isinstance(error, KeyboardInterrupt):
            message = f"interrupted{self._kept() or '; there are no results yet'}"
            self._end(message, 130, alone=not together(self.comm, error))
        from rotfem.scene.extensions import failure

        if isinstance(error, Exception) and (message := failure(error)):
            if not self.first:
                sleep(1.0)  # rank 0 speaks before mpirun ends it
            self._end(message, 2, alone=self.comm.size > 1)
        if self.comm.size > 1 and not isinstance(error, SystemExit):
            # A rank that fails alone would leave the others waiting for it.
            import traceback

            traceback.print_exception(kind, error, trace)
            self.comm.Abort(1)

    def _pass_on(self) -> None:
        """Wait until mpirun has passed on what was printed: what follows on stderr would go astray with it."""
        if self.comm.size > 1 and self.first:
            sys.stdout.flush()
            sleep(0.2)

    def _kept(self) -> str:
        """Return where results are of a command that did not end well, and how it goes on; empty where none are."""
        from rotfem.results.result_set import kept_in

        if not hasattr(self, "results"):
            return ""
        found = kept_in(self.results.path) if self.results.summary else []
        return "; ".join(["", f"results until then are in {self.results.path}", *found]) if found else ""

    def _end(self, message: str, status: int, alone: bool = False) -> NoReturn:
        """End this process, at once where the others may be waiting for it, or gone."""
        self.remark(f"rotfem: {message}")
        if alone:
            os._exit(status)
        raise SystemExit(status) from None

    def folder(self, path: Path, command: str, inputs: Sequence[Path]) -> ResultFolder:
        """Return the result folder, made where it is not there; from now on signals end a command with its results."""
        from rotfem.results.result_set import ResultFolder

        signal.signal(signal.SIGTERM, signal.default_int_handler)
        if not gc.isenabled():  # see `rotfem.__main__`
            gc.freeze()
            gc.enable()
        if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        self.results = ResultFolder(self.comm, path, command, inputs)
        return self.results

    def check_writable(self, option: str, path: Path, inputs: Sequence[Path]) -> None:
        """See that the file of an option can be written, before anything is computed, and is none that was read."""
        from rotfem.results.files import unwritable

        reason = self.comm.bcast(unwritable(path, inputs) if self.first else None)
        if reason:
            raise SceneError("command line", option, str(path), reason)

    def start(self, title: str, unit: str = "rad/s") -> None:
        """Begin to show progress; messages have speeds in the unit, too."""
        units.SPEED.set(unit)
        self.bar = ProgressBar(title, self.first and not self.quiet and not self.as_json)
        self.bar.start()

    def remark(self, line: str) -> None:
        """Print a line on stderr, above the bar."""
        if self.first:
            self.bar.print(line)

    def advise(self, line: str) -> None:
        """Print a line of advice on stderr."""
        self.remark(f"hint: {line}")

    def finish(self, result: Result, further: Sequence[Writer] = (), last: bool = True) -> None:
        """Write a result, its figures and what else is wanted, and print it unless it failed.

        One that is not the last waits for its error; after it, the last one is written and printed with that alone.
        """
        from rotfem.commands.printed import of_error, report

        if self.report and last:
            further = [*further, self._page(result)]
        self.bar.describe("writing results and figures")
        again = self._shown
        problems = result.write_into(self.results, self.plots, further, again)
        self._shown = not last
        self.bar.stop()
        if last:
            self.print_json(result.summary)
        for warning in result.summary["warnings"][self._warned :]:
            if not self.quiet:
                self.remark(f"warning: {warning}")
        self._warned = len(result.summary["warnings"])
        if problems:
            raise problems[0]
        if again:
            self.say(*of_error(result.summary))
        elif result.status == "done":
            self.say(*report(result), f"results in {self.results.path}")

    def _page(self, result: Result) -> Writer:
        """Return what writes report.html of a result, with a drawing of the scene's structure."""
        from rotfem.commands.check import check
        from rotfem.results.report import write_report

        drawing = None
        if result.summary["command"] != "check":
            with suppress(InputError, ComputationError):
                drawing = check(self.scene, comm=self.comm).plot()
        return partial(write_report, result, drawing)

    def print_json(self, summary: dict[str, Any]) -> None:
        """Print a summary if --json asks for it."""
        if self.first and self.as_json:
            from rotfem.results.files import json_text

            sys.stdout.write(json_text(summary))
            self._pass_on()

    def say(self, *lines: str) -> None:
        """Print what was done."""
        if self.first and not (self.quiet or self.as_json):
            self.bar.stop()
            print(folded("\n".join(map(printable, lines)), sys.stdout.isatty()))


class ProgressBar:
    """Progress on stderr: a bar at a terminal, nothing elsewhere.

    Args:
        title: of the computation.
        wanted: whether it is shown.
    """

    def __init__(self, title: str = "", wanted: bool = False):
        self._title, self._wanted = title, wanted
        self._bar: Any = None
        self._log = logging.getLogger("ffcx")  # which says what it does on its way to a library

    def start(self) -> None:
        """Draw the bar, which moves by itself until there is progress; it says so when equations are compiled."""
        if not (self._wanted and sys.stderr.isatty()):
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(20))
        percent = TextColumn("{task.fields[percent]}", markup=False)
        self._bar = Progress(*columns, percent, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
        self._bar.add_task(self._title, total=None, percent="")
        self._bar.start()
        self._log.addFilter(self._heard)

    def stop(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
            self._log.removeFilter(self._heard)

    def _heard(self, record: logging.LogRecord) -> bool:
        """Say in the bar that something is compiled, where FFCx's log says so, and nowhere else."""
        if "Compiler stage" in record.getMessage():
            self.describe("compiling (first run only)")
        return record.levelno > logging.INFO

    def describe(self, what: str) -> None:
        """Say what is being done."""
        if self._bar is not None:
            self._bar.update(0, description=f"{self._title}: {what}")

    def print(self, line: str) -> None:
        """Print a line, above the bar if there is one."""
        if self._bar is not None:
            self._bar.console.print(folded(line, True), markup=False, highlight=False, soft_wrap=True)
        else:
            print(folded(line, sys.stderr.isatty()), file=sys.stderr, flush=True)

    def __call__(self, share: float) -> None:
        """Show the share of the work that is done."""
        if self._bar is not None and share > 0.0:
            self._bar.update(0, description=self._title, total=1.0, completed=share, percent=f"{100 * share:3.0f} %")
