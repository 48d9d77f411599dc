"""The outputs that answers are compared by: the displacement of the tip, the moment at the root, modes.

The tip is a section, whose points are displaced by u + θ × d, d their distance from its axis. With d a radius of
gyration r the output is (u, r θ): a rotation counts by what it displaces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from dolfinx import fem, mesh

from rotfem.analysis.dense_output import write_state
from rotfem.analysis.schemes import Array, State
from rotfem.equations.system import System
from rotfem.numerics import forms
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


#: Turn between two edges of an outline (rad) above which it has a corner there.
CORNER = 1.0


def lines(system: System) -> list[Array]:
    """Return the coordinates (m) of all vertices of a mesh along each axis, each once and in order."""
    domain, out = system.structure.mesh, list[Array]()
    for axis in range(domain.topology.dim):
        x = np.unique(np.concatenate(system.comm.allgather(np.unique(domain.geometry.x[:, axis]))))
        out.append(x[np.append(True, np.diff(x) > 1e-9 * np.ptp(x))])  # nearer ones are on one line
    return out


def chords(system: System) -> float:
    """Return by how much straight edges along curved outlines of a plate may change frequencies, relative.

    An edge of length h between two that it turns from by θ, less than a corner, is a chord: hθ/12 off the curve in the
    mean. Frequencies are as 1/w² of the width w = 2A/P of an area A and its perimeter P, whose sides move.
    """
    plate: Any = system.structure
    domain = plate.mesh
    if plate.type != "plate" or domain.geometry.cmap.degree > 1:
        return 0.0
    from scipy.sparse import coo_array  # only meshes of plates need it, and it is slow to load
    from scipy.sparse.csgraph import connected_components

    domain.topology.create_connectivity(1, 2)
    domain.topology.create_connectivity(1, 0)
    facets = mesh.exterior_facet_indices(domain.topology)
    nodes = mesh.entities_to_geometry(domain, 1, facets) if len(facets) else np.empty((0, 2), dtype=np.int32)
    x = np.concatenate(domain.comm.allgather(domain.geometry.x[nodes, :2].reshape(-1, 2)))
    points, edges = np.unique(np.round(x / (1e-9 * plate.length)), axis=0, return_inverse=True)
    edges, x = edges.reshape(-1, 2), x.reshape(-1, 2, 2)
    along, h = x[:, 1] - x[:, 0], np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    if np.any(np.bincount(edges.ravel()) != 2):  # outlines that touch
        return 0.0
    turn = np.zeros(len(points))
    ends = np.argsort(edges.ravel(), kind="stable").reshape(-1, 2)  # of an outline two edges meet at each point
    (i, a), (j, b) = (np.divmod(end, 2) for end in ends.T)
    same = np.where(a == b, -1.0, 1.0)
    cosine = same * np.sum(along[i] * along[j], axis=1) / (h[i] * h[j])
    turn[edges[i, a]] = np.arccos(np.clip(cosine, -1.0, 1.0))
    turn[turn > CORNER] = 0.0
    off = h * turn[edges].min(axis=1) / 12.0
    count, outline = connected_components(coo_array((np.ones(len(edges)), edges.T), shape=(len(points),) * 2), False)
    of, each = outline[edges[:, 0]], np.arange(count)
    moved = sum(off[of == o] @ h[of == o] / h[of == o].sum() for o in each)
    area = float(domain.comm.allreduce(fem.assemble_scalar(forms.form(plate.constant(1.0) * plate.dx))))
    return float(moved * h.sum() / area)
