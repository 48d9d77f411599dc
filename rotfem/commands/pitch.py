"""The pitch over time of a scene as a motion has it: a value, a table or a function, and harmonics, added up."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.mechanics.motion import Motion
from rotfem.mechanics.pitch import Pitch, Scalar, constant_pitch, differentiated, harmonic_pitch, tabulated_pitch
from rotfem.scene import Scene, Time

#: Steps in which differences of a user's function have one step of their own, and parts of a history of adaptive steps.
CELL, CELLS = 16, 64


def with_pitch(scene: Scene, motion: Motion) -> Motion:
    """Return the motion of a scene with the pitch of its blade, which may change with time.

    Raises:
        InputError: the pitch is a function that raises at t = 0, or returns no finite number.
    """
    structure: Any = scene.structure
    if not structure.pitches:
        return motion
    given = structure.root.pitch
    parts = [constant_pitch(given.value or 0.0)]
    parts += [harmonic_pitch(h.amplitude, h.phase, _turn(h, motion)) for h in given.harmonic]
    knots = motion.sharp if any(h.per_rev is not None for h in given.harmonic) else ()
    if given.table is not None:
        parts.append(tabulated_pitch(given.table))
        knots = tuple(sorted({*knots, *(row[0] for row in given.table)}))
    if given.function is not None:
        parts.append(differentiated(given.at, given.rate_at if given.rate is not None else None, cell_of(scene.time)))
    angle, rate, acceleration = (_sum([part[i] for part in parts]) for i in range(3))
    axis, root = np.array(structure.root_axis), np.array(structure.root_position)
    known = given.function is None and not given.harmonic
    return motion.pitched(Pitch(angle, rate, acceleration, axis, root, knots, known, start=angle(0.0)))


def cell_of(time: Time | None) -> float | None:
    """Return the length of time (s) in which differences of a user's function have one step; None without [time]."""
    if time is None:
        return None
    return CELL * time.step if time.step else time.end / CELLS


def _turn(harmonic: Any, motion: Motion) -> tuple[Scalar, Scalar, Scalar]:
    """Return the angle that a harmonic is a cosine of, but for its phase, and its rates."""
    if harmonic.per_rev is None:
        omega = harmonic.frequency
        return (lambda t: omega * t), (lambda t: omega), (lambda t: 0.0)
    n = harmonic.per_rev
    return (lambda t: n * motion.angle(t)), (lambda t: n * motion.speed(t)), (lambda t: n * motion.rate(t))


def _sum(parts: list[Scalar]) -> Scalar:
    return lambda t: sum(part(t) for part in parts)
