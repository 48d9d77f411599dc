"""M, C and K of a motion in a few shapes, at any of its states; of a free hub with its angle as last coordinate.

Viscous stress ηD ε̇ of strain rates ε̇ = B(q) v has the tangents

    C = η Bᵀ D B    and    T = η Bᵀ D Ḃ,  Ḃ = ∂(B v)/∂q, in K.

Where a structure turns, neighbouring motions e keep B e small, not B_0 e of one state: ė is −B⁺Ḃ e beside what bends,
and C ė + T e = η Bᵀ D (B e)˙ is far smaller than both. In shapes that stay as they are C ċ has nothing of the one, so
that T must not be there either. With Ċ = T + Tᵀ, and what else v adds to K symmetric, it is

    T = ½ Ċ + ½ (K(v) − K(v)ᵀ) − ½ (K(0) − K(0)ᵀ).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.numerics.linear import transposed
from rotfem.numerics.low_rank import sparse_part

Array = npt.NDArray[np.float64]

#: Product of viscosity and the largest rate of an unknown in units of its scale from which viscous stress turns with
#: the structure, and how far it goes on to find Ċ, in those units.
TURNS, FAR = 1e-5, 1e-5

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
        mass: M, if it is known, and the time of the state is set already; None: found.

    Attributes:
        matrices: M and K, PETSc matrices.
    """

    def __init__(self, system: Any, state: Any, mass: Any = None):
        self.system, self.t = system, state.t
        if mass is None:
            system.count_rotations_from(state.datum)
            system.set_time(state.t)
        system.set_state(state.q, state.v, state.a)
        inner = system.held
        if system.comm.size > 1:
            for x in (inner.q, inner.v, inner.a):
                x.x.scatter_forward()
        self.speed = abs(float(system.motion.speed(state.t)))
        #: C, if it has been found.
        self._damping: Any = None
        self.matrices = {"M": self._matrix("M") if mass is None else mass, "K": self._matrix("K")}
        self._take_turning_stress(state)

    def _matrix(self, name: str) -> Any:
        return self.system.held.matrix(*SHIFTS[name], 1.0 if name == "K" else 0.0)

    def _take_turning_stress(self, state: Any) -> None:
        """Take T out of K."""
        inner = self.system.held
        eta = inner.structure.damping().stiffness
        if inner.linear or eta is None:
            return
        n = len(inner.scale)
        q, v = state.q[:n], state.v[:n]
        rate = float(np.abs(v / inner.scale).max(initial=0.0))
        rate = max(self.system.comm.allgather(rate))
        if not float(eta.value) * rate > TURNS:
            return
        forward = FAR / rate
        self._damping = self._matrix("C")
        inner.q.x.array[:] += forward * v
        change = sparse_part(self._matrix("C"))  # the rest of C is constant
        change.axpy(-1.0, sparse_part(self._damping), PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        inner.q.x.array[:], inner.v.x.array[:] = q, 0.0
        still = self._matrix("K")
        inner.v.x.array[:] = v
        # K + still of the one, and K − still of what is transposed, each less Ċ / 2
        one, other = self.matrices["K"], self.matrices["K"].copy()
        for A, sign in ((one, 1.0), (other, -1.0)):
            A.axpy(-0.5 / forward, change, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            A.axpy(sign, still, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        one.axpy(1.0, transposed(other))
        one.scale(0.5)

    def shapes(self) -> RitzVectors:
        """Return the shapes that move the tip here."""
        return RitzVectors(self.system.held, self.matrices["M"], self.matrices["K"], self.speed**2)

    def reduced(self, shapes: RitzVectors) -> tuple[Array, Array, Array]:
        """Return M, C, K in shapes that were made or turned by M and K, (r, r) each; of a free hub (r + 1, r + 1).

        The state must still be the one that is set in the system.
        """
        C = self._matrix("C") if self._damping is None else self._damping
        parts = {"M": np.eye(len(shapes.squares)), "C": shapes.product(C), "K": shapes.stiffness}
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
