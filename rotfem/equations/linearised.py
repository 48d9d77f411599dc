"""M, C and K of a system at one state, and solutions with K + s C + s² M for several s, complex ones among them.

Schemes whose stages hang together solve for all of them with such matrices, one for each eigenvalue of their
coefficients; the matrices serve for as many steps as they are good for, of any length.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import ComputationError
from rotfem.numerics.linear import ComplexSolver, DirectSolver, Increment, combine

Array = npt.NDArray[Any]


class Linearised:
    """The equations of a system, linearised about the state and time set.

    Args:
        system: equations of motion of a structure.

    Attributes:
        reference: what the rotations of the state are counted from.
        serves: whether further steps may be solved with them.
    """

    def __init__(self, system: Any):
        self.system, self.reference, self.serves = system, system.reference, True
        self._matrices = tuple(reversed(system.held.mass_damping_stiffness()))
        self._shift: float | None = None
        self._part = Increment(system.held.V)
        self._owned = len(self._matrices[0].createVecLeft().array)
        self._real_matrix = self._matrices[0].duplicate()
        self._real = DirectSolver(self._real_matrix)
        self._complex = ComplexSolver(self._matrices)
        self._b = self._real_matrix.createVecLeft()

    def take(self, shifts: tuple[float, complex]) -> None:
        """Factorise with a real and a complex s (1/s), unless the factors at hand are those."""
        if self._shift == shifts[0]:
            return
        s, z = shifts
        self._real.refresh(combine(self._real_matrix, list(self._matrices), np.array([1.0, s, s * s])))
        self._complex.factor((1.0, z, z * z))
        self._shift = s

    def solve(self, real: Array, complex_: Array) -> tuple[Array, Array]:
        """Return (K + s C + s² M)⁻¹ r for the real and the complex s, local arrays, of owned ones."""
        return self._solve_real(real), self._local(self._complex.solve(complex_))

    def _solve_real(self, r: Array) -> Array:
        self._b.array[:] = r
        return self._part.solve(self._real, self._b).copy()

    def _local(self, owned: Array) -> Array:
        """Return an owned complex array with the ghosts of other ranks."""
        if self.system.held.comm.size == 1:
            return owned
        parts = []
        for part in (owned.real, owned.imag):
            x = self._part.function.x
            x.array[: self._owned] = part
            x.scatter_forward()
            parts.append(x.array.copy())
        return np.asarray(parts[0] + 1j * parts[1])


class BorderedLinearised(Linearised):
    """Those of a structure with the angle of its hub as last unknown, eliminated as in `BorderedSystem`."""

    def __init__(self, system: Any):
        super().__init__(system)
        row, inner = system.row, system.held
        unit = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        self._rows = np.array([row.row(shifts).array.copy() for shifts in unit])
        self._columns = np.array([inner.spin_derivative(c_v, c_m).array.copy() for _, c_v, c_m in unit])
        self._corners = np.array([row.diagonal(c_v, c_m) for _, c_v, c_m in unit])

    def take(self, shifts: tuple[float, complex]) -> None:
        """Factorise, and solve for the answer to the angle."""
        if self._shift == shifts[0]:
            return
        super().take(shifts)
        powers = [np.array([1.0, s, s * s]) for s in shifts]
        answers = super().solve(*(p @ self._columns for p in powers))
        self._border = [
            (z, p @ self._rows, self._corners @ p - self._product(p @ self._rows, z))
            for p, z in zip(powers, answers, strict=True)
        ]

    def solve(self, real: Array, complex_: Array) -> tuple[Array, Array]:
        """Return the solutions with the angle last."""
        found = super().solve(real[:-1], complex_[:-1])
        out = []
        for y, r, (z, row, corner) in zip(found, (real[-1], complex_[-1]), self._border, strict=True):
            if corner == 0.0:
                raise ComputationError("the hub equation is singular")
            turn = (r - self._product(row, y)) / corner
            out.append(np.append(y - z * turn, turn))
        return out[0], out[1]

    def _product(self, row: Array, x: Array) -> Any:
        here, comm = row @ x[: len(row)], self.system.held.comm
        return here if comm.size == 1 else comm.allreduce(here)
