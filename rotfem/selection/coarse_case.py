"""What of a case is tried out: the same on a coarse mesh with all effects, and which of the outputs it has."""

from __future__ import annotations

import numpy as np

from rotfem.analysis.equilibrium import check_steady
from rotfem.errors import InputError
from rotfem.mechanics.problem import Problem
from rotfem.selection.case import Case
from rotfem.selection.distance import HISTORY, STEADY

#: Nodes along a coarse mesh for every wanted mode, and the fewest.
NODES_A_MODE, FEWEST_NODES = 3, 12

#: Newton stops here: small differences of two solutions are wanted. Its last increment is far larger than its error.
INCREMENT = 1e-10


def coarse(case: Case, modes: bool = True) -> Case:
    """Return the case on a mesh just fine enough, in the rotating frame with all effects, solved to round-off.

    Args:
        case: problem, and what is to be computed of it.
        modes: whether its modes are wanted; without, the mesh of a plate, whose time it makes, can be coarser still.
    """
    problem = case.problem
    if not from_file(problem):
        is_surface = np.ndim(problem.mesh.elements) > 0
        nodes = max(FEWEST_NODES, NODES_A_MODE * case.mode_count if modes or not is_surface else 0)
        problem = problem.replace(mesh=problem.mesh.at_most(nodes))
    return case.replace(
        problem=problem.replace(frame="rotating", effects=None),
        increment_tolerance=min(INCREMENT, case.increment_tolerance),
        tolerance=None,
    )


def from_file(problem: Problem) -> bool:
    """Return whether the mesh is that of a file."""
    return getattr(problem.structure, "mesh", None) is not None


def absent(case: Case) -> dict[str, str]:
    """Return output ↦ why a case has none of it, among history, steady state and modes."""
    out = {STEADY: "the scene asks for a history"}
    if case.steps is None:
        out = {HISTORY: "the scene has no [time]"} | ({STEADY: case.unsteady} if case.unsteady else {})
    try:
        check_steady(case.problem.replace(effects=None))
    except InputError as error:
        out.setdefault(STEADY, str(error))
    return out
