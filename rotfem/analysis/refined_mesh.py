"""How far the mesh of a beam puts a state off, by the same state on elements of half the length.

The state is put on the finer mesh, where its forces are out of balance by what the elements could not follow. The
displacements that balance them, by Newton's method with velocities and accelerations as they are, are the error of the
coarser mesh but for that of the finer one. The forms are those of the run itself, so nothing is compiled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import State
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError
from rotfem.numerics.linear import DirectSolver, Increment

Array = npt.NDArray[np.float64]

#: Most corrections, the relative size of one that is small, and how many of these in a row are the last.
CORRECTIONS, SMALL, ENOUGH = 15, 0.02, 2

#: Distance of two nodes that are one, as a part of the length.
ONE = 1e-9


def error_by_refinement(system: Any, state: State) -> float | None:
    """Return the error (m) of the tip at a state; None of other structures than beams, and where it cannot be found.

    Args:
        system: equations of motion, in the frame that turns.
        state: where; its rotations counted from the undeformed structure.
    """
    inner = system.held
    if inner.structure.mesh.topology.dim != 1 or system.clamp is not None or state.datum is not None:
        return None
    problem = inner.model.problem
    try:
        mesh = problem.mesh.model_copy(update={"elements": 2 * problem.mesh.elements})
        fine = compile_system(problem.replace(mesh=mesh, outputs={}), inner.comm, inner.moving)
        return _corrected(system, fine, state) if fine.structure.unknowns == inner.structure.unknowns else None
    except (ComputationError, InputError):
        return None


def _corrected(system: Any, fine: Any, state: State) -> float | None:
    """Return by how much the tip moves when a state is balanced on a finer mesh; None where that does not end."""
    motion = [_on(system.held, fine.held, x[: len(system.held.zeros())]) for x in (state.q, state.v, state.a)]
    q, hub = motion[0].copy(), [x[-1:] for x in (state.q, state.v, state.a)]
    increment, done = Increment(fine.V), 0
    moves = [i for i, name in enumerate(fine.structure.unknowns) if name.startswith("u")]
    for _ in range(CORRECTIONS):
        fine.set_time(state.t)
        whole = [q, motion[1], motion[2]]
        if system.hub is not None:
            whole = [np.append(x, angle) for x, angle in zip(whole, hub, strict=True)]
        fine.set_state(*whole)
        dq = increment.solve(DirectSolver(fine.held.matrix(1.0, 0.0, 0.0, 1.0)), fine.held.residual())
        q += dq
        last = float(np.linalg.norm(fine.structure.tip_values(dq)[moves]))
        size = float(np.linalg.norm(fine.structure.tip_values(q - motion[0])[moves]))
        done = done + 1 if last <= SMALL * size else 0
        if system.held.linear or done == ENOUGH:
            return size
    return None


def _on(coarse: Any, fine: Any, values: Array) -> Array:
    """Return the function of local dofs on a coarser line at the nodes of a finer one, local dofs of that."""
    x, q = coarse.structure.gather(values)
    order = np.argsort(x[:, 0], kind="stable")
    x, q = x[order, 0], q[order]
    degree = coarse.structure.problem.mesh.degree
    ends = x[::degree]
    at = fine.V.tabulate_dof_coordinates()[:, 0]
    cell = np.clip(np.searchsorted(ends, at + ONE * ends[-1], side="right") - 1, 0, len(ends) - 2)
    nodes = cell[:, None] * degree + np.arange(degree + 1)
    points = x[nodes]
    shape = np.ones_like(points)
    for j in range(degree + 1):
        for m in range(degree + 1):
            if m != j:
                shape[:, j] *= (at - points[:, m]) / (points[:, j] - points[:, m])
    return np.asarray(np.einsum("nj,njc->nc", shape, q[nodes]).ravel())
