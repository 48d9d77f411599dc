"""Prescribed motion of the floating frame.

The frame {o; a_i} turns with angular velocity w(t) = Omega(t) e about the unit axis e, which is fixed in the frame,
and its origin has the absolute acceleration a_o(t), both resolved in the frame (Simo & Vu-Quoc 1986, section 4).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from math import cos, pi, sin
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from rotfem.along import JUMP
from rotfem.mechanics.differentiation import Derivative
from rotfem.mechanics.free_hub import FreeHub
from rotfem.mechanics.loads import Load
from rotfem.mechanics.pitch import Pitch, turn_about
from rotfem.registry import Registry
from rotfem.registry import motion_laws as registered
from rotfem.short import short_fields
from rotfem.units import si
from rotfem.users_functions import number_of


class MotionLaw(ABC):
    """A prescribed rotation: `motion.type` of a scene names its class, the fields of a dataclass are keys of [motion].

    Attributes:
        name: what a scene calls it.
        rate: t (s) ↦ dΩ/dt (rad/s²), a method; None: differences of the speed.
        angle: t (s) ↦ ψ (rad), a method; None: a quadrature of the speed.
        breakpoints: times (s) between which the speed is smooth; steps end there. None: they are sought.
    """

    registry: ClassVar[Registry[Any]] = registered
    name: ClassVar[str]
    rate: Any = None
    angle: Any = None
    breakpoints: Any = None

    @abstractmethod
    def speed(self, t: float) -> float:
        """Return Ω (rad/s) at a time (s)."""

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        """Return what is allowed, by name of the parameters that are not; every number is unless a class says more."""
        return {}


Scalar = Callable[[float], float]
Array = npt.NDArray[np.float64]


def about(axis: npt.ArrayLike) -> Array:
    """Return the unit vector along an axis of any length, shape (3,)."""
    e = np.asarray(axis, dtype=float)
    return np.asarray(e / np.linalg.norm(e))


@dataclass(frozen=True)
class Motion:
    """Rotation of the hub about a fixed axis of its frame, the acceleration of its center, and a pitch over time.

    Attributes:
        speed: Omega(t) in rad/s.
        rate: dOmega/dt(t) in rad/s^2.
        angle: psi(t) = integral of Omega from 0, in rad.
        axis: unit vector e, frame components.
        base: a_o(t), frame components, m/s^2, as a sum; None: 0.
        is_spinning: whether Omega is anything but zero, as far as is known.
        changes_speed: whether Omega changes, as far as is known.
        knots: times (s) between which Omega is smooth and nearly a polynomial.
        sharp: those of them at which it may jump or have a kink.
        bent: those of them at which its rate has a kink.
        breakpoints: of a function, those that its user named; None if they are searched.
        smooth: whether Omega is known to be smooth between its knots.
        arrays: whether speed and rate take arrays of times too.
        settled: time (s) from which on Omega stays as it is, 0 if that is not known.
        hub: what turns freely where the rotation is an unknown; its speed is then only that of the start.
        pitch: turn of the frame in addition to that of the hub (see `rotfem.mechanics.pitch`); None: the frame is the
            hub's.
    """

    speed: Scalar
    rate: Scalar
    angle: Scalar
    axis: Array
    base: Load | None = None
    is_spinning: bool = True
    changes_speed: bool = True
    knots: tuple[float, ...] = ()
    sharp: tuple[float, ...] = ()
    bent: tuple[float, ...] = ()
    breakpoints: tuple[float, ...] | None = None
    smooth: bool = True
    arrays: bool = False
    settled: float = 0.0
    hub: FreeHub | None = None
    pitch: Pitch | None = None
    __repr__ = short_fields

    @classmethod
    def constant_speed(cls, speed: float | str, axis: npt.ArrayLike = (0, 0, 1), **more: Any) -> Motion:
        """Return steady rotation at a speed (rad/s, or as "12.1 rpm")."""
        speed = si(speed, "rad/s", "motion.speed")
        turning = (lambda t: speed), (lambda t: 0.0), (lambda t: speed * t)
        state: dict[str, Any] = {"is_spinning": speed != 0.0, "changes_speed": False}
        return cls(*turning, about(axis), **(state | more))

    @classmethod
    def spin_up(cls, speed: float | str, duration: float | str, axis: npt.ArrayLike = (0, 0, 1), **more: Any) -> Motion:
        """Return the smooth spin-up from rest to a speed (rad/s) in a time (s); see `smooth_spin_up`."""
        speed, duration = si(speed, "rad/s", "motion.speed"), si(duration, "s", "motion.duration")
        turns, knots = speed != 0.0, duration * np.arange(1, 17) / 16  # parts of it that are nearly straight
        state: dict[str, Any] = {"is_spinning": turns, "changes_speed": turns, "settled": duration, "arrays": True}
        state |= {"sharp": (duration,), "knots": tuple(knots)}
        return cls(*smooth_spin_up(speed, duration), about(axis), **(state | more))

    @classmethod
    def from_table(
        cls, table: npt.ArrayLike, kind: str = "pchip", axis: npt.ArrayLike = (0, 0, 1), **more: Any
    ) -> Motion:
        """Return rotation at a tabulated speed; see `tabulated`."""
        t, speeds = np.asarray(table, dtype=float).T
        state: dict[str, Any] = {
            "is_spinning": bool(np.any(speeds != 0.0)),
            "changes_speed": len(set(speeds)) > 1,
            "knots": tuple(t),
            "sharp": (t[0], *t[jumps_of(t)], *t[jumps_of(t) + 1], t[-1]) if kind in ("pchip", "cubic") else tuple(t),
            "bent": tuple(t) if kind == "pchip" else (),
            "arrays": True,
        }
        return cls(*tabulated(table, kind), about(axis), **(state | more))

    @classmethod
    def from_functions(
        cls,
        speed: Scalar,
        rate: Scalar | None = None,
        angle: Scalar | None = None,
        axis: npt.ArrayLike = (0, 0, 1),
        breakpoints: Sequence[float] | None = None,
        cell: float | None = None,
        **more: Any,
    ) -> Motion:
        """Return rotation at the speed that a function of time gives.

        Args:
            speed: t (s) ↦ Omega (rad/s).
            rate: t (s) ↦ dOmega/dt (rad/s²); differences of the speed if None (`rotfem.mechanics.differentiation`),
                which reach neither over a breakpoint nor before t = 0.
            angle: t (s) ↦ psi (rad); a quadrature of the speed if None.
            axis: direction of the angular velocity.
            breakpoints: times (s) between which the function is smooth, which steps then land on; where None, it is
                sampled for them before a march.
            cell: length of time (s) in which these differences have one step, as some steps of a march.
            more: further attributes of the motion.
        """
        speed = number_of(speed, "motion.speed", "time")
        rate, angle = (f and number_of(f, f"motion.{name}", "time") for name, f in (("rate", rate), ("angle", angle)))
        points = None if breakpoints is None else tuple(sorted(float(t) for t in breakpoints))
        known = points or ()
        state: dict[str, Any] = {"smooth": False, "breakpoints": points, "knots": known, "sharp": known}
        rate = rate or Derivative(speed, 1, cell, (0.0, *known))
        return cls(speed, rate, angle or integrated(speed, known), about(axis), **(state | more))

    @classmethod
    def free(cls, hub: FreeHub, axis: npt.ArrayLike = (0, 0, 1), **more: Any) -> Motion:
        """Return the rotation of a free hub, an unknown; what is prescribed of it is its initial speed."""
        state: dict[str, Any] = {"is_spinning": True, "changes_speed": True, "hub": hub}
        return replace(cls.constant_speed(hub.speed, axis), **(state | more))

    @property
    def constant(self) -> bool:
        """Whether neither Omega nor a_o nor the pitch changes with time."""
        turns = self.changes_speed or (self.pitch is not None and self.pitch.changes)
        return not turns and (self.base is None or self.base.constant)

    @property
    def is_accelerated(self) -> bool:
        """Whether a_o is anything but zero."""
        return self.base is not None and not self.base.is_zero

    def base_acceleration(self, t: float) -> Array:
        """Return a_o(t), shape (3,), frame components, m/s²."""
        return np.zeros(3) if self.base is None else self.base.at(t)

    def frame(self, t: float) -> dict[str, Array]:
        """Return w, dw, a_o of the frame (rad/s, rad/s², m/s²), and v_o of its origin by the pitch, its components."""
        w, dw, a_o = self.speed(t) * self.axis, self.rate(t) * self.axis, self.base_acceleration(t)
        if self.pitch is None:
            return {"w": w, "dw": dw, "a_o": a_o}
        turn = self.pitch.turned(t), self.pitch.rate(t), self.pitch.acceleration(t)
        return self.pitch.moved(turn, w, dw, a_o)

    def rotation(self, t: float) -> Array:
        """Return Q(t), shape (3, 3): inertial components = Q(t) · frame components."""
        turn = turn_about(self.axis, self.angle(t))
        return turn if self.pitch is None else turn @ self.pitch.rotation(t)

    def at_speed(self, omega: float) -> Motion:
        """Return the same frame spinning at the constant speed omega (rad/s), its pitch that of t = 0."""
        pitch = None if self.pitch is None else self.pitch.held()
        return Motion.constant_speed(omega, self.axis, pitch=pitch, base=self.base)

    def pitched(self, pitch: Pitch) -> Motion:
        """Return the motion of a frame that pitches over time too."""
        return replace(self, pitch=pitch)

    def top_speed(self, end: float | None) -> float:
        """Return the largest |Omega| (rad/s) at knots until a time (s), or ever; 0 of a function and of a free hub."""
        if not self.smooth or self.hub is not None:
            return 0.0
        last = max((0.0, *self.knots)) if end is None else end
        return max(abs(float(self.speed(t))) for t in (0.0, last, *(t for t in self.knots if t < last)))

    def final_speed(self, end: float) -> float:
        """Return the speed (rad/s) at the end of a history (s), or when the motion has settled if that is later."""
        return self.speed(max(end, self.settled))


def smooth_spin_up(speed: float, duration: float) -> tuple[Scalar, Scalar, Scalar]:
    """Return (Omega, dOmega/dt, psi) of speed (t/T − sin(2πt/T)/2π), constant after T (ICCIA 2017 eq. (17))."""
    T, k = duration, 2 * pi / duration

    def rising(t: Any, sine: Callable[[Any], Any]) -> Any:
        return speed * (t / T - sine(k * t) / (2 * pi))

    def gaining(t: Any, cosine: Callable[[Any], Any]) -> Any:
        return speed / T * (1 - cosine(k * t))

    def omega(t: Any) -> Any:
        if isinstance(t, np.ndarray):
            return np.where(t < T, rising(t, np.sin), speed)
        return float(rising(t, sin)) if t < T else speed  # of one number math's sine is ten times quicker

    def rate(t: Any) -> Any:
        if isinstance(t, np.ndarray):
            return np.where(t < T, gaining(t, np.cos), 0.0)
        return float(gaining(t, cos)) if t < T else 0.0

    def angle(t: float) -> float:
        s = min(t, T)
        return float(speed * (s * s / (2 * T) + (cos(k * s) - 1) / (2 * pi * k)) + speed * max(t - T, 0.0))

    return omega, rate, angle


def jumps_of(t: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return which intervals of times are the ramp that two rows of one time are."""
    return np.flatnonzero(np.diff(t) <= 2 * JUMP * np.max(np.abs(t)))


