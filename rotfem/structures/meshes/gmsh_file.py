"""A gmsh file as the mesh of a plate: read and checked on one process, and reduced to what the plate is made of."""

from __future__ import annotations

import os
import re
import resource
import signal
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class BadMesh(Exception):
    """Why a mesh is not one of a plate."""


@dataclass
class Cells:
    """Cells of one kind, with straight edges between their corners.

    Attributes:
        numbers: what the file calls them, shape (n,).
        corners: rows of x, shape (n, 3) or (n, 4), in order around the cell.
        x: coordinates of all nodes in the plane, shape (m, 2), m.
    """

    numbers: npt.NDArray[Any]
    corners: Integers
    x: Array

    def check(self) -> None:
        """Refuse cells without area, with a corner of 180° or more, and cells that overlap at an edge.

        Raises:
            BadMesh: says which cell, and where.
        """
        self._check_areas()
        self._check_edges()

    def _check_areas(self) -> None:
        x = self.x[self.corners]
        n = x.shape[1]
        after, before = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
        turn = _cross(after, before)  # twice the area of the corner's triangle
        area = np.abs(turn.sum(axis=1)) / (4 if n == 4 else 6)
        mean = float(np.mean(area))
        bad = np.flatnonzero(area <= 1e-10 * mean) if mean > 0 else np.arange(len(area))
        if len(bad):
            raise BadMesh(f"cell {int(self.numbers[bad[0]])} at {at(x[bad[0]])} has no area")
        folded = np.flatnonzero(np.min(turn * np.sign(turn.sum(axis=1))[:, None], axis=1) <= 0.0)
        if len(folded):
            raise BadMesh(f"cell {int(self.numbers[folded[0]])} at {at(x[folded[0]])} has a corner of 180° or more")

    # --- edges ------------------------------------------------------------------------------------------------------

    def key(self, ends: Integers) -> Integers:
        """Return one number for every edge between two nodes (…, 2), whichever end comes first."""
        return np.asarray(ends.min(axis=-1) * len(self.x) + ends.max(axis=-1))

    @cached_property
    def _edges(self) -> tuple[Integers, Integers, Integers, Integers]:
        """Return (keys of the edges, sorted; cells of each, one edge's after another; edge ↦ its first; how many)."""
        ends = np.stack([self.corners, np.roll(self.corners, -1, axis=1)], axis=-1)
        keys, edge, count = np.unique(self.key(ends).ravel(), return_inverse=True, return_counts=True)
        cells = np.argsort(edge.ravel(), kind="stable") // self.corners.shape[1]
        return keys, cells, np.cumsum(count) - count, count

    @cached_property
    def _joined(self) -> Integers:
        """Return the edges that two cells share."""
        return np.flatnonzero(self._edges[3] == 2)

    def _pairs(self) -> tuple[Integers, Integers]:
        """Return the two cells of every shared edge."""
        _, cells, first, _ = self._edges
        return cells[first[self._joined]], cells[first[self._joined] + 1]

    def _check_edges(self) -> None:
        """Refuse an edge of three cells, and one whose two cells lie on the same side of it."""
        keys, cells, first, count = self._edges
        bad = np.flatnonzero(count > 2)
        if not len(bad):
            start, end = (self.x[part] for part in np.divmod(keys[self._joined], len(self.x)))
            middle = self.x[self.corners].mean(axis=1)
            sides = [_cross(end - start, middle[part] - start) for part in self._pairs()]
            bad = self._joined[sides[0] * sides[1] > 0.0]
        if not len(bad):
            return
        e = bad[0]
        here = cells[first[e] : first[e] + count[e]]
        names = ", ".join(f"{int(number)}" for number in self.numbers[here])
        nodes = np.sort(self.corners[here], axis=1)
        same = " (two have the same nodes)" if len(np.unique(nodes, axis=0)) < len(nodes) else ""
        where = at(self.x[np.array(np.divmod(keys[e], len(self.x)))])
        raise BadMesh(f"cells {names} overlap{same} at their common edge at {where}")

    # --- curves -----------------------------------------------------------------------------------------------------

    def check_curve(self, name: str, edges: Integers, used: Integers) -> None:
        """Refuse a curve with edges (n, 2 or 3) that are no edges of cells; `used` are the nodes of all cells.

        Raises:
            BadMesh: says where.
        """
        keys, wanted = self._edges[0], self.key(edges[:, :2])
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        bad = np.flatnonzero((keys[place] != wanted) | ~np.isin(edges, used).all(axis=1))
        if len(bad):
            where = at(self.x[edges[bad[0], :2]])
            raise BadMesh(f'its physical curve "{name}" has an edge at {where} that is no edge of a cell of the plate')

    def check_held(self, clamp: Integers) -> None:
        """Refuse a part of the plate, connected through edges that cells share, that no edge of the clamp (n, 2) holds.

        Raises:
            BadMesh: says where it is, and of how many cells.
        """
        from scipy.sparse import coo_array  # slow to load, and only mesh files need it
        from scipy.sparse.csgraph import connected_components

        keys, cells, first, count = self._edges
        a, b = self._pairs()
        size = len(self.corners)
        graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(size, size))
        parts, part = connected_components(graph, directed=False)
        edges = np.searchsorted(keys, self.key(clamp))
        supported = np.zeros(parts, dtype=bool)
        supported[part[cells[first[edges]]]] = True
        supported[part[cells[first[edges] + count[edges] - 1]]] = True
        loose = np.flatnonzero(~supported[part])
        if not len(loose):
            return
        x = self.x[self.corners[part == part[loose[0]]]].reshape(-1, 2)
        low, high = x.min(axis=0), x.max(axis=0)
        several = parts - int(supported.sum())
        where = f"at {low[0]:.4g} ≤ x ≤ {high[0]:.4g} m, {low[1]:.4g} ≤ y ≤ {high[1]:.4g} m"
        raise BadMesh(
            f'{len(loose)} of its {size} cells are not connected to the curve "clamped", '
            f"{where if several == 1 else f'in {several} parts, one {where}'}; cells are connected by an edge whose "
            "two nodes they share, so parts that meet must not have nodes of their own there (fragment the geometry)"
        )


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def at(x: Array) -> str:
    """Return where the middle of some points (n, 2) is."""
    where = x.mean(axis=0)
    return f"({where[0]:.4g}, {where[1]:.4g}) m"


