"""A run that was killed goes on from its checkpoint as if it had never ended."""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import rotfem
from rotfem import ComputationError, SceneError
from rotfem.commands.run import Simulation
from rotfem.commands.run_store import interval
from rotfem.results import checkpoint_file
from rotfem.results.files import read_csv
from rotfem.scene import as_scene
from tests.beams import BEAM_TABLE, PLATE_TABLES, STRUCTURE
from tests.cli.conftest import Done
from tests.launch import environment

BEAM: dict[str, Any] = {
    "structure": STRUCTURE,
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 2.0},
    "mesh": {"elements": 3, "degree": 2},
    "time": {"end": 0.4, "step": 0.01},
}
PLATE = tomllib.loads(PLATE_TABLES)["structure"]
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

#: Kinds of runs, each with something of its own to be remembered.
KINDS: dict[str, dict[str, Any]] = {
    "fixed steps": {},
    "every third row": {"time.output_every": 3},
    "rows between steps": {"time.output_step": 0.013},
    "accuracy": {"accuracy": 1e-2, "time.output_step": 0.001, "initial": {"tip_displacement": 0.5}},
    "inertial frame": {"model.frame": "inertial"},
    "linear": {"model.theory": "consistent_linear"},
    "Newmark": {"time.scheme": "newmark"},
    "stages together": {"time.scheme": "radau5"},
    "stages together, free hub": {"time.scheme": "radau5", "motion": HUB},
    "stages in turn": {"time.scheme": "esdirk4"},
    "damping by mode at stations": {
        "structure": {**STRUCTURE, "damping": {"modal": 0.01}},
        "motion": HUB,
        "output": {"stations": 3},
    },
    "adaptive": {"time": {"end": 0.4, "tolerance": 1e-3}},
    "free hub": {"motion": HUB},
    "free hub, adaptive": {"motion": HUB, "time": {"end": 0.4, "tolerance": 1e-3}},
    "chosen model": {"model": {"tolerance": 0.05}},
    "release": {"initial": {"tip_displacement": 0.5}},
    "inactive unknowns": {"structure": SPATIAL, "time": {"end": 0.4, "tolerance": 1e-3}},
    "plate that bends": {
        "structure": PLATE,
        "motion": {"type": "constant", "speed": 0.0},
        "mesh": {"elements": [5, 3]},
        "model.theory": "consistent_linear",
        "loads": {"pressure": [[0.0, 0.0], [0.1, 30.0]]},
        "time": {"end": 4e-2, "step": 1e-3},
    },
    "plate": {
        "structure": PLATE,
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
    """To the last bit: state, memory of the scheme, numbers learnt and kept factor are those there were."""
    scene = scene_of(KINDS[kind])
    whole = rotfem.run(scene)
    with monkeypatch.context() as patch:
        cut(patch, 25 if whole.summary["steps"] > 26 else whole.summary["steps"] // 2)
        with pytest.raises(Killed):
            rotfem.run(scene, folder=tmp_path, checkpoint=4)
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "failed"
    result = rotfem.run(scene, folder=tmp_path, resume=True)
    assert list(result.history) == list(whole.history)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(result.history[name], values, err_msg=name)
    for name, values in whole.shape.items():
        np.testing.assert_array_equal(result.shape[name], values, err_msg=name)
    assert result.summary["steps"] == whole.summary["steps"]
    assert result.summary["newton_iterations"] == whole.summary["newton_iterations"]
    if kind != "accuracy":  # whose answer may be of a setting after the one that was broken off
        assert 0.0 < result.summary["resumed"][0]["time"] < whole.t[-1]
    assert result.summary["warnings"] == whole.summary["warnings"]
    assert result.summary["error"] == whole.summary["error"]
    np.testing.assert_array_equal(read_csv(tmp_path / "history.csv")["tip_u2"], whole.history["tip_u2"])


@pytest.mark.parametrize("end", [0.2, 0.205, 0.21])
@pytest.mark.parametrize("every", [1, 3])
def test_a_finished_run_goes_on_to_a_later_end(tmp_path: Path, end: float, every: int) -> None:
    """Also where the first end is in the middle of a step, or between two rows of the history."""
    still = {"motion": {"type": "constant", "speed": 2.0}, "initial": {"tip_displacement": 0.5}}
    scene = scene_of({"time.output_every": every, "mesh.elements": 2, **still})
    rotfem.run(scene.replace({"time.end": end}), folder=tmp_path, checkpoint=1000)
    result, whole = rotfem.run(scene, folder=tmp_path, resume=True), rotfem.run(scene)
    assert result.summary["resumed"][0]["time"] > end - 0.021
    for name, values in whole.history.items():
        np.testing.assert_array_equal(result.history[name], values, err_msg=name)


def test_where_steps_land_on_what_is_prescribed_a_later_end_keeps_the_rows_there_are(tmp_path: Path) -> None:
    """Where a march lands is chosen by what is prescribed up to its end: later steps are those of the later end."""
    first = rotfem.run(scene_of({"time.end": 0.2}), folder=tmp_path, checkpoint=1000)
    result, whole = rotfem.run(scene_of({}), folder=tmp_path, resume=True), rotfem.run(scene_of({}))
    np.testing.assert_array_equal(result.history["tip_u2"][:20], first.history["tip_u2"][:20])
    scale = np.max(np.abs(whole.history["tip_u2"]))
    np.testing.assert_allclose(result.history["tip_u2"], whole.history["tip_u2"], rtol=0, atol=1e-3 * scale)


SIGNALLED = """
import os, signal, sys
from rotfem.commands.run import Simulation
from rotfem.commands.cli import main

stepped = Simulation._stepped

def signalled(self, *arguments):
    if self.log.steps == {step}:
        os.kill(os.getpid(), signal.{name})
    stepped(self, *arguments)

Simulation._stepped = signalled
main()
"""

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


def signalled(folder: Path, name: str, step: int, *options: str) -> subprocess.CompletedProcess[str]:
    """Start a run in a process of its own that sends itself a signal after a step."""
    command = [sys.executable, "-c", SIGNALLED.format(name=name, step=step), "run", "beam.toml", "--no-plots", *options]
    return subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, check=False, timeout=300
    )


def test_killed_and_resumed(folder: Path, rotfem: Any) -> None:
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "whole").status == 0
    killed = signalled(folder, "SIGKILL", 33, "--checkpoint", "10", "-o", "cut")
    assert killed.returncode == -signal.SIGKILL
    there = read_csv(folder / "cut" / "history.csv")
    assert list(there)[:3] == ["t", "psi", "psi_dot"], "the rows so far can be read at any time"
    assert json.loads((folder / "cut" / "summary.json").read_text())["status"] == "running"
    done: Done = rotfem("run", "beam.toml", "--no-plots", "-o", "cut", "--resume")
    assert done.status == 0, done.err
    for name in ("history.csv", "shape.csv"):
        assert (folder / "cut" / name).read_bytes() == (folder / "whole" / name).read_bytes()
    assert json.loads((folder / "cut" / "summary.json").read_text())["resumed"] == [{"time": 0.3, "ranks": 1}]
    again = rotfem("run", "beam.toml", "--no-plots", "-o", "cut", "--resume")
    assert again.status == 0
    assert "holds the finished run already" in again.out


def test_an_interrupted_run_goes_on_from_the_step_it_was_in(folder: Path, rotfem: Any) -> None:
    """By SIGTERM; that SIGINT is the same is in test_cli."""
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "whole").status == 0
    done = signalled(folder, "SIGTERM", 33, "--checkpoint", "1000s", "-o", "cut")
    said = (
        "results until then are in cut; history.csv has 34 rows, up to t = 0.33 s; --resume goes on from its checkpoint"
    )
    assert (done.returncode, done.stderr) == (130, f"rotfem: interrupted; {said}\n")
    assert json.loads((folder / "cut" / "summary.json").read_text())["status"] == "interrupted"
    assert len(read_csv(folder / "cut" / "history.csv")["t"]) == 34
    assert rotfem("run", "beam.toml", "--no-plots", "-o", "cut", "--resume").status == 0
    assert json.loads((folder / "cut" / "summary.json").read_text())["resumed"][0]["time"] == pytest.approx(0.33)
    assert (folder / "cut" / "history.csv").read_bytes() == (folder / "whole" / "history.csv").read_bytes()


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
    path = folder / "out" / "checkpoint.h5"
    with h5py.File(path) as file:
        assert "arrays" in file, "HDF5, as other programs read it"
    (folder / "out" / "summary.json").write_text(json.dumps({"versions": {"rotfem": ""}, "status": "interrupted"}))
    return path


