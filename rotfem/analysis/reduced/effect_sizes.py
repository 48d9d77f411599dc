"""How much the motion changes when an effect is left out, by a reduced model: a small solution for each.

The linear equations without the pieces of an effect, and the answer to the second-order forces that are left without it
on the manifold of foreshortened states (see `rotfem.analysis.reduced.manifold`), give the displacement of the tip that
is compared. Small effects come out within a factor of two or so; large ones are only recognised as large.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.stretch import COARSE
from rotfem.analysis.reduced.tips import largest
from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]

#: Largest part of the tip's displacement that the answer to second-order forces may be.
MOST = 0.5


def effect_sizes(
    response: Response,
    effects: Collection[str] | None = None,
    manifold: Manifold | None = None,
    longer: int = COARSE,
) -> dict[str, float]:
    """Return effect ↦ relative change of the displacement of the tip without it; infinite where nothing holds then.

    Args:
        response: history of a linear theory with all effects.
        effects: those that are asked for; all of the model if None.
        manifold: of the response, if it is known.
        longer: how many times as long as those of the response the steps are in which the effects are compared.

    Raises:
        ComputationError: the answer to second-order forces is no small part of the motion, so that it is none.
    """
    model, manifold = response.model, manifold or Manifold(response)
    system = response.solution.drive.whole
    wanted = system.model.effects if effects is None else effects
    known = response.solution.hub is None and response.solution.parts == 1  # what is compared has the same steps
    # own answers are of forces without and with third order, and maybe of a further round, which is not compared
    whole = manifold.tip(response.q + manifold.own[1][1]) if known else _tips(response, manifold, longer)
    size = largest(model, whole)
    if largest(model, whole - response.tips) > MOST * largest(model, response.tips):
        raise ComputationError("the answer to second-order forces is as large as the motion")
    out = {}
    try:
        for name in wanted:
            system.leave_out((name,))
            try:
                change = largest(model, _tips(response, manifold, longer) - whole)
            except (ComputationError, np.linalg.LinAlgError):
                change = np.inf
            out[name] = change / size if size > 0.0 else float(change > 0.0)
    finally:
        system.leave_out(())
    return out


def _tips(response: Response, manifold: Manifold, longer: int) -> Array:
    """Return the unknowns at the tip with the effects that are on, (rows, components)."""
    model, solution = response.model, response.solution.again(longer)
    path = None
    if solution.constant or solution.hub is not None:
        path = solution.solve(model, response.q[0], response.v[0])
    if solution.hub is not None:
        assert path is not None
        return manifold.tip(path.q + manifold.with_hub(solution.hub)[0])
    slow, (answer,) = manifold.corrections(solution)
    return manifold.tip((path or slow).q + answer)
