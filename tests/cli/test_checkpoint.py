"""A run that was killed goes on from its checkpoint, and ends as one that was not, to 1e-9."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem import ComputationError, SceneError
from rotfem.commands import run_store
from rotfem.commands.run import Simulation
from rotfem.commands.run_store import read_checkpoint
from rotfem.results.files import read_csv
from rotfem.scene import as_scene
from rotfem.structures.reference_rotation import SectionTurns
from tests.beams import BEAM_TABLE, PLATE_TABLES, STRUCTURE
from tests.cli.conftest import Done
from tests.histories import difference
from tests.launch import environment

BEAM: dict[str, Any] = {
    "structure": STRUCTURE,
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 2.0},
    "mesh": {"elements": 3, "degree": 2},
    "time": {"end": 0.4, "step": 0.01},
}
SPATIAL = {
    **STRUCTURE,
    "type": "spatial_beam",
    "section": {
        **dict.fromkeys(("GA2", "GA3"), 1e7),
        **dict.fromkeys(("EI2", "EI3", "GJ"), 1.4e4),
        "EA": 2.8e7,
        "mass_per_length": 1.2,
    },
}
HUB = {"type": "torque", "hub_inertia": 50.0, "pulses": [[0.0, 0.17, 30.0]]}

TURNING = {
    "structure": SPATIAL,
    "motion": {"type": "constant", "speed": 0.0},
    "loads": {"tip_moment": [0.0, 0.0, 2000.0], "tip_force": [0.0, 0.0, 50.0]},
    "initial": {"state": "undeformed"},
    "output": {"error": False},
}

#: Kinds of runs, each with something of its own to be remembered.
KINDS: dict[str, dict[str, Any]] = {
    "every third row": {"time.output_every": 3},
    "rows between steps": {"time.output_step": 0.013},
    "inertial frame": {"model.frame": "inertial"},
    "linear": {"model.theory": "consistent_linear"},
    "stages in turn": {"time.scheme": "esdirk4"},
    "adaptive": {"time": {"end": 0.4, "tolerance": 1e-3}},
    "free hub at stations": {"motion": HUB, "output": {"stations": 3}},
    "rotations counted afresh": TURNING,
    "plate": {
        "structure": tomllib.loads(PLATE_TABLES)["structure"],
        "mesh": {"elements": [5, 3]},
        "motion.speed": 60.0,
        "time": {"end": 4e-2, "step": 1e-3},
    },
}


class Killed(Exception):
    """In the place of a kill: nothing that a run does on its way out is done."""


def cut(monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    """Let runs end in the middle of a step."""
    real = Simulation._stepped

    def stepped(self: Simulation, *arguments: Any) -> None:
        if self.log.steps == step:
            raise Killed
        real(self, *arguments)

    monkeypatch.setattr(Simulation, "_stepped", stepped)


def scene_of(changes: dict[str, Any]) -> rotfem.Scene:
    return as_scene(BEAM).replace(changes)


@pytest.mark.parametrize("kind", KINDS)
def test_the_history_is_that_of_an_unbroken_run(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SectionTurns, "enough", 0.3)  # rad, from where on rotations are counted afresh
    scene = scene_of(KINDS[kind])
    whole = rotfem.run(scene)
    with monkeypatch.context() as patch:
        cut(patch, max(whole.summary["steps"] - 6, whole.summary["steps"] // 2))
        with pytest.raises(Killed):
            rotfem.run(scene, folder=tmp_path, checkpoint=4)
    if kind == "rotations counted afresh":
        assert read_checkpoint(tmp_path / "checkpoint.npz")["processes"][0]["state"].reference is not None
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "failed"
    result = rotfem.run(scene, folder=tmp_path, resume=True)
    assert difference(result.history, whole.history) < 1e-9
    assert difference(result.shape, whole.shape) < 1e-9
    assert result.summary["steps"] == whole.summary["steps"]
    if "error" in whole.summary:
        assert result.summary["error"]["total"] == pytest.approx(whole.summary["error"]["total"], rel=1e-6)
    assert 0.0 < result.summary["resumed"][0]["time"] < whole.t[-1]
    assert result.summary["warnings"] == whole.summary["warnings"]
    np.testing.assert_array_equal(read_csv(tmp_path / "history.csv")["tip_u2"], result.history["tip_u2"])


@pytest.mark.parametrize(("end", "every"), [(0.2, 1), (0.205, 1), (0.205, 3)])
def test_a_finished_run_goes_on_to_a_later_end(tmp_path: Path, end: float, every: int) -> None:
    """Also where the first end is in the middle of a step, or between two rows of the history."""
    still = {"motion": {"type": "constant", "speed": 2.0}, "initial": {"tip_displacement": 0.5}}
    scene = scene_of({"time.output_every": every, "mesh.elements": 2, **still})
    rotfem.run(scene.replace({"time.end": end}), folder=tmp_path, checkpoint=1000)
    result = rotfem.run(scene, folder=tmp_path, resume=True)
    assert result.summary["resumed"][0]["time"] > end - 0.021
    assert difference(result.history, rotfem.run(scene).history) < 1e-9


SCENE = f"""\
{BEAM_TABLE}[motion]
type = "spin_up"
speed = 6.0
duration = 2.0
[mesh]
elements = 2
[time]
end = 0.4
step = 0.01
"""

SIGNALLED = """
import os, signal
from rotfem.commands.run import Simulation
from rotfem.commands.cli import main

