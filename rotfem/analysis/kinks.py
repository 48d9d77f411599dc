"""Kinks of what is prescribed, where the memory of a scheme goes on along another line than it came.

Generalised-α keeps an acceleration that stands for an instant θ h before the start of the next step, θ = α_f − α_m.
Where the accelerations jump there, it jumps with them; where their rate jumps by Δȧ, it is off by θ h Δȧ, and
velocities are off by θ² h² Δȧ/2 from then on. Over steps of one length that adds up to an error of the order of the
scheme. Where a step is gone in legs, short ones beside long ones, it does not: a blow of two short legs has up to eight
times its impulse with ρ∞ = 0. So the memory is put on the line that the accelerations take after the kink.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rotfem.analysis.itinerary import Leg
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import STEADY, Stepper, seen
from rotfem.mechanics.courses import View

#: Lag of a memory, in steps, up to which kinks between plain steps are left to the order of the scheme.
PLAIN = 0.06


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
