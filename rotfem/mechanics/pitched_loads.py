"""Dead loads on a blade that pitches: they keep their direction in the frame of the hub, and turn in that of the blade.

With φ, e of `rotfem.mechanics.pitch`, a vector f of the hub's frame has the components there

    Rᵀ f = e (e·f) + cos φ (f − e (e·f)) − sin φ e×f,

three linear maps of f with amplitudes 1, cos φ and −sin φ. So a load over the span is one of three times the shapes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.loads import Load, Loads, named, replaced
from rotfem.mechanics.pitch import Pitch
from rotfem.mechanics.span import ShapedSpan, Shapes, Span

Array = npt.NDArray[np.float64]


def pitched(loads: Loads, pitch: Pitch | None) -> Loads:
    """Return loads in the frame of a blade that pitches; the same without a pitch over time. Followers turn with it."""
    if pitch is None:
        return loads
    turning = {name: load for name, load in named(loads).items() if load.kind == "dead" and not load.is_zero}
    return replaced(loads, {name: PitchedLoad(load, pitch) for name, load in turning.items()})


def maps(axis: Array) -> tuple[Array, Array, Array]:
    """Return the three maps, (3, 3)."""
    along = np.outer(axis, axis)
    return np.asarray(along), np.asarray(np.eye(3) - along), np.asarray(np.cross(axis, np.eye(3)).T)


@dataclass(frozen=True)
class PitchedLoad:
    """A dead load in the frame of the blade (see `rotfem.mechanics.loads.Load`).

    Attributes:
        unpitched: in the frame of the hub.
        pitch: of the blade.
    """

    unpitched: Load
    pitch: Pitch
    kind: str = "dead"
    is_zero: bool = False
    constant: bool = False
    linear: bool = False

    @property
    def knots(self) -> tuple[float, ...]:
        """Times (s) between which it is smooth, as far as they are known."""
        return tuple(sorted({*(self.unpitched.knots or ()), *self.pitch.knots}))

    @property
    def span(self) -> Span | None:
        """How it is spread; None where it is the same everywhere."""
        span = self.unpitched.span
        if span is None:
            return None
        if span.shapes is None:
            return PitchedPlaces(span, self.pitch)
        turned = (Shapes(s.x, s.values @ m.T, s.region) for m in maps(self.pitch.axis) for s in span.shapes)
        return ShapedSpan(tuple(turned))

    def at(self, t: float) -> Array:
        """Return components, with a span all amplitudes, at time t (s)."""
        return np.asarray(self.many(np.array([t]))[0])

    def many(self, t: Array) -> Array:
        """Return the same at times (n,), shape (n, components)."""
        values, span = self.unpitched.many(t), self.unpitched.span
        phi = np.array([self.pitch.turned(float(s)) for s in t])[:, None]
        factors = np.ones_like(phi), np.cos(phi), -np.sin(phi)
        if span is not None and span.shapes is not None:
            return np.concatenate([factor * values for factor in factors], axis=1)
        vectors = values.reshape(len(t), -1, 3)
        turned = sum(f[:, None] * (vectors @ m.T) for f, m in zip(factors, maps(self.pitch.axis), strict=True))
        return np.asarray(turned).reshape(values.shape)

    def sizes(self) -> Array | None:
        """Return the largest size of each component at all times and places; None where that is not known."""
        known = self.unpitched.sizes()
        return None if known is None else np.full(3, float(np.linalg.norm(known)))


@dataclass(frozen=True)
class PitchedPlaces:
    """A function of place and time in the frame of the blade (see `rotfem.mechanics.span.Span`)."""

    span: Span
    pitch: Pitch
    shapes: None = None

    @property
    def stations(self) -> tuple[float, ...]:
        """Places along the span (m) at which the load has kinks or jumps."""
        return self.span.stations

    def over(self, points: Array) -> Callable[[float], Array]:
        """Return t (s) ↦ components at points (n, 3) in m, one after the other."""
        at: Any = self.span.over(points)
        return lambda t: (at(t).reshape(-1, 3) @ self.pitch.rotation(t)).ravel()
