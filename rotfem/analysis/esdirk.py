"""A scheme of fourth order with an error estimate: an explicit first stage and five singly diagonal implicit ones.

The stages are, with V_1 = v_n, A_1 = q̈_n,

    Q_i = q_n + h Σ_j a_ij V_j,    V_i = v_n + h Σ_j a_ij A_j,    a_ii = γ = ¼ (i > 1),

and the last is the end of the step (Kennedy & Carpenter 2003, appendix C, the implicit part of ARK4(3)6L[2]SA):
L-stable, stiffly accurate, of stage order two. All stages of steps of one length share one tangent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, Stage, State, divided_difference, inner
from rotfem.registry import register

GAMMA = 0.25

#: a_ij below the diagonal, row by row.
ROWS = (
    (),
    ("1/4",),
    ("8611/62500", "-1743/31250"),
    ("5012029/34652500", "-654441/2922500", "174375/388108"),
    ("15267082809/155376265600", "-71443401/120774400", "730878875/902184768", "2285395/8070912"),
    ("82889/524892", "0", "15625/83664", "69875/102672", "-2260/8211"),
)


def _numbers(row: Sequence[str]) -> list[float]:
    return [float(Fraction(text)) for text in row]


A = np.array([[*_numbers(row), GAMMA if row else 0.0, *[0.0] * (5 - len(row))] for row in ROWS])
C = A.sum(axis=1)


@dataclass(frozen=True)
class ESDIRK4(Scheme):
    """Fourth order in smooth motions; what it does not resolve is damped within a few steps."""

    name: ClassVar[str] = "esdirk4"
    order: ClassVar[int] = 4
    stages: ClassVar[int] = 5
    estimate: ClassVar[tuple[float, int, float]] = (8.5e-4, 5, 0.1)
    growth: ClassVar[float] = 5.0

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return stage i + 2 of the method, predicted by the acceleration of the stage before."""
        t = end if i == self.stages - 1 else state.t + C[i + 1] * h
        before: list[State | Stage] = [state, *done]
        weights, a = h * A[i + 1, : i + 1], before[-1].a.copy()
        v = state.v + weights @ np.array([s.a for s in before]) + GAMMA * h * a
        q = state.q + weights @ np.array([s.v for s in before]) + GAMMA * h * v
        return Stage(t, q, v, a, 1 / (GAMMA * h), 1 / (GAMMA * h) ** 2)

    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        """Return the last stage, and with it the local error of q, 8.5e-4 h⁵ q⁽⁵⁾: of a vibration |R(iωh) − e^{iωh}|.

        The embedded method of third order is so close to this one that its distance is less than the error where
        ωh > ¼; the third differences of accelerations are not.
        """
        end = done[-1]
        points, values = [0.0, *(C[3:] * h)], [state.a, *(s.a for s in done[2:])]
        error = 6 * self.estimate[0] * h**5 * divided_difference(points, values)
        return State(end.t, end.q, end.v, end.a, error, inner=inner(done))

    def local_error(self, new: State, old: State) -> Array:
        """Return the error of q in the step, of fifth order."""
        return np.asarray(new.memory)


register(ESDIRK4)
