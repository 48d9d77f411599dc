"""Applied loads as functions of time: what the forms' amplitude constants are set to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.span import Span

Array = npt.NDArray[np.float64]


class Load(Protocol):
    """A force or moment over time, and over the structure if it has a `span`."""

    @property
    def kind(self) -> str:
        """What its direction does: "dead" keeps it in the frame, "follower" turns with the section."""

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times."""

    @property
    def constant(self) -> bool:
        """Whether it does not change with time."""

    @property
    def knots(self) -> tuple[float, ...] | None:
        """Times (s) between which it is smooth, as far as they are known."""

    @property
    def linear(self) -> bool:
        """Whether it is linear between its knots; otherwise it has to be looked at."""

    @property
    def span(self) -> Span | None:
        """How it is spread over the structure; None where it is the same everywhere."""

    def at(self, t: float) -> Array:
        """Return its components at time t (s); with a span its amplitudes, as many as the span has shapes."""

    def many(self, t: Array) -> Array:
        """Return the same at times (n,), shape (n, components)."""

    def sizes(self) -> Array | None:
        """Return the largest size of each component at all times and places; None where that is not known."""


@dataclass(frozen=True)
class ConstantLoad:
    """A load that does not change with time.

    Attributes:
        value: components, N, N/m or N·m.
        kind: see `Load`.
    """

    value: tuple[float, ...]
    kind: Literal["dead", "follower"] = "dead"
    constant: bool = True
    is_zero: bool = False
    knots: tuple[float, ...] = ()
    linear: bool = True
    span: None = None

    def at(self, t: float) -> Array:
        """Return its components."""
        return np.array(self.value, dtype=np.float64)

    def many(self, t: Array) -> Array:
        """Return its components at times (n,), shape (n, components)."""
        return np.tile(self.at(0.0), (len(t), 1))

    def sizes(self) -> Array:
        """Return the size of each component."""
        return np.abs(self.at(0.0))


@dataclass(frozen=True)
class PointLoads:
    """What works at one place of the structure.

    Attributes:
        x: along a beam (m), or (x, y) on a plate.
        force: N, or None.
        moment: N·m, or None.
    """

    x: tuple[float, ...]
    force: Load | None = None
    moment: Load | None = None


class Applied(Protocol):
    """Gravity and the loads on a structure, None where there is none."""

    @property
    def gravity(self) -> tuple[float, ...]:
        """Acceleration of gravity, m/s², inertial axes."""

    @property
    def tip_force(self) -> Load | None:
        """Force at the tip, N."""

    @property
    def tip_moment(self) -> Load | None:
        """Moment at the tip, N·m."""

    @property
    def distributed(self) -> Load | None:
        """Force per length of a beam, N/m, or per area of a plate, N/m²."""


@dataclass(frozen=True)
class Loads:
    """Gravity and applied loads (see `Applied`); none by default.

    Attributes:
        pressure: force per area along the normal of a plate, N/m²: one component.
        at: what works at places along the structure.
    """

    gravity: tuple[float, ...] = (0.0, 0.0, 0.0)
    tip_force: Load | None = None
    tip_moment: Load | None = None
    distributed: Load | None = None
    pressure: Load | None = None
    at: tuple[PointLoads, ...] = ()


#: Loads of the whole structure and of its tip: forces and moments.
FORCES, MOMENTS = ("tip_force", "distributed", "pressure"), ("tip_moment",)


def named(loads: Applied) -> dict[str, Load]:
    """Return name ↦ load of all that are given, zero ones too: "tip_force", …, "at.0.force", "at.0.moment"."""
    out = {name: getattr(loads, name, None) for name in (*FORCES, *MOMENTS)}
    for i, point in enumerate(getattr(loads, "at", ())):
        out |= {f"at.{i}.force": point.force, f"at.{i}.moment": point.moment}
    return {name: load for name, load in out.items() if load is not None}


def stations(loads: Applied) -> set[float]:
    """Return the places along the structure (m) at which loads have kinks or jumps, or work at a point."""
    spans = (load.span for load in named(loads).values())
    points = (point.x for point in getattr(loads, "at", ()))
    return {x for span in spans if span is not None for x in span.stations} | {x[0] for x in points if len(x) == 1}


def is_moment(name: str) -> bool:
    """Return whether a named load is a moment."""
    return name.endswith("moment")


def replaced(loads: Applied, changed: Mapping[str, Load]) -> Loads:
    """Return the loads with other ones in the place of those of some names (see `named`)."""

    def now(name: str, load: Load | None) -> Load | None:
        return changed.get(name, load)

    whole: dict[str, Any] = {name: now(name, getattr(loads, name, None)) for name in (*FORCES, *MOMENTS)}
    points = tuple(
        PointLoads(point.x, now(f"at.{i}.force", point.force), now(f"at.{i}.moment", point.moment))
        for i, point in enumerate(getattr(loads, "at", ()))
    )
    return Loads(gravity=loads.gravity, at=points, **whole)
