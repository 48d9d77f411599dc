"""The march: fixed or adaptive steps through a time history, over nothing that is prescribed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from rotfem.analysis.adaptive import AdaptiveSteps
from rotfem.analysis.fixed_steps import Steps, fixed_steps
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import Stepper
from rotfem.numerics.newton import Newton

__all__ = ["LARGEST_LINEAR_DEFLECTION", "March", "Steps"]

#: A linear theory has lost its meaning when a displacement exceeds the structure's own length, or a rotation 1 rad.
LARGEST_LINEAR_DEFLECTION = 1.0


class March:
    """A time history, state after state.

    Args:
        system: equations of motion.
        scheme: time-stepping scheme.
        steps: end and length of the steps.
        newton: iteration control of the steps.
        q: shape at t = 0 in the turning frame, local dof array of the structure; undeformed if None.
        v: velocities there, relative to the turning frame; it is at rest if None.

    Attributes:
        stepper: what advances the system, with its counts.
        reached: state that an earlier march has yielded, to go on from; its stepper's numbers must be this one's.
    """

    def __init__(
        self, system: Any, scheme: Scheme, steps: Steps, newton: Newton, q: Array | None = None, v: Array | None = None
    ):
        self.system, self.steps = system, steps
        self.stepper = Stepper(system, scheme, newton)
        self.reached: State | None = None
        self._q = np.zeros_like(system.q.x.array) if q is None else q
        self._v = v

    def __iter__(self) -> Iterator[State]:
        """Yield the state at t = 0, unless it goes on from a later one, and at the end of every step.

        Raises:
            ComputationError: a step failed, however short.
        """
        state = self.reached
        if state is None:
            q, v = self.system.start(self._q)
            if self._v is not None:
                v[: len(self._v)] += self._v
            state = self.stepper.start(0.0, q, v)
            yield state
        steps = fixed_steps if self.steps.step is not None else AdaptiveSteps
        yield from steps(self.stepper, state, self.steps)
