"""`rotfem run`: the steady state or the time history of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady
from rotfem.commands.accuracy import ROOT_MOMENT, changes_of, first_setting, refuse, to_accuracy, within_tolerance
from rotfem.commands.error_report import check_rotations
from rotfem.commands.problem import Problem
from rotfem.commands.result_folder import ResultFolder
from rotfem.commands.run_store import Interval, RunStore
from rotfem.commands.simulation import Simulation
from rotfem.errors import ComputationError, Stopped, input_of
from rotfem.listeners import Hint, Progress, silent
from rotfem.mechanics.effects import Work
from rotfem.mechanics.problem import Functional
from rotfem.refinement.refine import Clock, Setting
from rotfem.results.run import RunResult
from rotfem.scene import Scene, as_scene


def run(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
    hint: Hint | None = silent,
    terms: Mapping[str, Work] | None = None,
    outputs: Mapping[str, Functional] | None = None,
    folder: str | Path | None = None,
    checkpoint: str | int | None = None,
    resume: bool = False,
) -> RunResult:
    """Return the time history of a scene, or its steady state where the spin is constant and [time] absent.

    Args:
        scene: scene, path of a scene file, or nested tables.
        comm: communicator the structure is distributed over; every rank gets the whole result.
        progress: called with the share of the work done, between 0 and 1.
        hint: called with every line of advice before the computation starts, and on attempts at an accuracy that take
            long; None asks for none.
        terms: further terms of the residual by name, (mechanics, variation) ↦ UFL form (see `rotfem.Effect`).
        outputs: functionals to record, by name, mechanics ↦ UFL form; columns of the history.
        folder: where the results go, the history as it grows, all of them but figures at the end; None writes nothing.
        checkpoint: how often checkpoints are written there: after "30s", or after 500 steps; never if None.
        resume: go on from the checkpoint that is there.

    Raises:
        SceneError: the scene is not valid or cannot be run, or a checkpoint that is none of this run.
        ComputationError: it failed; its attribute `result` holds what was computed until then.
        OutputError: the folder cannot be written.
    """
    scene = as_scene(scene)
    every = None if checkpoint is None else Interval.of(checkpoint)
    if folder is None:
        return simulate(scene, RunStore(comm, None, every, resume), progress, hint, terms, outputs)
    with ResultFolder(comm, Path(folder), "run", scene.inputs) as results:
        try:
            done = simulate(scene, RunStore(comm, results, every, resume), progress, hint, terms, outputs)
        except (ComputationError, Stopped) as error:
            if error.result is not None:
                results.write(error.result, plots=False)
            raise
        problems = results.write(done, plots=False)
        if problems:
            raise problems[0]
        return done


def simulate(
    scene: Scene,
    store: RunStore,
    progress: Progress | None,
    hint: Hint | None,
    terms: Mapping[str, Work] | None = None,
    outputs: Mapping[str, Functional] | None = None,
) -> RunResult:
    """Return the result of a scene (see `run`), with what is kept of it on disk while it goes on.

    Raises:
        Missed: its accuracy, or its model.tolerance with model.on_exceed = "stop", was not met.
        ComputationError: the richest model failed.
    """
    comm, clock = store.comm, Clock(scene.accuracy_budget, store.comm, hint)
    scene.check_run()
    store.open(scene, terms or {}, outputs or {})

    def compute(setting: Setting | None = None) -> RunResult:
        variant = scene if setting is None else scene.replace(changes_of(scene, setting))
        problem = Problem.of(variant, terms=terms, outputs=outputs)
        simulation = Simulation(variant, problem, store, setting, clock)
        if scene.accuracy is None:
            simulation.advise(hint)
        elif setting is not None and setting.reduced:
            check_rotations(variant, simulation.system)
        return simulation.run(progress)

    with input_of(scene.file):
        if scene.time is None:
            check_steady(Problem.of(scene, terms=terms, outputs=outputs))
        if scene.accuracy is not None:
            refuse(scene, ("tip", ROOT_MOMENT), "run")
            return to_accuracy(scene, store.setting() or first_setting(scene), compute, clock)
        if scene.model.tolerance is not None:
            return within_tolerance(scene, compute, comm, store.setting())
        return compute()
