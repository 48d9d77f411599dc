"""`rotfem explain`: which effects and which theory a scene calls for, and what each of them changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.loads import held
from rotfem.commands.modes import modes
from rotfem.commands.problem import Problem, case_of
from rotfem.commands.run import run
from rotfem.commands.summary import summary
from rotfem.errors import ComputationError, SceneError, input_of
from rotfem.listeners import Progress
from rotfem.mechanics.effects import Effect, Work
from rotfem.mechanics.theories import Theory
from rotfem.results import ExplainResult
from rotfem.scene import Scene, as_scene
from rotfem.selection.case import Case
from rotfem.selection.coarse_case import INCREMENT
from rotfem.selection.coarse_model import Trial
from rotfem.selection.dimensionless import MEANING, groups
from rotfem.selection.distance import HISTORY, MODES, STEADY, Outputs, change, notes, outputs_of
from rotfem.selection.estimate import RESOLVED, Change, Estimates
from rotfem.selection.model_choice import choose

#: What follows from the size of a change: for an effect or a richer theory, and for a poorer theory.
NEEDED = {"negligible": "not needed", "noticeable": "needed where {:.1%} matters", "large": "needed"}
ENOUGH = {"negligible": "good enough", "noticeable": "good to {:.1%}", "large": "not good enough"}

#: The same of steps, and how many times as many there are in a check.
FINE = {"negligible": "fine enough", "noticeable": "off by {:.1%}", "large": "too coarse: off by {:.1%}"}
FINER = 4

#: What the notes of a check are marked with.
FULL = " of the full model"


def explain(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    check: bool = False,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
    terms: Mapping[str, Work] | None = None,
) -> ExplainResult:
    """Return how much every effect and every theory changes the outputs of a scene.

    Args:
        scene: scene, path of a scene file, or nested tables.
        check: also run the full models of every row, so that the true change stands beside the estimate.
        comm: MPI communicator; every rank gets the whole result.
        progress: called with the share of the work done, between 0 and 1.
        terms: further terms of the residual by name, in every model, (mechanics, variation) ↦ UFL form.

    Raises:
        SceneError: the scene is not valid, or a check is asked for with terms that are not registered.
    """
    scene = as_scene(scene)
    if check and terms:
        raise SceneError(scene.file, "--check", None, "runs the scene's own models; register the terms as effects")
    with input_of(scene.file):
        case = case_of(scene).replace(problem=Problem.of(scene, terms=terms))
        return _explained(scene, case, check, comm, progress or (lambda share: None))


def _explained(scene: Scene, case: Case, check: bool, comm: MPI.Comm, progress: Progress) -> ExplainResult:
    started = perf_counter()
    trial, theory = Trial(case, comm=comm), case.problem.theory
    effects = case.problem.replace(frame="rotating").effective_effects()
    estimates = Estimates(trial, theory.name, effects)
    changes = estimates.all()
    spent = {"estimate": perf_counter() - started, "check": 0.0}
    if check:
        check_changes(scene, effects, changes, trial, comm, progress)
        spent["check"] = perf_counter() - started - spent["estimate"]
    numbers = groups(trial, estimates.own)
    rows = [{**item.row(), "why": why(item, theory)} for item in changes]
    chosen = case.tolerance is not None
    result: dict[str, Any] = {
        **summary("explain", scene, comm, choose(case, trial.wanted, comm=comm) if chosen else None),
        "theory": theory.name,
        "effects": list(effects),
        "groups": numbers,
        "meaning": {name: MEANING[name] for name in numbers},
        "outputs": list(trial.wanted),
        "resolution": RESOLVED,
        "absent_outputs": trial.absent,
        "absent_effects": {
            effect.name: effect.reasons[1] for effect in Effect.registry if effect.name not in trial.effects
        },
        "rows": rows,
        "speeds": list(trial.speeds),
        "warnings": doubts(scene, trial, estimates),
        "timings": {**spent, "total": sum(spent.values())},
    }
    return ExplainResult(result, rows)


def doubts(scene: Scene, trial: Trial, estimates: Estimates) -> list[str]:
    """Return warnings about what the estimates are of."""
    out = [f"{name} of {estimates.theory} cannot be computed: {why}" for name, why in estimates.own.failed.items()]
    if trial.unknown:
        out.append(f"frequencies at rest cannot be computed, the estimates take the scene's steps: {trial.unknown}")
    if MODES in trial.wanted:
        out += [f"modes: {line}" for line in held(trial.case.problem)]
    if scene.frame == "inertial":
        out.append("estimates are of the rotating frame, where the same physics is a sum of effects")
    return out


def why(item: Change, own: Theory) -> str:
    """Return in a few words why an effect or theory is in a model or not, and whether it has to be.

    Args:
        item: the change it makes.
        own: theory of the model.
    """
    failed = "".join(f"; {name}: {text}" for name, text in item.notes.items() if FULL not in name)
    if item.kind == "effect":
        reason = Effect.registry[item.name].reasons[0]
        if not item.included:
            reason += ", but it is not in model.effects"
        return f"{reason}; {NEEDED[item.verdict].format(item.worst)}{failed}"
    if item.kind == "discretisation":
        return FINE[item.verdict].format(item.worst)
    poorer = Theory.registry[item.name].rank < own.rank
    return (ENOUGH if poorer else NEEDED)[item.verdict].format(item.worst) + failed


# --- the truth ------------------------------------------------------------------------------------------------------


def check_changes(
    scene: Scene,
    effects: tuple[str, ...],
    changes: list[Change],
    trial: Trial,
    comm: MPI.Comm,
    progress: Progress,
) -> None:
    """Write the true change into every row: both models run as the scene says, on its own mesh with its own steps.

    Args:
        scene: as it was given; it runs in the rotating frame with the model of each row.
        effects: of its own model.
        changes: the rows.
        trial: what was tried out.
        comm: MPI communicator.
        progress: called with the share of the rows that are done.
    """
    increment = min(INCREMENT, scene.solver.increment_tolerance)
    exact = {"model.frame": "rotating", "model.tolerance": None, "solver.increment_tolerance": increment}
    scene = scene.replace(exact)
    own = full_outputs(scene.replace({"model.effects": list(effects)}), trial, comm)
    for i, item in enumerate(changes, start=1):
        if item.name == "time.tolerance":
            continue  # adaptive steps have no common times
        if item.kind == "discretisation":
            finer = finer_steps if item.name == "time.step" else finer_mesh
            other = finer(scene).replace({"model.effects": list(effects)})
        elif item.kind == "effect":
            kept = set(effects) ^ {item.name}
            other = scene.replace({"model.effects": [name for name in trial.effects if name in kept]})
        else:
            prestress = scene.model.prestress if Theory.registry[item.name].prestress else None
            said = {"model.theory": item.name, "model.prestress": prestress, "model.effects": list(effects)}
            other = scene.replace(said)
        there = full_outputs(other, trial, comm)
        item.truth = change(own, there, trial.wanted)
        item.notes |= {f"{name}{FULL}": text for name, text in notes(there).items()}
        progress(i / len(changes))


def finer_steps(scene: Scene) -> Scene:
    """Return a scene with shorter steps, its rows where they were."""
    time = scene.time
    assert time is not None
    assert time.step is not None
    return scene.replace({"time.step": time.step / FINER, "time.output_every": time.output_every * FINER})


def finer_mesh(scene: Scene) -> Scene:
    """Return a scene with twice the elements in each direction; of a mesh file, of a higher degree."""
    if getattr(scene.structure, "mesh", None) is not None:
        return scene.replace({"mesh.degree": scene.mesh.degree + 1})
    elements = scene.mesh.elements
    return scene.replace({"mesh.elements": [2 * n for n in elements] if isinstance(elements, tuple) else 2 * elements})


def compared(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the rows of modes that models are compared by: no rigid body, of an overdamped mode the slow one."""
    return [row for row in rows if row["label"] != "rigid body" and not row["label"].endswith(", fast")]


def full_outputs(scene: Scene, trial: Trial, comm: MPI.Comm) -> Outputs:
    """Return the outputs of a scene as `rotfem run` and `rotfem modes` give them, the latter at the trial's speed."""
    wanted = trial.wanted
    turning = scene.replace({"motion.speed": trial.speeds[0]}) if trial.case.problem.motion.hub is not None else scene
    failed: dict[str, str] = {}
    history: Mapping[str, Any] = {}
    rows: list[Mapping[str, Any]] = []

    def attempt(name: str, compute: Callable[[], Any]) -> Any:
        try:
            return compute()
        except ComputationError as error:
            failed[name] = error.what
            return None

    for name in wanted:
        if name in (HISTORY, STEADY):
            done = attempt(name, lambda: run(scene, comm=comm))
            history = done.history if done is not None else {"tip_u": np.zeros(1)}
        else:
            found = attempt(MODES, lambda: modes(turning, comm=comm))
            rows = compared(found.rows) if found is not None else []
    out = outputs_of(wanted, history, rows)
    out.failed = failed
    return out
