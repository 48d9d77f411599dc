"""The problem of a scene, and what a script does with one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from mpi4py import MPI

from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.time_loop import March, Steps
from rotfem.equations.compiled import compile_system
from rotfem.errors import SceneError, input_of
from rotfem.mechanics.effects import Work
from rotfem.mechanics.free_hub import FreeHub, Torque
from rotfem.mechanics.motion import Motion, no_acceleration
from rotfem.mechanics.outputs import Functional, Output
from rotfem.mechanics.problem import Problem as ProblemData
from rotfem.numerics.newton import Newton
from rotfem.scene import Scene, Time, as_scene
from rotfem.selection.case import Case


class Problem(ProblemData):
    """A problem and the verbs of a script: `march`, `steady`, `system` (its parts: `rotfem.mechanics.problem`)."""

    @classmethod
    def of(
        cls,
        scene: Scene | str | Path | Mapping[str, Any],
        *,
        terms: Mapping[str, Work] | None = None,
        outputs: Mapping[str, Functional] | None = None,
    ) -> Self:
        """Return the problem of a scene.

        Args:
            scene: scene, path of a scene file, or nested tables.
            terms: further terms of the residual by name, (mechanics, variation) ↦ UFL form.
            outputs: functionals to record besides those of the scene, by name, mechanics ↦ UFL form.

        Raises:
            SceneError: the scene is not valid.
        """
        scene = as_scene(scene)
        wanted = {name: Output.registry[name].form for name in scene.output.quantities}
        with input_of(scene.file):
            return cls(
                structure=scene.structure,
                motion=motion_of(scene),
                mesh=scene.mesh,
                theory=scene.model.theory,  # type: ignore[arg-type]
                effects=None if scene.model.effects == "auto" else tuple(scene.model.effects),
                loads=scene.loads,
                frame=scene.model.frame,
                terms=terms or {},
                outputs=wanted | dict(outputs or {}),
            )

    def system(self, *, moving: bool = True, comm: MPI.Comm = MPI.COMM_WORLD) -> Any:
        """Return the compiled equations: function space `V`, residual, tangents, matrices.

        Args:
            moving: whether it will be stepped in time.
            comm: communicator the structure is distributed over.

        Raises:
            InputError: a mesh or a section that cannot be computed with.
        """
        return compile_system(self, comm, moving)

    def march(
        self,
        *,
        end: float,
        step: float | None = None,
        tolerance: float | None = None,
        scheme: Scheme | None = None,
        start: Array | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> Iterator[Moment]:
        """Yield the motion at t = 0 and at the end of every step.

        Args:
            end: last time, s.
            step: fixed step, s; None for adaptive ones.
            tolerance: error of all adaptive steps together, relative to the largest displacement.
            scheme: generalised-α with ρ∞ = 0.9 if None.
            start: shape at t = 0 (a local dof array), at rest in the turning frame; undeformed if None.
            comm: communicator the structure is distributed over.

        Raises:
            InputError: neither step nor tolerance, or both; a mesh or a section that cannot be computed with.
            ComputationError: a step failed, however short.
        """
        system = self.system(comm=comm)
        scheme = scheme or Scheme.registry["generalised_alpha"]()
        march = March(system, scheme, Steps(end, step, tolerance), Newton(monotone=True), start)
        return (Moment(system, state) for state in march)

    def steady(self, *, speed: float | None = None, comm: MPI.Comm = MPI.COMM_WORLD) -> Moment:
        """Return the equilibrium in the rotating frame at a constant speed (rad/s), that of the motion if None.

        Raises:
            ComputationError: no equilibrium was reached; says how far the load got.
        """
        system = self.system(moving=False, comm=comm)
        q = steady_state(system, self.motion.speed(0.0) if speed is None else speed, Newton())
        return Moment(system, State(0.0, q, np.zeros_like(q), np.zeros_like(q)))


class Moment:
    """The motion at one instant, as a script sees it.

    Args:
        system: the equations of motion.
        state: unknowns and rates.

    Attributes:
        t: time, s.
    """

    def __init__(self, system: Any, state: State):
        self.system, self.state, self.t = system, state, state.t

    @property
    def tip(self) -> dict[str, float]:
        """The unknowns at the tip, relative to the turning frame: u1, u2, … (m), alpha, … (rad)."""
        values = self.system.tip(self.state.q, self.t)
        return dict(zip(self.system.structure.components, map(float, values), strict=True))

    @property
    def angle(self) -> float:
        """Angle psi of the frame, rad."""
        return self._set().motion.angle(self.t)

    @property
    def speed(self) -> float:
        """Speed of the frame, rad/s."""
        return self._set().motion.speed(self.t)

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral, J."""
        return dict(self._set().energies())

    def outputs(self) -> dict[str, float]:
        """Return the output functionals of the problem."""
        return dict(self._set().outputs())

    def shape(self) -> dict[str, Array]:
        """Return the deflected structure: position of the nodes (m) and their displacements and rotations."""
        return dict(self._set().shape())

    def _set(self) -> Any:
        """Write the state into the system."""
        self.system.set_time(self.t)
        self.system.set_state(self.state.q, self.state.v, self.state.a)
        return self.system


def case_of(scene: Scene) -> Case:
    """Return the case of a scene: its problem, and what is to be computed of it."""
    time, unsteady = scene.time, ""
    try:
        scene.check_run()
    except SceneError as error:
        unsteady = str(error)
    return Case(
        problem=Problem.of(scene),
        steps=None if time is None else Steps.of(time),
        scheme=None if time is None else scheme_of(time),
        tip_displacement=scene.initial.tip_displacement,
        from_steady=scene.initial.state == "steady",
        mode_count=scene.modes.count,
        about=scene.modes.about,
        increment_tolerance=scene.solver.increment_tolerance,
        max_iterations=scene.solver.max_iterations,
        tolerance=scene.model.tolerance,
        unsteady=unsteady,
    )


def scheme_of(time: Time) -> Scheme:
    """Return the scheme that a scene's [time] table asks for."""
    return cast(Scheme, Scheme.registry[time.scheme](**time.parameters))


def motion_of(scene: Scene) -> Motion:
    """Return the motion that a scene prescribes."""
    m: Any = scene.motion
    base = m.base_acceleration
    more = {
        "base_acceleration": no_acceleration if base is None else base.at,
        "is_accelerated": m.is_accelerated,
    }
    motion = _MOTIONS[m.type](m, {"axis": m.axis, **more})
    return motion if base is None or base.constant else motion.with_changing_base()


def _torque(m: Any, more: dict[str, Any]) -> Motion:
    torque = Torque(m.pulses or (), m.table)
    return Motion.free(FreeHub(m.hub_inertia, torque, m.hub_damping, m.coupled, m.speed), **more)


#: Type of a scene's [motion] table ↦ its motion, from the table and what all motions have.
_MOTIONS: dict[str, Any] = {
    "constant": lambda m, more: Motion.constant_speed(m.speed, **more),
    "spin_up": lambda m, more: Motion.spin_up(m.speed, m.duration, **more),
    "table": lambda m, more: Motion.from_table(m.table, m.interpolation, **more),
    "callable": lambda m, more: Motion.from_functions(m.speed, m.rate, m.angle, **more),
    "torque": _torque,
}
