"""The virtual work of every effect, for any variation of the motion.

The absolute acceleration of a point x of the frame is (theory section 1)

    ẍ + 2 w×ẋ + w×(w×x) + ẇ×x + a_o,

and each term is an effect of its own. A director (a vector that does not move with the origin) feels all but a_o and
gravity; that is its rotary inertia. With `Variation` δx = δ(x(q)) the work is that of the equations of motion, with
`RigidTurn` δx = e×x δψ it is the moment about the axis e, the hub's row. Momentum and energies are sums over the same
bodies.

The floating frame is seen as constants of the forms, for its angular velocity, its acceleration and gravity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem, mesh
from ufl import cross

from rotfem.mechanics.bodies import Body, Damping, Kinematics, Moved, RootSpring, Strain
from rotfem.mechanics.loads import AppliedLoad
from rotfem.mechanics.motion import Motion
from rotfem.numerics import forms
from rotfem.numerics.forms import added
from rotfem.registry import damping_models, resolved

Array = npt.NDArray[np.float64]


class Frame:
    """The constants of the floating frame in the forms: w, dw (its rate), a_o, v_o and gravity, all frame components.

    A constant comes into being when a form first asks for it, so an effect that is off leaves none behind.

    Args:
        domain: the mesh the constants live on.
        planar: motion in the plane (a_1, a_2) only; w then has one unknown component and the cross products of the
            forms lose their zero terms symbolically.
        fixed: the frame translates with the hub but does not rotate (the inertial-frame form).
        gravity: inertial components, m/s^2.
        pitching: the frame pitches over time.

    Attributes:
        constants: name ↦ constant in the forms.
        slices: name ↦ which components of a vector of the frame it has.
        of_supports: name ↦ speed (rad/s) ↦ entries of a coefficient of supports.
        whirl: that frequency; None where it is the speed, as of an unbalance.
    """

    def __init__(
        self,
        domain: mesh.Mesh,
        planar: bool,
        fixed: bool = False,
        gravity: npt.ArrayLike = (0, 0, 0),
        pitching: bool = False,
        spun: bool = False,
    ):
        self._domain, self.planar, self.fixed, self.pitching, self.spun = domain, planar, fixed, pitching, spun
        self._gravity = np.asarray(gravity, dtype=float)
        self.constants: dict[str, fem.Constant] = {}
        self._entries: dict[str, Array] = {}  # of the constants, where they are
        self.of_supports: dict[str, Callable[[float], Array]] = {}
        self.whirl: float | None = None
        turn, plane = (slice(2, 3), slice(0, 2)) if planar else (slice(0, 3), slice(0, 3))
        self.slices = {"w": turn, "dw": turn, "a_o": plane, "v_o": plane, "gravity": plane}
        self.slices |= dict.fromkeys(("pitch", "pitch_rate"), slice(0, 2)) | {"psi": slice(0, 1)}

    def _constant(self, name: str, size: int) -> fem.Constant:
        if name not in self.constants:
            self.constants[name] = forms.constant(self._domain, np.zeros(size, dtype=default_scalar_type))
            self._entries[name] = self.constants[name].value
        return self.constants[name]

    def _vector(self, name: str) -> Any:
        """Return a vector of the frame; in the plane w and dw have component 3 alone, the others lack it."""
        if not self.planar:
            return self._constant(name, 3)
        if name in ("w", "dw"):
            return ufl.as_vector((0, 0, self._constant(name, 1)[0]))
        c = self._constant(name, 2)
        return ufl.as_vector((c[0], c[1], 0))

    w = property(lambda self: self._vector("w"), doc="Angular velocity, rad/s.")
    dw = property(lambda self: self._vector("dw"), doc="Rate of the angular velocity, rad/s².")
    a_o = property(lambda self: self._vector("a_o"), doc="Absolute acceleration of the origin, m/s².")
    v_o = property(lambda self: self._vector("v_o"), doc="Velocity of the origin, m/s, by a pitch about another axis.")
    gravity = property(lambda self: self._vector("gravity"), doc="Acceleration of gravity, m/s².")

    @property
    def psi(self) -> Any:
        """Angle of the hub about axis 3, rad, which a frame that does not rotate sees."""
        return self._constant("psi", 1)[0]

    @property
    def pitch(self) -> tuple[Any, Any]:
        """(cos φ, sin φ) of the turn φ of a frame that pitches; the constants are zero at φ = 0."""
        c = self._constant("pitch", 2)
        return 1 + c[0], c[1]

    @property
    def pitch_rate(self) -> tuple[Any, Any]:
        """Their rates, 1/s."""
        c = self._constant("pitch_rate", 2)
        return c[0], c[1]

    def values(self, motion: Motion, t: float) -> dict[str, Array]:
        """Return the value of every constant in use at time t (s), as arrays of the constants' sizes."""
        out: dict[str, Array] = {}
        moved = motion.frame(t)
        for name in self.constants:
            if name in self.of_supports:
                out[name] = self.of_supports[name](motion.speed(t))
                continue
            if name == "gravity":
                value = self._gravity if self.fixed else motion.rotation(t).T @ self._gravity
            elif name == "psi":
                value = motion.angle(t) * motion.axis[2:]
            else:
                value = motion.rotation(t) @ moved[name] if self.fixed and name == "a_o" else moved[name]
            out[name] = value[self.slices[name]]
        return out

    def coefficients(self, name: str, given: Any) -> Any:
        """Return the rows of a 2×2 matrix of a support: entries of a constant, numbers 0 where they always vanish.

        Args:
            name: of the constant, which has the entries that do not vanish, one where it is that times the identity.
            given: the matrix, or what gives it `at` a speed and a frequency of whirl (rad/s), with all its `rows`.
        """
        all_of = np.reshape(getattr(given, "rows", [given]), (-1, 4))
        there = np.flatnonzero(np.any(all_of != 0.0, axis=0))
        if not len(there):
            return ((0, 0), (0, 0))
        scalar = list(there) == [0, 3] and bool(np.all(all_of[:, 0] == all_of[:, 3]))
        entries = there[:1] if scalar else there
        self.of_supports[name] = lambda speed: self.coefficient(given, speed).ravel()[entries]
        c = self._constant(name, len(entries))
        a, b, d, e = (c[0 if scalar else int(np.searchsorted(there, i))] if i in there else 0 for i in range(4))
        return ((a, b), (d, e))

    def coefficient(self, given: Any, speed: float) -> Array:
        """Return a 2×2 matrix of a support at a speed (rad/s) and the frequency of whirl."""
        if not hasattr(given, "at"):
            return np.array(given)
        return np.asarray(given.at(speed, speed if self.whirl is None else self.whirl))

    def set(self, values: dict[str, Array]) -> None:
        """Write values (from `values`) into the constants."""
        for name, value in values.items():
            self._entries[name][:] = value


