"""The command line as a user meets it: what it prints, what it leaves on disk, its exit status."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rotfem.results.files import read_csv
from tests import launch
from tests.beams import SECTION

ROOT = Path(__file__).resolve().parents[2]

FILES_OF_A_HISTORY = [
    "fields.h5",
    "fields.xdmf",
    "history.csv",
    "history.png",
    "loads.png",
    "shape.csv",
    "summary.json",
]

SCENE = f"""\
[structure]
type = "planar_beam"
length = 10.0

{SECTION}
[motion]
type = "spin_up"
speed = 6.0
duration = 15.0

[model]
theory = "reissner"

[mesh]
elements = 4
degree = 2

[time]
end = 0.5
step = 0.01
"""

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """Return a folder with the scene beam.toml."""
    (tmp_path / "beam.toml").write_text(SCENE)
    return tmp_path


@pytest.fixture
def rotfem(here: Path) -> Run:
    """Return a function that runs `rotfem …` in that folder, where asked for as a process of its own, or code."""

    def run(*arguments: str, code: str = "", alone: bool = False) -> subprocess.CompletedProcess[str]:
        if not (code or alone):
            return launch.rotfem(here, 1, *arguments)
        start = ["-c", code] if code else ["-m", "rotfem"]
        environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
        return subprocess.run(
            [sys.executable, *start, *arguments],
            cwd=here,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell may have it ignored
        )

    return run


def changed(old: str, new: str) -> str:
    assert SCENE.count(old) == 1
    return SCENE.replace(old, new)


#: What is wrong ↦ (text of the scene or None, further arguments, what the message must contain, in this order).
BAD: dict[str, tuple[str | None, tuple[str, ...], tuple[str, ...]]] = {
    "wrong key": (changed("duration", "durations"), (), ("motion.durations", "unknown key", "duration", "allowed")),
    "wrong type": (changed("length = 10.0", 'length = "long"'), (), ("structure.length", '"long"', "number")),
    "negative length": (
        changed("length = 10.0", "length = -10.0"),
        (),
        ("structure.length", "-10.0", "greater than 0"),
    ),
    "NaN": (changed("EI = 1.4e4", "EI = nan"), (), ("structure.section.EI", "nan", "finite")),
    "missing file": (
        changed('type = "spin_up"\nspeed = 6.0\nduration = 15.0', 'type = "table"\ntable = "speed.csv"'),
        (),
        ("motion.table", "speed.csv", "not found"),
    ),
    "unreadable TOML": (changed("[time]", "[time"), (), ("not valid TOML", "line 24")),
    "impossible combination": (
        SCENE,
        ("--set", "model.frame=inertial", "--set", "model.theory=linear"),
        ("model.frame", '"inertial"', '"reissner"'),
    ),
    "zero steps": (changed("step = 0.01", "step = 0.0"), (), ("time.step", "0.0", "greater than 0")),
    "unknown theory": (changed('"reissner"', '"reisner"'), (), ("model.theory", '"reisner"', "reissner", "linear")),
}


@pytest.mark.parametrize("what", list(BAD))
def test_bad_scenes(rotfem: Run, here: Path, what: str) -> None:
    text, arguments, words = BAD[what]
    (here / "beam.toml").write_text(text or SCENE)
    before = sorted(os.listdir(here))
    done = rotfem("run", "beam.toml", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert sorted(os.listdir(here)) == before
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("rotfem: beam.toml: ")
    rest = done.stderr
    for word in words:
        assert word in rest, f"{word!r} is not in {rest!r}, the rest of {done.stderr!r}"
        rest = rest.split(word, 1)[1]


def test_each_verb_has_a_folder_of_its_own(rotfem: Run, here: Path) -> None:
    for verb in ("run", "modes", "check"):
        assert rotfem(verb, "beam.toml", "-q", "--no-plots").returncode == 0
    assert sorted(os.listdir(here / "results" / "beam")) == ["check", "modes", "run"]
    assert "history.csv" in os.listdir(here / "results" / "beam" / "run")


def test_a_folder_of_somebody_else_is_refused(rotfem: Run, here: Path) -> None:
    """As that of the scene, whatever its files are called."""
    for verb in ("run", "modes", "check"):
        done = rotfem(verb, "beam.toml", "-o", ".", "--no-plots")
        said = "output .: cannot be written: it holds beam.toml, and no results of rotfem; choose another folder"
        assert (done.returncode, done.stderr) == (2, f"rotfem: {said} with -o DIR\n")
    assert os.listdir(here) == ["beam.toml"]


def test_missing_scene(rotfem: Run, here: Path) -> None:
    done = rotfem("run", "bean.toml")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "rotfem: bean.toml: no such file\n"
    assert os.listdir(here) == ["beam.toml"]


def test_unwritable_output(rotfem: Run, here: Path) -> None:
    """A folder below a file cannot be made, by root neither; it is found out before anything is computed."""
    done = rotfem("run", "beam.toml", "-o", "beam.toml/results")
    assert done.returncode == 2
    assert done.stdout == ""
    assert re.search(r"beam.toml/results.*cannot be written.*-o DIR", done.stderr)
    assert os.listdir(here) == ["beam.toml"]


def test_several_mistakes_are_told_at_once(rotfem: Run, here: Path) -> None:
    (here / "beam.toml").write_text(SCENE.replace("10.0", "-10.0").replace("1.4e4", "nan"))
    done = rotfem("run", "beam.toml")
    assert done.returncode == 2
    assert "(and 1 more)" in done.stderr
    assert "structure.length" in done.stderr
    assert "structure.section.EI" in done.stderr


def test_run_writes_its_results(rotfem: Run, here: Path) -> None:
    done = rotfem("run", "beam.toml")
    assert done.returncode == 0, done.stderr
    assert "50 time steps" in done.stdout
    assert "results/beam/run" in done.stdout
    folder = here / "results" / "beam" / "run"
    assert sorted(os.listdir(folder)) == FILES_OF_A_HISTORY
    history = read_csv(folder / "history.csv")
    assert list(history)[:7] == ["t", "psi", "psi_dot", "tip_u1", "tip_u2", "tip_alpha", "kinetic"]
    np.testing.assert_allclose(history["t"], np.arange(51) * 0.01, atol=1e-12)
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "done"
    assert summary["steps"] == 50
    assert summary["effects"] == ["coriolis", "centrifugal", "euler", "rotary_inertia"]
    assert summary["scene"]["structure"]["length"] == 10.0
    assert {"rotfem", "python", "numpy"} <= set(summary["versions"])


def test_json_is_all_there_is_on_stdout(rotfem: Run, here: Path) -> None:
    done = rotfem("run", "beam.toml", "--json", "--no-plots", "-o", "out")
    assert done.returncode == 0
    summary = json.loads(done.stdout)
    assert summary == json.loads((here / "out" / "summary.json").read_text())
    assert sorted(os.listdir(here / "out")) == ["fields.h5", "fields.xdmf", "history.csv", "shape.csv", "summary.json"]
    assert done.stderr == ""


def test_quiet(rotfem: Run) -> None:
    done = rotfem("run", "beam.toml", "-q", "--no-plots")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_set_changes_a_key_of_any_kind(rotfem: Run, here: Path) -> None:
    changes = ("model.theory=linear", "time.end=0.1", 'model.effects=["euler"]', "loads.tip_force=[0.0, 1.0]")
    arguments = [word for change in changes for word in ("--set", change)]
    done = rotfem("run", "beam.toml", "--json", "--no-plots", *arguments)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["theory"], summary["steps"], summary["effects"]) == ("linear", 10, ["euler"])
    assert summary["scene"]["loads"]["tip_force"]["value"] == [0.0, 1.0, 0.0]
    assert (here / "beam.toml").read_text() == SCENE


def test_steady_state_without_time(rotfem: Run, here: Path) -> None:
    """u1 = tan(kL)/k − L with kL = 10·6·√(1.2/2.8e7), exact: 5.14317e-4 m."""
    text = SCENE.split("[time]")[0].replace('"spin_up"', '"constant"').replace("duration = 15.0\n", "")
    (here / "beam.toml").write_text(text)
    done = rotfem("run", "beam.toml")
    assert done.returncode == 0, done.stderr
    assert "steady state" in done.stdout
    assert "0.000514317" in done.stdout
    assert sorted(os.listdir(here / "results/beam/run")) == [
        "fields.h5",
        "fields.xdmf",
        "history.csv",
        "shape.csv",
        "shape.png",
        "summary.json",
    ]


DIVERGING = ("--set", "model.theory=linear", "--set", "time.end=20.0", "--set", "time.step=0.02")


def test_a_failed_computation_keeps_what_it_had(rotfem: Run, here: Path) -> None:
    done = rotfem("run", "beam.toml", *DIVERGING)
    assert done.returncode == 3
    assert done.stdout == ""
    assert re.search(r"linear solution diverged.*3\.797\d* rad/s.*at t = (8\.9|9)\d* s.*consistent_linear", done.stderr)
    assert "Traceback" not in done.stderr
    folder = here / "results" / "beam" / "run"
    assert sorted(os.listdir(folder)) == FILES_OF_A_HISTORY
    summary = json.loads((folder / "summary.json").read_text())
    history = read_csv(folder / "history.csv")
    assert summary["status"] == "failed"
    assert summary["failure"]["time"] == pytest.approx(history["t"][-1] + 0.02)
    assert all(np.all(np.isfinite(column)) for column in history.values())


def test_json_of_a_failed_computation(rotfem: Run, here: Path) -> None:
    """What is printed is the summary on disk, with what failed, when, and what to try."""
    done = rotfem("run", "beam.toml", "--json", "--no-plots", *DIVERGING)
    assert done.returncode == 3
    summary = json.loads(done.stdout)
    assert summary == json.loads((here / "results/beam/run/summary.json").read_text())
    assert summary["status"] == "failed"
    assert "linear solution diverged" in summary["failure"]["what"]
    assert 8.5 < summary["failure"]["time"] < 9.5
    assert "consistent_linear" in summary["failure"]["advice"]
    history = read_csv(here / "results/beam/run/history.csv")
    assert history["t"][-1] == pytest.approx(summary["failure"]["time"] - 0.02)
    assert summary["figures"]["tip_u2_final"] == history["tip_u2"][-1]


def test_debug_shows_the_traceback(rotfem: Run) -> None:
    done = rotfem("run", "beam.toml", "--debug", "--set", "time.step=0", alone=True)
    assert done.returncode not in (0, 2)
    assert "Traceback" in done.stderr
    assert "SceneError" in done.stderr


#: Runs the command line with a signal to itself after the step numbered 30.
SIGNALLED = """
import os, signal, sys
from rotfem.commands.run import Simulation
from rotfem.commands.cli import main

