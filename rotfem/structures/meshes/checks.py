"""What a set of triangles or quadrilaterals must be to make a plate: cells of area, joined at edges, and held."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Part of the mean area below which a cell counts as having none; part of the size by which nodes may leave the plane.
NO_AREA, FLAT = 1e-10, 1e-9


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
        bad = np.flatnonzero(area <= NO_AREA * mean) if mean > 0 else np.arange(len(area))
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
        keys, cells, first, count = self._edges
        a, b = self._pairs()
        size = len(self.corners)
        graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(size, size))
        parts, part = connected_components(graph, directed=False)
        edges = np.searchsorted(keys, self.key(clamp))
        held = np.zeros(parts, dtype=bool)
        held[part[cells[first[edges]]]] = True
        held[part[cells[first[edges] + count[edges] - 1]]] = True
        loose = np.flatnonzero(~held[part])
        if not len(loose):
            return
        x = self.x[self.corners[part == part[loose[0]]]].reshape(-1, 2)
        low, high = x.min(axis=0), x.max(axis=0)
        several = parts - int(held.sum())
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
