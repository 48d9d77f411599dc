"""Time-stepping schemes: stages, update maps, memory, order and error estimate.

The equations of motion F(q, v, a, t) = 0 hold at every stage. A stage has a time t, a prediction of q, v and a there,
and ∂v/∂q and ∂a/∂q, by which a correction of q changes v and a. The scheme makes the state at the end of a step of its
stages. So F does not depend on the scheme, and the solution of a stage not on its coefficients.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import prod
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from rotfem.registry import Registry
from rotfem.registry import schemes as registered

Array = npt.NDArray[np.float64]

#: (∂q/∂q, ∂v/∂q, ∂a/∂q) of a stage: the factors of K, C and M in its tangent.
Shifts = tuple[float, float, float]


#: A time (s), and q, v, a at it.
Instant = tuple[float, Array, Array, Array]


@dataclass
class State:
    """The motion at one instant.

    Attributes:
        t: time, s.
        q, v, a: the unknowns (m, rad), q̇ and q̈; local dof arrays, of a free hub with its angle as last entry.
        memory: what the scheme keeps of the steps before.
        given: work (J) and angular impulse (N·m·s) that a free hub and its structure were given since t = 0, and the
            moment (N·m) of the forces from outside now; None where the hub is not free.
        reference: what the rotations in q are counted from; None for the undeformed structure.
        balanced: whether the equations hold with q, v and a; otherwise a is that of another instant.
        inner: instants (s) within the step that led here at which the equations hold, too, and q, v, a there.
        jump: what of a came at once, at the start or by a jump of what drives the system; None of a step's end.
    """

    t: float
    q: Array
    v: Array
    a: Array
    memory: Any = None
    given: Array | None = None
    reference: Any = None
    balanced: bool = True
    inner: tuple[Instant, ...] = ()
    jump: Array | None = None

    @classmethod
    def at_rest(cls, system: Any, q: Array, v: Array | None = None) -> State:
        """Return the state at t = 0 of a shape that rests in the frame, counted as a system counts its rotations.

        Args:
            system: whose forms see it.
            q: unknowns.
            v: their rates, where the frame does not turn with the structure.
        """
        return cls(0.0, q, np.zeros_like(q) if v is None else v, np.zeros_like(q), reference=system.reference)

    def changed(self, **changes: Any) -> State:
        """Return a copy with other values."""
        return replace(self, **changes)

    def after(self, before: State) -> State:
        """Return the state as the end of one step with the part that led to another state, `before`.

        What is between is known as well as in other steps, by an instant in the middle of each part.
        """
        if not self.inner:
            return self
        parts = [part.inner[len(part.inner) // 2] for part in (before, self) if part.inner]
        middle = (before.t, before.q, before.v, before.a)
        return self.changed(inner=tuple(sorted([*parts, middle], key=lambda instant: instant[0])))


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

    def begin_at(self, values: tuple[Array, Array, Array]) -> None:
        """Write copies of q, v and a."""
        self.q[:], self.v[:], self.a[:] = values

    def correct(self, dq: Array) -> None:
        """Add a correction of q, and what follows from it to v and a."""
        self.q += dq
        self.v += self.c_v * dq
        self.a += self.c_a * dq


def inner(stages: Sequence[Stage]) -> tuple[Instant, ...]:
    """Return the instants of stages before the last one, in their order in time."""
    return tuple(sorted(((s.t, s.q, s.v, s.a) for s in stages[:-1]), key=lambda instant: instant[0]))


class Equations(Protocol):
    """What a scheme may ask of the equations of motion to solve its stages."""

    system: Any
    newton: Any

    def predicted(self, stage: Stage, state: State) -> Array:
        """Return the predicted q of a stage; where the clamp moves the last shape, turned with it."""

    def solve(self, stage: Stage, state: State) -> None:
        """Solve one stage of a step from a state.

        Raises:
            ComputationError: it cannot be solved.
        """

    def imbalance(self, stage: Stage) -> Array:
        """Return −F at a stage, zero at clamped unknowns; the owned part, of a free hub with that of its angle last."""

    def linearised(self, stage: Stage | None) -> Any:
        """Return M, C and K at a stage; of None the present ones, or None if they may not be reused."""


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
    #: Whether a step of a free hub starts with the part of a jump of accelerations that it resolves (see `Stepper`).
    filters_jumps: ClassVar[bool] = False

    #: (C, m, s) of the `local_error` of a vibration of frequency ω and amplitude A: C (ωh)^m A where it is resolved,
    #: (s ωh)² A where it is not. Largest ratio of two adaptive steps.
    estimate: ClassVar[tuple[float, int, float]] = (1 / 12, 3, 0.3)
    growth: ClassVar[float] = 2.0

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
        """Return the stages of a step, solved: one after the other, each of which may depend on those before.

        Args:
            state: where the step starts.
            h: its length, s.
            end: its last instant.
            equations: that are solved.

        Raises:
            ComputationError: a stage cannot be solved.
        """
        done: list[Stage] = []
        for i in range(self.stages):
            stage = self.stage(i, state, h, end, done)
            if (q := equations.predicted(stage, state)) is not stage.q:
                stage.correct(q - stage.q)
            equations.solve(stage, state)
            done.append(stage)
        return done

    def start(self, state: State) -> State:
        """Return a first state, or one after a jump, with the memory that a step from it needs."""
        return state

    def jumped(self, state: State, change: Array) -> State:
        """Return a state whose acceleration has jumped by a change, with the memory that a step from it needs."""
        return self.start(state)

    def kinked(self, state: State) -> State:
        """Return a state at which a signal has a kink: its rate jumps, the acceleration does not."""
        return state

    def local_error(self, new: State, old: State) -> Array | None:
        """Return the estimated error of q of the step from old to new; None if there is none."""
        return None

    def fallbacks(self) -> tuple[Scheme, ...]:
        """Return more robust schemes for steps that this one cannot take, in the order they are tried."""
        return ()

    def resized(self, new: State, old: State, h: float) -> State:
        """Return the state for steps of another length h (s) than that of the step from old to new."""
        return new

    @classmethod
    def check(cls, parameters: dict[str, Any]) -> dict[str, str]:
        """Return name ↦ what is allowed, for every parameter whose value (a finite number) is not."""
        return {}


class Observer(Protocol):
    """An observer of the steps of a march."""

    def __call__(self, old: State, new: State, leg: Any) -> None:
        """Observe a step from an old to a new state, over a leg of the time grid (see `time_grid.Leg`)."""