#: What the process says at the end of its work.
DONE = b"\0done"


def mishap(work: Callable[[], object], seconds: float, memory: float) -> str | None:
    """Return how a process ends badly that does the work, or what an exception in it says; None where it comes through.

    Args:
        work: what is tried; nothing of it is left in this process.
        seconds: time that it may take.
        memory: bytes that it may need beyond what this process has.
    """
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
        told, tell = os.pipe()
        child = os.fork()  # beside threads of libraries: of locks that they hold, the end of the time is the end
    if child == 0:
        try:
            _behave(seconds, memory)
            work()
        except BaseException as error:
            os.write(tell, str(error).encode("utf-8", "replace")[:2000])  # less than a pipe holds
        else:
            os.write(tell, DONE)
        finally:
            os._exit(0)
    os.close(tell)
    with os.fdopen(told, "rb") as pipe:
        said = pipe.read()
    _, code = os.waitpid(child, 0)
    if os.WIFSIGNALED(code) and os.WTERMSIG(code) == signal.SIGALRM:
        return f"gmsh does not come to an end with it in {seconds:.0f} s"
    if code or not said:
        return "its numbers and counts cannot be right: gmsh crashes with it"
    return None if said == DONE else said.decode("utf-8", "replace")


def _behave(seconds: float, memory: float) -> None:
    """Leave this process no way to disturb another one, or to go on for ever."""
    for name in ("SEGV", "ABRT", "BUS", "FPE", "ILL", "ALRM", "TERM"):  # which libraries catch to print where they were
        signal.signal(signal.Signals[f"SIG{name}"], signal.SIG_DFL)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    with open("/proc/self/statm", encoding="ascii") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (int(now + memory), resource.getrlimit(resource.RLIMIT_AS)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.setitimer(signal.ITIMER_REAL, seconds)


#: gmsh's number of a kind of cells ↦ corners of a cell, and the kind of its edges. (Of second-order quadrilaterals
#: those with a node in the middle: dolfinx has no others.)
KINDS = {2: (3, 1), 9: (3, 8), 3: (4, 1), 10: (4, 8)}

#: The head of a mesh file: text, or binary with the integer 1 in either order of bytes. Version 2.0 gave the names of
#: groups no dimension. gmsh knows a mesh by its first characters alone, and runs what does not begin like one as a
#: script.
HEAD = re.compile(
    rb"\$MeshFormat(\r?\n)[ \t]*(?:2\.[12]|3|4|4\.[01])[ \t]+"
    rb"(?:0[ \t]+8[ \t]*\1|1[ \t]+8[ \t]*\1(?:\x01\0\0\0|\0\0\0\x01)(?:\1)?)\$EndMeshFormat\1"
)

#: Largest number of a node.
LARGEST_NUMBER = 10**8

#: What gmsh may need to read a file: seconds, one more for so many bytes of it, and bytes of memory.
SECONDS, BYTES_PER_SECOND, MEMORY = 20.0, 5e5, 1e9

#: Names of physical groups ↦ tag, by dimension.
Groups = dict[int, dict[str, int]]


def read(gmsh: Any, path: Path, surfaces: Sequence[str]) -> Groups:
    """Return the physical curves and surfaces of a file, of which gmsh then holds a model of the plate alone.

    The file is checked; the nodes of that model are numbered from 1.

    Args:
        gmsh: the module; it is initialised here.
        path: the file.
        surfaces: names of the physical surfaces that must make up the plate.

    Raises:
        BadMesh: the file is not the mesh of a plate.
    """
    if path.suffix != ".msh":
        raise BadMesh("must be a mesh file of gmsh, with the ending .msh")
    _check_head(path)
    size = path.stat().st_size
    # gmsh checks neither the counts in a file nor the numbers that it takes for indices.
    if (how := mishap(lambda: _load(gmsh, path), SECONDS + size / BYTES_PER_SECOND, MEMORY + 200 * size)) is not None:
        raise BadMesh(how)
    _load(gmsh, path)
    groups = _groups(gmsh)
    numbers, x, _ = gmsh.model.mesh.getNodes()
    if len(numbers) == 0:
        raise BadMesh("it holds no mesh")
    if groups[3] or len(gmsh.model.mesh.getElements(3)[0]):
        raise BadMesh("it holds cells of dimension 3; a plate is a mesh of triangles or quadrilaterals in a plane")
    _check_names(groups, surfaces)
    x = x.reshape(-1, 3)
    if numbers.max() > LARGEST_NUMBER:
        raise BadMesh(f"has a node of the number {numbers.max()}; numbers can be up to {LARGEST_NUMBER}")
    rows = np.full(int(numbers.max()) + 1, -1, dtype=np.int64)  # of x, by the number of a node in the file
    rows[numbers.astype(np.int64)] = np.arange(len(numbers))
    kind, found, nodes = _cells(gmsh, {name: groups[2][name] for name in surfaces}, rows)
    used = np.unique(np.concatenate([part.ravel() for part in nodes.values()]))
    _check_flat(x[used])
    corners = np.concatenate(list(nodes.values()))[:, : KINDS[kind][0]]
    cells = Cells(np.concatenate(list(found.values())), corners, x[:, :2])
    cells.check()
    curves = {name: _edges(gmsh, name, tag, KINDS[kind][1], rows) for name, tag in groups[1].items()}
    for name, edges in curves.items():
        cells.check_curve(name, edges, used)
    _check_apart(cells, curves)
    cells.check_held(curves["clamped"][:, :2])
    _replace(gmsh, x[used], {1: (KINDS[kind][1], curves), 2: (kind, nodes)}, used)
    return {1: _tags(curves), 2: _tags(nodes)}


def _check_head(path: Path) -> None:
    """Refuse what gmsh would not read as a mesh: a script would be run, with all that it asks of the system."""
    with path.open("rb") as file:
        head = file.read(512)
    if HEAD.match(head):
        return
    # A file that is none of ours may be a secret: nothing of it is shown.
    begins = "begins otherwise" if not head.startswith(b"$MeshFormat") else "has another format"
    raise BadMesh(
        f"is no mesh of gmsh: it {begins if head else 'is empty'}; must be $MeshFormat, without anything before, then "
        "version (2.1, 2.2, 3, 4, 4.0 or 4.1), file type (0 text, 1 binary) and data size (8), then $EndMeshFormat"
    )


def _load(gmsh: Any, path: Path) -> None:
    """Start gmsh, and load the file."""
    gmsh.initialize([], False, False, False)
    gmsh.option.setNumber("General.Terminal", 0)
    _merge(gmsh, path)


def _merge(gmsh: Any, path: Path) -> None:
    """Load the file under another name: gmsh runs a script "<name>.opt" that lies beside what it reads."""
    with TemporaryDirectory(prefix="rotfem-") as folder:
        link = Path(folder) / "plate.msh"
        link.symlink_to(path.resolve())
        try:
            gmsh.merge(str(link))
        except Exception as error:
            raise BadMesh(f"gmsh cannot read it: {str(error).replace(str(link), path.name)}") from None


def _groups(gmsh: Any) -> Groups:
    """Return the physical groups of the file; one without a name has its number."""
    groups: Groups = {0: {}, 1: {}, 2: {}, 3: {}}
    for dimension, tag in gmsh.model.getPhysicalGroups():
        try:
            name = gmsh.model.getPhysicalName(dimension, tag)
        except UnicodeDecodeError:
            raise BadMesh(f"the name of its physical group {tag} of dimension {dimension} is not UTF-8") from None
        groups[dimension][name or f"{tag}"] = tag
    return groups


def _check_names(groups: Groups, surfaces: Sequence[str]) -> None:
    if "clamped" not in groups[1]:
        raise BadMesh(f'has no physical curve "clamped" (physical curves: {_listed(groups[1])})')
    missing = [name for name in surfaces if name not in groups[2]]
    if missing:
        raise BadMesh(f'has no physical surface "{missing[0]}" (physical surfaces: {_listed(groups[2])})')
    others = [name for name in groups[2] if name not in surfaces]
    if others:
        raise BadMesh(
            f'its physical surface "{others[0]}" is not part of the plate; with several surfaces give '
            'structure.thickness as a table of all of them, and with one call it "plate"'
        )


def _listed(names: dict[str, int]) -> str:
    return ", ".join(f'"{name}"' for name in names) or "none"


def _elements(gmsh: Any, dimension: int, tag: int) -> list[tuple[int, npt.NDArray[Any], Integers]]:
    """Return (kind; numbers, (n,); nodes, (n, …)) of the elements of a physical group, entity by entity."""
    out = []
    for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag):
        for kind, numbers, nodes in zip(*gmsh.model.mesh.getElements(dimension, entity), strict=True):
            if len(numbers):
                out.append((int(kind), numbers, nodes.astype(np.int64).reshape(len(numbers), -1)))
    return out


