"""What the mesh of a case puts a history off, by a reduced linear model on it and on cells of half the size.

Both are solved by the same steps, short enough for all that moves in them, so that what the steps of the case damp out
or never excite is seen too. That holds where bending is not large. Motions that do not begin at rest are those of two
linear theories that march.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.tips import largest, tips_of
from rotfem.analysis.refined_mesh import MOST
from rotfem.errors import ComputationError, InputError
from rotfem.selection.candidate import Watch
from rotfem.selection.coarse_case import from_file
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import Outputs, tip_change
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
    if trial.case.first is not None:
        return _by_marches(trial, mesh, linear.name)
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


def _by_marches(trial: Trial, mesh: Any, theory: str) -> float | None:
    """Return the same by two histories of a linear theory in the steps of a trial."""
    samples, tips = trial.samples, []
    assert samples is not None
    try:
        coarse = trial.on_mesh(mesh, theory)
        structure = coarse.system.structure
        if 2**structure.mesh.topology.dim * len(coarse.system.zeros()) > MOST:
            return None
        for candidate in (coarse, trial.on_mesh(halved(mesh, structure), theory)):
            out = Outputs()
            candidate.history(samples.steps(trial.finer), trial.start(candidate, theory), out, Watch())
            tips.append(out.tip)
    except (ComputationError, InputError, np.linalg.LinAlgError):
        return None
    size = float(np.linalg.norm(tips[0], axis=1).max())
    return tip_change(*tips) if 0.0 < size <= LARGE * structure.length else None
