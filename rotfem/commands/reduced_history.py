"""The history of a run by a reduced model, in the place of a march: the same rows, fields and checks."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.critical_speed import critical_speed_within
from rotfem.analysis.march import Steps, grid
from rotfem.analysis.reduced.response import ACCURACY, Response, reduced_response
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


def reduced_history(
    scene: Scene, system: Any, start: Array | None, record: Recorder, monitor: Monitor, log: Log, alone: bool
) -> Response | None:
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
    response = reduced_response(system, times_of(scene.time), start, accuracy, scene.model.foreshortening)
    error = max(response.basis_error, response.time_error)
    if error > accuracy:
        what = f"the reduced model of {response.model.size} vectors is in error by {error:.2g}"
        if alone:  # a full system of this theory costs as much as one of a richer theory
            raise ComputationError(what)
        log.warnings.append(f"{what}, more than model.reduced allows ({accuracy:.2g}); the full system was used")
        return None
    log.steps = response.solution.steps
    monitor.critical = critical_speed_within(system, response.model.V[response.model.owned])
    Rows(response, record, monitor).record()
    return response


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

    Energies and forces at the root are those of the linear theory; tip and fields have the foreshortening, if that is
    wanted.

    Args:
        response: history of a reduced model.
        record: takes the rows.
        monitor: sees the states.
    """

    def __init__(self, response: Response, record: Recorder, monitor: Monitor):
        self.response, self.rows, self.monitor, self.system = response, record, monitor, record.system
        self.factors, self.turn = response.factors(), response.turn
        if self.system.hub is None:  # the response has no angle where nothing depends on it
            self.turn[:, 0] = [self.system.motion.angle(float(t)) for t in response.times]

    def record(self) -> None:
        """Add all rows to the run's history, and check states of it as a march does."""
        response, times = self.response, self.response.times
        kept = set(range(0, len(times), stride(len(times)))) | {len(times) - 1}
        energies = self._energies()
        tips, root = (self._in_hub_axes(values) for values in (response.tips, self._root()))
        columns = np.column_stack([times, *self.turn.T[:2], tips, *energies[:3], root, *energies[3:]])
        for i, values in enumerate(columns):
            row, record = [float(value) for value in values], self.rows
            wanted = record.needs_state
            state = self._state(i) if i in kept or wanted else None
            if state is not None:
                self.monitor.step(state)
                self.monitor.farthest(state.q, state.t)
                row += self._outputs(state) if wanted else []
            row += record.also(float(times[i]))
            record.add(row, self._shown(state, i) if i in kept else None)

    def _root(self) -> Array:
        """Return the columns of force and moment at the root; the moment about a free hub's axis by its equation."""
        response, hub, root = self.response, self.system.hub, self.system.root
        out = response.model.root_forces(self.factors, *response.states)
        if hub is None or not self.system.row.coupled:
            return out
        arms, turn = along_axis(root.names, root.place, self.system.motion.axis)
        _, speed, rate = self.turn.T
        moment = hub.torque.many(response.times, after=True) - hub.damping * speed - hub.inertia * rate
        return np.asarray(out + (moment - out @ arms)[:, None] * turn)

    def _in_hub_axes(self, values: Array) -> Array:
        """Return vectors of all rows (n, …) in the frame that turns with the hub."""
        pitch = self.system.motion.pitch
        if pitch is None:
            return values
        return np.array([pitch.in_hub_axes(row, float(t)) for row, t in zip(values, self.response.times, strict=True)])

    def _energies(self) -> list[Array]:
        """Return the columns of energies and the pitch, and of a free hub those of its own."""
        response, hub, pitch, speed = self.response, self.system.hub, self.system.motion.pitch, self.turn[:, 1]
        if pitch is not None:  # the frame turns about any axis, and its origin moves: as the full system has them
            columns = np.array([self._energies_of(i) for i in range(len(response.times))]).T
            return [*columns, np.array([pitch.angle(float(t)) for t in response.times])]
        q, v, _ = response.states
        found = response.model.energies(self.factors, speed, q, v)
        out = [found[name] for name in ENERGIES]
        if hub is None:
            return out
        coupled = float(self.system.row.coupled)
        momentum = response.model.energies(self.factors, speed, coupled * q, coupled * v)["momentum"]
        given = response.equations.given(response.solution, response.times)
        torque = hub.torque.many(response.times, after=True)
        own = 0.5 * hub.inertia * speed**2, hub.inertia * speed + momentum
        return [*out, torque, *own, given["impulse"], given["work"]]

    def _shown(self, state: State | None, i: int) -> State | None:
        """Return a state as fields show it: with its foreshortening if that is wanted."""
        if state is None or self.response.manifold is None:
            return state
        q = state.q.copy()
        q[: len(self.response.model.V)] = self.response.shape(i)
        return state.changed(q=q)

    def _state(self, i: int) -> State:
        """Return the state of a row; of a free hub its angle comes last."""
        response = self.response
        parts = [response.model.V @ x[i] for x in response.states]
        if self.system.hub is not None:
            parts = [np.append(x, angle) for x, angle in zip(parts, self.turn[i], strict=True)]
        return State(float(response.times[i]), *parts)

    def _energies_of(self, i: int) -> list[float]:
        """Return the energies of a row as the full system has them."""
        response = self.response
        self.system.set_time(float(response.times[i]))
        self.system.set_state(*(response.model.V @ x[i] for x in response.states))
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
