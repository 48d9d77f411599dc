"""A scheme of a user's own with two stages: the singly diagonally implicit Runge–Kutta method of second order.

Its stages i = 1, 2 at t_n + c_i h, c = (γ, 1), γ = 1 − 1/√2, are

    Q_i = q_n + h Σ_j a_ij V_j,    V_i = v_n + h Σ_j a_ij A_j,    a = ((γ, 0), (1 − γ, γ)),

and the last is the end of the step (Alexander 1977, section 3): L-stable.
"""

from dataclasses import dataclass
from math import sqrt

from rotfem import Scheme, Stage, State, register

GAMMA = 1 - 1 / sqrt(2)


@dataclass(frozen=True)
class SDIRK2(Scheme):
    """Alexander's method of two stages."""

    name = "sdirk2"
    order = 2
    stages = 2

    def stage(self, i, state, h, end, done):
        """Return a stage, predicted by the acceleration before."""
        c, t = (GAMMA, state.t + GAMMA * h) if i == 0 else (1.0, end)
        q, q_known, v_known = state.q + c * h * state.v + (c * h) ** 2 / 2 * state.a, state.q, state.v
        for before in done:
            q_known, v_known = q_known + (1 - GAMMA) * h * before.v, v_known + (1 - GAMMA) * h * before.a
        v = (q - q_known) / (GAMMA * h)
        return Stage(t, q, v, (v - v_known) / (GAMMA * h), 1 / (GAMMA * h), 1 / (GAMMA * h) ** 2)

    def finish(self, state, h, done):
        """Return the last stage."""
        return State(done[-1].t, done[-1].q, done[-1].v, done[-1].a)


register(SDIRK2)
