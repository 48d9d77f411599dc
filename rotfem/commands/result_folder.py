"""The result folder of a command on any number of processes: rank 0 has the files, all ranks have its errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from rotfem.errors import OutputError, SceneError
from rotfem.results.result import Result
from rotfem.results.result_set import ResultSet

if TYPE_CHECKING:
    from mpi4py import MPI

T = TypeVar("T")

#: Writes files into a folder.
Writer = Callable[[Path], Any]


class ResultFolder:
    """Result folder, locked until it is closed. All methods are called on all ranks together.

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

    def __enter__(self) -> Self:
        return self

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
        told, problem = self.comm.bcast((done if shared else None, problem))
        if problem is not None:
            raise problem
        return told if shared else done

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
