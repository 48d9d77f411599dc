"""Points of a structure: where they lie in its mesh, and measures whose integrals are values there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import geometry


@dataclass(frozen=True)
class PointPlace:
    """Where a point lies: the cell that holds it (on one rank, none on the others), and its reference coordinates."""

    cells: npt.NDArray[np.int32]
    reference: npt.NDArray[np.float64]


def locate(domain: Any, point: Sequence[float]) -> PointPlace | None:
    """Return the place of a point (m) in a mesh; None if it is not in it."""
    comm, tdim = domain.comm, domain.topology.dim
    owned = domain.topology.index_map(tdim).size_local
    x = np.array([(*point, 0.0, 0.0)[:3]])
    spread = 1e-9 * float(np.max(np.ptp(domain.geometry.x, axis=0), initial=0.0))
    tree = geometry.bb_tree(domain, tdim, padding=spread)
    candidates = geometry.compute_collisions_points(tree, x)
    hits = geometry.compute_colliding_cells(domain, candidates, x).links(0)
    mine = [int(c) for c in hits if c < owned]
    nowhere, owner = min(comm.allgather((not mine, comm.rank)))
    if nowhere:
        return None
    cells: npt.NDArray[np.int32] = np.empty(0, dtype=np.int32)
    where: npt.NDArray[np.float64] | None = None
    if comm.rank == owner:
        cells = np.array(mine[:1], dtype=np.int32)
        corners = domain.geometry.x[domain.geometry.dofmap[cells[0]]]
        where = domain.geometry.cmap.pull_back(x[:, :tdim], corners[:, :tdim])
        if tdim == 1:  # a node, and all nodes are to have one form
            where = np.round(where, 9) + 0.0
    where = comm.bcast(where, root=owner)
    return PointPlace(cells, where)


def point_measure(domain: Any, subdomains: Any, tag: int, place: PointPlace) -> Any:
    """Return a measure whose integrals are values at a point.

    The cell that holds it gets a quadrature rule of one point with the weight 1 in place of the cell's area.
    """
    rule = {
        "quadrature_rule": "custom",
        "quadrature_points": place.reference.view(_Digits),
        "quadrature_weights": np.ones(1).view(_Digits),
    }
    measure = ufl.Measure("dx", domain=domain, subdomain_data=subdomains, subdomain_id=tag, metadata=rule)
    return _AtPoint(measure, 1 / abs(ufl.JacobianDeterminant(domain)))


class Points:
    """Points of a mesh (m), each with a measure; a point may be there twice.

    Attributes:
        subdomains: what the cell measures of all forms have, list of (tag, cells); None without points.
        missing: the first point that is not in the mesh, None if all are.
    """

    def __init__(self, domain: Any, points: Sequence[Sequence[float]]):
        self._domain, self._tags = domain, dict[tuple[float, ...], int]()
        self._places: list[PointPlace] = []
        self.missing: tuple[float, ...] | None = None
        for point in map(tuple, points):
            if point in self._tags:
                continue
            place = locate(domain, point)
            if place is None:
                self.missing = point
                break
            self._places.append(place)
            self._tags[point] = len(self._places)
        self.subdomains = [(i, place.cells) for i, place in enumerate(self._places, start=1)] or None

    def measure(self, point: Sequence[float]) -> Any:
        """Return the measure of one of the points."""
        tag = self._tags[tuple(point)]
        return point_measure(self._domain, self.subdomains, tag, self._places[tag - 1])


class _Digits(np.ndarray):  # type: ignore[type-arg]
    """An array by all digits of which UFL distinguishes forms; the text of one that is long is cut short."""

    @property
    def ufl_signature(self) -> str:
        """All digits."""
        return repr(self.tolist())


@dataclass(frozen=True)
class _AtPoint:
    """A cell measure whose factor |det J| is taken out again."""

    measure: Any
    factor: Any

    def __rmul__(self, integrand: Any) -> Any:
        return (integrand * self.factor) * self.measure
