"""The implicit midpoint rule over steps that keep the balance of energy, of second order.

    q_{n+1} = q_n + h v,    v_{n+1} = v_n + h a,    F̄(q, v, a; t_n + h/2) = 0,    q = (q_n + q_{n+1})/2, v likewise.

What F̄ is the system says (`rotfem.equations.energy_balance`): of a linear theory F itself, whose quadratic energy the
rule conserves; of a nonlinear one the mean stress of the step's ends and a discrete gradient do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rotfem.analysis.schemes import Scheme, Span, Stage, State
from rotfem.registry import register


@dataclass(frozen=True)
class EnergyConserving(Scheme):
    """Energy to round-off for as many steps as there are; nothing is damped, resolved or not."""

    name: ClassVar[str] = "energy_conserving"
    order: ClassVar[int] = 2
    balanced_at_end: ClassVar[bool] = False

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return the middle of the step, predicted by the acceleration of the last one."""
        v = state.v + h / 2 * state.a
        return Stage((state.t + end) / 2, state.q + h / 2 * v, v, state.a.copy(), 2 / h, 4 / h**2, Span(state, end))

    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        """Return the end of the step; its acceleration is that of the middle."""
        (s,) = done
        assert s.over is not None
        return State(s.over.end, 2 * s.q - state.q, 2 * s.v - state.v, s.a, s.memory, balanced=False)


register(EnergyConserving)
