"""Meshes of plates: a rectangle, or a gmsh file that is checked on one process before any other one waits for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh
from mpi4py import MPI

from rotfem import compat
from rotfem.errors import SceneError
from rotfem.scene import PlateMesh, PlateStructure, Scene
from rotfem.structures.beam import beam_nodes

Array = npt.NDArray[np.float64]

#: gmsh's numbers of the cells a plate can be made of: triangles and quadrilaterals of first and second order.
CELLS = {2: "triangle", 9: "triangle", 3: "quadrilateral", 10: "quadrilateral", 16: "quadrilateral"}

#: Part of the mean area below which a cell counts as having none; part of the size by which nodes may leave the plane.
NO_AREA, FLAT = 1e-10, 1e-9

#: Edges of a rectangle, where a coordinate equals an end of its range: (axis, end).
EDGES = {"clamped": (0, 0), "tip": (0, 1), "lower": (1, 0), "upper": (1, 1)}


@dataclass
class PlateGrid:
    """A mesh of cells in the plane (1, 2) with its named parts.

    Attributes:
        mesh: triangles or quadrilaterals, geometric dimension 2.
        curves: edges with tags, and curve_names: name ↦ tag ("clamped" is one).
        regions: cells with tags, and region_names: name ↦ tag; None where the plate is one region.
    """

    mesh: Any
    curves: Any
    curve_names: dict[str, int]
    regions: Any = None
    region_names: dict[str, int] = field(default_factory=dict)

    def edges(self, name: str) -> npt.NDArray[np.int32]:
        """Return the local edges of a named curve."""
        return np.asarray(self.curves.find(self.curve_names[name]), dtype=np.int32)

    def along(self, name: str) -> Any:
        """Return the measure of a named curve, on the boundary or inside."""
        return ufl.ds(self.curve_names[name], domain=self.mesh, subdomain_data=self.curves)


def plate_grid(scene: Scene, data: PlateStructure, comm: MPI.Comm) -> PlateGrid:
    """Return the mesh of a scene's plate.

    Raises:
        SceneError: a mesh file that is no mesh of a plate; on every process the same.
    """
    if data.mesh is None:
        return rectangle(data, scene.mesh, comm)
    wanted = tuple(data.thickness) if isinstance(data.thickness, dict) else ()
    return from_file(scene.file, Path(data.mesh), wanted, comm)


def rectangle(data: PlateStructure, grid: Any, comm: MPI.Comm) -> PlateGrid:
    """Return 0 ≤ x ≤ length, |y| ≤ width/2 with even cells; the knots of a tapered thickness are mesh lines."""
    assert isinstance(grid, PlateMesh) and data.length is not None and data.width is not None
    cell = mesh.CellType.quadrilateral if grid.cell == "quadrilateral" else mesh.CellType.triangle
    knots = tuple(x for x, _ in data.thickness[1:-1]) if isinstance(data.thickness, tuple) else ()
    stations = beam_nodes(data.length, grid.elements[0], knots)
    half = data.width / 2
    corners = [np.array([0.0, -half]), np.array([data.length, half])]
    cells = (len(stations) - 1, grid.elements[1])
    out = mesh.create_rectangle(comm, corners, cells, cell, diagonal=mesh.DiagonalType.left_right)
    x = out.geometry.x
    x[:, 0] = np.interp(x[:, 0], np.linspace(0.0, data.length, len(stations)), stations)
    out.topology.create_connectivity(1, 2)
    names = {name: i for i, name in enumerate(EDGES, start=1)}
    edges, tags = [], []
    for name, (axis, end) in EDGES.items():
        at = (corners[0][axis], corners[1][axis])[end]
        found = mesh.locate_entities_boundary(out, 1, lambda p, axis=axis, at=at: np.isclose(p[axis], at))
        edges.append(found)
        tags.append(np.full(len(found), names[name], dtype=np.int32))
    flat, order = np.unique(np.concatenate(edges), return_index=True)
    return PlateGrid(out, mesh.meshtags(out, 1, flat, np.concatenate(tags)[order]), names)


def from_file(scene: str, path: Path, regions: Sequence[str], comm: MPI.Comm) -> PlateGrid:
    """Return the mesh of a gmsh file: physical curves (one is "clamped") and the physical surface "plate" or regions.

    Args:
        scene: name of the scene file, for errors.
        path: the file.
        regions: names of the surfaces that must make up the plate; if empty, "plate" does.
        comm: MPI communicator; the file is read on rank 0.

    Raises:
        SceneError: the file is no such mesh; on every process the same.
    """
    import gmsh

    names: dict[int, dict[str, int]] = {}
    why: str | None = None
    if comm.rank == 0:
        try:
            names = _open(gmsh, path, tuple(regions) or ("plate",))
        except _BadMesh as error:
            why = str(error)
    why, names = comm.bcast((why, names))
    try:
        if why is not None:
            raise SceneError(scene, "structure.mesh", path.name, why)
        out, cell_tags, edge_tags = compat.model_to_mesh(gmsh.model, comm)
    finally:
        if comm.rank == 0 and gmsh.isInitialized():
            gmsh.finalize()
    return PlateGrid(out, edge_tags, names[1], cell_tags, names[2])


class _BadMesh(Exception):
    """Why a file is not the mesh of a plate."""


def _open(gmsh: Any, path: Path, surfaces: tuple[str, ...]) -> dict[int, dict[str, int]]:
    """Load a file into gmsh and return dimension ↦ name ↦ tag of its physical groups."""
    gmsh.initialize([], False, False, False)
    gmsh.option.setNumber("General.Terminal", 0)
    if path.suffix != ".msh":
        raise _BadMesh("must be a mesh file of gmsh, with the ending .msh")
    try:
        gmsh.merge(str(path))
    except Exception as error:
        raise _BadMesh(f"gmsh cannot read it: {error}") from None
    groups: dict[int, dict[str, int]] = {0: {}, 1: {}, 2: {}, 3: {}}
    for dimension, tag in gmsh.model.getPhysicalGroups():
        groups[dimension][gmsh.model.getPhysicalName(dimension, tag) or f"{tag}"] = tag
    if len(gmsh.model.mesh.getNodes()[0]) == 0:
        raise _BadMesh("it holds no mesh")
    if groups[3] or len(gmsh.model.mesh.getElements(3)[0]):
        raise _BadMesh("it holds cells of dimension 3; a plate is a mesh of triangles or quadrilaterals in a plane")
    _check_names(groups, surfaces)
    _check_cells(gmsh, [groups[2][name] for name in surfaces], surfaces)
    _check_curves(gmsh, groups[1])
    return groups


def _check_names(groups: dict[int, dict[str, int]], surfaces: tuple[str, ...]) -> None:
    if "clamped" not in groups[1]:
        raise _BadMesh(f'has no physical curve "clamped" (physical curves: {_listed(groups[1])})')
    missing = [name for name in surfaces if name not in groups[2]]
    if missing:
        raise _BadMesh(f'has no physical surface "{missing[0]}" (physical surfaces: {_listed(groups[2])})')
    others = [name for name in groups[2] if name not in surfaces]
    if others:
        raise _BadMesh(
            f'its physical surface "{others[0]}" is not part of the plate; with several surfaces give '
            'structure.thickness as a table of all of them, and with one call it "plate"'
        )


def _check_cells(gmsh: Any, tags: list[int], surfaces: tuple[str, ...]) -> None:
    """Refuse mixed cells, cells without area and nodes outside the plane x_3 = 0."""
    numbers, x, _ = gmsh.model.mesh.getNodes()
    x = x.reshape(-1, 3)
    size = float(np.max(np.ptp(x, axis=0)))
    if np.max(np.abs(x[:, 2])) > FLAT * size:
        raise _BadMesh(f"it leaves the plane x₃ = 0 (by {np.max(np.abs(x[:, 2])):.3g} m); a plate lies in it")
    row = np.zeros(int(numbers.max()) + 1, dtype=np.int64)
    row[numbers.astype(np.int64)] = np.arange(len(numbers))
    kinds: set[int] = set()
    seen: list[npt.NDArray[Any]] = []
    for tag, name in zip(tags, surfaces, strict=True):
        count = 0
        for entity in gmsh.model.getEntitiesForPhysicalGroup(2, tag):
            for kind, cells, nodes in zip(*gmsh.model.mesh.getElements(2, entity), strict=True):
                kinds.add(int(kind))
                if int(kind) not in CELLS:
                    what = gmsh.model.mesh.getElementProperties(int(kind))[0]
                    raise _BadMesh(f'has cells "{what}"; can be triangles or quadrilaterals of order 1 or 2')
                corners = 3 if CELLS[int(kind)] == "triangle" else 4
                node = nodes.reshape(len(cells), -1)[:, :corners].astype(np.int64)
                _check_areas(cells, x[row[node]][:, :, :2])
                seen.append(cells)
                count += len(cells)
        if count == 0:
            raise _BadMesh(f'its physical surface "{name}" has no cells')
    if len(kinds) > 1:
        what = " and ".join(sorted(gmsh.model.mesh.getElementProperties(k)[0] for k in kinds))
        raise _BadMesh(f"mixes cells ({what}); all must be of one kind")
    cells = np.concatenate(seen)
    if len(np.unique(cells)) < len(cells):
        raise _BadMesh("has cells that belong to two physical surfaces")


def _check_areas(cells: npt.NDArray[Any], corners: Array) -> None:
    """Refuse a cell without area, or a quadrilateral with a corner of no angle or more than 180°."""
    n = corners.shape[1]
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    turn = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]  # twice the area of the corner's triangle
    area = np.abs(turn.sum(axis=1)) / (4 if n == 4 else 6)
    mean = float(np.mean(area))
    bad = np.flatnonzero(area <= NO_AREA * mean) if mean > 0 else np.arange(len(area))
    if len(bad):
        where = corners[bad[0]].mean(axis=0)
        raise _BadMesh(f"cell {int(cells[bad[0]])} at ({where[0]:.4g}, {where[1]:.4g}) m has no area")
    folded = np.flatnonzero(np.min(turn * np.sign(turn.sum(axis=1))[:, None], axis=1) <= 0.0)
    if len(folded):
        where = corners[folded[0]].mean(axis=0)
        raise _BadMesh(
            f"cell {int(cells[folded[0]])} at ({where[0]:.4g}, {where[1]:.4g}) m has a corner of 180° or more"
        )


def _check_curves(gmsh: Any, names: dict[str, int]) -> None:
    for name, tag in names.items():
        entities = gmsh.model.getEntitiesForPhysicalGroup(1, tag)
        if not sum(len(part) for e in entities for part in gmsh.model.mesh.getElements(1, e)[1]):
            raise _BadMesh(f'its physical curve "{name}" has no edges')


def _listed(names: dict[str, int]) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"
