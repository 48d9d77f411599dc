"""Plates on one, two and three processes: the same numbers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rotfem.results.files import read_csv
from tests.launch import MPIRUN, rotfem
from tests.plate_mesh_files import PLATE_SCENE, grid, write_msh

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

RECTANGLE = {"shape": "length = 1.0\nwidth = 0.6\npoint_masses = [[0.83, 0.1, 1.0]]", "mesh": "elements = [5, 4]"}


def test_modes_of_a_large_plate_on_two_processes(tmp_path: Path) -> None:
    """More than 5000 unknowns, whose pairs are computed by blocks; on one process from those of half the cells.

    To 1e-8; of linear theories, and Campbell diagrams, to 1e-5 in `tests.pairs`.
    """
    large = RECTANGLE | {"mesh": "elements = [16, 16]"}
    (tmp_path / "plate.toml").write_text(PLATE_SCENE.format(**large))
    found = []
    for ranks in (1, 2):
        done = rotfem(tmp_path, ranks, "modes", "plate.toml", "--json", "--no-plots")
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout)["modes"])
    one, two = ([row["frequency"] for row in rows] for rows in found)
    np.testing.assert_allclose(two, one, rtol=1e-8)
    assert [row["label"] for row in found[1]] == [row["label"] for row in found[0]]


def test_history_on_two_processes(tmp_path: Path) -> None:
    time = "[time]\nend = 0.02\nstep = 1e-3\n"
    (tmp_path / "plate.toml").write_text(PLATE_SCENE.format(**RECTANGLE) + time)
    histories = []
    for ranks in (1, 2):
        done = rotfem(tmp_path, ranks, "run", "plate.toml", "--no-plots", "-o", f"r{ranks}")
        assert done.returncode == 0, done.stderr
        assert list((tmp_path / f"r{ranks}").glob("fields.*"))
        histories.append(read_csv(tmp_path / f"r{ranks}" / "history.csv"))
    assert np.max(np.abs(histories[0]["tip_u3"])) > 1e-3
    for column, values in histories[0].items():
        scale = max(float(np.max(np.abs(values))), 1e-6)
        np.testing.assert_allclose(histories[1][column], values, rtol=0, atol=1e-8 * scale, err_msg=column)


POINTS, GROUPS = grid(2, 2)


def frequencies(folder: Path, mesh: str, ranks: int) -> list[float]:
    """Return those of the plate of a mesh file, on so many processes."""
    (folder / "plate.toml").write_text(PLATE_SCENE.format(shape=f'mesh = "{mesh}"', mesh=""))
    done = rotfem(folder, ranks, "modes", "plate.toml", "--json", "--no-plots", timeout=120)
    assert done.returncode == 0, done.stderr
    return [row["frequency"] for row in json.loads(done.stdout)["modes"]]


def test_nodes_of_no_cell(tmp_path: Path) -> None:
    """Anywhere in the numbers and off the plane: they are no part of the plate, on one process or three."""
    write_msh(tmp_path / "good.msh", POINTS, GROUPS)
    good = frequencies(tmp_path, "good.msh", 1)
    spoiled = np.insert(np.column_stack([POINTS, np.zeros(len(POINTS))]), 4, [9.0, 9.0, 9.0], axis=0)
    moved = {name: [[n + (n >= 4) for n in cell] for cell in cells] for name, cells in GROUPS.items()}
    write_msh(tmp_path / "more.msh", spoiled, moved)
    for ranks in (1, 3):
        np.testing.assert_allclose(frequencies(tmp_path, "more.msh", ranks), good, rtol=1e-8)
