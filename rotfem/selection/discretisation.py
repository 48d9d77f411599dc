"""What steps and mesh of a case put its outputs off, told by the coarse model and the case's own mesh at rest.

A march of the coarse model with the case's own steps is watched (`rotfem.analysis.error_watch`). Where there are very
many steps it takes longer ones, and the error is scaled by the order of the scheme. What the coarse mesh puts off is
scaled to the case's own by what both make of the same shapes, those that unit forces at the tip excite. The modes are
solved on the case's own mesh, by the poorest theory.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

import numpy as np

from rotfem.analysis.error_watch import ErrorWatch, TipErrors
from rotfem.analysis.mesh_estimate import SAFE
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.schemes import State
from rotfem.analysis.shape_error import LIKELY, ShapeError
from rotfem.analysis.time_loop import March
from rotfem.errors import ComputationError, InputError
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import HISTORY, MODES, STEADY

#: Steps of a march at most; beyond, one stands for several.
MOST_STEPS = 800

#: Shapes, the lowest first, by which two meshes are compared.
COMPARED = 3

#: Error of a frequency that is round-off.
ROUND_OFF = 1e-14


@dataclass(frozen=True)
class Discretisation:
    """Relative errors of the outputs of a case; outputs of which nothing is known are not there.

    Attributes:
        steps: output ↦ what the steps put it off.
        mesh: output ↦ what the mesh puts it off.
    """

    steps: dict[str, float] = field(default_factory=dict)
    mesh: dict[str, float] = field(default_factory=dict)


def discretisation(trial: Trial, theory: str, without: Collection[str] = ()) -> Discretisation:
    """Return what steps and mesh put the outputs off.

    Args:
        trial: the case that is tried out.
        theory: of the model.
        without: effects that it does not have.
    """
    out = Discretisation()
    try:
        own = own_mesh(trial)
        share = _share(own, trial.poorest)
    except (ComputationError, InputError, np.linalg.LinAlgError):
        own, share = None, None
    for name, errors in (
        (HISTORY, _marched(trial, theory, without) if HISTORY in trial.wanted else None),
        (STEADY, _resting(trial, theory, without) if STEADY in trial.wanted else None),
    ):
        if errors is None or not errors.scale > 0.0:
            continue
        if name == HISTORY and errors.time is not None:
            out.steps[name] = errors.time[0] / errors.scale
        if share is not None:
            out.mesh[name] = min(1.0, share * (errors.shape + errors.space[0] / errors.scale))
    if MODES in trial.wanted and own is not None:
        with suppress(ComputationError):
            out.mesh[MODES] = _of_modes(trial, own)
    return out


def _marched(trial: Trial, theory: str, without: Collection[str]) -> TipErrors | None:
    """Return the errors of a history; None where it fails."""
    steps, scheme, thinned = trial.full.steps, trial.full.scheme, 1
    assert steps is not None
    assert scheme is not None
    if steps.step is not None:
        thinned = ceil(steps.end / steps.step / MOST_STEPS - 1e-9)
        steps = replace(steps, step=thinned * steps.step)
    candidate = trial.candidate(theory, without)
    system = candidate.switched()

    def march() -> TipErrors | None:
        states = March(system, scheme, steps, trial.case.newton(), trial.start(candidate, theory))
        watch = states.stepper.watch = ErrorWatch(system, steps.end, scheme)
        last = None
        for last in states:
            if system.linear and not system.size(last.q) <= 1.0:
                return None
        return watch.errors(last)

    try:
        errors = candidate.plainly(march)
    except ComputationError:
        return None
    if errors is None or errors.time is None:
        return errors
    return replace(errors, time=(errors.time[0] / thinned**scheme.order, errors.time[1]))


def _resting(trial: Trial, theory: str, without: Collection[str]) -> TipErrors | None:
    """Return the errors of a steady state; None where there is none."""
    candidate = trial.candidate(theory, without)
    try:
        q = candidate.equilibrium()
        zero = np.zeros_like(q)
        return ErrorWatch(candidate.system).errors(State(0.0, q, zero, zero, datum=candidate.system.datum))
    except ComputationError:
        return None


# --- the mesh ---------------------------------------------------------------------------------------------------------


def own_mesh(trial: Trial) -> Any:
    """Return the system of the poorest theory on the mesh of the case itself."""
    if trial.full.problem.mesh == trial.case.problem.mesh:
        return trial.poorest
    return trial.compiled(trial.case.problem.replace(mesh=trial.full.problem.mesh), next(iter(trial.theories)))


def _share(own: Any, coarse: Any) -> float:
    """Return by what errors of the coarse mesh are multiplied for those of another one."""
    if own is coarse:
        return 1.0
    fine, rough = (float(_errors_at_rest(system).sum()) for system in (own, coarse))
    return fine / rough if rough > ROUND_OFF else 1.0


def _errors_at_rest(system: Any) -> Any:
    """Return the relative errors of the lowest frequencies that move the tip, the structure at rest."""
    held = system.held
    held.set_time(0.0, held.motion.at_speed(0.0))
    held.set_state(held.zeros())
    M, _, K = held.mass_damping_stiffness()
    return ShapeError(held).of_modes(RitzVectors(held, M, K, 0.0))[:COMPARED]


def _of_modes(trial: Trial, own: Any) -> float:
    """Return the largest relative error of the wanted frequencies by the mesh."""
    case = trial.case
    analysis = ModalAnalysis(own.model.problem, case.about, case.newton(), trial.comm, own)
    found = [analysis.mesh_errors(analysis.at(speed, case.mode_count))[: case.mode_count] for speed in trial.speeds]
    return LIKELY / SAFE * max(map(max, found))
