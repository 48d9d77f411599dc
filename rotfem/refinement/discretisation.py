"""The errors of a history by steps and mesh, as differences of two computed answers.

Differences become errors by an order (see `rotfem.refinement.estimate`): that of elements, or that of the scheme. Stiff
components reduce the order of a scheme to that of its stages (Hairer & Wanner 1996, section IV.15), or below: no order
is known of schemes that have more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.time_grid import Leg
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import compared
from rotfem.numerics.newton import Newton
from rotfem.refinement.coarser import on_other_mesh
from rotfem.refinement.companion import Companion
from rotfem.refinement.distance import Output, tip
from rotfem.refinement.estimate import error_of

#: Order of a scheme up to which it is that of all motions.
CERTAIN = 2

#: Shape and velocities at t = 0 of a system, local dof arrays; None where it is undeformed, or at rest.
Start = Callable[[Any], tuple[Array | None, Array | None]]


def richer_problem(problem: Problem) -> Problem | None:
    """Return a problem in the theory that its answers are compared with; None where there is none."""
    richer = compared(problem.theory, problem.structure.type)
    return None if richer is None else problem.replace(theory=richer)


class HistoryErrors:
    """The errors of a march by its companions; a watch of its steps.

    Args:
        problem: what is computed.
        system: its system, which marches.
        scheme: of its steps.
        newton: its iteration control.
        start: what it starts from.
        output: whose errors these are.
        interval: between rows, s; None where they are ends of steps.
        richer: the problem in the theory that its answers are compared with; None for none.

    Attributes:
        steps: companion in steps of twice the length; followed by the others.
        mesh: companion in the same long steps on another mesh; None without one.
        other: that mesh; None without one.
        theory: companion in the same long steps in the richer theory, compared at the tip; None without one.
    """

    def __init__(
        self,
        problem: Problem,
        system: Any,
        scheme: Scheme,
        newton: Newton,
        start: Start,
        output: Output = tip,
        interval: float | None = None,
        richer: Problem | None = None,
    ):
        self.scheme = scheme
        same, self.other = system.twin(), on_other_mesh(problem, system)
        self.mesh: Companion | None = None
        self.theory: Companion | None = None
        if self.other is not None:
            self.mesh = Companion(self.other.system, same, scheme, newton, False, output=output, interval=interval)
        if richer is not None:
            there = compile_system(richer.replace(outputs={}), system.comm)
            self.theory = Companion(there, same, scheme, newton, doubles=False)
        further = [companion for companion in (self.mesh, self.theory) if companion is not None]
        self.steps = Companion(same, system, scheme, newton, True, further, output, interval)
        for companion in self.companions:
            try:
                companion.begin(*start(companion.system))
            except ComputationError:
                companion.sound = False

    @property
    def companions(self) -> list[Companion]:
        """All of them, each after the one that it follows."""
        return [self.steps, *self.steps.further]

    def __call__(self, old: State, new: State, leg: Leg) -> None:
        """Take note of a step of the march."""
        self.steps(old, new, leg)

    def errors(self, scale: float) -> dict[str, float | None]:
        """Return the errors by the steps, `time`, and by the mesh, `space`, at the end of the march; None is unknown.

        Args:
            scale: largest value of the output.
        """
        self.steps.finish()
        return {"time": self._of_steps(scale), "space": self._of_mesh(scale)}

    def _of_steps(self, scale: float) -> float | None:
        state, steps = self.steps.state, self.steps
        if not steps.sound or state is None or not steps.doubled > state.t / 2:  # the lesser part says too little
            return None
        whole = steps.difference[0] * max(1.0, state.t / steps.doubled)  # as if all of it had been doubled
        order = self.scheme.order if self.scheme.order <= CERTAIN else 0
        return error_of(_relative(whole, scale), order)

    def _of_mesh(self, scale: float) -> float | None:
        if self.mesh is None or self.other is None or not self.steps.sound or not self.mesh.sound:
            return None
        return self.other.error(_relative(self.mesh.difference[0], scale))


def _relative(size: float, scale: float) -> float:
    return size / scale if scale > 0.0 else 0.0
