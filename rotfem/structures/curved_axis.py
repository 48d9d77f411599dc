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

    Angles are discontinuous, so that they jump at kinks; between points of the line they are right to their degree, and
    the axes that are made of them are unit vectors across each other everywhere.

    Args:
        beam: the discretised beam; points of the line are its nodes.
        line: `at(x, near)` and `angles(x, near)` over the arc length (m).
    """
    cell = beam.mesh.basix_cell()
    both = fem.Function(fem.functionspace(beam.mesh, element("DG", cell, AXIS_DEGREE, shape=(2,))), name="angles")
    space = both.function_space
    x, cells = space.tabulate_dof_coordinates()[:, 0], space.dofmap.list
    middle = x[cells].mean(axis=1)
    near = np.repeat(middle, cells.shape[1])
    values = np.stack(line.angles(x[cells].ravel(), near), axis=-1)
    both.x.array.reshape(-1, 2)[cells.ravel()] = values
    r = fem.Function(fem.functionspace(beam.mesh, element("Lagrange", cell, AXIS_DEGREE, shape=(3,))), name="line")
    r.interpolate(lambda p: line.at(p[0])[0].T)
    return both[0], both[1], r