def test_damaged_and_foreign_checkpoints_are_refused(checkpoint: Path, rotfem: Any) -> None:
    whole = checkpoint.read_bytes()
    rng = np.random.default_rng(11)
    for length in (0, 5, 511, 512, 700, len(whole) // 2, len(whole) - 1):
        checkpoint.write_bytes(whole[:length])
        assert re.search("damaged|is no checkpoint", refused(rotfem, "--resume"))
    for place in rng.integers(0, len(whole), 30):
        if 150 <= place < 512:
            continue  # nothing is there
        spoilt = bytearray(whole)
        spoilt[place] ^= 1 << int(rng.integers(8))
        checkpoint.write_bytes(spoilt)
        assert re.search("damaged|is no checkpoint|has format", refused(rotfem, "--resume")), place
    checkpoint.write_bytes(b"\x89HDF\r\n\x1a\n" + whole[8:])
    assert "is no checkpoint of rotfem" in refused(rotfem, "--resume")
    checkpoint.write_bytes(whole)
    err = refused(rotfem, "--resume", "--set", "mesh.elements=3", "--set", "motion.speed=5.0")
    assert "mesh.elements is 2 there and 3 here" in err
    assert "motion.speed is 6.0 there and 5.0 here" in err
    assert "is of t = 0.39 s, after time.end = 0.3 s" in refused(rotfem, "--resume", "--set", "time.end=0.3")


def test_checkpoints_of_other_formats_and_versions_are_refused(checkpoint: Path, rotfem: Any) -> None:
    tree = checkpoint_file.read_checkpoint(checkpoint)
    whole = checkpoint.read_bytes()
    checkpoint.write_bytes(whole.replace(b"rotfem-checkpoint 2", b"rotfem-checkpoint 0", 1))
    assert "has format 0, this rotfem reads 2" in refused(rotfem, "--resume")
    tree["versions"]["rotfem"] = "0.0.9"
    checkpoint_file.write_checkpoint(checkpoint, tree)
    assert "was written by rotfem 0.0.9" in refused(rotfem, "--resume")


def test_what_cannot_be_resumed_is_said(folder: Path, rotfem: Any) -> None:
    assert "there is no checkpoint" in refused(rotfem, "--resume")
    assert os.listdir(folder) == ["beam.toml"]
    for text in ("0", "-3", "0s", "30 m", "1.5", "s", "1e3", ""):
        assert "--checkpoint" in refused(rotfem, f"--checkpoint={text}")
    steady = SCENE.split("[time]")[0].replace('"spin_up"', '"constant"').replace("duration = 2.0\n", "")
    (folder / "beam.toml").write_text(steady)
    assert "a steady state has no steps" in refused(rotfem, "--checkpoint", "3")


def test_intervals() -> None:
    seconds = interval("30s"), interval("0.5s")
    assert seconds == (30.0, 0.5)
    assert all(isinstance(value, float) for value in seconds)
    assert interval("500") == interval(500) == 500
    assert isinstance(interval("500"), int)
    with pytest.raises(SceneError, match="--checkpoint"):
        interval("soon")


def test_a_checkpoint_that_cannot_be_written_is_no_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    result = rotfem.run(scene_of({}), folder=tmp_path, checkpoint=10)
    assert result.status == "done"
    (said,) = [w for w in result.warnings if "checkpoint" in w]
    assert "could not be written at t = 0.1 s: No space left on device" in said
    assert sorted(os.listdir(tmp_path)) == ["fields.h5", "fields.xdmf", "history.csv", "shape.csv", "summary.json"]


def test_what_another_state_of_the_program_wrote_is_refused_in_words(checkpoint: Path, rotfem: Any) -> None:
    whole = checkpoint_file.read_checkpoint(checkpoint)
    (own,) = whole["processes"]
    for wrong in (
        {},
        [],
        {**whole, "versions": None},
        {**whole, "rows": "x"},
        {**whole, "processes": [{**own, "state": 3.0}]},
        {**whole, "processes": [{**own, "stepper": {}}]},
        {**whole, "processes": None},
    ):
        checkpoint_file.write_checkpoint(checkpoint, wrong)
        assert "something else than this rotfem writes" in refused(rotfem, "--resume")


@dataclass
class Link:
    """A record outside the program."""

    length: float
    ends: tuple[Any, ...]


def test_what_a_file_cannot_hold_is_an_error(tmp_path: Path) -> None:
    for value in (object(), {1.0}, 1j, np.array([object()])):
        with pytest.raises(ComputationError, match=f"cannot hold a {type(value).__name__}"):
            checkpoint_file.write_checkpoint(tmp_path / "checkpoint.h5", {"stepper": [{"learnt": (value,)}]})
        assert os.listdir(tmp_path) == []


def test_a_file_makes_nothing_but_records(tmp_path: Path) -> None:
    path, stage = tmp_path / "checkpoint.h5", Link(3.0, (np.ones(2), None))
    checkpoint_file.write_checkpoint(path, {"link": stage})
    found = checkpoint_file.read_checkpoint(path)["link"]
    assert (type(found), found.length, found.ends[1]) == (Link, 3.0, None)
    np.testing.assert_array_equal(found.ends[0], np.ones(2))
    for name in (b"os:system", b"pathlib:Path", b"rotfem.analysis.schemes:np", b"no.module:Link"):
        tree = json.dumps({"dict": {"link": {name.decode(): {}}}}).encode()
        image = io.BytesIO()
        with h5py.File(image, "w", userblock_size=512) as file:
            file["tree"] = np.frombuffer(tree, dtype=np.uint8)
        content = image.getvalue()[512:]
        head = f"rotfem-checkpoint {checkpoint_file.FORMAT}\n{len(content)}\n{hashlib.sha256(content).hexdigest()}\n"
        path.write_bytes(head.encode().ljust(512, b"\0") + content)
        with pytest.raises(SceneError, match="is no dataclass of rotfem"):
            checkpoint_file.read_checkpoint(path)
