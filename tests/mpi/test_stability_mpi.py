"""The stability of an equilibrium does not depend on how many processes share the structure."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.beams import SECTION
from tests.launch import MPIRUN, rotfem

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]


def test_buckled_column_on_two_processes(tmp_path: Path) -> None:
    scene = f'[structure]\ntype = "planar_beam"\nlength = 10.0\n{SECTION}[motion]\ntype = "constant"\nspeed = 0.0\n'
    (tmp_path / "column.toml").write_text(f"{scene}[loads]\ntip_force = [-520.0, 0.0]\n", encoding="utf-8")
    found = []
    for ranks in (1, 2):
        done = rotfem(tmp_path, ranks, "run", "column.toml", "--no-plots", "-o", f"r{ranks}")
        assert done.returncode == 0, done.stderr
        assert done.stderr.count("unstable equilibrium") == 1
        found.append(json.loads((tmp_path / f"r{ranks}" / "summary.json").read_text(encoding="utf-8"))["stability"])
    assert found[0]["negative_eigenvalues"] == found[1]["negative_eigenvalues"] == 1
    # The eigensolver's tolerance is 1e-11; round-off of another order of sums adds to it.
    assert found[0]["growth_rate"] == pytest.approx(found[1]["growth_rate"], rel=1e-7)
