"""Fixed steps through a time history: every jump of a torque is met, and the history goes on from there afresh."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from rotfem.hub import HubStepper
from rotfem.integrators import State, Stepper

#: A linear theory has lost its meaning when a displacement exceeds the structure's own length, or a rotation 1 rad.
LARGEST_LINEAR_DEFLECTION = 1.0


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
    hub = stepper.hub if isinstance(stepper, HubStepper) else None
    jumps = [] if hub is None else [t for t in hub.torque.jumps if 0.0 < t < end]
    close = 1e-9 * step
    for i in range(1, n + 1):
        t = end if i == n else i * step
        m = 1 if parts is None else int(parts[i - 1])
        begin, length = (i - 1) * step, step / m
        between = [begin + (t - begin) * j / m for j in range(1, m)]
        for stop in sorted([*(j for j in jumps if state.t + close < j < t - close), *between, t]):
            h = stop - state.t
            if h <= close:
                continue  # a jump within rounding of a stop
            if hub is None and abs(h - length) <= close:
                h = length  # of one length to the last digit, so that the matrix stays; a hub must not pass a jump
            state = stepper.advance(state, h)
            state.t = stop
            if isinstance(stepper, HubStepper) and any(abs(stop - j) <= close for j in jumps):
                state = stepper.restart(state)
        yield state
