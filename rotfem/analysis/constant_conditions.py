"""What a history under constant conditions moves about: an equilibrium, which may be unstable though nothing leaves it.

A symmetric structure under symmetric loads never leaves an unstable equilibrium by itself: its history looks calm.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.equilibrium import gravity_turns
from rotfem.analysis.load_steps import Growth, balance
from rotfem.analysis.stability import Stability, stability_of
from rotfem.equations.compiled import with_all_unknowns
from rotfem.errors import ComputationError
from rotfem.mechanics.loads import named
from rotfem.mechanics.problem import Problem
from rotfem.numerics.newton import Newton


def are_constant(problem: Problem) -> bool:
    """Return whether speed, base acceleration, loads and gravity are constant in a frame that turns with the hub."""
    motion, applied = problem.motion, named(problem.loads).values()
    turning = problem.frame == "rotating" and motion.hub is None
    return turning and motion.constant and all(load.constant for load in applied) and not gravity_turns(problem)


def act_at_start(problem: Problem) -> bool:
    """Return whether the hub spins, or is accelerated, or a load acts, at t = 0."""
    motion, applied = problem.motion, [load for load in named(problem.loads).values() if not load.is_zero]
    forces = [np.asarray(problem.loads.gravity), motion.base_acceleration(0.0), *(load.at(0.0) for load in applied)]
    return motion.speed(0.0) != 0.0 or any(force.any() for force in forces)


def constant_stability(system: Any, newton: Newton) -> Stability | None:
    """Return the stability of the equilibrium of constant conditions; None where there is none that is found at once.

    Args:
        system: equations of motion; state and time are left at the equilibrium where it has all unknowns.
        newton: iteration control.
    """
    problem = system.model.problem
    if not are_constant(problem):
        return None
    system, speed = with_all_unknowns(system), problem.motion.speed(0.0)
    try:
        q = balance(system, Growth(speed), 1.0, system.zeros(), newton, looked_at=False)
        return stability_of(system, q, speed)
    except ComputationError:
        return None