def _called(gmsh: Any, kind: int) -> str:
    return f'"{gmsh.model.mesh.getElementProperties(kind)[0]}"'


def _cells(
    gmsh: Any, groups: dict[str, int], rows: Integers
) -> tuple[int, dict[str, npt.NDArray[Any]], dict[str, Integers]]:
    """Return the kind of the cells, and by surface their numbers in the file, (n,), and their nodes, (n, …)."""
    numbers, nodes, kinds = {}, {}, set()
    for name, tag in groups.items():
        parts = _elements(gmsh, 2, tag)
        if not parts:
            raise BadMesh(f'its physical surface "{name}" has no cells')
        kinds |= {kind for kind, _, _ in parts}
        if kinds - KINDS.keys():
            what = _called(gmsh, min(kinds - KINDS.keys()))
            raise BadMesh(f"has cells {what}; can be {' or '.join(_called(gmsh, kind) for kind in KINDS)}")
        if len(kinds) > 1:
            what = " and ".join(sorted(_called(gmsh, kind) for kind in kinds))
            raise BadMesh(f"mixes cells ({what}); all must be of one kind")
        numbers[name] = np.concatenate([part for _, part, _ in parts])
        nodes[name] = rows[np.concatenate([part for _, _, part in parts])]
    grouped = np.concatenate(list(numbers.values()))
    if len(np.unique(grouped)) < len(grouped):
        raise BadMesh("has cells that belong to two physical surfaces")
    others = sum(map(len, gmsh.model.mesh.getElements(2)[1])) - len(grouped)
    if others:
        raise BadMesh(
            f"has {others} cells in no physical surface; all must be in one, or left out of the file (Mesh.SaveAll=0)"
        )
    return kinds.pop(), numbers, nodes


