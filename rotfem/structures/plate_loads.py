"""What works on the surface of a plate, and along its edge "tip": pressure, and loads that are spread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl
from dolfinx import fem

from rotfem.errors import InputError
from rotfem.mechanics.bodies import AppliedLoad, Kinematics
from rotfem.mechanics.loads import AnyLoad
from rotfem.mechanics.mindlin import PlateGradients
from rotfem.numerics import forms
from rotfem.structures.points import Points
from rotfem.structures.structure import Structure


def plate_points(plate: Structure) -> Points:
    """Return the points of masses and loads of a plate.

    Raises:
        InputError: one is not on the plate.
    """
    masses = [row[:2] for row in plate.data.point_masses]
    applied = [point.x for point in plate.point_loads]
    points = Points(plate.mesh, [*masses, *applied])
    missing = points.missing
    if missing is None:
        return points
    why = f"({missing[0]:g}, {missing[1]:g}) is not on the plate"
    if missing in masses:
        raise InputError("structure.point_masses", list(plate.data.point_masses[masses.index(missing)]), why)
    raise InputError(f"loads.at.{applied.index(missing)}.x", list(missing), why)


def pressure(plate: Structure, load: AnyLoad) -> list[AppliedLoad]:
    """Return the pressure p on the surface: p a_3 if dead, p r,1 × r,2 per undeformed area if follower."""
    r = PlateGradients(plate.k.q).dr
    p, dead = plate.amplitude("pressure", load, 1)[0], load.kind == "dead"
    normal = ufl.as_vector((0, 0, 1)) if dead else ufl.cross(r[:, 0], r[:, 1])
    return [AppliedLoad("pressure", p * normal, plate.position(plate.k.q), plate.dx, dead)]


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
