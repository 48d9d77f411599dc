"""Finite rotations by their rotation vector θ, as UFL expressions and arrays: Rodrigues' formula, its tangent map.

With s = |θ|², A = sin|θ|/|θ|, B = (1 − cos|θ|)/s and C = (|θ| − sin|θ|)/|θ|³ (Cardona & Géradin 1988, section 2),

    Λ v = v + A θ×v + B θ×(θ×v)               rotation
    K   = θ' − B θ×θ' + C θ×(θ×θ')            axial vector of Λᵀ Λ', components along the turned axes
    k   = θ' + B θ×θ' + C θ×(θ×θ') = Λ K      axial vector of Λ' Λᵀ, components along the fixed axes

K(θ') is one-to-one up to |θ| = 2π, where A = B = 0 takes away every change of θ across θ.

Λ = exp(θ). The two angles of a plate are those of `rotfem.mechanics.strains`, t = R_2(−alpha_1) R_1(alpha_2) a_3. A
rotation has many vectors and a director many pairs of angles: the way back takes those nearest to a guess.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import factorial, pi
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from ufl import cross

#: Largest |θ| of the rotation vector, rad; a little beyond, so that a full circle itself can be reached.
FULL_TURN = 2 * pi * (1 + 1e-6)

#: |θ|² below which A, B and C are power series: beyond, the closed forms lose no digits even when derived three times.
SERIES_UP_TO = 1.0

#: Terms of the series; the first one left out is 1/21! of the sum or less.
TERMS = 10


def factors(theta: Any) -> tuple[Any, Any, Any]:
    """Return A, B, C of a rotation vector; smooth at θ = 0, where the branch with 0/0 is not taken."""
    s = ufl.dot(theta, theta)
    size = ufl.sqrt(s)
    small = ufl.lt(s, SERIES_UP_TO)
    b = ufl.conditional(small, _series(s, 2), (1 - ufl.cos(size)) / s)
    c = ufl.conditional(small, _series(s, 3), (1 - ufl.sin(size) / size) / s)
    return 1 - s * c, b, c


def _series(s: Any, n: int) -> Any:
    """Return Σ (−s)^k / (2k + n)!, k < TERMS, by Horner's rule: B for n = 2, C for n = 3."""
    out: Any = 1 / factorial(2 * (TERMS - 1) + n)
    for k in range(TERMS - 2, -1, -1):
        out = 1 / factorial(2 * k + n) - s * out
    return out


@dataclass(frozen=True)
class Turn:
    """The rotation Λ(θ) and its rates.

    Attributes:
        theta: rotation vector θ, an expression.
        exact: False takes A, B, C at θ = 0: Λ and T are then right to second order in θ.
    """

    theta: Any
    exact: bool = True
    _factors: tuple[Any, Any, Any] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        values = factors(self.theta) if self.exact else (1, 1 / 2, 1 / 6)
        object.__setattr__(self, "_factors", values)

    def rotate(self, v: Any) -> Any:
        """Return Λ v."""
        a, b, _ = self._factors
        return self._map(a, b, v)

    def rotate_back(self, v: Any) -> Any:
        """Return Λᵀ v."""
        a, b, _ = self._factors
        return self._map(-a, b, v)

    def material_rate(self, dtheta: Any) -> Any:
        """Return K: the rate of turning along the turned axes, for a rate dθ of the rotation vector."""
        _, b, c = self._factors
        return self._map(-b, c, dtheta)

    def spatial_rate(self, dtheta: Any) -> Any:
        """Return k: the rate of turning along the fixed axes, for a rate dθ of the rotation vector."""
        _, b, c = self._factors
        return self._map(b, c, dtheta)

    def _map(self, first: Any, second: Any, v: Any) -> Any:
        """Return v + first θ×v + second θ×(θ×v)."""
        turned = cross(self.theta, v)
        return v + first * turned + second * cross(self.theta, turned)


Array = npt.NDArray[np.float64]

#: |θ| below which a rotation vector has the direction of the guess.
NO_TURN = 1e-12


# --- rotation vectors -------------------------------------------------------------------------------------------------


def rotations(theta: Array) -> Array:
    """Return Λ(θ), shape (…, 3, 3), of rotation vectors (…, 3) in rad."""
    from scipy.spatial.transform import Rotation  # slow to load, and only large rotations need it

    return np.asarray(Rotation.from_rotvec(theta.reshape(-1, 3)).as_matrix().reshape(*theta.shape, 3))


def material_curvature(theta: Array, dtheta: Array) -> Array:
    """Return axial(Λᵀ Λ') (…, 3), components along the fixed axes, of θ and θ' (1/m)."""
    _, b, c, *_ = _factors(np.sum(theta * theta, axis=-1))
    turned = np.cross(theta, dtheta)
    return np.asarray(dtheta - b[..., None] * turned + c[..., None] * np.cross(theta, turned))


