"""The history of a run by a reduced model, in the place of a march: the same rows, fields and checks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.critical_speed import critical_speed_within
from rotfem.analysis.march import Steps, grid
from rotfem.analysis.reduced.energies import ReducedEnergies
from rotfem.analysis.reduced.foreshortened import Foreshortened, recover
from rotfem.analysis.reduced.response import ACCURACY, Response, reduced_response
from rotfem.analysis.reduced.root_forces import root_forces
from rotfem.analysis.schemes import State
from rotfem.commands.checkpoint import Log
from rotfem.commands.monitor import Monitor
from rotfem.commands.recorder import Recorder
from rotfem.errors import ComputationError
from rotfem.scene import Scene
from rotfem.structures.paraview import MOST
from rotfem.structures.root_reaction import along_axis

Array = npt.NDArray[np.float64]

#: Rows of a history whose steps are adaptive.
ROWS = 1000

#: Columns of energies.
ENERGIES = ("kinetic", "strain", "jacobi")


@dataclass
class ReducedHistory:
    """The history of a run by a reduced model.

    Attributes:
        response: its coordinates.
        foreshortened: what they move the structure back; None where that is not wanted.
    """

    response: Response
    foreshortened: Foreshortened | None

    def summary(self) -> dict[str, Any]:
        """Return what a summary has of it."""
        out = self.response.summary()
        return out if self.foreshortened is None else {**out, "foreshortening": self.foreshortened.summary()}


def reduced_history(
    scene: Scene, system: Any, start: Array | None, record: Recorder, monitor: Monitor, log: Log, alone: bool
) -> ReducedHistory | None:
    """Record the history of a reduced model; return None if none serves, which is noted.

    Args:
        scene: what is run.
        system: of its problem.
        start: shape at t = 0, local dof array; undeformed if None.
        record: takes the rows.
        monitor: sees the states.
        log: takes the warnings and the number of steps.
        alone: whether the full system is of no use instead.

    Raises:
        ComputationError: it failed.
    """
    accuracy = accuracy_of(scene)
    response = reduced_response(system, times_of(scene.time), start, accuracy)
    if response.projection_error > accuracy:
        what = f"the reduced model of {response.model.size} vectors is off by {response.projection_error:.2g}"
        if alone:  # a full system of this theory costs as much as one of a richer theory
            raise ComputationError(what)
        log.warnings.append(f"{what}, more than model.reduced allows ({accuracy:.2g}); the full system was used")
        return None
    log.steps = response.trajectory.steps
    monitor.critical = critical_speed_within(system, response.model.V[response.model.owned])
    done = ReducedHistory(response, recover(response) if scene.model.foreshortening else None)
    Rows(done, record, monitor).record()
    if response.time_error > accuracy:
        log.warnings.append(
            f"the steps of the reduced model leave an error of {response.time_error:.2g}, more than model.reduced "
            f"allows ({accuracy:.2g})"
        )
    return done


def accuracy_of(scene: Scene) -> float:
    """Return the accuracy that the reduced model of a scene is to have."""
    asked = scene.model.reduced
    return ACCURACY if asked is True else float(asked)


def times_of(time: Any) -> Array:
    """Return the times of the rows that a [time] table asks for, s."""
    steps = Steps.of(time)
    if time.output_step is not None:
        steps = Steps(steps.end, time.output_step)
    elif steps.step is None:
        steps = Steps(steps.end, steps.end / ROWS)
    ends, _ = grid(steps)
    return np.append(ends[: -1 : time.output_every], ends[-1])


class Rows:
    """Rows and fields of a run, from a response.

    Args:
        history: that of a reduced model.
        record: takes the rows.
        monitor: sees the states.
    """

    def __init__(self, history: ReducedHistory, record: Recorder, monitor: Monitor):
        self.response, self.foreshortened = history.response, history.foreshortened
        self.rows, self.monitor, self.system = record, monitor, record.system

    def record(self) -> None:
        """Add all rows to the run's history, and look at states of it as a march does."""
        response, times = self.response, self.response.times
        kept = set(range(0, len(times), stride(len(times)))) | {len(times) - 1}
        tips = response.tips if self.foreshortened is None else self.foreshortened.tips
        turn, a = self._turn(), response.accelerations()
        root, energies = self._root(a, turn[1], turn[2]), self._energies(turn[1], a)
        tips, root = (self._in_hub_axes(values) for values in (tips, root))
        columns = np.column_stack([times, *turn[:2], tips, *energies[:3], root, *energies[3:]])
        for i, values in enumerate(columns):
            row = [float(value) for value in values]
            record = self.rows
            wanted = record.needs_state
            state = self._state(i, a, turn) if i in kept or wanted else None
            if state is not None:
                self.monitor.step(state)
                self.monitor.farthest(state.q, state.t)
                row += self._outputs(state) if wanted else []
            row += record.also(float(times[i]))
            record.add(row, self._shown(state, i) if i in kept else None)

    def _turn(self) -> tuple[Array, Array, Array]:
        """Return angle, speed and its rate of the frame in all rows, rad, rad/s, rad/s²."""
        drive, t = self.response.solution.drive, self.response.times
        if self.system.hub is not None:
            return drive.angle(t), drive.speed(t), drive.rate(t)
        motion = self.system.motion
        return np.array([motion.angle(float(x)) for x in t]), drive.speed(t), drive.rate(t)

    def _root(self, a: Array, speed: Array, rate: Array) -> Array:
        """Return the columns of force and moment at the root; the moment about a free hub's axis by its equation."""
        response, hub, root = self.response, self.system.hub, self.system.root
        states = {"K": response.q, "C": response.v, "M": a}
        out = root_forces(response.model, response.factors(), states)
        if hub is None or not self.system.row.coupled:
            return out
        arms, turn = along_axis(root.names, root.place, self.system.motion.axis)
        torque = hub.torque.many(response.times, after=True)
        moment = torque - hub.damping * speed - hub.inertia * rate
        return np.asarray(out + (moment - out @ arms)[:, None] * turn)

    def _in_hub_axes(self, values: Array) -> Array:
        """Return vectors of all rows (n, …) in the frame that turns with the hub."""
        pitch = self.system.motion.pitch
        if pitch is None:
            return values
        return np.array([pitch.in_hub_axes(row, float(t)) for row, t in zip(values, self.response.times, strict=True)])

    def _energies(self, speed: Array, a: Array) -> list[Array]:
        """Return the columns of energies and the pitch, and of a free hub those of its own."""
        response, hub, pitch = self.response, self.system.hub, self.system.motion.pitch
        if pitch is not None:  # the frame turns about any axis, and its origin moves: as the full system has them
            columns = np.array([self._energies_of(i, a) for i in range(len(response.times))]).T
            return [*columns, np.array([pitch.angle(float(t)) for t in response.times])]
        energies = ReducedEnergies(response.model)
        found = energies(response.factors(), speed, response.q, response.v)
        out = [found[name] for name in ENERGIES]
        if hub is None:
            return out
        coupled = float(self.system.row.coupled)
        momentum = hub.inertia * speed + energies.momentum(speed, coupled * response.q, coupled * response.v)
        given = response.solution.given()
        torque = hub.torque.many(response.times, after=True)
        return [*out, torque, 0.5 * hub.inertia * speed**2, momentum, given["impulse"], given["work"]]

    def _shown(self, state: State | None, i: int) -> State | None:
        """Return a state as fields show it: with its foreshortening if that is given back."""
        if state is None or self.foreshortened is None:
            return state
        q = state.q.copy()
        q[: len(self.response.model.V)] = self.foreshortened.manifold.shape(self.foreshortened.q[i])
        return state.changed(q=q)

    def _state(self, i: int, a: Array, turn: tuple[Array, Array, Array]) -> State:
        """Return the state of a row; of a free hub its angle comes last."""
        response, V = self.response, self.response.model.V
        parts = [V @ x[i] for x in (response.q, response.v, a)]
        if self.system.hub is not None:
            parts = [np.append(x, angle[i]) for x, angle in zip(parts, turn, strict=True)]
        return State(float(response.times[i]), *parts)

    def _energies_of(self, i: int, a: Array) -> list[float]:
        """Return the energies of a row as the full system has them."""
        response, V, t = self.response, self.response.model.V, float(self.response.times[i])
        self.system.set_time(t)
        self.system.set_state(*(V @ x[i] for x in (response.q, response.v, a)))
        energies = self.system.energies()
        return [energies[name] for name in ENERGIES]

    def _outputs(self, state: State) -> list[float]:
        self.system.set_time(state.t)
        self.system.set_state(state.q, state.v, state.a)
        return list(self.system.outputs().values())


def stride(rows: int) -> int:
    """Return from which row to which a snapshot is kept, so that there are at most MOST."""
    every = 1
    while (rows - 1) // every + 1 > MOST:
        every *= 2
    return every
