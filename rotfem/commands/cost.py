"""`rotfem cost`: what accuracy costs in time, over theories, meshes, steps and schemes (`rotfem.accuracy.cost`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem import registry
from rotfem.accuracy.answer import Answers
from rotfem.accuracy.cost import ERRORS, CostResult, Study, recommendations
from rotfem.accuracy.ladder import Clock
from rotfem.analysis.equilibrium import check_steady
from rotfem.commands.answers import in_own_setting
from rotfem.commands.interrupts import together
from rotfem.commands.modes import analysis_of
from rotfem.commands.problem import Problem, motion_of
from rotfem.commands.processes import summary
from rotfem.commands.run import Simulation, rows_of
from rotfem.commands.run_store import RunStore
from rotfem.errors import ComputationError, SceneError, Stopped, input_of
from rotfem.listeners import Progress
from rotfem.mechanics.theories import Theory
from rotfem.mechanics.theories import theories as all_theories
from rotfem.results.distance import Spectrum
from rotfem.scene import Scene, as_scene
from rotfem.units import seconds_of

#: Speeds of a Campbell diagram that is studied.
SPEEDS = 9


def cost(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    quick: bool = False,
    accuracy: float = 1e-4,
    output: str | None = None,
    budget: float | str | None = None,
    theories: Sequence[str] | None = None,
    schemes: Sequence[str] | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
) -> CostResult:
    """Return errors and times down the ladders of a scene, and the cheapest setting for a wanted accuracy.

    Args:
        scene: scene, path of a scene file, or nested tables.
        quick: few theories, and the scheme of the reference and the scene's own.
        accuracy: relative error, that of the model included, for which a setting is recommended.
        output: "tip" (displacements, relative to the largest), "frequencies" (eigenvalues, each relative to itself) or
            "campbell" (eigenvalues at nine speeds from rest to the scene's); by default what the scene computes.
        budget: CPU time of the study, s, or text such as "2min"; two minutes for a quick one, else twenty.
        theories: to try, instead of those that the structure has.
        schemes: time-stepping schemes to try, instead of all.
        comm: MPI communicator.
        progress: called with the share of the work done, between 0 and 1.

    Raises:
        SceneError: the scene, or a choice, is not valid.
        ComputationError: not one setting could be computed.
        Stopped: it was interrupted; its attribute `result` holds what was measured.
    """
    scene = in_own_setting(as_scene(scene))
    output = checked(scene, accuracy, output)
    seconds = (120.0 if quick else 1200.0) if budget is None else seconds_of(budget, scene.file)
    names = chosen(scene, "theories", theories, [t.name for t in theories_of(scene, quick)])
    order = [t.name for t in all_theories()]
    wanted = sorted({*names, richest(scene)}, key=order.index)
    ways = chosen(scene, "schemes", schemes, schemes_of(scene, quick))

    def agree(x: float) -> float:
        return float(comm.bcast(x))

    def fresh() -> Answers:
        out = Answers(scene, compute, moving=output == "tip")
        out.times = rows_of(scene) if output == "tip" else None
        return out

    def compute(variant: Scene, times: Any) -> Any:
        if output == "tip":
            return Simulation(variant, Problem.of(variant), RunStore(comm), clock, times).compute()
        return eigenvalues(variant, output, comm)

    clock = Clock(seconds, agree, key="the budget")
    study = Study(fresh, accuracy, clock, agree, progress or (lambda share: None))

    def result(status: str) -> CostResult:
        rows, known = study.rows(), study.known
        candidates = [row for row in rows if row["theory"] in names]
        reference = study.reference
        found: dict[str, Any] = {
            **summary("cost", scene, comm),
            "status": status,
            "output": output,
            "quick": quick,
            "accuracy": accuracy,
            "reference": None if reference is None else reference.setting.words(),
            "uncertainty": known if isfinite(known) else None,
            "model_errors": study.model_errors(),
            **recommendations(candidates, accuracy, known),
            "settings": len(rows),
            "budget": {"seconds": seconds, "used": clock.used(), "refused": study.refused},
            "timings": {"total": clock.used()},
            "warnings": [] if reference is None or isfinite(known) else ["the error of the reference is unknown"],
        }
        return CostResult(found, rows, scene)

    with input_of(scene.file):
        try:
            study.climb(wanted, ["esdirk4", *(way for way in ways if way != "esdirk4")])
        except KeyboardInterrupt as stop:
            if study.reference is None or not together(comm, stop):
                raise
            raise Stopped(result("interrupted")) from stop
    if study.reference is None:
        reasons = [m.reason for m in study.measured.values() if m.reason] or [r["why"] for r in study.refused]
        raise ComputationError(f"no setting could be computed ({reasons[-1] if reasons else 'nothing was tried'})")
    if not study.reference.output.scale:
        raise SceneError(scene.file, "cost --of", output, 'nothing moves; try output "frequencies"')
    return result("done")


@dataclass
class Eigenvalues:
    """An outcome that is the eigenvalues at some speeds, by size at each."""

    output: Spectrum
    steps: int = 0
    stable: bool | None = None
    round_off: float | None = None

    def result(self) -> Spectrum:
        """Return the eigenvalues, which is all there is."""
        return self.output


def eigenvalues(variant: Scene, output: str, comm: MPI.Comm) -> Eigenvalues:
    """Return the eigenvalues of a scene at its final speed, or at those of a Campbell diagram."""
    problem, top = Problem.of(variant), None if variant.time is None else variant.time.end
    speeds = [problem.motion.final_speed(top or 0.0)]
    if output == "campbell":
        speeds = [motion_of(variant).top_speed(top) * i / (SPEEDS - 1) for i in range(SPEEDS)]
        problem = problem.spinning()
    analysis, count = analysis_of(variant, problem, comm), variant.modes.count
    return Eigenvalues(Spectrum(np.concatenate([analysis.at(s, count).pairs.values[:count] for s in speeds])))


# --- what is tried ----------------------------------------------------------------------------------------------------


def checked(scene: Scene, accuracy: float, output: str | None) -> str:
    """Return the output that is compared."""
    if not 0 < accuracy < inf:
        raise SceneError(scene.file, "cost --accuracy", accuracy, "must be a number greater than 0")
    if output is None:  # what the scene computes
        steady = scene.motion.is_steady and not scene.modes.model_fields_set
        at_rest = not (motion_of(scene).is_spinning or scene.loads.model_fields_set)
        output = "frequencies" if scene.time is None and (at_rest or not steady) else "tip"
    if output not in ERRORS:
        raise SceneError(scene.file, "cost --of", output, f"allowed: {', '.join(ERRORS)}")
    if output == "tip":
        scene.check_run()
        if scene.time is None:
            check_steady(Problem.of(scene))
    if output == "campbell" and not motion_of(scene).top_speed(None if scene.time is None else scene.time.end) > 0.0:
        raise SceneError(scene.file, "cost --of", "campbell", "the scene has no speed to go up to")
    return output


def theories_of(scene: Scene, quick: bool) -> list[Theory]:
    """Return the theories that the scene allows, few of them for a quick study, poorest first."""
    own = scene.model.theory
    if scene.model.frame == "inertial":
        return [theory for theory in all_theories() if theory.name == own]
    there = [theory for theory in all_theories() if theory.holds_for(scene.structure.type)]
    return [theory for theory in there if not quick or theory.quick or theory.name == own]


def richest(scene: Scene) -> str:
    """Return the richest theory that a scene allows."""
    return theories_of(scene, False)[-1].name


def schemes_of(scene: Scene, quick: bool) -> list[str]:
    """Return the schemes that are tried; none outside histories."""
    if scene.time is None:
        return []
    return [name for name in registry.schemes.names if not quick or name in ("esdirk4", scene.time.scheme)]


def chosen(scene: Scene, option: str, given: Sequence[str] | None, default: list[str]) -> list[str]:
    """Return names that were given, or the default ones."""
    key = {"theories": "model.theory", "schemes": "time.scheme"}[option]
    if given and option == "schemes" and scene.time is None:
        raise SceneError(scene.file, "time", None, "missing; schemes have a meaning only with [time]")
    for name in given or ():
        parameters = {} if scene.time is None else {f"time.{p}": None for p in scene.time.parameters}
        try:
            scene.replace({key: name, "model.prestress": None, **(parameters if option == "schemes" else {})})
        except SceneError as error:
            raise SceneError(scene.file, f"cost --{option}", name, error.allowed) from None
    return list(given or default)
