"""Implicit Runge–Kutta schemes: one of fourth order stage by stage, and Radau IIA of fifth order.

With V_i and A_i the rates at t_n + c_i h, a step of either ends in its last stage and solves

    Q_i = q_n + h Σ_j a_ij V_j,    V_i = v_n + h Σ_j a_ij A_j,    F(Q_i, V_i, A_i) = 0.

ESDIRK4 has an explicit first stage, V_1 = v_n, A_1 = q̈_n, and five singly diagonal implicit ones, a_ii = γ = ¼ (Kennedy
& Carpenter 2003, appendix C, the implicit part of ARK4(3)6L[2]SA): L-stable, stiffly accurate, of stage order two. All
stages of steps of one length share one tangent.

Radau IIA is L-stable; its three stages are coupled (Hairer & Wanner 1996, section IV.5). With W = a⁻¹ a change dQ of
the stages changes V by W dQ/h and A by W² dQ/h², so in the basis of W = T Λ T⁻¹ simplified Newton iterations fall into
K + s C + s² M with s = λ/h: one real system and a complex one, for two conjugate λ (IV.8). M, C and K are kept over
steps while the iterations converge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from rotfem.analysis.schemes import Array, Equations, GeneralisedAlpha, Scheme, Stage, State, divided_difference, inner
from rotfem.errors import ComputationError
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
    growth: ClassVar[float] = 5.0

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
        return State(end.t, end.q, end.v, end.a, error, inner=inner(done))

    def local_error(self, new: State, old: State) -> Array:
        """Return the error of q in the step, of fifth order."""
        return np.asarray(new.memory)


register(ESDIRK4)


ROOT = np.sqrt(6.0)

#: a_ij, and c_i.
A = np.array(
    [
        [(88 - 7 * ROOT) / 360, (296 - 169 * ROOT) / 1800, (-2 + 3 * ROOT) / 225],
        [(296 + 169 * ROOT) / 1800, (88 + 7 * ROOT) / 360, (-2 - 3 * ROOT) / 225],
        [(16 - ROOT) / 36, (16 + ROOT) / 36, 1 / 9],
    ]
)
C = A.sum(axis=1)

W = np.linalg.inv(A)
_EIGENVALUES, _VECTORS = np.linalg.eig(W)
_FIRST = [int(np.argmin(np.abs(_EIGENVALUES.imag))), int(np.argmax(_EIGENVALUES.imag))]

#: The real eigenvalue and the one above the axis, with their rows of T⁻¹; and the way back to the stages, of the real
#: part, and of the real and the imaginary part of the one above the axis.
REAL, ABOVE = float(_EIGENVALUES[_FIRST[0]].real), complex(_EIGENVALUES[_FIRST[1]])
ROWS, (_REAL, _ABOVE) = np.linalg.inv(_VECTORS)[_FIRST], _VECTORS[:, _FIRST].T
BACK = np.stack([_REAL.real, 2 * _ABOVE.real, -2 * _ABOVE.imag], axis=1)

#: Iterations before a solution is given up.
MOST_ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class Before:
    """Accelerations of a step's stages, as the memory of the step after it.

    Attributes:
        h: length of the step, s.
        accelerations: at its stages, local dof arrays.
        error: its local error of q.
    """

    h: float
    accelerations: tuple[Array, ...]
    error: Array


class Together(list[Stage]):
    """The coupled stages of a step.

    Args:
        stages: predictions that meet the formulas of the method.
        h: length of the step, s.
    """

    def __init__(self, stages: Sequence[Stage], h: float):
        super().__init__(stages)
        self.rates = np.concatenate((np.eye(len(stages)), W / h, W @ W / h**2))
        self.arrays = np.array([[getattr(s, name) for s in stages] for name in "qva"])
        for i, stage in enumerate(self):
            stage.q, stage.v, stage.a = self.arrays[:, i]

    def correct(self, dq: Array) -> None:
        """Change q by dq (3, …), and the rates with it."""
        self.arrays += self.rates.dot(dq).reshape(self.arrays.shape)


@dataclass(frozen=True)
class RadauIIA(Scheme):
    """Fifth order in smooth motions; unresolved vibrations are damped within a few steps."""

    name: ClassVar[str] = "radau5"
    order: ClassVar[int] = 5
    stages: ClassVar[int] = 3
    estimate: ClassVar[tuple[float, int, float]] = (1 / 14400, 6, 0.2)
    growth: ClassVar[float] = 5.0

    def start(self, state: State) -> State:
        """Return the state without a step before it."""
        return state.changed(memory=None)

    def kinked(self, state: State) -> State:
        """Return the state without the memory of the step before."""
        return self.start(state)

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return stage i + 1, predicted by a constant acceleration."""
        t = end if i == self.stages - 1 else state.t + C[i] * h
        step = C[i] * h
        q, v = state.q + step * state.v + 0.5 * step**2 * state.a, state.v + step * state.a
        return Stage(t, q, v, state.a, REAL / h, (REAL / h) ** 2)

    def solved(self, state: State, h: float, end: float, equations: Equations) -> list[Stage]:
        """Return the stages, solved together with the present matrices, or with new ones at the last iterate.

        Matrices are computed up to three times; at the start of the step if an iterate is half a length away.
        """
        stages = Together([self.stage(i, state, h, end, ()) for i in range(self.stages)], h)
        if state.memory is not None:
            change = weights(h / state.memory.h) @ np.array(state.memory.accelerations) - state.a
            stages.correct(h**2 * A @ A @ change)
        else:
            stages.correct(np.array([equations.predicted(s, state) - s.q for s in stages]))
        begin = stages.arrays.copy()
        if (known := equations.linearised(None)) is not None and iterate(stages, h, equations, known, False) is None:
            return stages
        size: float | None = np.inf
        for last in (False, False, True):
            if not equations.system.increment_size(np.abs(stages.arrays[0] - begin[0]).max(axis=0)) < 0.5:
                stages.arrays[:] = begin
            size = iterate(stages, h, equations, equations.linearised(stages[1]), last)
            if size is None:
                return stages
        raise ComputationError(f"simplified Newton stays at increments of {size:.1e} (scaled)", time=stages[-1].t)

    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        """Return the last stage, with the accelerations of all and the local error."""
        accelerations, end = tuple(s.a for s in done), done[-1]
        memory = Before(h, accelerations, local_error(state, h, accelerations))
        return State(end.t, end.q, end.v, end.a, memory, inner=inner(done))

    def local_error(self, new: State, old: State) -> Array | None:
        """Return the leading term of the error, by the fourth divided difference of accelerations."""
        return new.memory.error if new.memory is not None else None

    def fallbacks(self) -> tuple[Scheme, ...]:
        """Return schemes whose stages are solved one after the other, the most accurate first."""
        return ESDIRK4(), GeneralisedAlpha()


