"""Bodies and loads that turn with a section: directors, masses beside the axis, moments.

What is fixed in the section turns with Λ(θ) at the rate ω = T(θ) θ̇ along the turned axes. A director is followed in
these axes, where it stands still and Λᵀw takes the place of w: the same accelerations as for any vector, but made of
first derivatives of T, not of second ones of Λ, which compile to a fraction of the code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl
from ufl import cross

from rotfem.kinematics import AppliedLoad, Body, Kinematics
from rotfem.rotations import Turn


def rotation_part(q: Any) -> Any:
    """Return θ of q = (u, θ), or its rate of q̇, …"""
    return ufl.as_vector([q[i] for i in (3, 4, 5)])


def spin(turn: Turn, k: Kinematics) -> Any:
    """ω = T(θ) θ̇."""
    return turn.material_rate(rotation_part(k.v))


def relative_rate(turn: Turn, k: Kinematics, d: Any) -> Any:
    """ω×d, Λᵀ times the rate of Λ d."""
    return cross(spin(turn, k), d)


def relative_second_rate(turn: Turn, k: Kinematics, d: Any) -> Any:
    """ω̇×d + ω×(ω×d) with ω̇ = T θ̈ + Ṫ θ̇, Λᵀ times the second rate of Λ d."""
    w = spin(turn, k)
    dw = turn.material_rate(rotation_part(k.a)) + k.rate(w)
    return cross(dw, d) + cross(w, cross(w, d))


def relative_variation(turn: Turn, k: Kinematics, d: Any) -> Any:
    """(T δθ)×d, Λᵀ times the variation of Λ d."""
    return cross(turn.material_rate(rotation_part(k.dq)), d)


@dataclass(frozen=True)
class Director(Body):
    """A director Λ d, given by what it is in the undeformed beam, d = x; rates are those of Λᵀ."""

    turn: Turn | None = None
    is_position: bool = False

    def _turn(self) -> Turn:
        assert self.turn is not None
        return self.turn

    def rate(self, k: Kinematics) -> Any:
        """Return ω×d."""
        return relative_rate(self._turn(), k, self.x)

    def second_rate(self, k: Kinematics) -> Any:
        """Return ω̇×d + ω×(ω×d)."""
        return relative_second_rate(self._turn(), k, self.x)

    def variation(self, k: Kinematics) -> Any:
        """Return (T δθ)×d."""
        return relative_variation(self._turn(), k, self.x)

    def resolve(self, v: Any) -> Any:
        """Return Λᵀ v."""
        return self._turn().rotate_back(v)
