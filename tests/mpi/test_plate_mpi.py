"""Plates on 1, 2 and 4 processes: the same numbers; and bad meshes: one message, no waiting."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rotfem.results import read_csv
from tests.launch import MPIRUN, environment, rotfem
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


def joined(apart: float, across: float, path: Path) -> None:
    """Two rectangles with nodes of their own, the second one so far from the first and moved along it."""
    points = np.concatenate([POINTS, POINTS + [1.0 + apart, across]])
    plate = GROUPS["plate"] + [[n + len(POINTS) for n in cell] for cell in GROUPS["plate"]]
    write_msh(path, points, {**GROUPS, "plate": plate})


def one_point(path: Path) -> None:
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]])
    write_msh(path, points, {"clamped": [[0, 3]], "plate": [[0, 1, 2, 3], [2, 4, 5, 6]]})


def three_at_an_edge(path: Path) -> None:
    """Three triangles at one edge; and a node of no cell, which leaves a gap in the numbers."""
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0.5, 0.2]])
    write_msh(path, points, {"clamped": [[0, 3]], "plate": [[0, 1, 4], [0, 4, 3], [1, 2, 4], [1, 4, 6]]})


def twice(path: Path) -> None:
    write_msh(path, POINTS, {**GROUPS, "plate": GROUPS["plate"] + GROUPS["plate"][-1:]})


def turned_over(path: Path) -> None:
    """Two cells on the same side of their common edge."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.1, 0.8], [0.1, 0.2]])
    write_msh(path, points, {"clamped": [[0, 3]], "plate": [[0, 1, 2, 3], [1, 2, 4, 5]]})


def across(curve: str, path: Path) -> None:
    a, _, b, _ = GROUPS["plate"][0]
    write_msh(path, POINTS, {**GROUPS, curve: [[a, b]]})


def two_curves(path: Path) -> None:
    write_msh(path, POINTS, {**GROUPS, "outline": GROUPS["clamped"] + [[6, 3]]})


def no_surface(path: Path) -> None:
    """A cell in no physical group, which gmsh writes with Mesh.SaveAll."""
    write_msh(path, POINTS, {**GROUPS, "plate": GROUPS["plate"][:-1], "": GROUPS["plate"][-1:], "tip": [[6, 7]]})


LOOSE = 'not connected to the curve "clamped"'
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
    "gap": (partial(joined, 0.1, 0.0), f"4 of its 8 cells are {LOOSE}, at 1.1 ≤ x ≤ 2.1 m, -0.5 ≤ y ≤ 0.5 m"),
    "nodes not shared": (
        partial(joined, 0.0, 0.25),
        f"4 of its 8 cells are {LOOSE}, at 1 ≤ x ≤ 2 m, -0.25 ≤ y ≤ 0.75 m",
    ),
    "parts that overlap": (partial(joined, -0.3, 0.0), f"4 of its 8 cells are {LOOSE}, at 0.7 ≤ x ≤ 1.7 m"),
    "joined at a point": (one_point, f"1 of its 2 cells are {LOOSE}, at 1 ≤ x ≤ 2 m, 1 ≤ y ≤ 2 m"),
    "three cells at an edge": (three_at_an_edge, "cells 2, 4, 5 overlap at their common edge at (1, 0.5) m"),
    "a cell twice": (twice, "overlap (two have the same nodes)"),
    "a cell turned over": (turned_over, "cells 2, 3 overlap at their common edge at (1, 0.5) m"),
    "clamp inside a cell": (
        partial(across, "clamped"),
        '"clamped" has an edge at (0.25, -0.25) m that is no edge of a cell',
    ),
    "tip inside a cell": (partial(across, "tip"), '"tip" has an edge at (0.25, -0.25) m that is no edge of a cell'),
    "an edge of two curves": (two_curves, '"clamped" and "outline" share an edge at (0, -0.25) m'),
    "a cell in no group": (no_surface, "has 1 cells in no physical surface"),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", list(BAD))
def test_bad_meshes(tmp_path: Path, name: str, ranks: int) -> None:
    make, message = BAD[name]
    (tmp_path / "meshes").mkdir()
    if make is not None:
        make(tmp_path / "meshes" / "bad.msh")
    (tmp_path / "plate.toml").write_text(SCENE.format(shape='mesh = "meshes/bad.msh"', mesh=""))
    done = rotfem(tmp_path, ranks, "modes", "plate.toml", timeout=60)
    told = [text for text in done.stderr.splitlines() if text.startswith("rotfem:")]
    assert done.returncode == 2, done.stderr
    assert len(told) == 1, done.stderr
    assert 'structure.mesh = "meshes/bad.msh"' in told[0]
    assert message in told[0]
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "results").exists()


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


