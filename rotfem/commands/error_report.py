"""What the commands report of the error of their results: its contributions, and when a warning is due."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.theory_error import TheoryError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import compared
from rotfem.refinement.distance import sizes
from rotfem.refinement.estimate import ErrorEstimate

Array = npt.NDArray[np.float64]

#: What the contributions are called in warnings.
NAMES = {"time": "time steps", "space": "mesh", "model": "theory"}


def richer_problem(problem: Problem) -> Problem | None:
    """Return a problem in the richer theory that it is compared with; None where there is none."""
    richer = compared(problem.theory, problem.structure.type)
    return None if richer is None else problem.replace(theory=richer)


def error_of_modes(rows: Sequence[Mapping[str, Any]], theory: TheoryError | None) -> ErrorEstimate:
    """Return the largest error of the eigenvalues of rows, relative to each.

    Of one that is zero to round-off it is relative to the least at the same speed that is not.
    """
    flexible = [row for row in rows if row.get("stability") != "neutral"]
    mesh, bound = [row["mesh_error"] for row in flexible], 0.0
    for speed in {row.get("speed") for row in flexible}:
        there = [row for row in flexible if row.get("speed") == speed]
        bounds, found = np.array([(row["error_bound"], complex(row["growth"], row["frequency"])) for row in there]).T
        with np.errstate(over="ignore"):  # none of them is resolved
            of_others = np.abs(bounds * found) / sizes(np.where(np.abs(bounds) < 1.0, found, 0.0))
        bound = max(bound, float(np.minimum(np.abs(bounds), of_others).max()))
    space = None if None in mesh else float(max(mesh, default=0.0))
    return ErrorEstimate({"space": space, "model": None if theory is None else theory.estimate, "round_off": bound})
