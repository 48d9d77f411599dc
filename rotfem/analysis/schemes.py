"""Time-stepping schemes: stages, update maps, memory, order and error estimate.

The equations of motion F(q, v, a, t) = 0 hold at every stage. A stage has a time t, a prediction of q, v and a there,
and ∂v/∂q and ∂a/∂q, by which a correction of q changes v and a. The scheme makes the state at the end of a step of its
stages. So F does not depend on the scheme, and the solution of a stage not on its coefficients.

One step of generalised-α from t_n to t_{n+1} = t_n + h satisfies F(q, v, q̈) = 0 at t_{n+1}, with (Arnold & Brüls 2007,
eqs. 2–3)

    q_{n+1} = q_n + h v_n + h² (½ − β) a_n + h² β a_{n+1}
    v_{n+1} = v_n + h (1 − γ) a_n + h γ a_{n+1}
    (1 − α_m) a_{n+1} + α_m a_n = (1 − α_f) q̈_{n+1} + α_f q̈_n

where a is an auxiliary acceleration, the memory of the scheme; Newmark is α_m = α_f = 0. That which keeps energy has

    q_{n+1} = q_n + h v,    v_{n+1} = v_n + h a,    F̄(q, v, a; t_n + h/2) = 0,    q = (q_n + q_{n+1})/2, v likewise.

F̄ is F itself in a linear theory, whose quadratic energy the midpoint rule conserves. In a nonlinear one it has the mean
stress of the step's ends and a discrete gradient (`rotfem.equations.nonlinear`).

ESDIRK4 is an implicit Runge–Kutta scheme of fourth order, solved stage by stage. With V_i and A_i the rates at
t_n + c_i h, a step ends in its last stage and solves

    Q_i = q_n + h Σ_j a_ij V_j,    V_i = v_n + h Σ_j a_ij A_j,    F(Q_i, V_i, A_i) = 0.

The first stage is explicit, V_1 = v_n, A_1 = q̈_n, five are singly diagonal implicit ones, a_ii = γ = ¼ (Kennedy &
Carpenter 2003, appendix C, the implicit part of ARK4(3)6L[2]SA): L-stable, stiffly accurate, of stage order two. All
stages of steps of one length share one tangent.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, lru_cache
from math import prod
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from rotfem.registry import Registry, register
from rotfem.registry import schemes as registered

if TYPE_CHECKING:  # a scene is read without FEniCSx
    from rotfem.equations.system import System
    from rotfem.numerics.newton import Newton
    from rotfem.structures.reference_rotation import ReferenceRotation

Array = npt.NDArray[np.float64]

#: (∂q/∂q, ∂v/∂q, ∂a/∂q) of a stage: the factors of K, C and M in its tangent.
Shifts = tuple[float, float, float]


#: The longest adaptive step, as a part of the end of a history, which is drawn.
LONGEST = 0.05


@dataclass(frozen=True)
class Pace:
    """Memory of the step-size controller.

    Attributes:
        h: length of the next step, s.
        error: of the last step, as a part of the one aimed at.
        largest: displacement so far (scaled).
    """

    h: float
    error: float
    largest: float


@dataclass
class State:
    """The motion at one instant.

    Attributes:
        t: time, s.
        q, v, a: the unknowns (m, rad), q̇ and q̈; local dof arrays, of a free hub with its angle as last entry.
        memory: what the scheme keeps of the steps before.
        hub_work: work (J) and angular impulse (N·m·s) that a free hub and its structure were given since t = 0, and the
            moment (N·m) of the forces from outside now; None where the hub is not free.
        reference: what the rotations in q are counted from; None for the undeformed structure.
        balanced: whether the equations hold with q, v and a; otherwise a is that of another instant.
        jump: what of a came at once, at the start or by a jump of what drives the system; None of a step's end.
        pace: memory of the step-size controller; None before the first adaptive step.
    """

    t: float
    q: Array
    v: Array
    a: Array
    memory: Any = None
    hub_work: Array | None = None
    reference: ReferenceRotation | None = None
    balanced: bool = True
    jump: Array | None = None
    pace: Pace | None = None

    @classmethod
    def at_rest(cls, system: System, q: Array, v: Array | None = None) -> State:
        """Return the state at t = 0 of a shape q that rests in the frame, counted as a system counts its rotations.

        With rates v where the frame does not turn with the structure.
        """
        return cls(0.0, q, np.zeros_like(q) if v is None else v, np.zeros_like(q), reference=system.reference)

    def changed(self, **changes: Any) -> State:
        """Return a copy with other values."""
        return replace(self, **changes)


@dataclass(frozen=True)
class Span:
    """A whole step: where it starts, and when it ends (s)."""

    start: State
    end: float


@dataclass
class Stage:
    """An instant at which F = 0 is to be met: a prediction of q, v, a, and how v and a change with q.

    Attributes:
        t: time, s.
        q, v, a: the prediction, then the solution; overwritten by `correct`.
        c_v, c_a: ∂v/∂q (1/s) and ∂a/∂q (1/s²).
        over: the step that the stage is the middle of, where the balance of energy over it is to be kept; its end is
            at 2q − q_n, 2v − v_n then.
        memory: what the balance leaves to the next step.
        carried: part of the scheme's own memory that does not change with the solution.
    """

    t: float
    q: Array
    v: Array
    a: Array
    c_v: float
    c_a: float
    over: Span | None = None
    memory: Any = None
    carried: Any = None
    shifts: Shifts = field(init=False)

    def __post_init__(self) -> None:
        self.shifts = (1.0, self.c_v, self.c_a)

    def correct(self, dq: Array) -> None:
        """Add a correction of q, and what follows from it to v and a."""
        self.q += dq
        self.v += self.c_v * dq
        self.a += self.c_a * dq


class Equations(Protocol):
    """What a scheme may ask of the equations of motion to solve its stages together."""

    system: System
    newton: Newton

    def imbalance(self, stage: Stage) -> Array:
        """Return −F at a stage, zero at clamped unknowns; the owned part, of a free hub with that of its angle last."""


#: What sees a step, or a part of one, of a march, from an old to a new state.
Observer = Callable[[State, State], None]


def divided_difference(points: Sequence[float], values: Sequence[Array]) -> Array:
    """Return the divided difference of values at distinct points: the derivative of order n − 1 over (n − 1)!."""
    return np.asarray(_difference_weights(*points) @ np.array(values))


@lru_cache(maxsize=8)
def _difference_weights(*points: float) -> Array:
    return np.array([1 / prod(x - p for j, p in enumerate(points) if j != i) for i, x in enumerate(points)])


class Scheme(ABC):
    """One time-stepping scheme; its dataclass fields are its parameters, keys of a scene's [time] table.

    A scheme is registered as a class, with its name, its order in q and its number of stages. `stage` returns a stage,
    `finish` the state at the end of a step.
    """

    registry: ClassVar[Registry[Any]] = registered

    name: ClassVar[str]
    order: ClassVar[int]
    stages: ClassVar[int] = 1
    #: Whether a step of a free hub starts with the part of a jump of accelerations that it resolves (see `March`).
    filters_jumps: ClassVar[bool] = False

    #: (C, m, s) of the `local_error` of a vibration of frequency ω and amplitude A: C (ωh)^m A where it is resolved,
    #: (s ωh)² A where it is not. Largest ratio of two adaptive steps.
    estimate: ClassVar[tuple[float, int, float]] = (1 / 12, 3, 0.3)
    growth: ClassVar[float] = 5.0

    @abstractmethod
    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return stage i of a step.

        Args:
            i: number of the stage, from 0.
            state: where the step starts.
            h: its length, s.
            end: its last instant, state.t + h but for rounding.
            done: the stages before, solved.
        """

    @abstractmethod
    def finish(self, state: State, h: float, done: Sequence[Stage]) -> State:
        """Return the state at the end of a step, all its stages solved."""

    def solved(self, state: State, h: float, end: float, equations: Equations) -> list[Stage]:
        """Return the stages of a step, solved together; none where each depends on those before alone.

        Args:
            state: where the step starts.
            h: its length, s.
            end: its last instant.
            equations: that are solved.

        Raises:
            ComputationError: they cannot be solved.
        """
        return []

    def start(self, state: State) -> State:
        """Return a first state, or one after a jump, with the memory that a step from it needs."""
        return state

    def jumped(self, state: State, change: Array) -> State:
        """Return a state whose acceleration has jumped by a change, with the memory that a step from it needs."""
        return self.start(state)

    def local_error(self, new: State, old: State) -> Array | None:
        """Return the estimated error of q of the step from old to new; None if there is none."""
        return None

    def resized(self, new: State, old: State, h: float) -> State:
        """Return the state for steps of another length h (s) than that of the step from old to new."""
        return new

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        """Return name ↦ what is allowed, for every parameter whose value (a finite number) is not."""
        return {}


