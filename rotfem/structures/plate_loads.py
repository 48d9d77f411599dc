"""What works on a plate at a point or along an edge: the measure of a point, a moment spread over an edge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import geometry

from rotfem.mechanics.bodies import AppliedLoad, Kinematics

#: Distance from a cell, relative to the size of the mesh, at which a point still counts as in it.
NEAR = 1e-9


@dataclass(frozen=True)
class PointPlace:
    """Where a point lies: the cell that holds it (on one rank, none on the others), and its reference coordinates."""

    cells: npt.NDArray[np.int32]
    reference: npt.NDArray[np.float64]


def locate(domain: Any, point: tuple[float, float]) -> PointPlace | None:
    """Return the place of a point (m) in a mesh; None if it is not in it."""
    comm, tdim = domain.comm, domain.topology.dim
    owned = domain.topology.index_map(tdim).size_local
    x = np.array([[*point, 0.0]])
    spread = NEAR * float(np.max(np.ptp(domain.geometry.x, axis=0), initial=0.0))
    tree = geometry.bb_tree(domain, tdim, padding=spread)
    candidates = geometry.compute_collisions_points(tree, x)
    hits = geometry.compute_colliding_cells(domain, candidates, x).links(0)
    mine = [int(c) for c in hits if c < owned]
    first = comm.allreduce((not mine, comm.rank), op=_least)
    if first[0]:
        return None
    cells: npt.NDArray[np.int32] = np.empty(0, dtype=np.int32)
    where: npt.NDArray[np.float64] | None = None
    if comm.rank == first[1]:
        cells = np.array(mine[:1], dtype=np.int32)
        corners = domain.geometry.x[domain.geometry.dofmap[cells[0]]]
        where = domain.geometry.cmap.pull_back(x[:, :tdim], corners[:, :tdim])
    where = comm.bcast(where, root=first[1])
    return PointPlace(cells, where)


def point_measure(domain: Any, subdomains: Any, tag: int, place: PointPlace) -> Any:
    """Return a measure whose integrals are values at a point.

    The cell that holds it gets a quadrature rule of one point with the weight 1 in place of the cell's area.

    Args:
        domain: the mesh.
        subdomains: list of (tag, cells), the same for all measures of a form.
        tag: the point's tag there.
        place: its place.
    """
    rule = {
        "quadrature_rule": "custom",
        "quadrature_points": place.reference,
        "quadrature_weights": np.ones(1),
        "digits": repr(place.reference.tolist()),  # forms are told apart by text, which cuts an array short
    }
    measure = ufl.Measure("dx", domain=domain, subdomain_data=subdomains, subdomain_id=tag, metadata=rule)
    return _AtPoint(measure, 1 / abs(ufl.JacobianDeterminant(domain)))


def _least(a: tuple[bool, int], b: tuple[bool, int]) -> tuple[bool, int]:
    return min(a, b)


@dataclass(frozen=True)
class _AtPoint:
    """A cell measure whose factor |det J| is taken out again."""

    measure: Any
    factor: Any

    def __rmul__(self, integrand: Any) -> Any:
        return (integrand * self.factor) * self.measure


@dataclass(frozen=True, kw_only=True)
class EdgeMoment(AppliedLoad):
    """A moment per length on the directors of an edge (N, frame components): it works on t×δt.

    Its part along t, about which a director has no rotation, does no work. With x = (alpha_2, −alpha_1, 0) the
    potential −M·x, if it is dead, is right as long as the plate bends about one direction.
    """

    director: Any

    def variation(self, k: Kinematics) -> Any:
        """Return t×δt."""
        return ufl.cross(self.director, k.variation(self.director))

    def rigid_turn(self, e: Any) -> Any:
        """Return the turn in a unit rigid turn about e, without its part along t."""
        return e - ufl.dot(e, self.director) * self.director
