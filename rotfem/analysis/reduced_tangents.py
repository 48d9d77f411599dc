"""M, C and K of a motion in a few shapes, at any of its states; of a free hub with its angle as last coordinate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.ritz_vectors import RitzVectors

Array = npt.NDArray[np.float64]

#: c_k, c_v, c_m of K, C and M, and what they are of the speed and its rate.
SHIFTS = {"M": (0.0, 0.0, 1.0), "C": (0.0, 1.0, 0.0), "K": (1.0, 0.0, 0.0)}
OF_SPIN = {"M": (0.0, 1.0), "C": (1.0, 0.0), "K": (0.0, 0.0)}


@dataclass(frozen=True)
class Border:
    """What the angle of a free hub adds to a matrix: its row, its column, the corner."""

    row: Array
    column: Array
    corner: float


class Tangents:
    """M, C and K of a system at one state.

    Args:
        system: equations of motion; time and state are set in it.
        state: where.

    Attributes:
        matrices: M and K, PETSc matrices.
    """

    def __init__(self, system: Any, state: Any):
        self.system, self.t = system, state.t
        system.count_rotations_from(state.datum)
        system.set_time(state.t)
        system.set_state(state.q, state.v, state.a)
        inner = system.held
        if system.comm.size > 1:
            for x in (inner.q, inner.v, inner.a):
                x.x.scatter_forward()
        self.speed = abs(float(system.motion.speed(state.t)))
        self.by_mode = inner.by_mode
        self.matrices = {name: self._matrix(name) for name in "MK"}

    def _matrix(self, name: str) -> Any:
        return self.system.held.matrix(*SHIFTS[name], 1.0 if name == "K" else 0.0)

    def shapes(self) -> RitzVectors:
        """Return the shapes that move the tip here."""
        return RitzVectors(self.system.held, self.matrices["M"], self.matrices["K"], self.speed**2)

    def reduced(self, shapes: RitzVectors) -> tuple[Array, Array, Array]:
        """Return M, C, K in shapes that were made or turned by M and K, (r, r) each; of a free hub (r + 1, r + 1).

        The state must still be the one that is set in the system.
        """
        C = self._matrix("C")
        parts = {"M": np.eye(len(shapes.squares)), "C": shapes.product(C), "K": shapes.stiffness}
        if self.by_mode is not None:
            along = self.by_mode.along(shapes.V)
            parts["C"] = parts["C"] + along.T @ along
        for name in parts if self.system.hub is not None else ():
            border = self._border(name)
            row, column = shapes.sum(np.array([border.row @ shapes.V, border.column @ shapes.V]))
            parts[name] = np.block([[parts[name], column[:, None]], [row[None, :], np.array([[border.corner]])]])
        return parts["M"], parts["C"], parts["K"]

    def _border(self, name: str) -> Border:
        """Return what the angle of a free hub adds to a matrix."""
        system, of_spin = self.system, OF_SPIN[name]
        row = system.row.row(SHIFTS[name]).array.copy()
        return Border(row, system.held.spin_derivative(*of_spin).array.copy(), system.row.diagonal(*of_spin))
