"""What a history starts from: a shape, an equilibrium, a mode, velocities."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import static_tip_shape, steady_state
from rotfem.analysis.first_motion import FirstMotion
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.stability import Stability, constant_stability, stability_of
from rotfem.equations.compiled import compile_system, with_all_unknowns
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.numerics.newton import Newton
from rotfem.scene import Scene

Array = npt.NDArray[np.float64]

#: What there is to be done where a history has no equilibrium to start from.
WITHOUT = 'initial.state = "undeformed" to start without an equilibrium'


@dataclass
class Start:
    """What a history starts from.

    Attributes:
        q, v: shape in the turning frame and velocities relative to it, local dof arrays; None where it is undeformed,
            or at rest.
        stability: of the equilibrium that it starts from, or that constant conditions hold it in; None without one.
        warnings: what is to be known of it.
    """

    q: Array | None = None
    v: Array | None = None
    stability: Stability | None = None
    warnings: list[str] = field(default_factory=list)


def first_state(scene: Scene, problem: Problem, system: System, judged: bool = True) -> Start:
    """Return what the history of a scene starts from."""
    initial, newton, start = scene.initial, Newton.of(scene.solver), Start()
    if initial.state == "steady":
        start = _equilibrium(scene, problem, system, judged)
    elif judged:
        start.stability = constant_stability(system, newton)
        if start.stability is not None and (said := start.stability.warning()):
            start.warnings.append(f"what constant conditions hold in balance: {said}")
    if initial.tip_displacement is not None:
        start.q = static_tip_shape(problem, initial.tip_displacement, newton, system.comm)
    if initial.moves:
        mode, amplitude, velocity = initial.mode, initial.amplitude or 0.0, initial.velocity
        motion = FirstMotion(mode=mode, amplitude=amplitude, phase=initial.phase, velocity=velocity)
        analysis = ModalAnalysis(problem, initial.state, comm=system.comm, system=system)
        start.q, start.v = motion.about(start.q, analysis, newton)
    return start


def _equilibrium(scene: Scene, problem: Problem, system: System, judged: bool) -> Start:
    """Return the equilibrium under the speed, loads and pitch of t = 0 (see `first_state`); undeformed without any."""
    solver, start, speed = scene.solver, Start(), problem.motion.speed(0.0)
    if problem.frame == "inertial":
        system = compile_system(problem.turning(), system.comm, moving=False)
    if speed == 0.0:
        system.set_time(0.0, system.motion.at_speed(0.0))
        system.set_state(system.zeros())
        if not system.residual().norm() > 0.0:  # nothing acts on it
            return start

    def found(system: System, notes: list[str]) -> Array:
        return steady_state(system, speed, Newton.of(solver), notes=notes)

    try:
        start.q = found(system, start.warnings)
        if not judged:
            return start
        whole = with_all_unknowns(system)
        start.stability = stability_of(whole, start.q if whole is system else found(whole, []), speed)
    except ComputationError as error:
        raise ComputationError(f"no equilibrium to start from: {error.what}", advice=WITHOUT) from error
    said = start.stability.warning()
    if start.stability.stable is False:
        raise ComputationError(f"the history would start from an {said}", advice=WITHOUT)
    if said:
        start.warnings.append(f"what the history starts from: {said}")
    return start
