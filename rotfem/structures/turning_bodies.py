"""Bodies and loads that turn with a section of q = (u, θ): directors, masses beside the axis, moments.

What is fixed in a section turns with Λ(θ), at the rate ω = T(θ) θ̇ along the turned axes. A director is followed in
these axes, where it stands still and Λᵀw takes the place of w: the same accelerations as for any vector, but made of
first derivatives of T instead of second ones of Λ, which compile to much less code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import ufl
from ufl import cross

from rotfem.mechanics.bodies import AppliedLoad, Body, Kinematics
from rotfem.mechanics.rotations import Turn


def rotation_part(q: Any) -> Any:
    """Return θ of q = (u, θ), θ̇ of q̇ and so on."""
    return ufl.as_vector([q[i] for i in (3, 4, 5)])


@dataclass(frozen=True)
class SectionTurn(Turn):
    """The turn of a section: rates of Λ d for a d fixed in the section, all times Λᵀ."""

    def spin(self, k: Kinematics) -> Any:
        """Return ω = T θ̇."""
        return self.material_rate(rotation_part(k.v))

    def rate(self, k: Kinematics, d: Any) -> Any:
        """Return ω×d."""
        return cross(self.spin(k), d)

    def second_rate(self, k: Kinematics, d: Any) -> Any:
        """Return ω̇×d + ω×(ω×d), ω̇ = T θ̈ + Ṫ θ̇."""
        w = self.spin(k)
        dw = self.material_rate(rotation_part(k.a)) + k.rate(w)
        return cross(dw, d) + cross(w, cross(w, d))

    def variation(self, k: Kinematics, d: Any) -> Any:
        """Return (T δθ)×d."""
        return cross(self.material_rate(rotation_part(k.dq)), d)


@dataclass(frozen=True, kw_only=True)
class Director(Body):
    """The director Λ x, seen along the turned axes: x is what it is in the undeformed beam."""

    turn: SectionTurn
    is_position: bool = False

    def rate(self, k: Kinematics) -> Any:
        """Return ω×x."""
        return self.turn.rate(k, self.x)

    def second_rate(self, k: Kinematics) -> Any:
        """Return ω̇×x + ω×(ω×x)."""
        return self.turn.second_rate(k, self.x)

    def variation(self, k: Kinematics) -> Any:
        """Return (T δθ)×x."""
        return self.turn.variation(k, self.x)

    def resolve(self, v: Any) -> Any:
        """Return Λᵀ v."""
        return self.turn.rotate_back(v)


@dataclass(frozen=True, kw_only=True)
class OffsetMass(Body):
    """A mass at x = r + Λ d: beside the axis r, fixed in the section.

    Attributes:
        axis: r, an expression of q.
        arm: d, what the offset is in the undeformed beam.
        turn: Λ.
    """

    axis: Any
    arm: Any
    turn: SectionTurn

    def rate(self, k: Kinematics) -> Any:
        """Return ṙ + Λ (ω×d)."""
        return k.rate(self.axis) + self.turn.rotate(self.turn.rate(k, self.arm))

    def second_rate(self, k: Kinematics) -> Any:
        """Return r̈ + Λ (ω̇×d + ω×(ω×d))."""
        return k.second_rate(self.axis) + self.turn.rotate(self.turn.second_rate(k, self.arm))

    def variation(self, k: Kinematics) -> Any:
        """Return δr + Λ (T δθ×d)."""
        return k.variation(self.axis) + self.turn.rotate(self.turn.variation(k, self.arm))


@dataclass(frozen=True, kw_only=True)
class AppliedMoment(AppliedLoad):
    """A moment on a section (N·m, frame components): it works on k(δθ), the turning along the axes of the frame.

    With x = θ its potential −M·θ, if it is dead, is right as long as θ keeps to one axis: a moment of fixed direction
    has none in general (Argyris, Comput. Meth. Appl. Mech. Eng. 32 (1982) 85).
    """

    section: SectionTurn
    conservative: ClassVar[bool] = False

    def variation(self, k: Kinematics) -> Any:
        """Return k(δθ)."""
        return self.section.spatial_rate(rotation_part(k.dq))

    def rigid_turn(self, e: Any) -> Any:
        """Return the turn in a unit rigid turn about e, e itself."""
        return e
