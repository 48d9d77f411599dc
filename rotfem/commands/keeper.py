"""What of a run is on disk while it goes on: the rows of its history."""

from __future__ import annotations

from mpi4py import MPI

from rotfem.commands.interrupts import Interrupted, Interrupts
from rotfem.commands.result_folder import ResultFolder
from rotfem.results.live import LiveTable
from rotfem.results.result_set import ResultSet
from rotfem.results.run import Table


class Keeper:
    """Keeps a run's rows on disk, and ends it between steps when it is asked to.

    Args:
        comm: communicator of the run.
        folder: where its results go; None keeps nothing.
    """

    def __init__(self, comm: MPI.Comm, folder: ResultFolder | None = None):
        self.comm, self.folder = comm, folder
        self._live: LiveTable | None = None

    def interrupts(self) -> Interrupts:
        """Return the context in which a march is interrupted between steps, where ranks must agree on that."""
        self._interrupts = Interrupts(self.comm, self._secure, self.comm.size > 1)
        return self._interrupts

    def start(self, history: Table) -> None:
        """Begin the set of the run with the rows there are.

        Raises:
            OutputError: the folder cannot be written.
        """
        if self.folder is None:
            return

        def begin(files: ResultSet) -> None:
            self._live = files.grow("history.csv", history)

        self.folder.first_does(begin)

    def stepped(self) -> None:
        """Take note of the end of a step.

        Raises:
            Interrupted: a signal has asked one of the ranks to end.
        """
        if self._live is not None:
            self._live.update()
        if self._interrupts.active and self.comm.allreduce(self._interrupts.asked, op=MPI.LOR):
            raise Interrupted

    def _secure(self) -> None:
        """Put on disk at once what can be."""
        if self._live is None or self.folder is None or self.folder.set is None:
            return
        self._live.flush()
        self.folder.set.mark("interrupted")
