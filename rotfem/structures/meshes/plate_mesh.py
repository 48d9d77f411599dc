"""Meshes of plates: a rectangle, or a gmsh file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh
from mpi4py import MPI

from rotfem.errors import InputError, shown
from rotfem.mechanics.problem import Problem
from rotfem.numerics import compat
from rotfem.places import ONE, apart
from rotfem.structures.meshes.gmsh_file import BadMesh, read


def boundary_tags(domain: Any, dimension: int, places: Sequence[Any]) -> Any:
    """Return tags 1, 2, … of what lies on the boundary of a mesh where each of some functions of points holds."""
    found = [mesh.locate_entities_boundary(domain, dimension, at) for at in places]
    entities, order = np.unique(np.concatenate(found), return_index=True)
    tags = np.repeat(np.arange(1, len(found) + 1, dtype=np.int32), [len(part) for part in found])
    return mesh.meshtags(domain, dimension, entities, tags[order])


def beam_nodes(length: float, elements: int, knots: tuple[float, ...]) -> Array:
    """Return elements + 1 node positions on [0, length], evenly spaced between knots that are all nodes (m)."""
    stations = np.array([0.0, *knots, length])
    if len(stations) - 1 > elements:
        elements = len(stations) - 1
    share = np.diff(stations) / length * elements
    counts = np.maximum(1, np.floor(share).astype(int))
    while counts.sum() < elements:
        counts[np.argmax(share / counts)] += 1
    while counts.sum() > elements:
        counts[np.argmin(np.where(counts > 1, share / counts, np.inf))] -= 1
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(stations[:-1], stations[1:], counts, strict=True)]
    return np.concatenate([*pieces, [length]])


Array = npt.NDArray[np.float64]

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

    def ends(self, name: str) -> Array:
        """Return the ends of the edges of a named curve, of all processes, (n, 2, 3) in m."""
        edges = self.edges(name)
        own = edges[edges < self.mesh.topology.index_map(1).size_local]
        self.mesh.topology.create_connectivity(1, 0)
        nodes = mesh.entities_to_geometry(self.mesh, 1, own)[:, :2] if len(own) else np.empty((0, 2), dtype=int)
        return np.concatenate(self.mesh.comm.allgather(self.mesh.geometry.x[nodes]))

    def along(self, name: str) -> Any:
        """Return the measure of a named curve, on the boundary or inside."""
        return ufl.ds(self.curve_names[name], domain=self.mesh, subdomain_data=self.curves)


def plate_grid(problem: Problem, comm: MPI.Comm) -> PlateGrid:
    """Return the mesh of a plate."""
    data = problem.structure
    if data.mesh is None:
        return rectangle(data, problem.mesh, comm, problem.loads.stations)
    wanted = tuple(data.thickness) if isinstance(data.thickness, dict) else ()
    return from_file(Path(data.mesh), wanted, comm)


def rectangle(data: Any, grid: Any, comm: MPI.Comm, stations: Collection[float] = ()) -> PlateGrid:
    """Return 0 ≤ x ≤ length, |y| ≤ width/2 with even cells.

    The knots of a tapered thickness and stations of the loads (m) are mesh lines.
    """
    cell = mesh.CellType.quadrilateral if grid.cell == "quadrilateral" else mesh.CellType.triangle
    knots = tuple(x for x, _ in data.thickness[1:-1]) if isinstance(data.thickness, tuple) else ()
    lines = beam_nodes(data.length, grid.elements[0], apart((*knots, *stations), data.length))
    half = data.width / 2
    corners = [np.array([0.0, -half]), np.array([data.length, half])]
    cells = (len(lines) - 1, grid.elements[1])
    out = mesh.create_rectangle(comm, corners, cells, cell, diagonal=mesh.DiagonalType.left_right)
    x = out.geometry.x
    x[:, 0] = np.interp(x[:, 0], np.linspace(0.0, data.length, len(lines)), lines)
    out.topology.create_connectivity(1, 2)
    near, edges = ONE * (corners[1] - corners[0]), list[Any]()
    for axis, end in EDGES.values():
        edges.append(lambda p, i=axis, at=corners[end][axis]: np.abs(p[i] - at) < near[i])
    return PlateGrid(out, boundary_tags(out, 1, edges), {name: i for i, name in enumerate(EDGES, start=1)})


def from_file(path: Path, regions: Sequence[str], comm: MPI.Comm) -> PlateGrid:
    """Return the mesh of a gmsh file: physical curves, "clamped" among them, and the surface "plate" or regions."""
    import gmsh

    groups: dict[int, dict[str, int]] = {}
    why: str | None = None
    if comm.rank == 0:
        try:
            groups = read(gmsh, path, tuple(regions) or ("plate",))
        except BadMesh as error:
            why = str(error)
        except Exception as error:  # the others wait for rank 0: whatever happens there must reach them
            why = f"cannot be used as the mesh of a plate ({type(error).__name__}: {' '.join(str(error).split())})"
    why, groups = comm.bcast((why, groups))
    try:
        if why is not None:
            raise InputError("structure.mesh", shown(path), why)
        out, cell_tags, edge_tags = compat.model_to_mesh(gmsh.model, comm)
    finally:
        if comm.rank == 0 and gmsh.isInitialized():
            gmsh.finalize()
    return PlateGrid(out, edge_tags, groups[1], cell_tags, groups[2])
