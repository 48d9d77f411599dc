"""A gmsh file as the mesh of a plate: read and checked on one process, before dolfinx makes a mesh of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: gmsh's number of a kind of cells ↦ corners of a cell, and the kind of its edges. (Of second-order quadrilaterals
#: those with a node in the middle: dolfinx has no others.)
KINDS = {2: (3, 1), 9: (3, 8), 3: (4, 1), 10: (4, 8)}

#: Names of physical groups ↦ tag, by dimension.
Groups = dict[int, dict[str, int]]


class BadMesh(Exception):
    """Why a mesh is not one of a plate."""


def read(gmsh: Any, path: Path, surfaces: Sequence[str]) -> Groups:
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
    _check_names(groups, surfaces)
    gmsh.model.mesh.renumberNodes()
    numbers, x, _ = gmsh.model.mesh.getNodes()
    x = x.reshape(-1, 3)[np.argsort(numbers)]
    found = [_elements(gmsh, 2, name, groups[2][name]) for name in surfaces]
    kind = found[0][0]
    if kind not in KINDS or any(other != kind for other, _ in found):
        named = " and ".join(sorted({_called(gmsh, other) for other, _ in found}))
        allowed = ", ".join(_called(gmsh, known) for known in KINDS)
        raise BadMesh(f"has cells {named}; all must be of one kind: {allowed}")
    nodes = np.concatenate([part for _, part in found])
    _check_flat(x[nodes.ravel()])
    curves = dict[str, Integers]()
    for name, tag in groups[1].items():
        edges, curves[name] = _elements(gmsh, 1, name, tag)
        if edges != KINDS[kind][1]:
            what = f"{_called(gmsh, edges)}; those of its cells are {_called(gmsh, KINDS[kind][1])}"
            raise BadMesh(f'its physical curve "{name}" has edges {what}')
    check_cells(x[:, :2], nodes[:, : KINDS[kind][0]], {name: edges[:, :2] for name, edges in curves.items()})
    return groups


def _load(gmsh: Any, path: Path) -> None:
    """Start gmsh, and load the file under another name: a script "<name>.opt" beside what it reads would be run."""
    gmsh.initialize([], False, False, False)
    gmsh.option.setNumber("General.Terminal", 0)
    with TemporaryDirectory(prefix="rotfem-") as folder:
        link = Path(folder) / "plate.msh"
        link.symlink_to(path.resolve())
        try:
            gmsh.merge(str(link))
        except Exception as error:
            raise BadMesh(f"gmsh cannot read it: {str(error).replace(str(link), path.name)}") from None


def _check_names(groups: Groups, surfaces: Sequence[str]) -> None:
    """Refuse a solid, and other physical groups than a clamp, further curves and the surfaces of the plate."""

    def listed(dimension: int) -> str:
        return ", ".join(f'"{name}"' for name in groups[dimension]) or "none"

    if groups[3]:
        raise BadMesh("it holds cells of dimension 3; a plate is a mesh of triangles or quadrilaterals in a plane")
    if "clamped" not in groups[1]:
        raise BadMesh(f'has no physical curve "clamped" (physical curves: {listed(1)})')
    for name in surfaces:
        if name not in groups[2]:
            raise BadMesh(f'has no physical surface "{name}" (physical surfaces: {listed(2)})')
    for name in groups[2].keys() - set(surfaces):
        raise BadMesh(
            f'its physical surface "{name}" is not part of the plate; with several surfaces give '
            'structure.thickness as a table of all of them, and with one call it "plate"'
        )


def _called(gmsh: Any, kind: int) -> str:
    return f'"{gmsh.model.mesh.getElementProperties(kind)[0]}"'


def _elements(gmsh: Any, dimension: int, name: str, tag: int) -> tuple[int, Integers]:
    """Return kind and nodes, (n, …) from 0, of the elements of a physical group."""
    entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
    parts = [part for entity in entities for part in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True)]
    kinds = {int(kind) for kind, _, _ in parts}
    if len(kinds) != 1:
        what = " and ".join(sorted(_called(gmsh, kind) for kind in kinds))
        raise BadMesh(f'its physical group "{name}" {f"mixes cells ({what})" if kinds else "has no cells"}')
    nodes = [part.astype(np.int64).reshape(len(numbers), -1) - 1 for _, numbers, part in parts]
    return kinds.pop(), np.concatenate(nodes)


def _check_flat(x: Array) -> None:
    """Refuse nodes outside the plane x_3 = 0."""
    if not np.all(np.abs(x) < 1e100):  # so that areas are numbers
        raise BadMesh("has nodes whose coordinates are not finite, or of no size")
    away = np.max(np.abs(x[:, 2]))
    if away > 1e-9 * np.max(np.ptp(x, axis=0)):
        raise BadMesh(f"it leaves the plane x₃ = 0 (by {away:.3g} m); a plate lies in it")


def check_cells(x: Array, cells: Integers, curves: Mapping[str, Integers]) -> None:
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
    every = np.concatenate(list(curves.values()))
    _, first, count = np.unique(_keys(every), return_index=True, return_counts=True)
    if np.any(count > 1):
        raise BadMesh(f"an edge at {_at(x[every[first[count > 1][0]]])} is in two physical curves; can be in one only")
    number, size = len(cells), len(cells) + len(keys)
    pairs = np.repeat(np.arange(number), cells.shape[1]), number + edge.ravel()
    part = connected_components(coo_array((np.ones(len(pairs[0])), pairs), (size, size)), directed=False)[1]
    clamp = number + np.searchsorted(keys, _keys(curves["clamped"]))
    loose = np.flatnonzero(~np.isin(part[:number], part[clamp]))
    if len(loose):
        raise BadMesh(
            f'{len(loose)} of its {number} cells are not connected to the curve "clamped", one of them at '
            f"{_at(corners[loose[0]])}; parts that meet must share the nodes there (fragment the geometry)"
        )


def _keys(ends: Integers) -> Integers:
    """Return one number for every edge between two nodes (n, 2), whichever end comes first."""
    low, high = np.sort(ends, axis=1).T
    return np.asarray(high * (high + 1) // 2 + low)


def _at(x: Array) -> str:
    """Return where the middle of some points (n, 2) is."""
    return "({:.4g}, {:.4g}) m".format(*x.mean(axis=0))