stepped = Simulation._stepped

def signalled(self, *arguments):
    if self.log.steps == 33:
        os.kill(os.getpid(), signal.{name})
    stepped(self, *arguments)

Simulation._stepped = signalled
main()
"""


def signalled(folder: Path, name: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Start a run in a process of its own that sends itself a signal after a step."""
    command = [sys.executable, "-c", SIGNALLED.format(name=name), "run", "beam.toml", "--no-plots", *options]
    return subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, check=False, timeout=300
    )


def summary(folder: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(Path(folder, "summary.json").read_text())
    return found


def test_killed_and_resumed(folder: Path, rotfem: Any) -> None:
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "whole").status == 0
    killed = signalled(folder, "SIGKILL", "--checkpoint", "10", "-o", "cut")
    assert killed.returncode == -signal.SIGKILL
    assert list(read_csv("cut/history.csv"))[:3] == ["t", "psi", "psi_dot"], "the rows so far can be read at any time"
    assert summary("cut")["status"] == "running"
    assert "cut: run is running, or was killed; " in rotfem("check", "cut").out
    done: Done = rotfem("run", "beam.toml", "--no-plots", "-o", "cut", "--resume")
    assert done.status == 0, done.err
    assert difference(read_csv("cut/history.csv"), read_csv("whole/history.csv")) < 1e-9
    assert summary("cut")["resumed"] == [{"time": 0.3, "ranks": 1}]


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_an_interrupted_run_goes_on_from_the_step_it_was_in(name: str, folder: Path, rotfem: Any) -> None:
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "whole").status == 0
    done = signalled(folder, name, "--checkpoint", "1000s", "-o", "cut")
    said = (
        "results until then are in cut; history.csv has 34 rows, up to t = 0.33 s; --resume goes on from its checkpoint"
    )
    assert done.returncode == 130
    assert done.stderr.endswith(f"rotfem: interrupted; {said}\n")
    assert summary("cut")["status"] == "interrupted"
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "cut", "--resume").status == 0
    assert summary("cut")["resumed"][0]["time"] == pytest.approx(0.33)
    assert difference(read_csv("cut/history.csv"), read_csv("whole/history.csv")) < 1e-9


def refused(rotfem: Any, *options: str) -> str:
    """Return the one error of a run that is refused before anything is computed or changed."""
    before = {p: p.read_bytes() for p in Path("out").iterdir()} if Path("out").is_dir() else None
    done: Done = rotfem("run", "beam.toml", "--no-plots", "-o", "out", *options)
    assert done.status == 2, done.err
    assert done.err.count("\n") == 1, done.err
    assert before is None or {p: p.read_bytes() for p in Path("out").iterdir()} == before
    return done.err


