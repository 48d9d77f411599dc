"""`rotfem cost` as a user calls it, and the advice that the other commands give."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
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
SMALL = ("--theories", "reissner", "--steps", "0.04,0.02", "--elements", "2,4", "--degrees", "2", "--repeat", "1")
SMALL += ("--schemes", "generalised_alpha")


def test_cost_writes_table_figure_and_tuned_scene(rotfem: Rotfem, folder: Path) -> None:
    done = rotfem("cost", "beam.toml", *SMALL, "--accuracy", "0.02", "--write", "tuned.toml")
    assert done.status == 0
    assert all(line.startswith("beam: cost: ") for line in done.err.splitlines())  # progress, where it takes long
    assert "tuned scene in tuned.toml" in done.out
    assert "for a relative accuracy of 0.02: reissner, " in done.out
    results = folder / "results" / "beam" / "cost"
    assert {"cost.csv", "cost.json", "cost.jsonl", "cost.png", "summary.json"} <= set(os.listdir(results))
    summary = json.loads((results / "summary.json").read_text())
    row = summary["recommended"]
    tuned = load_scene("tuned.toml")
    assert (tuned.mesh.elements, tuned.mesh.degree) == (row["elements"], row["degree"])
    assert len((results / "cost.csv").read_text().splitlines()) == 1 + summary["settings"]
    assert rotfem("run", "tuned.toml", "--no-plots").status == 0
    second = json.loads(rotfem("cost", "beam.toml", *SMALL, "--accuracy", "0.02", "--json", "--no-plots").out)
    assert (second["measured"], second["resumed"]) == (0, summary["measured"])
    assert second["references"] == summary["references"]
    fresh = json.loads(rotfem("cost", "beam.toml", *SMALL, "--json", "--no-plots", "--fresh").out)
    assert fresh["measured"] > 0 == fresh["resumed"]


def test_what_the_budget_leaves_out_is_said(rotfem: Rotfem, folder: Path) -> None:
    """Errors of 1e-9 take more steps than five seconds allow; what was reached is written."""
    done = rotfem("cost", "beam.toml", "--quick", "--budget", "5s", "--accuracy", "1e-9", "--no-plots")
    assert done.status == 3
    summary = json.loads((folder / "results" / "beam" / "cost" / "summary.json").read_text())
    assert summary["budget"]["seconds"] == 5.0
    assert summary["budget"]["used"] < 7.0
    assert summary["budget"]["refused"]
    assert summary["recommended"] is None
    assert "no setting is known to be within 1e-09 (relative)" in done.out
    assert "no setting tried is within 1e-09" in done.err
    assert "left" in summary["missing"]


def test_an_accuracy_out_of_reach(rotfem: Rotfem, folder: Path) -> None:
    """Of the theory that is tried, whatever its mesh and its steps: it knows no foreshortening."""
    linear = ("--theories", "consistent_linear", *SMALL[2:])
    done = rotfem("cost", "beam.toml", *linear, "--accuracy", "1e-4", "--write", "tuned.toml")
    assert done.status == 3
    assert "no setting tried is within 0.0001" in done.err
    assert "no setting is known to be within 0.0001 (relative): the best error is" in done.out
    assert (folder / "results" / "beam" / "cost" / "cost.csv").exists()
    assert not (folder / "tuned.toml").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--elements", "two"), '--elements = "two": must be integers separated by commas'),
        (("--theories", "reisner"), 'did you mean "reissner"'),
        (("--of", "tipp"), "allowed: tip, frequencies"),
        (("--accuracy", "0"), "must be a number greater than 0"),
        (("--budget", "soon"), 'cost --budget = "soon": must be a time greater than 0, such as 60s'),
        (("--of", "campbell", "--set", "motion.speed=0.0"), "the scene has no speed to go up to"),
        (("--degrees", "9"), "cost --degrees = 9: must be"),
        # adaptive steps, of which the mean is measured first
        (
            ("--elements", "-1", "--set", "time={end=0.4, tolerance=1e-3}"),
            "cost --elements = -1: must be at least 1",
        ),
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
    assert not (folder / "results" / "beam" / "cost" / "cost.jsonl").exists()  # nothing was computed


def test_degrees_that_lock_on_a_mesh_file_are_refused(rotfem: Rotfem, folder: Path) -> None:
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addRectangle(0.0, 0.0, 0.0, 1.0, 0.5)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(1, [4], name="clamped")
        gmsh.model.addPhysicalGroup(2, [1], name="plate")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(folder / "plate.msh"))
    finally:
        gmsh.finalize()
    (folder / "plate.toml").write_text(
        '[structure]\ntype = "plate"\nmesh = "plate.msh"\nthickness = 0.01\nE = 7e10\nnu = 0.3\nrho = 2700.0\n'
        '[motion]\ntype = "constant"\nspeed = 5.0\n[modes]\ncount = 2\n'
    )
    done = rotfem("cost", "plate.toml", "--degrees", "1")
    assert done.status == 2
    assert "cost --degrees = 1: triangles of degree 1" in done.err
    assert rotfem("cost", "plate.toml", "--elements", "4").status == 2


def test_interrupt_keeps_what_is_finished(folder: Path) -> None:
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, "-m", "rotfem", "cost", "beam.toml", "--set", "time.end=20.0", "--no-plots"]
    process = subprocess.Popen(
        command,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    record = folder / "results" / "beam" / "cost" / "cost.jsonl"
    limit = time.monotonic() + 60
    while time.monotonic() < limit and not (record.exists() and record.stat().st_size > 0):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    said = "what was measured is in results/beam/cost, and the same command goes on from there"
    assert err == f"rotfem: interrupted; {said}\n"
    assert all(json.loads(line)["measurement"]["status"] for line in record.read_text().splitlines())


def test_hint_at_the_start_of_a_run(rotfem: Rotfem, folder: Path) -> None:
    still = ("run", "beam.toml", "--set", "motion.type=constant", "--set", "time.end=0.1", "--no-plots", "--no-error")
    text = (folder / "beam.toml").read_text()
    (folder / "beam.toml").write_text("\n".join(x for x in text.split("\n") if not x.startswith("duration")))
    done = rotfem(*still)
    assert done.status == 0
    (hint,) = done.err.splitlines()
    assert hint.startswith("hint: speed and loads are constant")
    summary = folder / "results" / "beam" / "cost" / "summary.json"
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
