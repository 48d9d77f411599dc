"""Outputs of answers, and the distance of two answers in them.

The tip is a section, whose points are displaced by u + θ × d, d their distance from its axis. With d a radius of
gyration r, the output is (u, r θ): a rotation counts by what it displaces, and where there is nothing else it is all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rotfem.analysis.dense_output import write_state
from rotfem.analysis.schemes import Array, State

#: An output of a state of a system.
Output = Callable[[Any, State], Array]


def tip(system: Any, state: State) -> Array:
    """Return the displacement of the tip in the frame that turns with the hub, and its rotation times a radius, m."""
    system.count_rotations_from(state.reference)
    return np.asarray(system.tip(state.q, state.t) * system.structure.lever)


def root_moment(system: Any, state: State) -> Array:
    """Return the moment of the hub on the structure at its root, N·m."""
    system.count_rotations_from(state.reference)
    system.set_time(state.t)
    write_state(system, state)
    return np.array([value for name, value in system.root_reaction().items() if name.startswith("m")])


#: Outputs by their names in `accuracy_of`.
OUTPUTS: dict[str, Output] = {"tip": tip, "root_moment": root_moment}


def of_columns(name: str, history: Mapping[str, Array], structure: Any) -> Array:
    """Return an output (n, components) by its name, from the columns of a history."""
    if name == "tip":
        return np.asarray(np.column_stack([history[f"tip_{c}"] for c in structure.components]) * structure.lever)
    return np.column_stack([x for column, x in history.items() if column.startswith("root_m")])


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
