"""Of a small system every process computes a copy, with the results of one; frequencies of loads are shared out."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.results.files import read_csv
from tests.beams import PLATE_TABLES, SECTION
from tests.histories import difference
from tests.launch import MPIRUN, rotfem

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

BEAM = f"""\
[structure]
type = "planar_beam"
length = 10.0
{SECTION}[structure.damping]
modal = 0.01
[motion]
type = "constant"
speed = 3.0
[mesh]
elements = 3
degree = 2
[modes]
count = 3
"""
TIME = "[time]\nend = 0.2\nstep = 0.01\n[initial]\ntip_displacement = 0.1\n"
LOAD = "[loads]\ntip_force.harmonic = { amplitude = [0.0, 1.0], frequency = 1.0 }\n"


@pytest.fixture(autouse=True)
def copies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Share meshes as users do, from many unknowns on."""
    monkeypatch.setenv("ROTFEM_SHARED_FROM", "1000")


def summaries(folder: Path, text: str, *arguments: str) -> list[dict[str, Any]]:
    """Return what one and two processes say of a scene; their results are in r1 and r2."""
    (folder / "scene.toml").write_text(text)
    out = []
    for ranks in (1, 2):
        verb, *options = arguments
        done = rotfem(folder, ranks, verb, "scene.toml", "--json", "--no-plots", "-o", f"r{ranks}", *options)
        assert done.returncode == 0, done.stderr
        out.append(json.loads(done.stdout))
    assert "shared" not in out[0]
    assert out[1]["ranks"] == 2
    return out


def test_a_history_is_that_of_one_process(tmp_path: Path) -> None:
    """To the last bit; and to 1e-9 that of two processes that go on from a checkpoint, or of one that goes on."""
    (tmp_path / "scene.toml").write_text(BEAM + TIME)
    base = ("run", "scene.toml", "--no-plots")
    starts = [(1, "whole", ()), (2, "two", ()), (2, "cut", ("--checkpoint", "7", "--set", "time.end=0.1"))]
    for ranks, folder, options in [*starts, (2, "cut", ("--resume",))]:
        done = rotfem(tmp_path, ranks, *base, "-o", folder, *options)
        assert done.returncode == 0, done.stderr
    assert "2 processes each computed all of it" in done.stdout
    assert json.loads((tmp_path / "two" / "summary.json").read_text())["shared"] == "nothing"
    for name in ("history.csv", "shape.csv"):
        assert (tmp_path / "two" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
        assert difference(*(read_csv(tmp_path / folder / name) for folder in ("cut", "whole"))) < 1e-9


def test_files_of_a_plate_are_written_once(tmp_path: Path) -> None:
    summaries(tmp_path, PLATE_TABLES + '[mesh]\nelements = [3, 2]\n[output]\nfields = ["xdmf"]\n', "modes")
    one, two = (sorted(p.name for p in (tmp_path / f"r{ranks}").iterdir()) for ranks in (1, 2))
    assert one == two
    assert {"modes.xdmf", "modes.h5"} <= set(two)


def test_a_diagram_is_that_of_one_process(tmp_path: Path) -> None:
    one, two = summaries(tmp_path, BEAM, "campbell", "--speeds", "0:6:5")
    assert two["shared"] == "nothing"
    rows = [json.loads((tmp_path / f"r{ranks}" / "campbell.json").read_text())["rows"] for ranks in (1, 2)]
    assert [(r["speed"], r["label"]) for r in rows[0]] == [(r["speed"], r["label"]) for r in rows[1]]
    for name in ("frequency", "damping"):
        np.testing.assert_allclose(*([r[name] for r in each] for each in rows), rtol=1e-8, atol=1e-10)
    at = [[c["speed"] for c in summary["critical_speeds"]] for summary in (one, two)]
    assert len(at[0]) > 0
    np.testing.assert_allclose(*at, rtol=1e-8)


def test_frequencies_are_shared_out(tmp_path: Path) -> None:
    _, two = summaries(tmp_path, BEAM + LOAD, "response", "--number", "9")
    assert two["shared"] == "frequencies"
    one, other = ((tmp_path / f"r{ranks}" / "response.csv").read_text() for ranks in (1, 2))
    assert one == other
