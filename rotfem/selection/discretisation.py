"""The errors of a case's outputs by its steps and its mesh, estimated as a run does it (`rotfem.refinement`)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array
from rotfem.analysis.time_loop import March
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError
from rotfem.refinement.coarser import on_other_mesh
from rotfem.refinement.discretisation import HistoryErrors, error_by_cells, error_of_shape
from rotfem.selection.candidate import Candidate
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import HISTORY, MODES, STEADY, modes_change


@dataclass(frozen=True)
class Discretisation:
    """Relative errors of the outputs of a case; outputs of which nothing is known are not there.

    Attributes:
        steps: output ↦ its error by the steps.
        mesh: output ↦ its error by the mesh.
        sizes: output ↦ largest displacement of the tip over the length.
    """

    steps: dict[str, float] = field(default_factory=dict)
    mesh: dict[str, float] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)


def discretisation(trial: Trial, theory: str, without: Collection[str] = ()) -> Discretisation:
    """Return the errors of the outputs by steps and mesh.

    Args:
        trial: the case that is tried out.
        theory: of the model.
        without: effects that it does not have.
    """
    out = Discretisation()
    effects = tuple(name for name in trial.effects if name not in without)
    problem = trial.full.problem.replace(theory=trial.theories[theory], effects=effects)
    for name, compute in ((HISTORY, _of_history), (STEADY, _of_steady), (MODES, _of_modes)):
        if name not in trial.wanted:
            continue
        try:
            compute(trial, theory, problem, out)
        except (ComputationError, InputError, np.linalg.LinAlgError):
            continue
    return out


def _on(trial: Trial, problem: Any, system: Any) -> Candidate:
    case = trial.full.replace(problem=problem.replace(mesh=system.model.problem.mesh))
    return Candidate(case, system, frozenset())


def _of_history(trial: Trial, theory: str, problem: Any, out: Discretisation) -> None:
    steps, scheme = trial.full.steps, trial.full.scheme
    assert steps is not None
    assert scheme is not None

    def start(system: Any) -> tuple[Array | None, Array | None]:
        return trial.start(_on(trial, problem, system), theory)

    system, newton = compile_system(problem, trial.comm), trial.full.newton()
    march = March(system, scheme, steps, newton, *start(system))
    watch = march.stepper.watch = HistoryErrors(problem, system, scheme, newton, start)
    candidate, scale = _on(trial, problem, system), 0.0
    for state in march:
        if system.linear and not system.size(state.q) <= 1.0:
            return
        scale = max(scale, float(np.linalg.norm(candidate.tip(state.q))))
    found = watch.errors(scale)
    if found["time"] is not None:
        out.steps[HISTORY] = found["time"]
    if found["space"] is not None:
        out.mesh[HISTORY] = found["space"]
    out.sizes[HISTORY] = scale / system.structure.length


def _of_steady(trial: Trial, theory: str, problem: Any, out: Discretisation) -> None:
    system = compile_system(problem, trial.comm, moving=False)
    candidate = _on(trial, problem, system)
    q = candidate.equilibrium()
    error = error_of_shape(problem, system, q, lambda other: _on(trial, problem, other).equilibrium())
    if error is not None:
        out.mesh[STEADY] = error
    out.sizes[STEADY] = float(np.linalg.norm(candidate.tip(q))) / system.structure.length


def _of_modes(trial: Trial, theory: str, problem: Any, out: Discretisation) -> None:
    system = compile_system(problem, trial.comm, moving=False)
    other = on_other_mesh(problem, system, moving=False)
    if other is not None:
        there, ratio = other
        values = [_on(trial, problem, s).eigenvalues(trial.speeds) for s in (system, there)]
        out.mesh[MODES] = error_by_cells(modes_change(*values), ratio)
