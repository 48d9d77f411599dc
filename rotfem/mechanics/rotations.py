"""Finite rotations by their rotation vector θ, as UFL expressions: Rodrigues' formula and its tangent map.

With s = |θ|², A = sin|θ|/|θ|, B = (1 − cos|θ|)/s and C = (|θ| − sin|θ|)/|θ|³ (Cardona & Géradin 1988, section 2),

    Λ v = v + A θ×v + B θ×(θ×v)               rotation
    K   = θ' − B θ×θ' + C θ×(θ×θ')            axial vector of Λᵀ Λ', components along the turned axes
    k   = θ' + B θ×θ' + C θ×(θ×θ') = Λ K      axial vector of Λ' Λᵀ, components along the fixed axes

K(θ') is one-to-one up to |θ| = 2π, where A = B = 0 takes away every change of θ across θ.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import factorial, pi
from typing import Any

import ufl
from ufl import cross

#: Largest |θ| of the rotation vector, rad; a little beyond, so that a full circle itself can be reached.
FULL_TURN = 2 * pi * (1 + 1e-6)

#: |θ|² below which A, B and C are power series: beyond, the closed forms lose no digits even when derived three times.
SERIES_UP_TO = 1.0

#: Terms of the series; the first one left out is 1/19! of the sum or less.
TERMS = 9


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
