"""`rotfem modes` and `rotfem campbell` as a user calls them: exit status, what is printed where, what is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Rotfem = Callable[..., Any]

SCENE = """\
[structure]
type = "planar_beam"
length = 1.0
hub_radius = 0.5
[structure.section]
EA = 400.0
GA = 130.0
EI = 1.0
mass_per_length = 1.0
rotary_inertia = 0.0025
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


#: Modes as a surface, for ParaView.
FIELDS = ("modes.xdmf", "modes.h5")


def written(path: Path) -> set[str]:
    return {file.name for file in path.iterdir()}


def test_modes_prints_a_table_and_writes_files(folder: Path, rotfem: Rotfem) -> None:
    done = rotfem("modes", "beam.toml")
    assert done.status == 0, done.err
    assert done.err == ""
    lines = done.out.splitlines()
    assert lines[0].startswith("beam: consistent_linear theory, about the undeformed state at 3 rad/s")
    assert "1st edgewise" in done.out
    assert "rad/s" in done.out
    assert "damping" in done.out
    out = folder / "results" / "beam" / "modes"
    assert written(out) == {"modes.csv", "modes.json", "mode_shapes.csv", "modes.png", "summary.json", *FIELDS}
    assert len(json.loads((out / "modes.json").read_text())["modes"]) == 3


def test_modes_json_is_alone_on_stdout(folder: Path, rotfem: Rotfem) -> None:
    """A hint and a warning (an unstable mode, here) go to stderr."""
    options = ("--set", "model.theory=linear", "--set", "motion.speed=5", "--no-plots", "-o", "out")
    done = rotfem("modes", "beam.toml", "--json", *options)
    assert done.status == 0
    summary = json.loads(done.out)
    assert summary["modes"][0]["stability"] == "static instability"
    hint, warning, beyond = done.err.splitlines()
    assert hint.startswith('hint: model.theory = "linear"')
    assert warning.startswith("warning: static instability")
    assert beyond.startswith('warning: model.theory = "linear"')
    assert written(folder / "out") == {"modes.csv", "modes.json", "mode_shapes.csv", "summary.json", *FIELDS}
    quiet = rotfem("modes", "beam.toml", "-q", *options)
    assert quiet == (0, "", "")


def test_modes_exports(folder: Path, rotfem: Rotfem) -> None:
    done = rotfem("modes", "beam.toml", "-q", "--no-plots", "--state-space", "--matrices", "-o", "out")
    assert done.status == 0, done.err
    assert {"state_space.npz", "M.mtx", "C.mtx", "K.mtx", "M.npz", "unknowns.csv"} <= written(folder / "out")
    with np.load(folder / "out" / "state_space.npz") as file:
        assert file["A"].shape == (6, 6)


def test_campbell_prints_branches_and_writes_files(folder: Path, rotfem: Rotfem) -> None:
    done = rotfem("campbell", "beam.toml", "--speeds", "0:6:4", "--per-rev", "2")
    assert done.status == 0, done.err
    assert "critical speed" in done.out
    assert "excitation" in done.out
    assert "2Ω" in done.out
    assert "MAC" in done.out
    out = folder / "results" / "beam" / "campbell"
    assert written(out) == {"campbell.csv", "campbell.json", "campbell.png", "summary.json"}
    rows = json.loads((out / "campbell.json").read_text())["rows"]
    assert {row["speed"] for row in rows if not row["refined"]} == {0.0, 2.0, 4.0, 6.0}


def test_campbell_json_and_quiet(folder: Path, rotfem: Rotfem) -> None:
    options = ("--speeds", "0,2,3.5", "--set", "model.theory=linear", "--no-plots", "-o", "out")
    done = rotfem("campbell", "beam.toml", "--json", *options)
    assert done.status == 0, done.err
    summary = json.loads(done.out)
    assert summary["speeds"] == 3
    assert summary["instabilities"][0]["kind"] == "static instability"
    assert "warning: static instability from 3.4" in done.err
    quiet = rotfem("campbell", "beam.toml", "-q", *options)
    assert quiet == (0, "", "")


