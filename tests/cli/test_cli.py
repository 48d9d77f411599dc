"""The command line as a user meets it: what it prints, what it leaves on disk, its exit status."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rotfem.commands.cli import app
from rotfem.errors import SceneError
from rotfem.results.files import read_csv
from tests.beams import SECTION
from tests.cli.conftest import Done

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

Run = Callable[..., Done]


def test_a_bad_scene(rotfem: Run, folder: Path) -> None:
    """File, key, what is wrong and what is allowed in one message, and nothing on disk."""
    (folder / "beam.toml").write_text(SCENE.replace("duration", "durations"))
    done = rotfem("run", "beam.toml")
    assert (done.status, done.out) == (2, "")
    assert os.listdir(folder) == ["beam.toml"]
    assert done.err.startswith('rotfem: beam.toml: motion.durations: unknown key; did you mean "duration"? allowed: ')
    assert "Traceback" not in done.err


def test_each_verb_has_a_folder_of_its_own(rotfem: Run, folder: Path) -> None:
    for verb in ("run", "modes", "check"):
        assert rotfem(verb, "beam.toml", "-q", "--no-plots").status == 0
    assert sorted(os.listdir(folder / "results" / "beam")) == ["check", "modes", "run"]
    assert "history.csv" in os.listdir(folder / "results" / "beam" / "run")


def test_a_folder_of_somebody_else_is_refused(rotfem: Run, folder: Path) -> None:
    """As that of the scene, whatever its files are called."""
    for verb in ("run", "modes", "check"):
        done = rotfem(verb, "beam.toml", "-o", ".", "--no-plots")
        said = "output .: cannot be written: it holds beam.toml, and no results of rotfem; choose another folder"
        assert (done.status, done.err) == (2, f"rotfem: {said} with -o DIR\n")
    assert os.listdir(folder) == ["beam.toml"]


def test_missing_scene(rotfem: Run, folder: Path) -> None:
    done = rotfem("run", "bean.toml")
    assert done.status == 2
    assert done.out == ""
    assert done.err == "rotfem: bean.toml: no such file\n"
    assert os.listdir(folder) == ["beam.toml"]


def test_unwritable_output(rotfem: Run, folder: Path) -> None:
    """A folder below a file cannot be made, by root neither; it is found out before anything is computed."""
    done = rotfem("run", "beam.toml", "-o", "beam.toml/results")
    assert done.status == 2
    assert done.out == ""
    assert re.search(r"beam.toml/results.*cannot be written.*-o DIR", done.err)
    assert os.listdir(folder) == ["beam.toml"]


def test_run_writes_its_results(rotfem: Run, folder: Path) -> None:
    done = rotfem("run", "beam.toml")
    assert done.status == 0, done.err
    assert "50 time steps" in done.out
    assert "results in results/beam/run" in done.out
    out = folder / "results" / "beam" / "run"
    assert sorted(os.listdir(out)) == FILES_OF_A_HISTORY
    history = read_csv(out / "history.csv")
    assert list(history)[:7] == ["t", "psi", "psi_dot", "tip_u1", "tip_u2", "tip_alpha", "kinetic"]
    np.testing.assert_allclose(history["t"], np.arange(51) * 0.01, atol=1e-12)
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["status"], summary["steps"]) == ("done", 50)
    assert summary["effects"] == ["coriolis", "centrifugal", "euler", "rotary_inertia"]
    assert {"rotfem", "python", "numpy"} <= set(summary["versions"])


def test_json_is_all_there_is_on_stdout(rotfem: Run, folder: Path) -> None:
    done = rotfem("run", "beam.toml", "--json", "--no-plots", "-o", "out")
    assert (done.status, done.err) == (0, "")
    assert json.loads(done.out) == json.loads((folder / "out" / "summary.json").read_text())
    assert set(os.listdir(folder / "out")) == {name for name in FILES_OF_A_HISTORY if not name.endswith("png")}


def test_quiet(rotfem: Run) -> None:
    assert rotfem("run", "beam.toml", "-q", "--no-plots") == (0, "", "")


def test_set_changes_a_key_of_any_kind(rotfem: Run, folder: Path) -> None:
    changes = ("model.theory=linear", "time.end=0.1", 'model.effects=["euler"]', "loads.tip_force=[0.0, 1.0]")
    arguments = [word for change in changes for word in ("--set", change)]
    done = rotfem("run", "beam.toml", "--json", "--no-plots", *arguments)
    assert done.status == 0, done.err
    summary = json.loads(done.out)
    assert (summary["theory"], summary["steps"], summary["effects"]) == ("linear", 10, ["euler"])
    assert summary["scene"]["loads"]["tip_force"]["value"] == [0.0, 1.0, 0.0]
    assert (folder / "beam.toml").read_text() == SCENE


def test_steady_state_without_time(rotfem: Run, folder: Path) -> None:
    """u1 = tan(kL)/k − L with kL = 10·6·√(1.2/2.8e7), exact: 5.14317e-4 m."""
    text = SCENE.split("[time]")[0].replace('"spin_up"', '"constant"').replace("duration = 15.0\n", "")
    (folder / "beam.toml").write_text(text)
    done = rotfem("run", "beam.toml")
    assert done.status == 0, done.err
    assert "steady state" in done.out
    assert "0.000514317" in done.out
    assert {"history.csv", "shape.csv", "shape.png"} < set(os.listdir(folder / "results/beam/run"))


def test_a_failed_computation_keeps_what_it_had(rotfem: Run, folder: Path) -> None:
    """What --json prints is the summary on disk, with what failed, when, and what to try."""
    changes = ("--set", "model.theory=linear", "--set", "time.end=20.0", "--set", "time.step=0.02")
    done = rotfem("run", "beam.toml", "--json", *changes)
    assert done.status == 3
    assert re.search(r"linear solution diverged.*3\.797\d* rad/s.*at t = (8\.9|9)\d* s.*consistent_linear", done.err)
    assert "Traceback" not in done.err
    out = folder / "results" / "beam" / "run"
    assert sorted(os.listdir(out)) == FILES_OF_A_HISTORY
    summary, history = json.loads(done.out), read_csv(out / "history.csv")
    assert summary == json.loads((out / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert "linear solution diverged" in summary["failure"]["what"]
    assert "consistent_linear" in summary["failure"]["advice"]
    assert summary["failure"]["time"] == pytest.approx(history["t"][-1] + 0.02)
    assert all(np.all(np.isfinite(column)) for column in history.values())


def test_debug_gives_the_traceback(folder: Path) -> None:
    with pytest.raises(SceneError):
        app(["run", "beam.toml", "--debug", "--set", "time.step=0"])


def test_no_arguments_show_help(rotfem: Run) -> None:
    assert "campbell" in rotfem().out
    assert rotfem("--help").status == 0


def test_a_wrong_option_is_bad_input(rotfem: Run) -> None:
    done = rotfem("run", "beam.toml", "--tset", "time.step=0")
    assert done.status == 2
    assert "--tset" in done.err
