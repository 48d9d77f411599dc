"""`rotfem cost` as a user calls it, and the advice that the other commands give."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rotfem.scene import load_scene
from tests.beams import SECTION

Rotfem = Callable[..., Any]

ROOT = Path(__file__).resolve().parents[2]

SCENE = f"""\
[structure]
type = "planar_beam"
length = 10.0
{SECTION}[motion]
type = "spin_up"
speed = 6.0
duration = 15.0
[mesh]
elements = 4
degree = 2
[time]
end = 1.0
step = 0.01
"""
SMALL = ("--theories", "reissner", "--schemes", "esdirk4")


def test_cost_writes_table_figure_and_tuned_scene(rotfem: Rotfem, folder: Path) -> None:
    done = rotfem("cost", "beam.toml", *SMALL, "--accuracy", "0.01", "--write", "tuned.toml")
    assert done.status == 0, done.err
    assert "tuned scene in tuned.toml" in done.out
    assert "for a relative accuracy of 0.01: reissner, " in done.out
    results = folder / "results" / "beam" / "cost"
    assert {"cost.csv", "cost.png", "summary.json"} <= set(os.listdir(results))
    summary = json.loads((results / "summary.json").read_text())
    row, tuned = summary["recommended"], load_scene("tuned.toml")
    assert (tuned.mesh.elements, tuned.mesh.degree) == (row["elements"], row["degree"])
    assert len((results / "cost.csv").read_text().splitlines()) == 1 + summary["settings"]
    assert rotfem("run", "tuned.toml", "--no-plots").status == 0


def test_an_accuracy_out_of_reach(rotfem: Rotfem, folder: Path) -> None:
    """Of the theory that is tried, whatever its mesh and its steps: it knows no foreshortening."""
    linear = ("--theories", "consistent_linear", *SMALL[2:])
    done = rotfem("cost", "beam.toml", *linear, "--accuracy", "1e-5", "--no-plots", "--write", "tuned.toml")
    assert done.status == 3
    assert "no setting is known to be within 1e-05" in done.err
    assert (folder / "results" / "beam" / "cost" / "cost.csv").exists()
    assert not (folder / "tuned.toml").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--theories", "reisner"), 'did you mean "reissner"'),
        (("--schemes", "euler"), "cost --schemes"),
        (("--of", "tipp"), "allowed: tip, frequencies"),
        (("--accuracy", "0"), "must be a number greater than 0"),
        (("--budget", "soon"), 'cost --budget = "soon": must be a time greater than 0, such as 60s'),
        (("--of", "campbell", "--set", "motion.speed=0.0"), "the scene has no speed to go up to"),
        (("--theories", "linear", "--set", "model.frame=inertial"), 'cost --theories = "linear"'),
        (("--write", "no/where.toml"), '--write = "no/where.toml": there is no folder no'),
        (("--write", "results"), '--write = "results": is a folder'),
    ],
)
def test_bad_options(rotfem: Rotfem, folder: Path, arguments: tuple[str, ...], says: str) -> None:
    done = rotfem("cost", "beam.toml", *arguments)
    assert done.status == 2
    assert says in done.err
    assert "Traceback" not in done.err


def test_hint_at_the_start_of_a_run(rotfem: Rotfem, folder: Path) -> None:
    still = ("run", "beam.toml", "--set", "motion.type=constant", "--set", "time.end=0.1", "--no-plots", "--no-error")
    text = (folder / "beam.toml").read_text()
    (folder / "beam.toml").write_text("\n".join(x for x in text.split("\n") if not x.startswith("duration")))
    done = rotfem(*still)
    assert done.status == 0
    (hint,) = done.err.splitlines()
    assert hint.startswith("hint: speed and loads are constant")
    summary = folder / "results" / "beam" / "run" / "summary.json"
    assert json.loads(summary.read_text())["advice"] == [hint.removeprefix("hint: ")]
    assert "hint" not in rotfem(*still, "-q").err
    assert "hint" not in rotfem(*still, "--no-advice").err
    assert json.loads(summary.read_text())["advice"] == []


def test_hints_of_campbell(rotfem: Rotfem) -> None:
    fast = ("campbell", "beam.toml", "--speeds", "0,5", "--set", "model.theory=linear", "--set", "modes.count=1")
    assert (
        'hint: model.theory = "linear" has no centrifugal stiffening, and loses its stiffness at 3.8 rad/s'
        in rotfem(*fast, "--no-plots").err
    )
    assert "hint" not in rotfem(*fast, "--no-plots", "--no-advice").err
