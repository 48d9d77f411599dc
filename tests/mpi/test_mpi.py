"""Two processes compute what one does, and only the first speaks."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rotfem.results.files import read_csv
from tests.beams import SECTION
from tests.launch import MPIRUN, rotfem

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

SCENE = f"""\
[structure]
type = "planar_beam"
length = 10.0
tip_mass = 1.0
{SECTION}[structure.damping]
kelvin_voigt = 1e-3
[motion]
type = "spin_up"
speed = 6.0
duration = 2.0
[loads]
distributed = {{ over_span = [[0.0, 0.0, 0.5], [6.0, 0.0, 0.0]] }}
[[loads.at]]
x = 3.0
force = [0.0, 1.0]
[mesh]
elements = 8
degree = 3
[time]
end = 0.3
step = 0.01
"""


def run(folder: Path, ranks: int, *arguments: str, verb: str = "run") -> subprocess.CompletedProcess[str]:
    """Run `rotfem run beam.toml -o r<ranks> …`, or another verb, in a folder on that many processes."""
    return rotfem(folder, ranks, verb, "beam.toml", "--no-plots", "-o", f"r{ranks}", *arguments)


def test_history_is_that_of_one_process(tmp_path: Path) -> None:
    """To 1e-8; other theories, frames and schemes to 1e-5 in `tests.pairs`."""
    (tmp_path / "beam.toml").write_text(SCENE)
    changes = ("--json", "--set", "structure.damping.modal=[0.01, 0.02]")
    one, two = (run(tmp_path, ranks, *changes) for ranks in (1, 2))
    assert one.returncode == 0, one.stderr
    assert two.returncode == 0, two.stderr
    summary = json.loads(two.stdout)  # once: both ranks speaking would not be JSON
    assert summary["ranks"] == 2
    assert summary["dofs"] == json.loads(one.stdout)["dofs"]
    for name in ("history.csv", "shape.csv"):
        serial, parallel = (read_csv(tmp_path / f"r{ranks}" / name) for ranks in (1, 2))
        assert list(serial) == list(parallel)
        for column, values in serial.items():  # sums in another order, and what that does to Newton's last increments
            scale = float(np.max(np.abs(values)))
            assert scale > 0.0, f"{column} says nothing"
            # Forces at the root are stiffnesses times what Newton leaves of displacements.
            close = 1e-6 if column.startswith("root_") else 1e-8
            np.testing.assert_allclose(parallel[column], values, rtol=0, atol=close * scale, err_msg=column)


def test_adaptive_steps_are_those_of_one_process(tmp_path: Path) -> None:
    """Errors are measured over all processes, so that all take the same steps."""
    scene = SCENE.replace("step = 0.01", "tolerance = 0.1")
    scene += '[initial]\nstate = "undeformed"\n'  # in balance the first steps would be chosen by what Newton leaves
    (tmp_path / "beam.toml").write_text(scene.replace("kelvin_voigt = 1e-3", "modal = { lag = [0.02], axial = 0.1 }"))
    for ranks in (1, 2):
        done = run(tmp_path, ranks)
        assert done.returncode == 0, done.stderr
    serial, parallel = (read_csv(tmp_path / f"r{ranks}" / "history.csv") for ranks in (1, 2))
    for column in ("t", "tip_u1", "tip_u2", "tip_alpha"):  # round-off of the error moves steps a little
        scale = float(np.max(np.abs(serial[column])))
        np.testing.assert_allclose(parallel[column], serial[column], rtol=0, atol=1e-6 * scale, err_msg=column)


def test_errors_are_told_once(tmp_path: Path) -> None:
    (tmp_path / "beam.toml").write_text(SCENE)
    bad = run(tmp_path, 2, "--set", "structure.length=-1")
    assert bad.stderr.count("structure.length = -1") == 1
    assert bad.returncode == 2
    failed = run(tmp_path, 2, "--set", "model.theory=linear", "--set", "time.end=20.0", "--set", "time.step=0.05")
    assert failed.returncode == 3
    assert failed.stderr.count("diverged") == 1
    assert json.loads((tmp_path / "r2" / "summary.json").read_text())["status"] == "failed"
