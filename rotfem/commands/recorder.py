"""What a run sees of its states and keeps of them: rows, the last shape, fields."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.along import TWIST
from rotfem.analysis.dense_output import write_state
from rotfem.analysis.equilibrium import conditioning, rounding_message
from rotfem.analysis.march import LARGEST_LINEAR_DEFLECTION
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import Stability
from rotfem.commands.fields import Snapshots, fields_writer
from rotfem.commands.problem import hub_values
from rotfem.equations.stations import PlateResultants, Stations
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.listeners import computing
from rotfem.mechanics.theories import Theory, richest, theories
from rotfem.results.files import Table
from rotfem.results.run import RunResult, StationHistory
from rotfem.scene.settings import OutputTable
from rotfem.units import speed_text

Array = npt.NDArray[np.float64]


@dataclass
class Log:
    """What a run counts and has to say.

    Attributes:
        started, began: `perf_counter()` then, and CPU time without compilation, s.
        steps: number of the last step.
        elapsed, cpu: time and CPU time that it had taken before it went on from a checkpoint, s.
        warnings, advice: texts.
        resumed: time (s) and number of ranks of every checkpoint that it went on from.
    """

    started: float = field(default_factory=perf_counter)
    began: float = field(default_factory=computing)
    steps: int = 0
    elapsed: float = 0.0
    cpu: float = 0.0
    warnings: list[str] = field(default_factory=list)
    advice: list[str] = field(default_factory=list)
    resumed: list[dict[str, Any]] = field(default_factory=list)


class Monitor:
    """Sees that the theory of a run holds for its states; an observer of these.

    Args:
        system: equations of motion.
        critical: speed at which the stiffness of its theory is singular, rad/s; None if there is none.

    Attributes:
        since: from when on (s) the speed was above the critical one; None before.
        farthest: of a linear theory the largest component of displacements over the length or of rotations (rad) so
            far, by which round-off is judged, its time (s) and state.
        stability: of the equilibrium that is computed, or that a history starts from; None where there is none.
    """

    def __init__(self, system: System, critical: float | None):
        self.system, self.critical = system, critical
        self.since: float | None = None
        self.farthest: tuple[float, float, Array] = (-1.0, 0.0, system.zeros())
        self.stability: Stability | None = None

    def step(self, state: State) -> None:
        """Stop a history that has left the range of its theory."""
        if not self.system.linear:
            return
        speed = abs(self.system.motion.speed(state.t))
        if self.since is None and self.critical is not None and speed > self.critical:
            self.since = state.t
        size = self.system.size(state.q)
        if np.isfinite(size) and size <= LARGEST_LINEAR_DEFLECTION:
            return
        raise self._diverged(state.t)

    def _diverged(self, time: float) -> ComputationError:
        """Return the error of a linear solution that has diverged, and which theories to use in its place."""
        theory: Theory = self.system.model.problem.theory
        loose = [hinge.name for hinge in self.system.structure.hinges.values() if hinge.stiffness == 0.0]
        why = "the motion is unstable, or the load is too large for a linear theory"
        if loose:
            why = f"no spring holds the root's hinge ({', '.join(loose)}), which turns beyond what is linear"
        if self.since is not None and self.critical is not None:
            why = f"its stiffness is not definite above {speed_text(self.critical)}, passed at t = {self.since:.4g} s"
            if not theory.prestress:
                why += ": first-order strains have the softening by the centrifugal force but not the stiffening"
        what = f"the {theory.name} solution diverged (a displacement exceeds the length, or a rotation 1 rad; {why})"
        exact = richest().name
        advice = f'use model.theory = "{exact}", which holds for any deflection'
        if not theory.prestress and not loose:
            stiffened = next(t.name for t in theories() if t.linear and t.prestress)
            advice = f'use model.theory = "{stiffened}" for small or "{exact}" for any deflection'
        return ComputationError(what, time=time, advice=advice)

    def row(self, state: State) -> None:
        """Take note of a state that is recorded."""
        if not self.system.linear:
            self.system.structure.check_range(state.q, state.t)
        elif (size := self.system.size(state.q)) > 1.02 * self.farthest[0]:  # some are copied
            self.farthest = (size, state.t, np.array(state.q))

    def round_off(self) -> str:
        """Return the warning of what round-off may have done to the largest state, which it sets; empty if little."""
        size, t, q = self.farthest
        if size < 0.0:
            return ""
        self.system.set_time(t)
        with suppress(ComputationError):
            return rounding_message(conditioning(self.system, q[: len(self.system.scale)], t or np.inf))
        return ""


def check_finite(values: Iterable[tuple[str, Any]], time: float | None = None, where: str = "") -> None:
    """See that all named values, computed at a time (s), are finite; what is no number passes."""
    wrong = [name for name, value in values if isinstance(value, float) and not math.isfinite(value)]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        advice = "check the units of the scene, whose numbers are out of all proportion, or use a shorter time step"
        raise ComputationError(f"not a finite number{where}: {', '.join(wrong[:3])}{more}", time, advice)


def check_rows(rows: Iterable[Mapping[str, Any]]) -> None:
    """See that all numbers of modes, or of branches over speed, are finite."""
    for number, row in enumerate(rows, start=1):
        where = f" at {speed_text(row['speed'])}" if "speed" in row else ""
        check_finite(row.items(), where=f" of mode {row.get('branch', number)}{where}")


# --- what is kept -----------------------------------------------------------------------------------------------------

#: What the equivalent stress is called.
STRESS = "von_mises"


class ResultantRows:
    """Takes the states of the rows of a history of a plate, its hub held, and keeps named resultants.

    Attributes:
        last: values (nodes, names) at the last row.
        largest: largest equivalent stress (Pa) so far, where, and when: value, x, y (m), t (s).
    """

    def __init__(self, system: System, names: tuple[str, ...]):
        self.names = names
        self._resultants = PlateResultants(system)
        self._nodes = system.structure.nodes(system.zeros())[0]
        self._columns = [self._resultants.names.index(name) for name in names]
        self._stress = self._resultants.names.index(STRESS)
        self.last: Array | None = None
        self.largest: tuple[float, ...] = ()

    def __call__(self, t: float) -> float:
        """Keep the values at the state that is written into the system; return the largest equivalent stress, Pa."""
        values = self._resultants()
        worst = int(np.argmax(values[:, self._stress]))
        stress = float(values[worst, self._stress])
        check_finite([("the equivalent stress", float(values.sum()))], t)
        if not self.largest or stress > self.largest[0]:
            self.largest = (stress, float(self._nodes["x"][worst]), float(self._nodes["y"][worst]), t)
        self.last = values[:, self._columns]
        return stress

    def columns(self) -> dict[str, Array]:
        """Return the positions of the nodes (m), and the resultants of the last row; empty of no row."""
        if self.last is None:
            return {}
        return {**self._nodes, **dict(zip(self.names, self.last.T, strict=True))}

    def summary(self) -> dict[str, float]:
        """Return the largest equivalent stress (Pa), where (m) and when (s)."""
        return dict(zip((STRESS, "x", "y", "t"), self.largest, strict=False))


class StationRows:
    """Takes the states of every so many rows of a history of a beam, and keeps what is asked for at its stations.

    Attributes:
        kept: (time in s, values (stations, quantities)) so far.
        seen: rows of the history so far.
    """

    def __init__(self, system: System, output: OutputTable):
        self.output, beam = output, system.structure
        self._stations = Stations(system, output.positions(beam.length))
        self.names = (*output.sections(beam.type), *beam.components, *TWIST[beam.type])
        self._columns = [self._stations.names.index(name) for name in self.names]
        self.kept: list[tuple[float, Array]] = []
        self.seen = 0

    def __call__(self, t: float) -> None:
        """Keep the values at the state that is written into the system, or pass the row by."""
        if self.seen % self.output.every == 0:
            values = self._stations()[:, self._columns]
            check_finite(zip(self.names, map(float, values.sum(axis=0)), strict=True), t, " at the stations")
            self.kept.append((t, values))
        self.seen += 1

    def result(self) -> StationHistory:
        """Return what has been kept."""
        shape = len(self.kept), len(self._stations.positions), len(self.names)
        t, values = np.array([t for t, _ in self.kept]), np.array([x for _, x in self.kept]).reshape(shape)
        named = {name: values[:, :, i] for i, name in enumerate(self.names)}
        return StationHistory(t, self._stations.positions, named, self.output.format)


class Recorder:
    """Takes states and keeps rows of history.csv, and what the scene's output asks for in addition.

    Attributes:
        history: rows so far.

    Raises:
        InputError: an output of a user has the name of a column.
    """

    def __init__(self, system: System, output: OutputTable):
        self.system = system
        names = tuple(f"tip_{c}" for c in system.structure.components)
        free = ("torque", "hub_kinetic", "angular_momentum", "impulse", "work") if system.hub is not None else ()
        root, further = (f"root_{name}" for name in system.root.names), tuple(system.model.problem.outputs)
        named = output.resultants(system.structure.type)
        self.resultants = ResultantRows(system, named) if named else None
        stress = ("von_mises_max",) if named else ()
        energies = ("kinetic", "strain", "jacobi")
        pitch = () if system.motion.pitch is None else ("pitch",)
        columns = ("t", "psi", "psi_dot", *names, *energies, *root, *system.support_forces(), *free, *pitch)
        self._last: State | None = None
        self.snapshots = Snapshots(system.structure) if output.fields else None
        self.stations = None if output.stations is None else StationRows(system, output)
        of_stations = () if self.stations is None else ("x", *self.stations.names)
        taken = (*columns, *stress, *of_stations, *named)
        for name in further:
            if name in taken:
                why = f"is the name of a column already; choose another one than {', '.join(taken)}"
                raise InputError("output.quantities", name, why)
        self.history = Table((*columns, *further, *stress))

    def __call__(self, state: State) -> None:
        """Add a row for a state; stations and plates keep what they have of it."""
        system, t = self.system, state.t
        system.set_time(t)
        write_state(system, state)
        energy, motion = system.energies(), system.motion
        row = [t, motion.angle(t), motion.speed(t), *system.tip(state.q, t)]
        row += [energy[name] for name in ("kinetic", "strain", "jacobi")]
        row += system.root_reaction().values()
        row += system.support_forces().values()
        row += hub_values(system, state).values()
        row += [] if motion.pitch is None else [motion.pitch.angle(t)]
        row += system.outputs().values()
        if self.stations is not None:
            self.stations(t)
        row += [] if self.resultants is None else [self.resultants(t)]
        if not math.isfinite(sum(row)):
            check_finite(zip(self.history.columns, row, strict=True), t)
        self.history.append(row)
        self._last = state
        if self.snapshots is not None:
            self.snapshots.add(state.t, state.q, None if self.resultants is None else self.resultants.last)

    def result(self, summary: dict[str, Any], history: dict[str, Array]) -> RunResult:
        """Return a result with the last shape and the fields kept."""
        structure = self.system.structure
        if self._last is not None:  # a state after it may have been refused
            self.system.count_rotations_from(self._last.reference)
            self.system.set_time(self._last.t)
            self.system.set_state(self._last.q, self._last.v, self._last.a)
        shape = self.system.shape() if self.history.rows else {}
        out = RunResult(summary, history, shape, triangles=structure.surface())
        if self.stations is not None:
            out.stations = self.stations.result()
        if self.snapshots is not None and self.snapshots.kept:
            names = () if self.resultants is None else self.resultants.names
            out.fields = fields_writer(self.system, self.snapshots, names)
        if self.resultants is not None:
            out.resultants = self.resultants.columns()
        return out
