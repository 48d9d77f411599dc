"""What a history starts from: a shape, an equilibrium, a mode, velocities."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.constant_conditions import act_at_start, are_constant, stability_ahead
from rotfem.analysis.equilibrium import static_tip_shape, steady_state
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.stability import stability_of
from rotfem.commands.problem import first_motion
from rotfem.equations.compiled import compile_system, with_all_unknowns
from rotfem.errors import ComputationError
from rotfem.numerics.newton import Newton

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation

Array = npt.NDArray[np.float64]

#: What there is to be done where a history has no equilibrium to start from.
WITHOUT = 'initial.state = "undeformed" to start without an equilibrium'


def hints_of_start(run: Simulation) -> list[str]:
    """Return hints about what a history starts from: where that rings for ever, or never moves."""
    initial, problem = run.scene.initial, run.problem
    if run.scene.time is None or initial.tip_displacement is not None or not act_at_start(problem):
        return []
    if initial.state == "undeformed":
        what = "what acts at t = 0 acts all at once, and what that sets ringing is followed to the end"
        return [f'initial.state = "undeformed": {what}; "steady" starts in balance']
    if initial.moves or not are_constant(problem):
        return []
    what = "speed and loads are constant, and the history starts in balance: nothing will move"
    return [f'{what}; initial.state = "undeformed" lets them act all at once at t = 0']


def first_state(run: Simulation) -> tuple[Array | None, Array | None]:
    """Return (q, q̇) at t = 0 in the turning frame, local dof arrays; None where it is undeformed, or at rest.

    What there is to be said of them is added to the warnings of the run.
    """
    q, motion = _shape(run), first_motion(run.scene)
    if motion is None:
        return q, None
    analysis = ModalAnalysis(run.problem, run.scene.initial.state, comm=run.comm, system=run.system)
    return motion.beside(q, analysis, Newton.of(run.scene.solver))


def _shape(run: Simulation) -> Array | None:
    """Return q at t = 0 in the turning frame, local dof array; None where it is undeformed.

    Raises:
        ComputationError: there is no static shape, or no stable equilibrium.
    """
    initial, solver = run.scene.initial, run.scene.solver
    if initial.state == "steady":
        return _equilibrium(run)
    run.stability = stability_ahead(run.system, Newton.of(solver))
    if run.stability is not None and (said := run.stability.warning()):
        run.warnings.append(f"what constant conditions hold in balance: {said}")
    if initial.tip_displacement is None:
        return None
    return static_tip_shape(run.problem, initial.tip_displacement, Newton.of(solver), run.comm)


def _equilibrium(run: Simulation) -> Array | None:
    """Return the equilibrium under the speed, loads and pitch of t = 0; None where nothing acts then.

    Raises:
        ComputationError: there is none, or an unstable one.
    """
    system, solver, speed = run.system, run.scene.solver, run.problem.motion.speed(0.0)
    if run.problem.frame == "inertial":
        system = compile_system(run.problem.replace(frame="rotating"), run.comm, moving=False)
    if speed == 0.0 and not _is_loaded(system.held):
        return None

    def found(system: Any, notes: list[str]) -> Array:
        return steady_state(system, speed, Newton.of(solver), past_limits=solver.past_limits, notes=notes)

    try:
        q, whole = found(system, run.warnings), with_all_unknowns(system)
        run.stability = stability_of(whole, q if whole is system else found(whole, []), speed)
    except ComputationError as error:
        raise ComputationError(f"no equilibrium to start from: {error.what}", advice=WITHOUT) from error
    said = run.stability.warning()
    if run.stability.stable is False:
        raise ComputationError(f"the history would start from an {said}", advice=WITHOUT)
    if said:
        run.warnings.append(f"what the history starts from: {said}")
    return q


def _is_loaded(system: Any) -> bool:
    """Return whether any force acts on the undeformed structure at rest at t = 0."""
    system.set_time(0.0, system.motion.at_speed(0.0))
    system.set_state(system.zeros())
    return bool(system.residual().norm() > 0.0)