stepped = Simulation._stepped

def signalled(self, *arguments):
    if self.log.steps == 30:
        os.kill(os.getpid(), signal.{name})
    stepped(self, *arguments)

Simulation._stepped = signalled
main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_an_interrupted_run_keeps_what_it_had(rotfem: Run, here: Path, name: str) -> None:
    done = rotfem("run", "beam.toml", "--no-plots", code=SIGNALLED.format(name=name))
    assert done.returncode == 130
    assert done.stderr.startswith("rotfem: interrupted; results until then are in results/beam/run; history.csv has 3")
    assert done.stdout == ""
    folder = here / "results" / "beam" / "run"
    assert sorted(os.listdir(folder)) == ["fields.h5", "fields.xdmf", "history.csv", "shape.csv", "summary.json"]
    assert json.loads((folder / "summary.json").read_text())["status"] == "interrupted"
    times = read_csv(folder / "history.csv")["t"]
    assert 0.28 < times[-1] < 0.32  # the step during which the signal came may be lost


def test_no_arguments_show_help(rotfem: Run) -> None:
    done = rotfem(alone=True)
    assert "run" in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert rotfem("--help").returncode == 0


def test_a_wrong_option_is_bad_input(rotfem: Run) -> None:
    done = rotfem("run", "beam.toml", "--tset", "time.step=0")
    assert done.returncode == 2
    assert "--tset" in done.stderr
