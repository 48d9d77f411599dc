"""`rotfem explain`: which effects and which theory a scene calls for, and what each of them changes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.fixed_frame import check_rotating
from rotfem.analysis.march import Steps
from rotfem.commands.first_state import first_state
from rotfem.commands.loads import frozen_inputs
from rotfem.commands.modes import modes
from rotfem.commands.problem import Problem, scheme_of
from rotfem.commands.processes import communicator, summary
from rotfem.commands.run import run
from rotfem.errors import ComputationError, SceneError, input_of
from rotfem.listeners import Progress
from rotfem.mechanics.effects import Effect, Work
from rotfem.mechanics.theories import Theory
from rotfem.numerics.newton import Newton
from rotfem.refinement.dimensionless import MEANING, groups
from rotfem.refinement.distance import distance, distance_each
from rotfem.refinement.explain import MODES, RESOLVED, Case, Change, Explanation
from rotfem.results import ExplainResult
from rotfem.scene import Scene, as_scene

#: What follows from the size of a change: for an effect or a richer theory, and for a poorer theory.
NEEDED = {"negligible": "not needed", "noticeable": "needed where {:.1%} matters", "large": "needed"}
ENOUGH = {"negligible": "good enough", "noticeable": "good to {:.1%}", "large": "not good enough"}

#: The same of steps.
FINE = {"negligible": "fine enough", "noticeable": "in error by {:.1%}", "large": "too coarse: in error by {:.1%}"}

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
        check: also run the full models of every row, so that the true change stands next to the estimate.
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
        case = case_of(scene, terms)
        of = Explanation(case, communicator(case.problem, comm))
        return _explained(scene, of, check, progress or (lambda share: None), comm)


def case_of(scene: Scene, terms: Mapping[str, Work] | None = None) -> Case:
    """Return the case of a scene: its problem, and what is to be computed of it."""
    time, unsteady = scene.time, ""
    try:
        scene.check_run()
    except SceneError as error:
        unsteady = str(error)

    def first(system: Any) -> tuple[Any, Any]:
        start = first_state(scene, system.model.problem, system, judged=False)
        return start.q, start.v

    problem = Problem.of(scene, terms=terms)
    check_rotating(problem, "explain")
    return Case(
        problem=problem,
        steps=None if time is None else Steps.of(time),
        scheme=None if time is None else scheme_of(time),
        first=first,
        mode_count=scene.modes.count,
        about=scene.modes.about,
        newton=lambda: Newton.of(scene.solver),
        past_limits=scene.solver.past_limits,
        unsteady=unsteady,
    )


def _explained(scene: Scene, of: Explanation, check: bool, progress: Progress, comm: MPI.Comm) -> ExplainResult:
    started, theory = perf_counter(), of.problem.theory
    changes = of.all()
    spent = {"estimate": perf_counter() - started, "check": 0.0}
    if check:
        check_changes(scene, of, changes, progress)
        spent["check"] = perf_counter() - started - spent["estimate"]
    numbers = groups(of)
    rows = [{**item.row(), "why": why(item, theory)} for item in changes]
    result: dict[str, Any] = {
        **summary("explain", scene, comm, of.system.comm),
        "theory": theory.name,
        "effects": list(of.own),
        "groups": numbers,
        "meaning": {name: MEANING[name] for name in numbers},
        "outputs": list(of.wanted),
        "resolution": RESOLVED,
        "absent_outputs": of.absent,
        "absent_effects": {e.name: e.reasons[1] for e in Effect.registry if e.name not in of.effects},
        "rows": rows,
        "speeds": [of.speed],
        "warnings": doubts(scene, of),
        "timings": {**spent, "total": sum(spent.values())},
    }
    return ExplainResult(result, rows)


def doubts(scene: Scene, of: Explanation) -> list[str]:
    """Return warnings about what the estimates are of."""
    out = [f"{name} of {of.problem.theory.name} cannot be computed: {what}" for name, what in of.failed.items()]
    if MODES in of.wanted:
        out += [f"modes: {line}" for line in frozen_inputs(of.problem)]
    if scene.model.frame == "inertial":
        out.append("estimates are of the rotating frame, where the same physics is a sum of effects")
    return out


def why(item: Change, own: Theory) -> str:
    """Return in a few words why an effect or theory is in a model or not, and whether it has to be.

    Args:
        item: the change it makes.
        own: theory of the model.
    """
    failed = "".join(f"; {name}: {text}" for name, text in item.notes.items() if FULL not in name)
    if item.verdict == "unknown":
        return ("the error is unknown" if item.kind == "discretisation" else "these steps do not show it") + failed
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


def check_changes(scene: Scene, of: Explanation, changes: list[Change], progress: Progress) -> None:
    """Write the true change into every row: both models run as the scene says, on its own mesh with its own steps.

    Args:
        scene: as it was given; it runs in the rotating frame with the model of each row.
        of: the changes.
        changes: the rows.
        progress: called with the share of the rows that are done.
    """
    increment = min(1e-10, scene.solver.increment_tolerance)  # small differences are wanted
    exact = {"model.frame": "rotating", "model.tolerance": None, "solver.increment_tolerance": increment}
    scene = scene.replace({**exact, "model.effects": list(of.own), "output.error": False})
    own, own_notes = full_outputs(scene, of)
    for i, item in enumerate(changes, start=1):
        if item.name == "time.tolerance":
            continue  # adaptive steps have no common times
        if item.kind == "discretisation":
            other = finer(scene, item.name)
        elif item.kind == "effect":
            kept = set(of.own) ^ {item.name}
            other = scene.replace({"model.effects": [name for name in of.effects if name in kept]})
        else:
            prestress = scene.model.prestress if Theory.registry[item.name].prestress else None
            other = scene.replace({"model.theory": item.name, "model.prestress": prestress})
        there, notes = full_outputs(other, of)
        for name, x in own.items():
            apart = distance_each if name == MODES else distance
            item.truth[name] = np.inf if x is None or there[name] is None else apart(x, there[name])
        item.notes |= {f"{name}{FULL}": text for name, text in (own_notes | notes).items()}
        progress(i / len(changes))


def finer(scene: Scene, name: str) -> Scene:
    """Return a scene with shorter steps and rows where they were, or on a finer mesh; of a file, of a higher degree."""
    time = scene.time
    if name == "time.step" and time is not None and time.step is not None:
        return scene.replace({"time.step": time.step / 4, "time.output_every": time.output_every * 4})
    if scene.structure.mesh_file is not None:
        return scene.replace({"mesh.degree": scene.mesh.degree + 1})
    elements = scene.mesh.elements
    return scene.replace({"mesh.elements": [2 * n for n in elements] if isinstance(elements, tuple) else 2 * elements})


def full_outputs(scene: Scene, of: Explanation) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the outputs of a scene as `rotfem run` and `rotfem modes` give them, None of what fails, and why.

    Modes are those at the speed of the explanation.
    """
    comm, out, notes = of.system.comm, dict[str, Any](), dict[str, str]()
    turning = scene.replace({"motion.speed": of.speed}) if of.problem.motion.hub is not None else scene
    for name in of.wanted:
        try:
            if name == MODES:
                rows = modes(turning, comm=comm).rows  # no rigid body, of an overdamped mode the slow one
                kept = [r for r in rows if r["label"] != "rigid body" and not r["label"].endswith(", fast")]
                out[name] = np.array([complex(row["growth"], row["frequency"]) for row in kept])
            else:
                history = run(scene, comm=comm).history
                out[name] = np.column_stack([x for key, x in history.items() if key.startswith("tip_u")])
        except ComputationError as error:
            out[name], notes[name] = None, error.what
    return out, notes