@pytest.fixture
def checkpoint(folder: Path, rotfem: Any) -> Path:
    """A checkpoint of the scene."""
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "out", "--checkpoint", "15").status == 0
    there = summary("out") | {"status": "interrupted"}
    (folder / "out" / "summary.json").write_text(json.dumps(there))
    return folder / "out" / "checkpoint.npz"


def test_damaged_and_foreign_checkpoints_are_refused(checkpoint: Path, rotfem: Any) -> None:
    whole = checkpoint.read_bytes()
    for length in (0, 5, 700, len(whole) // 2, len(whole) - 1):
        checkpoint.write_bytes(whole[:length])
        assert "is damaged, or no checkpoint" in refused(rotfem, "--resume")
    start = whole.index(b"arr_1.npy") + 200  # within the numbers, which have a check sum
    checkpoint.write_bytes(whole[:start] + bytes([whole[start] ^ 1]) + whole[start + 1 :])
    assert "is damaged, or no checkpoint" in refused(rotfem, "--resume")
    checkpoint.write_bytes(whole)
    err = refused(rotfem, "--resume", "--set", "mesh.elements=3", "--set", "motion.speed=5.0")
    assert "mesh.elements is 2 there and 3 here" in err
    assert "motion.speed is 6.0 there and 5.0 here" in err
    assert "is of t = 0.39 s, after time.end = 0.3 s" in refused(rotfem, "--resume", "--set", "time.end=0.3")


def test_what_another_program_wrote_is_refused_in_words(checkpoint: Path, rotfem: Any) -> None:
    whole = run_store.read_checkpoint(checkpoint)
    (own,) = whole["processes"]
    for wrong in ({"rows": "x"}, {"processes": [{**own, "state": 3.0}]}, {"processes": [{**own, "parts": {}}]}):
        run_store.write_checkpoint(checkpoint, {**whole, **wrong})
        assert "is damaged, or no checkpoint of this rotfem" in refused(rotfem, "--resume")
    run_store.write_checkpoint(checkpoint, {**whole, "rotfem": "0.0.9"})
    assert "was written by rotfem 0.0.9" in refused(rotfem, "--resume")


def test_what_cannot_be_resumed_is_said(folder: Path, rotfem: Any) -> None:
    assert "there is no checkpoint" in refused(rotfem, "--resume")
    assert [path.name for path in folder.iterdir()] == ["beam.toml"]
    for text in ("0", "-3", "0s", "30 m", "1.5", "s", "1e3", ""):
        assert "--checkpoint" in refused(rotfem, f"--checkpoint={text}")
    steady = SCENE.split("[time]")[0].replace('"spin_up"', '"constant"').replace("duration = 2.0\n", "")
    (folder / "beam.toml").write_text(steady)
    assert "a steady state has no steps" in refused(rotfem, "--checkpoint", "3")


@dataclass
class Link:
    """A record outside the program."""

    length: float
    ends: Any


def test_nothing_but_dataclasses_is_made_of_a_file(tmp_path: Path) -> None:
    path, link = tmp_path / "checkpoint.npz", Link(3.0, (np.ones(2), None))
    run_store.write_checkpoint(path, {"link": link})
    found = run_store.read_checkpoint(path)["link"]
    assert (type(found), found.length, found.ends[1]) == (Link, 3.0, None)
    np.testing.assert_array_equal(found.ends[0], np.ones(2))
    for value in (object(), {1.0}, 1j, np.array([object()])):
        with pytest.raises(ComputationError, match=f"cannot hold a {type(value).__name__}"):
            run_store.write_checkpoint(path, {"learnt": (value,)})
    for name in ("os:system", "pathlib:Path", "rotfem.analysis.schemes:np", "no.module:Link"):
        run_store.write_checkpoint(path, {"learnt": {"#class": name}})
        with pytest.raises(SceneError, match="is no dataclass of rotfem"):
            run_store.read_checkpoint(path)


def test_a_checkpoint_executes_nothing(checkpoint: Path, rotfem: Any) -> None:
    """A pickle, which numpy could load."""
    np.savez(checkpoint, head=np.array([Link(1.0, None)], dtype=object))
    assert "is damaged, or no checkpoint of this rotfem (ValueError)" in refused(rotfem, "--resume")
