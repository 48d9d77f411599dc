"""What the steps of a case put its history off: told by a march of the coarse model with those steps.

The march is watched (`rotfem.analysis.error_watch`). Where there are very many steps it takes longer ones, and the
error is scaled by the order of the scheme.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from math import ceil

from rotfem.analysis.error_watch import ErrorWatch
from rotfem.analysis.time_loop import March
from rotfem.errors import ComputationError
from rotfem.selection.coarse_model import Trial

#: Steps of a march at most; beyond, one stands for several.
MOST_STEPS = 1500


def step_error(trial: Trial, theory: str, without: Collection[str] = ()) -> float | None:
    """Return the largest error of the tip's displacement by the steps, relative to the largest displacement.

    Args:
        trial: the case that is tried out.
        theory: of the model.
        without: effects that it does not have.

    Returns:
        None where there is no history, or its error cannot be told.
    """
    steps, scheme = trial.full.steps, trial.full.scheme
    if steps is None or scheme is None:
        return None
    thinned = 1
    if steps.step is not None:
        thinned = ceil(steps.end / steps.step / MOST_STEPS - 1e-9)
        steps = replace(steps, step=thinned * steps.step)
    candidate, last = trial.candidate(theory, without), None
    system = candidate.switched()
    try:
        march = March(system, scheme, steps, trial.case.newton(), trial.start(candidate, theory))
        watch = march.stepper.watch = ErrorWatch(system, steps.end, scheme)
        for last in march:
            if system.linear and not system.size(last.q) <= 1.0:
                return None
        errors = watch.errors(last)
    except ComputationError:
        return None
    if errors.time is None or not errors.scale > 0.0:
        return None
    return float(errors.time[0] / errors.scale / thinned**scheme.order)
