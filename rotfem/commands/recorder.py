"""What a run keeps of its states: rows of the history, the last shape, fields of plates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import State
from rotfem.commands.fields import fields_writer, stations_writer
from rotfem.commands.finite import check_finite
from rotfem.commands.moment import hub_values, write_state
from rotfem.commands.resultant_rows import ResultantRows
from rotfem.commands.station_rows import StationRows
from rotfem.errors import InputError
from rotfem.results.run import RunResult, Table
from rotfem.scene import OutputTable
from rotfem.structures.paraview import Snapshots

Array = npt.NDArray[np.float64]


def check_names(outputs: Sequence[str], taken: Sequence[str]) -> None:
    """Refuse outputs of a user with the name of something that is recorded anyway.

    Raises:
        InputError: a name is taken.
    """
    for name in outputs:
        if name in taken:
            why = f"is the name of a column already; choose another one than {', '.join(taken)}"
            raise InputError("output.quantities", name, why)


class Recorder:
    """Takes states and keeps rows of history.csv.

    Args:
        system: equations of motion.
        output: what is recorded beside what always is, of it the stations.

    Attributes:
        history: rows so far.

    Raises:
        InputError: an output of a user has the name of a column.
    """

    def __init__(self, system: Any, output: OutputTable | None = None):
        self.system = system
        names = tuple(f"tip_{c}" for c in system.structure.components)
        free = ("torque", "hub_kinetic", "angular_momentum", "impulse", "work") if system.hub is not None else ()
        root, further = (f"root_{name}" for name in system.root.names), tuple(system.model.problem.outputs)
        named = () if output is None else output.resultants(system.structure.type)
        self.resultants = ResultantRows(system.held, named) if named else None
        stress = ("von_mises_max",) if named else ()
        energies = ("kinetic", "strain", "jacobi")
        pitch = () if system.motion.pitch is None else ("pitch",)
        columns = ("t", "psi", "psi_dot", *names, *energies, *root, *free, *pitch)
        self._last: State | None = None
        self.formats = ("vtx",) if output is None else output.formats(system.structure.type)
        self.snapshots = Snapshots() if self.formats else None
        stations = output is not None and output.stations is not None
        self.stations = StationRows(system, output) if stations and output is not None else None
        of_stations = ("x", *self.stations.names) if self.stations is not None else ()
        check_names(further, (*columns, *stress, *of_stations, *named))
        self.history = Table((*columns, *further, *stress))

    def __call__(self, state: State) -> None:
        """Add a row for a state.

        Raises:
            ComputationError: a number of it is not finite.
        """
        system, t = self.system, state.t
        system.set_time(t)
        write_state(system, state)
        energy, motion = system.energies(), system.motion
        row = [t, motion.angle(t), motion.speed(t), *system.tip(state.q, t)]
        row += [energy[name] for name in ("kinetic", "strain", "jacobi")]
        row += system.root_reaction().values()
        row += hub_values(system, state).values()
        row += [] if motion.pitch is None else [motion.pitch.angle(t)]
        row += system.outputs().values()
        row += self.also(t)
        self.add(row, state)

    @property
    def needs_state(self) -> bool:
        """Whether more than what a reduced model knows is to be recorded of the next row."""
        due = self.stations is not None and self.stations.due
        return due or self.resultants is not None or bool(self.system.model.problem.outputs)

    def also(self, t: float) -> list[float]:
        """Keep what stations and plates have at the state written into the system; return the last columns."""
        if self.stations is not None:
            self.stations(t)
        return [] if self.resultants is None else [self.resultants(t)]

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
            if self.resultants is not None and self.resultants.last is not None:
                self.resultants.frames.add(state.t, self.resultants.last)

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
            if len(out.stations.t):  # a run may fail before its first record
                out.further.append(stations_writer(self.system, out.stations))
        if self.snapshots is not None and self.snapshots.kept:
            more = None if self.resultants is None else (self.resultants.names, self.resultants.frames.kept)
            out.fields = fields_writer(self.system, self.snapshots.kept, self.formats, more)
        if self.resultants is not None:
            out.resultants = self.resultants.columns()
        return out
