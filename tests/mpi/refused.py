"""Runs commands one after the other in one mpirun, and prints what each of them ends with on each process.

    mpirun -n N python refused.py commands.json

The file holds a list of (name, arguments, whether the reader of mesh files is broken on purpose). For each of them rank
0 prints a line of JSON: the name, the exit status by process, what the processes wrote to stderr, and whether there is
a folder of results. The last command runs as a user's would: it ends the processes.
"""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext, redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

from mpi4py import MPI

from rotfem.commands.cli import app, main


def ended(arguments: list[str]) -> tuple[Any, str]:
    """Return the exit status of a command, and what it writes to stderr."""
    told = StringIO()
    with redirect_stderr(told):
        try:
            app(arguments)
        except SystemExit as end:
            return end.code, told.getvalue()
    raise AssertionError("a command ends with an exit status")


def answer(name: str, arguments: list[str], broken: bool) -> None:
    """Run a command on all processes and print its line."""
    reader = patch("gmsh.clear", side_effect=ZeroDivisionError("on purpose")) if broken else nullcontext()
    with reader:
        status, told = ended(arguments)
    by_rank = MPI.COMM_WORLD.gather((status, told))
    if by_rank is not None:
        statuses, texts = zip(*by_rank, strict=True)
        print(json.dumps([name, statuses, texts, Path("results").exists()]), flush=True)


if __name__ == "__main__":
    *commands, last = json.loads(Path(sys.argv[1]).read_text())
    for command in commands:
        answer(*command)
    sys.argv[1:] = last[1]
    main()
