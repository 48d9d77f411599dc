"""The way of the tip, step by step, for who asks later what a motion was made of."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import State, Watch

Array = npt.NDArray[np.float64]


class TipTrack:
    """Remembers the displacement of the tip at the end of every step.

    Args:
        system: equations of motion.
        further: who else is told of the steps; None if nobody.
    """

    def __init__(self, system: Any, further: Watch | None = None):
        inner = system.held
        self.values, self.comm, self.further = inner.structure.tip_values, inner.comm, further
        names = inner.structure.unknowns
        self._moves = [self.values.dofs.start + i for i, name in enumerate(names) if name.startswith("u")]
        self._has_tip = inner.comm.rank == self.values.owner
        self._times: list[float] = []
        self._tips: list[Array] = []

    def __call__(self, old: State, new: State, leg: Any) -> None:
        """Take note of a step from an old to a new state."""
        for state in (new,) if self._times else (old, new):
            self._times.append(state.t)
            if self._has_tip:
                self._tips.append(state.q[self._moves])
        if self.further is not None:
            self.further(old, new, leg)

    def path(self) -> tuple[Array, Array]:
        """Return the times (n,), s, and the displacements of the tip (n, components), m; the same on all processes."""
        tips: Array = np.zeros((len(self._times), len(self._moves)))
        if self._has_tip and self._tips:
            tips[:] = self._tips
        if self.comm.size > 1:
            self.comm.Bcast(tips, root=self.values.owner)
        return np.array(self._times), tips
