"""Plates on 1, 2 and 4 processes: the same numbers; and bad meshes: one message, no waiting."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rotfem.results import read_csv
from tests.launch import MPIRUN, rotfem
from tests.plate_mesh_files import grid, write_msh

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

SCENE = """\
[structure]
type = "plate"
{shape}
thickness = 0.02
E = 70.0e9
nu = 0.3
rho = 2700.0
hub_radius = 0.5
[motion]
type = "constant"
speed = 60.0
axis = [0.2, 1.0, 0.5]
[mesh]
{mesh}
[modes]
count = 5
[loads]
tip_force = [0, 0, 300.0]
"""
RECTANGLE = {"shape": "length = 1.0\nwidth = 0.6\npoint_masses = [[0.83, 0.1, 1.0]]", "mesh": "elements = [5, 4]"}


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_modes_on_any_number_of_processes(tmp_path: Path, theory: str) -> None:
    (tmp_path / "plate.toml").write_text(SCENE.format(**RECTANGLE))
    found, labels = [], []
    for ranks in (1, 2, 4):
        done = rotfem(tmp_path, ranks, "modes", "plate.toml", "--json", "--no-plots", "--set", f"model.theory={theory}")
        assert done.returncode == 0, done.stderr
        rows = json.loads(done.stdout)["modes"]
        found.append([row["frequency"] for row in rows])
        labels.append([row["label"] for row in rows])
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=1e-8)
    assert labels == [labels[0]] * 3


def test_history_on_any_number_of_processes(tmp_path: Path) -> None:
    time = "[time]\nend = 0.02\nstep = 1e-3\n"
    (tmp_path / "plate.toml").write_text(SCENE.format(**RECTANGLE) + time)
    histories = []
    for ranks in (1, 2, 4):
        done = rotfem(tmp_path, ranks, "run", "plate.toml", "--no-plots", "-o", f"r{ranks}")
        assert done.returncode == 0, done.stderr
        assert list((tmp_path / f"r{ranks}").glob("fields.*"))
        histories.append(read_csv(tmp_path / f"r{ranks}" / "history.csv"))
    assert np.max(np.abs(histories[0]["tip_u3"])) > 1e-3
    for other in histories[1:]:
        for column, values in histories[0].items():
            scale = max(float(np.max(np.abs(values))), 1e-6)
            np.testing.assert_allclose(other[column], values, rtol=0, atol=1e-8 * scale, err_msg=column)


def test_campbell_on_two_processes(tmp_path: Path) -> None:
    (tmp_path / "plate.toml").write_text(SCENE.format(**RECTANGLE))
    found = []
    for ranks in (1, 2):
        arguments = ("--speeds", "0:90:4", "--json", "--no-plots", "--set", "model.theory=von_karman_linear")
        done = rotfem(tmp_path, ranks, "campbell", "plate.toml", *arguments)
        assert done.returncode == 0, done.stderr
        found.append([[b["frequency_first"], b["frequency_last"]] for b in json.loads(done.stdout)["branches"]])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8)


# --- bad meshes ------------------------------------------------------------------------------------------------------

POINTS, GROUPS = grid(2, 2)


def no_group(path: Path) -> None:
    write_msh(path, POINTS, {"plate": GROUPS["plate"], "edge": GROUPS["clamped"]})


def no_plate(path: Path) -> None:
    write_msh(path, POINTS, {"wing": GROUPS["plate"], "clamped": GROUPS["clamped"]})


def mixed(path: Path) -> None:
    a, b, c, d = GROUPS["plate"][0]
    cells = [[a, b, c], [a, c, d]]
    write_msh(path, POINTS, {"clamped": GROUPS["clamped"], "plate": GROUPS["plate"][1:] + cells})


def no_area(path: Path) -> None:
    points = POINTS.copy()
    points[4] = points[1] = points[0]
    points[3] = points[0]
    write_msh(path, points, GROUPS)


def folded(path: Path) -> None:
    points = POINTS.copy()
    points[4] = [0.9, 0.45]
    write_msh(path, points, GROUPS)


def solid(path: Path) -> None:
    x = np.array([[i, j, k] for k in (0, 1) for j, i in ((0, 0), (0, 1), (1, 1), (1, 0))], dtype=float)
    write_msh(path, x, {"plate": [list(range(8))], "clamped": [[0, 1]]})


def curved(path: Path) -> None:
    write_msh(path, np.column_stack([POINTS, POINTS[:, 0] ** 2]), GROUPS)


def line(path: Path) -> None:
    write_msh(path, POINTS, {"clamped": GROUPS["clamped"], "plate": GROUPS["tip"]})


def rubbish(path: Path) -> None:
    path.write_text("$MeshFormat\n4.1 0 8\nnonsense")


BAD: dict[str, tuple[Callable[[Path], None] | None, str]] = {
    "no clamped group": (no_group, 'no physical curve "clamped" (physical curves: "edge")'),
    "no plate group": (no_plate, 'no physical surface "plate" (physical surfaces: "wing")'),
    "mixed cells": (mixed, "mixes cells"),
    "cell without area": (no_area, "has no area"),
    "folded cell": (folded, "corner of 180° or more"),
    "solid": (solid, "dimension 3"),
    "out of the plane": (curved, "leaves the plane"),
    "no surface": (line, 'no physical surface "plate"'),
    "not a mesh": (rubbish, "structure.mesh"),
    "missing": (None, "file not found"),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", list(BAD))
def test_bad_meshes(tmp_path: Path, name: str, ranks: int) -> None:
    make, message = BAD[name]
    if make is not None:
        make(tmp_path / "bad.msh")
    (tmp_path / "plate.toml").write_text(SCENE.format(shape='mesh = "bad.msh"', mesh=""))
    done = rotfem(tmp_path, ranks, "modes", "plate.toml", timeout=60)
    told = [text for text in done.stderr.splitlines() if text.startswith("rotfem:")]
    assert done.returncode == 2, done.stderr
    assert len(told) == 1, done.stderr
    assert "bad.msh" in told[0]
    assert message in told[0]
    assert "Traceback" not in done.stderr
    assert not list((tmp_path / "results").glob("*/*"))


def test_a_good_mesh_file(tmp_path: Path) -> None:
    """The mesh of the bad cases before it is spoiled, and on one and three processes the same."""
    write_msh(tmp_path / "bad.msh", POINTS, GROUPS)
    (tmp_path / "plate.toml").write_text(SCENE.format(shape='mesh = "bad.msh"', mesh=""))
    found = []
    for ranks in (1, 3):
        done = rotfem(tmp_path, ranks, "modes", "plate.toml", "--json", "--no-plots")
        assert done.returncode == 0, done.stderr
        found.append([row["frequency"] for row in json.loads(done.stdout)["modes"]])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8)
