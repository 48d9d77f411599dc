"""What the mesh scripts share: the command line, quadrilaterals or triangles, named groups, the file."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gmsh


@contextmanager
def model(name: str) -> Iterator[Any]:
    """Open gmsh with an empty model, silent."""
    gmsh.initialize([], False, False, False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add(name)
        yield gmsh.model
    finally:
        gmsh.finalize()


def finish(
    path: Path, groups: dict[str, tuple[int, list[int]]], triangles: bool, free: bool = True, order: int = 1
) -> None:
    """Name the groups (name ↦ dimension and entities), mesh the surfaces and write the file.

    Free quadrilaterals are made by halving a coarser mesh, which leaves no triangle among them. Cells of order 2 follow
    curved edges.
    """
    for name, (dimension, tags) in groups.items():
        gmsh.model.addPhysicalGroup(dimension, tags, name=name)
    if not triangles:
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        gmsh.option.setNumber("Mesh.Algorithm", 8)  # frontal, for quadrilaterals
        if free:
            gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
            gmsh.option.setNumber("Mesh.MeshSizeFactor", 2)
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.setOrder(order)
    path.parent.mkdir(parents=True, exist_ok=True)
    gmsh.write(str(path))


def blade(path: Path, name: str, corners: list[tuple[float, float]], size: float, triangles: bool) -> None:
    """Write the mesh of a blade with four corners (m): root and tip at their trailing edge, then tip and root again."""
    with model(name) as gm:
        points = [gm.geo.addPoint(x, y, 0, size) for x, y in corners]
        lines = [gm.geo.addLine(points[i], points[(i + 1) % 4]) for i in range(4)]
        surface = gm.geo.addPlaneSurface([gm.geo.addCurveLoop(lines)])
        gm.geo.synchronize()
        names = ("trailing", "tip", "leading", "clamped")
        groups = {edge: (1, [line]) for edge, line in zip(names, lines, strict=True)}
        finish(path, {**groups, "plate": (2, [surface])}, triangles)


def command(make: Callable[..., None], description: str, **defaults: float) -> None:
    """Run a script: FILE.msh, --triangles, and one option for each number of `defaults` (m)."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("file", type=Path, help="mesh file to write (.msh)")
    parser.add_argument("--triangles", action="store_true", help="triangles instead of quadrilaterals")
    for name, value in defaults.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=float, default=value, help=f"m [{value:g}]")
    arguments = vars(parser.parse_args())
    make(arguments.pop("file"), **arguments)