def iterate(stages: Together, h: float, equations: Equations, linearised: Any, last: bool) -> float | None:
    """Correct stages by simplified Newton iterations to round-off; return the increment if that fails.

    Args:
        stages: changed.
        h: length of the step, s.
        equations: that are solved.
        linearised: matrices.
        last: whether increments below Newton's own tolerance are small enough, if they shrink no more.
    """
    linearised.take((REAL / h, ABOVE / h))
    newton, previous, size = equations.newton, np.inf, np.inf
    enough = 0.01 * newton.tolerance  # what it leaves adds up over the steps
    for k in range(1, MOST_ITERATIONS + 1):
        residuals = np.array([equations.imbalance(s) for s in stages])
        real, above = linearised.solve(ROWS[0].real @ residuals, ROWS[1] @ residuals)
        dq = BACK.dot(np.array((real, above.real, above.imag)))
        stages.correct(dq)
        newton.iterations += 1
        size = float(equations.system.increment_size(np.abs(dq).max(axis=0)))
        rate = size / previous if previous > 0.0 else 0.0
        if k > 1 and (size <= enough or (rate < 1.0 and rate / (1 - rate) * size <= enough)):
            linearised.serves = k < 5  # else the next step gets new matrices
            return None
        if not np.isfinite(size) or (k > 2 and (rate >= 1.0 or size * rate ** (MOST_ITERATIONS - k) > enough)):
            break
        previous = size
    if last and size <= newton.tolerance:
        newton.roundoff = max(newton.roundoff, size)
        return None
    return size


@lru_cache(maxsize=8)
def weights(ratio: float) -> Array:
    """Return the weights (3, 3) of a step's accelerations at the stages of one that is longer by a ratio."""
    points = C - 1
    others = [np.delete(points, j) for j in range(len(C))]
    return np.array([[np.prod((x - o) / (p - o)) for p, o in zip(points, others, strict=True)] for x in C * ratio])


def local_error(state: State, h: float, accelerations: Sequence[Array]) -> Array:
    """Return the local error of q, of a step with one before it by fourth differences of q̈, h⁶ q⁽⁶⁾/14400.

    That of a vibration is |R(iωh) − e^{iωh}|. Of others it is estimated by third differences, 5e-4 h⁵ q⁽⁵⁾.
    """
    before = state.memory
    points, values = [0.0, *(C * h)], [state.a, *accelerations]
    if before is None:
        return np.asarray(6 * 5e-4 * h**5 * divided_difference(points, values))
    points, values = [(C[1] - 1) * before.h, *points], [before.accelerations[1], *values]
    return np.asarray(24 * RadauIIA.estimate[0] * h**6 * divided_difference(points, values))


register(RadauIIA)
