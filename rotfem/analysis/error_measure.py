"""What a step's local error makes of a history: the error at its end if every step were like this one.

A vibration of frequency ω and amplitude A has a local error of C (ωh)ᵐ A in every step. N such steps add up to
N C (ωh)ᵐ A, but never to much more than the vibration itself: what is small need not be resolved. With filters
F(τ) = (M + τ C + τ² K)⁻¹ M, which leave a vibration 1/(1 + τ²ω²), the size of the error is the larger of

    N F(τ₁) … F(τ_k) e    and    F(h) e,    N C (h/τ)ᵐ = 2,

the τ such that N e is left where it is below 2 A, and about 2 A beyond; what is not resolved at all has an e of up to
(ωh)² A, of which F(h) leaves A, once: it is damped, or hardly moved. Stiff axial motions, whose e is the largest there
is, thus count with their amplitude. So do motions that strong damping C stops within the step: without C their e, of
h² a at the start, would be taken for an error (as of any stiff component: Hairer & Wanner 1996, eq. (IV.8.20)).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import Scheme, State
from rotfem.numerics import compat
from rotfem.numerics.linear import DirectSolver, Increment

Array = npt.NDArray[np.float64]

#: Filters are made for steps in this ratio.
COARSE = 1.5


class ErrorMeasure:
    """Size of the error of a whole history that a step stands for.

    Args:
        system: equations of motion; state and time of the start are set in it where filters are made.
        scheme: whose local errors are measured.
        end: length of the history, s.
    """

    def __init__(self, system: Any, scheme: Scheme, end: float):
        self.inner, self.end, self.scheme = system.held, end, scheme
        self._e, self._b = (compat.create_vector(self.inner.V) for _ in range(2))
        self._filtered = Increment(self.inner.V)
        self._displacements = [i for i, name in enumerate(self.inner.structure.components) if name.startswith("u")]
        self._kept: dict[int, list[list[DirectSolver]]] = {}
        self._mass: Any = None

    def __call__(self, error: Array, h: float) -> float:
        """Return the largest entry of the error, in units of the unknowns' scale.

        Args:
            error: local error of q, local dof array; of a free hub with that of its angle last.
            h: length of the step, s.
        """
        length = round(np.log(h) / np.log(COARSE))
        if length not in self._kept:
            while len(self._kept) >= 4:
                self._kept.pop(next(iter(self._kept)))
            self._kept[length] = self._made(COARSE**length)
        # what is not resolved is off by up to 2 A, of which A/2 may remain
        adds_up, remains = (self.size(self._through(error, filters)) for filters in self._kept[length])
        return max(self.end / h * adds_up, 3.0 * remains)

    def size(self, x: Array) -> float:
        """Return the largest displacement of a local dof array, in units of their scale."""
        return float(self.inner.sizes(x)[self._displacements].max())

    def displacement(self, state: State) -> float:
        """Return the largest displacement of a state relative to the turning frame, in units of its scale."""
        q, clamp = state.q[: len(self.inner.scale)], self.inner.clamp
        if clamp is not None:
            x = self.inner.V.tabulate_dof_coordinates()[:, 0]
            q = clamp.relative(q.reshape(len(x), -1), x, state.t).ravel()
        return self.size(q)

    def _made(self, h: float) -> list[list[DirectSolver]]:
        """Return the filters of what adds up and of what remains, for steps of h (s), by the matrices at the start."""
        constant, order, lost = self.scheme.estimate
        # filters in a row turn off less sharply than (1 + (τω)ᵐ)⁻¹ does, so they start earlier
        slow = 0.85 * (0.5 * constant * self.end / h) ** (1 / order)
        times = [slow] * (order // 2) + [slow**0.5] * (order % 2)
        inner = self.inner
        inner.set_time(0.0, inner.model.problem.motion)  # of a free hub the speed it starts with, not that of now
        inner.set_state(inner.zeros())
        self._mass = self._mass or inner.matrix(0.0, 0.0, 1.0, 0.0)
        made = {tau: DirectSolver(inner.matrix((tau * h) ** 2, tau * h, 1.0, 1.0)) for tau in {lost, *times}}
        return [[made[tau] for tau in times], [made[lost]]]

    def _through(self, error: Array, filters: list[DirectSolver]) -> Array:
        """Return an error after filters, a local array of the structure's unknowns (reused)."""
        x = error
        for solver in filters:
            self._e.array[:] = x[: len(self._e.array)]
            self._mass.mult(self._e, self._b)
            self._b.array[self.inner.clamped] = 0.0
            x = self._filtered.solve(solver, self._b)
        return x
