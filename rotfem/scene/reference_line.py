"""The reference line of a beam through points in space: where it runs, and its direction, over its arc length."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.scene.table import problem
from rotfem.scene.values import Array, Matrix

#: Gauss points for the arc length between two points: the speed along a cubic is smooth there.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(12)


def as_line(rows: Matrix) -> Matrix:
    """Return points (x, y, z) in m of a line from the clamp (0, 0, 0), two equal rows a kink; refuse others."""
    if len(set(rows)) < 2 or rows[0] == rows[1] or rows[-1] == rows[-2]:
        raise problem("", None, "must be points [[x, y, z], …], at least two, and no kink at an end")
    if rows[0] != (0.0, 0.0, 0.0):
        raise problem("", list(rows[0]), "the line must start at the clamp, [0, 0, 0]; hub_offset says where that is")
    line = ReferenceLine(rows)
    along = np.linspace(0.0, line.length, 8 * len(rows) + 1)
    if np.max(np.abs(line.at(along)[1][:, 2])) > 1 - 1e-6:
        reason = "runs along direction 3 somewhere, which leaves section axis 2 no direction; choose other axes"
        raise problem("", None, f"the line {reason}")
    return rows


@lru_cache(maxsize=16)
def line_through(rows: Matrix) -> ReferenceLine:
    """Return the line through points that `as_line` has read."""
    return ReferenceLine(rows)


@dataclass(frozen=True)
class ReferenceLine:
    """Cubic splines (not-a-knot) through points, one from kink to kink.

    Attributes:
        rows: the points (m); two equal rows are a kink.
    """

    rows: Matrix

    @cached_property
    def _pieces(self) -> list[tuple[float, Any]]:
        """Arc length at which each spline starts (m), and the spline over the lengths of the chords."""
        from scipy.interpolate import CubicSpline

        cuts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(self.rows)) if a == b), len(self.rows)]
        out, start = [], 0.0
        for first, last in pairwise(cuts):
            points = np.array(self.rows[first:last])
            chords = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
            spline = CubicSpline(chords, points)
            out.append((start, spline))
            start += float(np.sum(_lengths(spline)))
        return out

    @cached_property
    def length(self) -> float:
        """Arc length (m)."""
        start, spline = self._pieces[-1]
        return start + float(np.sum(_lengths(spline)))

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """Arc lengths of the kinks (m)."""
        return tuple(start for start, _ in self._pieces[1:])

    @cached_property
    def knots(self) -> tuple[float, ...]:
        """Arc lengths of all points between the ends (m)."""
        places = [start + np.cumsum(np.concatenate([[0.0], _lengths(spline)])) for start, spline in self._pieces]
        inner = np.unique(np.concatenate([p[:-1] for p in places]))
        return tuple(inner[1:].tolist())

    def at(self, x: npt.ArrayLike, near: npt.ArrayLike | None = None) -> tuple[Array, Array]:
        """Return (position in m, unit tangent), each (n, 3), at arc lengths x (n,) in m."""
        x = np.clip(np.atleast_1d(np.asarray(x, dtype=np.float64)), 0.0, self.length)
        side = x if near is None else np.atleast_1d(np.asarray(near, dtype=np.float64))
        piece = np.searchsorted(self.kinks, side, side="right")
        position, tangent = np.empty((len(x), 3)), np.empty((len(x), 3))
        for number, (start, spline) in enumerate(self._pieces):
            here = piece == number
            u = _places(spline, x[here] - start)
            rate = spline(u, 1)
            position[here], tangent[here] = spline(u), rate / np.linalg.norm(rate, axis=1)[:, None]
        return position, tangent

    def angles(self, x: npt.ArrayLike, near: npt.ArrayLike | None = None) -> tuple[Array, Array]:
        """Return (sweep χ, bend ζ), each (n,) in rad: t₁ = cos ζ (cos χ e₁ + sin χ e₂) + sin ζ e₃."""
        t = self.at(x, near)[1]
        return np.arctan2(t[:, 1], t[:, 0]), np.arcsin(np.clip(t[:, 2], -1.0, 1.0))


@dataclass(frozen=True)
class SweptLine:
    """A line in the plane (1, 2) by its angle: arcs between rows (x, angle), kinks where one x stands in two.

    Attributes:
        rows: arc length (m) and angle (rad).
    """

    rows: Matrix

    @cached_property
    def knots(self) -> tuple[float, ...]:
        """Arc lengths of all rows between the ends (m)."""
        return tuple(sorted({x for x, _ in self.rows[1:-1]}))

    @property
    def kinks(self) -> tuple[float, ...]:
        """The same: curvature jumps there."""
        return self.knots

    def at(self, x: npt.ArrayLike, near: npt.ArrayLike | None = None) -> tuple[Array, Array]:
        """Return (position in m, unit tangent), each (n, 3), at arc lengths x (n,), exact, arc by arc."""
        places = np.atleast_1d(np.asarray(x, dtype=np.float64))
        position = np.zeros((len(places), 3))
        for (a, first), (b, last) in pairwise(self.rows):
            if b == a:
                continue
            s = np.clip(places, a, b) - a
            curvature = (last - first) / (b - a)
            half = 0.5 * curvature * s
            chord = s * np.sinc(half / np.pi)  # 2 sin(κs/2)/κ
            position[:, 0] += chord * np.cos(first + half)
            position[:, 1] += chord * np.sin(first + half)
        chi = self.angles(places, near)[0]
        return position, np.stack([np.cos(chi), np.sin(chi), np.zeros(len(places))], axis=-1)

    def angles(self, x: npt.ArrayLike, near: npt.ArrayLike | None = None) -> tuple[Array, Array]:
        """Return (sweep χ, bend ζ = 0), each (n,) in rad."""
        places = np.atleast_1d(np.asarray(x, dtype=np.float64))
        side = places if near is None else np.atleast_1d(np.asarray(near, dtype=np.float64))
        rows = np.array(self.rows)
        row = np.clip(np.searchsorted(rows[:, 0], side, side="right") - 1, 0, len(rows) - 2)
        (a, first), (b, last) = rows[row].T, rows[row + 1].T
        span = np.where(b > a, b - a, 1.0)
        return first + (last - first) * (places - a) / span, np.zeros(len(places))


def _lengths(spline: Any) -> Array:
    """Return the arc length of each part between two points (m)."""
    return _arcs(spline, spline.x[:-1], spline.x[1:])


def _arcs(spline: Any, a: Array, b: Array) -> Array:
    """Return ∫ |r'| from a to b, arrays (n,) with no point strictly between."""
    half = (b - a) / 2
    speeds = np.linalg.norm(spline(((a + b) / 2)[:, None] + half[:, None] * POINTS, 1), axis=-1)
    return np.asarray(half * (speeds @ WEIGHTS))


def _places(spline: Any, s: Array) -> Array:
    """Return the parameters of a spline at arc lengths s (n,) from its start, by Newton's method."""
    knots = np.concatenate([[0.0], np.cumsum(_lengths(spline))])
    part = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
    a, b = spline.x[part], spline.x[part + 1]
    u = a + (b - a) * (s - knots[part]) / (knots[part + 1] - knots[part])
    for _ in range(8):  # the digits double with each
        u = np.clip(u - (_arcs(spline, a, u) - (s - knots[part])) / np.linalg.norm(spline(u, 1), axis=-1), a, b)
    return np.asarray(u)