def test_nodes_of_no_cell(tmp_path: Path) -> None:
    """Anywhere in the numbers and off the plane: they are no part of the plate."""
    spoiled = np.insert(np.column_stack([POINTS, np.zeros(len(POINTS))]), 4, [9.0, 9.0, 9.0], axis=0)
    moved = {name: [[n + (n >= 4) for n in cell] for cell in cells] for name, cells in GROUPS.items()}
    write_msh(tmp_path / "good.msh", POINTS, GROUPS)
    write_msh(tmp_path / "more.msh", spoiled, moved)
    found = []
    for name, ranks in (("good", 1), ("more", 1), ("more", 2)):
        (tmp_path / "plate.toml").write_text(SCENE.format(shape=f'mesh = "{name}.msh"', mesh=""))
        done = rotfem(tmp_path, ranks, "modes", "plate.toml", "--json", "--no-plots", timeout=120)
        assert done.returncode == 0, done.stderr
        found.append([row["frequency"] for row in json.loads(done.stdout)["modes"]])
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=1e-8)


BROKEN = """\
import sys
sys.argv = ["rotfem", "modes", "plate.toml"]
import gmsh
def clear():
    raise ZeroDivisionError("on purpose")
gmsh.clear = clear
from rotfem.cli import main
main()
"""


def test_any_failure_of_the_reader_is_told_by_all(tmp_path: Path) -> None:
    """What nobody foresaw fails on rank 0 alone, and ends the other too."""
    write_msh(tmp_path / "bad.msh", POINTS, GROUPS)
    (tmp_path / "plate.toml").write_text(SCENE.format(shape='mesh = "bad.msh"', mesh=""))
    start = [str(MPIRUN), "-n", "2", "--oversubscribe", sys.executable, "-c", BROKEN]
    done = subprocess.run(
        start, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert "cannot be used as the mesh of a plate (ZeroDivisionError: on purpose)" in done.stderr


# --- more processes than cells ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["modes", "run"])
@pytest.mark.parametrize(
    ("ranks", "shape", "mesh"),
    [
        (2, "length = 1.0\nwidth = 0.6", "elements = [1, 1]"),
        (4, "length = 1.0\nwidth = 0.6", "elements = [3, 1]"),
        (2, 'mesh = "one.msh"', ""),
    ],
)
def test_more_processes_than_cells(tmp_path: Path, ranks: int, shape: str, mesh: str, command: str) -> None:
    write_msh(tmp_path / "one.msh", *grid(1, 1))
    time = "[time]\nend = 0.01\nstep = 0.005\n"
    (tmp_path / "plate.toml").write_text(SCENE.format(shape=shape, mesh=mesh) + time)
    done = rotfem(tmp_path, ranks, command, "plate.toml", timeout=60)
    told = [text for text in done.stderr.splitlines() if text.startswith("rotfem:")]
    assert done.returncode == 2, done.stderr
    assert len(told) == 1, done.stderr
    assert f"mesh.{mesh}: " in told[0] if mesh else 'structure.mesh = "one.msh": ' in told[0]
    assert f"cannot be shared by {ranks} processes" in told[0]
    assert not (tmp_path / "results").exists()


BEAM = """\
[structure]
type = "planar_beam"
length = 1.0
section = { EA = 1e6, GA = 4e5, EI = 1e2, mass_per_length = 1.0, rotary_inertia = 1e-4 }
[motion]
type = "constant"
speed = 5.0
[mesh]
elements = 1
"""


def test_beams_of_fewer_cells_than_processes(tmp_path: Path) -> None:
    """Their modes cannot be computed; their histories and steady states can."""
    (tmp_path / "beam.toml").write_text(BEAM)
    done = rotfem(tmp_path, 2, "modes", "beam.toml", timeout=60)
    assert done.returncode == 2, done.stderr
    assert "mesh.elements = 1: the mesh (cells: 1) cannot be shared by 2 processes" in done.stderr
    assert rotfem(tmp_path, 2, "run", "beam.toml", "--no-plots", timeout=120).returncode == 0
