"""Fixed steps, taken in legs where breakpoints of what is prescribed lie in them.

At a kink of what is prescribed the memory of a scheme goes on along another line than it came.
Generalised-α keeps an acceleration that stands for an instant θ h before the start of the next step, θ = α_f − α_m.
Where the accelerations jump there, it jumps with them; where their rate jumps by Δȧ, it is off by θ h Δȧ, and
velocities are off by θ² h² Δȧ/2 from then on. Over steps of one length that adds up to an error of the order of the
scheme. Where a step is gone in legs, short ones beside long ones, it does not: a blow of two short legs has up to eight
times its impulse with ρ∞ = 0. So the memory is put on the line that the accelerations take after the kink.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import STEADY, Stepper, seen
from rotfem.analysis.time_grid import Leg, TimeGrid
from rotfem.mechanics.courses import View

#: Lag of a memory, in steps, up to which kinks between plain steps are left to the order of the scheme.
PLAIN = 0.06


@dataclass(frozen=True)
class Steps:
    """When a history ends, and how it is stepped: by a fixed step or to a tolerance.

    Attributes:
        end: last time, s.
        step: fixed step, s; None for adaptive ones.
        tolerance: error of all adaptive steps together, relative to the largest displacement; None for fixed ones.
        max_step, min_step: bounds of an adaptive step, s; None for those of the program.
        parts: in how many equal steps each fixed step is gone; in one, if None.
    """

    end: float
    step: float | None = None
    tolerance: float | None = None
    max_step: float | None = None
    min_step: float | None = None
    parts: Sequence[int] | None = None

    @classmethod
    def of(cls, time: Any) -> Steps:
        """Return the steps of anything with these attributes but the parts, as a scene's [time] table."""
        return cls(time.end, time.step, time.tolerance, time.max_step, time.min_step)


def fixed_steps(stepper: Stepper, state: State, steps: Steps) -> Iterator[State]:
    """Yield the states at step, 2 step, … and end (s); the last distance may be shorter.

    Raises:
        ComputationError: a step failed, however short.
    """
    assert steps.step is not None
    ahead, reached = TimeGrid(stepper.system.courses, *grid(steps), stepper.scheme.order), state.t
    legs = ((number, leg) for number, leg in ahead if leg.end > reached)
    wanted = None if steps.parts is None else set(np.cumsum(steps.parts).tolist())
    after: Leg | None
    number, after = next(legs, (0, None))
    if after is not None and reached == 0.0:
        state = started(stepper, state, after)
    while after is not None:
        now, leg = number, after
        number, after = next(legs, (0, None))
        state = travel(stepper, state, leg, after)
        if leg.whole and (wanted is None or now in wanted):
            yield state


def grid(steps: Steps) -> tuple[Array, float]:
    """Return the ends of fixed steps, the first at 0, and their length (s)."""
    assert steps.step is not None
    n = int(np.ceil(steps.end / steps.step - 1e-9))
    times = np.append(np.arange(n) * steps.step, steps.end)
    if steps.parts is None:
        return times, steps.step
    cut = [np.linspace(a, b, m, endpoint=False) for a, b, m in zip(times, times[1:], steps.parts, strict=False)]
    return np.append(np.concatenate(cut), steps.end), steps.step


def started(stepper: Stepper, state: State, first: Leg) -> State:
    """Return the state at t = 0 as the first leg starts from it."""
    return stepper.restart(state, View(1), View(window=(0.0, first.length))) if first.averaged else state


def travel(stepper: Stepper, state: State, leg: Leg, after: Leg | None) -> State:
    """Return the state at the end of a leg, as the one after it starts from it.

    Raises:
        ComputationError: the step failed, however short.
    """
    old, before = None, state
    if leg.drifts:
        state = stepper.drift(state, leg.length, leg.end)
        if leg.averaged:
            state = stepper.struck(state, leg.length)
    else:
        joined = after is not None and leg.joins(after)
        window = (leg.length, after.length if after is not None and joined else 0.0) if leg.averaged else None
        with seen(stepper.system, View(-1 if leg.lands else 0, window)):
            old, state = state, stepper.advance(state, leg.length, leg.end)
    if stepper.watch is not None:
        stepper.watch(before, state, leg)
    if after is None:
        return state
    if old is not None and not after.drifts and after.length != leg.length:
        state = stepper.scheme.resized(state, old, after.length)
    if leg.lands or ((leg.averaged or after.averaged) and not leg.joins(after)):
        finish = View(-1 if leg.lands else 0, (leg.length, 0.0) if leg.averaged else None)
        ahead = View(1 if leg.lands else 0, (0.0, after.length) if after.averaged else None)
        state = stepper.restart(state, finish, ahead)
    if old is not None and not (after.drifts or leg.averaged or after.averaged) and bends(stepper.scheme, leg, after):
        state = bent(stepper, state, leg.length, after.length)
    return state


def bends(scheme: Scheme, leg: Leg, after: Leg) -> bool:
    """Return whether a kink between two legs matters to the memory of a scheme, or the second one starts without it."""
    if leg.plain and after.plain and scheme.lag <= PLAIN:
        return False
    return scheme.lag > 0.0 and (leg.lands or scheme.forgets(leg.length, after.length))


def bent(stepper: Stepper, state: State, last: float, h: float) -> State:
    """Return a state whose memory is on the line that what drives the system takes from here.

    Args:
        stepper: what takes the steps.
        state: at the end of a step, with the accelerations and the memory that the next one starts from.
        last: length of that step, s.
        h: length of the next one, s.
    """
    s, t, scheme = stepper.system, state.t, stepper.scheme
    if s.clamp is not None:  # its motion is exact, and what it drives follows by waves
        return state
    weights = {(t + h, -1): 1.0, (t, 1): -1.0}
    if not scheme.forgets(last, h):
        weights |= {(t, -1): -h / last, (t - last, 1): h / last}

    def parts(values: Callable[[float], Array]) -> list[Array]:
        out = []
        for (at, side), weight in weights.items():
            with seen(s, View(side)):
                out.append(weight * values(at))
        return out

    def forces(at: float) -> Array:
        s.set_time(at)
        s.set_state(state.q, state.v, state.a)
        return np.asarray(s.forces(at))

    driven = np.array(parts(s.driven))
    if np.max(np.abs(driven.sum(axis=0)), initial=0.0) <= STEADY * np.max(np.abs(driven), initial=0.0):
        return state
    s.count_rotations_from(state.datum)
    change = np.sum(parts(forces), axis=0)
    s.set_time(t)
    s.set_state(state.q, state.v, state.a)
    return scheme.bent(state, s.accelerated(change))
