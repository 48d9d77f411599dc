"""The history of a run by a reduced model, in the place of a march: the same rows, fields and checks."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.march import Steps, grid
from rotfem.analysis.reduced.response import ACCURACY, Response, reduced_response
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import critical_speed_within
from rotfem.commands.accuracy import ROWS
from rotfem.commands.checkpoint import Log
from rotfem.commands.monitor import Monitor
from rotfem.commands.recorder import Recorder
from rotfem.errors import ComputationError
from rotfem.scene import Scene

Array = npt.NDArray[np.float64]


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
    record_rows(response, record, monitor)
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


def record_rows(response: Response, record: Recorder, monitor: Monitor) -> None:
    """Record the rows of a response, and check their states as a march does.

    Energies and forces at the root are those of the linear theory; tip and fields have the foreshortening, if that is
    wanted.
    """
    system, model, turn = record.system, response.model, response.turn
    given = None if system.hub is None else response.equations.given(response.solution, response.times)
    for i, t in enumerate(map(float, response.times)):
        q, v, a = (model.V @ x[i] for x in response.states)
        state = State(t, q, v, a)
        if given is not None:
            psi, speed, rate = turn[i]
            q, v, a = np.append(q, psi), np.append(v, speed), np.append(a, rate)
            state = State(t, q, v, a, given=np.array([*given[i], 0.0]))
        monitor.step(state)
        monitor.farthest(state.q, t)
        row = record.row(state)
        if response.manifold is not None and response.bent is not None:
            q = state.q.copy()
            q[: len(model.V)] = response.manifold.shape(response.bent[i])
            state = state.changed(q=q)
            row[3 : 3 + len(system.structure.components)] = map(float, system.tip(q, t))
        record.add(row, state)
