"""Reduced models on two processes: small arrays on both, the basis shared out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rotfem.results.files import read_csv
from tests.beams import BEAM_TABLE
from tests.launch import MPIRUN, rotfem

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

BEAM = f"""\
{BEAM_TABLE}[model]
theory = "consistent_linear"
reduced = 1e-5
foreshortening = true
[mesh]
elements = 8
[time]
end = 4.0
step = 0.02
"""

MOTIONS = {
    "spin-up": '[motion]\ntype = "spin_up"\nspeed = 2.0\nduration = 3.0\n',
    "free": '[motion]\ntype = "torque"\nhub_inertia = 400.0\ntable = [[0, 0], [1, 300], [3, 0]]\n',
}


@pytest.mark.parametrize("kind", MOTIONS)
def test_reduced_history_is_that_of_one_process(tmp_path: Path, kind: str) -> None:
    (tmp_path / "beam.toml").write_text(BEAM + MOTIONS[kind])
    done = [rotfem(tmp_path, n, "run", "beam.toml", "--no-plots", "--json", "-o", f"r{n}") for n in (1, 2)]
    for result in done:
        assert result.returncode == 0, result.stderr
    assert all("reduced" in json.loads(result.stdout) for result in done)
    serial, parallel = (read_csv(tmp_path / f"r{n}" / "history.csv") for n in (1, 2))
    assert list(serial) == list(parallel)
    for column, values in serial.items():  # sums in another order make a basis that may end one vector earlier
        scale = float(np.max(np.abs(values)))
        counts = {"tip_alpha": 1e-4} | {name: 1e-3 for name in serial if name.startswith("root_")}
        digits = counts.get(column, 1e-5)  # what is asked for of displacements; the last vectors count more in others
        np.testing.assert_allclose(parallel[column], values, rtol=0, atol=digits * scale, err_msg=column)


def test_what_nothing_moves_is_no_trouble(tmp_path: Path) -> None:
    """A basis without columns, and a solver that has nothing to solve, of which no library complains."""
    (tmp_path / "beam.toml").write_text(BEAM + MOTIONS["spin-up"].replace("2.0", "0.0"))
    done = rotfem(tmp_path, 2, "run", "beam.toml", "--no-plots", "-q")
    assert (done.returncode, done.stderr) == (0, "")
