"""What works on a plate at a point or along an edge: the measure of a point, loads spread over the edge "tip"."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, geometry

from rotfem.mechanics.bodies import AppliedLoad, Kinematics
from rotfem.mechanics.mindlin import PlateGradients
from rotfem.numerics import forms
from rotfem.structures.structure import Structure

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


class TipEdge:
    """The edge "tip" of a plate, along which the loads of the tip are spread.

    Args:
        plate: the discretised plate; its `tip` is the measure of the edge.
    """

    def __init__(self, plate: Structure):
        self._plate = plate

    def spread(self, load: Any) -> Any:
        """Return a load over the length of the edge."""
        scalars = self._plate.scalars
        if "tip_length" not in scalars:
            self._plate.scalar("tip_length", self._length())
        return load / scalars["tip_length"]

    def moment(self, m: Any, dead: bool, director: Any) -> list[AppliedLoad]:
        """Return what a moment is on the edge: one on its directors, and a couple of forces in the plane.

        A director has no rotation about itself: the third component of the moment is the couple, e_3×(X − X_c) in
        direction and growing with the distance from the middle X_c of the edge.

        Args:
            m: components of the moment, N·m.
            dead: whether its direction does not depend on q.
            director: the unit director t(q).
        """
        plate, q = self._plate, self._plate.k.q
        tilting, alpha = ufl.as_vector((m[0], m[1], 0)), PlateGradients(q).alpha
        density = self.spread(tilting if dead else plate.turned(q, tilting))
        if plate.turns is not None and plate.turns.before is not None:
            alpha = alpha + PlateGradients(plate.turns.before).alpha
        about = ufl.as_vector((alpha[1], -alpha[0], 0))
        couple = m[2] * self._couple()
        force = couple if dead else plate.turned(q, couple)
        return [
            EdgeMoment("tip_moment", density, about, plate.tip, dead, director=director),
            AppliedLoad("tip_moment", force, plate.position(q), plate.tip, dead),
        ]

    def _couple(self) -> Any:
        """Return the forces along the edge (per length, in the plane) that make a couple of one."""
        plate, x = self._plate, ufl.SpatialCoordinate(self._plate.mesh)
        length = self._length()
        middle = [self._integral(x[i]) / length for i in range(2)]
        arm = ufl.as_vector([x[i] - plate.scalar(f"tip_middle_{i + 1}", middle[i]) for i in range(2)])
        inertia = plate.scalar("tip_inertia", self._integral(ufl.dot(arm, arm)))
        return ufl.as_vector((-arm[1], arm[0], 0)) / inertia

    def _length(self) -> float:
        """Return the length of the edge, m."""
        return self._integral(self._plate.constant(1.0))

    def _integral(self, density: Any) -> float:
        """Return the integral of a density over the edge."""
        here = float(fem.assemble_scalar(forms.form(density * self._plate.tip)))
        return float(self._plate.comm.allreduce(here))
