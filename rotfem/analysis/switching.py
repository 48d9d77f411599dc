"""Torques that jump with the motion: relays, which a controller of a free hub may be.

A switch that the motion passes once is found by the error of steps, which shorten up to it and grow again after it.
Where the torque drives the motion back from either side of its switch (a sliding mode, Filippov 1988, section 4), no
step passes it: the equations of an implicit step may have no solution there, and adaptive steps follow every switch.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from rotfem.analysis.schemes import State
from rotfem.errors import ComputationError

#: Halvings after which a change that is still there is a jump: all digits of the arguments; part that is left of it.
HALVINGS, LEFT = 52, 0.5

#: Switches in so many steps that are a sliding mode. Steps that have passed a switch grow for tens of steps before
#: there is another one to be found; in a sliding mode one in two or three has one.
SWITCHES, STEPS = 50, 200

#: What to do where there is one.
SMOOTHER = (
    "a torque that is continuous there, as one proportional to the deviation between its limits, or a hysteresis that "
    "leaves the motion time between two switches"
)


class Switches:
    """Counts the switches of a controlled torque over the steps of a march.

    Args:
        system: equations of motion of a free hub.
    """

    def __init__(self, system: Any):
        self.system, self.torque = system, system.hub.torque
        self._passed: deque[tuple[int, float]] = deque(maxlen=SWITCHES)

    def passed(self, number: int, old: State, new: State) -> None:
        """Take note of a step.

        Raises:
            ComputationError: it is one of many in a row with a switch in it.
        """
        if not self.between(self._seen(old), self._seen(new)):
            return
        self._passed.append((number, new.t))
        first, since = self._passed[0]
        if len(self._passed) < SWITCHES or number - first > STEPS:
            return
        what = (
            f"the torque has switched in {SWITCHES} of the last {number - first + 1} steps, of "
            f"{(new.t - since) / (number - first):.3g} s on average: it holds the motion at its own jump (sliding mode)"
        )
        raise ComputationError(what, time=new.t, advice=SMOOTHER)

    def ahead(self, state: State, h: float) -> bool:
        """Return whether the torque jumps within a time h (s) of a state that goes on with its acceleration."""
        return self.between(self._seen(state), self._seen(state) + h * np.array([1.0, *self._rates(state)]))

    def between(self, old: Any, new: Any) -> bool:
        """Return whether the torque jumps on the straight line between two sets of its arguments."""
        M, there = self._at(old), self._at(new)
        change = abs(there - M)
        if change == 0.0:
            return False
        for _ in range(HALVINGS):
            middle = 0.5 * (old + new)
            value = self._at(middle)
            if abs(value - M) >= abs(there - value):
                new, there = middle, value
            else:
                old, M = middle, value
            if abs(there - M) < LEFT * change:
                return False
        return True

    def _at(self, seen: Any) -> float:
        t, psi, speed, *tip = map(float, seen)
        return float(
            self.torque.controller(t, psi, speed, dict(zip(self.system.structure.components, tip, strict=True)))
        )

    def _seen(self, state: State) -> Any:
        """Return time, angle, speed and the components of the tip, the arguments of the torque."""
        self.system.count_rotations_from(state.reference)
        return np.array([state.t, state.q[-1], state.v[-1], *self.system.tip(state.q, state.t)])

    def _rates(self, state: State) -> list[float]:
        return [state.v[-1], state.a[-1], *np.zeros(len(self.system.structure.components))]


def watched_switches(system: Any) -> Switches | None:
    """Return what counts the switches of a free hub's torque that answers to the motion; None without one."""
    return Switches(system) if system.hub is not None and system.hub.torque.controlled else None
