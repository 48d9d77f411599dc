"""The files of one computation in a folder: one set, which takes the place of the one before as a whole.

At every instant a folder holds the complete set of one computation, or a summary.json that says that its set is not
complete. The steps are ordered for that: new files are written under hidden names; a summary.json that says "writing"
replaces the old one; the old set's files are removed, by the list in its summary, so that nothing else in the folder is
touched; the new files get their names; large files follow; summary.json, renamed into place, ends it.

A folder whose summary.json has the version of rotfem in it is one of rotfem's. In any other one nothing is removed, and
nothing is written over; nor is a file that the computation has read, wherever it is.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import shutil
import socket
import tempfile
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from rotfem.errors import ComputationError, InputError, OutputError, SceneError
from rotfem.results.files import (
    CHECKPOINT,
    CHECKPOINT_MAGIC,
    PART,
    json_text,
    opened,
    overwrite,
    prepare_folder,
    read_csv,
    write_text,
    writing,
)
from rotfem.results.run import LiveTable
from rotfem.version import __version__

if TYPE_CHECKING:
    from mpi4py import MPI

    from rotfem.results.result import Result
    from rotfem.results.run import Table

T = TypeVar("T")

#: Writes files into a folder.
Writer = Callable[[Path], Any]

#: Name of the file that is locked, while it is; it says who holds the lock.
NAME = ".rotfem.lock"


class FolderLock:
    """Lock on a result folder that is there, from now on until it is released; a second one is refused.

    What a killed process leaves of it is a file that no process holds, and no obstacle.
    """

    def __init__(self, folder: Path):
        self._path = Path(os.path.realpath(folder), NAME)
        self._descriptor: int | None = None
        try:
            while self._descriptor is None:
                self._descriptor = self._locked(folder)
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise OutputError(folder / NAME, "it is a symbolic link, which is not followed") from None
            raise OutputError(folder, error.strerror or str(error)) from None

    def release(self) -> None:
        """Give the lock back, and remove its file."""
        if self._descriptor is not None:
            self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = None

    def _locked(self, folder: Path) -> int | None:
        """Return the descriptor of the file, locked; None where whoever held it has removed it in between."""
        descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = _named_in(descriptor)
            os.close(descriptor)
            raise OutputError(folder, f"{owner} is writing its results there") from None
        except OSError:  # a file system without locks: whoever shares it must take care
            return descriptor
        with suppress(FileNotFoundError):
            if os.path.samestat(os.stat(self._path), os.fstat(descriptor)):
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
                return descriptor
        os.close(descriptor)
        return None


def holder(folder: Path) -> str:
    """Return which process holds the lock on a folder, in words; empty where none does. Nothing is changed."""
    with suppress(OSError), opened(folder / NAME, os.O_RDONLY) as descriptor:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:  # it is held, or the file system has no locks and whoever wrote the file may be there
            return _named_in(descriptor)
    return ""


def _named_in(descriptor: int) -> str:
    return os.pread(descriptor, 200, 0).decode(errors="replace").strip() or "another process"


SUMMARY = "summary.json"

#: Words for a set that is not complete while a process is at work on it.
AT_WORK = ("running", "writing")

#: Characters for which summary.json has room while a process is at work: what went wrong must fit on a full disk.
ROOM = 1000

#: Names that are those of results in a folder with a summary of one; a set with others lists them in its summary.
OURS = re.compile(
    r"(history|shape|stations|resultants|modes|mode_shapes|sensitivities|unknowns)\.csv|"
    r"(history|loads|shape|stations|resultants|modes|mode_\d+|response|campbell_fixed)\.png|"
    r"(campbell|explain|cost|check|compare|sweep)\.(csv|json|png)|modes\.json|report\.html|mode_\d+\.gif|state_space\.npz|"
    r"[MCK]\.(mtx|npz)|(fields|modes|stations_line)\.(bp|xdmf|h5)|(checkpoint|stations)\.h5"
)


class ResultSet(AbstractContextManager["ResultSet"]):
    """The files of one computation, locked in their folder while they are written.

    Args:
        folder: result folder, made where it is not there.
        command: verb that computes.
        inputs: files that it has read.

    Attributes:
        files: names of the set's files so far.
        live: table that is on disk while it grows, if there is one.
        before: what became of the set before, in words, if the process that was at work on it has vanished.

    Raises:
        OutputError: the folder cannot be written, another process writes in it, or it has a file of the name of a
            result that is an input, or none of rotfem's.
    """

    def __init__(self, folder: Path, command: str = "", inputs: Iterable[Path] = ()):
        self.folder, self.command = prepare_folder(folder), command
        self.files: list[str] = []
        self.begun = self.ended = False
        self.live: LiveTable | None = None
        self._staged: set[str] = set()
        there = read_summary(folder)
        left = is_ours(there) and there["status"] in AT_WORK and not holder(folder)
        self.before = said_of(folder) if left else ""
        self._lock = FolderLock(folder)
        taken = self._taken(inputs)
        if taken is not None:
            self._lock.release()
            raise taken

    def _taken(self, inputs: Iterable[Path]) -> OutputError | None:
        """Return the error of a file that is not to be lost and has the name of a result; None where there is none."""
        summary = read_summary(self.folder)
        top, listed = Path(os.path.realpath(self.folder)), summary.get("files") or ()
        for path in map(Path, map(os.path.realpath, inputs)):
            first = path.relative_to(top).parts[0] if path.is_relative_to(top) else ""
            if OURS.fullmatch(first) or first in (SUMMARY, *listed):
                return OutputError(self.folder / first, "the scene reads it")
        if is_ours(summary):
            return None
        for name in sorted(os.listdir(self.folder), key=lambda name: (name != SUMMARY, name)):
            drawn = name.endswith(".png")  # by a script, maybe, from a result that it writes now
            if name == SUMMARY or (OURS.fullmatch(name) and not drawn and not _is_checkpoint(self.folder / name)):
                return OutputError(self.folder / name, "it is there already, in a folder that is none of rotfem's")
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.close(error)

    def close(self, error: BaseException | None = None) -> None:
        """Give the folder free; a set that has not ended by now has failed, by the error that ended it."""
        if self.begun and not self.ended:
            self._fail(error)
        for name in self._staged:
            remove(self.folder / name)
        self._lock.release()

    def _fail(self, error: BaseException | None) -> None:
        kind = "" if isinstance(error, ComputationError | InputError | OutputError) else f"{type(error).__name__}: "
        what = " ".join(f"{kind}{error}".split())[: ROOM // 4]
        status = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
        summary = self._owned(status) | {"failure": {"what": what, "time": None, "advice": ""}}
        try:
            self._summarise(summary)
        except OutputError:
            with suppress(OSError):
                overwrite(self.folder / SUMMARY, self._text(summary))

    def begin(self, status: str, keep: Collection[str] = ()) -> None:
        """Say that the folder's set is this one, "running" or "writing", and remove what is not kept of the one before.

        Raises:
            OutputError: summary.json cannot be written.
        """
        if self.begun:
            return
        old = [name for name in previous(self.folder) if name not in keep]
        self.files = old  # they are found by the next start, should this one be killed here
        self.mark(status)
        hidden = [name for name in os.listdir(self.folder) if name.startswith(PART) and name.endswith(".part")]
        for name in {*old, *hidden} - self._staged:
            remove(self.folder / name)
        self.begun, self.files = True, []

    def mark(self, status: str) -> None:
        """Write a summary.json that says only what is going on."""
        self._summarise(self._owned(status))
        self.ended = status not in AT_WORK

    def _owned(self, status: str) -> dict[str, Any]:
        owner = {"pid": os.getpid(), "host": socket.gethostname()}
        return {"command": self.command, "status": status, **owner, "warnings": []}

    def _summarise(self, summary: Mapping[str, Any]) -> Path:
        text = self._text(summary)
        return write_text(self.folder / SUMMARY, text.ljust(ROOM) if summary["status"] in AT_WORK else text)

    def _text(self, summary: Mapping[str, Any]) -> str:
        further = sorted(name for name in self.files if not OURS.fullmatch(name))
        mark = {"versions": {"rotfem": __version__}}
        return json_text({**mark, **summary, **({"files": further} if further else {})})

    def put(self, texts: Mapping[str, str]) -> list[Path]:
        """Write files, all or none; return their paths."""
        new, whole = self.open_stage(), False
        try:
            for name, text in texts.items():
                write_text(new / name, text)
            whole = True
        except OutputError as error:
            raise OutputError(self.folder / Path(str(error.path)).name, error.reason) from None
        finally:
            self.close_stage(new, whole)
        return [self.folder / name for name in texts]

    def open_stage(self) -> Path:
        """Return a new hidden folder."""
        with writing(self.folder):
            new = Path(tempfile.mkdtemp(dir=self.folder, prefix=PART, suffix=".part"))
        self._staged.add(new.name)
        return new

    def close_stage(self, new: Path, whole: bool) -> None:
        """Move what is in a hidden folder into the set if it is whole, and remove the folder."""
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
        with writing(self.folder):
            for name in names:
                os.replace(new / name, self.folder / name)

    def grow(self, name: str, table: Table) -> LiveTable:
        """Return a table of the set that is on disk while it grows."""
        self.begin("running")
        self.live = LiveTable(self.folder / name, table)
        self.files.append(name)
        return self.live

    def publish(self, result: Result, complete: bool = True) -> list[Path]:
        """Write the files of a result, the summary last unless others follow; return their paths.

        Raises:
            OutputError: one cannot be written.
        """
        texts = result.files()
        paths = [self.folder / name for name in texts]
        live = self.live
        if live is not None and live.flush() and live.path.name in texts:
            del texts[live.path.name]
        self.put({name: text for name, text in texts.items() if name != SUMMARY})
        self.finish(result.summary, None if complete or result.status != "done" else "writing")
        return paths

    def finish(self, summary: Mapping[str, Any], status: str | None = None) -> Path:
        """Write summary.json, with another status while files are to follow; return its path.

        Raises:
            OutputError: it cannot be written.
        """
        self.begin("writing")
        path = self._summarise({**summary, "status": status or summary["status"]})
        self.ended = status not in AT_WORK
        return path


def is_ours(summary: Mapping[str, Any]) -> bool:
    """Return whether a summary is one of rotfem's; one without a version was left by an early one that was killed."""
    if not summary.keys() - {"files"} ^ {"command", "status", "pid", "host", "warnings"}:
        return True
    versions = summary.get("versions")
    return isinstance(versions, dict) and "rotfem" in versions and "status" in summary