def tabulated(table: npt.ArrayLike, kind: str) -> tuple[Scalar, Scalar, Scalar]:
    """Return (Omega, dOmega/dt, psi) of rows (t, Omega), straight at jumps and constant outside; see `from_table`."""
    from scipy import interpolate  # only a table needs it, and it is slow to load

    t, omega = np.asarray(table, dtype=float).T
    curve: Any = interpolate.PPoly(np.array([np.diff(omega) / np.diff(t), omega[:-1]]), t)
    if smooth := {"pchip": interpolate.PchipInterpolator, "cubic": interpolate.CubicSpline}.get(kind):
        curve.c = np.concatenate([np.zeros_like(curve.c), curve.c])
        for a, b in pairwise([0, *jumps_of(t) + 1, len(t)]):
            if b - a > 1:
                curve.c[:, a : b - 1] = smooth(t[a:b], omega[a:b]).c
    slope, area = curve.derivative(), curve.antiderivative()
    first, last = float(t[0]), float(t[-1])  # speed and rate are asked for at arrays of times too
    speed_at, rate_at = one_time(curve), one_time(slope)

    def turned(s: float) -> float:
        inside = float(area(np.clip(s, first, last)))
        return float(inside + omega[0] * min(s - first, 0.0) + omega[-1] * max(s - last, 0.0))

    def speed(s: Any) -> Any:
        return curve(np.clip(s, first, last)) if isinstance(s, np.ndarray) else speed_at(min(max(s, first), last))

    def rate(s: Any) -> Any:
        if isinstance(s, np.ndarray):
            return np.where((first <= s) & (s < last), slope(np.clip(s, first, last)), 0.0)
        return rate_at(s) if first <= s < last else 0.0

    at_zero = turned(0.0)
    return speed, rate, lambda s: turned(s) - at_zero


def one_time(curve: Any) -> Scalar:
    """Return a piecewise polynomial as a function of one number, which scipy takes ten times as long over."""
    t, powers = curve.x.tolist(), curve.c.T.tolist()

    def at(s: float) -> float:
        i = min(max(bisect_right(t, s) - 1, 0), len(powers) - 1)
        return reduce(lambda value, power: value * (s - t[i]) + power, powers[i], 0.0)

    return at


def integrated(speed: Scalar, breakpoints: Sequence[float]) -> Scalar:
    """Return psi of a speed: an adaptive quadrature that goes on from the last time asked for."""
    from scipy import integrate  # only a callable needs it, and it is slow to load

    last = [0.0, 0.0]

    def quadrature(t: float) -> float:
        inside = [p for p in breakpoints if min(last[0], t) < p < max(last[0], t)] or None
        last[1] += integrate.quad(speed, last[0], t, epsabs=1e-12, epsrel=1e-12, points=inside)[0]
        last[0] = t
        return last[1]

    return quadrature
