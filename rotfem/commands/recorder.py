"""What a run keeps of its states: rows of the history, the last shape, fields of plates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import State
from rotfem.commands.fields import fields_writer, stations_writer
from rotfem.commands.finite import check_finite
from rotfem.commands.moment import hub_values
from rotfem.commands.station_rows import StationRows
from rotfem.results.run import RunResult, Table
from rotfem.scene import OutputTable
from rotfem.structures.paraview import Snapshots

Array = npt.NDArray[np.float64]


class Recorder:
    """Takes states and keeps rows of history.csv.

    Args:
        system: equations of motion.
        output: what is recorded beside what always is, of it the stations.

    Attributes:
        history: rows so far.
    """

    def __init__(self, system: Any, output: OutputTable | None = None):
        self.system = system
        names = tuple(f"tip_{c}" for c in system.structure.components)
        free = ("torque", "hub_kinetic", "angular_momentum", "impulse", "work") if system.hub is not None else ()
        root, further = (f"root_{name}" for name in system.root.names), tuple(system.model.problem.outputs)
        self.history = Table(("t", "psi", "psi_dot", *names, "kinetic", "strain", "jacobi", *root, *free, *further))
        self._last: State | None = None
        self.formats = ("vtx",) if output is None else output.formats(system.structure.type)
        self.snapshots = Snapshots() if self.formats else None
        stations = output is not None and output.stations is not None
        self.stations = StationRows(system, output) if stations and output is not None else None

    def __call__(self, state: State) -> None:
        """Add a row for a state.

        Raises:
            ComputationError: a number of it is not finite.
        """
        system, t = self.system, state.t
        system.set_time(t)
        system.set_state(state.q, state.v, state.a)
        energy, motion = system.energies(), system.motion
        row = [t, motion.angle(t), motion.speed(t), *system.tip(state.q, t)]
        row += [energy[name] for name in ("kinetic", "strain", "jacobi")]
        row += system.root_reaction().values()
        row += hub_values(system, state).values()
        row += system.outputs().values()
        if self.stations is not None:
            self.stations(t)
        self.add(row, state)

    def add(self, row: Sequence[float], state: State | None) -> None:
        """Add a row, and keep the state that it is of if there is one.

        Raises:
            ComputationError: a number of it is not finite.
        """
        check_finite(zip(self.history.columns, row, strict=True), row[0])
        self.history.append(row)
        if state is None:
            return
        self._last = state
        if self.snapshots is not None:
            self.snapshots.add(state.t, state.q)

    def result(self, summary: dict[str, Any], history: dict[str, Array]) -> RunResult:
        """Return a result with the last shape and the fields kept."""
        structure = self.system.structure
        if self._last is not None:  # a state after it may have been refused
            self.system.count_rotations_from(self._last.datum)
            self.system.set_time(self._last.t)
            self.system.set_state(self._last.q, self._last.v, self._last.a)
        shape = self.system.shape() if len(self.history) else {}
        out = RunResult(summary, history, shape, triangles=structure.surface())
        if self.stations is not None:
            out.stations = self.stations.result()
            out.further.append(stations_writer(self.system, out.stations))
        if self.snapshots is not None and self.snapshots.kept:
            out.fields = fields_writer(self.system, self.snapshots.kept, self.formats)
        return out
