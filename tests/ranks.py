"""Processes of one mpirun that stay up: each command is run by all of them, as `mpirun -n N rotfem …` would.

A start takes a second of each process, which many tests share here. As a program, `ranks.py SOCKET` is one of them.
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Mapping
from multiprocessing.connection import Client, Connection, wait
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

#: Seconds in which processes start.
START = 120.0


class Ended(NamedTuple):
    """What a command ends with on one process: its exit status, and what it wrote to stdout and stderr."""

    status: int
    out: str
    err: str


class Lost(Exception):
    """Processes ended in the middle of a command, or waited for each other; with what they wrote."""


class Ranks:
    """Processes that share an MPI communicator. Those that are lost are started anew with the next command.

    Args:
        start: the command that starts them, `mpirun -n N …` and the interpreter.
        number: of processes.
        environment: theirs.
    """

    def __init__(self, start: list[str], number: int, environment: Mapping[str, str]):
        self._start, self._number, self._environment = start, number, dict(environment)
        self._connections: list[Connection] = []
        self._program: subprocess.Popen[bytes] | None = None

    def __call__(
        self, folder: Path, arguments: list[str], changes: Mapping[str, str], broken: str = "", timeout: float = 300.0
    ) -> list[Ended]:
        """Return what `rotfem …` ends with on each process.

        Args:
            folder: where it runs.
            arguments: of the command line.
            changes: of the environment.
            broken: name of a function that fails on purpose, as "gmsh.clear".
            timeout: seconds that it may take.

        Raises:
            Lost: processes ended, or the time was over.
        """
        with tempfile.TemporaryDirectory() as texts:
            try:
                if self._program is None:
                    self._begin()
                for connection in self._connections:
                    connection.send((str(folder), texts, arguments, dict(changes), broken))
                statuses = self._statuses(time.monotonic() + timeout)
            except (EOFError, OSError, TimeoutError) as error:
                if self._program is not None:
                    self._program.terminate()
                self.close()
                told = "".join(f"{file.name}: {file.read_text()}\n" for file in sorted(Path(texts).iterdir()))
                raise Lost(f"rotfem {' '.join(arguments)} on {self._number} processes: {error!r}\n{told}") from error
            return [
                Ended(status, *((Path(texts) / f"{rank}.{end}").read_text() for end in ("out", "err")))
                for rank, status in enumerate(statuses)
            ]

    def _begin(self) -> None:
        with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as listener:
            listener.bind(f"{folder}/socket")
            listener.listen(self._number)
            listener.settimeout(START)
            command = [*self._start, __file__, f"{folder}/socket"]
            self._program = subprocess.Popen(command, env=self._environment, stdin=subprocess.DEVNULL)
            by_rank = {}
            for _ in range(self._number):
                connection = Connection(listener.accept()[0].detach())
                by_rank[connection.recv()] = connection
        self._connections = [by_rank[rank] for rank in range(self._number)]

    def _statuses(self, end: float) -> list[int]:
        statuses: dict[int, int] = {}
        while len(statuses) < self._number:
            left = [c for rank, c in enumerate(self._connections) if rank not in statuses]
            ready = wait(left, end - time.monotonic())
            if not ready:
                raise TimeoutError("they wait for ever")
            for rank, connection in enumerate(self._connections):
                if connection in ready:
                    statuses[rank] = connection.recv()
        return [statuses[rank] for rank in range(self._number)]

    def close(self) -> None:
        """End the processes, which wait for a command."""
        for connection in self._connections:
            connection.close()
        if self._program is not None:
            self._program.wait()
        self._connections, self._program = [], None


@contextlib.contextmanager
def written_to(*paths: Path) -> Iterator[None]:
    """Write to two files what this process writes to stdout and stderr, its libraries too."""
    kept = [os.dup(number) for number in (1, 2)]
    for number, path in zip((1, 2), paths, strict=True):
        with open(path, "wb") as file:
            os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, own in zip((1, 2), kept, strict=True):
            os.dup2(own, number)
            os.close(own)


def main(address: str) -> None:
    """Run what is sent to this address until it is closed."""
    from mpi4py import MPI

    from rotfem.commands.cli import app

    rank = MPI.COMM_WORLD.rank
    with Client(address, "AF_UNIX") as connection:
        connection.send(rank)
        while True:
            try:
                folder, texts, arguments, changes, broken = connection.recv()
            except EOFError:
                return
            fails = patch(broken, side_effect=ZeroDivisionError("on purpose")) if broken else contextlib.nullcontext()
            files = [Path(texts) / f"{rank}.{end}" for end in ("out", "err")]
            with contextlib.chdir(folder), patch.dict(os.environ, changes), fails, written_to(*files):
                try:
                    app(arguments)
                    raise AssertionError("a command ends with an exit status")
                except SystemExit as end:
                    status = int(end.code or 0)
                except BaseException:
                    traceback.print_exc()
                    os._exit(1)  # mpirun ends the others
            connection.send(status)


if __name__ == "__main__":
    main(sys.argv[1])
