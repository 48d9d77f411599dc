"""Outputs of answers, and the distance of two answers in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rotfem.analysis.dense_output import write_state
from rotfem.analysis.schemes import Array, State

#: An output of a state of a system.
Output = Callable[[Any, State], Array]


def tip(system: Any, state: State) -> Array:
    """Return the displacement of the tip in the frame that turns with the hub, m."""
    system.count_rotations_from(state.reference)
    return np.asarray(system.tip(state.q, state.t)[system.structure.moves])


def root_moment(system: Any, state: State) -> Array:
    """Return the moment of the hub on the structure at its root, N·m."""
    system.count_rotations_from(state.reference)
    system.set_time(state.t)
    write_state(system, state)
    return np.array([value for name, value in system.root_reaction().items() if name.startswith("m")])


#: Outputs by their names in `accuracy_of`, and the prefix of their columns of a history.
OUTPUTS: dict[str, Output] = {"tip": tip, "root_moment": root_moment}
COLUMNS = {"tip": "tip_u", "root_moment": "root_m"}


def distance(one: Array, other: Array) -> float:
    """Return the largest distance of two histories of an output (n, components), relative to the largest of the first.

    Infinite where the first is zero and the other is not.
    """
    size, off = largest(one), largest(other - one)
    if size > 0.0:
        return off / size
    return 0.0 if off == 0.0 else np.inf


def distance_each(one: Array, other: Array) -> float:
    """Return the largest distance of two lists of eigenvalues, complex or (n, components), each relative to `sizes`.

    Of lists of different length the first ones are compared.
    """
    pairs = zip(one, other, sizes(one), strict=False)
    return max((float(np.linalg.norm(b - a) / size) for a, b, size in pairs), default=0.0)


def sizes(values: Array) -> Array:
    """Return the absolute values (n,) of eigenvalues, complex or (n, components); for a zero the least other one."""
    out = np.array([np.linalg.norm(a) for a in values])
    out[out == 0.0] = min(out[out > 0.0], default=1e-300)
    return out


def largest(values: Array) -> float:
    """Return the largest Euclidean norm of an output over a history (n, components)."""
    return float(np.linalg.norm(values, axis=-1).max(initial=0.0))
