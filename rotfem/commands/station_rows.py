"""Rows of what is recorded at the stations along a beam while a run goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.commands.finite import check_finite
from rotfem.equations.stations import Stations
from rotfem.results.stations import StationHistory
from rotfem.scene.output import OutputTable

Array = npt.NDArray[np.float64]


class StationRows:
    """Takes the states of every so many rows of a history.

    Args:
        system: equations of motion of a beam.
        output: what is asked for, with stations.

    Attributes:
        kept: (time in s, values (stations, quantities)) so far.
        seen: rows of the history so far.
    """

    def __init__(self, system: Any, output: OutputTable):
        self.output, beam = output, system.structure
        self._stations = Stations(system, output.positions(beam.length))
        self.names = (*output.sections(beam.type), *beam.components)
        self._columns = [self._stations.names.index(name) for name in self.names]
        self.kept: list[tuple[float, Array]] = []
        self.seen = 0

    @property
    def due(self) -> bool:
        """Whether the next row is one of those that are kept."""
        return self.seen % self.output.every == 0

    def __call__(self, t: float) -> None:
        """Keep the values at the state that is written into the system, or pass the row by.

        Raises:
            ComputationError: a number is not finite.
        """
        if self.due:
            values = self._stations()[:, self._columns]
            check_finite(zip(self.names, map(float, values.sum(axis=0)), strict=True), t, " at the stations")
            self.kept.append((t, values))
        self.seen += 1

    def kept_arrays(self) -> dict[str, Any]:
        """Return what a checkpoint has of it."""
        return {"seen": self.seen, "t": [t for t, _ in self.kept], "values": [x.tolist() for _, x in self.kept]}

    def put_back(self, known: dict[str, Any], rows: int) -> None:
        """Take what a checkpoint has, where the history has so many rows.

        Raises:
            ValueError: it is not what there is after so many.
        """
        t, values = np.array(known["t"], dtype=float), np.array(known["values"], dtype=float)
        shape = 1 + (rows - 1) // self.output.every, len(self._stations.positions), len(self.names)
        if known["seen"] != rows or t.shape != shape[:1] or values.shape != shape:
            raise ValueError(f"values at stations of shape {values.shape} instead of {shape}")
        self.seen, self.kept = rows, [(float(a), x) for a, x in zip(t, values, strict=True)]

    def result(self) -> StationHistory:
        """Return what has been kept."""
        shape = len(self.kept), len(self._stations.positions), len(self.names)
        t, values = np.array([t for t, _ in self.kept]), np.array([x for _, x in self.kept]).reshape(shape)
        named = {name: values[:, :, i] for i, name in enumerate(self.names)}
        return StationHistory(t, self._stations.positions, named, self.output.format)
