"""How much effects change a history, by a reduced linear model where the motion is one that it holds for.

A basis of few shapes is solved again without each effect (see `rotfem.analysis.reduced.effect_sizes`), which takes a
small part of the time that marches of a trial take. It serves where nothing is left out yet, and bending stays
moderate: what second-order forces do beyond that only a trial knows. With a free hub each solution is a Newton
iteration, so it is asked for less accuracy in time there, and compared in steps that are less coarse. Where steps
were cut short for a fast motion that even they do not resolve, its accelerations grow as steps become shorter, and with
them what an effect seems to do; so sizes count that steps of twice the length show, too.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.effect_sizes import effect_sizes
from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.response import Response, reduced_response
from rotfem.analysis.reduced.stretch import COARSE
from rotfem.analysis.reduced.tips import largest
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import Theory
from rotfem.selection.candidate import Candidate
from rotfem.selection.coarse_model import Trial

Array = npt.NDArray[np.float64]

#: Displacement of the tip over the length from which a trial is asked.
MODERATE = 0.1

#: How many times as large a displacement of another model may be for this one to be asked how large its own is.
SURELY = 2.0

#: Relative change of a history from which a trial is asked.
LARGEST = 3.0

#: Accuracy of basis and steps, with a free hub the latter of that one: changes of a history are found in one basis by
#: the same steps, and are much better than it.
ACCURACY, WITH_HUB = 1e-4, 1e-3

#: How many times as long steps are in which effects on a free hub are compared.
LONGER = 2

#: Sizes in steps of twice the length that are farther apart than by this factor, and not both as small, are not told.
AGREED, SMALL = 1.5, 1e-8


def reduced_effects(trial: Trial, theory: str, effects: Collection[str]) -> dict[str, float]:
    """Return effect ↦ relative change of the tip's displacement in a history without it; none where a trial is needed.

    Args:
        trial: the case that is tried out, with a history.
        theory: of the model, all effects in it.
        effects: those that are asked for.
    """
    linear = linear_of(trial, theory)
    if trial.case.first is not None:  # motions of reduced models begin at rest
        return {}
    if linear is None or trial.samples is None or trial.moves > SURELY * MODERATE:
        return {}
    candidate = trial.candidate(linear.name)
    try:
        response = history_of(trial, candidate, linear.name)
        if not response.met or largest(response.model, response.tips) > MODERATE * candidate.system.structure.length:
            return {}
        found = agreed(response, effects)
    except (ComputationError, np.linalg.LinAlgError):
        return {}
    return {name: size for name, size in found.items() if size < LARGEST}


def history_of(trial: Trial, candidate: Candidate, theory: str, parts: int | None = None) -> Response:
    """Return the history of a linear theory at the samples of a trial by a reduced model.

    Args:
        trial: the case that is tried out, with a history.
        candidate: the model, on any mesh.
        theory: its name.
        parts: into which the first steps are cut; as many as the accuracy asks for if None.

    Raises:
        ComputationError: the stiffness is singular, or the history not finite.
    """
    samples = trial.samples
    assert samples is not None
    times: Array = np.linspace(0.0, samples.end, len(samples.parts) + 1, dtype=np.float64)
    accuracy = ACCURACY if trial.case.problem.motion.hub is None else WITH_HUB
    shape, _ = trial.start(candidate, theory)
    return reduced_response(candidate.switched(), times, shape, accuracy, parts)


def agreed(response: Response, effects: Collection[str]) -> dict[str, float]:
    """Return effect ↦ relative change without it, as far as longer steps show the same.

    Raises:
        ComputationError: the answer to second-order forces is no small part of the motion.
    """
    manifold, longer = Manifold(response), COARSE if response.solution.hub is None else LONGER
    found = effect_sizes(response, effects, manifold, longer)
    if response.solution.parts <= longer:  # there are no longer steps
        return found
    other = effect_sizes(response, effects, manifold, 2 * longer)
    return {n: x for n, x in found.items() if max(x, other[n]) <= max(SMALL, AGREED * min(x, other[n]))}


def linear_of(trial: Trial, theory: str) -> Theory | None:
    """Return the linear theory with prestress that is the model's, or that its theory has for small motions."""
    own = trial.theories[theory]
    names = [own.name, *reversed(own.poorer)]
    able = (trial.theories[name] for name in names if name in trial.theories)
    return next((t for t in able if t.linear and t.prestress), None) if not own.linear or own.prestress else None
