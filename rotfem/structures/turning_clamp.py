"""The clamp of a planar beam as seen from a frame that does not turn with the hub (theory section 4).

There the inertia of the beam is linear (A_rho ü, I_rho α̈) and the spin enters as the motion of the clamped end,
Simo & Vu-Quoc 1986, claim (v).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.motion import Motion

Array = npt.NDArray[np.float64]


class TurningClamp:
    """Prescribed q = (u_1, u_2, alpha) of the clamped node, without alpha in a hinge, and rigid turns of the beam."""

    def __init__(self, structure: Any, motion: Motion):
        self.motion, self.structure = motion, structure
        self._clamped_components = np.arange(2 if structure.hinges else 3)
        self.dofs = (structure.clamped[:, None] * 3 + self._clamped_components).ravel()
        self._x = structure.V.tabulate_dof_coordinates()[:, 0] + structure.hub_radius

    def angle(self, t: float) -> float:
        """Return the angle of the hub about a_3 at time t (s), rad."""
        return float(self.motion.axis[2]) * self.motion.angle(t)

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Return q, q̇ and q̈ of the clamped unknowns at time t (s), inertial components."""
        R, sign = self.structure.hub_radius, float(self.motion.axis[2])
        psi, w, dw = self.angle(t), sign * self.motion.speed(t), sign * self.motion.rate(t)
        c, s = np.cos(psi), np.sin(psi)
        q = np.array([R * (c - 1), R * s, psi])
        v = w * np.array([-R * s, R * c, 1.0])
        a = dw * np.array([-R * s, R * c, 1.0]) - w * w * np.array([R * c, R * s, 0.0])
        held, repeat = self._clamped_components, len(self.dofs) // len(self._clamped_components)
        return np.tile(q[held], repeat), np.tile(v[held], repeat), np.tile(a[held], repeat)

    def rigid(self, relative: Array, t: float) -> tuple[Array, Array]:
        """Return (q, q̇) in inertial components of a shape given in the turning frame and at rest there."""
        r = relative.reshape(-1, 3)
        x, y = self._turn(self._x + r[:, 0], r[:, 1], self.angle(t))
        w = float(self.motion.axis[2]) * self.motion.speed(t)
        q = np.column_stack([x - self._x, y, r[:, 2] + self.angle(t)])
        return q.ravel(), (w * np.column_stack([-y, x, np.ones_like(x)])).ravel()

    def turned(self, q: Array, v: Array, t0: float, t1: float) -> Array:
        """Return the configuration q at t0 carried to t1 by the hub's turn and its velocity relative to the hub."""
        p, u = q.reshape(-1, 3), v.reshape(-1, 3)
        w, h = float(self.motion.axis[2]) * self.motion.speed(t0), t1 - t0
        x, y = self._x + p[:, 0], p[:, 1]
        x, y = x + h * (u[:, 0] + w * y), y + h * (u[:, 1] - w * x)
        turn = self.angle(t1) - self.angle(t0)
        x, y = self._turn(x, y, turn)
        return np.column_stack([x - self._x, y, p[:, 2] + turn + h * (u[:, 2] - w)]).ravel()

    def relative(self, q: Array, X: Any, t: float) -> Array:
        """Return (u_1, u_2, alpha), shape (n, 3), in the turning frame from inertial q (n, 3) of points at X (m)."""
        reach = self.reach(X)
        x, y = self._turn(reach + q[:, 0], q[:, 1], -self.angle(t))
        return np.column_stack([x - reach, y, q[:, 2] - self.angle(t)])

    def reach(self, X: Any) -> Any:
        """Return the distance of points at X (m) from the axis of rotation, undeformed."""
        return self.structure.hub_radius + X

    @staticmethod
    def _turn(x: Any, y: Any, angle: float) -> tuple[Any, Any]:
        c, s = np.cos(angle), np.sin(angle)
        return c * x - s * y, s * x + c * y