def said_of(folder: Path) -> str:
    """Return in words how the set of a folder ended, and what is left of one that is not complete."""
    summary = read_summary(folder)
    if not is_ours(summary):
        raise OutputError(folder, "there are no results of rotfem")
    status, parts = summary["status"], [f"{folder}: {summary.get('command', 'results')}"]
    at_work = holder(folder) if status in AT_WORK else ""
    if at_work:
        parts[0] += f" {status}, by {at_work}"
    elif status in AT_WORK:
        process = f"process {summary.get('pid')} on {summary.get('host')}"
        parts[0] += f" failed: {process} was {status} and has ended without a word"
    else:
        parts[0] += f" {status}" + (f": {summary['failure']['what']}" if "failure" in summary else "")
    return "; ".join([*parts, *([] if at_work else kept_in(folder))])


def kept_in(folder: Path) -> list[str]:
    """Return in words what a set that is not complete has of a history, and how it goes on."""
    out = []
    with suppress(OSError, ValueError, IndexError, KeyError):
        t = read_csv(folder / "history.csv")["t"]
        out.append(f"history.csv has {len(t)} rows, up to t = {t[-1]:.6g} s")
    if read_summary(folder).get("status") != "done" and _is_checkpoint(folder / CHECKPOINT):
        out.append("--resume goes on from its checkpoint")
    return out


