"""Runs `rotfem` in a folder, in this process or on several of their own."""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from rotfem.commands.cli import app
from tests.ranks import Ranks

ROOT = Path(__file__).resolve().parents[1]
MPIRUN = shutil.which("mpirun")
SCRATCH = tempfile.TemporaryDirectory(prefix="rotfem-tests.", ignore_cleanup_errors=True)


def of_rotfem() -> dict[str, str]:
    """Return what rotfem reads of the environment: a mesh is shared, however small it is, unless a test says else."""
    return {"ROTFEM_SHARED_FROM": "0"} | {name: os.environ[name] for name in os.environ if name.startswith("ROTFEM_")}


def environment() -> dict[str, str]:
    """Return the environment of a started process.

    Each has a TMPDIR of its own: mpirun names its session directory after its process number, and one that was killed
    leaves it behind, where a later mpirun of the same number fails with PMIX_ERR_EXISTS.
    """
    return os.environ | {
        "TMPDIR": tempfile.mkdtemp(dir=SCRATCH.name),
        "PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_mpi_yield_when_idle": "1",  # where there are fewer cores than processes
        **of_rotfem(),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


@cache
def ranks_of(number: int) -> Ranks:
    """Return so many processes, which stay up until the tests end."""
    start = [str(MPIRUN), "-n", str(number), "--oversubscribe", sys.executable]
    processes = Ranks(start, number, environment())
    atexit.register(processes.close)
    return processes


def rotfem(folder: Path, ranks: int, *arguments: str, timeout: float = 300.0) -> subprocess.CompletedProcess[str]:
    """Run `rotfem …` in a folder: on one process in this one, on several in others, which `timeout` (s) ends."""
    if ranks == 1:
        out, err, status = io.StringIO(), io.StringIO(), 0
        with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                app(list(arguments))
            except SystemExit as end:
                status = int(end.code or 0)
        return subprocess.CompletedProcess(arguments, status, out.getvalue(), err.getvalue())
    done = ranks_of(ranks)(folder, list(arguments), of_rotfem(), timeout=timeout)
    status = next((ended.status for ended in done if ended.status), 0)
    out, err = ("".join(getattr(ended, name) for ended in done) for name in ("out", "err"))
    return subprocess.CompletedProcess(arguments, status, out, err)
