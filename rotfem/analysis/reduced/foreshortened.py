"""A response of a reduced linear model with its foreshortening given back, and what is then left of its error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.stretch import ringing, stretched, unseen
from rotfem.analysis.reduced.tips import largest
from rotfem.analysis.theory_error import TheoryError

Array = npt.NDArray[np.float64]

#: Part of the largest bending of a history up to which its start, that of a spinning structure, is bent by round-off.
UNBENT = 1e-9


def recover(response: Response) -> Foreshortened:
    """Return a response with its foreshortening and the answer to the forces of second order.

    The forces of third order, which cubic terms of the strains oppose, move it by what is taken as the error left. With
    these terms they belong to the answer; the error is what a further round moves it by, and what orders beyond do that
    fall as those that are known. To it comes what the stretch may do that linear theories take for none, as far as it
    is not of a shape whose products are known.
    """
    # a start that is bent is one of a linear theory, which third order would bend further
    bent = np.abs(response.tips[:, 1:]).max(axis=1, initial=0.0)
    manifold = Manifold(response, third=response.solution.hub is not None or bent[0] <= UNBENT * bent.max())
    path, answers = manifold.own
    kept = answers[0] if manifold.fourth is None else answers[-1]
    *_, before, last = (manifold.tip(response.q + answer) for answer in answers)
    size = largest(response.model, before)
    stretch = stretched(response) * (1.0 if manifold.fourth is None else unseen(response, manifold.shapes))
    parts = [largest(response.model, last - before), stretch, ringing(response, path)]
    if manifold.fourth is not None:
        second = manifold.tip(response.q + answers[0], third=False)
        orders = [largest(response.model, x) for x in (second - response.tips, last - second)]
        parts.append(orders[1] * min(1.0, orders[1] / max(orders[0], 1e-300)))
    off, by_stretch = (x / size if size > 0.0 else 0.0 for x in (sum(parts), parts[1]))
    return Foreshortened(response, manifold, response.q + kept, off, by_stretch)


@dataclass(frozen=True)
class Foreshortened:
    """A response with its foreshortening.

    Attributes:
        response: the linear one.
        manifold: on which it moves.
        q: coordinates in the rows, (n, m), with what the forces of second order add to those of the response.
        error: estimate of what the foreshortened displacements are off, relative to the largest of the tip.
        stretching: that part of it which the stretch makes; its law is known, that of the rest is not.
    """

    response: Response
    manifold: Manifold
    q: Array
    error: float
    stretching: float

    @property
    def tips(self) -> Array:
        """The unknowns at the tip in all rows, (n, components)."""
        return self.manifold.tip(self.q)

    def theory_error(self) -> TheoryError:
        """Return the error of the theory as far as the foreshortening does not take it away."""
        left = "the forces of third order that it lacks" if self.manifold.third is None else "a further round of it"
        basis = f"its foreshortening is given back; {left}"
        return TheoryError(self.error, basis, self.response.model.system.model.theory.name)

    def summary(self) -> dict[str, Any]:
        """Return what a summary says of it."""
        return {"shapes": self.manifold.shapes.shape[1], "error": self.error}
