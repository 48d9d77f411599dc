"""The files of one computation in a folder: each one whole, summary.json last.

A folder is rotfem's own if it was empty, or if its summary.json has the version of rotfem in it. Any other one is
refused, so that nothing of somebody else's is removed or written over. Until all files are there the summary says
"running". The next computation in the folder removes the files of this one, by their names, before it writes its own.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from math import inf
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

from rotfem.errors import ComputationError, InputError, OutputError, SceneError
from rotfem.results.files import PART, csv_text, json_text, line, read_csv, write_text, writing
from rotfem.version import __version__

if TYPE_CHECKING:
    from rotfem.results.result import Result
    from rotfem.results.run import Table

T = TypeVar("T")

#: Writes files into a folder.
Writer = Callable[[Path], Any]

SUMMARY, CHECKPOINT = "summary.json", "checkpoint.npz"

#: Status of a computation that has not ended, or was killed.
RUNNING = "running"

#: Names of the files of results, which the next computation in the folder removes.
RESULTS = re.compile(
    r"(history|shape|stations|resultants|modes|mode_shapes|sensitivities|unknowns)\.csv|"
    r"(history|loads|shape|stations|resultants|modes|mode_\d+|response|campbell_fixed)\.png|"
    r"(campbell|explain|cost|check|compare|sweep|response)\.(csv|json|png)|modes\.json|report\.html|sweep\.nc|"
    r"mode_\d+\.gif|state_space\.npz|[MCK]\.(mtx|npz)|(fields|modes|stations_line)\.(bp|xdmf|h5)|"
    r"(stations|checkpoint)\.(h5|npz)"
)

#: Names of what `campbell` and `sweep` go on with, which stays.
KEPT = ("speeds.npz", "points")


class ResultFolder(AbstractContextManager["ResultFolder"]):
    """The result folder of a command: rank 0 has the files, all ranks have its errors, and call it together.

    Args:
        comm: communicator of the command.
        path: the folder, made where it is not there.
        command: its verb.
        inputs: files that it has read.

    Attributes:
        summary: what summary.json holds; empty before anything is written.

    Raises:
        OutputError: it cannot be written, is none of rotfem's, or holds a symbolic link or an input.
    """

    def __init__(self, comm: Any, path: Path, command: str, inputs: Iterable[Path] = ()):
        self.comm, self.path, self.command = comm, path, command
        self.summary: dict[str, Any] = {}
        self._live: LiveTable | None = None
        self.first_does(lambda: check_own(path, inputs))

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.close(error)

    def close(self, error: BaseException | None = None) -> None:
        """Say in the summary what ended the command where its results are not complete."""
        if self._live is not None:
            self._live.close()
        if self.comm.rank == 0 and self.summary.get("status") == RUNNING:
            kind = "" if isinstance(error, ComputationError | InputError | OutputError) else f"{type(error).__name__}: "
            failure = {"what": " ".join(f"{kind}{error}".split()), "time": None, "advice": ""}
            status = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
            with suppress(OutputError):  # as where the disk is full
                self.summarise({"failure": failure, **self.summary, "status": status})

    def first_does(self, work: Callable[[], T]) -> T:
        """Return on every rank what rank 0 makes of some work with the files, or raise its error."""
        done, problem = None, None
        if self.comm.rank == 0:
            try:
                done = work()
            except (ComputationError, OutputError, SceneError) as error:
                problem = error
        found: tuple[T, Exception | None] = self.comm.bcast((done, problem))
        if found[1] is not None:
            raise found[1]
        return found[0]

    def begin(self, keep: Collection[str] = ()) -> None:
        """Say that a computation is running, and remove the results of the one before but for some names."""
        if self.summary:
            return
        self.summary = {"command": self.command, "status": RUNNING, "warnings": []}
        self.first_does(lambda: self.summarise(self.summary))
        if self.comm.rank == 0:
            for name in os.listdir(self.path):
                if name not in keep and (RESULTS.fullmatch(name) or name.startswith(PART)):
                    remove(self.path / name)

    def summarise(self, summary: Mapping[str, Any]) -> Path:
        """Write summary.json, on rank 0."""
        self.summary = {"versions": {"rotfem": __version__}, **summary}
        return write_text(self.path / SUMMARY, json_text(self.summary))

    def grow(self, name: str, table: Table) -> LiveTable | None:
        """Return a table that is on disk while it grows; None on other ranks than the first."""

        def begin() -> None:
            self._live = LiveTable(self.path / name, table)

        self.first_does(begin)
        return self._live

    def publish(self, result: Result) -> list[Path]:
        """Write the tables of a result and its summary; return their paths."""
        tables = self._tables(result)
        return [*tables, self.first_does(lambda: self.summarise(result.summary))]

    def _tables(self, result: Result) -> list[Path]:
        self.begin()
        return self.first_does(lambda: [write_text(self.path / name, text) for name, text in result.texts().items()])

    def write(self, result: Result, plots: bool, further: Sequence[Writer] = ()) -> list[OutputError | SceneError]:
        """Write a result, tables first, then large files and figures; return what went wrong with these."""
        fields: Writer | None = getattr(result, "fields", None)
        writers = [(write, False) for write in (*result.large(), *further, *([result.draw] if plots else []))]
        if fields is not None:
            writers.append((fields, result.summary.get("shared") == "mesh"))
        self._tables(result)
        self.summary = {**result.summary, "status": RUNNING}
        found = [self._problem(write, together) for write, together in writers]
        problems = [problem for problem in found if problem is not None]
        lost = [f"not written: {problem}" for problem in problems if isinstance(problem, OutputError)]
        result.summary["warnings"] = [*result.summary["warnings"], *lost]
        self.first_does(lambda: self.summarise(result.summary))
        return problems

    def add(self, result: Result, further: Sequence[Writer] = ()) -> list[OutputError | SceneError]:
        """Write the summary of a result that is written already, and what else is wanted; return what went wrong."""
        found = [self._problem(write, False) for write in further]
        self.first_does(lambda: self.summarise(result.summary))
        return [problem for problem in found if problem is not None]

    def _problem(self, write: Writer, together: bool) -> OutputError | SceneError | None:
        """Write files on rank 0, or on all ranks together; return the error of the first rank that has one."""
        problem = None
        if together or self.comm.rank == 0:
            try:
                write(self.path)
            except (OutputError, SceneError) as error:
                problem = error
        return next((found for found in self.comm.allgather(problem) if found is not None), None)


def check_own(folder: Path, inputs: Iterable[Path] = ()) -> None:
    """Make a folder, and see that results may be written there."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
    foreign = [entry.name for entry in entries if entry.name not in KEPT and not entry.name.startswith(PART)]
    if foreign and not is_ours(read_summary(folder)):
        raise OutputError(folder, f"it holds {foreign[0]}, and no results of rotfem")
    for entry in entries:
        if entry.is_symlink():
            raise OutputError(folder / entry.name, "it is a symbolic link, which is not followed")
    top = Path(os.path.realpath(folder))
    for path in inputs:
        if Path(os.path.realpath(path)).is_relative_to(top):
            raise OutputError(folder, f"it holds {path}, which is read")


