"""Inertia effects as accelerations of a material vector in a moving frame, and the virtual work they do.

The absolute acceleration of a point x of the frame is (theory section 1)

    ẍ + 2 w×ẋ + w×(w×x) + ẇ×x + a_o,

and each term is an effect of its own, switched on or off. A director (a vector that does not move with the origin)
feels all but a_o and gravity; that is its rotary inertia.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import ufl
from ufl import cross

from rotfem.mechanics.bodies import AppliedLoad, Body, Damping, Kinematics, Strain
from rotfem.mechanics.frame import Frame

Acceleration = Callable[[Body, Kinematics, Frame], Any]


def inertia(body: Body, k: Kinematics, frame: Frame) -> Any:
    """ẍ, the acceleration relative to the frame."""
    return body.second_rate(k)


def coriolis(body: Body, k: Kinematics, frame: Frame) -> Any:
    """2 w×ẋ."""
    return 2 * cross(body.resolve(frame.w), body.rate(k))


def centrifugal(body: Body, k: Kinematics, frame: Frame) -> Any:
    """w×(w×x)."""
    w = body.resolve(frame.w)
    return cross(w, cross(w, body.x))


def euler(body: Body, k: Kinematics, frame: Frame) -> Any:
    """ẇ×x."""
    return cross(body.resolve(frame.dw), body.x)


def base(body: Body, k: Kinematics, frame: Frame) -> Any:
    """a_o, felt by positions only."""
    return frame.a_o if body.is_position else None


def gravity(body: Body, k: Kinematics, frame: Frame) -> Any:
    """−g, felt by positions only."""
    return -frame.gravity if body.is_position else None


#: Effects that act on every body, with the frame constant they contain and its power: the key to affine pieces.
ACCELERATIONS: dict[str, tuple[Acceleration, str | None, int]] = {
    "inertia": (inertia, None, 0),
    "coriolis": (coriolis, "w", 1),
    "centrifugal": (centrifugal, "w", 2),
    "euler": (euler, "dw", 1),
    "base": (base, "a_o", 1),
    "gravity": (gravity, "gravity", 1),
}


def virtual_work(name: str, bodies: list[Body], k: Kinematics, frame: Frame) -> Any:
    """Return Σ ∫ ρ a·δx over the bodies for the effect `name`, a UFL form in k.dq (0 where no body feels it)."""
    acceleration = ACCELERATIONS[name][0]
    work: Any = 0
    for body in bodies:
        a = acceleration(body, k, frame)
        if a is not None:
            work += body.density * ufl.inner(a, body.variation(k)) * body.measure
    return work


def damping(strains: list[Strain], bodies: list[Body], k: Kinematics, coefficients: Damping) -> Any:
    """Return the virtual work of Kelvin–Voigt stress C η Γ̇ and of Rayleigh damping a0 M + a1 K, a UFL form in k.dq.

    The mass part acts on the velocity relative to the frame; the stiffness part a1 adds to η.
    """
    work: Any = 0
    eta, a0 = coefficients.stiffness, coefficients.mass
    if eta is not None:
        work += sum(ufl.inner(eta * s.force(k.rate(s.value)), k.variation(s.value)) * s.measure for s in strains)
    if a0 is not None:
        work += sum(a0 * b.density * ufl.inner(b.rate(k), b.variation(k)) * b.measure for b in bodies)
    return work


def load_work(point_loads: list[AppliedLoad], k: Kinematics) -> Any:
    """Return −Σ ∫ (force · δx) over applied forces and moments, a UFL form in k.dq."""
    return -sum(ufl.inner(load.force, load.variation(k)) * load.measure for load in point_loads)
