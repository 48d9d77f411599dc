"""The undeformed axis along a reference line in space, as fields on the mesh of a beam."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from basix.ufl import element
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


def curved_axis(beam: Beam, line: Any) -> tuple[Any, Any, Any]:
    """Return (χ, ζ, r): angles of the tangent (rad, see `rotfem.scene.reference_line`) and position (m) over X.

    Angles are discontinuous, so that they jump at kinks. Where no point of the line lies inside an element they are
    right to their degree. The axes that are made of them are unit vectors across each other everywhere.

    Args:
        beam: the discretised beam; kinks of the line are its nodes.
        line: `at(x, near)` and `angles(x, near)` over the arc length (m).
    """
    both = beam.field("angles", lambda x, near: np.stack(line.angles(x, near), axis=-1), AXIS_DEGREE, 2)
    space = element("Lagrange", beam.mesh.basix_cell(), AXIS_DEGREE, shape=(3,))
    r = fem.Function(fem.functionspace(beam.mesh, space), name="line")
    r.interpolate(lambda p: line.at(p[0])[0].T)
    return both[0], both[1], r
