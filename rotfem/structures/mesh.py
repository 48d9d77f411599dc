"""Meshes: nodes of a beam, a rectangle, or a gmsh file, which is checked before a mesh is made of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh
from mpi4py import MPI

from rotfem.along import ONE, apart
from rotfem.errors import InputError, shown
from rotfem.mechanics.problem import Problem
from rotfem.numerics import compat

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


def boundary_tags(domain: Any, dimension: int, places: Sequence[Any]) -> Any:
    """Return tags 1, 2, … of what lies on the boundary of a mesh where each of some functions of points holds."""
    found = [mesh.locate_entities_boundary(domain, dimension, at) for at in places]
    entities, order = np.unique(np.concatenate(found), return_index=True)
    tags = np.repeat(np.arange(1, len(found) + 1, dtype=np.int32), [len(part) for part in found])
    return mesh.meshtags(domain, dimension, entities, tags[order])


def beam_nodes(length: float, elements: int, knots: tuple[float, ...]) -> Array:
    """Return elements + 1 node positions on [0, length], evenly spaced between knots that are all nodes (m)."""
    stations = np.array([0.0, *knots, length])
    elements = max(elements, len(stations) - 1)
    share = np.diff(stations) / length * elements
    counts = np.maximum(1, np.floor(share).astype(int))
    while counts.sum() < elements:
        counts[np.argmax(share / counts)] += 1
    while counts.sum() > elements:
        counts[np.argmin(np.where(counts > 1, share / counts, np.inf))] -= 1
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(stations[:-1], stations[1:], counts, strict=True)]
    return np.concatenate([*pieces, [length]])


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
    return from_file(Path(data.mesh), data.regions, tuple(data.holds), () if data.edges else CLAMP, comm)


def rectangle(data: Any, grid: Any, comm: MPI.Comm, stations: Collection[float] = ()) -> PlateGrid:
    """Return 0 ≤ x ≤ length, |y| ≤ width/2 in even cells, with lines at knots of thickness and loads (m)."""
    cell = mesh.CellType.quadrilateral if grid.cell == "quadrilateral" else mesh.CellType.triangle
    lines = beam_nodes(data.length, grid.elements[0], apart((*data.knots, *stations), data.length))
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


def from_file(
    path: Path, regions: Sequence[str], held: Sequence[str], needed: Sequence[str], comm: MPI.Comm
) -> PlateGrid:
    """Return the mesh of a gmsh file with the physical surface "plate", or regions.

    Args:
        path: of the file.
        regions: names of physical surfaces, instead of "plate".
        held: names of physical curves that hold the plate, as far as there are any.
        needed: names of physical curves that there must be.
        comm: communicator the mesh is distributed over.
    """
    import gmsh

    groups: dict[int, dict[str, int]] = {}
    why: str | None = None
    if comm.rank == 0:
        try:
            groups = read(gmsh, path, tuple(regions) or ("plate",), held, needed)
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


# --- a gmsh file, read and checked on one process ---------------------------------------------------------------------

#: gmsh's number of a kind of cells ↦ corners of a cell: triangles of 3 and 6 nodes, quadrilaterals of 4 and 9.
KINDS = {2: 3, 9: 3, 3: 4, 10: 4}

#: The curve that holds a plate unless something else is said.
CLAMP = ("clamped",)

#: Names of physical groups ↦ tag, by dimension.
Groups = dict[int, dict[str, int]]


class BadMesh(Exception):
    """Why a mesh is not one of a plate."""


def read(
    gmsh: Any, path: Path, surfaces: Sequence[str], held: Sequence[str] = CLAMP, needed: Sequence[str] = CLAMP
) -> Groups:
    """Return the physical curves and surfaces of a file, whose model gmsh then holds, its nodes numbered from 1."""
    if path.suffix != ".msh":
        raise BadMesh("must be a mesh file of gmsh, with the ending .msh")
    with path.open("rb") as file:  # gmsh runs what begins otherwise as a script, with all that it asks of the system
        if file.readline(20).rstrip(b"\r\n") != b"$MeshFormat":
            raise BadMesh("is no mesh of gmsh: its first line must be $MeshFormat")
    _load(gmsh, path)
    groups: Groups = {0: {}, 1: {}, 2: {}, 3: {}}
    for dimension, tag in gmsh.model.getPhysicalGroups():
        groups[dimension][gmsh.model.getPhysicalName(dimension, tag) or f"{tag}"] = tag
    _check_names(groups, surfaces, needed)
    gmsh.model.mesh.renumberNodes()
    numbers, x, _ = gmsh.model.mesh.getNodes()
    x = x.reshape(-1, 3)[np.argsort(numbers)]
    found = [_elements(gmsh, 2, name, groups[2][name]) for name in surfaces]
    kind = found[0][0]
    if kind not in KINDS or any(other != kind for other, _ in found):
        raise BadMesh("has other cells than triangles of 3 or 6 nodes, or quadrilaterals of 4 or 9, all of one kind")
    nodes = np.concatenate([part for _, part in found])
    _check_flat(x[nodes.ravel()])
    curves = {name: _elements(gmsh, 1, name, tag)[1][:, :2] for name, tag in groups[1].items()}
    check_cells(x[:, :2], nodes[:, : KINDS[kind]], curves, [curves[name] for name in held if name in curves])
    return groups


def _load(gmsh: Any, path: Path) -> None:
    """Start gmsh, and load the file under another name: a script "<name>.opt" next to what it reads would be run."""
    gmsh.initialize([], False, False, False)
    gmsh.option.setNumber("General.Terminal", 0)
    with TemporaryDirectory(prefix="rotfem-") as folder:
        link = Path(folder) / "plate.msh"
        link.symlink_to(path.resolve())
        try:
            gmsh.merge(str(link))
        except Exception as error:
            raise BadMesh(f"gmsh cannot read it: {str(error).replace(str(link), path.name)}") from None


def _check_names(groups: Groups, surfaces: Sequence[str], needed: Sequence[str]) -> None:
    """Refuse a solid, and other physical groups than curves and the surfaces of the plate."""
    for dimension, kind, wanted in ((1, "curve", needed), (2, "surface", surfaces)):
        for name in wanted:
            if name not in groups[dimension]:
                named = ", ".join(f'"{other}"' for other in groups[dimension]) or "none"
                why = ", and structure.edges names none that holds it" * (dimension == 1)
                raise BadMesh(f'has no physical {kind} "{name}" (physical {kind}s: {named}){why}')
    for name in (*groups[3], *(groups[2].keys() - set(surfaces))):
        raise BadMesh(f'its physical group "{name}" is of dimension 3, or no region of structure or "plate"')


def _elements(gmsh: Any, dimension: int, name: str, tag: int) -> tuple[int, Integers]:
    """Return kind and nodes, (n, …) from 0, of the elements of a physical group."""
    entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
    parts = [part for entity in entities for part in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True)]
    kinds = {int(kind) for kind, _, _ in parts}
    if len(kinds) != 1:
        raise BadMesh(f'its physical group "{name}" {"mixes cells" if kinds else "has no cells"}')
    nodes = [part.astype(np.int64).reshape(len(numbers), -1) - 1 for _, numbers, part in parts]
    return kinds.pop(), np.concatenate(nodes)


def _check_flat(x: Array) -> None:
    """Refuse nodes outside the plane x_3 = 0."""
    away = np.max(np.abs(x[:, 2]))
    if away > 1e-9 * np.max(np.ptp(x, axis=0)):
        raise BadMesh(f"it leaves the plane x₃ = 0 (by {away:.3g} m); a plate lies in it")


def check_cells(x: Array, cells: Integers, curves: Mapping[str, Integers], held: Sequence[Integers]) -> None:
    """Refuse cells without area, that overlap at an edge, or that nothing holds, and curves along no edges of cells."""
    from scipy.sparse import coo_array  # slow to load, and only mesh files need it
    from scipy.sparse.csgraph import connected_components

    corners = x[cells]
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    turn = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]  # twice the area of each corner's triangle
    side = np.sign(turn.sum(axis=1))
    if len(bad := np.flatnonzero(np.min(turn * side[:, None], axis=1) <= 1e-10 * np.mean(np.abs(turn)))):
        raise BadMesh(f"the cell at {_at(corners[bad[0]])} has no area, or a corner of 180° or more")
    ends = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1)
    ends[side < 0.0] = ends[side < 0.0, :, ::-1]  # all cells the same way around: two of them run along an edge apart
    _, first, count = np.unique(ends.reshape(-1, 2), axis=0, return_index=True, return_counts=True)
    if np.any(count > 1):
        raise BadMesh(f"cells overlap at their common edge at {_at(x[ends.reshape(-1, 2)[first[count > 1][0]]])}")
    keys, edge = np.unique(_keys(ends.reshape(-1, 2)), return_inverse=True)
    for name, wanted in curves.items():
        if len(bad := np.flatnonzero(~np.isin(_keys(wanted), keys))):
            raise BadMesh(f'its physical curve "{name}" has an edge at {_at(x[wanted[bad[0]]])} that is none of a cell')
    every = np.concatenate([np.empty((0, 2), dtype=np.int64), *curves.values()])
    _, first, count = np.unique(_keys(every), return_index=True, return_counts=True)
    if np.any(count > 1):
        raise BadMesh(f"an edge at {_at(x[every[first[count > 1][0]]])} is in two physical curves; can be in one only")
    number, size = len(cells), len(cells) + len(keys)
    pairs = np.repeat(np.arange(number), cells.shape[1]), number + edge.ravel()
    part = connected_components(coo_array((np.ones(len(pairs[0])), pairs), (size, size)), directed=False)[1]
    holding = number + np.searchsorted(keys, _keys(np.concatenate(held))) if held else [0]  # else with the first one
    loose = np.flatnonzero(~np.isin(part[:number], part[holding]))
    if len(loose):
        where = (
            f"are not connected to {'a curve that is held' if held else 'the others'}, one at {_at(corners[loose[0]])}"
        )
        raise BadMesh(f"{len(loose)} of its {number} cells {where}; parts that meet must share the nodes there")


def _keys(ends: Integers) -> Integers:
    """Return one number for every edge between two nodes (n, 2), whichever end comes first."""
    low, high = np.sort(ends, axis=1).T
    return np.asarray(high * (high + 1) // 2 + low)


def _at(x: Array) -> str:
    """Return where the middle of some points (n, 2) is."""
    return "({:.4g}, {:.4g}) m".format(*x.mean(axis=0))
