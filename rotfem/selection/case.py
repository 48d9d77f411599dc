"""The case: a problem with what is to be computed of it, as the choice of a model sees it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

from rotfem.analysis.first_motion import FirstMotion
from rotfem.analysis.schemes import Scheme
from rotfem.analysis.time_loop import Steps
from rotfem.mechanics.problem import Problem
from rotfem.numerics.newton import Newton


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem, its history or steady state, and its modes. Immutable; `replace` makes variants.

    Attributes:
        problem: what moves, and how.
        steps: end and steps of the history; None where a steady state is wanted.
        scheme: time-stepping scheme of the history.
        tip_displacement: u_2 (m) of the tip of the static shape it starts from, or None.
        from_steady: whether it starts from the equilibrium at its speed.
        first: the mode or the velocities it starts with beside that; None where it starts at rest.
        mode_count: number of modes that are wanted.
        about: the state that modes are about: "steady" or "undeformed".
        increment_tolerance: at which Newton's method stops.
        history_tolerance: at which it does in a history; None where that is the same.
        max_iterations: of Newton's method.
        tolerance: relative error up to which a poorer model is good enough; None if none is to be chosen.
        unsteady: why there is neither history nor steady state; "" if there is one.
    """

    problem: Problem
    steps: Steps | None = None
    scheme: Scheme | None = None
    tip_displacement: float | None = None
    from_steady: bool = False
    first: FirstMotion | None = None
    mode_count: int = 6
    about: str = "steady"
    increment_tolerance: float = 1e-9
    history_tolerance: float | None = None
    max_iterations: int = 25
    tolerance: float | None = None
    unsteady: str = ""

    def replace(self, **changes: Any) -> Self:
        """Return a variant with other values of some attributes."""
        return replace(self, **changes)

    def newton(self, foreseeing: bool = False) -> Newton:
        """Return the iteration control, for histories one that need not see the last increment (see `Newton`)."""
        own = self.increment_tolerance
        tolerance = own if not foreseeing or self.history_tolerance is None else self.history_tolerance
        return Newton(tolerance, self.max_iterations, foreseeing=foreseeing)
