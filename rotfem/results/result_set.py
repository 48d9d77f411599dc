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
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, TypeVar

from rotfem.errors import ComputationError, InputError, OutputError, SceneError
from rotfem.results.files import PART, Table, json_text, read_csv, write_text, writing
from rotfem.version import __version__

T = TypeVar("T")

#: Writes files into a folder.
Writer = Callable[[Path], object]

SUMMARY, CHECKPOINT = "summary.json", "checkpoint.npz"

#: Status of a computation that has not ended, or was killed.
RUNNING = "running"

#: Names of the files of results, which the next computation in the folder removes.
RESULTS = re.compile(
    r"(history|loads|shape|stations|resultants|modes|mode_(shapes|table|polynomials|\d+)|sensitivities|unknowns|fields|"
    r"campbell(_fixed)?|unbalance\w*|explain|cost|check|compare|sweep|response|report|state_space|elastodyn_modes|"
    r"checkpoint|[MCK])\.(csv|json|png|html|nc|gif|dat|npz|mtx|bp|xdmf|h5)"
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
        self._growing: Table | None = None
        self._made = [p for p in (path, *path.parents) if not os.path.exists(p)]  # Path.exists may raise
        self.first_does(lambda: check_own(path, inputs))

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.close(error)

    def close(self, error: BaseException | None = None) -> None:
        """Say in the summary what ended the command where its results are not complete; remove made, empty folders."""
        if error is not None and self.comm.rank == 0:
            with suppress(OSError):
                for made in self._made:
                    made.rmdir()
        if self.comm.rank == 0 and self.summary.get("status") == RUNNING:
            if self._growing is not None:
                self._growing.flush()
            kind = "" if isinstance(error, ComputationError | InputError | OutputError) else f"{type(error).__name__}: "
            found: dict[str, Any] = {"status": "interrupted"}
            if not isinstance(error, KeyboardInterrupt):
                what = {"what": " ".join(f"{kind}{error}".split()), "time": None, "advice": ""}
                found = {"status": "failed", "failure": self.summary.get("failure", what)}
            with suppress(OutputError):  # as where the disk is full
                self._summarise({**self.summary, **found})

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
        self.summarise(self.summary)
        if self.comm.rank == 0:
            for name in os.listdir(self.path):
                if name not in keep and (RESULTS.fullmatch(name) or name.startswith(PART)):
                    remove(self.path / name)

    def summarise(self, summary: Mapping[str, Any]) -> Path:
        """Write summary.json."""
        return self.first_does(lambda: self._summarise(summary))

    def _summarise(self, summary: Mapping[str, Any]) -> Path:
        self.summary = {"versions": {"rotfem": __version__}, **summary}
        return write_text(self.path / SUMMARY, json_text(self.summary))

    def grow(self, name: str, table: Table) -> None:
        """Write a table that goes on growing on disk."""
        self.first_does(lambda: table.keep(self.path / name))
        self._growing = table

    def publish(self, texts: Mapping[str, str]) -> list[Path]:
        """Write tables, file name ↦ text; return their paths."""
        self.begin()
        self._growing = None
        return self.first_does(lambda: [write_text(self.path / name, text) for name, text in texts.items()])

    def attempt(self, write: Writer, together: bool = False) -> OutputError | SceneError | None:
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
