"""Generalised-α and Newmark: one step as update maps.

One step from t_n to t_{n+1} = t_n + h satisfies F(q, v, q̈) = 0 at t_{n+1}, with (Arnold & Brüls 2007, eqs. 2–3)

    q_{n+1} = q_n + h v_n + h² (½ − β) a_n + h² β a_{n+1}
    v_{n+1} = v_n + h (1 − γ) a_n + h γ a_{n+1}
    (1 − α_m) a_{n+1} + α_m a_n = (1 − α_f) q̈_{n+1} + α_f q̈_n

where a is an auxiliary acceleration, the memory of the scheme; Newmark is α_m = α_f = 0.

q_{n+1} = q_n + h v,    v_{n+1} = v_n + h a,    F̄(q, v, a; t_n + h/2) = 0,    q = (q_n + q_{n+1})/2, v likewise.

F̄ is F itself in a linear theory, whose quadratic energy the midpoint rule conserves. In a nonlinear one it has the mean
stress of the step's ends and a discrete gradient (`rotfem.equations.energy_balance`).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, Span, Stage, State
from rotfem.registry import register


@lru_cache(maxsize=8)
def update_maps(coefficients: tuple[float, float, float, float], h: float) -> tuple[Array, float, float]:
    """Return maps of a step of h (s), and ∂v/∂q and ∂a/∂q in it.

    The maps (4, 4) take q, v, q̈ and â at its start to q, v and q̈ at its end where q̈ stays, and to the part of â there
    that does not change with q̈.
    """
    alpha_m, alpha_f, beta, gamma = coefficients
    kept, moved = (alpha_f / (1 - alpha_m), -alpha_m / (1 - alpha_m)), np.array([1.0, -alpha_m]) / (1 - alpha_m)
    q, v = (np.array([0.0, 0.5 - beta]) + beta * moved) * h * h, (np.array([0.0, 1 - gamma]) + gamma * moved) * h
    c_a = 1 / (beta * h * h)
    maps = np.array([[1.0, h, *q], [0.0, 1.0, *v], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, *kept]])
    return maps, gamma * h * c_a, (1 - alpha_m) / (1 - alpha_f) * c_a


class AlphaFamily(Scheme):
    """What generalised-α and Newmark share; second-order accurate when γ = ½ + α_f − α_m."""

    order: ClassVar[int] = 2
    filters_jumps: ClassVar[bool] = True

    @property
    @abstractmethod
    def coefficients(self) -> tuple[float, float, float, float]:
        """α_m, α_f, β, γ."""

    def start(self, state: State) -> State:
        """Return the state with the auxiliary acceleration q̈."""
        return state.changed(memory=state.a.copy())

    def jumped(self, state: State, change: Array) -> State:
        """Return the state whose auxiliary acceleration has jumped too.

        It stands for q̈ at another instant than t, also after the jump.
        """
        return state.changed(memory=state.memory + change)

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return the step that keeps q̈, which is free of residual when the acceleration is constant."""
        maps, c_v, c_a = update_maps(self.coefficients, h)
        q, v, a, carried = maps.dot(np.array((state.q, state.v, state.a, state.memory)))
        return Stage(end, q, v, a, c_v, c_a, carried=carried)

    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        """Return the state of the one stage; the auxiliary acceleration follows from its definition."""
        s, (alpha_m, alpha_f, _, _) = done[0], self.coefficients
        s.carried += (1 - alpha_f) / (1 - alpha_m) * s.a
        return State(s.t, s.q, s.v, s.a, s.carried)

    def local_error(self, new: State, old: State) -> Array:
        """Return |β − 1/6| h² |a_{n+1} − a_n|.

        Zienkiewicz & Xie 1991, eq. (14): the term of the Taylor series that Newmark's β does not match.
        """
        h, beta = new.t - old.t, self.coefficients[2]
        change: Array = new.memory - old.memory
        return abs(beta - 1 / 6) * h * h * change

    def resized(self, new: State, old: State, h: float) -> State:
        """Return the state with the auxiliary acceleration moved to where the next step takes it.

        It stands for q̈ at t + h (α_m − α_f), so it changes with h; without this a change of step would cost an order.
        Beyond the largest growth of steps it is q̈.
        """
        last, (alpha_m, alpha_f, _, _) = new.t - old.t, self.coefficients
        if h > self.growth * last * (1 + 1e-9):
            return self.start(new)
        return new.changed(memory=new.memory + (alpha_f - alpha_m) * (1 - h / last) * (new.memory - old.memory))


@dataclass(frozen=True)
class GeneralisedAlpha(AlphaFamily):
    """Generalised-α (Chung & Hulbert 1993, eqs. 17, 25).

    Attributes:
        spectral_radius: ρ∞ at infinite frequency, between 0 (annihilates) and 1 (conserves).
    """

    name: ClassVar[str] = "generalised_alpha"

    spectral_radius: float = 0.9

    @cached_property
    def coefficients(self) -> tuple[float, float, float, float]:
        """α_m, α_f, β, γ."""
        rho = self.spectral_radius
        alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
        return alpha_m, alpha_f, (1 - alpha_m + alpha_f) ** 2 / 4, 0.5 - alpha_m + alpha_f

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        """Return what is allowed of a spectral radius that is not."""
        inside = 0.0 <= parameters.get("spectral_radius", 0.0) <= 1.0
        return {} if inside else {"spectral_radius": "must be at least 0 and at most 1"}


@dataclass(frozen=True)
class Newmark(AlphaFamily):
    """Newmark's scheme; (1/4, 1/2) is the trapezoidal rule.

    Attributes:
        beta, gamma: its parameters; of second order with gamma = ½.
    """

    name: ClassVar[str] = "newmark"

    beta: float = 0.25
    gamma: float = 0.5

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """α_m, α_f, β, γ."""
        return 0.0, 0.0, self.beta, self.gamma

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        """Return what is allowed of values that are not."""
        out = {} if parameters.get("beta", 1.0) > 0.0 else {"beta": "must be greater than 0"}
        return out if parameters.get("gamma", 0.5) >= 0.5 else out | {"gamma": "must be at least 0.5"}


register(GeneralisedAlpha)
register(Newmark)


@dataclass(frozen=True)
class EnergyConserving(Scheme):
    """Conserves the energy to round-off; nothing is damped, resolved or not."""

    name: ClassVar[str] = "energy_conserving"
    order: ClassVar[int] = 2

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
