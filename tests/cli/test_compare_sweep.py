"""`rotfem compare` and `rotfem sweep` as a user calls them: exit status, what is printed, what is written."""

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
hub_radius = 0.5
section = { EA = 400.0, GA = 130.0, EI = 1.0, mass_per_length = 1.0, rotary_inertia = 0.0025 }
[motion]
type = "constant"
speed = 3.0
[model]
theory = "consistent_linear"
[mesh]
elements = 4
[modes]
count = 3
"""
OPTIONS = ("-q", "--no-plots", "--no-error")


def test_compare_ends_with_status_1_beyond_the_tolerance(folder: Path, rotfem: Rotfem) -> None:
    for name, elements in (("fine", 8), ("coarse", 2)):
        assert rotfem("modes", "beam.toml", *OPTIONS, "--set", f"mesh.elements={elements}", "-o", name).status == 0
    done = rotfem("compare", "fine", "coarse", "-o", "out", "--json", "--tolerance", "1e-9")
    summary = json.loads(done.out)
    assert done.status == 1
    assert summary["worst"] > 1e-9
    assert {path.name for path in (folder / "out").iterdir()} == {"compare.csv", "compare.png", "summary.json"}
    shown = rotfem("compare", "fine", "coarse", "-o", "out", "--tolerance", "1")
    assert shown.status == 0, shown.err
    assert "lag 1" in shown.out
    assert max(map(len, shown.out.splitlines())) <= 80


def test_compare_refuses(folder: Path, rotfem: Rotfem) -> None:
    assert rotfem("modes", "beam.toml", *OPTIONS, "-o", "a").status == 0
    (folder / "empty").mkdir()
    for arguments, said in (
        (("a",), "two results at least"),
        (("a", "empty"), "no result"),
        (("a", "a", "-o", "a"), "the scene reads it"),
    ):
        done = rotfem("compare", *arguments)
        assert done.status == 2, arguments
        assert said in done.err
