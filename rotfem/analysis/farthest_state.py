"""Of all states of a motion the one with the largest rotation, where a theory is farthest from the exact one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from rotfem.analysis.lost_digits import lost_digits
from rotfem.analysis.theory_error import TheoryCheck, TheoryError
from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]

T = TypeVar("T")

#: By how much a rotation must exceed the largest one so far to be looked at in its place.
MORE = 1.02


class Farthest:
    """Remembers the state of a motion with the largest rotation, where a theory is farthest from the exact one.

    Args:
        system: equations of motion.

    Attributes:
        seen: largest rotation (rad), time (s) and state (local dof array).
    """

    def __init__(self, system: Any):
        self.system, self.check = system, TheoryCheck(system.held)
        self._turned = np.array([not name.startswith("u") for name in system.structure.components])
        self.seen: tuple[float, float, Array] = (-1.0, 0.0, system.zeros())

    def __call__(self, q: Array, t: float) -> None:
        """Look at a state (local dof array) of time t (s)."""
        if not (self.check.known or self.system.linear):
            return
        size = float(np.max(self.system.sizes(q)[self._turned], initial=0.0))
        if size > MORE * self.seen[0]:
            self.seen = (size, t, np.array(q))

    def error(self) -> TheoryError | None:
        """Return the error of the theory there; None where that fails. State and time of the system stay."""
        if not self.check.known:
            return self.check.of_state(self.seen[2])
        return self._there(self.check.of_state)

    def lost_digits(self) -> float | None:
        """Return what round-off of the stiffness may have done there, relative; None where that cannot be said."""
        return self._there(partial(lost_digits, self.system.held))

    def _there(self, of_state: Callable[[Array], T]) -> T | None:
        """Return a function of the state, with its time set; None where nothing was seen, or it fails."""
        system, (size, t, q) = self.system.held, self.seen
        if size < 0.0:
            return None
        state, time = [x.x.array.copy() for x in (system.q, system.v, system.a)], system.time
        system.set_time(t)
        try:
            return of_state(q[: len(state[0])])
        except ComputationError:
            return None
        finally:
            system.set_time(time)
            system.set_state(*state)
