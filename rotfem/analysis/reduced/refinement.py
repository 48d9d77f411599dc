"""Steps of a reduced model's collocation that are short enough for an accuracy, and the estimate of their error."""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.solution import Trajectory, after
from rotfem.analysis.reduced.tips import largest, tips_of
from rotfem.analysis.reduced.vibrations import Vibrations

if TYPE_CHECKING:
    from rotfem.analysis.reduced.response import Growth

Array = npt.NDArray[np.float64]

#: Most parts into which a first step of a collocation is cut, most and least times as many as before, and most steps.
PARTS, FINER, MOST_STEPS = 64, (1.25, 2.0), 200_000

#: Parts of a first step that vibrations may ask for at once.
CUTS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, PARTS)

#: Order of their error that is taken for granted, and that which is believed at least and most: that of the nodes is 5.
ORDER, SEEN = 3.0, (2.0, 4.0)

#: Part of an accuracy that steps are cut for.
AIM = 0.7

#: Part of the tip's displacement from which what is not static is taken for a vibration.
VIBRATES = 1e-6

#: Rows of a history in which vibrations are looked for.
ROWS = 600


def refined(growth: Growth, path: Trajectory, accuracy: float, parts: int | None) -> tuple[Trajectory, float]:
    """Return the history with steps short enough, or cut into parts, and the estimate of their error.

    With errors that fall as n^−p with the number of steps, n_2 of them are off by the difference from n_1 over
    (n_2/n_1)^p − 1. Two differences show p. Vibrations that both damp away are told by their size.

    Args:
        growth: the basis, and how it is solved in.
        path: the history by the first steps.
        accuracy: of the tip, relative.
        parts: of each first step, whose error is then infinite; as the accuracy asks for if None.
    """
    solution, model = growth.solution, growth.model
    if path.exact:
        return path, solution.off
    if parts is not None:
        solution.parts = parts
        return growth.solve(), np.inf
    tips: Array = path.q @ tips_of(model).T
    size, known = largest(model, tips), solution.hub is None
    vibrations = _vibrations(growth, path).beyond(VIBRATES * size) if known else Vibrations.none()
    solution.vibrations = vibrations if known else None
    error, order, before = np.inf, ORDER, 0.0
    enough = (n for n in CUTS if solution.vibrating(vibrations, n) <= accuracy * size)
    factor = max(2.0, min(next(enough, PARTS) / solution.parts, MOST_STEPS / path.steps))
    while solution.parts < PARTS and factor * path.steps <= MOST_STEPS:
        parts = min(PARTS, ceil(factor * solution.parts))
        last, factor, solution.parts = factor, parts / solution.parts, parts
        finer = growth.solve()
        coarse, tips = tips, finer.q @ tips_of(model).T
        size = largest(model, tips)
        change = largest(model, tips - coarse) / size if size > 0.0 else 0.0
        if before > 0.0 and change > 0.0:
            order = float(np.clip(np.log(before / change) / np.log(last), *SEEN))
        path, before, error = finer, change, change / (factor**order - 1)
        error = max(error, solution.vibrating(vibrations, parts) / size if size > 0.0 else 0.0)
        if error <= accuracy:
            break
        factor = float(np.clip((error / (AIM * accuracy)) ** (1 / order), *FINER))
    return path, error


def _vibrations(growth: Growth, path: Trajectory) -> Vibrations:
    """Return the vibrations in a history, of the matrices in the middle of it."""
    times = growth.solution.times
    rows = np.unique(np.linspace(0, len(times) - 1, ROWS).astype(int))
    c, q, v = growth.drive.factors(after(times[rows])), path.q[rows], path.v[rows]
    return Vibrations.of(growth.model, c[len(c) // 2], v, growth.model.accelerations(c, q, v))
