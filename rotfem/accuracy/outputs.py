"""The outputs that answers are compared by: the displacement of the tip, the moment at the root, modes.

The tip is a section, whose points are displaced by u + θ × d, d their distance from its axis. With d a radius of
gyration r the output is (u, r θ): a rotation counts by what it displaces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rotfem.analysis.dense_output import write_state
from rotfem.analysis.schemes import Array, State
from rotfem.equations.system import System
from rotfem.scene import Scene

#: An output of a state of a system.
Output = Callable[[Any, State], Array]


def tip(system: System, state: State) -> Array:
    """Return the displacement of the tip in the frame that turns with the hub, and its rotation times a radius, m."""
    system.count_rotations_from(state.reference)
    return np.asarray(system.tip(state.q, state.t) * system.structure.lever)


def root_moment(system: System, state: State) -> Array:
    """Return the moment of the hub on the structure at its root, N·m."""
    system.count_rotations_from(state.reference)
    system.set_time(state.t)
    write_state(system, state)
    return np.array([value for name, value in system.root_reaction().items() if name.startswith("m")])


#: Outputs by their names in `accuracy_of`.
OUTPUTS: dict[str, Output] = {"tip": tip, "root_moment": root_moment}


def output_of(scene: Scene) -> str:
    """Return the name of the output whose error a run of a scene estimates."""
    return scene.accuracy_of if scene.accuracy_of in OUTPUTS else "tip"


def of_columns(name: str, history: Mapping[str, Array], structure: Any) -> Array:
    """Return an output (n, components) by its name, from the columns of a history."""
    if name == "tip":
        return np.asarray(np.column_stack([history[f"tip_{c}"] for c in structure.components]) * structure.lever)
    return np.column_stack([x for column, x in history.items() if column.startswith("root_m")])


def lines(system: System) -> list[Array]:
    """Return the coordinates (m) of all vertices of a mesh along each axis, each once and in order."""
    mesh, out = system.structure.mesh, list[Array]()
    for axis in range(mesh.topology.dim):
        x = np.unique(np.concatenate(system.comm.allgather(np.unique(mesh.geometry.x[:, axis]))))
        out.append(x[np.append(True, np.diff(x) > 1e-9 * np.ptp(x))])  # nearer ones are on one line
    return out
