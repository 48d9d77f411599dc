"""The summaries of all commands: what they have in common, and that of a run."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.modal import ModalAnalysis
from rotfem.results.columns import figures
from rotfem.scene import Scene
from rotfem.selection.model_choice import Choice
from rotfem.version import versions

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation


def summary(command: str, scene: Scene, comm: MPI.Comm, choice: Choice | None = None) -> dict[str, Any]:
    """Return what every summary has.

    Args:
        command: the verb.
        scene: the scene as it was given; the model may have been chosen by its tolerance.
        comm: MPI communicator.
        choice: how it was, if so.
    """
    out: dict[str, Any] = {"command": command, "status": "done", "name": scene.name}
    out |= {"versions": versions(), "ranks": comm.size, "scene": scene.digest()}
    return out if choice is None else {**out, "choice": choice.summary()}


def timings(parts: Mapping[str, float], started: float, before: Mapping[str, float] | None = None) -> dict[str, float]:
    """Return the parts (s) of a computation, the rest of it since it started, and the total with what was before."""
    before = before or {}
    total = perf_counter() - started + sum(before.values())
    named = {**before, **parts}
    return {**named, "other": total - sum(named.values()), "total": total}


def modal_summary(
    command: str, analysis: ModalAnalysis, scene: Scene, choice: Choice | None, started: float
) -> dict[str, Any]:
    """Return what the summaries of modes and Campbell diagrams have in common (see `summary`).

    Args:
        command: the verb.
        analysis: what was solved.
        scene: the scene as it was given.
        choice: how its model was chosen, if it was.
        started: `perf_counter()` at the start.
    """
    space = analysis.system.V.dofmap
    return {
        **summary(command, scene, analysis.comm, choice),
        "theory": analysis.problem.theory.name,
        "about": "undeformed" if analysis.system.linear else analysis.about,
        "effects": list(analysis.model.effects),
        "dofs": space.index_map.size_global * space.index_map_bs,
        "timings": timings(analysis.seconds, started),
    }


def run_summary(run: Simulation, status: str, history: dict[str, npt.NDArray[np.float64]]) -> dict[str, Any]:
    """Return the summary of a run.

    Args:
        run: what was computed.
        status: "done", "failed" or "interrupted".
        history: its rows.
    """
    system, stepper, choice = run.system, run.stepper, run.choice
    space, mesh = system.V.dofmap, system.structure.mesh
    parts = {"compile": run.compiled, **(system.seconds if stepper else {})}
    if run.reduced is not None:
        parts["reduce"] = run.reduced.seconds["wall"]
    before = {} if choice is None or run.resumed else {"choice": choice.seconds}
    before |= {"before": run.elapsed} if run.resumed else {}
    out = {
        **summary("run", run.scene, run.comm, choice),
        "status": status,
        "kind": "steady" if run.scene.time is None else "history",
        "theory": run.problem.theory.name,
        "frame": run.problem.frame,
        "effects": list(system.model.effects),
        "integrals": system.integrals,
        "dofs": space.index_map.size_global * space.index_map_bs,
        "elements": mesh.topology.index_map(mesh.topology.dim).size_global,
        "steps": run.steps,
        "newton_iterations": run.iteration.iterations,
        "factorisations": system.factorisations if stepper else run.iteration.iterations,
        "timings": timings(parts, run.started, before),
        "figures": figures(history),
        "warnings": run.warnings,
        "advice": run.advice,
        "root": {"place": [float(c) for c in system.root.place]},
    }
    if run.scene.time is None and len(history["t"]):
        out["root"] |= {name: float(x[-1]) for name, x in history.items() if name.startswith("root_")}
    if run.critical is not None:
        out["figures"]["critical_speed"] = run.critical
    return out | _told(run)


def _told(run: Simulation) -> dict[str, Any]:
    """Return what a summary says of a run only where there is something to be said."""
    parts = {
        "stress": run.record.resultants,
        "reduced": run.reduced,
        "error": run.error,
        "theory_error": run.theory_error,
        "stability": run.stability,
    }
    out: dict[str, Any] = {name: part.summary() for name, part in parts.items() if part is not None}
    if run.foreshortened is not None:
        out["reduced"]["foreshortening"] = run.foreshortened.summary()
    if run.resumed:
        out["resumed"] = run.resumed
    if run.stepper is not None and run.stepper.rejected:
        out["rejected_steps"] = run.stepper.rejected
    if run.problem.inactive:
        why = "structure, loads and spin are symmetric, so that nothing moves them"
        out["left_out"] = {"unknowns": list(run.problem.inactive), "why": why}
    return out
