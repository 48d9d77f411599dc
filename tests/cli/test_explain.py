"""`rotfem explain`, and `rotfem run` with a tolerance, as a user calls them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Rotfem = Callable[..., Any]

SCENE = """\
[structure]
type = "planar_beam"
length = 1.0
[structure.section]
EA = 400.0
GA = 130.0
EI = 1.0
mass_per_length = 1.0
rotary_inertia = 0.0025
[motion]
type = "constant"
speed = 1.0
[loads]
tip_force = [0.0, 0.02]
[mesh]
elements = 4
[modes]
count = 2
"""


def test_explain_prints_a_row_each(folder: Path, rotfem: Rotfem) -> None:
    done = rotfem("explain", "beam.toml")
    assert (done.status, done.err) == (0, "")
    for name in ("without coriolis", "without centrifugal", "without rotary_inertia", "consistent_linear theory"):
        assert name in done.out
    assert "gravity (no gravity)" in done.out
    assert {f.name for f in (folder / "results" / "beam" / "explain").iterdir()} == {
        "explain.csv",
        "explain.png",
        "summary.json",
    }


def test_rows_are_in_json_and_in_a_file(folder: Path, rotfem: Rotfem) -> None:
    done = rotfem("explain", "beam.toml", "--json", "--no-plots", "-o", "out")
    assert done.status == 0, done.err
    summary = json.loads(done.out)
    assert summary["outputs"] == ["steady", "modes"]
    assert len((folder / "out" / "explain.csv").read_text().splitlines()) == 1 + len(summary["rows"])
    assert not (folder / "out" / "explain.png").exists()
    assert rotfem("explain", "beam.toml", "-q", "--no-plots", "-o", "out") == (0, "", "")


def test_modes_say_that_they_have_all_effects(rotfem: Rotfem) -> None:
    done = rotfem("modes", "beam.toml", "--set", "model.effects=needed", "--no-plots", "--no-error")
    assert "all effects are in" in done.out
    assert "effects: coriolis, centrifugal, rotary_inertia" in done.out
