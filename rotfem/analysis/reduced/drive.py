"""What drives a linear theory, as arrays: the factors of all its pieces at many times at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.looks import look_at
from rotfem.mechanics.courses import SAME

Array = npt.NDArray[np.float64]

#: Relative distance from a knot at which a course has the value that it has on that side of it.
BESIDE = 4 * SAME

#: Times in a leg at which it is looked whether anything changes.
LOOKS = 5


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
        self._courses = {course.name: course for course in system.courses}
        for course in system.courses:
            look_at(course, times)
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

    def factors(
        self, t: Array, angle: Array | None = None, speed: Array | None = None, rate: Array | None = None
    ) -> Array:
        """Return the factor of every piece at times (n,), shape (n, pieces).

        Args:
            t: times, s.
            angle: psi there (rad), where it is an unknown.
            speed: psi' (rad/s) there, likewise.
            rate: psi'' (rad/s²) there, likewise.
        """
        turn = slice(2, 3) if self.frame.planar else slice(0, 3)
        plane = slice(0, 2) if self.frame.planar else slice(0, 3)
        values: dict[str, Array] = {}
        for name in self.frame.constants:
            if name == "w":
                values[name] = np.outer(self.speed(t) if speed is None else speed, self.motion.axis[turn])
            elif name == "dw":
                values[name] = np.outer(self.rate(t) if rate is None else rate, self.motion.axis[turn])
            elif name == "a_o":
                values[name] = self._course("motion.base_acceleration", self.motion.base_acceleration, t)[:, plane]
            else:
                values[name] = self._gravity(t, angle)[:, plane]
        for name, (constant, at) in self.system.structure.load_constants.items():
            values[name] = self._course(f"loads.{name}", at, t)[:, : constant.value.size]
        return np.asarray(self.system.factors(values) if values else np.ones((len(t), len(self.system.pieces))))

    def speed(self, t: Array) -> Array:
        """Return the speed at times (n,), rad/s."""
        return self._course("motion.speed", self.motion.speed, t)[:, 0]

    def rate(self, t: Array) -> Array:
        """Return the rate of the speed at times (n,), rad/s²."""
        return self._course("motion.rate", self.motion.rate, t)[:, 0]

    def looks(self) -> Array:
        """Return times in all legs at which what is prescribed is typical of them, s."""
        shares = (np.arange(LOOKS) + 0.5) / LOOKS
        return self.within(self.knots[:-1], self.knots[1:], shares).ravel()

    def _course(self, name: str, at: Any, t: Array) -> Array:
        """Return the values of a course, or of what does not change, at times (n,), shape (n, components)."""
        known = self._courses.get(name)
        values = known.values(t) if known else np.tile(np.atleast_1d(np.asarray(at(0.0), dtype=float)), (len(t), 1))
        return np.asarray(values, dtype=float)

    def _gravity(self, t: Array, angle: Array | None) -> Array:
        """Return gravity in the turning frame (Rodrigues' formula, backwards), shape (n, 3)."""
        e, g = self.motion.axis, np.asarray(self.system.model.problem.loads.gravity, dtype=float)
        psi = np.array([self.motion.angle(float(s)) for s in t]) if angle is None else angle
        along = e * (e @ g)
        turned = along + np.outer(np.cos(psi), g - along) - np.outer(np.sin(psi), np.cross(e, g))
        return np.asarray(turned)
