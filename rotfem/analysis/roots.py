"""Where Newton's method starts in a step, and whether the root it came to is the motion's."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Stage, State
from rotfem.errors import ComputationError

#: Part of the kinetic and strain energy by which a root that Newton strayed to may exceed the energy there was.
MORE_ENERGY = 0.03


def check_root(system: Any, stage: Stage, state: State) -> None:
    """Refuse a root of a stage that is not the motion's.

    Args:
        system: one that is solved by Newton's method, at the time of the stage.
        stage: solved.
        state: where the step started.

    Raises:
        ComputationError: it is turned inside out, or has energy that nothing has given it.
    """
    system.set_state(stage.q, stage.v, stage.a)
    if not system.linear and system.model.inside_out():
        raise ComputationError("Newton met a state turned inside out (an axial strain below −1)", time=stage.t)
    if not system.model.closed or stage.over is not None:
        return
    new = system.energies()
    system.set_state(state.q, state.v, state.a)
    old = system.energies()
    grown, there = new["jacobi"] - old["jacobi"], max(e["kinetic"] + e["strain"] for e in (old, new))
    if grown > MORE_ENERGY * there:
        what = f"Newton met a state with {grown:.2g} J more than there were, of {there:.2g} J"
        raise ComputationError(what, time=stage.t)


def turned_with_clamp(clamp: Any, state: State, stage: Stage) -> Array:
    """Return q of a stage predicted by a turn with the clamp and the velocity relative to it."""
    if stage.over is None:
        return np.asarray(clamp.turned(state.q, state.v, state.t, stage.t))
    return np.asarray((state.q + clamp.turned(state.q, state.v, state.t, stage.over.end)) / 2)


def came_true(system: Any, move: Array, predicted: Array) -> float:
    """Return the share of a predicted move that makes it closest to the one that came, between 0 and 1.

    Where the motion is smooth it is 1. Where vibrations are faster than the steps resolve a prediction of constant
    acceleration is worse than none: they are elsewhere after every step, and h²q̈ is much larger than they are.
    """
    length = system.product(predicted, predicted)
    return float(np.clip(system.product(move, predicted) / length, 0.0, 1.0)) if length > 0.0 else 1.0
