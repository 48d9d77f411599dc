"""Pitch over time: the frame of a blade turns about the blade's axis at the root, in addition to the turn of the hub.

The pitched frame turns with the blade and coincides with that of the hub at t = 0, where the blade has its first pitch
already. With the pitch θ(t), φ = θ − θ(0), the axis e and the rotation R = exp(φ e), vectors of the hub's frame have
the components Rᵀ v in the pitched one, and

    w = Rᵀ w_hub + θ̇ e,        ẇ = Rᵀ ẇ_hub − θ̇ e×Rᵀ w_hub + θ̈ e.

The root r stays where it is in both, so the origin, the point of the pitched frame that was the hub's center, moves
unless the axis of the pitch goes through that center:

    v_o = Rᵀ (w_hub×r) − w×r,        a_o = Rᵀ (a_hub + ẇ_hub×r + w_hub×(w_hub×r)) − ẇ×r − w×(w×r).

So bodies, strains, sections and theories know nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.differentiation import Derivative

Scalar = Callable[[float], float]
Array = npt.NDArray[np.float64]

#: A quantity over time and its two rates.
WithRates = tuple[Scalar, Scalar, Scalar]


def turn_about(axis: Array, angle: float) -> Array:
    """Return the matrix (3, 3) of the turn by an angle (rad) about a unit vector (Rodrigues' formula)."""
    eye, cross, twice = _parts_of_turn(*axis)
    return np.asarray(eye + np.sin(angle) * cross + (1 - np.cos(angle)) * twice)


@lru_cache(maxsize=8)
def _parts_of_turn(*axis: float) -> tuple[Array, Array, Array]:
    cross: Array = np.asarray(np.cross(axis, np.eye(3)).T, dtype=np.float64)
    return np.eye(3), cross, cross @ cross


def is_beside(root: npt.ArrayLike, axis: npt.ArrayLike) -> bool:
    """Return whether the line through the root (m) along an axis misses the origin."""
    arm, along = np.asarray(root, dtype=float), np.asarray(axis, dtype=float)
    return bool(np.linalg.norm(np.cross(arm, along)) > 1e-12 * np.linalg.norm(arm))


@dataclass(frozen=True)
class Pitch:
    """The pitch of a blade over time.

    Attributes:
        angle: θ(t), rad.
        rate: θ̇(t), rad/s.
        acceleration: θ̈(t), rad/s².
        axis: unit vector e along the blade at its root, the same in both frames.
        root: position of the root, m, the same in both frames.
        knots: times (s) at which the acceleration may jump.
        known: whether these are all; a function has to be sampled.
        start: θ(0), rad.
        changes: whether it changes with time.
    """

    angle: Scalar
    rate: Scalar
    acceleration: Scalar
    axis: Array
    root: Array
    knots: tuple[float, ...] = ()
    known: bool = True
    start: float = 0.0
    changes: bool = True

    @cached_property
    def moves_origin(self) -> bool:
        """Whether the center of the hub is not on its axis."""
        return is_beside(self.root, self.axis)

    @property
    def signals(self) -> dict[str, Scalar]:
        """The angle and its rates by the names of their signals (see `rotfem.mechanics.time_signals`)."""
        names = ("structure.root.pitch", "pitch.rate", "pitch.acceleration")
        return dict(zip(names, (self.angle, self.rate, self.acceleration), strict=True))

    def held(self) -> Pitch:
        """Return the pitch that stays as it is at t = 0."""
        angle, rate, acceleration = constant_pitch(self.start)
        return replace(self, angle=angle, rate=rate, acceleration=acceleration, knots=(), known=True, changes=False)

    def turned(self, t: float) -> float:
        """Return φ = θ(t) − θ(0), rad."""
        return self.angle(t) - self.start

    def rotation(self, t: float) -> Array:
        """Return R(t), shape (3, 3): components in the hub's frame = R · components in the pitched frame."""
        return turn_about(self.axis, self.turned(t))

    def moved(self, turn: tuple[Any, Any, Any], w: Array, dw: Array, a_o: Array) -> dict[str, Array]:
        """Return the motion of the pitched frame: w, dw, a_o and v_o, the velocity of its origin, its components.

        With them "pitch" (cos φ − 1, sin φ) and "pitch_rate", its rate (1/s). Of many times at once all have one more
        dimension, which comes first.
        """
        phi, rate, acceleration = (np.asarray(x)[..., None] for x in turn)
        c, s, e, r = np.cos(phi), np.sin(phi), self.axis, self.root
        of_hub = self.seen(phi, w)
        spin = of_hub + rate * e
        change = self.seen(phi, dw) - rate * np.cross(e, of_hub) + acceleration * e
        origin, velocity = self.seen(phi, a_o), np.zeros_like(spin)
        if self.moves_origin:
            of_root: Any = np.cross(dw, r) + np.cross(w, np.cross(w, r))
            origin = origin + self.seen(phi, of_root) - np.cross(change, r) - np.cross(spin, np.cross(spin, r))
            velocity = self.seen(phi, np.asarray(np.cross(w, r))) - np.cross(spin, r)
        turned = {"pitch": np.concatenate([c - 1.0, s], axis=-1)}
        turned["pitch_rate"] = rate * np.concatenate([-s, c], axis=-1)
        return {"w": spin, "dw": change, "a_o": origin, "v_o": velocity, **turned}

    def seen(self, phi: Array, v: Array) -> Array:
        """Return the components Rᵀ v of vectors (…, 3) of the hub's frame at turns φ (…, 1)."""
        _, cross, twice = _parts_of_turn(*self.axis)
        return np.asarray(v - np.sin(phi) * (v @ cross.T) + (1 - np.cos(phi)) * (v @ twice.T))

    def in_hub_axes(self, values: Array, t: float) -> Array:
        """Return vectors (…, 3 n), n of them one after the other, with components in the hub's frame."""
        triples = values.reshape(*values.shape[:-1], -1, 3)
        return np.asarray((triples @ self.rotation(t).T).reshape(values.shape))


def constant_pitch(angle: float) -> WithRates:
    """Return (θ, θ̇, θ̈) of an angle (rad) that stays."""
    return (lambda t: angle), (lambda t: 0.0), (lambda t: 0.0)


def tabulated_pitch(rows: npt.ArrayLike) -> WithRates:
    """Return (θ, θ̇, θ̈) through rows (t in s, θ in rad): at rest at the first and the last, and before and after them.

    Piecewise cubics without overshoot, whose rate is continuous (Fritsch & Carlson, SIAM J. Numer. Anal. 17, 1980,
    238), since a rate that jumps takes a moment without bound.
    """
    from scipy import interpolate  # only a table needs it, and it is slow to load

    t, angles = np.asarray(rows, dtype=float).T
    slopes = interpolate.PchipInterpolator(t, angles).derivative()(t)
    slopes[[0, -1]] = 0.0
    curve: Any = interpolate.CubicHermiteSpline(t, angles, slopes)
    first, second = curve.derivative(), curve.derivative(2)

    def inside(s: float) -> bool:
        return bool(t[0] <= s < t[-1])

    return (
        lambda s: float(curve(min(max(s, t[0]), t[-1]))),
        lambda s: float(first(s)) if inside(s) else 0.0,
        lambda s: float(second(s)) if inside(s) else 0.0,
    )


def differentiated(angle: Scalar, rate: Scalar | None = None, cell: float | None = None) -> WithRates:
    """Return (θ, θ̇, θ̈) of a function of time: differences whose step follows it, not before t = 0."""
    first = rate or Derivative(angle, 1, cell, (0.0,))
    return angle, first, Derivative(angle, 2, cell, (0.0,)) if rate is None else Derivative(rate, 1, cell, (0.0,))


def harmonic_pitch(amplitude: float, phase: float, turn: WithRates) -> WithRates:
    """Return (θ, θ̇, θ̈) of amplitude · cos(α + phase), of an angle α(t) and its two rates."""
    alpha, rate, acceleration = turn

    def at(t: float) -> tuple[float, float]:
        return amplitude * np.cos(alpha(t) + phase), amplitude * np.sin(alpha(t) + phase)

    return (
        lambda t: float(at(t)[0]),
        lambda t: float(-rate(t) * at(t)[1]),
        lambda t: float(-acceleration(t) * at(t)[1] - rate(t) ** 2 * at(t)[0]),
    )