def _is_checkpoint(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return path.name == CHECKPOINT and file.read(len(CHECKPOINT_MAGIC)) == CHECKPOINT_MAGIC.encode()
    except OSError:
        return False


def previous(folder: Path) -> list[str]:
    """Return the names of the files there that belong to the set of the folder's summary, but for that itself."""
    summary = read_summary(folder)
    if not is_ours(summary):
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


def remove(path: Path) -> None:
    """Remove a file or a folder, as far as that goes."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)


# --- on any number of processes ---------------------------------------------------------------------------------------


class ResultFolder(AbstractContextManager["ResultFolder"]):
    """The result set of a command on any number of processes: rank 0 has the files, all ranks have its errors.

    It is locked until it is closed. All methods are called on all ranks together.

    Args:
        comm: communicator of the command.
        path: the folder, made where it is not there.
        command: its verb.
        inputs: files that it has read.

    Attributes:
        set: the files, on rank 0.

    Raises:
        OutputError: the folder is not to be written (see `ResultSet`).
    """

    def __init__(self, comm: MPI.Comm, path: Path, command: str, inputs: Sequence[Path] = ()):
        self.comm, self.path = comm, path
        self.set: ResultSet | None = None
        self.set = self._on_first(lambda: ResultSet(path, command, inputs), shared=False)

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        self.close(error)

    def close(self, error: BaseException | None = None) -> None:
        """Give the folder free, with what ended the command if it did not end well."""
        if self.set is not None:
            self.set.close(error)

    def first_does(self, work: Callable[[ResultSet], T]) -> T:
        """Return on every rank what rank 0 makes of some work with the files, or raise its error."""
        done: T = self._on_first(lambda: work(self.set))  # type: ignore[arg-type]
        return done

    def _on_first(self, work: Callable[[], T], shared: bool = True) -> Any:
        done, problem = None, None
        if self.comm.rank == 0:
            try:
                done = work()
            except (OutputError, SceneError) as error:
                problem = error
        found, problem = self.comm.bcast((done if shared else None, problem))
        if problem is not None:
            raise problem
        return found if shared else done

    def write(self, result: Result, plots: bool, further: Sequence[Writer] = ()) -> list[OutputError | SceneError]:
        """Write a result, small files first and large ones last; return what went wrong with the large ones.

        Args:
            result: the result.
            plots: whether its figures are wanted.
            further: what else is to be written, on rank 0.

        Raises:
            OutputError: the small files cannot be written.
        """
        fields: Writer | None = getattr(result, "fields", None)
        of_first: list[Writer] = [*result.large(), *further, *([result.draw] if plots else [])]
        writers = [(write, False) for write in of_first]
        if fields is not None:
            writers.append((fields, result.summary.get("shared") == "mesh"))
        self.first_does(lambda files: files.publish(result, not writers))
        problems: list[OutputError | SceneError] = []
        for write, together in writers:
            try:
                self._staged(write, together)
            except (OutputError, SceneError) as problem:
                problems.append(problem)
        if writers:
            lost = [f"not written: {problem}" for problem in problems if isinstance(problem, OutputError)]
            result.summary["warnings"] = [*result.summary["warnings"], *lost]
            self.first_does(lambda files: files.finish(result.summary))
        return problems

    def _staged(self, write: Writer, together: bool) -> None:
        """Write files into a hidden folder, on rank 0 or on all ranks together; whole ones become part of the set."""
        new, problem = self.first_does(lambda files: files.open_stage()), None
        if together or self.comm.rank == 0:
            try:
                write(new)
            except (OutputError, SceneError) as error:
                problem = error
        problem = next((p for p in self.comm.allgather(problem) if p is not None), None)
        self.first_does(lambda files: files.close_stage(new, problem is None))
        if isinstance(problem, OutputError):
            raise OutputError(self.path / Path(str(problem.path)).name, problem.reason)
        if problem is not None:
            raise problem
