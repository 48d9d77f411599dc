"""The words every form is written in: bodies, strains, springs, and the unknown with its rates."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import ufl


class Moved:
    """What work is done on: x, an expression of q."""

    x: Any

    def variation(self, k: Kinematics) -> Any:
        """Return δx."""
        return k.variation(self.x)

    def rigid_turn(self, e: Any) -> Any:
        """Return the change of x in a unit rigid turn about the axis e: e×x of a vector, 1 of an angle about e."""
        e = self.resolve(e)
        return ufl.cross(e, self.x) if ufl.as_ufl(self.x).ufl_shape else e[2]

    def resolve(self, v: Any) -> Any:
        """Return a vector of the frame in the axes that x and its rates are given in, here those of the frame."""
        return v


@dataclass(frozen=True)
class Body(Moved):
    """Mass that a material vector carries.

    Attributes:
        x: the vector as an expression of q, three frame components (m for a position, 1 for a director).
        density: mass per measure (kg/m, kg) for a position, second moment of mass (kg·m, kg·m^2) for a director.
        measure: UFL measure the body lives on.
        is_position: whether x moves with the origin of the frame (positions do, directors do not).
        effect: the effect that brings it, "" where it is always there.
    """

    x: Any
    density: Any
    measure: Any
    is_position: bool = True
    effect: str = ""

    def rate(self, k: Kinematics) -> Any:
        """Return ẋ relative to the frame."""
        return k.rate(self.x)

    def second_rate(self, k: Kinematics) -> Any:
        """Return ẍ relative to the frame."""
        return k.second_rate(self.x)

    def spin(self, k: Kinematics) -> Any:
        """Return the angular velocity ω relative to the frame of the section that a director is fixed in, its axes."""
        raise NotImplementedError


@dataclass(frozen=True)
class Gain:
    """What an effect adds to a strain, as expressions of q.

    Attributes:
        first: the part of first order in q, all that a theory of first order takes; the number 0 if there is none.
        higher: the rest.
    """

    first: Any
    higher: Any


@dataclass(frozen=True)
class Strain:
    """One strain measure with the stiffness that makes energy of it: W = ∫ ½ Γ·C Γ.

    Attributes:
        name: "axial", "shear", "bending", …
        value: Γ as an expression of q, scalar or vector.
        stiffness: C, scalar (N, N·m^2) or matrix.
        measure: UFL measure.
        gains: effect ↦ what it adds to Γ.
    """

    name: str
    value: Any
    stiffness: Any
    measure: Any
    gains: Mapping[str, Gain] = field(default_factory=dict)

    def gaining(self, effects: Collection[str], switched: Callable[[str, Any], Any], first_order: bool) -> Strain:
        """Return the strain with what these effects add to it, each times its switch."""
        value = self.value
        for name, gain in self.gains.items():
            part = gain.first if first_order else gain.first + gain.higher
            if name in effects and not isinstance(part, int):
                value += switched(name, part)
        return replace(self, value=value, gains={})

    def force(self, strain: Any) -> Any:
        """Return C Γ, the conjugate force (N) or moment (N·m)."""
        return ufl.dot(self.stiffness, strain) if ufl.as_ufl(self.stiffness).ufl_shape else self.stiffness * strain

    @property
    def energy(self) -> Any:
        """∫ ½ Γ·C Γ, J."""
        return ufl.inner(self.force(self.value), self.value) / 2 * self.measure


@dataclass(frozen=True)
class RootSpring(Moved):
    """A spring and a damper against a turn of the root.

    Attributes:
        x: the angle as an expression of q, rad.
        stiffness: N·m/rad, a constant.
        damping: N·m·s/rad, a constant.
        measure: UFL measure of the root.
        axis: that it turns about, 1 to 3.
        drift: rate of the angle at rest in the frame (rad/s), where the frame pitches and the axis does not.
    """

    x: Any
    stiffness: Any
    damping: Any
    measure: Any
    axis: int
    drift: Any = 0


def _half(a: Any, b: Any, sign: int = 1) -> Any:
    """Return (a ± b)/2, the number 0 where both are."""
    return 0 if isinstance(a, int) and isinstance(b, int) else (a + sign * b) / 2


@dataclass(frozen=True)
class Support(Moved):
    """A spring and a damper of a beam, in the frame: forces −K x − D ẋ, or moments of turns x.

    Attributes:
        x: displacement (m) or turn (rad) as an expression of q, components along directions 2 and 3 across the axis.
        stiffness: K, rows of two (N/m, N·m/rad), constants or 0.
        damping: D likewise (N·s/m, N·m·s/rad).
        measure: UFL measure of its place.
        at_rest: whether it stands in the fixed frame, also where the frame rotates; else it turns with the hub.
        across: whether x is across the axis; that of a coupling may be the stretch and the twist along it.
    """

    x: Any
    stiffness: Any
    damping: Any
    measure: Any
    at_rest: bool = True
    across: bool = True

    def rigid_turn(self, e: Any) -> Any:
        """Return e×x of a support in the fixed frame; nothing of one that turns with the hub."""
        return ufl.as_vector((-e[0] * self.x[1], e[0] * self.x[0])) if self.at_rest else ufl.zero(2)

    def symmetric(self) -> Any:
        """Return the rows of the symmetric part of K."""
        (a, b), (c, d) = self.stiffness
        return ((a, _half(b, c)), (_half(b, c), d))

    def skew(self) -> Any:
        """Return the rows of the skew part of K, by which a support may feed energy to a whirl."""
        (_, b), (c, _) = self.stiffness
        half = _half(b, c, -1)
        return ((0, half), (-half, 0))


@dataclass(frozen=True)
class Damping:
    """Viscosity η (s) of the strains and mass-proportional rate a0 (1/s), constants or None.

    Attributes:
        models: registered damping model ↦ its coefficient, a constant.
    """

    stiffness: Any = None
    mass: Any = None
    models: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Kinematics:
    """The unknown and its rates, q, v = q̇, a = q̈, and its variation dq: all components that a structure has.

    Attributes:
        made_of: see `functions`; None for themselves.
    """

    q: Any
    v: Any
    a: Any
    dq: Any
    made_of: tuple[Any, Any, Any, Any] | None = None

    @property
    def functions(self) -> tuple[Any, Any, Any, Any]:
        """The coefficients q, v, a and the test function of the space, of which q, v, a and dq are made."""
        return self.made_of or (self.q, self.v, self.a, self.dq)

    def rate(self, x: Any) -> Any:
        """Return ẋ of an expression x(q)."""
        q, v, _, _ = self.functions
        return ufl.derivative(x, q, v)

    def second_rate(self, x: Any) -> Any:
        """Return ẍ of an expression x(q)."""
        q, v, a, _ = self.functions
        return ufl.derivative(x, q, a) + ufl.derivative(self.rate(x), q, v)

    def variation(self, x: Any) -> Any:
        """Return δx of an expression x(q)."""
        q, _, _, dq = self.functions
        return ufl.derivative(x, q, dq)
