"""From the axes of blade files to those of a spatial beam (docs/blades.md), and matrices from properties at centres."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.scene.reference_line import ReferenceLine, as_line, line_through
from rotfem.scene.values import Array

#: Components along our axes 1, 2, 3 from those along x (flapwise, downwind), y (to the trailing edge), z (to the tip)
#: of IEC 61400-13 and OpenFAST.
FROM_IEC = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])

#: The same from x (to the leading edge), y (downwind, suction side), z (to the tip) of HAWC2.
FROM_HAWC2 = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def turned_matrix(matrix: npt.ArrayLike, axes: Array) -> Array:
    """Return a 6×6 matrix along our axes; axes (3, 3) gives components along ours from those of the file."""
    both = np.kron(np.eye(2), axes)
    return np.asarray(both @ np.asarray(matrix) @ both.T)


def scaled_rows(x: npt.ArrayLike, length: float, values: npt.ArrayLike) -> list[list[Any]]:
    """Return the table [[x, value], …] of values over fractions of the length, ended by the length exactly."""
    places = np.asarray(x, dtype=float) * length
    places[-1] = length
    return rows_over(places, values)


def rows_over(x: npt.ArrayLike, values: npt.ArrayLike) -> list[list[Any]]:
    """Return the table [[x, value], …] of places (m) and values there, numbers, points or matrices."""
    return [[float(place), value.tolist()] for place, value in zip(np.asarray(x), np.asarray(values), strict=True)]


def iec_pretwist(tangent: Array, twist: Array) -> Array:
    """Return the pretwist (n,), rad, of a twist (n,) about −z from axes whose x has no part along y, as in BeamDyn.

    It is −twist, and the angle about the tangents (n, 3) from our axis 3 without twist to that x.
    """
    t_2 = np.cross([0.0, 0.0, 1.0], tangent)
    t_2 /= np.linalg.norm(t_2, axis=1)[:, None]
    t_3 = np.cross(tangent, t_2)
    x = np.cross([0.0, -1.0, 0.0], tangent)  # across our axis 2, which is −y
    x /= np.linalg.norm(x, axis=1)[:, None]
    between = np.arctan2(-np.sum(x * t_2, axis=1), np.sum(x * t_3, axis=1))
    return np.asarray(between - np.unwrap(twist))


def coned_root(radius: float, precone: float) -> dict[str, Any]:
    """Return the keys of a hub radius along the coned axis (m) and a precone (rad, towards axis 3)."""
    if precone == 0.0:
        return {"hub_radius": radius}
    offset = [radius * float(np.cos(precone)), 0.0, radius * float(np.sin(precone))]
    return {"hub_offset": offset, "precone": precone}


def line_of(points: npt.ArrayLike) -> tuple[list[Any], ReferenceLine, Array]:
    """Return the rows of a line through points (m) from its first one, the line itself and its arc lengths there."""
    rows = (np.asarray(points) - np.asarray(points)[0]).tolist()
    through = line_through(as_line(rows))
    return rows, through, np.array([0.0, *through.knots, through.length])
