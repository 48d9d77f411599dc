"""One verb from its start to its end: where results go, and of a command who speaks and what an error prints.

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
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from textwrap import wrap
from time import sleep
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from rotfem import units
from rotfem.commands.interrupts import together
from rotfem.errors import ComputationError, InputError, OutputError, SceneError, printable
from rotfem.listeners import ONE_PROCESS

if TYPE_CHECKING:
    from rotfem.results.result import Result
    from rotfem.results.result_set import ResultFolder, Writer
    from rotfem.scene import Scene

R = TypeVar("R", bound="Result")


def folded(text: str, at_terminal: bool) -> str:
    """Return a text with its lines folded to the width of the terminal; as it is where there is none."""
    if not at_terminal:
        return text
    width = shutil.get_terminal_size().columns
    folds: dict[str, Any] = {"subsequent_indent": "  ", "break_long_words": False, "break_on_hyphens": False}
    return "\n".join("\n".join(wrap(x, width, **folds)) if len(x) > width else x for x in text.split("\n"))


class Job:
    """One verb on a scene: who computes it, and where its results go.

    Attributes:
        comm: processes of the command.
        first: whether this is the one that writes.
        scene: what it computes.
        results: folder where its results go, if they do.
    """

    scene: Scene
    results: ResultFolder | None = None

    def __init__(self, comm: Any = None, plots: bool = True, report: bool = False):
        if comm is None:
            comm = ONE_PROCESS
            with suppress(ImportError):  # some commands do without FEniCSx, and so without MPI
                from mpi4py import MPI

                comm = MPI.COMM_WORLD
        self.comm, self.plots, self.report = comm, plots, report
        self.first = bool(comm.rank == 0)
        self._shown = False

    def open(self, path: Path, command: str, inputs: Sequence[Path] | None = None) -> None:
        """Make the result folder, where it is not there."""
        from rotfem.results.result_set import ResultFolder

        if self.report and find_spec("bokeh") is None:
            raise InputError("--report", None, "needs bokeh, which is not installed: pip install bokeh")
        self.results = ResultFolder(self.comm, path, command, self.scene.inputs if inputs is None else inputs)

    def close(self, error: BaseException | None) -> None:
        """Say in the folder how the command ended, where its results are not complete."""
        if self.results is not None:
            self.results.close(error)

    def check_writable(self, option: str, path: str | Path | None, inputs: Sequence[Path]) -> None:
        """See that the file of an option can be written, before anything is computed, and is none that was read."""
        from rotfem.results.files import unwritable

        reason = self.comm.bcast(unwritable(Path(path), inputs) if self.first and path is not None else None)
        if reason:
            raise SceneError("command line", option, str(path), reason)

    def finish(self, result: R, further: Sequence[Writer] = (), last: bool = True) -> R:
        """Write a result, its figures and what else is wanted; return it.

        One that is not the last waits for its error; after it, the last one is written with that alone.
        """
        problems = self._written(result, further, last)
        if problems:
            raise problems[0]
        return result

    def _written(self, result: Result, further: Sequence[Writer], last: bool) -> list[OutputError | SceneError]:
        if self.results is None:
            return []
        if self.report and last:
            further = [*further, self._page(result)]
        again, self._shown = self._shown, not last
        return result.write_into(self.results, self.plots, further, again)

    def _page(self, result: Result) -> Writer:
        """Return what writes report.html of a result, with a drawing of the scene's structure."""
        from rotfem.commands.check import weighed
        from rotfem.results.report import write_report

        drawing = None
        if result.summary["command"] != "check":
            with suppress(InputError, ComputationError):
                drawing = weighed(self.scene, self.comm).plot()
        return partial(write_report, result, drawing)

    def say(self, *lines: str) -> None:
        """Print what was done; a script has it in its result."""


class Session(Job):
    """One command under one set of flags: speaks on rank 0 only, and turns errors into messages and exit status.

    It prints JSON of the summary and nothing else on stdout, errors only if it is quiet, and tracebacks to debug.

    Attributes:
        bar: progress of the computation.
    """

    def __init__(
        self,
        as_json: bool = False,
        quiet: bool = False,
        debug: bool = False,
        plots: bool = True,
        report: bool = False,
    ):
        super().__init__(None, plots, report)
        self.as_json, self.quiet, self.debug = as_json, quiet, debug
        self.bar = ProgressBar()
        self._warned = 0

    def __enter__(self) -> Session:
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")  # not every terminal has every letter
        self._unit = units.SPEED.set("rad/s")
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.bar.stop()
        units.SPEED.reset(self._unit)
        self.close(error)
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

        if self.results is None:
            return ""
        found = kept_in(self.results.path) if self.results.summary else []
        return "; ".join(["", f"results until then are in {self.results.path}", *found]) if found else ""

    def _end(self, message: str, status: int, alone: bool = False) -> NoReturn:
        """End this process, at once where the others may be waiting for it, or gone."""
        self.remark(f"rotfem: {message}")
        if alone:
            os._exit(status)
        raise SystemExit(status) from None

    def open(self, path: Path, command: str, inputs: Sequence[Path] | None = None) -> None:
        """Make the result folder, where it is not there; from now on signals end a command with its results."""
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        if not gc.isenabled():  # see `rotfem.__main__`
            gc.freeze()
            gc.enable()
        if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        super().open(path, command, inputs)

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

    def finish(self, result: R, further: Sequence[Writer] = (), last: bool = True) -> R:
        """Write a result and what else is wanted, and print it unless it failed; after its error that alone."""
        from rotfem.commands.printed import of_error, report

        self.bar.describe("writing results and figures")
        again = self._shown
        problems = self._written(result, further, last)
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
        elif result.status == "done" and self.results is not None:
            self.say(*report(result), f"results in {self.results.path}")
        return result

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
