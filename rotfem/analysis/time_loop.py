"""The march: fixed or adaptive steps through a time history. Every jump is met, and there it goes on afresh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotfem.analysis.itinerary import Itinerary, Leg
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import Stepper, seen
from rotfem.errors import ComputationError
from rotfem.mechanics.courses import View
from rotfem.numerics.newton import Newton

#: A linear theory has lost its meaning when a displacement exceeds the structure's own length, or a rotation 1 rad.
LARGEST_LINEAR_DEFLECTION = 1.0

#: Adaptive steps: safety factor, bounds of a change, changes not worth a new factorisation, smallest relative scale.
SAFETY, SHRINK, GROW, KEEP, FLOOR = 0.9, 0.2, 2.0, (0.95, 1.3), 1e-6


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


class March:
    """A time history, state after state.

    Args:
        system: equations of motion.
        scheme: time-stepping scheme.
        steps: end and length of the steps.
        newton: iteration control of the steps.
        q: shape at t = 0, at rest in the turning frame, local dof array of the structure; undeformed if None.

    Attributes:
        stepper: what advances the system, with its counts.
        reached: state that an earlier march has yielded, to go on from; its stepper's numbers must be this one's.
    """

    def __init__(self, system: Any, scheme: Scheme, steps: Steps, newton: Newton, q: Array | None = None):
        self.system, self.steps = system, steps
        self.stepper = Stepper(system, scheme, newton)
        self.reached: State | None = None
        self._q = np.zeros_like(system.q.x.array) if q is None else q

    def __iter__(self) -> Iterator[State]:
        """Yield the state at t = 0, unless it goes on from a later one, and at the end of every step.

        Raises:
            ComputationError: a step failed, however short.
        """
        state = self.reached
        if state is None:
            state = self.stepper.start(0.0, *self.system.start(self._q))
            yield state
        steps = fixed_steps if self.steps.step is not None else adaptive_steps
        yield from steps(self.stepper, state, self.steps)


def fixed_steps(stepper: Stepper, state: State, steps: Steps) -> Iterator[State]:
    """Yield the states at step, 2 step, … and end (s); the last distance may be shorter.

    Raises:
        ComputationError: a step failed, however short.
    """
    assert steps.step is not None
    ahead, reached = Itinerary(stepper.system.courses, *grid(steps)), state.t
    legs = ((number, leg) for number, leg in ahead if leg.end > reached)
    wanted = None if steps.parts is None else set(np.cumsum(steps.parts).tolist())
    after: Leg | None
    number, after = next(legs, (0, None))
    if after is not None and after.averaged and reached == 0.0:
        state = stepper.restart(state, View(1), View(window=(0.0, after.length)))
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


def travel(stepper: Stepper, state: State, leg: Leg, after: Leg | None) -> State:
    """Return the state at the end of a leg, as the one after it starts from it.

    Raises:
        ComputationError: the step failed, however short.
    """
    old: State | None = None
    if leg.drifts:
        state = stepper.drift(state, leg.length, leg.end)
        if leg.averaged:
            state = stepper.struck(state, leg.length)
    else:
        joined = after is not None and leg.joins(after)
        window = (leg.length, after.length if after is not None and joined else 0.0) if leg.averaged else None
        with seen(stepper.system, View(-1 if leg.lands else 0, window)):
            old, state = state, stepper.advance(state, leg.length, leg.end)
    if after is None:
        return state
    if old is not None and not after.drifts and after.length != leg.length:
        state = stepper.scheme.resized(state, old, after.length)
    if leg.lands or ((leg.averaged or after.averaged) and not leg.joins(after)):
        before = View(-1 if leg.lands else 0, (leg.length, 0.0) if leg.averaged else None)
        ahead = View(1 if leg.lands else 0, (0.0, after.length) if after.averaged else None)
        state = stepper.restart(state, before, ahead)
    return state


def adaptive_steps(stepper: Stepper, state: State, steps: Steps) -> Iterator[State]:
    """Yield states whose local errors add up to the tolerance, relative to the largest displacement so far.

    Raises:
        ComputationError: a step failed, or would have to be shorter than allowed.
    """
    assert steps.tolerance is not None
    longest = steps.max_step or steps.end / 20
    shortest = steps.min_step or 1e-9 * steps.end
    h, largest = stepper.pace or (min(longest, 1e-4 * steps.end), FLOOR)
    close = 1e-12 * steps.end
    jumps = sorted({float(t) for c in stepper.system.courses for t in c.knots if 0.0 < t <= steps.end + close})
    while state.t < steps.end - close:
        stop = min((j for j in jumps if j > state.t), default=steps.end)
        left = stop - state.t
        wanted = min(h, longest)
        h = left if wanted >= left * (1 - 1e-9) else (left / 2 if wanted > 0.6 * left else wanted)
        with seen(stepper.system, View(-1)):
            new = stepper.advance(state, h, stop if h == left else None)
        largest = max(largest, stepper.system.size(new.q))
        allowed = steps.tolerance * largest * h / steps.end  # so that the errors of all steps add up to the tolerance
        error = stepper.local_error(new, state) / allowed
        factor = float(np.clip(SAFETY * max(error, 1e-12) ** (-1 / stepper.scheme.order), SHRINK, GROW))
        if error > 1.0:
            stepper.rejected += 1
            h *= min(factor, 0.9)
            if h < shortest:
                raise ComputationError(
                    f"the step fell below {shortest:.3g} s without meeting the tolerance",
                    time=state.t,
                    advice="a looser time.tolerance, a smaller time.min_step, or some damping",
                )
            continue
        if new.t in jumps:
            new = stepper.restart(new, View(-1), View(1))
            h = min(h, 1e-4 * steps.end)
        elif not KEEP[0] <= factor <= KEEP[1]:
            new = stepper.scheme.resized(new, state, h * factor)
            h *= factor
        state, stepper.pace = new, (h, largest)
        yield state
