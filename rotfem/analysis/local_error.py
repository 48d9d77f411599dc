"""Local errors of adaptive steps, as displacements."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.numerics.linear import DirectSolver, combine
from rotfem.numerics.projection import sparse_part, times, with_ghosts

#: Filters are made for steps in this ratio.
COARSE = 1.5


class LocalError:
    """Error at the end of a history that a step's local error e leads to if every step were like this one.

    A vibration of frequency ω and amplitude A has a local error e of C (ωh)ᵐ A in every step. N such steps add up to
    N C (ωh)ᵐ A, but never to more than 2 A, the vibration in opposite phase: what is small need not be resolved. With

        F = (M + τ C + τ² K)⁻¹ M,    N C (h/τ)ᵐ = 2,    n = (m + 1)/2,

    4 Fⁿ N e is N e/2 where that is 2A, and at most 2.1 · 2A beyond. An unresolved vibration has an e of up to
    (s ωh)² A, of which F with τ = s h leaves A: it counts with twice its amplitude. The error is the larger
    of both. With C, motions that strong damping stops within the step are filtered too (as any stiff component: Hairer
    & Wanner 1996, eq. (IV.8.20)). Matrices are those at the start. Without Fⁿ motions that ring take three to five
    times the steps.

    Args:
        system: equations of motion; state and time of the start are set in it.
        scheme: whose local errors are measured.
        end: length of the history, s.
    """

    def __init__(self, system: Any, scheme: Scheme, end: float):
        self.inner, self.end, self.scheme = system.held, end, scheme
        self.inner.set_time(0.0, self.inner.model.problem.motion)  # of a free hub the speed it starts with, not of now
        self.inner.set_state(self.inner.zeros())
        self._matrices = system.with_hub(self.inner.mass_damping_stiffness())
        self._owned = self.inner.V.dofmap.index_map.size_local * self.inner.V.dofmap.index_map_bs
        self._bucket: int | None = None
        self._solvers: list[DirectSolver] = []

    def __call__(self, error: Array | None, h: float) -> float:
        """Return the largest displacement of an error of q (local dof array), scaled, at the end of the history."""
        assert error is not None
        M, bucket = self._matrices[0], round(np.log(h) / np.log(COARSE))
        if bucket != self._bucket:
            self._bucket, self._solvers = bucket, self._made(COARSE**bucket)
        e = np.full((M.getLocalSize()[0], 1), error[-1])  # the last process has the angle of a hub
        e[: self._owned, 0] = error[: self._owned]
        (adds_up, remains), n = self._solvers, (self.scheme.estimate[1] + 1) // 2
        once, often = remains.solve_all(times(M, e)), e
        for _ in range(n):
            often = adds_up.solve_all(times(M, often))
        sizes = [self.size(with_ghosts(self.inner.V, x[: self._owned, 0])) for x in (often, once)]
        return max(4.0 * self.end / h * sizes[0], 2.0 * sizes[1])

    def _made(self, h: float) -> list[DirectSolver]:
        """Return the filters of what adds up, and of unresolved vibrations, for steps of h (s)."""
        (M, C, K), (constant, order, lost) = self._matrices, self.scheme.estimate
        out = []
        for tau in (h * (0.5 * constant * self.end / h) ** (1 / order), lost * h):
            out.append(DirectSolver(combine(sparse_part(M).duplicate(), [M, C, K], np.array([1.0, tau, tau * tau]))))
        return out

    def size(self, x: Array) -> float:
        """Return the largest displacement of points of the sections in a local dof array, over the length."""
        n = len(self.inner.scale)
        return float(self.inner.displaced(x[:n]).max() / self.inner.structure.length)

    def displacement(self, state: State) -> float:
        """Return the largest displacement of a state relative to the turning frame, in units of its scale."""
        q, clamp = state.q[: len(self.inner.scale)], self.inner.clamp
        if clamp is not None:
            x = self.inner.V.tabulate_dof_coordinates()[:, 0]
            q = clamp.relative(q.reshape(len(x), -1), x, state.t).ravel()
        return max(1e-6, self.size(q))
