"""Where Newton's method starts in a step, and whether the root it came to is the motion's."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Stage, State
from rotfem.errors import ComputationError

#: Part of the kinetic and strain energy by which a root that Newton strayed to may exceed the energy there was.
MORE_ENERGY = 0.03

#: Energy above that of the start, relative to what is exchanged, from which steps that add to it are made in parts.
GAIN = 0.003


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


def energy_gain(
    system: Any, new: State, state: State, known: tuple[float, ...] | None
) -> tuple[tuple[float, ...], bool]:
    """Return what is known of the energies, and whether a step raised an energy that is above what there can be.

    Nothing gives the motion energy. A scheme that does not resolve it may, a little in each step, which Newton's method
    does not notice until the motion is lost; shorter steps give less, and take some back.

    Args:
        system: nonlinear, and closed.
        new: end of the step.
        state: its start.
        known: Jacobi integral at the start, least and largest kinetic and strain energy since (J); None at first.
    """

    def energies(at: State) -> dict[str, float]:
        system.set_time(at.t)
        system.set_state(at.q, at.v, at.a)
        return dict(system.energies())

    first = None if known is not None else energies(state)
    if first is not None:
        known = (first["jacobi"], *2 * (first["kinetic"],), *2 * (first["strain"],))
    assert known is not None
    now = energies(new)
    reference, low_t, high_t, low_w, high_w = known
    low_t, high_t = min(low_t, now["kinetic"]), max(high_t, now["kinetic"])
    low_w, high_w = min(low_w, now["strain"]), max(high_w, now["strain"])
    too_much = now["jacobi"] - reference > GAIN * max(high_t - low_t, high_w - low_w)
    gains = too_much and now["jacobi"] > (first or energies(state))["jacobi"]
    return (reference, low_t, high_t, low_w, high_w), gains


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
