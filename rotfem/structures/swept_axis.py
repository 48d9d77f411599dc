"""The undeformed axis of a swept or curved beam: its angle, and where it runs."""

from __future__ import annotations

from typing import Any

import ufl
from dolfinx import fem

from rotfem.structures.beam import Beam

#: Degree of the polynomials the axis of an arc is held in; strains see its exact angle, only inertia sees these.
AXIS_DEGREE = 5


def swept_axis(beam: Beam, sweep: Any, line: Any) -> tuple[Any, Any, Any]:
    """Return (χ, ∫ cos χ dX, ∫ sin χ dX) of a sweep profile: angle (rad) and position of the axis (m) over X.

    Args:
        beam: the discretised beam; kinks and ends of arcs are its nodes.
        sweep: a number, or rows (x, angle) between which the axis is an arc and, where one x stands twice, kinked.
        line: the same as `at(x, near)` and `angles(x, near)` over the arc length (m).
    """
    if not isinstance(sweep, tuple):
        chi = beam.scalar("sweep", sweep)
        X = ufl.SpatialCoordinate(beam.mesh)[0]
        return chi, X * ufl.cos(chi), X * ufl.sin(chi)
    angle = beam.field("sweep", lambda x, near: line.angles(x, near)[0], 1)
    position = fem.functionspace(beam.mesh, ("Lagrange", AXIS_DEGREE))
    along, across = fem.Function(position, name="along"), fem.Function(position, name="across")
    along.interpolate(lambda p: line.at(p[0])[0][:, 0])
    across.interpolate(lambda p: line.at(p[0])[0][:, 1])
    return angle, along, across
