"""The undeformed axis along a reference line in space, as fields on the mesh of a beam."""

from __future__ import annotations

from typing import Any

import numpy as np
from basix.ufl import element
from dolfinx import fem

from rotfem.structures.beam import Beam
from rotfem.structures.swept_axis import AXIS_DEGREE


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
