"""Of all states of a motion the one with the largest rotation, where a theory is farthest from the exact one."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.theory_error import TheoryCheck, TheoryError
from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]

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
        if not self.check.known:
            return
        size = float(np.max(self.system.sizes(q)[self._turned], initial=0.0))
        if size > MORE * self.seen[0]:
            self.seen = (size, t, np.array(q))

    def error(self) -> TheoryError | None:
        """Return the error of the theory there; None where that fails. State and time of the system stay."""
        system, (size, t, q) = self.system.held, self.seen
        if not self.check.known:
            return self.check.of_state(q)
        if size < 0.0:
            return None
        state, time = [x.x.array.copy() for x in (system.q, system.v, system.a)], system.time
        system.set_time(t)
        try:
            return self.check.of_state(q[: len(state[0])])
        except ComputationError:
            return None
        finally:
            system.set_time(time)
            system.set_state(*state)
