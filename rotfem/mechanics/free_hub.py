"""A free hub: what is prescribed where the rotation is an unknown."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

#: Relative difference of two times that rounding can make.
ROUNDING = 1e-14

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Torque:
    """M(t) about the axis, N·m: pulses that add up, or a table, linear between its rows and constant outside.

    Attributes:
        pulses: rows (start, end, torque) in s, s, N·m.
        table: rows (t, torque); None if there is none.
    """

    pulses: Rows = ()
    table: Rows | None = None

    @cached_property
    def _pulses(self) -> Rows:
        """Pulses; times that differ by a rounding only are one and the same."""
        last = -np.inf
        same: dict[float, float] = {}
        for t in sorted({t for start, end, _ in self.pulses for t in (start, end)}):
            last = last if t - last <= ROUNDING * abs(t) else t
            same[t] = last
        return tuple((same[start], same[end], torque) for start, end, torque in self.pulses)

    @property
    def jumps(self) -> tuple[float, ...]:
        """Times (s) of discontinuity."""
        return tuple(sorted({t for start, end, _ in self._pulses for t in (start, end)}))

    def at(self, t: float, after: bool = False) -> float:
        """Return M(t): the limit from the left, or from the right with `after` (they differ at a jump)."""
        if self.table is not None:
            rows = np.array(self.table)
            return float(np.interp(t, rows[:, 0], rows[:, 1]))
        return float(sum(M for start, end, M in self._pulses if (start <= t < end if after else start < t <= end)))


@dataclass(frozen=True)
class FreeHub:
    """The hub of a structure, free to turn about the axis (Yigit, Scott & Ulsoy 1988).

    Attributes:
        inertia: I_R, kg·m².
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
