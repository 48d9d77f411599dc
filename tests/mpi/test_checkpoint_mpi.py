"""As many processes go on as share a mesh in a checkpoint, and signals end all of them at the same step."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rotfem.results.files import read_csv
from tests.beams import BEAM_TABLE, PLATE_TABLES
from tests.histories import difference
from tests.launch import MPIRUN, environment, rotfem

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

BEAM = f"""\
{BEAM_TABLE}[motion]
type = "torque"
hub_inertia = 50.0
pulses = [[0.0, 0.1, 30.0]]
[mesh]
elements = 6
[time]
end = 0.2
step = 0.01
"""
PLATE = f"""\
{PLATE_TABLES}[loads]
distributed = [0.0, 0.0, 100.0]
[mesh]
elements = [4, 3]
cell = "triangle"
[time]
end = 0.02
step = 1e-3
[initial]
state = "undeformed"
[output]
error = false
"""


COMMAND = ("run", "scene.toml", "--no-plots", "--no-advice")


def end_of(text: str) -> float:
    return float(text.split("end = ")[1].split("\n")[0])


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Path]:
    """Scene, number of processes ↦ a folder with the whole run by so many, and six tenths of one."""

    @cache
    def folder(text: str, first: int) -> Path:
        out = tmp_path_factory.mktemp("begun")
        (out / "scene.toml").write_text(text)
        assert rotfem(out, first, *COMMAND, "-o", "whole").returncode == 0
        half = rotfem(out, first, *COMMAND, "-o", "cut", "--checkpoint", "3", "--set", f"time.end={0.6 * end_of(text)}")
        assert half.returncode == 0, half.stderr
        return out

    return folder


@pytest.mark.parametrize("text", [BEAM, PLATE], ids=["beam", "plate"])
def test_processes_that_share_a_mesh_go_on(tmp_path: Path, begun: Callable[[str, int], Path], text: str) -> None:
    """To 1e-9, but the stiffness of the axis makes more of Newton's last increments in the forces at the root."""
    end, ranks = end_of(text), 2
    shutil.copytree(begun(text, ranks), tmp_path, dirs_exist_ok=True)
    done = rotfem(tmp_path, ranks, *COMMAND, "-o", "cut", "--resume")
    assert done.returncode == 0, done.stderr
    (note,) = json.loads((tmp_path / "cut" / "summary.json").read_text())["resumed"]
    assert note["ranks"] == ranks
    assert 0.5 * end < note["time"] < 0.6 * end
    for name in ("history.csv", "shape.csv"):
        found = []
        for part in ("cut", "whole"):
            columns = read_csv(tmp_path / part / name)
            order = np.lexsort([np.round(columns[c], 9) for c in ("x", "y", "t") if c in columns])  # of the processes
            found.append({c: x[order] for c, x in columns.items()})
        assert difference(*found) < 1e-8


def test_another_number_of_processes_is_refused(tmp_path: Path, begun: Callable[[str, int], Path]) -> None:
    shutil.copytree(begun(BEAM, 2), tmp_path, dirs_exist_ok=True)
    done = rotfem(tmp_path, 1, *COMMAND, "-o", "cut", "--resume")
    assert done.returncode == 2
    assert "is of a mesh that 2 processes share, and here are 1: go on with as many" in done.stderr


RANK = "$OMPI_COMM_WORLD_RANK"


def started(folder: Path) -> subprocess.Popen[str]:
    """Return a long run on two processes that has got to its first rows; shells keep the exit status of each."""
    (folder / "beam.toml").write_text(BEAM.replace("end = 0.2", "end = 200.0"))
    run = f"{sys.executable} -m rotfem run beam.toml --no-plots --no-advice -o out"
    command = ["sh", "-c", f"echo $$ > shell.{RANK}; {run}; echo $? > status.{RANK}"]
    start = [str(MPIRUN), "-n", "2", "--oversubscribe", *command]
    program = subprocess.Popen(start, cwd=folder, env=environment(), stderr=subprocess.PIPE, text=True)
    for _ in range(1000):
        rows = folder / "out" / "history.csv"
        if rows.exists() and rows.read_text().count("\n") > 2:
            return program
        time.sleep(0.1)
    program.kill()
    pytest.fail("the run did not start")


@pytest.mark.parametrize(("number", "whom"), [(signal.SIGINT, (0, 1)), (signal.SIGTERM, (1,))])
def test_a_signal_to_one_process_or_all_ends_all_with_what_there_is(
    tmp_path: Path, number: signal.Signals, whom: tuple[int, ...]
) -> None:
    program = started(tmp_path)
    shells = [int((tmp_path / f"shell.{rank}").read_text()) for rank in (0, 1)]
    children = [int(subprocess.check_output(["ps", "-o", "pid=", "--ppid", str(pid)])) for pid in shells]
    time.sleep(0.5)
    for rank in whom:
        os.kill(children[rank], number)
    _, err = program.communicate(timeout=60)
    assert [(tmp_path / f"status.{rank}").read_text() for rank in (0, 1)] == ["130\n", "130\n"]
    assert err.count("rotfem: interrupted") == 1
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "interrupted"
    assert len(read_csv(tmp_path / "out" / "history.csv")["t"]) == summary["steps"] + 1
