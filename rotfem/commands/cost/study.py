"""`rotfem cost`: what accuracy costs in time, over theory, mesh, degree, step and scheme.

The error of a setting is its distance to the converged output of the same theory, found by refinement with an
uncertainty of its own; what the theory itself misses is the distance of its converged output from the exact one's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.cost.bench import Bench
from rotfem.commands.cost.front import describe, model_errors, recommend, rows_of
from rotfem.commands.cost.record import Measurement, Record, fingerprint
from rotfem.commands.cost.reference import Reference, reference
from rotfem.commands.cost.result import CostResult
from rotfem.commands.cost.settings import (
    OUTPUTS,
    Setting,
    default_output,
    grid,
    own_setting,
    reference_settings,
    sample_interval,
    unique,
)
from rotfem.commands.problem import Problem
from rotfem.equations.model import Model
from rotfem.errors import ComputationError, InputError, SceneError
from rotfem.listeners import Progress
from rotfem.mechanics.theories import richest
from rotfem.scene import Scene, as_scene
from rotfem.version import versions

#: Name of the file that keeps what has been measured.
RECORD = "cost.jsonl"

#: Uncertainties below this are not worth a warning.
ROUND_OFF = 1e-9

#: Accuracies a setting is recommended for besides the wanted one.
DECADES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def cost(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    quick: bool = False,
    accuracy: float = 1e-4,
    output: str | None = None,
    repeat: int = 3,
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
        output: "tip" (displacements, relative to the largest) or "frequencies" (eigenvalues, each relative to itself);
            by default what the scene computes.
        repeat: times each setting is computed; times are medians.
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
    scene = as_scene(scene)
    if scene.model.tolerance is not None:  # the study chooses by itself, over all theories
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
    chosen = {"theories": theories, "elements": elements, "degrees": degrees, "steps": steps, "schemes": schemes}
    study = Study(scene, output, repeat, comm, None if folder is None else Path(folder), resume)
    return study.run(quick, accuracy, chosen, progress or (lambda share: None))


class Study:
    """One work–precision study.

    Args:
        scene: validated scene.
        output: "tip" or "frequencies".
        repeat: repetitions of every setting.
        comm: MPI communicator.
        folder: where the record is kept, or None.
        resume: whether to go on with the record that is there.
    """

    def __init__(self, scene: Scene, output: str, repeat: int, comm: MPI.Comm, folder: Path | None, resume: bool):
        self.started = perf_counter()
        self.scene, self.output, self.repeat, self.comm = scene, output, repeat, comm
        self.each = output == "frequencies"
        path = folder / RECORD if folder is not None and comm.rank == 0 else None
        self.record = Record(path, fingerprint(scene, output, comm.size), fresh=not resume)
        self.richest = richest().name
        self.bench = Bench(scene, output, comm)
        self.taken: set[Setting] = set()
        self.new = 0

    def measure(self, setting: Setting, repeat: int) -> Measurement:
        """Return the measurement of a setting, from the record where it has it."""
        found: Measurement | None = self.comm.bcast(self.record.get(setting, repeat))
        if found is not None:
            if self.comm.bcast(self.record.is_earlier(setting)):
                self.taken.add(setting)
            return found
        measurement: Measurement = self.comm.bcast(self.bench.measure(setting, repeat))
        self.record.put(setting, measurement)
        self.new += 1
        return measurement

    def run(
        self, quick: bool, accuracy: float, chosen: Mapping[str, Sequence[Any] | None], progress: Progress
    ) -> CostResult:
        """Return the result (see `cost`)."""
        base = self.base_step()
        settings = grid(self.scene, self.output, quick, base, chosen)
        self.check_degrees(chosen.get("degrees") or ())
        interval = None if base is None else sample_interval(self.scene, base)
        own = own_setting(self.scene)
        theories = unique([*(s.theory for s in settings), self.richest])
        finer = {theory: reference_settings(settings, own, theory, interval) for theory in theories}
        ahead = dict.fromkeys([*settings, *(s for levels in finer.values() for s in levels)], 0.0)
        for s in ahead:  # the work is about that of the steps, or that of the elements where there are none
            ahead[s] = float(np.prod(s.elements or 1)) if base is None else 1 / (s.step or base)
        whole = sum(ahead.values())

        def get(setting: Setting, times: int) -> Measurement:
            measurement = self.measure(setting, times)
            ahead.pop(setting, None)
            progress(1.0 - sum(ahead.values()) / whole)
            return measurement

        measured = [(setting, get(setting, self.repeat)) for setting in settings]
        if not any(m.status == "done" for _, m in measured):
            setting, m = measured[-1]
            raise ComputationError(f"no setting could be computed ({describe(setting.key())}: {m.reason})")
        references: dict[str, Reference] = {}
        failures: dict[str, str] = {}
        for theory, levels in finer.items():
            self._refer(theory, levels, get, references, failures)
        if not self.each and self.richest in references and not np.any(references[self.richest].samples.values):
            raise SceneError(self.scene.file, "cost --of", "tip", 'the tip does not move; try output "frequencies"')
        rows = rows_of(measured, references, self.each)
        return CostResult(self._summary(rows, references, failures, accuracy, quick), rows, self.scene, references)

    def check_degrees(self, degrees: Sequence[int]) -> None:
        """Check that elements of these degrees may be used; of a mesh file only the file says of what shape they are.

        Raises:
            SceneError: they may not.
        """
        for degree in degrees if getattr(self.scene.structure, "mesh", None) is not None else ():
            try:
                Model(Problem.of(self.scene.replace({"mesh.degree": degree})).replace(effects=()), self.comm)
            except InputError as error:
                raise SceneError(self.scene.file, "cost --degrees", degree, error.allowed) from None

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
        pilot = self.measure(own_setting(self.scene), self.repeat)
        if pilot.status != "done":
            raise ComputationError(f"the scene as it is failed, so that no grid can be made around it: {pilot.reason}")
        return time.end / pilot.steps

    def _refer(
        self,
        theory: str,
        levels: list[Setting],
        get: Callable[[Setting, int], Measurement],
        references: dict[str, Reference],
        failures: dict[str, str],
    ) -> None:
        """Add the reference of a theory, or the reason why there is none."""
        samples = []
        for setting in levels:
            measurement = get(setting, 1)
            if measurement.samples is None:
                failures[theory] = measurement.reason
                return
            samples.append(measurement.samples)
        references[theory] = reference(samples[:3], self.each, samples[3] if len(samples) > 3 else None)

    def _summary(
        self,
        rows: list[dict[str, Any]],
        references: dict[str, Reference],
        failures: dict[str, str],
        accuracy: float,
        quick: bool,
    ) -> dict[str, Any]:
        warnings = []
        if self.richest not in references:
            reason = failures.get(self.richest, "")
            warnings.append(f"no reference of {self.richest} ({reason}): errors do not include that of the model")
        judges = [r for t, r in references.items() if t == self.richest or self.richest not in references]
        uncertainty = max((r.uncertainty for r in judges), default=0.0)
        for theory, r in references.items():
            mine = [row["error"] for row in rows if row["theory"] == theory and row["error"]]
            if mine and r.uncertainty > max(ROUND_OFF, 0.5 * min(mine)):
                warnings.append(
                    f"the reference of {theory} is uncertain by {r.uncertainty:.1e}, the best setting off by "
                    f"{min(mine):.1e}: errors near that are not resolved"
                )
        best = {a: recommend(rows, a, uncertainty) for a in sorted({*DECADES, accuracy}, reverse=True)}
        total = perf_counter() - self.started
        return {
            "command": "cost",
            "status": "done",
            "name": self.scene.name,
            "output": self.output,
            "quick": quick,
            "accuracy": accuracy,
            "uncertainty": uncertainty,
            "references": {
                t: {"order": r.order, "uncertainty": r.uncertainty, "parts": r.parts} for t, r in references.items()
            },
            "reference_failures": failures,
            "model_errors": model_errors(references, self.each),
            "recommended": best[accuracy],
            "recommendations": [{"accuracy": a, "setting": r and describe(r), "row": r} for a, r in best.items()],
            "settings": len(rows),
            "failed": sum(row["status"] == "failed" for row in rows),
            "measured": self.new,
            "resumed": len(self.taken),
            "timings": {"compile": self.bench.compiling, "other": total - self.bench.compiling, "total": total},
            "warnings": warnings,
            "versions": versions(),
            "ranks": self.comm.size,
            "scene": self.scene.digest(),
        }
