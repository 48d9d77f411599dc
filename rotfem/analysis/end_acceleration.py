"""The acceleration that the equations of motion give at a state: a scheme may end its steps in that of another instant.

M δa = −F(q, v, a) is solved with the factor of M at rest, where that leads on quickly: M of a structure changes little
with its deflection.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, State

#: Corrections with the factor at rest, how fast they must shrink, and what may be left, relative to the acceleration.
MOST, RATE, LEFT = 8, 0.1, 1e-13


def end_acceleration(system: Any, state: State) -> Array:
    """Return q̈ of F(q, q̇, q̈) = 0 at a state, a local dof array; the time is set, the state is written on return."""
    a = state.a.copy()
    before, at_rest, left = np.inf, True, MOST
    while True:
        system.set_state(state.q, state.v, a)
        change = system.accelerated(system.forces(state.t), at_rest)
        a += change
        size, left = system.increment_size(change), left - 1
        if not at_rest or (before < np.inf and size * size <= LEFT * before * system.increment_size(a)):
            break
        at_rest = left > 0 and size <= RATE * before
        before = size
    system.set_state(state.q, state.v, a)
    return a