def _edges(gmsh: Any, name: str, tag: int, kind: int, rows: Integers) -> Integers:
    """Return the nodes of the edges of a curve, the two ends first, (n, 2) or with a node between them (n, 3)."""
    parts = _elements(gmsh, 1, tag)
    if not parts:
        raise BadMesh(f'its physical curve "{name}" has no edges')
    others = [part for part, _, _ in parts if part != kind]
    if others:
        what = f"{_called(gmsh, others[0])}; those of its cells are {_called(gmsh, kind)}"
        raise BadMesh(f'its physical curve "{name}" has edges {what}')
    nodes = rows[np.concatenate([part for _, _, part in parts])]
    _, once = np.unique(np.sort(nodes[:, :2], axis=1), axis=0, return_index=True)
    return np.asarray(nodes[np.sort(once)])


def _check_flat(x: Array) -> None:
    """Refuse nodes outside the plane x_3 = 0."""
    if not np.all(np.abs(x) < 1e100):  # so that areas are numbers
        raise BadMesh("has nodes whose coordinates are not finite, or of no size")
    away = np.max(np.abs(x[:, 2]))
    if away > 1e-9 * np.max(np.ptp(x, axis=0)):
        raise BadMesh(f"it leaves the plane x₃ = 0 (by {away:.3g} m); a plate lies in it")


