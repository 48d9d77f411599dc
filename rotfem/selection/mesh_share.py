"""What the mesh of a case makes of the errors of a coarse one, and what it puts frequencies off.

Two meshes are compared by the frequencies of the shapes that move the tip, the structure at rest, each told as a run
tells it (`rotfem.analysis.refined_mesh`): on cells of half the size, or from the shapes themselves where there are too
many. Modes are solved by the poorest theory on the case's own mesh and on cells of half the size; of a free
hub with a mesh file the hub is held.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.refined_mesh import MOST, RefinedMesh
from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.shape_error import ShapeError
from rotfem.equations.finer import FinerEquations
from rotfem.errors import ComputationError
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.refinement import NotRefined
from rotfem.selection.candidate import Candidate
from rotfem.selection.coarse_case import from_file
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import modes_change

#: Shapes, the lowest first, by which two meshes are compared.
COMPARED = 3

#: Error of a frequency that is round-off.
ROUND_OFF = 1e-14


def share_of_mesh(own: Any, coarse: Any) -> float | None:
    """Return by what errors of the coarse mesh are multiplied for those of another one; None where that is not known.

    Args:
        own: system of the poorest theory on the mesh of the case.
        coarse: the same on the coarse mesh.
    """
    if own is coarse:
        return 1.0
    try:
        fine, rough = (_errors_at_rest(system) for system in (own, coarse))
    except (ComputationError, np.linalg.LinAlgError):
        return None
    return float(fine / rough) if rough > ROUND_OFF else 1.0


def _errors_at_rest(system: Any) -> float:
    """Return the relative errors of the lowest frequencies that move the tip, the structure at rest, added up."""
    held = system.held
    held.set_time(0.0, held.motion.at_speed(0.0))
    held.set_state(held.zeros())
    M, _, K = held.mass_damping_stiffness()
    shapes = RitzVectors(held, M, K, 0.0)
    found = RefinedMesh(system).of_frequencies(shapes)
    errors = ShapeError(held).of_modes(shapes) if found is None else np.abs(found)
    return float(errors[:COMPARED].sum())


def error_of_modes(trial: Trial, own: Candidate) -> float:
    """Return the largest relative error of the wanted frequencies by the mesh of a case.

    Args:
        trial: the case that is tried out.
        own: its poorest theory on its own mesh.

    Raises:
        ComputationError: eigenpairs not to be trusted.
    """
    system, count, hub = own.switched(), trial.case.mode_count, trial.case.problem.motion.hub
    small = 2**system.structure.mesh.topology.dim * len(system.held.zeros()) <= MOST
    if hub is not None and small and not from_file(trial.case.problem):
        twice = trial.poorest_on(halved(trial.full.problem.mesh, system.structure))
        return modes_change(own.eigenvalues(trial.speeds), twice.eigenvalues(trial.speeds))
    fine = RefinedMesh(system).equations if system.held.linear else None
    if fine is not None:
        with suppress(NotRefined):
            found = [_eigenvalues(system.held, fine, speed, count) for speed in trial.speeds]
            return max(modes_change(here, there) for here, there in found)
    analysis = ModalAnalysis(system.model.problem, trial.case.about, trial.case.newton(), trial.comm, system)
    told = [analysis.mesh_errors(analysis.at(speed, count))[:count] for speed in trial.speeds]
    return max(map(max, told))


def halved(mesh: Any, structure: Any) -> Any:
    """Return a mesh of no file with cells of half the size of those that a structure has on it.

    A beam has a node wherever its line or its section has one, and so maybe more elements than were asked for.
    """
    elements, cells = mesh.elements, structure.mesh.topology.index_map(structure.mesh.topology.dim).size_global
    twice = 2 * cells if isinstance(elements, int) else tuple(2 * n for n in elements)
    return mesh.model_copy(update={"elements": twice})


def _eigenvalues(held: Any, fine: FinerEquations, speed: float, count: int) -> tuple[npt.NDArray[Any], ...]:
    """Return λ of a linear theory at a speed (rad/s), the hub held, here and there."""
    held.set_time(0.0, held.motion.at_speed(speed))
    held.set_state(held.zeros())
    here = held.mass_damping_stiffness()
    fine.take()
    return tuple(Pencil(*matrices).lasting(count) for matrices in (here, fine.mass_damping_stiffness()))
