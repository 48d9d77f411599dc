"""What steps and mesh of a case put its outputs off, told as every run tells it.

A march on the case's own mesh with its own steps is watched (`rotfem.analysis.error_watch`). Where there are very many
steps it takes longer ones, and the error is scaled by the order of the scheme. What the mesh puts a history off two
reduced models tell where they serve (`rotfem.selection.history_on_meshes`), else the same march. Where the mesh makes
that dear, the coarse model marches, and what its mesh puts off is scaled (`rotfem.selection.mesh_share`), which also
tells the modes.
"""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import ceil

import numpy as np

from rotfem.analysis.error_watch import ErrorWatch, TipErrors
from rotfem.analysis.schemes import State
from rotfem.analysis.time_loop import March, Steps
from rotfem.errors import ComputationError, InputError
from rotfem.selection.candidate import Candidate
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import HISTORY, MODES, STEADY
from rotfem.selection.history_on_meshes import error_of_history
from rotfem.selection.mesh_share import error_of_modes, share_of_mesh

#: Steps of a march at most, beyond which one stands for several, and corrections of an equilibrium.
MOST_STEPS, CORRECTIONS = 800, 20

#: Most steps (or corrections) times unknowns of what is computed on the mesh of the case.
AFFORDABLE = 1e6

#: Error of the steps from which that of the mesh is asked of finer ones, what theirs may be, and most of them for one.
HIDING, SEEING, MOST_FINER = 2e-2, 4e-3, 5


@dataclass(frozen=True)
class Discretisation:
    """Relative errors of the outputs of a case; outputs of which nothing is known are not there.

    Attributes:
        steps: output ↦ what the steps put it off.
        mesh: output ↦ what the mesh puts it off.
        sizes: output ↦ largest displacement of the tip over the length.
    """

    steps: dict[str, float] = field(default_factory=dict)
    mesh: dict[str, float] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)


def discretisation(trial: Trial, theory: str, without: Collection[str] = ()) -> Discretisation:
    """Return what steps and mesh put the outputs off.

    Args:
        trial: the case that is tried out.
        theory: of the model.
        without: effects that it does not have.
    """
    out = Discretisation()
    try:
        own = trial.poorest_on(trial.full.problem.mesh)
    except (ComputationError, InputError, np.linalg.LinAlgError):
        return out
    for name in (HISTORY, STEADY):
        if name not in trial.wanted:
            continue
        unknowns = len(own.system.held.zeros())
        number = CORRECTIONS if name == STEADY else min(_number(trial), MOST_STEPS)
        near = number * unknowns <= AFFORDABLE
        candidate = (
            trial.on_mesh(trial.full.problem.mesh, theory, without) if near else trial.candidate(theory, without)
        )
        errors = _resting(candidate) if name == STEADY else _marched(trial, candidate, theory)
        if errors is None or not errors.scale > 0.0:
            continue
        out.sizes[name] = errors.scale / candidate.system.structure.length
        if name == HISTORY and errors.time is not None:
            out.steps[name] = errors.time[0] / errors.scale
            known = None if without else error_of_history(trial, theory)
            if known is not None:
                out.mesh[name] = known
                continue
            errors = _in_finer_steps(trial, candidate, theory, out.steps[name]) or errors
        share = 1.0 if near else share_of_mesh(own.switched(), trial.poorest)
        if share is not None:
            out.mesh[name] = min(1.0, share * (errors.shape + errors.space[0] / errors.scale))
    if MODES in trial.wanted:
        with suppress(ComputationError):
            out.mesh[MODES] = error_of_modes(trial, own)
    return out


def _number(trial: Trial) -> int:
    """Return the number of steps of a case; that of a march at most where they are adaptive."""
    steps = trial.full.steps
    assert steps is not None
    return MOST_STEPS if steps.step is None else ceil(steps.end / steps.step - 1e-9)


def _in_finer_steps(trial: Trial, candidate: Candidate, theory: str, off: float) -> TipErrors | None:
    """Return the errors of a history whose steps are off by so much, in shorter ones; None where they do not help.

    What long steps damp out or never excite the mesh cannot be seen to put off.
    """
    steps, scheme = trial.full.steps, trial.full.scheme
    assert steps is not None
    assert scheme is not None
    if steps.step is None or off <= HIDING:
        return None
    finer = min(MOST_FINER, ceil((off / SEEING) ** (1 / scheme.order)))
    if finer * _number(trial) * len(candidate.system.held.zeros()) > AFFORDABLE:
        return None
    found = _marched(trial, candidate, theory, finer)
    return found if found is not None and found.scale > 0.0 else None


def _marched(trial: Trial, candidate: Candidate, theory: str, finer: int = 1) -> TipErrors | None:
    """Return the errors of a history, in so many steps for one; None where it fails."""
    steps, scheme = trial.full.steps, trial.full.scheme
    assert steps is not None
    assert scheme is not None
    thinned = ceil(_number(trial) / MOST_STEPS) / finer
    longer: Steps = steps if steps.step is None else replace(steps, step=thinned * steps.step)
    system = candidate.switched()

    def march() -> TipErrors | None:
        states = March(system, scheme, longer, trial.case.newton(foreseeing=True), *trial.start(candidate, theory))
        watch = states.stepper.watch = ErrorWatch(system, longer.end, scheme)
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


def _resting(candidate: Candidate) -> TipErrors | None:
    """Return the errors of a steady state; None where there is none."""
    try:
        q = candidate.equilibrium()
        zero = np.zeros_like(q)
        return ErrorWatch(candidate.system).errors(State(0.0, q, zero, zero, datum=candidate.system.datum))
    except ComputationError:
        return None
