"""Fixed and adaptive steps through a time history: every jump of a torque is met, and there it goes on afresh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rotfem.analysis.hub_stepper import HubStepper
from rotfem.analysis.stepper import State, Stepper
from rotfem.errors import ComputationError
from rotfem.scene import Time

#: A linear theory has lost its meaning when a displacement exceeds the structure's own length, or a rotation 1 rad.
LARGEST_LINEAR_DEFLECTION = 1.0

#: Adaptive steps: safety factor, bounds of a change, changes not worth a new factorisation, smallest relative scale.
SAFETY, SHRINK, GROW, KEEP, FLOOR = 0.9, 0.2, 2.0, (0.95, 1.3), 1e-6


def fixed_steps(
    stepper: Stepper, state: State, end: float, step: float, parts: Sequence[int] | None = None
) -> Iterator[State]:
    """Yield the states at step, 2 step, … and end (s).

    Args:
        stepper: what advances the state.
        state: where to start.
        end: last time, s.
        step: distance of the states, s; the last one may be closer.
        parts: in how many equal steps each of these distances is gone; in one, if not given.

    Raises:
        ComputationError: a step failed, however short.
    """
    n = int(np.ceil(end / step - 1e-9))
    close = 1e-9 * step
    jumps = jumps_of(stepper, end + close)
    for i in range(1, n + 1):
        t = end if i == n else i * step
        m = 1 if parts is None else int(parts[i - 1])
        begin, length = (i - 1) * step, step / m
        between = [begin + (t - begin) * j / m for j in range(1, m)]
        for stop in stops([*between, t], [j for j in jumps if state.t + close < j < t + close], close):
            h = stop - state.t
            if abs(h - length) <= close:
                h = length  # of one length to the last digit, so that the matrix stays
            state = stepper.advance(state, h, stop)
            if isinstance(stepper, HubStepper) and stop in jumps:
                state = stepper.restart(state)
        yield state


def stops(times: Sequence[float], jumps: Sequence[float], close: float) -> list[float]:
    """Return times and jumps (s) in order; a time closer to a jump than `close` is that jump, exactly."""
    snapped = (min((j for j in jumps if abs(j - t) <= close), key=lambda j: abs(j - t), default=t) for t in times)
    return sorted({*snapped, *jumps})


def adaptive_steps(stepper: Stepper, state: State, time: Time) -> Iterator[State]:
    """Yield states whose local errors add up to the tolerance, relative to the largest displacement so far.

    Args:
        stepper: what advances the state; it counts the steps that are taken back.
        state: where to start.
        time: end, tolerance and bounds of the step.

    Raises:
        ComputationError: a step failed, or would have to be shorter than allowed.
    """
    assert time.tolerance is not None
    longest = time.max_step or time.end / 20
    shortest = time.min_step or 1e-9 * time.end
    h, largest = min(longest, 1e-4 * time.end), FLOOR
    close = 1e-12 * time.end
    jumps = jumps_of(stepper, time.end + close)
    while state.t < time.end - close:
        stop = min((j for j in jumps if j > state.t), default=time.end)
        left = stop - state.t
        wanted = min(h, longest)
        h = left if wanted >= left * (1 - 1e-9) else (left / 2 if wanted > 0.6 * left else wanted)
        new = stepper.advance(state, h, stop if h == left else None)
        largest = max(largest, stepper.system.size(new.q))
        allowed = time.tolerance * largest * h / time.end  # so that the errors of all steps add up to the tolerance
        error = stepper.local_error(new, state) / allowed
        factor = float(np.clip(SAFETY * max(error, 1e-12) ** (-1 / 2), SHRINK, GROW))
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
        if isinstance(stepper, HubStepper) and new.t in jumps:
            new = stepper.restart(new)
            h = min(h, 1e-4 * time.end)
        elif not KEEP[0] <= factor <= KEEP[1]:
            stepper.resize(new, state, h * factor)
            h *= factor
        state = new
        yield state


def jumps_of(stepper: Stepper, end: float) -> list[float]:
    """Return the times (s) up to the end at which the torque on a free hub jumps."""
    return [t for t in stepper.hub.torque.jumps if 0.0 < t <= end] if isinstance(stepper, HubStepper) else []
