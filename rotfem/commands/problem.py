"""The problem of a scene, with its verbs for scripts: march, steady, modes and system."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from mpi4py import MPI

from rotfem.analysis.dense_output import write_state
from rotfem.analysis.equilibrium import check_steady, steady_state
from rotfem.analysis.march import March, Steps
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stability import Stability, stability_of
from rotfem.commands.mode_tables import mode_tables
from rotfem.equations.compiled import compile_system
from rotfem.equations.system import System
from rotfem.errors import InputError, SceneError, input_of
from rotfem.mechanics.effects import Work
from rotfem.mechanics.free_hub import ControlledTorque, FreeHub, Torque
from rotfem.mechanics.loads import load_of
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.pitch import Pitch, Scalar, constant_pitch, differentiated, harmonic_pitch, tabulated_pitch
from rotfem.mechanics.problem import Functional, Output
from rotfem.mechanics.problem import Problem as ProblemData
from rotfem.numerics.newton import Newton
from rotfem.results.modes import ModesResult
from rotfem.scene import Scene, Time, as_scene
from rotfem.scene.settings import NO_STEPS, estimates_error
from rotfem.units import si
from rotfem.users_functions import number_of


class Moment:
    """The motion at one instant, as a script sees it.

    Args:
        system: the equations of motion.
        state: unknowns and rates.

    Attributes:
        t: time, s.
    """

    def __init__(self, system: System, state: State):
        self.system, self.state, self.t = system, state, state.t

    def __repr__(self) -> str:
        return f"<Moment at t = {self.t:.6g} s>"

    @property
    def tip(self) -> dict[str, float]:
        """The unknowns at the tip, relative to the turning frame: u1, u2, … (m), alpha, … (rad)."""
        self.system.count_rotations_from(self.state.reference)
        values = self.system.tip(self.state.q, self.t)
        return dict(zip(self.system.structure.components, map(float, values), strict=True))

    @property
    def angle(self) -> float:
        """Angle psi of the frame, rad."""
        return float(self._set().motion.angle(self.t))

    @property
    def speed(self) -> float:
        """Speed of the frame, rad/s."""
        return float(self._set().motion.speed(self.t))

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral, J."""
        return dict(self._set().energies())

    def stability(self) -> Stability:
        """Return what becomes of small disturbances of an equilibrium (see `rotfem.analysis.stability`)."""
        return stability_of(self.system, self.state.q, self.speed)

    def hub(self) -> dict[str, float]:
        """Return what the history has of a free hub: `torque`, `hub_kinetic`, …; empty where none is free.

        Torque (N·m) and kinetic energy of the hub (J), angular momentum of hub and structure, angular impulse of all
        forces from outside (N·m·s) and work of torque and brake (J) since t = 0.
        """
        return hub_values(self._set(), self.state)

    def root(self) -> dict[str, float]:
        """Return force f1, f2, f3 (N) and moment m1, m2, m3 (N·m) of the hub on the structure, in axes of the frame.

        The moment is about the root: the clamped end, or the middle of a plate's clamped edges, not the axis of spin.
        """
        return dict(self._set().root_reaction())

    def outputs(self) -> dict[str, float]:
        """Return the output functionals of the problem."""
        return dict(self._set().outputs())

    def shape(self) -> dict[str, Array]:
        """Return the deflected structure: position of the nodes (m) and their displacements and rotations."""
        return dict(self._set().shape())

    def _set(self) -> Any:
        """Write the state into the system."""
        self.system.count_rotations_from(self.state.reference)
        self.system.set_time(self.t)
        write_state(self.system, self.state)
        return self.system


def hub_values(system: System, state: State) -> dict[str, float]:
    """Return the values of a free hub at a state that is written into the system (see `Moment.hub`)."""
    row = system.row
    if row is None:
        return {}
    work, impulse = (0.0, 0.0) if state.hub_work is None else map(float, state.hub_work[:2])
    own = {"torque": row.torque(state.t, after=True), "hub_kinetic": row.kinetic()}
    return {**own, "angular_momentum": row.angular_momentum(), "impulse": impulse, "work": work}


