"""A scheme of a user's own that keeps a step of history: the backward difference formula of second order.

With r = h_n/h_{n−1} and D x = (1 + 2r)/(1 + r) x_{n+1} − (1 + r) x_n + r²/(1 + r) x_{n−1}

    h v_{n+1} = D q,    h q̈_{n+1} = D v,

and the first step, or the one after a jump, by the trapezoidal rule.
"""

from dataclasses import dataclass

from rotfem import Scheme, Stage, State, register


@dataclass(frozen=True)
class BDF2(Scheme):
    """Backward differences of second order (Curtiss & Hirschfelder 1952), for steps of any length."""

    name = "bdf2"
    order = 2

    def stage(self, i, state, h, end, done):
        """Return the end of the step, predicted by the acceleration before."""
        q = state.q + h * state.v + h * h / 2 * state.a
        if state.memory is None:
            v = 2 / h * (q - state.q) - state.v
            return Stage(end, q, v, 2 / h * (v - state.v) - state.a, 2 / h, 4 / h**2)
        last, q_last, v_last = state.memory
        r = h / (state.t - last)
        new, now, before = (1 + 2 * r) / (1 + r) / h, -(1 + r) / h, r**2 / (1 + r) / h
        v = new * q + now * state.q + before * q_last
        return Stage(end, q, v, new * v + now * state.v + before * v_last, new, new**2)

    def finish(self, state, h, done):
        """Return the end of the step; it remembers where it began."""
        return State(done[0].t, done[0].q, done[0].v, done[0].a, (state.t, state.q, state.v))


register(BDF2)
