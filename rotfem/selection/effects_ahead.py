"""What the effects of a model are worth in an answer, by a reduced model of it, and which of them nobody would miss.

Each is left out of the reduced model in turn (`rotfem.analysis.reduced.effect_sizes`). None is left out of the answer:
what an effect costs there is not worth the forms that have to be compiled without it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.reduced.effect_sizes import effect_sizes
from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.stretch import COARSE
from rotfem.errors import ComputationError

#: Steps of the reduced model, once for every effect, that may be spent on it: of an exact solution, and of collocation.
MOST = {True: 3_000, False: 800}

#: Error of a reduced model from which it does not say what effects are worth.
POOR = 0.5


def effects_ahead(response: Response | None, off: float, allowed: float, manifold: Manifold | None = None) -> Any:
    """Return `sizes` of all effects, relative changes of the tip's displacement without each; which are `negligible`.

    Args:
        response: of the reduced model; None without one.
        off: its error, relative.
        allowed: what effects that are called negligible may come to together.
        manifold: of the response, if it is known.

    Returns:
        None where a reduced model does not say it, or not quickly; of a free hub it does not.
    """
    if response is None or not off < POOR:
        return None
    system = response.solution.drive.whole
    if system.hub is not None or (1 + len(system.model.effects)) * steps(response) > MOST[response.trajectory.exact]:
        return None
    try:
        sizes = effect_sizes(response, manifold=manifold)
    except (ComputationError, np.linalg.LinAlgError):
        return None
    negligible, together = [], 0.0
    for name, size in sorted(sizes.items(), key=lambda item: item[1]):
        together += size
        if together > allowed:
            break
        negligible.append(name)
    return {"sizes": sizes, "negligible": negligible}


def steps(response: Response) -> int:
    """Return the number of steps in which a response is compared with others."""
    path, solution = response.trajectory, response.solution
    return path.steps if path.exact else len(solution.ends(response.model, COARSE)) - 1
