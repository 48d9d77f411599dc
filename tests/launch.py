"""Starts `rotfem` in a folder on one or several processes, as a user would."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

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
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def rotfem(folder: Path, ranks: int, *arguments: str, timeout: float = 300.0) -> subprocess.CompletedProcess[str]:
    """Run `rotfem …` in a folder on that many processes; one that hangs is ended by `timeout` (s), as a failure."""
    start = [str(MPIRUN), "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    command = [*start, sys.executable, "-m", "rotfem", *arguments]
    return subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, check=False, timeout=timeout
    )
