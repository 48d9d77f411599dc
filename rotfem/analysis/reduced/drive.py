"""What drives a linear theory, as arrays: the factors of all its pieces at many times at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.time_grid import find_breakpoints
from rotfem.mechanics.courses import SAME
from rotfem.mechanics.pitch import Pitch

Array = npt.NDArray[np.float64]

#: Relative distance from a knot at which a course has the value that it has on that side of it.
BESIDE = 4 * SAME

#: Times in a leg, and in all legs at least, at which it is looked whether anything changes.
LOOKS, FEWEST = 5, 40

#: Part of a leg from one of them to the next, counted on from its start: no multiple of it is a period of anything.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1)

#: Arrays of times at which the pitch is known.
KEPT = 256


class Drive:
    """Speed, base acceleration, gravity and loads over a stretch of time, and the factors of the pieces they make.

    Args:
        system: equations of a linear theory, the hub held.
        times: times of the history, increasing, s.

    Attributes:
        knots: times (s) between which everything prescribed is smooth and nearly straight; first and last are ends.
    """

    def __init__(self, system: Any, times: Array):
        self.system, self.motion, self.frame = system, system.motion, system.model.frame
        self._turns: dict[bytes, tuple[Array, Array, Array]] = {}
        self._courses = {course.name: course for course in system.courses}
        for course in system.courses:
            find_breakpoints(course, times)
        first, last = float(times[0]), float(times[-1])
        points = np.concatenate([np.empty(0), *(np.concatenate([c.knots, c.marks]) for c in system.courses)])
        inside = np.unique(points[(points > first) & (points < last)])
        knots = np.concatenate([[first], inside, [last]])
        self.knots: Array = knots[np.append(np.diff(knots) > BESIDE * (last - first), True)]

    def within(self, begin: Array, end: Array, shares: Array) -> Array:
        """Return the times at these shares of stretches, never on the wrong side of their ends; (n, shares), s."""
        t = begin[:, None] + (end - begin)[:, None] * shares
        low, high = begin[:, None] * (1 + BESIDE), end[:, None] * (1 - BESIDE)
        return np.asarray(np.clip(t, np.minimum(low, high), high))

    @property
    def whole(self) -> Any:
        """The system with its hub, whose effects can be switched."""
        return self.system

    def factors(self, t: Array) -> Array:
        """Return the factor of every piece at times (n,), shape (n, pieces)."""
        return self.made_of(self.constants(t, self.angle(t), self.speed(t), self.rate(t)), len(t))

    def made_of(self, constants: dict[str, Array], n: int) -> Array:
        """Return the factor of every piece, shape (n, pieces), from the values of constants (n, size)."""
        return np.asarray(self.system.factors(constants, n))

    def constants(self, t: Array, angle: Array, speed: Array, rate: Array) -> dict[str, Array]:
        """Return the values of all constants of frame and loads, by name, (n, size).

        Args:
            t: times (n,), s.
            angle: of the frame there, rad.
            speed: rad/s.
            rate: of the speed, rad/s².
        """
        turn = slice(2, 3) if self.frame.planar else slice(0, 3)
        plane = slice(0, 2) if self.frame.planar else slice(0, 3)
        slices = {"w": turn, "dw": turn, "a_o": plane, "v_o": plane, "gravity": plane}
        moved = self._moved(t, angle, speed, rate)
        values = {name: moved[name][:, slices.get(name, slice(None))] for name in self.frame.constants}
        for name, (constant, at) in self.system.structure.load_constants.items():
            if constant.follows_nodes:
                values[name] = np.array([at(float(s)) for s in t])
                continue
            values[name] = self._course(f"loads.{name}", at, t)[:, : constant.value.size]
        return values

    def _moved(self, t: Array, angle: Array, speed: Array, rate: Array) -> dict[str, Array]:
        """Return what the frame's constants are at times, by name, as far as they are asked for, (n, components)."""
        axis, names = self.motion.axis, self.frame.constants
        values = {"w": np.outer(speed, axis), "dw": np.outer(rate, axis)}
        if "a_o" in names or self.motion.pitch is not None:
            values["a_o"] = self._course("motion.base_acceleration", self.motion.base_acceleration, t)
        if "gravity" in names:
            values["gravity"] = self._gravity(angle)
        pitch = self.motion.pitch
        if pitch is None:
            return values
        turn = self._turned(pitch, t)
        if "gravity" in names:
            values["gravity"] = pitch.seen(turn[0][:, None], values["gravity"])
        values |= pitch.moved(turn, values["w"], values["dw"], values["a_o"])
        return values

    def _turned(self, pitch: Pitch, t: Array) -> tuple[Array, Array, Array]:
        """Return what the pitch has turned the frame by at times (n,), rad, and the two rates of it.

        They are functions of one time at a time, and the same times are asked for by all solutions by the same steps.
        """
        key = t.tobytes()
        if key not in self._turns:
            if len(self._turns) == KEPT:
                self._turns.clear()
            angle, rate, acceleration = (self._course(name, at, t)[:, 0] for name, at in pitch.courses.items())
            self._turns[key] = angle - pitch.start, rate, acceleration
        return self._turns[key]

    def angle(self, t: Array) -> Array:
        """Return the angle of the frame at times (n,), rad; 0 where nothing asks for it."""
        if "gravity" not in self.frame.constants:
            return np.zeros(len(t))
        return np.array([self.motion.angle(float(s)) for s in t])

    def speed(self, t: Array) -> Array:
        """Return the speed at times (n,), rad/s."""
        return self._course("motion.speed", self.motion.speed, t)[:, 0]

    def rate(self, t: Array) -> Array:
        """Return the rate of the speed at times (n,), rad/s²."""
        return self._course("motion.rate", self.motion.rate, t)[:, 0]

    def active(self) -> npt.NDArray[np.int64]:
        """Return the numbers of the pieces that are ever there."""
        return np.flatnonzero(np.abs(self.factors(self.looks())).max(axis=0) > 0.0)

    def looks(self) -> Array:
        """Return times in all legs at which what is prescribed is typical of them, s."""
        number = max(LOOKS, -(-FEWEST // (len(self.knots) - 1)))
        shares = np.sort(GOLDEN * (np.arange(number) + 1) % 1.0)
        return self.within(self.knots[:-1], self.knots[1:], shares).ravel()

    def _course(self, name: str, at: Any, t: Array) -> Array:
        """Return the values of a course, or of what does not change, at times (n,), shape (n, components)."""
        known = self._courses.get(name)
        values = known.values(t) if known else np.tile(np.atleast_1d(np.asarray(at(0.0), dtype=float)), (len(t), 1))
        return np.asarray(values, dtype=float)

    def _gravity(self, angle: Array) -> Array:
        """Return gravity in the turning frame (Rodrigues' formula, backwards), shape (n, 3)."""
        e, g = self.motion.axis, np.asarray(self.system.model.problem.loads.gravity, dtype=float)
        along = e * (e @ g)
        turned = along + np.outer(np.cos(angle), g - along) - np.outer(np.sin(angle), np.cross(e, g))
        return np.asarray(turned)
