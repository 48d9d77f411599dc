"""`rotfem cost`: what accuracy costs in time, over theory, mesh, degree, step and scheme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.cost.budget import DEFAULT_FULL, DEFAULT_QUICK, Budget, seconds_of
from rotfem.commands.cost.exploration import Study
from rotfem.commands.cost.result import CostResult
from rotfem.commands.cost.settings import OUTPUTS, check_choice, default_output, sweep_speeds
from rotfem.errors import SceneError
from rotfem.listeners import Progress
from rotfem.scene import Scene, as_scene


def cost(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    quick: bool = False,
    accuracy: float = 1e-4,
    output: str | None = None,
    repeat: int = 3,
    budget: float | str | None = None,
    folder: str | Path | None = None,
    resume: bool = True,
    theories: Sequence[str] | None = None,
    elements: Sequence[int] | None = None,
    degrees: Sequence[int] | None = None,
    steps: Sequence[float] | None = None,
    schemes: Sequence[str] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
) -> CostResult:
    """Return errors and times of a grid of settings around the scene's own, and the cheapest for a wanted accuracy.

    Args:
        scene: scene, path of a scene file, or nested tables.
        quick: a small grid.
        accuracy: relative error, that of the model included, for which a setting is recommended.
        output: "tip" (displacements, relative to the largest), "frequencies" (eigenvalues, each relative to itself) or
            "campbell" (frequencies from rest to the scene's speed); by default what the scene computes.
        repeat: times each setting is computed that may be recommended; times are medians.
        budget: time the study may take in all, s, or text such as "2min"; two minutes for a quick one, else twenty.
        folder: where cost.jsonl keeps every finished measurement; None keeps nothing.
        resume: take from there what agrees in scene, setting and version; otherwise start afresh.
        theories: to try, instead of the default grid's.
        elements: likewise, numbers of elements.
        degrees: likewise, polynomial degrees.
        steps: likewise, time steps, s.
        schemes: likewise, time-stepping schemes.
        comm: MPI communicator.
        progress: called with the share of the settings done, between 0 and 1.

    Raises:
        SceneError: the scene, or a choice, is not valid.
        ComputationError: not one setting could be computed.
        OutputError: the folder cannot be written.
    """
    scene, output = checked(as_scene(scene), accuracy, repeat, output)
    seconds = (DEFAULT_QUICK if quick else DEFAULT_FULL) if budget is None else seconds_of(budget, scene.file)
    chosen = {"theories": theories, "elements": elements, "degrees": degrees, "steps": steps, "schemes": schemes}
    check_choice(scene, chosen)  # before anything is computed or kept
    study = Study(scene, output, repeat, Budget(seconds, comm), None if folder is None else Path(folder), resume)
    return study.run(quick, accuracy, chosen, progress or (lambda share: None))


def checked(scene: Scene, accuracy: float, repeat: int, output: str | None) -> tuple[Scene, str]:
    """Return the scene as it is studied, over all theories without its own choice, and the output that is compared.

    Raises:
        SceneError: what is asked for is not valid, or has no meaning for the scene.
    """
    if scene.model.tolerance is not None:
        scene = scene.replace({"model.tolerance": None})
    if not (np.isfinite(accuracy) and accuracy > 0):
        raise SceneError(scene.file, "cost --accuracy", accuracy, "must be a number greater than 0")
    if repeat < 1:
        raise SceneError(scene.file, "cost --repeat", repeat, "must be an integer at least 1")
    output = default_output(scene) if output is None else output
    if output not in OUTPUTS:
        raise SceneError(scene.file, "cost --of", output, f"allowed: {', '.join(OUTPUTS)}")
    if output == "tip":
        scene.check_run()
    if output == "campbell":
        sweep_speeds(scene)
    return scene, output
