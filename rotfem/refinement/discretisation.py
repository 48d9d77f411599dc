"""The errors of a history and of a steady state by steps and mesh, as differences of two computed answers.

Let u_h be the tip's displacement in steps of length h of a scheme of order p. In the asymptotic range

    |u_h − u| = |u_h − u_2h| / (2^p − 1)

(Richardson's extrapolation; Hairer, Nørsett & Wanner 1993, section II.4), and likewise in the size of the cells. Stiff
components reduce the order of a scheme to that of its stages (Hairer & Wanner 1996, section IV.15), or below: no order
is known of schemes that have more. Elements converge at least with order 2. Beyond ASYMPTOTIC, or where no order is
known, the error reported is the difference itself. What cannot be computed is unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

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

#: Relative difference of two answers up to which their order is believed.
ASYMPTOTIC = 0.05

#: Order of a scheme up to which it is that of all motions, and lowest order of elements.
CERTAIN, OF_ELEMENTS = 2, 2

#: Part of a history that must have been taken in doubled steps for their difference to stand for the whole.
MOST_OF_IT = 0.5

#: Shape and velocities at t = 0 of a system, local dof arrays; None where it is undeformed, or at rest.
Start = Callable[[Any], tuple[Array | None, Array | None]]


def error_of(difference: float, order: float, ratio: float = 2.0) -> float:
    """Return the error of the finer of two answers.

    Args:
        difference: relative.
        order: of convergence; 0 where none is known.
        ratio: of their step or cell sizes.
    """
    if difference > ASYMPTOTIC or order < 1.0:
        return difference
    return float(difference / (ratio**order - 1.0))


def error_by_cells(difference: float, ratio: float) -> float:
    """Return the error of an answer by its mesh.

    Args:
        difference: to an answer on another mesh, relative.
        ratio: of the cell sizes of the other mesh to the own ones; below 1 the other one is the finer of the two.
    """
    if ratio > 1.0:
        return error_of(difference, OF_ELEMENTS, ratio)
    return difference + error_of(difference, OF_ELEMENTS, 1.0 / ratio)


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
        richer: the problem in the theory that its answers are compared with; None for none.

    Attributes:
        steps: companion in steps of twice the length; followed by the others.
        mesh: companion in the same long steps on another mesh, and the ratio of its cell sizes to the own ones; None
            without one.
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
        richer: Problem | None = None,
    ):
        self.scheme = scheme

        same, other = system.twin(), on_other_mesh(problem, system)
        self.mesh: tuple[Companion, float] | None = None
        self.theory: Companion | None = None
        if other is not None:
            self.mesh = Companion(other[0], same, scheme, newton, doubles=False, output=output), other[1]
        if richer is not None:
            self.theory = Companion(
                compile_system(richer.replace(outputs={}), system.comm), same, scheme, newton, doubles=False
            )
        others = (None if self.mesh is None else self.mesh[0], self.theory)
        further = [companion for companion in others if companion is not None]
        self.steps = Companion(same, system, scheme, newton, further=further, output=output)
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
        if not steps.sound or state is None or not steps.doubled > MOST_OF_IT * state.t:
            return None
        whole = steps.difference[0] * max(1.0, state.t / steps.doubled)  # as if all of it had been doubled
        order = self.scheme.order if self.scheme.order <= CERTAIN else 0
        return error_of(_relative(whole, scale), order)

    def _of_mesh(self, scale: float) -> float | None:
        if self.mesh is None or not self.steps.sound or not self.mesh[0].sound:
            return None
        companion, ratio = self.mesh
        return error_by_cells(_relative(companion.difference[0], scale), ratio)


def error_of_shape(
    problem: Problem, system: Any, q: Array, solve: Callable[[Any], Array], output: Output = tip
) -> float | None:
    """Return the relative error of an equilibrium's output by the mesh; None where it is not known.

    Args:
        problem: what is computed.
        system: its system, its rotations counted as in q.
        q: the equilibrium, a local dof array.
        solve: returns the equilibrium of another system.
        output: of a state.
    """
    here = output(system, State.at_rest(system, *system.start(q.copy())))
    other = on_other_mesh(problem, system, moving=False)
    if other is None:
        return None
    coarse, ratio = other
    try:
        there = output(coarse, State.at_rest(coarse, *coarse.start(solve(coarse))))
    except ComputationError:
        return None
    return error_by_cells(_relative(float(np.linalg.norm(there - here)), float(np.linalg.norm(here))), ratio)


def _relative(size: float, scale: float) -> float:
    return size / scale if scale > 0.0 else 0.0
