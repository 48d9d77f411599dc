"""What a step's local error makes of a history: the error at its end if every step were like this one.

A vibration of frequency ω and amplitude A has a local error of c (ωh)³ A in every step of a scheme of second order. N
such steps add up to N c (ωh)³ A, but never to more than the vibration itself, 2 A: what is small need not be resolved.
The filter

    ê = N (M + τ² K)⁻¹ M e,    τ = 2.5 h (½ c N)^⅓,

leaves N e of what is resolved so far that N c (ωh)³ is small. Of what is not resolved, whose local error in
accelerations is at most 2 c (ωh)² A, a few A are left, whatever N; of the stiffest, axial motions, which are noise,
nothing, though their e is the largest there is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.numerics import compat
from rotfem.numerics.linear import DirectSolver, Increment

Array = npt.NDArray[np.float64]

#: c of the trapezoidal rule, and τ in units of the time within which a vibration is resolved.
COEFFICIENT, PLATEAU = 1 / 12, 2.5


class ErrorMeasure:
    """Size of the error of a whole history that a step stands for.

    Args:
        system: equations of motion; the state of the step is set in it.
        end: length of the history, s.
    """

    def __init__(self, system: Any, end: float):
        self.inner, self.end = system.held, end
        self._e, self._b = (compat.create_vector(self.inner.V) for _ in range(2))
        self._filtered = Increment(self.inner.V)

    def __call__(self, error: Array, h: float) -> float:
        """Return the largest entry of ê, in units of the unknowns' scale.

        Args:
            error: local error of q, local dof array; of a free hub with that of its angle last.
            h: length of the step, s.
        """
        number = self.end / h
        tau = PLATEAU * h * (0.5 * COEFFICIENT * number) ** (1 / 3)
        self._e.array[:] = error[: len(self._e.array)]
        self.inner.matrix(0.0, 0.0, 1.0, 0.0).mult(self._e, self._b)
        self._b.array[self.inner.clamped] = 0.0
        solver = DirectSolver(self.inner.matrix(tau**2, 0.0, 1.0, 1.0))
        return float(number * self.inner.size(self._filtered.solve(solver, self._b)))
