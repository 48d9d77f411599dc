"""An accuracy of the moment at the root: what coarser steps and a coarser mesh change in it says how far it is off.

The estimates of a run (`rotfem.analysis.error_watch`) are those of the displacement of the tip. Moments have more of
the high modes in them, so their error is found by comparison, in every attempt: with steps of twice the length, or
eight times the tolerance, and with elements half as long again. The error of the finer one is

    e = |m_coarse − m| / (r^p − 1),

r the ratio of the steps or elements. The order p is taken lower than it is, so that the estimate is on the safe side
where the coarser run is too coarse for its order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.commands.accuracy import settings_of
from rotfem.commands.interrupts import together
from rotfem.commands.pace import TooDear
from rotfem.errors import ComputationError
from rotfem.results.run import RunResult
from rotfem.scene import Scene
from rotfem.selection.accuracy import Settings

Array = npt.NDArray[np.float64]

#: What `accuracy_of` calls it.
ROOT_MOMENT = "root_moment"

#: Ratios of steps, of tolerances and of elements that are compared, and by what their differences are divided.
LONGER, LOOSER, WIDER = 2.0, 8.0, 1.5
BY_STEPS, BY_ELEMENTS = 3.0, 2.0

#: Tolerance to begin with, as a part of that of a displacement.
TIGHTER = 0.2


def first_settings(scene: Scene) -> Settings:
    """Return the settings that a scene is first computed with: of its own theory, with tighter steps than for a tip."""
    settings = settings_of(scene)
    tolerance = None if settings.tolerance is None else TIGHTER * settings.tolerance
    return replace(settings, models=settings.models[-1:], tolerance=tolerance)


def judged(
    settings: Settings, attempt: Callable[[Settings], RunResult], aside: Callable[[Settings], RunResult], comm: MPI.Comm
) -> RunResult:
    """Return the result of settings, with the error of its root moment as that of its summary.

    Args:
        settings: how it is computed.
        attempt: settings ↦ their result.
        aside: the same for results that are only compared.
        comm: of the processes that compute them.

    Raises:
        KeyboardInterrupt: of a result that is only compared, with the one that it is compared with.
    """
    done = attempt(settings)
    try:
        done.summary["error"] = error_of(done, settings, aside)
    except KeyboardInterrupt as stop:
        if together(comm, stop):
            done.summary["status"] = "interrupted"
            vars(stop)["result"] = done
        raise
    return done


def error_of(done: RunResult, settings: Settings, aside: Callable[[Settings], RunResult]) -> dict[str, Any]:
    """Return the error of the root moment of a result (see `judged`); parts that are not known are None."""
    moment = moments(done)
    scale = float(np.max(np.linalg.norm(moment, axis=1), initial=0.0))
    known = done.summary.get("error", {})
    error: dict[str, Any] = {"model": known.get("model", 0.0)}
    if settings.moving:
        error["time"] = compared(done, with_longer_steps(settings), aside, scale, BY_STEPS)
    coarse = with_larger_elements(settings)
    error["space"] = known.get("space") if coarse is None else compared(done, coarse, aside, scale, BY_ELEMENTS)
    total = None if None in error.values() else float(sum(error.values()))
    return {**error, "total": total, "scale": scale, "of": ROOT_MOMENT}


def moments(result: RunResult) -> Array:
    """Return the moment at the root in all rows, (n, components), N·m."""
    return np.column_stack([values for name, values in result.history.items() if name.startswith("root_m")])


def compared(
    fine: RunResult, settings: Settings, aside: Callable[[Settings], RunResult], scale: float, by: float
) -> float | None:
    """Return the error of moments, relative to a scale: what coarser settings change in them, divided.

    1 divided where these cannot be computed, None where they would take too long.
    """
    try:
        return difference(fine, aside(settings), scale) / by
    except TooDear:
        return None
    except ComputationError:
        return 1.0 / by


def difference(fine: RunResult, coarse: RunResult, scale: float) -> float:
    """Return the largest difference of the moments of two runs at the times of the first, relative to a scale."""
    one, other = moments(fine), moments(coarse)
    if len(fine.t) > 1:
        other = np.column_stack([np.interp(fine.t, coarse.t, column) for column in other.T])
    size = float(np.max(np.linalg.norm(one - other, axis=1)))
    return size / scale if scale > 0.0 else 0.0


def with_longer_steps(settings: Settings) -> Settings:
    """Return settings of a history with steps to compare with."""
    if settings.step is not None:
        return replace(settings, step=LONGER * settings.step)
    assert settings.tolerance is not None
    return replace(settings, tolerance=LOOSER * settings.tolerance)


def with_larger_elements(settings: Settings) -> Settings | None:
    """Return settings with a mesh to compare with; None where a file says the mesh."""
    if settings.elements is None:
        return None
    if isinstance(settings.elements, tuple):
        nx, ny = (max(1, int(n / WIDER)) for n in settings.elements)
        return replace(settings, elements=(nx, ny))
    return replace(settings, elements=max(1, int(settings.elements / WIDER)))