def is_ours(summary: Mapping[str, Any]) -> bool:
    """Return whether a summary is one of rotfem's."""
    versions = summary.get("versions")
    return isinstance(versions, dict) and "rotfem" in versions and "status" in summary


def said_of(folder: Path) -> str:
    """Return in words how the computation of a folder ended, and what there is of one that is not complete."""
    summary = read_summary(folder)
    if not is_ours(summary):
        raise OutputError(folder, "there are no results of rotfem")
    status = summary["status"]
    how = "is running, or was killed" if status == RUNNING else status
    failure = f": {summary['failure']['what']}" if "failure" in summary else ""
    return "; ".join([f"{folder}: {summary.get('command', 'results')} {how}{failure}", *kept_in(folder)])


def kept_in(folder: Path) -> list[str]:
    """Return in words what a folder has of a history, and how one that is not complete goes on."""
    out = []
    with suppress(OSError, ValueError, IndexError, KeyError):
        t = read_csv(folder / "history.csv")["t"]
        out.append(f"history.csv has {len(t)} rows, up to t = {t[-1]:.6g} s")
    if read_summary(folder).get("status") != "done" and (folder / CHECKPOINT).exists():
        out.append("--resume goes on from its checkpoint")
    return out


def read_summary(folder: Path) -> dict[str, Any]:
    """Return the folder's summary; empty where there is none that can be read."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return summary if isinstance(summary, dict) else {}


def remove(path: Path) -> None:
    """Remove a file or a folder, as far as that goes."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


class LiveTable:
    """CSV file of a table that grows: new rows are on disk once a second, until the disk is full.

    Raises:
        OutputError: the file cannot be written.
    """

    def __init__(self, path: Path, table: Table):
        self._table, self._rows, self._written = table, len(table), monotonic()
        with writing(path):
            self._file = open(write_text(path, csv_text(table.arrays())), "ab", buffering=0)  # noqa: SIM115

    def update(self) -> None:
        """Write the rows that are new, if a second has passed since that was done."""
        if monotonic() - self._written >= 1.0:
            self.flush()

    def flush(self) -> None:
        """Write the rows that are new, by one call of the system."""
        new = self._table.rows(self._rows)
        self._rows, self._written = self._rows + len(new), monotonic()
        try:
            self._file.write("".join(map(line, new)).encode())
        except OSError:
            self._written = inf  # no rows after a gap; all are written again at the end

    def close(self) -> None:
        """Write what is new, and close the file."""
        if self._written < inf:
            self.flush()
        self._file.close()