# --- of second order --------------------------------------------------------------------------------------------------


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

    def resized(self, new: State, old: State, h: float) -> State:
        """Return the state with the auxiliary acceleration moved to where the next step takes it.

        It stands for q̈ at t + h (α_m − α_f), so it changes with h; without this a change of step would cost an order.
        """
        last, (alpha_m, alpha_f, _, _) = new.t - old.t, self.coefficients
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
    """Conserves the energy to round-off, on a free hub to its order; nothing is damped, resolved or not."""

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


# --- of fourth order --------------------------------------------------------------------------------------------------

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


def _line(i: int) -> Array:
    """Return the weights of the two accelerations nearest to stage i + 2 in the one predicted on their line."""
    near, out = np.argsort(np.abs(C_ESDIRK[: i + 1] - C_ESDIRK[i + 1]))[:2], np.zeros(i + 1)
    for j in near:
        out[j] = prod((C_ESDIRK[i + 1] - C_ESDIRK[k]) / (C_ESDIRK[j] - C_ESDIRK[k]) for k in near if k != j)
    return out


LINES = [_line(i) for i in range(5)]


@dataclass(frozen=True)
class ESDIRK4(Scheme):
    """Fourth order in smooth motions; unresolved vibrations are damped within a few steps."""

    name: ClassVar[str] = "esdirk4"
    order: ClassVar[int] = 4
    stages: ClassVar[int] = 5
    estimate: ClassVar[tuple[float, int, float]] = (8.5e-4, 5, 0.1)

    def stage(self, i: int, state: State, h: float, end: float, done: Sequence[Stage]) -> Stage:
        """Return stage i + 2 of the method, predicted by the accelerations of the two nearest before."""
        t = end if i == self.stages - 1 else state.t + C_ESDIRK[i + 1] * h
        # v and a at the start and of all stages, which write theirs there
        rates = done[0].carried if done else np.array([(state.v, state.a)] * (self.stages + 1))
        from_v, from_a = (h * A_ESDIRK[i + 1, : i + 1]).dot(rates[: i + 1].reshape(i + 1, -1)).reshape(2, -1)
        v, a = rates[i + 1]
        a[:] = LINES[i].dot(rates[: i + 1, 1])
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
