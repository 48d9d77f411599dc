"""What is prescribed over time, and how a march sees it: from one side of an instant, or as a mean around it.

Speed, base acceleration, torque and loads are *signals*, smooth between their knots. A march lands on knots, and there
a signal has two values: that of the step that ends, t⁻, and that of the step that starts, t⁺. Where knots are closer
than steps can be, a signal is seen through the hat function of an instant and its steps l before and r after it,

    f̄(t) = ∫ f(s) φ(s) ds / ∫ φ(s) ds,    φ = 1 + (s − t)/l before t, 1 − (s − t)/r after it.

Hats add up to one, so the impulse Σ ½ (l + r) f̄ that a scheme of second order passes on is ∫ f dt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.free_hub import FreeHub, Torque
from rotfem.mechanics.loads import AnyLoad, PlaceLoad, named, replaced
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.pitch import Pitch
from rotfem.mechanics.problem import Problem

Array = npt.NDArray[np.float64]

#: Two times that are closer than this, relative to themselves, are one.
SAME = 1e-13

#: An instant after 0, s.
TINY = 1e-300

#: Gauss points and weights on (0, 1): exact for a cubic times a hat.
POINTS, WEIGHTS = 0.5 + 0.5 * np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0]), np.array([5.0, 8.0, 5.0]) / 18


@dataclass
class View:
    """How the signals of a problem are seen at present.

    Attributes:
        side: −1 just before the time asked for, 1 just after it, 0 at it.
        window: lengths (s) of the steps before and after it that signals are averaged over; None for their values.
    """

    side: int = 0
    window: tuple[float, float] | None = None


@dataclass
class TimeSignal:
    """One quantity over time.

    Attributes:
        name: what it is; of what must not jump its key, for messages. No two have the same.
        at: time (s) ↦ value, scalar or shape (components,).
        knots: times (s) between which it is smooth, increasing.
        marks: further times (s) between which it is nearly straight, where it is known to be fast.
        many: the same of an array of times, shape (n, components); made of `at` if None.
        probes: times (s) at which it is sampled to see whether a step resolves it, but not landed on.
        samples: times (n,) and values (n, components) of a function that has been sampled, nearly straight between;
            jumps are two times; None of anything else.
        data: what has been made of its values at knots and marks (`rotfem.analysis.time_grid`); None before.
        continuous: derivatives, from 0 on, that must not jump, as no force is large enough for that: 2 are the value
            and its rate.
        known: whether all knots are known; otherwise it is a function that has to be looked at.
    """

    name: str
    at: Callable[[float], Any]
    knots: Array
    marks: Array
    many: Callable[[Array], Array] | None = None
    known: bool = True
    probes: Array = field(default_factory=lambda: np.empty(0))
    samples: tuple[Array, Array] | None = None
    data: Any = None
    continuous: int = 0
    _kept: tuple[Array, Array, Array] | None = None

    def values(self, t: Array) -> Array:
        """Return the values at times (n,), shape (n, components)."""
        if self.many is not None:
            return self.many(t)
        return np.array([np.atleast_1d(self.at(float(s))) for s in t], dtype=float).reshape(len(t), -1)

    def mean(self, t: float, before: float, after: float) -> Any:
        """Return f̄(t), as a scalar or shape (components,) as `at` does."""
        points = self._points()
        inside = points[np.searchsorted(points, t - before, "right") : np.searchsorted(points, t + after, "left")]
        edges = np.unique(np.concatenate([[t - before, t, t + after], inside]))
        lengths = np.diff(edges)
        s = (edges[:-1, None] + lengths[:, None] * POINTS).ravel()
        hat = np.where(s < t, 1 + (s - t) / (before or 1.0), 1 - (s - t) / (after or 1.0))
        weights = (lengths[:, None] * WEIGHTS).ravel() * hat
        mean = weights @ (self.values(s) if self.samples is None else self._straight(s, *self.samples)) / weights.sum()
        return mean if np.ndim(self.at(t)) else float(mean[0])

    def _points(self) -> Array:
        """Return knots and marks in order; kept until others have been found."""
        if self._kept is None or self._kept[0] is not self.knots or self._kept[1] is not self.marks:
            self._kept = self.knots, self.marks, np.union1d(self.knots, self.marks)
        return self._kept[2]

    @staticmethod
    def _straight(s: Array, t: Array, f: Array) -> Array:
        """Return values at times s (n,) on the straight lines between samples f at times t, (n, components)."""
        return np.stack([np.interp(s, t, column) for column in f.T], axis=1)

    def seen(self, view: View) -> Callable[[float], Any]:
        """Return the signal as a function of time that shows what a view shows."""

        def at(t: float) -> Any:
            if view.window is not None:
                return self.mean(t, *view.window)
            return self.at(t + view.side * max(SAME * abs(t), TINY)) if view.side else self.at(t)

        return at


@dataclass(frozen=True)
class SeenTorque(Torque):
    """A torque as a view shows it."""

    seen: Callable[[float], float] = float

    def at(self, t: float, after: bool = False) -> float:
        """Return M(t)."""
        return super().at(t, True) if after else self.seen(t)


def watched(problem: Problem, view: View) -> tuple[Problem, list[TimeSignal]]:
    """Return the problem whose signals are seen as a view shows them, and those that change with time."""
    signals: list[TimeSignal] = []

    def see(signal: TimeSignal) -> Callable[[float], Any]:
        signals.append(signal)
        return signal.seen(view)

    motion = _watched_motion(problem.motion, see)
    changing = {name: load for name, load in named(problem.loads).items() if not load.constant}
    seen = {name: _watched_load(f"loads.{name}", load, see, view) for name, load in changing.items()}
    return problem.replace(motion=motion, loads=replaced(problem.loads, seen)), signals


def _watched_load(name: str, load: AnyLoad, see: Callable[[TimeSignal], Callable[[float], Any]], view: View) -> AnyLoad:
    """Return a load as a view shows it; a function of place at every place, with the knots found at its probes."""
    signal = TimeSignal(name, load.at, _times(load.knots), np.empty(0), load.many, known=load.linear)
    sampled = see(signal)
    if not isinstance(load, PlaceLoad):
        return replace(load, seen=sampled)
    function = load.function

    def at(place: Any, t: float) -> Array:
        one = TimeSignal(name, lambda s: function(place, s), signal.knots, signal.marks)
        return np.asarray(one.seen(view)(t))

    return replace(load, function=at)


def _watched_motion(motion: Motion, see: Callable[[TimeSignal], Callable[[float], Any]]) -> Motion:
    changes: dict[str, Any] = {}
    none = np.empty(0)
    if motion.is_accelerated and not motion.constant:
        base, at = motion.base_knots, motion.base_acceleration
        changes["base_acceleration"] = see(
            TimeSignal("motion.base_acceleration", at, _times(base), none, _between(at, base), known=base is not None)
        )
    if motion.hub is not None:
        if len(motion.hub.torque.knots):
            changes["hub"] = _watched_hub(motion.hub, see)
    elif motion.changes_speed:
        known = motion.smooth or motion.breakpoints is not None
        for name, f in (("speed", motion.speed), ("rate", motion.rate)):
            many = _columns(f) if motion.arrays else None
            signal = TimeSignal(f"motion.{name}", f, _times(motion.sharp), _times(motion.knots), many, known)
            signal.probes = 0.5 * (signal.marks[1:] + signal.marks[:-1])
            signal.continuous = int(name == "speed")
            changes[name] = see(signal)
    if motion.pitch is not None:
        changes["pitch"] = _watched_pitch(motion.pitch, see)
    return replace(motion, **changes)


def _watched_pitch(pitch: Pitch, see: Callable[[TimeSignal], Callable[[float], Any]]) -> Pitch:
    """Return a pitch as it is seen; of a function the acceleration is sampled, which shows fast changes most."""
    none, changes = np.empty(0), dict[str, Any]()
    for name, (key, at) in zip(("angle", "rate", "acceleration"), pitch.signals.items(), strict=True):
        signal = TimeSignal(key, at, _times(pitch.knots), none, known=pitch.known or name == "rate")
        signal.continuous = 2 if name == "angle" else 0
        changes[name] = see(signal)
    return replace(pitch, **changes)


def _watched_hub(hub: FreeHub, see: Callable[[TimeSignal], Callable[[float], Any]]) -> FreeHub:
    torque = hub.torque
    signal = TimeSignal("motion.torque", torque.at, torque.knots, np.empty(0), lambda t: torque.many(t)[:, None])
    return replace(hub, torque=SeenTorque(torque.pulses, torque.table, see(signal)))


def _times(knots: Iterable[float] | None) -> Array:
    return np.array(() if knots is None else knots, dtype=float)


def _columns(f: Callable[[Any], Any]) -> Callable[[Array], Array]:
    return lambda t: np.asarray(f(t))[:, None]


def _between(at: Callable[[float], Array], knots: tuple[float, ...] | None) -> Callable[[Array], Array] | None:
    """Return a signal of an array of times that is linear between knots; None where it is not, or jumps there."""
    if not knots or np.any(np.diff(knots) <= 0.0):
        return None
    columns = np.array([at(t) for t in knots], dtype=float).T
    return lambda t: np.stack([np.interp(t, knots, column) for column in columns], axis=1)
