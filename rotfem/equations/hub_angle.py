"""The angle of a free hub as an unknown: what the motion of the frame reads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.motion import Motion


class HubAngle:
    """psi, psi' and psi'' of a free hub, and the motion of the frame that they make.

    Args:
        motion: what is prescribed: the hub, its axis, the acceleration of its origin.

    Attributes:
        values: psi (rad), psi' (rad/s), psi'' (rad/s²).
        hub: inertia, torque, brake.
        motion: of the frame, read from the values.
    """

    def __init__(self, motion: Motion):
        assert motion.hub is not None
        self.hub = motion.hub
        self.values: npt.NDArray[np.float64] = np.zeros(3)
        self.start()
        self.motion = replace(
            motion,
            angle=lambda t: float(self.values[0]),
            speed=lambda t: float(self.values[1]),
            rate=lambda t: float(self.values[2]),
        )

    def start(self) -> None:
        """Put the hub back to where it starts."""
        self.values[:] = 0.0, self.hub.speed, 0.0
