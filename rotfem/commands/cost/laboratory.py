"""What measures the settings of a study: from the record where it has them, within the budget, learning as it goes."""

from __future__ import annotations

from pathlib import Path

from rotfem.commands.cost.bench import Bench
from rotfem.commands.cost.budget import Budget
from rotfem.commands.cost.prediction import Prediction
from rotfem.commands.cost.record import Measurement, Record, fingerprint
from rotfem.commands.cost.settings import Setting
from rotfem.scene import Scene


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
        end = scene.time.end if output == "tip" and scene.time is not None else 0.0
        self.prediction = Prediction(2 if scene.structure.type == "plate" else 1, end)
        self.measured: dict[Setting, tuple[str, Measurement]] = {}
        self.taken: set[Setting] = set()
        self.new = 0

    def get(self, setting: Setting, share: float, purpose: str, repeat: int = 1) -> Measurement | None:
        """Return the measurement of a setting, from the record where it has it; None where the budget refuses it.

        Args:
            setting: what is measured.
            share: of the time left that it may take.
            purpose: what for: grid, reference or proposal.
            repeat: how often it is to be computed, in all.
        """
        found: Measurement | None = self.comm.bcast(self.record.get(setting, repeat))
        if found is not None:
            if self.comm.bcast(self.record.is_earlier(setting)):
                self.taken.add(setting)
            return self._kept(setting, purpose, found)
        if not self.budget.allows(setting, self.prediction.of(setting), share):
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