@dataclass(frozen=True)
class Variation:
    """The variation δq of the unknowns."""

    k: Kinematics
    within_frame = True

    def of(self, moving: Moved) -> Any:
        """Return δx of a body, or of what a load works on."""
        return moving.variation(self.k)


@dataclass(frozen=True)
class RigidTurn:
    """The variation δψ = 1 of a turn of the frame with all that is in it about the unit axis e."""

    e: Any
    within_frame = False

    def of(self, moving: Moved) -> Any:
        """Return e×x of a body, or of what a load works on."""
        return moving.rigid_turn(self.e)


class Place:
    """x instead of its variation, for potentials of forces and springs."""

    within_frame = True

    def of(self, moving: Moved) -> Any:
        """Return x of a body, or of what a load works on."""
        return moving.x


@dataclass(frozen=True)
class Mechanics:
    """The quantities of which effects write their work.

    Attributes:
        bodies: all mass, part by part.
        strains: with the stored energy.
        loads: applied forces and moments.
        k: the unknowns and their rates.
        frame: w, dw, a_o and gravity.
        damping: coefficients.
        structure: the discretised structure: measures, fields, the position.
    """

    bodies: list[Body]
    strains: list[Strain]
    loads: list[AppliedLoad]
    k: Kinematics
    frame: Frame
    damping: Damping
    structure: Any

    def carried(self, body: Body) -> Any:
        """Return the velocity by the spin, in axes of the body: w×x; in the fixed frame only directors have it."""
        if not self.frame.spun:
            return cross(body.resolve(self.frame.w), body.x)
        return ufl.zero(3) if body.is_position else cross(self.frame.w, body.x)

    def strain_rate(self, strain: Strain) -> Any:
        """Return the rate of a strain seen from the structure: of a shaft in the fixed frame Γ̇ − w×Γ.

        A section that is the same in all directions turns under its strains: those across the axis pass from one to the
        other direction.
        """
        rate = self.k.rate(strain.value)
        if not self.frame.spun:
            return rate
        omega, (kind, _, direction) = self.frame.w[0], strain.name.partition("_")
        if strain.name == "section":
            g = strain.value
            return rate + omega * ufl.as_vector((g[1], -g[0], 0, g[4], -g[3]))
        other = next((s for s in self.strains if s.name == f"{kind}_{5 - int(direction or 0)}"), None)
        return rate if other is None else rate + (omega if direction == "2" else -omega) * other.value

    def rate(self, body: Body) -> Any:
        """Return ẋ seen from the structure: of a shaft in the fixed frame ẋ − w×x."""
        if not self.frame.spun:
            return body.rate(self.k)
        w = self.frame.w
        return (
            body.rate(self.k) - cross(w, body.x)
            if body.is_position
            else body.rate(self.k) + cross(w - body.resolve(w), body.x)
        )

    def gyroscopic(self, body: Body) -> Any:
        """Return 2 w×ẋ; of a director d of a shaft in the fixed frame, which turns at ω + w in its axes, 2 ω×(w×d)."""
        if not self.frame.spun:
            return 2 * cross(body.resolve(self.frame.w), body.rate(self.k))
        return None if body.is_position else 2 * cross(body.spin(self.k), cross(self.frame.w, body.x))

    def euler(self, body: Body) -> Any:
        """Return ẇ×x; of a shaft in the fixed frame that of directors."""
        if not self.frame.spun:
            return cross(body.resolve(self.frame.dw), body.x)
        return None if body.is_position else cross(self.frame.dw, body.x)

    def velocity(self, body: Body) -> Any:
        """Return ẋ + w×x (ẋ in a frame that does not rotate), the origin's apart, in the axes of the body."""
        rate = body.rate(self.k)
        return rate if self.frame.fixed else rate + self.carried(body)

    def resultant(self, name: str) -> Any:
        """Return the stress resultant of the strain of a name ("axial", "bending", …), N or N·m, as an expression."""
        strain = next(s for s in self.strains if s.name == name)
        return strain.force(strain.value)

    def springs(self) -> list[RootSpring]:
        """Return the springs and dampers of the root's hinges.

        The turns are those from the hub: in a frame that does not rotate less its angle, in one that pitches flap and
        lag about axes that do not.
        """
        springs: list[RootSpring] = self.structure.springs()
        if self.frame.fixed:
            return [replace(s, x=s.x - self.frame.psi, drift=-self.frame.w[2]) for s in springs]
        turns = {s.axis: s.x for s in springs}
        if not self.frame.pitching or not {2, 3} <= turns.keys():
            return springs
        (c, s), (dc, ds), flap, lag = self.frame.pitch, self.frame.pitch_rate, turns[2], turns[3]
        still = {2: (c * flap - s * lag, dc * flap - ds * lag), 3: (c * lag + s * flap, dc * lag + ds * flap)}
        return [replace(y, x=still[y.axis][0], drift=still[y.axis][1]) if y.axis in still else y for y in springs]

    def positions(self) -> list[Body]:
        """Return the bodies of the structure itself that are points of it, not directors: its axis or mid-surface."""
        return [body for body in self.bodies if body.is_position and not body.effect]


