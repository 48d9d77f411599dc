"""The files of one computation in a folder: one set, which takes the place of the one before as a whole.

At every instant a folder holds the complete set of one computation, or a summary.json that says that its set is not
complete. The steps are ordered for that: new files are written under hidden names; a summary.json that says "writing"
replaces the old one; the old set's files are removed, by the list in its summary, so that nothing else in the folder is
touched; the new files get their names; large files follow; summary.json, renamed into place, ends it.
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import socket
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rotfem.errors import OutputError
from rotfem.results.files import PART, json_text, prepare_folder, write_text
from rotfem.results.live import LiveTable
from rotfem.results.lock import FolderLock

if TYPE_CHECKING:
    from rotfem.results.result import Result
    from rotfem.results.run import Table

SUMMARY = "summary.json"

#: Names that are those of results in a folder with a summary of one; a set with others lists them in its summary.
OURS = re.compile(
    r"(history|shape|stations|resultants|modes|mode_shapes|sensitivities|unknowns|campbell|cost|check)\.csv|"
    r"(modes|campbell|explain|cost)\.json|mode_\d+\.gif|state_space\.npz|"
    r"(history|shape|stations|resultants|modes|mode_\d+|campbell|travelling_waves|explain|cost|check)\.png|"
    r"[MCK]\.(mtx|npz)|(fields|modes|stations_line)\.(bp|xdmf|h5)|(checkpoint|stations)\.h5"
)


class ResultSet:
    """The files of one computation, locked in their folder while they are written.

    Args:
        folder: result folder, made where it is not there.
        command: verb that computes.

    Attributes:
        files: names of the set's files so far.
        live: table that is on disk while it grows, if there is one.

    Raises:
        OutputError: the folder cannot be written, or another process writes in it.
    """

    def __init__(self, folder: Path, command: str = ""):
        self.folder, self.command = prepare_folder(folder), command
        self.files: list[str] = []
        self.begun = False
        self.live: LiveTable | None = None
        self._staged: set[str] = set()
        self._lock = FolderLock(folder)
        self._lock.acquire()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the folder free."""
        self._lock.release()

    def begin(self, status: str, keep: Collection[str] = ()) -> None:
        """Say that the folder's set is this one and not complete, and remove the one before.

        Args:
            status: what summary.json says: "running" or "writing".
            keep: files of the set before that are part of this one.

        Raises:
            OutputError: summary.json cannot be written.
        """
        if self.begun:
            return
        old = [name for name in previous(self.folder) if name not in keep]
        self.files = old  # they are found by the next start, should this one be killed here
        self.mark(status)
        for name in [*old, *(name for name in leftovers(self.folder) if name not in self._staged)]:
            remove(self.folder / name)
        self.begun, self.files = True, []

    def mark(self, status: str) -> None:
        """Write a summary.json that says only what is going on.

        Raises:
            OutputError: it cannot be written.
        """
        owner = {"pid": os.getpid(), "host": socket.gethostname()}
        self._summarise({"command": self.command, "status": status, **owner, "warnings": []})

    def _summarise(self, summary: Mapping[str, Any]) -> Path:
        further = sorted(name for name in self.files if not OURS.fullmatch(name))
        return write_text(self.folder / SUMMARY, json_text({**summary, **({"files": further} if further else {})}))

    def put(self, texts: Mapping[str, str]) -> list[Path]:
        """Write files, all or none; return their paths.

        Raises:
            OutputError: one cannot be written; the set before is still there, if this one has not begun.
        """
        with self.stage() as new:
            for name, text in texts.items():
                write_text(new / name, text)
        return [self.folder / name for name in texts]

    @contextmanager
    def stage(self) -> Iterator[Path]:
        """Give a hidden folder; what is in it at the end becomes part of the set, unless there was an error.

        Raises:
            OutputError: it cannot be made, or its files cannot be moved.
        """
        new, whole = self.open_stage(), False
        try:
            yield new
            whole = True
        except OutputError as error:
            raise self.outside(error) from None
        finally:
            self.close_stage(new, whole)

    def outside(self, error: OutputError) -> OutputError:
        """Return an error with a file of a hidden folder as one with the name that it would have had."""
        return OutputError(self.folder / Path(str(error.path)).name, error.reason)

    def open_stage(self) -> Path:
        """Return a new hidden folder.

        Raises:
            OutputError: it cannot be made.
        """
        try:
            new = Path(tempfile.mkdtemp(dir=self.folder, prefix=PART, suffix=".part"))
        except OSError as error:
            raise OutputError(self.folder, error.strerror or str(error)) from None
        self._staged.add(new.name)
        return new

    def close_stage(self, new: Path, whole: bool) -> None:
        """Move what is in a hidden folder into the set if it is whole, and remove the folder.

        Raises:
            OutputError: it cannot be moved.
        """
        try:
            if whole:
                self._adopt(new)
        finally:
            remove(new)
            self._staged.discard(new.name)

    def _adopt(self, new: Path) -> None:
        names = sorted(os.listdir(new))
        for name in names:
            if (self.folder / name).is_dir() and not (new / name).is_dir():
                raise OutputError(self.folder / name, os.strerror(errno.EISDIR))
        self.begin("writing")
        self.files = sorted({*self.files, *names})
        try:
            for name in names:
                os.replace(new / name, self.folder / name)
        except OSError as error:
            raise OutputError(self.folder, error.strerror or str(error)) from None

    def grow(self, name: str, table: Table) -> LiveTable:
        """Return a table of the set that is on disk while it grows.

        Raises:
            OutputError: it cannot be written.
        """
        self.begin("running")
        self.live = LiveTable(self.folder / name, table)
        self.files.append(name)
        return self.live

    def publish(self, result: Result, complete: bool = True) -> list[Path]:
        """Write the files of a result, the summary last; return their paths.

        Args:
            result: the result.
            complete: whether no other files follow.

        Raises:
            OutputError: one cannot be written.
        """
        texts = result.files()
        paths = [self.folder / name for name in texts]
        live = self.live
        if live is not None and live.flush() and live.path.name in texts:
            del texts[live.path.name]
        self.put({name: text for name, text in texts.items() if name != SUMMARY})
        following = not complete and result.status == "done"
        self.finish(result.summary, "writing" if following else None)
        return paths

    def finish(self, summary: Mapping[str, Any], status: str | None = None) -> Path:
        """Write summary.json with the list of the files; return its path.

        Args:
            summary: of the result.
            status: another one than the summary's, while files are to follow.

        Raises:
            OutputError: it cannot be written.
        """
        self.begin("writing")
        return self._summarise({**summary, "status": status or summary["status"]})


def previous(folder: Path) -> list[str]:
    """Return the names of the files there that belong to the set of the folder's summary, but for that itself."""
    summary = read_summary(folder)
    if "status" not in summary:
        return []
    listed = summary.get("files")
    further = listed if isinstance(listed, list) else []
    return [name for name in os.listdir(folder) if name != SUMMARY and (OURS.fullmatch(name) or name in further)]


def read_summary(folder: Path) -> dict[str, Any]:
    """Return the folder's summary; empty where there is none that can be read."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return summary if isinstance(summary, dict) else {}


def leftovers(folder: Path) -> list[str]:
    """Return the hidden names that killed processes left in a folder (which is locked now)."""
    return [name for name in os.listdir(folder) if name.startswith(PART) and name.endswith(".part")]


def remove(path: Path) -> None:
    """Remove a file or a folder, as far as that goes."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return