def _check_apart(cells: Cells, curves: dict[str, Integers]) -> None:
    """Refuse an edge of two curves: an edge has one tag."""
    names = list(curves)
    owner = np.concatenate([np.full(len(edges), i) for i, edges in enumerate(curves.values())])
    ends = np.concatenate([edges[:, :2] for edges in curves.values()])
    keys, first, count = np.unique(cells.key(ends), return_index=True, return_counts=True)
    if np.any(count > 1):
        bad = int(np.flatnonzero(count > 1)[0])
        both = " and ".join(f'"{names[i]}"' for i in owner[cells.key(ends) == keys[bad]])
        where = at(cells.x[ends[first[bad]]])
        raise BadMesh(f"its physical curves {both} share an edge at {where}; an edge can be in one only")


def _tags(parts: dict[str, Integers]) -> dict[str, int]:
    return {name: tag for tag, name in enumerate(parts, start=1)}


def _replace(gmsh: Any, x: Array, parts: dict[int, tuple[int, dict[str, Integers]]], used: Integers) -> None:
    """Put a model in the place of what was read: the nodes x, and curves and surfaces as one entity and group each.

    What else the file holds (nodes of no cell, gaps in the numbers, surfaces in no group) is no part of it.

    Args:
        gmsh: the module.
        x: the nodes, shape (m, 3), m.
        parts: dimension ↦ kind of the elements, and name ↦ nodes of the elements (n, …), as rows of the file.
        used: rows of x in the file, in increasing order.
    """
    gmsh.clear()
    gmsh.model.add("plate")
    for dimension, (_, groups) in parts.items():
        for name, tag in _tags(groups).items():
            gmsh.model.addDiscreteEntity(dimension, tag)
            gmsh.model.addPhysicalGroup(dimension, [tag], tag, name)
    mesh = gmsh.model.mesh
    mesh.addNodes(2, 1, np.arange(1, len(x) + 1), x.ravel())
    for kind, groups in parts.values():
        for name, tag in _tags(groups).items():
            mesh.addElementsByType(tag, kind, [], 1 + np.searchsorted(used, groups[name].ravel()))