# --- terms of the residual --------------------------------------------------------------------------------------------


def _work_of(law: str, acceleration: Callable[[Mechanics, Body], Any]) -> Callable[[Mechanics, Any], Any]:
    """Return the effect Σ ∫ ρ a·δx over the bodies that feel an acceleration a, None of those that do not."""

    def work(m: Mechanics, delta: Any) -> Any:
        felt = ((body, a) for body in m.bodies if (a := acceleration(m, body)) is not None)
        return added(body.density * ufl.inner(a, delta.of(body)) * body.measure for body, a in felt)

    work.__doc__ = f"Return the work of {law}."
    return work


inertia = _work_of("ẍ, the acceleration relative to the frame", lambda m, b: b.second_rate(m.k))
coriolis = _work_of("2 w×ẋ", lambda m, b: m.gyroscopic(b))
centrifugal = _work_of("w×(w×x)", lambda m, b: None if m.frame.spun else cross(b.resolve(m.frame.w), m.carried(b)))
euler = _work_of("ẇ×x", lambda m, b: m.euler(b))
base = _work_of("a_o, felt by positions only", lambda m, b: m.frame.a_o if b.is_position else None)
gravity = _work_of("−g, felt by positions only", lambda m, b: -m.frame.gravity if b.is_position else None)


def internal(m: Mechanics, delta: Variation) -> Any:
    """Return δ(∫ ½ Γ·C Γ): the work of the stresses is the derivative of the stored energy."""
    return added(m.k.variation(s.energy) for s in m.strains)


def damping(m: Mechanics, delta: Variation) -> Any:
    """Return the work of the Kelvin–Voigt stress C η Γ̇ and of Rayleigh damping, a0 M + a1 K.

    The mass part acts on the velocity relative to the frame; the stiffness part a1 adds to η. Registered models add
    their own work.
    """
    work: list[Any] = []
    eta, a0 = m.damping.stiffness, m.damping.mass
    k = m.k
    if eta is not None:
        work += [ufl.inner(eta * s.force(m.strain_rate(s)), k.variation(s.value)) * s.measure for s in m.strains]
    if a0 is not None:
        work += [a0 * b.density * ufl.inner(m.rate(b), delta.of(b)) * b.measure for b in m.bodies]
    work += [resolved(damping_models[name].work)(m, delta, c) for name, c in m.damping.models.items()]
    return added(work)