BENT = tuple(
    word
    for change in ("model.theory=reissner", "loads.tip_force=[0, 50]", "solver.max_iterations=1")
    for word in ("--set", change)
)


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (("campbell", "beam.toml", "--speeds", "5"), 2, "--speeds"),
        (("campbell", "beam.toml"), 2, "--speeds"),
        (("modes", "beam.toml", "--animate", "99"), 2, "--animate"),
        (("campbell", "beam.toml", "--speeds", "0:1:2", "--rated", "fast"), 2, "--rated"),
        (("campbell", "beam.toml", "--speeds", "0:1:2", "--operating", "12rpm"), 2, "--operating"),
        (("campbell", "beam.toml", "--speeds", "0:1:2", "--operating", "12:6rpm"), 2, "modes.operating"),
        (("modes", "beam.toml", "-o", "beam.toml/out"), 2, "beam.toml/out"),
        # One Newton iteration is too few for a bent beam, however small the steps of the load.
        (("modes", "beam.toml", *BENT), 3, "no steady state"),
    ],
)
def test_what_cannot_be_done(rotfem: Rotfem, arguments: tuple[str, ...], status: int, message: str) -> None:
    done = rotfem(*arguments)
    assert done.status == status
    assert done.out == ""
    assert message in done.err
    assert "Traceback" not in done.err
    assert not Path("results").exists()


@pytest.mark.parametrize(
    ("command", "changes", "allowed"),
    [
        (("modes",), (), 36),  # 3 unknowns at 12 nodes
        (("campbell", "--speeds", "0:4:3"), (), 36),
        (("modes",), ('motion={type="torque", hub_inertia=1.0}', "time={end=1.0, step=0.1}"), 37),
    ],
)
def test_more_modes_than_unknowns(
    rotfem: Rotfem, command: tuple[str, ...], changes: tuple[str, ...], allowed: int
) -> None:
    options = [part for change in (*changes, f"modes.count={allowed + 1}") for part in ("--set", change)]
    done = rotfem(command[0], "beam.toml", *command[1:], *options)
    assert done.status == 2, done.err
    (told,) = done.err.splitlines()
    assert f"modes.count = {allowed + 1}: must be at most {allowed}, " in told


def test_all_modes_there_are(folder: Path, rotfem: Rotfem) -> None:
    """Three free unknowns: as many modes, two without rotary inertia; the default count is no demand for more."""
    small = ("--json", "--no-plots", "--set", "mesh={elements=1, degree=1}")
    done = rotfem("modes", "beam.toml", *small)
    assert done.status == 0, done.err
    assert len(json.loads(done.out)["modes"]) == 3
    done = rotfem("modes", "beam.toml", *small, "--set", 'model.effects=["coriolis", "centrifugal"]')
    assert done.status == 0, done.err
    assert len(json.loads(done.out)["modes"]) == 2
    text = (folder / "beam.toml").read_text()
    (folder / "beam.toml").write_text(text.replace("[modes]\ncount = 3\n", ""))
    done = rotfem("modes", "beam.toml", *small)
    assert done.status == 0, done.err
    assert len(json.loads(done.out)["modes"]) == 3


def test_no_error_leaves_out_the_estimate_alone(folder: Path, rotfem: Rotfem) -> None:
    """The same frequencies, digit by digit, and neither `mesh_error` nor `error`; as output.error = false does."""
    plain, quick, same = (
        rotfem(*command, "beam.toml", "--json", "--no-plots", "-o", out, *more)
        for command, out, more in (
            (("campbell", "--speeds", "0,2,4"), "plain", ()),
            (("campbell", "--speeds", "0,2,4"), "quick", ("--no-error",)),
            (("modes",), "same", ("--set", "output.error=false")),
        )
    )
    assert {done.status for done in (plain, quick, same)} == {0}
    tables = {out: (folder / out / "campbell.csv").read_text().splitlines() for out in ("plain", "quick")}
    names = {out: lines[0].split(",") for out, lines in tables.items()}
    assert set(names["plain"]) - set(names["quick"]) == {"mesh_error"}
    columns = [[line.split(",")[names[out].index("frequency")] for line in lines] for out, lines in tables.items()]
    assert columns[0] == columns[1]
    assert "error" in json.loads(plain.out)
    assert "error" not in json.loads(quick.out)
    assert all("mesh_error" not in row for row in json.loads(same.out)["modes"])
