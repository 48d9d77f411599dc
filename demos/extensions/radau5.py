"""A scheme of a user's own whose stages are coupled: Radau IIA of fifth order.

With V_i and A_i the rates at t_n + c_i h, three stages i, the last of which is the end of the step, solve

    Q_i = q_n + h Σ_j a_ij V_j,    V_i = v_n + h Σ_j a_ij A_j,    F(Q_i, V_i, A_i) = 0

(Hairer & Wanner 1996, section IV.5). With W = a⁻¹ a change dQ of the stages changes V by W dQ/h and A by W² dQ/h², so
in the basis of W = T Λ T⁻¹ simplified Newton iterations fall into K + s C + s² M with s = λ/h: a real system and a
complex one, for two conjugate λ (IV.8). M, C and K are those at the start of the step. On one process.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from rotfem import ComputationError, Scheme, Stage, State, register

R = np.sqrt(6.0)
A = np.array(
    [
        [(88 - 7 * R) / 360, (296 - 169 * R) / 1800, (-2 + 3 * R) / 225],
        [(296 + 169 * R) / 1800, (88 + 7 * R) / 360, (-2 - 3 * R) / 225],
        [(16 - R) / 36, (16 + R) / 36, 1 / 9],
    ]
)
C, W = A.sum(axis=1), np.linalg.inv(A)
LAMBDA, T = np.linalg.eig(W)


@dataclass(frozen=True)
class Radau5(Scheme):
    """Fifth order in smooth motions; unresolved vibrations are damped within a few steps."""

    name = "radau5"
    order = 5
    stages = 3

    def stage(self, i, state, h, end, done):
        """Return a stage, predicted by the acceleration before."""
        c, t = C[i] * h, end if i == 2 else state.t + C[i] * h
        q, v = state.q + c * state.v + c * c / 2 * state.a, state.v + c * state.a
        return Stage(t, q, v, state.a.copy(), 1 / c, 1 / c**2)

    def solved(self, state, h, end, equations):
        """Return the stages, solved together by simplified Newton iterations."""
        stages = [self.stage(i, state, h, end, ()) for i in range(3)]
        system, newton, previous = equations.system, equations.newton, np.inf
        equations.imbalance(Stage(state.t, state.q.copy(), state.v.copy(), state.a.copy(), 0.0, 0.0))
        matrices = [csr_array(M.getValuesCSR()[::-1]) for M in system.with_hub(system.mass_damping_stiffness())]
        solvers = [splu((s * s * matrices[0] + s * matrices[1] + matrices[2]).tocsc()) for s in LAMBDA / h]
        for _ in range(newton.max_iterations):
            residuals = np.array([equations.imbalance(stage) for stage in stages])
            parts = [solver.solve(row) for solver, row in zip(solvers, np.linalg.inv(T) @ residuals, strict=True)]
            dq = np.real(T @ np.array(parts))
            for stage, q, v, a in zip(stages, dq, W @ dq / h, W @ W @ dq / h**2, strict=True):
                stage.q[:], stage.v[:], stage.a[:] = stage.q + q, stage.v + v, stage.a + a
            newton.iterations += 1
            size = float(system.increment_size(np.abs(dq).max(axis=0)))
            if size <= 1e-2 * newton.tolerance or (size <= newton.tolerance and size > 0.3 * previous):
                return stages
            previous = size
        raise ComputationError(f"simplified Newton stays at increments of {size:.1e} (scaled)", time=end)

    def finish(self, state, h, done):
        """Return the last stage."""
        return State(done[-1].t, done[-1].q, done[-1].v, done[-1].a)


register(Radau5)