def root_springs(m: Mechanics, delta: Any) -> Any:
    """Return Σ k φ δφ over the turns φ that the root makes against springs."""
    return added(s.stiffness * s.x * delta.of(s) * s.measure for s in m.springs())


def root_dampers(m: Mechanics, delta: Variation) -> Any:
    """Return Σ c φ̇ δφ over the turns φ that the root makes against dampers."""
    return added(s.damping * (m.k.rate(s.x) + s.drift) * delta.of(s) * s.measure for s in m.springs())


def _product(rows: Any, x: Any, delta: Any) -> Any:
    """Return δ·A x of two components, entries of A that are the number 0 left out."""
    return added(a * x[j] * delta[i] for i, row in enumerate(rows) for j, a in enumerate(row) if not isinstance(a, int))


def _springs_of(kind: str) -> Callable[[Mechanics, Any], Any]:
    """Return Σ K x·δx of displacements or turns x in supports or couplings, K the symmetric part of their stiffness."""

    def work(m: Mechanics, delta: Any) -> Any:
        found = getattr(m.structure, kind)(m.frame)
        return added(_product(s.symmetric(), s.x, delta.of(s)) * s.measure for s in found)

    return work


def _dampers_of(kind: str) -> Callable[[Mechanics, Any], Any]:
    """Return Σ (D ẋ + K x)·δx, K the skew part of stiffness, ẋ seen from what the supports or couplings stand in."""

    def work(m: Mechanics, delta: Any) -> Any:
        work = []
        for s in getattr(m.structure, kind)(m.frame):
            rate = m.k.rate(s.x)
            if s.across and s.at_rest != m.frame.spun:  # what it stands in turns in the frame
                rate += (m.frame.w[0] if s.at_rest else -m.frame.w[0]) * ufl.as_vector((-s.x[1], s.x[0]))
            for rows, x in ((s.damping, rate), (s.skew(), s.x)):
                work.append(_product(rows, x, delta.of(s)) * s.measure)
        return added(w for w in work if not isinstance(w, int))

    return work


supports, support_dampers = _springs_of("supports"), _dampers_of("supports")
couplings, coupling_dampers = _springs_of("couplings"), _dampers_of("couplings")


def loads(m: Mechanics, delta: Any) -> Any:
    """Return −Σ ∫ (force · δx) over applied forces and moments."""
    return added(-ufl.inner(load.force, delta.of(load)) * load.measure for load in m.loads)


# --- momentum and energies --------------------------------------------------------------------------------------------


def momentum(m: Mechanics, delta: Any) -> Any:
    """Return Σ ∫ ρ (ẋ + w×x)·δx, a UFL form: of a rigid turn the angular momentum about its axis."""
    return added(b.density * ufl.inner(delta.of(b), m.velocity(b)) * b.measure for b in m.bodies)


def strain_energy(m: Mechanics) -> Any:
    """Return ∫ ½ Γ·C Γ (J), a UFL form."""
    return added(s.energy for s in m.strains)


def kinetic_parts(m: Mechanics) -> dict[str, Callable[[], Any]]:
    """Return T2, T1, T0 of T = ∫ ½ρ |ẋ + w×x|², by degree in the velocities relative to the frame (J), as UFL forms.

    Where the origin moves by a pitch, "origin" is what its velocity adds, ∫ ρ v_o·(ẋ + w×x + ½ v_o).
    """

    def product(first: Callable[[Body], Any], second: Callable[[Body], Any]) -> Any:
        return added(b.density * ufl.inner(first(b), second(b)) * b.measure for b in m.bodies)

    def relative(body: Body) -> Any:
        return body.rate(m.k)

    def of_origin() -> Any:
        v_o, places = m.frame.v_o, [b for b in m.bodies if b.is_position]
        return added(b.density * ufl.inner(v_o, m.velocity(b) + v_o / 2) * b.measure for b in places)

    return {
        "T2": lambda: 0.5 * product(relative, relative),
        "T1": lambda: product(relative, m.carried),
        "T0": lambda: 0.5 * product(m.carried, m.carried),
        "origin": of_origin,
    }


def _potential_of(work: Callable[[Mechanics, Any], Any], part: float) -> Callable[[Mechanics], Any]:
    """Return mechanics ↦ a part of an effect's work on the places themselves: all of a force's, half of a spring's."""
    return lambda m: part * work(m, Place())


potential_of_base = _potential_of(base, 1.0)
potential_of_gravity = _potential_of(gravity, 1.0)
potential_of_root_springs = _potential_of(root_springs, 0.5)
potential_of_supports = _potential_of(supports, 0.5)
potential_of_couplings = _potential_of(couplings, 0.5)


def potential_of_loads(m: Mechanics) -> Any:
    """Return −Σ ∫ force·x over the dead loads."""
    return loads(replace(m, loads=[load for load in m.loads if load.dead]), Place())
