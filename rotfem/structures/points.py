"""Points of a structure: where they lie in its mesh, and measures whose integrals are values there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import geometry


def locate(domain: Any, point: Sequence[float]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]] | None:
    """Return the cell that holds a point (m), on one rank, and its reference coordinates; None if none does."""
    comm, tdim = domain.comm, domain.topology.dim
    owned = domain.topology.index_map(tdim).size_local
    x, nodes = np.array([(*point, 0.0, 0.0)[:3]]), domain.geometry.x
    spread = 1e-9 * float(np.ptp(nodes, axis=0).max()) if len(nodes) else 0.0
    tree = geometry.bb_tree(domain, tdim, padding=spread)
    candidates = geometry.compute_collisions_points(tree, x)
    hits = geometry.compute_colliding_cells(domain, candidates, x).links(0)
    middles = ((float(nodes[domain.geometry.dofmap[c], 0].mean()), int(c)) for c in hits if c < owned)
    middle, mine = min(middles, default=(np.inf, -1))  # of cells that share it that before it: see `couplings`
    first, owner = min(comm.allgather((middle, comm.rank)))
    if first == np.inf:
        return None
    cells: npt.NDArray[np.int32] = np.empty(0, dtype=np.int32)
    where: Any = None
    if comm.rank == owner:
        cells = np.array([mine], dtype=np.int32)
        corners = domain.geometry.x[domain.geometry.dofmap[cells[0]]]
        where = domain.geometry.cmap.pull_back(x[:, :tdim], corners[:, :tdim])
        if tdim == 1:  # a node, and all nodes are to have one form
            where = np.round(where, 9) + 0.0
    where = comm.bcast(where, root=owner)
    return cells, where


class Points:
    """Points of a mesh (m), each with a measure; a point may be there twice.

    Attributes:
        subdomains: what the cell measures of all forms have, list of (tag, cells); None without points.
        missing: the first point that is not in the mesh, None if all are.
    """

    def __init__(self, domain: Any, points: Sequence[Sequence[float]]):
        self._domain, self._places = domain, dict[tuple[float, ...], Any]()
        self.missing: tuple[float, ...] | None = None
        for point in map(tuple, points):
            place = self._places.get(point) or locate(domain, point)
            if place is None:
                self.missing = point
                break
            self._places[point] = place
        self.subdomains = [(i, cells) for i, (cells, _) in enumerate(self._places.values(), start=1)] or None

    def measure(self, point: Sequence[float]) -> Any:
        """Return a measure whose integrals are values at one of the points: a rule of one point of weight 1."""
        place = tuple(point)
        rule = {
            "quadrature_rule": "custom",
            "quadrature_points": self._places[place][1].view(_Digits),
            "quadrature_weights": np.ones(1).view(_Digits),
        }
        tag = 1 + list(self._places).index(place)
        dx = ufl.Measure("dx", domain=self._domain, subdomain_data=self.subdomains, subdomain_id=tag, metadata=rule)
        return _AtPoint(dx, 1 / abs(ufl.JacobianDeterminant(self._domain)))


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