def first_shape(system: System, start: Array | Moment | None) -> Array | None:
    """Return the shape that a motion starts from (local dof array), and set the reference rotation of the system."""
    if start is None:
        return None
    reference = None
    q = np.asarray(start.state.q if isinstance(start, Moment) else start)
    if isinstance(start, Moment):
        source, reference = start.system, start.state.reference
        q = q[: len(source.zeros())]
        if reference is not None and system.structure.turns is None:
            source.count_rotations_from(reference)
            q, reference = source.structure.total(q), None
    if q.shape != system.zeros().shape:
        allowed = f"must have the {len(system.zeros())} unknowns of this structure and mesh on this process"
        raise InputError("start", f"{q.size} unknowns", allowed)
    system.count_rotations_from(reference)
    return q


# --- the problem of a scene -------------------------------------------------------------------------------------------


class Problem(ProblemData):
    """A problem and the verbs of a script (its parts: `rotfem.mechanics.problem`); `loads` as `rotfem.Loads`."""

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
        wanted = {name: Output.registry[name].form for name in scene.output.functionals}
        if twice := [name for name in outputs or {} if name in wanted]:
            raise SceneError(scene.file, "output.quantities", twice[0], "is the name of an output of the call, too")
        with input_of(scene.file):
            return cls(
                structure=scene.structure,
                motion=motion_of(scene),
                mesh=scene.mesh,
                theory=scene.model.theory,
                effects=scene.model.effects if isinstance(scene.model.effects, tuple) else None,
                loads=cast(Any, scene.loads),
                frame=scene.model.frame,
                prestress=scene.model.prestress,
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
        end: float | str,
        step: float | str | None = None,
        tolerance: float | None = None,
        scheme: Scheme | None = None,
        start: Array | Moment | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> Iterator[Moment]:
        """Yield the motion at t = 0 and at the end of every step.

        Args:
            end: last time, s, or as "2 min".
            step: fixed step, s, or as "1 ms"; None for adaptive ones.
            tolerance: error of all adaptive steps together, relative to the largest displacement.
            scheme: generalised-α with ρ∞ = 0.9 if None, with a tolerance `esdirk4`.
            start: shape at t = 0, at rest in the turning frame: that of a moment (`steady`), or a local dof array with
                rotations counted from the undeformed structure; undeformed if None.
            comm: communicator the structure is distributed over.

        Raises:
            InputError: neither step nor tolerance, or both, or one that is not positive; a tolerance for a scheme
                that does not estimate its error; a start of another mesh; supports that differ by direction; a mesh or
                a section that cannot be computed with.
            ComputationError: a step failed, however short.
        """
        if step is None and tolerance is None:
            raise InputError("time.step", None, NO_STEPS)
        given = {"end": end, "step": step, "tolerance": tolerance}
        time = Time(**{name: value for name, value in given.items() if value is not None})
        scheme = scheme or scheme_of(time)
        if tolerance is not None and not estimates_error(type(scheme)):
            raise InputError("time.tolerance", tolerance, f"{scheme.name} does not estimate its error; give step")
        system = self.system(comm=comm)
        march = March(system, scheme, Steps.of(time), Newton(), first_shape(system, start))
        return (Moment(system, state) for state in march)

    def steady(self, *, speed: float | str | None = None, comm: MPI.Comm = MPI.COMM_WORLD) -> Moment:
        """Return the equilibrium in the rotating frame at a constant speed.

        Args:
            speed: rad/s, or as "12.1 rpm"; that of the motion if None, its last where it changes.
            comm: communicator the structure is distributed over.

        Raises:
            InputError: gravity across the axis or supports that differ by direction, with which there is none; a mesh
                or a section as for `system`.
            ComputationError: no equilibrium was reached; says how far the load got.
        """
        speed = self._speed(speed)
        still = self.turning().replace(motion=self.motion.at_speed(speed))
        check_steady(still)
        system = still.system(moving=False, comm=comm)
        q = steady_state(system, speed, Newton())
        return Moment(system, State.at_rest(system, q))

    def modes(
        self,
        *,
        count: int = 6,
        speed: float | str | None = None,
        about: str = "steady",
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> ModesResult:
        """Return the modes of small vibrations at a constant speed.

        Args:
            count: number of modes.
            speed: rad/s, or as "12.1 rpm"; that of the motion if None, its last where it changes.
            about: the state that they are about: "steady" or "undeformed".
            comm: communicator the structure is distributed over.

        Raises:
            InputError: more modes than unknowns; no such state; a mesh or a section that cannot be computed with.
            ComputationError: no equilibrium, or eigenpairs that fail the check of their backward error.
        """
        if about not in ("steady", "undeformed"):
            raise InputError("modes.about", about, 'must be "steady" or "undeformed"')
        speed = self._speed(speed)
        problem = self.spinning() if speed != 0.0 else self
        analysis = ModalAnalysis(problem, about, comm=comm)
        analysis.check_count(count)
        return mode_tables(analysis.at(speed, count), count)

    def _speed(self, speed: float | str | None) -> float:
        return self.motion.final_speed(0.0) if speed is None else si(speed, "rad/s", "speed")


def scheme_of(time: Time) -> Scheme:
    """Return the scheme that a scene's [time] table asks for."""
    return cast(Scheme, Scheme.registry[time.scheme](**time.parameters))


def motion_of(scene: Scene) -> Motion:
    """Return the motion that a scene prescribes, with the pitch of its blade."""
    m: Any = scene.motion
    given = m.base_acceleration
    base = None if given is None else load_of("motion.base_acceleration", given, scene.structure, float)
    more = {"axis": m.axis, "base": base}
    if m.type in _MOTIONS:
        motion: Motion = _MOTIONS[m.type](m, more)
    else:  # functions of time, of a script or of a registered law
        law = getattr(m, "law", m)
        more |= {"breakpoints": getattr(law, "breakpoints", None), "cell": cell_of(scene.time)}
        motion = Motion.from_functions(law.speed, law.rate, law.angle, **more)
    return with_pitch(scene, motion) if scene.structure.pitches else motion


def _torque(m: Any, more: dict[str, Any]) -> Motion:
    torque = Torque(m.pulses or (), m.table)
    if m.function is not None:
        torque = ControlledTorque(controller=number_of(m.function, "motion.function", "t, psi, psi_dot and tip"))
    return Motion.free(FreeHub(m.hub_inertia, torque, m.hub_damping, m.coupled, m.speed), **more)


#: Type of a scene's [motion] table ↦ its motion, from the table and what all motions have.
_MOTIONS: dict[str, Any] = {
    "constant": lambda m, more: Motion.constant_speed(m.speed, **more),
    "spin_up": lambda m, more: Motion.spin_up(m.speed, m.duration, **more),
    "table": lambda m, more: Motion.from_table(m.table, m.interpolation, **more),
    "torque": _torque,
}


def with_pitch(scene: Scene, motion: Motion) -> Motion:
    """Return the motion of a scene with the pitch of its blade, which may change with time."""
    structure: Any = scene.structure
    given = structure.root.pitch
    angles, parts = given.over_time, [constant_pitch(given.value[0] if given.value else 0.0)]
    parts += [harmonic_pitch(h.amplitude[0], h.phase, _turn(h, motion)) for h in given.harmonic]
    knots = motion.sharp if any(h.per_rev is not None for h in given.harmonic) else ()
    if callable(angles):
        key = "structure.root.pitch"
        rate = given.rate and number_of(given.rate, f"{key}.rate", "time")
        parts.append(differentiated(number_of(angles, key, "time"), rate, cell_of(scene.time)))
    elif angles is not None:
        parts.append(tabulated_pitch(angles))
        knots = tuple(sorted({*knots, *(row[0] for row in angles)}))

    def summed(i: int) -> Scalar:
        return lambda t: sum(part[i](t) for part in parts)

    angle, rate, acceleration = map(summed, range(3))
    axis, root = np.array(structure.root_axis), np.array(structure.root_position)
    known = not callable(angles) and not given.harmonic
    return motion.pitched(Pitch(angle, rate, acceleration, axis, root, knots, known, start=angle(0.0)))


def cell_of(time: Time | None) -> float | None:
    """Return the time (s) in which differences have one step: of 16 steps, or a 64th of a history."""
    if time is None:
        return None
    return 16 * time.step if time.step else time.end / 64


def _turn(harmonic: Any, motion: Motion) -> tuple[Scalar, Scalar, Scalar]:
    """Return the argument of a harmonic's cosine without its phase, and its two rates."""
    if harmonic.per_rev is None:
        omega = harmonic.frequency
        return (lambda t: omega * t), (lambda t: omega), (lambda t: 0.0)
    n = harmonic.per_rev
    return (lambda t: n * motion.angle(t)), (lambda t: n * motion.speed(t)), (lambda t: n * motion.rate(t))
