"""What the mesh of a case puts a history off, by a reduced linear model on it and on cells of half the size.

Both are solved by the same steps, short enough for all that moves in them, so that what the steps of the case damp out
or never excite is seen too. That holds where bending is not large.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.tips import largest, tips_of
from rotfem.analysis.refined_mesh import MOST
from rotfem.errors import ComputationError, InputError
from rotfem.selection.coarse_case import from_file
from rotfem.selection.coarse_model import Trial
from rotfem.selection.mesh_share import halved
from rotfem.selection.reduced_effects import ACCURACY, history_of, linear_of

#: Displacement of the tip over the length from which a linear model does not say what a mesh makes of it.
LARGE = 0.5


def error_of_history(trial: Trial, theory: str) -> float | None:
    """Return the change of the tip's displacement from cells of half the size to those of the case, relative.

    Args:
        trial: the case that is tried out, with a history; all effects in its model.
        theory: of the model.

    Returns:
        None where a reduced linear model does not tell it, or not quickly.
    """
    linear, mesh = linear_of(trial, theory), trial.full.problem.mesh
    if linear is None or trial.samples is None or from_file(trial.case.problem):
        return None
    try:
        own = _response(trial, mesh, linear.name)
        unknowns = 2**own.model.system.structure.mesh.topology.dim * len(own.model.system.zeros())
        size = largest(own.model, own.tips)
        if unknowns > MOST or not 0.0 < size <= LARGE * own.model.system.structure.length:
            return None
        fine = _response(trial, halved(mesh, own.model.system.structure), linear.name, own.solution.parts)
    except (ComputationError, InputError, np.linalg.LinAlgError):
        return None
    if max(own.projection_error, fine.projection_error) > ACCURACY:
        return None
    change = largest(own.model, own.q @ tips_of(own.model).T - fine.q @ tips_of(fine.model).T)
    return change / size


def _response(trial: Trial, mesh: Any, theory: str, parts: int | None = None) -> Response:
    """Return the history of a linear theory on a mesh, by steps cut into so many parts or as many as it asks for."""
    return history_of(trial, trial.on_mesh(mesh, theory), theory, parts)
