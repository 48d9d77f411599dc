"""A motion that is computed in the inertial frame, as its hub sees it: states, and equations to judge them by."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import State
from rotfem.equations.compiled import compile_system

Array = npt.NDArray[np.float64]


class TurningView:
    """States of a system in a fixed frame, in the frame that turns with its clamp.

    Args:
        system: equations of motion in the inertial frame.
    """

    def __init__(self, system: Any):
        self._fixed = system
        self._x = system.V.tabulate_dof_coordinates()[:, 0]

    @cached_property
    def system(self) -> Any:
        """The same problem's equations in the frame that turns."""
        problem = self._fixed.model.problem
        return compile_system(problem.replace(frame="rotating", outputs={}), self._fixed.comm)

    def state(self, state: State) -> State:
        """Return a state with u, and the rates of u, relative to the turning frame.

        With r = Qᵀ p, p the position: ṙ = Qᵀ ṗ − w×r and r̈ = Qᵀ p̈ − 2 w×ṙ − w×(w×r) − ẇ×r.
        """
        clamp, motion, t = self._fixed.clamp, self._fixed.motion, state.t
        sign = float(motion.axis[2])
        w, dw = sign * motion.speed(t), sign * motion.rate(t)
        q, v, a = (x.reshape(-1, 3) for x in (state.q, state.v, state.a))
        u = clamp.relative(q, self._x, t)
        r = u[:, :2] + np.column_stack([clamp.reach(self._x), np.zeros_like(self._x)])
        rate = clamp.turned_back(v[:, :2], t) - w * _normal(r)
        acceleration = clamp.turned_back(a[:, :2], t) - 2 * w * _normal(rate) + w * w * r - dw * _normal(r)
        return state.changed(
            q=u.ravel(),
            v=np.column_stack([rate, v[:, 2] - w]).ravel(),
            a=np.column_stack([acceleration, a[:, 2] - dw]).ravel(),
        )


def _normal(r: Array) -> Array:
    """Return e×r, e out of the plane, of vectors (n, 2)."""
    return np.column_stack([-r[:, 1], r[:, 0]])
