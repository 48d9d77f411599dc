"""`rotfem cost`: what accuracy costs in time, over theory, mesh, degree, step and scheme."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import ceil, inf, log2
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem import registry
from rotfem.commands.cost.bench import check_degrees
from rotfem.commands.cost.budget import DEFAULT_FULL, DEFAULT_QUICK, Budget, seconds_of
from rotfem.commands.cost.laboratory import Laboratory
from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import Refinement, distance, paired
from rotfem.commands.cost.result import (
    CostResult,
    References,
    Row,
    describe,
    recommend,
    rows_of,
    setting_of,
    study_summary,
    truth_of,
)
from rotfem.commands.cost.settings import (
    OUTPUTS,
    Setting,
    cells,
    check_choice,
    count,
    default_output,
    grid,
    own_setting,
    remeshed,
    restepped,
    sample_interval,
    samples_every,
    scheme_of,
    sweep_speeds,
    unique,
)
from rotfem.errors import ComputationError, SceneError
from rotfem.listeners import Progress
from rotfem.mechanics.theories import ladder, richest
from rotfem.scene import Scene, as_scene

#: Name of the file that keeps what has been measured.
RECORD = "cost.jsonl"

#: What a setting does not have outside a history.
STILL: dict[str, Any] = {"scheme": None, "step": None, "tolerance": None, "every": 1}

#: Part of the accuracy that the error of references may be: the rest is left to the settings that are judged by them.
CERTAIN = 1 / 4

#: Uncertainty (relative) below which no reference is refined: the increments at which Newton stops are not far below.
LEAST_GOAL = 1e-8

#: Steps too long for a scheme that are halved before it is given up.
MOST_FAILURES = 3


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
        progress: called with the share of the work done, between 0 and 1.

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


class Study:
    """One work–precision study: references, the search for the cheapest setting, then the rest of the grid.

    Args:
        scene: validated scene.
        output: one of OUTPUTS.
        repeat: repetitions of every setting that may be recommended.
        budget: time and memory.
        folder: where the record is kept, or None.
        resume: whether to go on with the record that is there.
    """

    def __init__(self, scene: Scene, output: str, repeat: int, budget: Budget, folder: Path | None, resume: bool):
        self.scene, self.output, self.repeat, self.budget = scene, output, repeat, budget
        self.each = output != "tip"
        self.laboratory = Laboratory(scene, output, budget, None if folder is None else folder / RECORD, resume)
        self.own = own_setting(scene) if output == "tip" else replace(own_setting(scene), **STILL)
        self.references: References = {}
        self.failures: dict[str, str] = {}
        self.chosen: Mapping[str, Sequence[Any] | None] = {}
        self.interval = self.goal = 0.0
        self.outlook: dict[str, Any] | None = None

    def run(
        self, quick: bool, accuracy: float, chosen: Mapping[str, Sequence[Any] | None], progress: Progress
    ) -> CostResult:
        """Return the result (see `cost`)."""
        self.chosen, self.goal = chosen, accuracy
        base = self.base_step()
        settings = grid(self.scene, self.output, quick, base, chosen)
        check_degrees(self.scene, chosen.get("degrees") or (), self.laboratory.comm)
        self.interval = 0.0 if base is None else sample_interval(self.scene, base)
        self._refer(settings, max(CERTAIN * accuracy, LEAST_GOAL))
        progress(0.4)
        if self.own in settings:
            self.laboratory.get(self.own, "grid")
        self._search(settings, accuracy)
        progress(0.6)
        self._repeat(accuracy)
        for i, setting in enumerate(sorted(settings, key=lambda s: self.laboratory.prediction.of(s)["cpu"] or 0.0)):
            self.laboratory.get(setting, "grid")
            progress(0.7 + 0.3 * i / len(settings))
        self._check_computed()
        progress(1.0)
        rows = self.rows()
        return CostResult(study_summary(self, rows, accuracy, quick), rows, self.scene, self.references)

    def _check_computed(self) -> None:
        rows = [row for row in self.rows() if row["candidate"]]
        if not any(row["status"] == "done" for row in rows):
            row = rows[-1] if rows else None
            why = "the budget is too small" if row is None else f"{describe(row)}: {row['reason']}"
            raise ComputationError(f"no setting could be computed ({why})")
        truth = truth_of(self.references)
        if not self.each and truth is not None and not np.any(self.references[truth].samples.values):
            raise SceneError(self.scene.file, "cost --of", "tip", 'the tip does not move; try output "frequencies"')

    def rows(self) -> list[Row]:
        """Return one row a setting that was measured."""
        return rows_of(self.laboratory.measured, self.references, self.each, self.chosen.get("theories"))

    @property
    def uncertainty(self) -> float:
        """How far what errors are measured against may be off; infinite where there is nothing."""
        truth = truth_of(self.references)
        return inf if truth is None else self.references[truth].uncertainty

    # --- what errors are measured against ----------------------------------------------------------------------------

    def _refer(self, settings: Sequence[Setting], goal: float) -> None:
        """Make the reference of the richest theory, and those of the others from their difference at one setting."""
        mesh = min((s for s in settings), key=lambda s: (cells(s.elements), -s.degree))
        base = replace(self.own, elements=mesh.elements, degree=max(s.degree for s in settings))
        theories = unique([richest().name, *(s.theory for s in settings)])
        for theory in sorted(theories, key=ladder().index, reverse=True):
            truth = truth_of(self.references)
            if truth is None:
                self._refine(replace(base, theory=theory), settings, goal)
                continue
            known = self.references[truth]
            there, here = (self._measured(replace(known.setting, theory=t)) for t in (theory, truth))
            if there is not None and there.samples is not None and here is not None and here.samples is not None:
                self.references[theory] = paired(known, there.samples, here.samples, self.each)
            else:
                self.failures[theory] = "the budget is too small for it" if there is None else there.reason

    def _measured(self, setting: Setting) -> Measurement | None:
        return self.laboratory.get(setting, "reference")

    def _refine(self, base: Setting, settings: Sequence[Setting], goal: float) -> None:
        """Make the reference of a theory by refinement, steps on the coarsest mesh first."""

        def finer_mesh(setting: Setting) -> Setting | None:
            return remeshed(setting, 2.0)

        moves: dict[str, Callable[[Setting], Setting | None]] = {"mesh": finer_mesh}
        start: Setting | None = base
        if base.scheme is not None:
            moves["time"] = self._finer_step
            start = self._race(base, settings, goal)
        samples = None if start is None else self._measured(start)
        if start is None or samples is None or samples.samples is None:
            at_fault = samples or self.laboratory.measured.get(base, ("", None))[1]
            self.failures[base.theory] = "the budget is too small for it" if at_fault is None else at_fault.reason
            return

        def get(setting: Setting) -> Any:
            found = self._measured(setting)
            return None if found is None else found.samples

        refinement = Refinement(get, start, moves, self.each)
        before = restepped(start, 2.0, self.interval)
        if before in self.laboratory.measured:  # of the race, so that the order of the scheme can be observed
            refinement.differences["time"] = [(before, self._apart(before, start))]
        found = refinement.reference(goal)
        if found is None:
            self.failures[base.theory] = "the budget is too small for it"
        else:
            self.references[base.theory] = found

    def _finer_step(self, setting: Setting) -> Setting | None:
        return restepped(setting, 0.5, self.interval)

    def _race(self, base: Setting, settings: Sequence[Setting], goal: float) -> Setting | None:
        """Return the step and scheme whose next halving changes the output by a goal at most, soonest reached.

        All schemes start with the longest step of the grid. The one goes on that promises to get there first: a halving
        takes twice the iterations, and the difference falls with the order of the scheme. Times, which scatter, decide
        nothing here.
        """
        steps = unique([s.step for s in settings if s.step is not None]) or [self.base_step() or 0.0]
        shared = [h for h in steps if abs(log2(self.interval / h) - round(log2(self.interval / h))) < 1e-6] or steps
        first = replace(base, step=max(shared), tolerance=None, every=samples_every(self.interval, max(shared)))
        able: dict[Setting, float] = {}
        for scheme in self.chosen.get("schemes") or registry.schemes.names:
            setting: Setting | None = replace(first, scheme=scheme)
            for _ in range(MOST_FAILURES):
                promise = None if setting is None else self._promise(setting, goal)
                if setting is not None and promise is not None:
                    able[setting] = promise
                    break
                setting = None if setting is None else self._finer_step(setting)
        while able:
            setting = min(able, key=lambda s: able[s])
            finer = self._finer_step(setting)
            assert finer is not None
            if self._apart(setting, finer) <= goal / 2:  # the other half is the mesh's
                return setting
            promise = self._promise(finer, goal)
            if promise is None and len(able) == 1:
                return setting  # as far as it goes
            del able[setting]
            if promise is not None:
                able[finer] = promise
        return None

    def _promise(self, setting: Setting, goal: float) -> float | None:
        """Return about how many Newton iterations a scheme takes to a goal; None where it cannot be computed."""
        finer = self._finer_step(setting)
        assert finer is not None
        apart = self._apart(setting, finer)
        if apart == inf:
            return None
        further = ceil(log2(apart / goal) / scheme_of(setting).order) if apart > goal else 0
        return self.laboratory.measured[finer][1].iterations * 2.0**further

    def _apart(self, one: Setting, other: Setting) -> float:
        """Return the distance of the outputs of two settings; infinite where one is not to be had."""
        here, there = self._measured(one), self._measured(other)
        if here is None or here.samples is None or there is None or there.samples is None:
            return inf
        return distance(here.samples, there.samples, self.each)

    # --- what is tried -----------------------------------------------------------------------------------------------

    def _search(self, settings: Sequence[Setting], accuracy: float) -> None:
        """Compute what should be the cheapest setting within an accuracy until none cheaper is in sight."""
        while True:
            found = self._candidate(settings, accuracy)
            best = recommend(self.rows(), accuracy, self.uncertainty)
            if found is None or (best is not None and found[1] >= best["cost"]):
                return
            if self.laboratory.get(found[0], "proposal") is None:
                if best is None:
                    used = self.budget.seconds - self.budget.left()
                    self.outlook = {"setting": found[0].key(), "cost": found[1], "budget": used + 2 * found[1]}
                return

    def _candidate(self, settings: Sequence[Setting], accuracy: float) -> tuple[Setting, float] | None:
        """Return the setting not yet computed, and its predicted cost, that is the cheapest expected to be good enough.

        Errors of theory, steps and mesh add up at most. That of steps is no more than the least error of any setting
        with these steps, and so is that of a mesh; next to these they change with the order of the method.
        """
        rows = [row for row in self.rows() if row["status"] == "done" and row["error"] is not None]
        models = {t: row["model_error"] for row in rows if (t := row["theory"]) in (self.chosen.get("theories") or [t])}
        ways = self._errors(rows, ("scheme", "step", "tolerance", "every"), self._other_ways, settings)
        meshes = self._errors(rows, ("elements", "degree"), self._other_meshes, settings)
        best: tuple[Setting, float] | None = None
        for theory, model in models.items():
            for way, time in ways.items():
                for mesh, space in meshes.items():
                    setting = Setting(theory, mesh[0], mesh[1], *way)
                    if setting in self.laboratory.measured or not model + time + space + self.uncertainty <= accuracy:
                        continue
                    price = self.laboratory.prediction.of(setting)["cpu"]
                    if price is not None and (best is None or price < best[1]):
                        best = setting, price
        return best

    def _errors(
        self,
        rows: Sequence[Row],
        names: Sequence[str],
        others: Callable[[Setting, float], list[tuple[Setting, float]]],
        settings: Sequence[Setting],
    ) -> dict[tuple[Any, ...], float]:
        """Return values of some keys of settings ↦ error that they cause at most: as measured, and of the next ones.

        Args:
            rows: of settings that were computed.
            names: of the keys.
            others: (setting, error) ↦ its neighbours in these keys and their errors.
            settings: of the grid, to which they are bound where the user has chosen them.
        """
        found: dict[tuple[Any, ...], tuple[Setting, float]] = {}

        def note(setting: Setting, error: float) -> None:
            key = tuple(getattr(setting, name) for name in names)
            if key not in found or error < found[key][1]:
                found[key] = setting, error

        for row in rows:
            note(setting_of(row), row["error"])
        for setting, error in list(found.values()):
            for other, other_error in others(setting, error):
                if tuple(getattr(other, name) for name in names) not in found:
                    note(other, other_error)
        fixed = {"step": "steps", "elements": "elements"}
        for name, option in fixed.items():
            if name in names and self.chosen.get(option):
                allowed = {getattr(s, name) for s in settings}
                found = {key: value for key, value in found.items() if key[names.index(name)] in allowed}
        return {key: error for key, (_, error) in found.items()}

    def _other_ways(self, setting: Setting, error: float) -> list[tuple[Setting, float]]:
        """Return a setting with half and twice its step, and the error of each by the order of the scheme.

        A tolerance is a relative error: none above the accuracy is of use.
        """
        scheme = scheme_of(setting)
        power = 0 if scheme is None else scheme.order if setting.step is not None else 1
        found = [(restepped(setting, factor, self.interval), error * factor**power) for factor in (0.5, 2.0)]
        end = self.scene.time.end if self.scene.time is not None else 0.0
        return [
            (s, e) for s, e in found if s is not None and (s.step or 0.0) <= end and (s.tolerance or 0.0) <= self.goal
        ]

    def _other_meshes(self, setting: Setting, error: float) -> list[tuple[Setting, float]]:
        """Return a setting on the next coarser and finer mesh, with errors of order k + 1, of eigenvalues 2k.

        Strang & Fix, "An Analysis of the Finite Element Method", 1973, sections 3.2 and 6.3.
        """
        power = 2 * setting.degree if self.each else setting.degree + 1
        found = [(remeshed(setting, factor), factor) for factor in (0.5, 2.0)]
        return [(s, error * factor**-power) for s, factor in found if s is not None and count(s) > setting.degree]

    def _repeat(self, accuracy: float) -> None:
        """Time the recommended setting and the front as often as was asked for."""
        rows = self.rows()
        best = recommend(rows, accuracy, self.uncertainty)
        for row in [*([best] if best is not None else []), *(row for row in rows if row["pareto"])]:
            self.laboratory.get(setting_of(row), row["purpose"], self.repeat)

    # --- the scene ---------------------------------------------------------------------------------------------------

    def base_step(self) -> float | None:
        """Return the fixed step (s) around which steps are tried: the scene's own, or the mean of its adaptive ones.

        Raises:
            ComputationError: the scene as it is cannot be computed, so that the mean step is not known.
        """
        time = self.scene.time
        if self.output != "tip" or time is None:
            return None
        if time.step is not None:
            return time.step
        pilot = self.laboratory.get(self.own, "grid")
        if pilot is None or pilot.status != "done":
            why = "" if pilot is None else f": {pilot.reason}"
            raise ComputationError(f"the scene as it is failed, so that no grid can be made around it{why}")
        return time.end / pilot.steps
