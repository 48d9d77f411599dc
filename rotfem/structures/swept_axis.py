"""The undeformed axis of a swept or curved beam: its angle, and where it runs."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from rotfem.structures.beam import Beam
from rotfem.structures.structure import Array

#: Degree of the polynomials the axis of an arc is held in; strains see its exact angle, only inertia sees these.
AXIS_DEGREE = 5


def swept_axis(beam: Beam, sweep: Any) -> tuple[Any, Any, Any]:
    """Return (χ, ∫ cos χ dX, ∫ sin χ dX) of a sweep profile: angle (rad) and position of the axis (m) over X.

    Args:
        beam: the discretised beam; kinks and ends of arcs are its nodes.
        sweep: a number, or rows (x, angle) between which the axis is an arc and, where one x stands twice, kinked.
    """
    if not isinstance(sweep, tuple):
        chi = beam.scalar("sweep", sweep)
        X = ufl.SpatialCoordinate(beam.mesh)[0]
        return chi, X * ufl.cos(chi), X * ufl.sin(chi)
    rows = np.array(sweep)
    angle = fem.Function(fem.functionspace(beam.mesh, ("DG", 1)), name="sweep")
    space = angle.function_space
    x = space.tabulate_dof_coordinates()[:, 0]
    for cell in range(len(space.dofmap.list)):
        dofs = space.dofmap.cell_dofs(cell)
        middle = x[dofs].mean()
        row = int(np.searchsorted(rows[:, 0], middle)) - 1
        (a, first), (b, last) = rows[row], rows[row + 1]
        angle.x.array[dofs] = first + (last - first) * (x[dofs] - a) / (b - a)
    position = fem.functionspace(beam.mesh, ("Lagrange", AXIS_DEGREE))
    along, across = fem.Function(position, name="along"), fem.Function(position, name="across")
    along.interpolate(lambda p: path(rows, p[0])[0])
    across.interpolate(lambda p: path(rows, p[0])[1])
    return angle, along, across


def path(rows: Array, x: Array) -> tuple[Array, Array]:
    """Return (∫ cos χ, ∫ sin χ) from 0 to x (m) for the angle χ of rows (x, angle); exact, arc by arc."""
    out = np.zeros((2, len(x)))
    for (a, first), (b, last) in pairwise(rows):
        if b == a:
            continue
        s = np.clip(x, a, b) - a
        curvature = (last - first) / (b - a)
        half = 0.5 * curvature * s
        chord = s * np.sinc(half / np.pi)  # 2 sin(κs/2)/κ
        out += chord * np.array([np.cos(first + half), np.sin(first + half)])
    return out[0], out[1]
