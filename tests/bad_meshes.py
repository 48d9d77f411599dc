"""Mesh files that are no mesh of a plate, and what must be said of each."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from tests.plate_mesh_files import PLATE_SCENE, grid, write_msh

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


def rubbish(path: Path) -> None:
    path.write_text("$MeshFormat\n4.1 0 8\nnonsense")


def joined(apart: float, across: float, path: Path) -> None:
    """Two rectangles with nodes of their own, the second one so far from the first and moved along it."""
    points = np.concatenate([POINTS, POINTS + [1.0 + apart, across]])
    plate = GROUPS["plate"] + [[n + len(POINTS) for n in cell] for cell in GROUPS["plate"]]
    write_msh(path, points, {**GROUPS, "plate": plate})


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


LOOSE = "not connected to a curve that is held, one at"
#: Name ↦ what writes the file (None: there is none), and what the program must say of it.
BAD: dict[str, tuple[Callable[[Path], None] | None, str]] = {
    "no clamped group": (no_group, 'no physical curve "clamped" (physical curves: "edge")'),
    "no plate group": (no_plate, 'no physical surface "plate" (physical surfaces: "wing")'),
    "mixed cells": (mixed, 'its physical group "plate" mixes cells'),
    "cell without area": (no_area, "has no area"),
    "folded cell": (folded, "corner of 180° or more"),
    "solid": (solid, "no physical surface"),
    "out of the plane": (curved, "leaves the plane"),
    "not a mesh": (rubbish, "structure.mesh"),
    "missing": (None, "file not found"),
    "nodes not shared": (partial(joined, 0.0, 0.25), f"4 of its 8 cells are {LOOSE} (1.25, 0) m"),
    "three cells at an edge": (three_at_an_edge, "cells overlap at their common edge at (1, 0.5) m"),
    "a cell twice": (twice, "cells overlap at their common edge at (1, 0.25) m"),
    "a cell turned over": (turned_over, "cells overlap at their common edge at (1, 0.5) m"),
    "clamp inside a cell": (partial(across, "clamped"), '"clamped" has an edge at (0.25, -0.25) m that is none of'),
    "an edge of two curves": (two_curves, "an edge at (0, -0.25) m is in two physical curves"),
}


def file_of(name: str) -> str:
    return f"meshes/{name.replace(' ', '_')}.msh"


def write_bad(folder: Path, name: str) -> str:
    """Write a bad mesh and a scene of it in a folder; return the scene's file."""
    make, _ = BAD[name]
    path = folder / file_of(name)
    path.parent.mkdir(exist_ok=True)
    if make is not None:
        make(path)
    scene = f"{path.stem}.toml"
    (folder / scene).write_text(PLATE_SCENE.format(shape=f'mesh = "{file_of(name)}"', mesh=""))
    return scene


def refusal(name: str) -> tuple[str, str]:
    """Return what the refusal of a bad mesh must hold: key and file, and what is wrong."""
    return f'structure.mesh = "{file_of(name)}"', BAD[name][1]
