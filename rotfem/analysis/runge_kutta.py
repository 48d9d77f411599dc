"""ESDIRK4: an implicit Runge–Kutta scheme of fourth order, stage by stage.

With V_i and A_i the rates at t_n + c_i h, a step ends in its last stage and solves

    Q_i = q_n + h Σ_j a_ij V_j,    V_i = v_n + h Σ_j a_ij A_j,    F(Q_i, V_i, A_i) = 0.

The first stage is explicit, V_1 = v_n, A_1 = q̈_n, five are singly diagonal implicit ones, a_ii = γ = ¼ (Kennedy &
Carpenter 2003, appendix C, the implicit part of ARK4(3)6L[2]SA): L-stable, stiffly accurate, of stage order two. All
stages of steps of one length share one tangent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, Stage, State, divided_difference
from rotfem.registry import register

#: γ, and a_ij below the diagonal, row by row.
GAMMA = 0.25
COEFFICIENTS = (
    (),
    ("1/4",),
    ("8611/62500", "-1743/31250"),
    ("5012029/34652500", "-654441/2922500", "174375/388108"),
    ("15267082809/155376265600", "-71443401/120774400", "730878875/902184768", "2285395/8070912"),
    ("82889/524892", "0", "15625/83664", "69875/102672", "-2260/8211"),
)


def _numbers(row: Sequence[str]) -> list[float]:
    return [float(Fraction(text)) for text in row]


A_ESDIRK = np.array([[*_numbers(row), GAMMA if row else 0.0, *[0.0] * (5 - len(row))] for row in COEFFICIENTS])
C_ESDIRK = A_ESDIRK.sum(axis=1)


@dataclass(frozen=True)
class ESDIRK4(Scheme):
    """Fourth order in smooth motions; unresolved vibrations are damped within a few steps."""

    name: ClassVar[str] = "esdirk4"
    order: ClassVar[int] = 4
    stages: ClassVar[int] = 5
    estimate: ClassVar[tuple[float, int, float]] = (8.5e-4, 5, 0.1)

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return stage i + 2 of the method, predicted by the acceleration of the stage before."""
        t = end if i == self.stages - 1 else state.t + C_ESDIRK[i + 1] * h
        # v and a at the start and of all stages, which write theirs there
        rates = done[0].carried if done else np.array([(state.v, state.a)] * (self.stages + 1))
        from_v, from_a = (h * A_ESDIRK[i + 1, : i + 1]).dot(rates[: i + 1].reshape(i + 1, -1)).reshape(2, -1)
        v, a = rates[i + 1]
        a[:] = rates[i, 1]
        v[:] = state.v + from_a + GAMMA * h * a
        q = state.q + from_v + GAMMA * h * v
        return Stage(t, q, v, a, 1 / (GAMMA * h), 1 / (GAMMA * h) ** 2, carried=rates)

    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        """Return the last stage, and with it the local error of q, 8.5e-4 h⁵ q⁽⁵⁾: of a vibration |R(iωh) − e^{iωh}|.

        The embedded method of third order is so close to this one that its distance is less than the error where
        ωh > ¼; the third differences of accelerations are not.
        """
        end = done[-1]
        points, values = [0.0, *(C_ESDIRK[3:] * h)], [state.a, *(s.a for s in done[2:])]
        error = 6 * self.estimate[0] * h**5 * divided_difference(points, values)
        return State(end.t, end.q, end.v, end.a, error)

    def local_error(self, new: State, old: State) -> Array:
        """Return the error of q in the step, of fifth order."""
        return np.asarray(new.memory)


register(ESDIRK4)
