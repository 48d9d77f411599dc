"""`rotfem explain`: which effects and which theory a scene calls for, and what each of them changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.modes import modes
from rotfem.commands.run import run
from rotfem.errors import ComputationError
from rotfem.listeners import Progress
from rotfem.results import ExplainResult
from rotfem.scene import EFFECTS, Scene, as_scene
from rotfem.selection.coarse_model import INCREMENT, Trial
from rotfem.selection.dimensionless import MEANING, groups
from rotfem.selection.distance import HISTORY, MODES, STEADY, Outputs, change, notes, outputs_of
from rotfem.selection.estimate import LADDER, Change, Estimates
from rotfem.selection.model_choice import choose
from rotfem.version import versions

#: Why an effect is in the full model; the scene reference has the same list.
REASONS = {
    "coriolis": ("the structure spins", "nothing spins"),
    "centrifugal": ("the structure spins", "nothing spins"),
    "euler": ("the speed changes", "the speed is constant"),
    "rotary_inertia": ("the section has rotary inertia", "the section has no rotary inertia"),
    "base": ("the origin is accelerated", "no base_acceleration"),
    "gravity": ("loads.gravity is not zero", "no gravity"),
    "damping": ("there is a damping coefficient", "no damping"),
    "tip_mass": ("there is a tip mass", "no tip mass"),
    "hub_coupling": ("the hub is free and coupled", "the hub does not feel the structure"),
}

#: What follows from the size of a change: for an effect or a richer theory, and for a poorer theory.
NEEDED = {"negligible": "not needed", "noticeable": "needed where {:.1%} matters", "large": "needed"}
ENOUGH = {"negligible": "good enough", "noticeable": "good to {:.1%}", "large": "not good enough"}

#: What the notes of a check are marked with.
FULL = " of the full model"


def explain(
    scene: Scene | str | Path | Mapping[str, Any],
    check: bool = False,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
) -> ExplainResult:
    """Return how much every effect and every theory changes the outputs of a scene.

    Args:
        scene: scene, path of a scene file, or nested tables.
        check: also run the full models of every row, so that the true change stands beside the estimate.
        comm: MPI communicator; every rank gets the whole result.
        progress: called with the share of the work done, between 0 and 1.

    Raises:
        SceneError: the scene is not valid.
    """
    started = perf_counter()
    scene = as_scene(scene)
    trial = Trial(scene, comm=comm)
    asked = scene.replace({"model.frame": "rotating", "model.tolerance": None})
    theory, effects = scene.model.theory, asked.effective_effects()
    estimates = Estimates(trial, theory, effects)
    changes = estimates.all()
    estimated = perf_counter()
    if check:
        check_changes(asked, effects, changes, trial, comm, progress or (lambda share: None))
    own = estimates.own
    warnings = [f"{name} of {theory} cannot be computed: {why}" for name, why in own.failed.items()]
    if trial.unknown:
        warnings.append(
            f"frequencies at rest cannot be computed, the estimates take the scene's steps: {trial.unknown}"
        )
    if scene.model.frame == "inertial":
        warnings.append("estimates are of the rotating frame, where the same physics is a sum of effects")
    total = perf_counter() - started
    numbers = groups(scene, trial, own)
    rows = [{**c.row(), "why": why(c, scene)} for c in changes]
    summary: dict[str, Any] = {
        "command": "explain",
        "status": "done",
        "name": scene.name,
        "theory": theory,
        "effects": list(effects),
        "groups": numbers,
        "meaning": {name: MEANING[name] for name in numbers},
        "outputs": list(trial.wanted),
        "absent_outputs": trial.absent,
        "absent_effects": {name: REASONS[name][1] for name in EFFECTS if name not in trial.effects},
        "rows": rows,
        "speeds": list(trial.speeds),
        "warnings": warnings,
        "timings": {"estimate": estimated - started, "check": total - (estimated - started), "total": total},
        "versions": versions(),
        "ranks": comm.size,
        "scene": scene.to_dict(),
    }
    if scene.model.tolerance is not None:
        summary["choice"] = choose(scene, trial.wanted, comm=comm).summary()
    return ExplainResult(summary, rows)


def why(item: Change, scene: Scene) -> str:
    """Return in a few words why an effect or theory is in the scene's model or not, and whether it has to be."""
    failed = "".join(f"; {name}: {text}" for name, text in item.notes.items() if FULL not in name)
    if item.kind == "effect":
        reason = REASONS[item.name][0]
        if not item.included:
            reason += ", but it is not in model.effects"
        return f"{reason}; {NEEDED[item.verdict].format(item.worst)}{failed}"
    poorer = LADDER.index(item.name) < LADDER.index(scene.model.theory)
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
    """Write the true change into every row: both models run as the scene says, on its own mesh with its own steps."""
    exact = {"solver.increment_tolerance": min(INCREMENT, scene.solver.increment_tolerance)}
    scene = scene.replace(exact)
    own = full_outputs(scene.replace({"model.effects": list(effects)}), trial.wanted, comm)
    for i, item in enumerate(changes, start=1):
        if item.kind == "effect":
            kept = set(effects) ^ {item.name}
            other = scene.replace({"model.effects": [name for name in EFFECTS if name in kept]})
        else:
            other = scene.replace({"model.theory": item.name, "model.effects": list(effects)})
        there = full_outputs(other, trial.wanted, comm)
        item.truth = change(own, there, trial.wanted)
        item.notes |= {f"{name}{FULL}": text for name, text in notes(there).items()}
        progress(i / len(changes))


def full_outputs(scene: Scene, wanted: tuple[str, ...], comm: MPI.Comm) -> Outputs:
    """Return the outputs of a scene as `rotfem run` and `rotfem modes` give them."""
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
            done = attempt(name, lambda: run(scene, comm))
            history = done.history if done is not None else {"tip_u": np.zeros(1)}
        else:
            found = attempt(MODES, lambda: modes(scene, comm))
            rows = [row for row in found.rows if row["label"] != "rigid body"] if found is not None else []
    out = outputs_of(wanted, history, rows)
    out.failed = failed
    return out
