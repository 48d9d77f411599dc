"""Whether a motion with unknowns left out would leave what it is held in, if anything pushed it there."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Most states that are kept of a motion: each is a factorisation.
MOST = 8


class LeftAside:
    """States of a motion, for a look at the stiffness of what is left out.

    Args:
        system: equations of motion of what is kept.
        beside: those of what is left out (see `rotfem.equations.beside`).
    """

    def __init__(self, system: Any, beside: Any):
        self.system, self.beside = system.held, beside
        self._kept: list[tuple[float, Array, dict[str, Array]]] = []
        self._every, self._count = 1, 0
        #: Whether the stiffness is the same in all states: of a linear theory without spin.
        motion = self.system.motion
        self._once = self.system.linear and not motion.is_spinning and motion.pitch is None

    def __call__(self, q: Array, t: float) -> None:
        """Keep a state (local dof array) of the time that is set, or pass it by."""
        self._count += 1
        if self._count % self._every or (self._once and self._kept):
            return
        model = self.system.model
        named = {**model.frame.constants, **{n: c for n, (c, _) in self.system.structure.load_constants.items()}}
        constants = {name: constant.value.copy() for name, constant in named.items()}
        shape = self.system.displaced() if self.system.linear else q[: len(self.system.q.x.array)]
        self._kept.append((t, shape.copy(), constants))
        if len(self._kept) > MOST:
            self._kept, self._every = self._kept[1::2], 2 * self._every

    def summary(self) -> dict[str, Any]:
        """Return what a summary says of it: names, why, and the first time at which motions of them are unstable."""
        names = list(self.system.model.problem.left_out)
        unstable = next((t for t, q, c in self._kept if self.beside.negative(q, c) != 0), None)
        why = "nothing moves them: structure, loads and spin are symmetric to what is kept"
        return {"unknowns": names, "why": why, "unstable_since": unstable}

    @staticmethod
    def warning(said: dict[str, Any]) -> str:
        """Return what is to be said of a summary; empty where motions of what is left out are stable."""
        if said["unstable_since"] is None:
            return ""
        return (
            f"{', '.join(said['unknowns'])} are zero by symmetry and left out, but the stiffness against them is not "
            f"positive at t = {said['unstable_since']:.6g} s: a small disturbance may grow, which "
            "model.all_unknowns = true with a small load across shows"
        )