def spins(theta: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Return angular velocity ω = axial(Λ̇ Λᵀ) and ω̇ (…, 3), fixed axes, of θ, θ̇ = v (rad/s) and θ̈ = a (rad/s²)."""
    s, rate = np.sum(theta * theta, axis=-1), 2 * np.sum(theta * v, axis=-1)
    _, b, c, db, dc = (factor[..., None] for factor in _factors(s))
    rate = rate[..., None]
    first, second = np.cross(theta, v), np.cross(theta, np.cross(theta, v))
    w = v + b * first + c * second
    dw = a + b * np.cross(theta, a) + c * np.cross(theta, np.cross(theta, a))
    dw += db * rate * first + dc * rate * second + c * np.cross(v, first)
    return w, dw


def turned_vectors(theta: Array, turn: Array) -> Array:
    """Return by how much rotation vectors (…, 3), rad, change in a small turn (3,), fixed axes: T⁻¹(θ) δφ.

    Of ω = T(θ) θ̇ (see `spins`): T⁻¹(θ) δφ = δφ − ½ θ×δφ + (1 − ½|θ| cot ½|θ|)/|θ|² θ×(θ×δφ).
    """
    a, b, *_ = (factor[..., None] for factor in _factors(np.sum(theta * theta, axis=-1)))
    s = np.sum(theta * theta, axis=-1)[..., None]
    across = np.where(s > NO_TURN, (1 - a / (2 * b)) / np.maximum(s, NO_TURN), 1 / 12)
    first = np.cross(theta, turn)
    return np.asarray(turn - first / 2 + across * np.cross(theta, first))


def rotation_vectors(Lambda: Array, guess: Array) -> Array:
    """Return rotation vectors (…, 3), rad, of matrices (…, 3, 3): of all that they have those nearest to a guess."""
    from scipy.spatial.transform import Rotation

    vectors = Rotation.from_matrix(Lambda.reshape(-1, 3, 3)).as_rotvec().reshape(guess.shape)
    angle, size = (np.linalg.norm(x, axis=-1)[..., None] for x in (vectors, guess))
    along = np.where(size > 0.0, guess / np.where(size, size, 1.0), np.eye(3)[0])
    axis = np.where(angle > NO_TURN, vectors / np.where(angle > NO_TURN, angle, 1.0), along)
    whole = np.round((np.sum(axis * guess, axis=-1)[..., None] - angle) / (2 * np.pi))
    return np.asarray((angle + 2 * np.pi * whole) * axis)


def _factors(s: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return A, B, C of `rotfem.mechanics.rotations.factors`, dB/ds and dC/ds for s = |θ|²."""
    small = s < SERIES_UP_TO
    z = np.where(small, s, 0.0)
    b, c, db, dc = (np.zeros_like(s) for _ in range(4))
    for k in range(TERMS, -1, -1):
        b, c = 1 / factorial(2 * k + 2) - z * b, 1 / factorial(2 * k + 3) - z * c
        db, dc = (-(k + 1) / factorial(2 * k + 4) - z * db, -(k + 1) / factorial(2 * k + 5) - z * dc)
    big = np.where(small, 1.0, s)
    size = np.sqrt(big)
    a, cosine = np.sin(size) / size, np.cos(size)
    B, C = (1 - cosine) / big, (1 - a) / big
    b, c = np.where(small, b, B), np.where(small, c, C)
    db = np.where(small, db, (a / 2 - B) / big)
    dc = np.where(small, dc, ((a - cosine) / (2 * big) - C) / big)
    return 1 - s * c, b, c, db, dc


# --- the two angles of a plate ----------------------------------------------------------------------------------------


def triads(alpha: Array) -> Array:
    """Return (t_1, t_2, t) of angles (…, 2) in rad as columns, shape (…, 3, 3): `rotfem.mechanics.strains.triad`."""
    c1, s1, c2, s2 = np.cos(alpha[..., 0]), np.sin(alpha[..., 0]), np.cos(alpha[..., 1]), np.sin(alpha[..., 1])
    rows = [[c1, -s1 * s2, -s1 * c2], [np.zeros_like(c1), c2, -s2], [s1, c1 * s2, c1 * c2]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def tilts(alpha: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Return −t_γ·ṫ (rad/s) and −t_γ·ẗ (rad/s²), (…, 2), of rates v, a: those of angles counted from the triad."""
    c2, s2 = np.cos(alpha[..., 1]), np.sin(alpha[..., 1])
    first = np.stack([c2 * v[..., 0], v[..., 1]], axis=-1)
    second = [c2 * a[..., 0] - 2 * s2 * v[..., 0] * v[..., 1], a[..., 1] + s2 * c2 * v[..., 0] ** 2]
    return first, np.stack(second, axis=-1)


def tilt_angles(t: Array, guess: Array) -> Array:
    """Return the angles (…, 2), rad, of directors (…, 3): of all that they have those nearest to a guess."""
    across = np.hypot(t[..., 0], t[..., 2])
    first = np.where(across > 1e-8, np.arctan2(-t[..., 0], t[..., 2]), guess[..., 0])
    second = np.arctan2(-t[..., 1], across)
    pairs = np.stack([np.stack([first, second], -1), np.stack([first + np.pi, np.pi - second], -1)])
    pairs = pairs + 2 * np.pi * np.round((guess - pairs) / (2 * np.pi))
    distance = np.sum((pairs - guess) ** 2, axis=-1)
    return np.where((distance[0] <= distance[1])[..., None], pairs[0], pairs[1])
