"""Finite rotations by their rotation vector θ, as UFL expressions: Rodrigues' formula and its tangent map.

With s = |θ|², A = sin|θ|/|θ|, B = (1 − cos|θ|)/s and C = (|θ| − sin|θ|)/|θ|³ (Cardona & Géradin 1988, section 2),

    Λ v = v + A θ×v + B θ×(θ×v)               rotation
    K   = θ' − B θ×θ' + C θ×(θ×θ')            axial vector of Λᵀ Λ', components along the turned axes
    k   = θ' + B θ×θ' + C θ×(θ×θ') = Λ K      axial vector of Λ' Λᵀ, components along the fixed axes

K(θ') is one-to-one up to |θ| = 2π, where A = B = 0 takes away every change of θ across θ.
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
import ufl
from ufl import cross

#: Largest |θ| of the rotation vector, rad; a little beyond, so that a full circle itself can be reached.
FULL_TURN = 2 * np.pi * (1 + 1e-6)

#: |θ|² below which A, B and C are power series: beyond, the closed forms lose no digits even when derived three times.
SERIES_UP_TO = 1.0

#: Terms of the series; the first one left out is 1/19! of the sum or less.
TERMS = 9


def factors(theta: Any) -> tuple[Any, Any, Any]:
    """Return A, B, C of a rotation vector; smooth at θ = 0, where the branch with 0/0 is not taken."""
    s = ufl.dot(theta, theta)
    size = ufl.sqrt(s)
    closed = (ufl.sin(size) / size, (1 - ufl.cos(size)) / s, (size - ufl.sin(size)) / (size * s))
    small = ufl.lt(s, SERIES_UP_TO)
    a, b, c = (ufl.conditional(small, _series(s, n), f) for n, f in enumerate(closed, start=1))
    return a, b, c


def _series(s: Any, n: int) -> Any:
    """Return Σ (−s)^k / (2k + n)!, k < TERMS, by Horner's rule: A, B, C for n = 1, 2, 3."""
    out: Any = 1 / factorial(2 * (TERMS - 1) + n)
    for k in range(TERMS - 2, -1, -1):
        out = 1 / factorial(2 * k + n) - s * out
    return out


def _map(theta: Any, first: Any, second: Any, v: Any) -> Any:
    """v + first θ×v + second θ×(θ×v)."""
    turned = cross(theta, v)
    return v + first * turned + second * cross(theta, turned)


def rotate(theta: Any, v: Any) -> Any:
    """Λ(θ) v."""
    a, b, _ = factors(theta)
    return _map(theta, a, b, v)


def rotate_back(theta: Any, v: Any) -> Any:
    """Λ(θ)ᵀ v."""
    a, b, _ = factors(theta)
    return _map(theta, -a, b, v)


def rotate_second_order(theta: Any, v: Any) -> Any:
    """Λ(θ) v to second order in θ."""
    return _map(theta, 1, 0.5, v)


def material_rate(theta: Any, dtheta: Any) -> Any:
    """K: the rate of turning along the turned axes for a rate dθ of the rotation vector."""
    _, b, c = factors(theta)
    return _map(theta, -b, c, dtheta)


def spatial_rate(theta: Any, dtheta: Any) -> Any:
    """k: the rate of turning along the fixed axes for a rate dθ; its transpose is `material_rate`."""
    _, b, c = factors(theta)
    return _map(theta, b, c, dtheta)
