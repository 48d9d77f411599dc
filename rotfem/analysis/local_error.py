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

    A vibration that is not resolved has an e of up to (s ωh)² times its amplitude, of which

        (M + τ C + τ² K)⁻¹ M e,    τ = s h,

    leaves the amplitude (Hairer & Wanner 1996, eq. (IV.8.20)). With C, motions that strong damping stops within the
    step are filtered too. Matrices are those at the start.

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
        self._solver: DirectSolver | None = None

    def __call__(self, error: Array | None, h: float) -> float:
        """Return the largest displacement of an error of q (local dof array), scaled, over all steps like it.

        Args:
            error: local error of q; of a free hub with that of its angle last.
            h: length of the step, s.
        """
        assert error is not None
        M, C, K = self._matrices
        e = np.full(M.getLocalSize()[0], error[-1])  # the last process has the angle of a hub
        e[: self._owned] = error[: self._owned]
        bucket = round(np.log(h) / np.log(COARSE))
        if self._solver is None or bucket != self._bucket:
            tau = self.scheme.estimate[2] * COARSE**bucket
            matrix = combine(sparse_part(M).duplicate(), [M, C, K], np.array([1.0, tau, tau * tau]))
            self._bucket, self._solver = bucket, DirectSolver(matrix)
        filtered = self._solver.solve_all(times(M, e[:, None]))[: self._owned, 0]
        return self.end / h * self.size(with_ghosts(self.inner.V, filtered))

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
