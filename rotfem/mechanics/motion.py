"""Prescribed motion of the floating frame, and the constants through which every form sees it.

The frame {o; a_i} turns with angular velocity w(t) = Omega(t) e about the unit axis e, which is fixed in the frame,
and its origin has the absolute acceleration a_o(t), both resolved in the frame (Simo & Vu-Quoc 1986, section 4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.scene import Scene

Scalar = Callable[[float], float]
Array = npt.NDArray[np.float64]

IDENTITY = np.eye(3)


@dataclass(frozen=True)
class Motion:
    """Rotation about a fixed axis of the frame, and the acceleration of its origin.

    Attributes:
        speed: Omega(t) in rad/s.
        rate: dOmega/dt(t) in rad/s^2.
        angle: psi(t) = integral of Omega from 0, in rad.
        axis: unit vector e, frame components.
        base_acceleration: a_o(t), shape (3,), frame components, m/s^2.
        constant: whether Omega and a_o do not change with time.
    """

    speed: Scalar
    rate: Scalar
    angle: Scalar
    axis: Array
    base_acceleration: Callable[[float], Array]
    constant: bool

    def rotation(self, t: float) -> Array:
        """Return Q(t), shape (3, 3): inertial components = Q(t) · frame components (Rodrigues' formula)."""
        e, psi = self.axis, self.angle(t)
        cross = np.array([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
        return np.asarray(np.eye(3) + np.sin(psi) * cross + (1 - np.cos(psi)) * cross @ cross)

    def at_speed(self, omega: float) -> Motion:
        """Return the same frame spinning at the constant speed omega (rad/s)."""
        return Motion(lambda t: omega, lambda t: 0.0, lambda t: omega * t, self.axis, self.base_acceleration, True)


def smooth_spin_up(speed: float, duration: float) -> tuple[Scalar, Scalar, Scalar]:
    """Return (Omega, dOmega/dt, psi) of the spin-up Omega(t) = speed (t/T − sin(2πt/T)/2π), constant after T.

    Kane, Ryan & Banerjee 1987; ICCIA 2017 eq. (17).
    """
    T, k = duration, 2 * np.pi / duration

    def omega(t: float) -> float:
        return float(speed * (t / T - np.sin(k * t) / (2 * np.pi))) if t < T else speed

    def rate(t: float) -> float:
        return float(speed / T * (1 - np.cos(k * t))) if t < T else 0.0

    def angle(t: float) -> float:
        s = min(t, T)
        return float(speed * (s * s / (2 * T) + (np.cos(k * s) - 1) / (2 * np.pi * k)) + speed * max(t - T, 0.0))

    return omega, rate, angle


def tabulated(table: npt.ArrayLike, kind: str) -> tuple[Scalar, Scalar, Scalar]:
    """Return (Omega, dOmega/dt, psi) through the points (t, Omega), held constant outside the table.

    Args:
        table: rows (t in s, Omega in rad/s), t increasing.
        kind: "pchip" (monotone, C1), "cubic" (C2 spline) or "linear".
    """
    from scipy import interpolate  # only a table needs it, and it is slow to load

    t, omega = np.asarray(table, dtype=float).T
    if kind == "pchip":
        curve: Any = interpolate.PchipInterpolator(t, omega)
    elif kind == "cubic":
        curve = interpolate.CubicSpline(t, omega)
    else:
        curve = interpolate.make_interp_spline(t, omega, k=1)
    slope, area = curve.derivative(), curve.antiderivative()
    first, last = t[0], t[-1]
    at_zero = float(area(np.clip(0.0, first, last)) + omega[0] * min(0.0 - first, 0.0))

    def angle(s: float) -> float:
        inside = float(area(np.clip(s, first, last)))
        return inside + omega[0] * min(s - first, 0.0) + omega[-1] * max(s - last, 0.0) - at_zero

    return (
        lambda s: float(curve(np.clip(s, first, last))),
        lambda s: float(slope(s)) if first <= s < last else 0.0,
        angle,
    )


def from_callable(speed: Scalar, rate: Scalar | None, angle: Scalar | None) -> tuple[Scalar, Scalar, Scalar]:
    """Return (Omega, dOmega/dt, psi) for any function Omega(t); what is not given is computed from it.

    The missing rate is a fourth-order central difference, the missing angle an adaptive quadrature that goes on from
    the last time asked for.
    """

    def difference(t: float) -> float:
        h = 1e-3
        return float((8 * (speed(t + h) - speed(t - h)) - (speed(t + 2 * h) - speed(t - 2 * h))) / (12 * h))

    from scipy import integrate  # only a callable needs it, and it is slow to load

    last = [0.0, 0.0]

    def quadrature(t: float) -> float:
        last[1] += integrate.quad(speed, last[0], t, epsabs=1e-12, epsrel=1e-12)[0]
        last[0] = t
        return last[1]

    return (lambda t: float(speed(t)), rate or difference, angle or quadrature)


def motion_of(scene: Scene) -> Motion:
    """Return the Motion a scene prescribes; a free hub (type "torque") starts from its initial speed."""
    m = scene.motion
    constant = False
    if m.type == "spin_up":
        omega, rate, angle = smooth_spin_up(m.speed, m.duration)
    elif m.type == "table":
        omega, rate, angle = tabulated(m.table, m.interpolation)
    elif m.type == "callable":
        omega, rate, angle = from_callable(m.speed, m.rate, m.angle)
    else:
        speed, constant = m.speed, True
        omega, rate, angle = (lambda t: speed), (lambda t: 0.0), (lambda t: speed * t)
    base = m.base_acceleration
    acceleration: Callable[[float], Array] = base.at if base is not None else lambda t: np.zeros(3)
    axis = np.asarray(m.axis, dtype=float)
    steady_base = base is None or base.constant
    return Motion(omega, rate, angle, axis / np.linalg.norm(axis), acceleration, constant and steady_base)
