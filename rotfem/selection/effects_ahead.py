"""What the effects of a model are worth in an answer, by a reduced model of it, and which of them nobody would miss.

Each is left out of the reduced model in turn (`rotfem.analysis.reduced.effect_sizes`). None is left out of the answer:
what an effect costs there is not worth the forms that have to be compiled without it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.reduced.effect_sizes import effect_sizes
from rotfem.analysis.reduced.response import Response
from rotfem.errors import ComputationError

#: Processor time that may be spent on it, as a part of that of the answer and, s, at least; and what every effect
#: takes, as a part of that of the reduced model.
PART, LEAST, EACH = 0.1, 0.15, 0.5

#: Error of a reduced model from which it does not say what effects are worth.
POOR = 0.5


def effects_ahead(response: Response | None, off: float, allowed: float, spent: float, comm: MPI.Comm) -> Any:
    """Return `sizes` of all effects, relative changes of the tip's displacement without each; which are `negligible`.

    Args:
        response: of the reduced model; None without one.
        off: its error, relative.
        allowed: what effects that are called negligible may come to together.
        spent: time that the answer has taken, s.
        comm: of the processes that have computed it.

    Returns:
        None where a reduced model does not say it, or not in a small part of that time.
    """
    if response is None or not off < POOR:
        return None
    number = 1 + len(response.solution.drive.whole.model.effects)
    if not comm.bcast(number * EACH * response.seconds["cpu"] <= max(LEAST, PART * spent)):
        return None
    try:
        sizes = effect_sizes(response)
    except (ComputationError, np.linalg.LinAlgError):
        return None
    negligible, together = [], 0.0
    for name, size in sorted(sizes.items(), key=lambda item: item[1]):
        together += size
        if together > allowed:
            break
        negligible.append(name)
    return {"sizes": sizes, "negligible": negligible}
