"""What a history starts from: a shape, an equilibrium, a mode, velocities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rotfem.analysis.constant_conditions import stability_ahead
from rotfem.analysis.equilibrium import static_tip_shape, steady_state
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.stability import stability_of
from rotfem.commands.problem import first_motion
from rotfem.equations.compiled import compile_system, with_all_unknowns
from rotfem.numerics.newton import Newton

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation

Array = npt.NDArray[np.float64]


def first_state(run: Simulation) -> tuple[Array | None, Array | None]:
    """Return (q, q̇) at t = 0 in the turning frame, local dof arrays; None where it is undeformed, or at rest.

    What there is to be said of them is added to the warnings of the run.
    """
    q, motion = _shape(run), first_motion(run.scene)
    if motion is None:
        return q, None
    problem, system = run.problem, run.system if motion.mode is None else None
    speed = problem.motion.speed(0.0)
    turning = problem.spinning() if system is None and speed != 0.0 else problem
    return motion.beside(q, ModalAnalysis(turning, run.scene.initial.state, comm=run.comm, system=system))


def _shape(run: Simulation) -> Array | None:
    initial, solver = run.scene.initial, run.scene.solver
    if initial.state != "steady":
        run.stability = stability_ahead(run.system, Newton.of(solver))
        if run.stability is not None and (said := run.stability.warning()):
            run.warnings.append(f"what constant conditions hold in balance: {said}")
    if initial.tip_displacement is not None:
        return static_tip_shape(run.problem, initial.tip_displacement, Newton.of(solver), run.comm)
    if initial.state != "steady":
        return None
    system = run.system
    if run.problem.frame == "inertial":
        system = compile_system(run.problem.replace(frame="rotating"), run.comm, moving=False)
    speed = run.problem.motion.speed(0.0)
    q = steady_state(system, speed, Newton.of(solver), past_limits=solver.past_limits, notes=run.warnings)
    whole = with_all_unknowns(system)
    shape = q if whole is system else steady_state(whole, speed, Newton.of(solver), past_limits=solver.past_limits)
    run.stability = stability_of(whole, shape, speed)
    if said := run.stability.warning():
        run.warnings.append(f"the motion starts from an equilibrium of its own: {said}")
    return q
