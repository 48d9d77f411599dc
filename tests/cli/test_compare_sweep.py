"""`rotfem compare` and `rotfem sweep` as a user calls them: exit status, what is printed, what is written."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest

from tests.beams import MODAL_SCENE
from tests.launch import environment

Rotfem = Callable[..., Any]
SCENE = MODAL_SCENE

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
    assert "1st edgewise" in shown.out
    assert max(map(len, shown.out.splitlines())) <= 80


def test_compare_refuses(folder: Path, rotfem: Rotfem) -> None:
    assert rotfem("modes", "beam.toml", *OPTIONS, "-o", "a").status == 0
    (folder / "empty").mkdir()
    for arguments, said in (
        (("a",), "two results at least"),
        (("a", "empty"), "no result"),
        (("a", "a", "-o", "a"), "which is read"),
    ):
        done = rotfem("compare", *arguments)
        assert done.status == 2, arguments
        assert said in done.err


SWEEP = ("sweep", "beam.toml", "--set", "motion.speed=0:8:4", "--set", "structure.hub_radius=0.1:0.9:4", "-o", "out")
MODES = ("--", "modes", "--no-error")


def done(out: Path) -> dict[str, int]:
    """Return the points that are done and when their summaries were written."""
    found = {path.parent.name: path for path in out.glob("points/*/summary.json")}
    return {
        name: path.stat().st_mtime_ns
        for name, path in found.items()
        if json.loads(path.read_text())["status"] == "done"
    }


def table(out: Path) -> list[dict[str, str]]:
    """Return the rows of the table, of which there may be none yet."""
    path = out / "sweep.csv"
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines())) if path.exists() else []


def test_a_sweep_that_was_killed_goes_on(folder: Path, rotfem: Rotfem) -> None:
    """On one process: nothing is lost, and nothing computed twice; the table is that of the modes' own results."""
    out = folder / "out"
    command = [sys.executable, "-m", "rotfem", *SWEEP, "-j", "2", *MODES]
    killed = subprocess.Popen(command, cwd=folder, env=environment(), start_new_session=True)
    limit = monotonic() + 240.0
    while len(done(out)) < 2 and killed.poll() is None and monotonic() < limit:
        sleep(0.02)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    before = done(out)
    assert 2 <= len(before) < 16
    assert {row["folder"] for row in table(out)} <= set(before), "the table grows with them"

    again = rotfem(*SWEEP, *MODES)
    assert again.status == 0, again.err
    assert "16 of 16 points done" in again.out
    after = done(out)
    assert len(after) == 16
    assert {name: after[name] for name in before} == before
    rows = table(out)
    assert {row["folder"] for row in rows} == set(after)
    for row in rows:
        summary = json.loads((out / "points" / row["folder"] / "summary.json").read_text())
        assert summary["scene"]["motion"]["speed"] == float(row["motion.speed"])
        assert summary["scene"]["structure"]["hub_radius"] == float(row["structure.hub_radius"])
        assert summary["modes"][0]["frequency"] == float(row["frequency_1"])


def test_sweep_writes_a_table_arrays_and_a_figure(folder: Path, rotfem: Rotfem) -> None:
    """A theory that fails at a speed is a row that says so; more points take those that are there."""
    sets = ("--set", "model.theory=linear,consistent_linear", "--set", "motion.speed=1,9")
    given = ("sweep", "beam.toml", "-o", "out", *sets, "--set", "time={end=20.0,step=0.05}")
    shown = rotfem(*given, "--", "run", "--no-error")
    assert shown.status == 0, shown.err
    assert "3 of 4 points done" in shown.out
    assert "1 of 4 points failed, the first one: the history would start from an unstable equilibrium" in shown.err
    out = folder / "out"
    names = {path.name for path in out.iterdir()}
    assert {"sweep.csv", "sweep.png", "summary.json", "points"} <= names
    times = done(out)
    more = rotfem(*given[:-1], "time={end=20.0,step=0.05}", "--set", "mesh.elements=4", "--", "run", "--no-error")
    assert more.status == 0, more.err
    assert done(out) == times
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(out / "sweep.nc", engine="scipy") as data:
        assert data.sizes == {"model.theory": 2, "motion.speed": 2}
        assert np.isnan(data["tip_u2_final"].values).tolist() == [[False, True], [False, False]]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--set", "motion.speed=1,2", "--", "explain"), "needs a verb, on the command line after --: run, modes"),
        (("--set", "motion.speed=1,2", "--", "modes", "--nonsense"), "No such option"),
        (("--set", "motion.speed=1", "--", "modes"), "must give a key several values"),
        (("--set", "motion.speed=1:b:3", "--", "modes"), "must give a key several values"),
        (("--set", "motion.speed=nan:1:3", "--", "modes"), "must be a number"),
        (("--set", "motion.sped=1,2", "--", "modes"), "motion.sped"),
        (("--set", "motion.speed=1,2", "-j", "0", "--", "modes"), "'-j'"),
    ],
)
def test_sweep_refuses(folder: Path, rotfem: Rotfem, arguments: tuple[str, ...], said: str) -> None:
    refused = rotfem("sweep", "beam.toml", "-o", "out", *arguments)
    assert refused.status == 2
    assert said in refused.err
    assert not (folder / "out").exists()


def test_values_of_a_key() -> None:
    from rotfem.commands.sweep import values_of

    assert values_of("0:1:3") == [0, 0.5, 1]
    assert values_of("4:16:4") == [4, 8, 12, 16]
    assert all(isinstance(value, int) for value in values_of("4:16:4"))
    assert values_of("0:15:2rpm") == ["0 rpm", "15 rpm"]
    assert values_of("1,2.5,3 rpm") == ["1 rpm", "2.5 rpm", "3 rpm"]
    assert values_of("0,1e-3") == [0, 1e-3]
    assert values_of("1,1e3 N") == ["1 N", "1e3 N"]
    assert values_of("linear,reissner") == ["linear", "reissner"]
    assert values_of("[0, 1]") == ["[0, 1]"]
    assert values_of("[0, 1],[0, 2]") == ["[0, 1]", "[0, 2]"]
    assert values_of("10:20:11") == list(range(10, 21))  # which TOML takes for a time of day
