"""Loads that are sums: shapes over the structure, or components, each with an amplitude over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.span import FunctionOfPlace, ShapedSpan, Shapes, Span

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """Σ_k a_k(t) s_k(x).

    Attributes:
        shapes: s_k.
        amplitudes: times (n,) ↦ a_k, shape (n, k); None where all are 1.
        knots: times (s) between which they are smooth, as far as they are known.
        linear: whether they are linear between knots.
        largest: largest size of each; None where that is not known.
    """

    shapes: Shapes
    amplitudes: Callable[[Array], Array] | None = None
    knots: tuple[float, ...] = ()
    linear: bool = True
    largest: Array | None = None

    @classmethod
    def table(cls, rows: npt.ArrayLike, shapes: Shapes) -> Part:
        """Return amplitudes that are given by rows (t, a…), linear between them and constant outside."""
        t, *columns = np.asarray(rows, dtype=float).T
        largest = np.abs(columns).max(axis=1)

        def amplitudes(s: Array) -> Array:
            return np.stack([np.interp(s, t, column) for column in columns], axis=1)

        return cls(shapes, amplitudes, tuple(t), largest=largest)

    @classmethod
    def harmonic(cls, shapes: Shapes, angle: Callable[[Array], Array]) -> Part:
        """Return one shape with the amplitude cos(angle(t)), the angle in rad."""
        return cls(shapes, lambda t: np.cos(angle(t))[:, None], linear=False, largest=np.ones(1))

    def at(self, t: Array) -> Array:
        """Return the amplitudes at times (n,), shape (n, k)."""
        return np.ones((len(t), len(self.shapes.values))) if self.amplitudes is None else self.amplitudes(t)


@dataclass(frozen=True)
class ComposedLoad:
    """A sum of parts (see `rotfem.mechanics.loads.Load`)."""

    kind: Literal["dead", "follower"]
    parts: tuple[Part, ...]

    @cached_property
    def is_zero(self) -> bool:
        """Whether all shapes are zero."""
        return not any(np.any(part.shapes.values) for part in self.parts)

    @cached_property
    def constant(self) -> bool:
        """Whether it does not change with time."""
        return all(part.amplitudes is None for part in self.parts)

    @cached_property
    def knots(self) -> tuple[float, ...]:
        """Times (s) of all parts between which it is smooth, as far as they are known."""
        return tuple(sorted({t for part in self.parts for t in part.knots}))

    @cached_property
    def linear(self) -> bool:
        """Whether it is linear between its knots."""
        return all(part.linear for part in self.parts)

    @cached_property
    def span(self) -> Span | None:
        """How it is spread; None where all parts are the same everywhere."""
        shapes = tuple(part.shapes for part in self.parts)
        return None if all(s.x is None and not s.region for s in shapes) else ShapedSpan(shapes)

    def many(self, t: Array) -> Array:
        """Return components, with a span all amplitudes, at times (n,), shape (n, components)."""
        if self.span is not None:
            return np.concatenate([part.at(t) for part in self.parts], axis=1)
        return np.asarray(sum(part.at(t) @ part.shapes.values[:, 0] for part in self.parts))

    def at(self, t: float) -> Array:
        """Return components, with a span all amplitudes, at time t (s)."""
        return np.asarray(self.many(np.array([t]))[0])

    def sizes(self) -> Array | None:
        """Return an upper bound of the size of each component at all times and places; None if there is none."""
        out = np.zeros(self.parts[0].shapes.values.shape[2])
        for part in self.parts:
            most = np.abs(part.shapes.values).max(axis=1)
            largest = np.ones(len(most)) if part.amplitudes is None else part.largest
            if largest is None:
                return None
            out += largest @ most
        return out


@dataclass(frozen=True)
class LoadOfPlace:
    """A load that is a function of place and time (see `rotfem.mechanics.loads.Load`).

    Attributes:
        kind: see there.
        span: the function.
        probes: points (n, 3) in m at which it is looked at to see how it changes with time.
        constant: whether it does not change with time.
    """

    kind: Literal["dead", "follower"]
    span: FunctionOfPlace
    probes: Array
    constant: bool
    is_zero: bool = False
    knots: tuple[float, ...] = ()
    linear: bool = False

    @cached_property
    def at(self) -> Callable[[float], Array]:
        """The components at the probes as a function of time (s)."""
        return self.span.over(self.probes)

    def many(self, t: Array) -> Array:
        """Return the components at the probes at times (n,), shape (n, …)."""
        return np.array([self.at(float(s)) for s in t])

    def sizes(self) -> None:
        """Return None: it is not known how large it becomes."""
        return
