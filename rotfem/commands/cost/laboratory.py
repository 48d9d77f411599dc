"""What measures the settings of a study: from the record where it has them, within the budget.

Time and memory of a setting are predicted from the nearest one that was measured. Time grows with the number of steps
and stages. Over the unknowns n it grows as n for a beam, whose matrices are a band of fixed width, and as n^{3/2} for a
plate; memory grows as n and as n log n (nested dissection of a plane graph; A. George, SIAM J. Numer. Anal. 10, 1973).
"""

from __future__ import annotations

from math import log
from pathlib import Path
from typing import Any

from rotfem.commands.cost.bench import Bench
from rotfem.commands.cost.budget import Budget
from rotfem.commands.cost.record import Measurement, Record, fingerprint
from rotfem.commands.cost.settings import Setting, count, scheme_of
from rotfem.scene import Scene

#: Multiples of the largest number of unknowns that a table of sizes predicts.
AHEAD = (4, 16)


class Prediction:
    """Time and memory of settings.

    Args:
        plate: whether the mesh is one of a plate.
    """

    def __init__(self, plate: bool):
        self.plate = plate
        self.known: dict[Setting, Measurement] = {}

    def learn(self, setting: Setting, measurement: Measurement) -> None:
        """Take up what was measured of a setting."""
        if measurement.status == "done" and measurement.wall:
            self.known[setting] = measurement

    def of(self, setting: Setting) -> dict[str, float | None]:
        """Return the predicted `cpu` time (s, with set-up) and `memory` (bytes), None where unknown."""
        if setting in self.known:
            m = self.known[setting]
            return {"cpu": m.cost, "memory": m.memory}
        if not self.known:
            return {"cpu": None, "memory": None}
        near = min(self.known, key=lambda other: self._far(setting, other))
        m, n = self.known[near], self.known[near].dofs
        more = n * count(setting) / count(near)
        march = self._growth(n, more) * self._steps(setting, near)
        return {
            "cpu": m.median("setup_cpu") * max(more / n, 1.0) + m.median("cpu") * march,
            "memory": m.memory * self._filled(n, more),
        }

    def _growth(self, n: float, more: float) -> float:
        """Return the ratio of the times of a step with n and with more unknowns."""
        return float((more / n) ** (1.5 if self.plate else 1.0))

    def _filled(self, n: float, more: float) -> float:
        """Return the ratio of the memory of n and of more unknowns."""
        return more / n * (log(max(more, 3.0)) / log(max(n, 3.0)) if self.plate else 1.0)

    def _steps(self, setting: Setting, near: Setting) -> float:
        """Return the ratio of the numbers of stages of two histories; of adaptive steps (tolerance)^(-1/p) are needed.

        It is 1 outside histories, and where nothing shows how fixed steps compare with adaptive ones.
        """
        scheme, other = scheme_of(setting), scheme_of(near)
        if scheme is None or other is None:
            return 1.0
        stages = float(scheme.stages / other.stages)
        if setting.step is not None and near.step is not None:
            return stages * near.step / setting.step
        if setting.tolerance is not None and near.tolerance is not None:
            return stages * float((near.tolerance / setting.tolerance) ** (1 / scheme.order))
        return stages

    def _far(self, one: Setting, other: Setting) -> tuple[float, ...]:
        """Return how far a measured setting is from one to be predicted: way of the steps, theory, size."""
        return (
            float((one.step is None) != (other.step is None)),
            float(one.scheme != other.scheme),
            float(one.theory != other.theory),
            abs(log(count(one) / count(other))),
            abs(log(self._steps(one, other))),
        )

    def scaling(self) -> list[dict[str, Any]]:
        """Return time (s, CPU, of a step or in all) and memory (bytes) over the unknowns, by theory, and predictions.

        What is predicted, for some multiples of the largest number of unknowns that was measured, says so.
        """
        out: list[dict[str, Any]] = []
        for theory in dict.fromkeys(s.theory for s in self.known):
            sizes: dict[int, dict[str, Any]] = {}
            for m in (m for s, m in self.known.items() if s.theory == theory and m.dofs):
                time = m.median("cpu") / m.steps if m.steps else m.cost
                known = sizes.get(m.dofs, {"time": time, "memory": 0.0})
                least, most = min(time, known["time"]), max(m.memory, known["memory"])
                sizes[m.dofs] = {"theory": theory, "dofs": m.dofs, "time": least, "memory": most, "predicted": False}
            if len(sizes) < 2:
                continue
            last = sizes[max(sizes)]
            out += [sizes[n] for n in sorted(sizes)]
            for n, more in ((last["dofs"], factor * last["dofs"]) for factor in AHEAD):
                time, memory = last["time"] * self._growth(n, more), last["memory"] * self._filled(n, more)
                out.append({"theory": theory, "dofs": more, "time": time, "memory": memory, "predicted": True})
        return out


class Laboratory:
    """Measures settings of a scene.

    Args:
        scene: validated scene.
        output: one of OUTPUTS.
        budget: time and memory.
        path: the file that keeps measurements, or None.
        resume: whether to go on with what it holds.

    Attributes:
        measured: setting ↦ what it was first computed for, and its measurement.
        taken: settings that the file had.
        new: number of measurements made.
    """

    def __init__(self, scene: Scene, output: str, budget: Budget, path: Path | None, resume: bool):
        self.budget, self.comm = budget, budget.comm
        path = path if self.comm.rank == 0 else None
        self.record = Record(path, fingerprint(scene, output, self.comm.size), fresh=not resume)
        self.bench = Bench(scene, output, self.comm)
        self.prediction = Prediction(scene.structure.type == "plate")
        self.measured: dict[Setting, tuple[str, Measurement]] = {}
        self.taken: set[Setting] = set()
        self.new = 0

    def get(self, setting: Setting, purpose: str, repeat: int = 1) -> Measurement | None:
        """Return the measurement of a setting, from the record where it has it; None where the budget refuses it.

        Args:
            setting: what is measured.
            purpose: what for: grid, reference or proposal.
            repeat: how often it is to be computed, in all.
        """
        found: Measurement | None = self.comm.bcast(self.record.get(setting, repeat))
        if found is not None:
            if self.comm.bcast(self.record.is_earlier(setting)):
                self.taken.add(setting)
            return self._kept(setting, purpose, found)
        if not self.budget.allows(setting, self.prediction.of(setting)):
            return None
        before: Measurement | None = self.comm.bcast(self.record.find(setting))
        limit = max(self.budget.left(), 1.0)
        measurement: Measurement = self.comm.bcast(self.bench.measure(setting, repeat, before, limit))
        self.new += 1
        if measurement.status != "stopped":
            self.record.put(setting, measurement)
        return self._kept(setting, purpose, measurement)

    def _kept(self, setting: Setting, purpose: str, measurement: Measurement) -> Measurement:
        first = self.measured.get(setting, (purpose, measurement))[0]
        self.measured[setting] = "grid" if purpose == "grid" else first, measurement
        self.prediction.learn(setting, measurement)
        return measurement
