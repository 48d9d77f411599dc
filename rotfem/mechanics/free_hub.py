"""A free hub: what is prescribed where the rotation is an unknown."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from rotfem.short import short_fields
from rotfem.units import si

Array = npt.NDArray[np.float64]
Rows = tuple[tuple[float, ...], ...]

#: psi (rad), psi' (rad/s), and the tip by the names of its components.
Seen = tuple[float, float, Mapping[str, float]]


@dataclass(frozen=True)
class Torque:
    """M(t) about the axis, N·m: pulses that add up, or a table, linear between its rows and constant outside.

    Attributes:
        pulses: rows (start, end, torque) in s, s, N·m.
        table: rows (t, torque); None if there is none.
    """

    #: Whether it answers to the motion.
    controlled: ClassVar[bool] = False

    pulses: Rows = ()
    table: Rows | None = None
    __repr__ = short_fields

    @cached_property
    def _line(self) -> tuple[Array, Array]:
        """Times, and torques that are linear between them; of pulses two at a time, before and after a jump.

        Times of pulses that differ by a rounding only, 1e-14 of themselves, are one and the same.
        """
        if self.table is not None:
            t, M = np.array(self.table).T
            return t, M
        t = np.sort([t for start, end, _ in self.pulses for t in (start, end)])
        t = t[np.diff(t, prepend=-np.inf) > 1e-14 * np.abs(t)]
        change = np.zeros(len(t))
        for start, end, torque in self.pulses:
            first, last = np.searchsorted(t, [start - 1e-14 * abs(start), end - 1e-14 * abs(end)])
            change[first] += torque
            change[last] -= torque
        return np.repeat(t, 2), np.repeat(np.concatenate([[0.0], np.cumsum(change)]), 2)[1:-1]

    @cached_property
    def knots(self) -> Array:
        """Times (s) between which it is linear."""
        return np.unique(self._line[0])

    def many(self, t: Array, after: bool = False) -> Array:
        """Return M at times (n,), shape (n,): the limits from the left, or from the right with `after`."""
        knots, M = self._line
        if not len(knots):
            return np.zeros(len(t))
        return np.interp(t if self.table is not None else np.nextafter(t, np.inf if after else -np.inf), knots, M)

    def at(self, t: float, after: bool = False) -> float:
        """Return M(t): the limit from the left, or from the right with `after` (they differ at a jump)."""
        return float(self.many(np.array([t]), after)[0])

    def on(self, t: float, state: Callable[[], Seen], after: bool = False) -> float:
        """Return M at time t (s): a state, psi (rad), psi' (rad/s) and the tip, does not change it."""
        return self.at(t, after)

    def slopes(self, t: float, state: Callable[[], Seen]) -> tuple[float, float]:
        """Return ∂M/∂psi and ∂M/∂psi': it does not depend on them."""
        return 0.0, 0.0

    def impulse(self, start: float, end: float) -> float:
        """Return ∫ M dt from start to end (s), N·m·s."""
        knots = self.knots
        t = np.array([start, *knots[(knots > start) & (knots < end)], end])
        return float(0.5 * np.diff(t) @ (self.many(t[:-1], after=True) + self.many(t[1:])))


#: (t, psi, psi', tip) ↦ torque, N·m; the tip by the names of its components.
Controller = Callable[[float, float, float, Mapping[str, float]], float]

#: Changes of angle (rad) and speed (rad/s) over which the derivative of a controller is taken.
SLIGHT = 1e-6


@dataclass(frozen=True)
class ControlledTorque(Torque):
    """A torque that answers to the motion; none where no state of it is given.

    Attributes:
        controller: what gives it.
    """

    controlled: ClassVar[bool] = True

    controller: Controller = field(kw_only=True)

    def on(self, t: float, state: Callable[[], Seen], after: bool = False) -> float:
        """Return M at time t (s) and a state."""
        return self.controller(t, *state())

    def slopes(self, t: float, state: Callable[[], Seen]) -> tuple[float, float]:
        """Return ∂M/∂psi and ∂M/∂psi' at time t (s) and a state."""
        psi, speed, tip = state()
        here = self.controller(t, psi, speed, tip)
        by_angle = self.controller(t, psi + SLIGHT, speed, tip) - here
        return by_angle / SLIGHT, (self.controller(t, psi, speed + SLIGHT, tip) - here) / SLIGHT


@dataclass(frozen=True)
class FreeHub:
    """The hub of a structure, free to turn about the axis (Yigit, Scott & Ulsoy 1988).

    Attributes:
        inertia: I_R, kg·m², or a text with a unit, as damping and speed.
        torque: what drives it.
        damping: viscous brake, N·m·s.
        coupled: whether it feels the structure's elastic motion; otherwise it turns as if the structure were rigid.
        speed: initial speed, rad/s.
    """

    inertia: float
    torque: Torque = field(default_factory=Torque)
    damping: float = 0.0
    coupled: bool = True
    speed: float = 0.0
    __repr__ = short_fields

    def __post_init__(self) -> None:
        for name, unit in (("inertia", "kg*m**2"), ("damping", "N*m*s"), ("speed", "rad/s")):
            object.__setattr__(self, name, si(getattr(self, name), unit, f"motion.{name}"))

    def rigid_speeds(self, times: Array, inertia: float) -> Array:
        """Return the speed (n,), rad/s, at times (n,), s, from the start on, of a rigid hub of all inertia, kg·m²."""
        h, middle, psi, k = np.diff(times), 0.5 * (times[:-1] + times[1:]), 0.0, 0
        speeds, decay = np.full(len(times), self.speed), self.damping / inertia

        def seen() -> Seen:
            return psi, float(speeds[k]), defaultdict(float)

        for k, t in enumerate(middle):
            M = self.torque.on(float(t), seen)
            speeds[k + 1] = (speeds[k] + h[k] * M / inertia) / (1 + h[k] * decay)
            psi += h[k] * speeds[k + 1]
        return speeds
