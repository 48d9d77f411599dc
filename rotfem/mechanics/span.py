"""How a load is spread over a structure: shapes over the span, each of them with an amplitude over time.

f(x, t) = Σ_k a_k(t) s_k(x): a table over the span has one shape and an amplitude of 1, one over span and time as many
shapes as stations and components, linear between stations, a harmonic its shape with the amplitude cos(ω t + φ). So a
linear theory assembles one piece for every shape. A function of place and time has the nodes of a mesh for stations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Shapes:
    """Some shapes with common stations: linear between them, nothing outside.

    Attributes:
        x: stations along the span (m), increasing; one that stands twice is a jump. None: the same everywhere.
        values: of the shapes there, (shapes, stations, components); (shapes, 1, components) where there are none.
        region: name of the only region of the mesh where they are; "" everywhere.
    """

    x: Array | None
    values: Array
    region: str = ""

    def along(self, x: Array, towards: Array) -> Array:
        """Return the shapes at places (n,), (shapes, n, components).

        Args:
            x: places along the span, m.
            towards: places on that side of them from which they are looked at, as the middles of their cells.
        """
        if self.x is None:
            return np.repeat(self.values, len(x), axis=1)
        side = x + 1e-6 * (towards - x)
        i = np.searchsorted(self.x, side, side="right") - 1
        there = (i >= 0) & (side <= self.x[-1])
        i = np.clip(i, 0, len(self.x) - 2)
        share = (x - self.x[i]) / np.where(self.x[i + 1] > self.x[i], self.x[i + 1] - self.x[i], 1.0)
        share = np.where(there, share, 0.0)[:, None]
        found = (1.0 - share) * self.values[:, i] + share * self.values[:, i + 1]
        return np.where(there[:, None], found, 0.0)


class Span(Protocol):
    """What the structure makes fields of."""

    @property
    def stations(self) -> tuple[float, ...]:
        """Places along the span (m) at which the load has kinks or jumps, which are nodes of the mesh."""

    @property
    def shapes(self) -> Sequence[Shapes] | None:
        """The shapes that the load's amplitudes belong to; None of a function of place."""

    def over(self, points: Array) -> Callable[[float], Array]:
        """Return t (s) ↦ components of a function of place at points (n, 3) in m, one after the other."""


@dataclass(frozen=True)
class ShapedSpan:
    """A span with shapes."""

    shapes: tuple[Shapes, ...]

    @property
    def stations(self) -> tuple[float, ...]:
        """Stations of all shapes, m."""
        return tuple(sorted({float(x) for s in self.shapes if s.x is not None for x in s.x}))

    def over(self, points: Array) -> Callable[[float], Array]:
        """Raise: shapes are not asked for values."""
        raise TypeError("a load with shapes is no function of place")


@dataclass(frozen=True)
class FunctionOfPlace:
    """A span given by a function.

    Attributes:
        function: (place, t) ↦ components; place is x (m) along a beam, (x, y) on a plate; shape (components,).
        plate: whether places have two coordinates.
    """

    function: Callable[[Any, float], Array]
    plate: bool
    shapes: None = None
    stations: tuple[float, ...] = ()

    def over(self, points: Array) -> Callable[[float], Array]:
        """Return t (s) ↦ components at points (n, 3) in m, one after the other."""
        places = [(float(p[0]), float(p[1])) if self.plate else float(p[0]) for p in points]
        return lambda t: np.concatenate([self.function(place, t) for place in places])
