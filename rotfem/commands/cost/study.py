"""`rotfem cost`: what accuracy costs in time, over theory, mesh, degree, step and scheme.

The reference is the last answer of a refinement in the richest theory (`rotfem.refinement.refine`). An answer u(h, n)
in steps h and n cells has the error

    |u(h, n) − u(rh, n)| + |u(h, n) − u(h, n/r)|,    r = √2,

at most, as r² − 1 = 1 is the least by which errors of order p ≥ 2 differ (Richardson); of adaptive steps the first
difference is divided by r² − 1, r the ratio of the numbers of steps, where that is less. It is refined until that is a
part of the accuracy. The error of a setting is the distance of its answer from
the reference. Settings are computed from the cheapest on, those first that may be within the accuracy: errors of
theory, mesh and steps add up, and each is no larger than the least error of a setting with this theory, mesh or steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite, log, nan
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem import registry
from rotfem.commands.cost.bench import Array, Bench, Measurement, Record, bytes_of, fingerprint
from rotfem.commands.cost.result import CostResult, Reference, pareto, recommend, recommendations
from rotfem.commands.cost.settings import (
    MESHES,
    Chosen,
    allowed_by,
    check_choice,
    checked,
    default_theories,
    grid,
    own_setting,
    parts_of,
    with_theory,
    without_choices,
)
from rotfem.commands.problem import Problem
from rotfem.equations.model import Model
from rotfem.errors import ComputationError, InputError, SceneError
from rotfem.listeners import Progress
from rotfem.mechanics.theories import ladder, richest
from rotfem.refinement.coarser import lengths
from rotfem.refinement.distance import distance, distance_each
from rotfem.refinement.refine import (
    AIM,
    COARSE,
    HIGHEST,
    RATIO,
    Clock,
    OverBudget,
    Refinement,
    Setting,
    grown,
    is_known,
    refine,
)
from rotfem.results.result import Row
from rotfem.scene import Scene, as_scene
from rotfem.units import seconds_of
from rotfem.version import versions


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
    scene = without_choices(as_scene(scene))
    output = checked(scene, accuracy, repeat, output)
    chosen = {"theories": theories, "elements": elements, "degrees": degrees, "steps": steps, "schemes": schemes}
    seconds = (120.0 if quick else 1200.0) if budget is None else seconds_of(budget, scene.file)
    check_choice(scene, chosen)
    for degree in degrees or () if scene.structure.mesh_file is not None else ():
        try:  # only the file says of what shape elements are
            Model(Problem.of(scene.replace({"mesh.degree": degree})).replace(effects=()), comm)
        except InputError as error:
            raise SceneError(scene.file, "cost --degrees", degree, error.allowed) from None
    path = None if folder is None or comm.rank > 0 else Path(folder) / "cost.jsonl"
    record = Record(path, fingerprint(scene, output, comm.size), fresh=not resume)
    study = Study(scene, output, chosen, repeat, Clock(seconds, comm, key="the budget"), record)
    return study.run(quick, accuracy, progress or (lambda share: None))


class Study:
    """One study: the reference, then the grid, then the best settings again.

    Args:
        scene: validated scene.
        output: one of OUTPUTS.
        chosen: lists that replace those of the grid.
        repeat: repetitions of every setting that may be recommended.
        clock: CPU time of all.
        record: what is measured already, of rank 0; keeps what follows.

    Attributes:
        measured: key of a setting ↦ the setting and what was measured of it.
        references: theory ↦ its reference.
        failures: theory ↦ why it has none.
        refused: settings that were not computed for want of time or memory.
        of_grid: keys of the settings that the grid has.
        new: keys of those that were not taken from the record.
    """

    def __init__(self, scene: Scene, output: str, chosen: Chosen, repeat: int, clock: Clock, record: Record):
        self.scene, self.output, self.chosen, self.repeat = scene, output, chosen, repeat
        self.clock, self.record, self.comm = clock, record, clock.comm
        record.found = self.comm.bcast(record.found)
        self.bench = Bench(scene.replace({"output.error": False}), output, self.comm)
        self.own = own_setting(scene, output)
        self.measured: dict[str, tuple[Setting, Measurement]] = {}
        self.references: dict[str, Reference] = {}
        self.failures: dict[str, str] = {}
        self.refused: dict[str, dict[str, Any]] = {}
        self.of_grid, self.new = set[str](), set[str]()

    def run(self, quick: bool, accuracy: float, progress: Progress) -> CostResult:
        """Return the result (see `cost`)."""
        self._refer(quick, accuracy, self.chosen["theories"] or default_theories(self.scene, quick))
        progress(0.4)
        step, time = self.own.step, self.scene.time
        if time is not None and self.own.tolerance is not None:  # the mean of its adaptive steps
            found = self.get(self.own, "grid")
            step = None if found is None or found.values is None else time.end / found.steps
        self._explore(grid(self.scene, self.output, quick, self.chosen, step), accuracy, progress)
        rows = self.rows()
        best = recommend(rows, accuracy, self.uncertainty)
        for row in sorted((row for row in rows if row["pareto"]), key=lambda row: row is not best):
            self.get(Setting.of(row), row["purpose"], self.repeat)  # timed as often as was asked for
        progress(1.0)
        rows = self.rows()
        self._check_computed(rows)
        return CostResult(self._summary(rows, accuracy, quick), rows, self.scene, self.references)

    def rows(self) -> list[Row]:
        """Return one row a setting that was measured.

        `error` is the distance from the reference of the same theory, `total_error` that from the richest theory's.
        That of a reference itself is its uncertainty. What a failed setting does not have is None.
        """
        truth, rows = self.truth, list[Row]()

        def error(reference: Reference | None, m: Measurement) -> float | None:
            if reference is None or m.values is None:
                return None
            return self.apart(reference.values, m.values) or reference.uncertainty

        for key, (setting, m) in self.measured.items():
            own = self.references.get(setting.theory)
            row = {
                "theory": setting.theory,
                "elements": list(setting.elements) if isinstance(setting.elements, tuple) else setting.elements,
                **{name: getattr(setting, name) for name in ("degree", "scheme", "step", "tolerance")},
                "purpose": "grid" if key in self.of_grid else "reference",
                "candidate": allowed_by(setting, self.chosen),
                "status": m.status,
                "error": error(own, m),
                "model_error": None if own is None or truth is None else self.apart(truth.values, own.values),
                "total_error": error(truth, m),
                "uncertainty": own.uncertainty if own else None,
                "cost": m.cost,
                "time": m.median("wall"),
                "cpu_time": m.median("cpu"),
                "time_min": min(m.wall, default=nan),
                "time_max": max(m.wall, default=nan),
                "setup": m.median("setup"),
                "setup_cpu": m.median("setup_cpu"),
                "memory": m.memory or None,
                "dofs": m.dofs or None,
                "steps": m.steps,
                "iterations": m.iterations,
                "repeats": len(m.wall),
                "pareto": False,
                "reason": m.reason,
            }
            rows.append(row)
        for row in pareto(rows):
            row["pareto"] = True
        return rows

    def apart(self, one: Array, other: Array) -> float:
        """Return the distance of two outputs, relative to the first; infinite where they cannot be compared."""
        if one.shape != other.shape:
            return inf
        return distance(one, other) if self.output == "tip" else distance_each(one, other)

    @property
    def truth(self) -> Reference | None:
        """Reference of the richest theory that has one, by which all settings are judged."""
        return next((self.references[name] for name in reversed(ladder()) if name in self.references), None)

    def _check_computed(self, rows: list[Row]) -> None:
        candidates = [row for row in rows if row["candidate"]]
        if not any(row["status"] == "done" for row in candidates):
            why = "the budget is too small"
            if candidates:
                why = f"{Setting.of(candidates[-1]).words()}: {candidates[-1]['reason']}"
            raise ComputationError(f"no setting could be computed ({why})")
        if self.output == "tip" and self.truth is not None and not np.any(self.truth.values):
            raise SceneError(self.scene.file, "cost --of", "tip", 'the tip does not move; try output "frequencies"')

    # --- what errors are measured against ----------------------------------------------------------------------------

    def _refer(self, quick: bool, accuracy: float, theories: Sequence[str]) -> None:
        """Make the reference of the richest theory, in half of the time, and compute the others in its setting."""
        whole = self.clock.budget
        assert whole is not None
        self.clock.budget = AIM * whole
        for theory in sorted({richest().name, *theories}, key=ladder().index, reverse=True):
            if self.truth is None:
                self._refine(theory, quick, accuracy)
                continue
            self.clock.budget, truth = whole, self.truth
            found = self.get(with_theory(truth.setting, theory), "reference")
            if found is None or found.values is None:
                self.failures[theory] = "the budget is too small for it" if found is None else found.reason
            else:
                parts = truth.parts | {"theory": self.apart(truth.values, found.values) * truth.uncertainty}
                self.references[theory] = Reference(found.values, parts, with_theory(truth.setting, theory))
        self.clock.budget = whole

    def _refine(self, theory: str, quick: bool, accuracy: float) -> None:
        """Make the reference of a theory by refinement."""
        first, found = with_theory(self.own, theory), Refinement[Array]()
        if first.elements is None:
            first = replace(first, degree=min(first.degree + 1, HIGHEST))
        else:
            first = replace(first, elements=grown(grown(first.elements, min(MESHES[quick])), 2.0))
        if first.moving:
            first = replace(first, scheme="esdirk4", tolerance=max(accuracy, COARSE), step=None)
        try:
            self.bench.compiled(first)  # so that the first answer shows what the next ones take
            refine(first, self._paired, AIM * accuracy, self.clock, found)
        except (ComputationError, InputError) as error:
            self.failures[theory] = str(error)
        if isinstance(found.failure, OverBudget):
            self.refused["reference"] = {"setting": {}, "why": found.failure.what, "time": None, "memory": None}
        if found.best is not None and is_known(found.best.error):
            parts = {name: float(found.best.error[name]) for name in ("time", "space") if name in found.best.error}
            self.references[theory] = Reference(found.best.result, parts, found.best.setting)
        elif found.best is not None:
            self.failures[theory] = "its error is unknown"

    def _paired(self, setting: Setting) -> tuple[Array, dict[str, float | None]]:
        """Return the output of a setting, and its errors by its differences from those of coarser ones.

        Unknown is that of steps which another tolerance does not change, and that of a mesh with cells that required
        nodes fix.
        """
        coarser = {name: self._computed(other) for name, other in setting.coarser().items()}
        here, error = self._computed(setting), dict[str, float | None]()
        for name in ("time", "space") if setting.moving else ("space",):
            there, error[name] = coarser.get(name), None
            if there is not None:
                sizes = RATIO if setting.elements is None else float(lengths(there.lines, here.lines).min())
                ratio = here.steps / there.steps if name == "time" else sizes
                if ratio > 1.0:
                    error[name] = self.apart(here.values, there.values) / min(1.0, ratio**2 - 1.0)
        known = [part for part in error.values() if part is not None]
        error["total"] = sum(known) if len(known) == len(error) else None
        return here.values, error if self.output == "tip" else {**error, "round_off": 0.0}

    def _computed(self, setting: Setting) -> Any:
        """Return the measurement of a setting.

        Raises:
            ComputationError: it failed, or was refused.
        """
        found = self.get(setting, "reference")
        if found is None or found.status == "stopped":
            raise OverBudget("the budget is too small for it" if found is None else found.reason)
        if found.values is None:
            raise ComputationError(found.reason)
        return found

    # --- the grid ----------------------------------------------------------------------------------------------------

    def _explore(self, settings: Sequence[Setting], accuracy: float, progress: Progress) -> None:
        """Compute the settings of a grid.

        Those come first that change the own one in one part, then those that may be within the accuracy, each the
        cheapest first.
        """
        left = [(setting, self.predicted(setting)["time"] or 0.0) for setting in settings]
        for number in range(len(settings)):
            least: dict[tuple[Any, ...], float] = {}
            for row in self.rows():
                error = row["total_error"]
                for part in parts_of(Setting.of(row)) if error is not None else ():
                    least[part] = min(error, least.get(part, inf))

            def rank(entry: tuple[Setting, float], least: Mapping[Any, float] = least) -> tuple[bool, bool, float]:
                parts = parts_of(entry[0])
                changes = sum(one != other for one, other in zip(parts, parts_of(self.own), strict=True))
                return changes > 1, sum(least.get(part, 0.0) for part in parts) > accuracy, entry[1]

            following = min(left, key=rank)
            left.remove(following)
            self.get(following[0], "grid")
            progress(0.4 + 0.5 * number / len(settings))

    @property
    def uncertainty(self) -> float:
        """How far what errors are measured against may be off; infinite where there is nothing."""
        return inf if self.truth is None else self.truth.uncertainty

    # --- measuring ---------------------------------------------------------------------------------------------------

    def get(self, setting: Setting, purpose: str, repeat: int = 1) -> Measurement | None:
        """Return the measurement of a setting, from the record where it has it; None where the budget refuses it.

        Args:
            setting: what is measured.
            purpose: "grid" or "reference".
            repeat: how often it is to be computed, in all.
        """
        key = setting.key()
        if purpose == "grid":
            self.of_grid.add(key)
        found = self.record.found.get(key)
        if found is None or (found.status == "done" and len(found.wall) < repeat):
            if not self._allows(setting):
                return None
            found = self.comm.bcast(self.bench.measure(setting, repeat, found, self.clock))
            self.new.add(key)
            if found.status != "stopped":
                self.record.put(key, found)
        self.measured[key] = setting, found
        return found

    def _allows(self, setting: Setting) -> bool:
        """Return whether a setting may be computed, in half of the time left besides a reference; note a refusal."""
        known, free = self.predicted(setting), self.comm.bcast(bytes_of("MemAvailable", "/proc/meminfo") or inf)
        time, memory = known["time"] or 0.0, known["memory"] or 0.0
        try:
            if memory > free:
                raise OverBudget(f"would need about {memory / 1e9:.2g} GB, {free / 1e9:.2g} GB are free")
            self.clock.begin(setting.words(), len(self.measured) + 1, time / (AIM if self.truth else 1.0))
        except OverBudget as error:
            self.refused.setdefault(setting.key(), {"setting": setting.summary(), "why": error.what, **known})
            return False
        return True

    def predicted(self, setting: Setting) -> dict[str, float | None]:
        """Return `time` (s, CPU, with set-up) and `memory` (bytes) that a setting takes, by the most similar one.

        Memory grows as n log n at most (nested dissection; George 1973).
        """
        done = [(s, m) for s, m in self.measured.values() if m.status == "done"]
        if not done:
            return {"time": None, "memory": None}

        def far(entry: tuple[Setting, Measurement]) -> tuple[bool, bool, float]:
            s, ratio = entry[0], self._work(setting, *entry) / self._work(entry[0], *entry)
            steps_differ = s.scheme != setting.scheme or (s.step is None) != (setting.step is None)
            return steps_differ, s.theory != setting.theory, abs(log(ratio))

        near, m = min(done, key=far)
        more = setting.unknowns() / near.unknowns()
        filled = more * max(1.0, 1.0 + log(more) / log(max(m.dofs, 3)))
        return {"time": m.cost * self._work(setting, near, m) / self._work(near, near, m), "memory": m.memory * filled}

    def _work(self, setting: Setting, near: Setting, found: Measurement) -> float:
        """Return what the time of a setting is proportional to, with the number of adaptive steps of a measured one."""
        if setting.scheme is None or near.scheme is None or self.scene.time is None:
            return setting.work()
        stages = registry.schemes[setting.scheme].stages
        steps = found.steps * (near.tolerance or 1.0) ** 0.25
        if setting.step is not None:
            steps = self.scene.time.end / setting.step
        return float(setting.work() * stages * steps)

    # --- what comes of it --------------------------------------------------------------------------------------------

    def _summary(self, rows: list[Row], accuracy: float, quick: bool) -> dict[str, Any]:
        """Return the summary of the study."""
        references, uncertainty, truth = self.references, self.uncertainty, self.truth
        refused, used, compiling, warnings = list(self.refused.values()), self.clock.used(), self.bench.compiling, []
        if richest().name not in references:
            reason = self.failures.get(richest().name, "")
            warnings.append(f"no reference of {richest().name} ({reason}): errors do not include that of the model")
        if isfinite(uncertainty) and uncertainty > AIM * accuracy:
            warnings.append(f"the reference is known to {uncertainty:.1e}: errors near that are not resolved")
        return {
            "command": "cost",
            "status": "done",
            "name": self.scene.name,
            "output": self.output,
            "quick": quick,
            "accuracy": accuracy,
            "truth": None if truth is None else truth.setting.theory,
            "uncertainty": None if truth is None else uncertainty,
            "references": {
                name: {"uncertainty": r.uncertainty, "parts": r.parts, "setting": r.setting.summary()}
                for name, r in references.items()
            },
            "reference_failures": self.failures,
            "model_errors": {t: self.apart(truth.values, r.values) for t, r in references.items() if truth is not None},
            **recommendations(rows, accuracy, uncertainty, refused),
            "settings": len(rows),
            "failed": sum(row["status"] == "failed" for row in rows),
            "measured": len(self.new),
            "resumed": len(rows) - len(self.new),
            "budget": {"seconds": self.clock.budget, "used": used, "refused": refused},
            "timings": {"compile": compiling, "other": used - compiling, "total": used},
            "warnings": warnings,
            "versions": versions(),
            "ranks": self.comm.size,
            "scene": self.scene.digest(),
        }
