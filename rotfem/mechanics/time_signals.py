"""Signals: prescribed data over time, evaluated on one side of an instant, or as a straight line over a step.

Speed, base acceleration, torque and loads are signals, smooth between their knots. At a knot a signal has two values:
that of the step that ends, t⁻, and that of the step that starts, t⁺. Over a step [a, b] with knots inside a signal f is
replaced by the straight line with its mean and first moment, as schemes of second order need, or for others by the
cubic that has the values of f at both ends too, so that cubics of neighbouring steps join:

    f̄ = Σ_k c_k P_k(x),    x(t) = (2t − a − b)/h,    h = b − a,    c_k = (2k + 1)/h ∫ P_k(x(s)) f(s) ds,    k = 0, 1,

P_k those of Legendre. In a row of steps with several knots each the lines of second order join as well: their value
where two of them meet is the mean of f over both, weighted by the hat function of the instant. So the sums of the
scheme have its impulse and first moment, and noise of the input does not add up in them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial.legendre import leggauss

from rotfem.mechanics.differentiation import Derivative
from rotfem.mechanics.free_hub import ControlledTorque, Seen, Torque
from rotfem.mechanics.loads import Load, PlaceLoad
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem

Array = npt.NDArray[np.float64]

#: Relative distance of two times below which they are equal.
SAME = 1e-13

#: Begin and end (s) of a step, and the degree of the polynomials that replace signals in it, 1 or 3; or its begin and
#: end after the begin and before the end of its neighbours, with which lines join (its own where they do not).
Fit = tuple[float, float, int] | tuple[float, float, float, float]

#: Gauss points and weights on (0, 1): exact for polynomials of degree 7.
POINTS, WEIGHTS = (x / 2 for x in leggauss(4))
POINTS = POINTS + 0.5

#: Column k: coefficients of the powers of x in P_k, up to cubics.
LEGENDRE = np.array([[1.0, 0.0, -0.5, 0.0], [0.0, 1.0, 0.0, -1.5], [0.0, 0.0, 1.5, 0.0], [0.0, 0.0, 0.0, 2.5]])


def has_ends(line: Fit | None) -> bool:
    """Return whether what replaces signals in a step, if anything, has their values at its ends."""
    return line is None or line[2:] == (3,)


@dataclass
class View:
    """How the signals of a problem are evaluated at present.

    Attributes:
        side: −1 just before the time asked for, 1 just after it, 0 at it.
        line: step over which they are replaced by polynomials; None for their values.
    """

    side: int = 0
    line: Fit | None = None

    @contextmanager
    def as_in(self, other: View) -> Iterator[None]:
        """Evaluate signals as another view does, within the context."""
        before = self.side, self.line
        self.side, self.line = other.side, other.line
        try:
            yield
        finally:
            self.side, self.line = before


@dataclass
class TimeSignal:
    """One quantity over time.

    Attributes:
        name: unique; the key in messages, where it must not jump.
        at: time (s) ↦ value, scalar or shape (components,).
        knots: times (s) at which it or its rate may jump, increasing.
        smooth: further times (s) between which it is a polynomial, or nearly one.
        bent: those of them at which its rate has a kink, which takes two orders from an adaptive step over it.
        many: the same of an array of times, shape (n, components); made of `at` if None.
        known: whether all knots are known; else jumps are searched.
        continuous: whether it must not jump, as speeds and angles.
        view: how it is evaluated.
        changes: of a function, the first time (s) at which it was seen to change within a step, and the distance of
            samples there (s); None if it was not.
        primitive: of the differences of a function, which are dear, that function; its knots are theirs.
    """

    name: str
    at: Callable[[float], Any]
    knots: Array
    smooth: Array = field(default_factory=lambda: np.empty(0))
    bent: Array = field(default_factory=lambda: np.empty(0))
    many: Callable[[Array], Array] | None = None
    known: bool = True
    continuous: bool = False
    view: View = field(default_factory=View)
    changes: tuple[float, float] | None = None
    primitive: TimeSignal | None = None
    _fit: tuple[Any, Array] | None = None
    _kept: dict[Any, Array] = field(default_factory=dict)

    @cached_property
    def _points(self) -> Array:
        return np.union1d(self.knots, self.smooth)

    @cached_property
    def _is_number(self) -> bool:
        return np.ndim(self.at(0.0)) == 0

    def values(self, t: Array) -> Array:
        """Return the values at times (n,), shape (n, components)."""
        if self.many is not None:
            return self.many(t)
        return np.array([self.at(float(s)) for s in t], dtype=np.float64).reshape(len(t), -1)

    def fitted(self, t: Any, *line: Any) -> Array:
        """Return f̄ of a step (see `Fit`) at times (n,), shape (n, components); at one, shape (components,)."""
        begin, end = line[-3:-1] if len(line) == 4 else line[:2]
        x = (t - 0.5 * (begin + end)) * (2 / (end - begin))
        powers = self._powers(line)
        return np.asarray(np.power.outer(x, np.arange(len(powers))) @ powers)

    def _powers(self, line: Any) -> Array:
        """Return the coefficients of powers of x in f̄ of a step, shape (degree + 1, components)."""
        if self._fit is None or self._fit[0] != line:
            if len(line) == 4:
                first, last = self._joint(*line[:3]), self._joint(*line[1:])
                powers = np.array([first + last, last - first]) / 2
            else:
                powers = self._line(*line[:2])
            if line[2:] == (3,):
                after, before = self.values(np.array([line[0] + SAME * (abs(line[0]) or SAME), line[1] * (1 - SAME)]))
                mean, slope = powers
                powers = LEGENDRE @ np.array([mean, slope, (after + before) / 2 - mean, (before - after) / 2 - slope])
            self._fit = line, powers
        return self._fit[1]

    def _joint(self, before: float, at: float, after: float) -> Array:
        """Return the mean of f weighted by the hat function of an instant (s) between two others."""
        sides = ((before, at, 1.0), (at, after, -1.0))
        total = sum((b - a) * (np.array([1.0, sign / 3]) @ self._line(a, b)) for a, b, sign in sides if b > a)
        return np.asarray(total / (after - before))

    def _line(self, begin: float, end: float) -> Array:
        """Return c_0 and c_1 of a step: mean and slope of the best line in it, shape (2, components)."""
        if (found := self._kept.get((begin, end))) is not None:
            return found
        middle, h = 0.5 * (begin + end), end - begin
        first, last = np.searchsorted(self._points, (begin, end), side="right")
        inside = self._points[first:last]
        edges = np.array([begin, *inside[inside < end], end])
        s = (edges[:-1, None] + np.diff(edges)[:, None] * POINTS).ravel()
        weights = (np.diff(edges)[:, None] * WEIGHTS).ravel() / h
        basis = np.array([weights, 3 * weights * (s - middle) * (2 / h)])
        if len(self._kept) > 4:
            self._kept.clear()
        return self._kept.setdefault((begin, end), basis @ self.values(s))

    def deviation(self, t: Array, *line: Any) -> Array:
        """Return |f − f̄| at times (n,) of a step, as parts of the largest |f| there."""
        f = self.values(t * (1 - SAME))
        largest = float(np.linalg.norm(f, axis=1).max())
        return np.asarray(np.linalg.norm(f - self.fitted(t, *line), axis=1) / (largest or 1.0))

    def seen(self, t: float) -> Any:
        """Return the value at a time (s), evaluated as the view says."""
        if self.view.line is not None:
            value = self.fitted(t, *self.view.line)
            return float(value[0]) if self._is_number else value
        return self.at(t + self.view.side * SAME * (abs(t) or SAME)) if self.view.side else self.at(t)


@dataclass(frozen=True)
class SeenTorque(Torque):
    """A torque, evaluated as a view says."""

    seen: Callable[[float], float] = float

    def at(self, t: float, after: bool = False) -> float:
        """Return M(t)."""
        return super().at(t, True) if after else self.seen(t)


@dataclass(frozen=True)
class SeenController(ControlledTorque):
    """A controller; what it changes by time alone, in the state at the start, is evaluated as a view says."""

    signal: TimeSignal = field(kw_only=True)

    def on(self, t: float, state: Callable[[], Seen], after: bool = False) -> float:
        """Return M at time t (s) and a state."""
        own, signal = super().on(t, state), self.signal
        return own + signal.seen(t) - signal.at(t) if len(signal.knots) else own


def viewed(problem: Problem, view: View) -> tuple[Problem, list[TimeSignal]]:
    """Return the problem with signals that are evaluated as a view says, and those that change with time."""
    signals: list[TimeSignal] = []

    def see(name: str, at: Callable[[float], Any], knots: Any, **more: Any) -> TimeSignal:
        signals.append(TimeSignal(name, at, np.array(() if knots is None else knots, dtype=float), view=view, **more))
        return signals[-1]

    motion = _viewed_motion(problem.motion, see)
    changing = {name: load for name, load in problem.loads.named.items() if not load.constant}
    seen = {name: _viewed_load(f"loads.{name}", load, see) for name, load in changing.items()}
    return problem.replace(motion=motion, loads=problem.loads.replaced(seen)), signals


def _viewed_load(name: str, load: Load, see: Callable[..., TimeSignal]) -> Load:
    """Return a load, evaluated as a view says; a function of place with the knots found at its probes."""
    signal = see(name, load.at, load.knots, many=load.many, known=load.linear)
    if not isinstance(load, PlaceLoad):
        return replace(load, seen=signal.seen)
    function = load.function

    def at(place: Any, t: float) -> Array:
        return np.asarray(TimeSignal(name, lambda s: function(place, s), signal.knots, view=signal.view).seen(t))

    return replace(load, function=at)


def _viewed_motion(motion: Motion, see: Callable[..., TimeSignal]) -> Motion:
    """Return a motion, evaluated as a view says; speed, pitch and its rate must not jump."""
    changes: dict[str, Any] = {}
    if motion.base is not None and not motion.base.constant:
        changes["base"] = _viewed_load("motion.base_acceleration", motion.base, see)
    if motion.hub is not None:
        torque: Any = motion.hub.torque
        if torque.controlled:
            start = 0.0, motion.hub.speed, defaultdict[str, float](float)
            signal = see("motion.function", lambda t: torque.controller(t, *start), (), known=False)
            changes["hub"] = replace(motion.hub, torque=SeenController(controller=torque.controller, signal=signal))
        elif len(torque.knots):
            signal = see("motion.torque", torque.at, torque.knots, many=lambda t: torque.many(t)[:, None])
            changes["hub"] = replace(motion.hub, torque=SeenTorque(torque.pulses, torque.table, signal.seen))
    elif motion.changes_speed:
        signal = None
        more: dict[str, Any] = {"smooth": np.array(motion.knots), "bent": np.array(motion.bent)}
        more |= {"known": motion.smooth or motion.breakpoints is not None}
        for name, f in (("speed", motion.speed), ("rate", motion.rate)):
            more["primitive"] = signal if isinstance(f, Derivative) else None
            many = (lambda t, f=f: np.asarray(f(t))[:, None]) if motion.arrays else None
            signal = see(f"motion.{name}", f, motion.sharp, many=many, continuous=name == "speed", **more)
            changes[name] = signal.seen
    if (pitch := motion.pitch) is not None:
        turned, signal = dict[str, Any](), None
        for name, (key, f) in zip(("angle", "rate", "acceleration"), pitch.signals.items(), strict=True):
            more = {"continuous": name != "acceleration", "primitive": signal if isinstance(f, Derivative) else None}
            signal = see(key, f, pitch.knots, known=pitch.known, **more)
            turned[name] = signal.seen
        changes["pitch"] = replace(pitch, **turned)
    return replace(motion, **changes)
