"""Rotations without a limit: where they have become large they are counted from the shape reached."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, State


def keep_rotations_small(system: Any, scheme: Scheme, state: State, h: float) -> bool:
    """Count rotations afresh if a step of h (s) might lead out of their range; return whether that was done.

    The motion that the state describes does not change, but the numbers for it do, in the state itself, so that whoever
    holds it can go on with it. A memory of the scheme that is a second rate, as an auxiliary acceleration is, changes
    as one; of any other the scheme makes a new one.
    """
    turns = system.structure.turns
    if turns is None:
        return False
    system.count_rotations_from(state.reference)
    if not turns.is_due(state.q, state.v, h):
        return False
    is_rate = isinstance(state.memory, np.ndarray) and state.memory.shape == state.a.shape
    q, v, a = state.q.copy(), state.v.copy(), state.a.copy()
    second = [a, state.memory.copy()] if is_rate else [a]
    reference = turns.reset(q, v, second)
    system.count_rotations_from(reference)
    state.q, state.v, state.a, state.reference = q, v, a, reference
    state.memory = second[-1] if is_rate else scheme.start(state.changed(memory=None)).memory
    return True


def recounted(system: Any, q: Array, change: Array | None = None) -> tuple[Array, Array]:
    """Return a shape q (local dof array) and a small change of it with rotations that are counted from q itself."""
    q, rate = q.copy(), np.zeros_like(q) if change is None else change.copy()
    system.count_rotations_from(system.structure.turns.reset(q, rate, [np.zeros_like(q)]))
    return q, rate


def reached(system: Any, q: Array) -> float:
    """Return the part of their range that the rotations of q (local dof array) take; 0 where they have no limit."""
    turns = system.structure.turns
    return 0.0 if turns is None else float(turns.reached(q))
