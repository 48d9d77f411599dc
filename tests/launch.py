"""Runs `rotfem` in a folder, in this process or on several of their own."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from rotfem.commands.cli import app

ROOT = Path(__file__).resolve().parents[1]
MPIRUN = shutil.which("mpirun")
SCRATCH = tempfile.TemporaryDirectory(prefix="rotfem-tests.", ignore_cleanup_errors=True)


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
        "ROTFEM_SHARED_FROM": os.environ.get("ROTFEM_SHARED_FROM", "0"),  # the mesh is shared, however small it is
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def rotfem(folder: Path, ranks: int, *arguments: str, timeout: float = 300.0) -> subprocess.CompletedProcess[str]:
    """Run `rotfem …` in a folder: on one process in this one, on several in others, which `timeout` (s) ends."""
    command = [str(MPIRUN), "-n", str(ranks), "--oversubscribe", sys.executable, "-m", "rotfem", *arguments]
    if ranks == 1:
        out, err, status = io.StringIO(), io.StringIO(), 0
        with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                app(list(arguments))
            except SystemExit as end:
                status = int(end.code or 0)
        return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())
    return subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, check=False, timeout=timeout
    )
