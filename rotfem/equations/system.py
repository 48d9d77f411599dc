"""The equations of motion F(q, v, a; δq) = 0 of a problem, and their tangents, compiled.

F = Σ virtual work of inertia, effects, stress, damping and loads; M = ∂F/∂a, C = ∂F/∂v, K = ∂F/∂q by `ufl.derivative`.
What all systems share is here: the state and the time of the forms, solutions with their matrices, readings. The
nonlinear one is in `nonlinear`, that of the linear theories in `affine`; `compiled` adds the angle of a free hub.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import lru_cache
from time import perf_counter
from typing import Any, Generic, Protocol, TypeVar, cast

import numpy as np
import numpy.typing as npt
from dolfinx import la
from mpi4py import MPI
from petsc4py import PETSc

from rotfem.equations.clamp import RootReaction, TurningClamp
from rotfem.equations.hub import HubRow
from rotfem.equations.modal_damping import EFFECT, ByMode, damping_by_mode
from rotfem.equations.model import Model
from rotfem.errors import ComputationError
from rotfem.mechanics.loads import is_moment
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.time_signals import TimeSignal, View
from rotfem.numerics import compat, forms
from rotfem.numerics.forms import Assembler, Functionals, added
from rotfem.numerics.linear import DirectSolver, SingularSolver, is_regular
from rotfem.numerics.projection import PlusLowRank, summed, with_ghosts
from rotfem.structures.beam import Beam
from rotfem.structures.reference_rotation import ReferenceRotation

Array = npt.NDArray[np.float64]


class Instant(Protocol):
    """The motion at an instant: time (s), unknowns and rates, and what a free hub was given (see `System.hub_work`)."""

    t: float
    q: Array
    v: Array
    a: Array
    hub_work: Array | None


T = TypeVar("T")


class per_composition(Generic[T]):
    """A property of a system that is made once, and anew with its forms (see `System.count_rotations_from`)."""

    def __init__(self, make: Callable[[Any], T]):
        self._make, self.__doc__ = make, make.__doc__

    def __get__(self, system: System, kind: Any = None) -> T:
        if self._make not in system.kept:
            system.kept[self._make] = self._make(system)
        found: T = system.kept[self._make]
        return found


class System(ABC):
    """A compiled system: residual and tangent at (q, v, a, t), and solutions with its tangent.

    Args:
        model: the terms.
        moving: whether velocities and accelerations will be set, as in a history. A system that is not moving has
            forms of its own at v = a = 0, which compile in a fraction of the time.
        parted: whether effects can be left out at rest too, as in comparisons of models.
        view, signals: see below.

    Attributes:
        q, v, a: dolfinx functions that hold the state the forms are evaluated at.
        linear: whether its theory is linear in q.
        solved_at_once: whether one solution of a step is exact.
        settled: whether M, C and K are those of the time before; known of linear theories alone.
        scale: size of each local unknown (m or 1), by which increments are judged.
        clamp: motion of the clamp, where the frame does not rotate with it.
        root: rigid motions of what is clamped, which forces and moments at the root work on.
        hub: what turns freely; None where the rotation is prescribed.
        row: its equation; None likewise.
        signals: prescribed data that change with time.
        view: how they are evaluated (`rotfem.mechanics.time_signals`).
        keeps_factor: whether a factor is kept over steps: where a factorisation takes much longer than a solution.
        seconds: time spent on assembly and solution of steps.
        assembled: time spent on assembly while compiling, s.
        plain: whether tangents are without `PointStresses`, which need a form of their own.
        analysed: a solver with a symmetric matrix of the pattern, whose ordering others use; None at first.
        left_out: effects that are switched off.
        by_mode: the part of C by mode; None without, and where damping is left out.
        assembler: makes matrices of the pattern of all tangents.
        compositions: of the model that the forms are of: 1, or 2 after a change of the reference rotation.
        kept: what is made once for the forms, by what makes it.
    """

    linear = False
    solved_at_once = False
    settled = False
    plain = False
    left_out: frozenset[str] = frozenset()
    row: HubRow | None = None
    analysed: DirectSolver | None = None

    def __init__(
        self,
        model: Model,
        moving: bool = True,
        parted: bool = False,
        view: View | None = None,
        signals: Collection[TimeSignal] = (),
    ):
        self.view, self.signals, self.parted = view or View(), tuple(signals), parted
        self.model, self.structure, self.motion, self.moving = model, model.structure, model.motion, moving
        self.comm, self.shared, self.hub = model.comm, model.comm.size > 1, model.motion.hub
        self.q, self.v, self.a, _ = self.structure.k.functions
        self.V = self.structure.V
        #: Values of the frame's constants at the last few times, as iterations come back to them.
        self._frame_at = lru_cache(maxsize=8)(lambda t, *_: self.model.frame.values(self.motion, t))
        self._state = tuple(x.x.array for x in (self.q, self.v, self.a))
        self.scale = self.structure.scales()
        self.assembled = 0.0
        self.seconds = {"assemble": 0.0, "solve": 0.0}
        self.bcs, self.clamped = self.structure.clamp_conditions(), self.structure.clamped_unknowns()
        self.clamp = TurningClamp(cast(Beam, self.structure), self.motion) if model.fixed else None
        self.root = RootReaction(self.structure)
        self._b = la.vector(self.V.dofmap.index_map, self.V.dofmap.index_map_bs)
        self._b_array = self._b.array
        self.b = compat.wrap(self._b)
        self.by_mode: ByMode | None = None
        self._compose()
        self._by_mode = self.by_mode = damping_by_mode(model, self.matrices_at_rest)
        self.keeps_factor = self.A.getSize()[0] > (5000 if self.structure.mesh.topology.dim == 1 else 300)

    def _compose(self) -> None:
        """Compile the forms of the model as it is now."""
        self._solver: DirectSolver | None = None
        self.kept = dict[Any, Any]()
        self.assembler = self._compile()
        self.A, self.compositions = self.assembler.pattern, self.model.compositions
        if self.hub is not None:
            self.row = HubRow(self.model, self.clamped)
            self.row.coupled &= "hub_coupling" not in self.left_out

    def count_rotations_from(self, reference: ReferenceRotation | None) -> None:
        """Count rotations from a reference (`rotfem.structures.reference_rotation`), None for the undeformed structure.

        The first time all forms are compiled again, with the reference in them; `set_time` must follow.
        """
        turns = self.structure.turns
        if reference is not None and self._by_mode is not None:
            raise ComputationError(
                "the rotations have become too large for damping by mode, which is that of small motions",
                time=self.time,
                advice="structure.damping.kelvin_voigt or rayleigh",
            )
        if turns is None:
            return
        if turns.use(reference):
            self.model.compose()
            self.model.compositions += 1
        if reference is not None and self.compositions < self.model.compositions:
            self._compose()

    @property
    def reference(self) -> ReferenceRotation | None:
        """What rotations are counted from; None for the undeformed structure."""
        return None if self.structure.turns is None else self.structure.turns.reference

    def check_reach(self, q: Array, time: float | None = None) -> None:
        """Refuse rotations in q (local dof array) that are too far from their reference."""
        if self.structure.turns is not None:
            self.structure.turns.check(q, time)

    # --- what kinds of systems differ in -----------------------------------------------------------------------------

    @abstractmethod
    def residual(self) -> Any:
        """Return −F at the state in q, v, a as a PETSc vector (reused), zero at clamped unknowns."""

    @abstractmethod
    def tangent(self, c_k: float, c_v: float, c_m: float, before: Array | None = None) -> tuple[Any, bool]:
        """Return (c_k K + c_v C + c_m M at the state, whether it changed); clamped rows are identity rows.

        Given the q before the last correction, its geometric part may have other stresses (see `PointStresses`).
        """

    @abstractmethod
    def matrix(self, c_k: float, c_v: float, c_m: float, diagonal: float) -> Any:
        """Return a new matrix c_k K + c_v C + c_m M at the state with `diagonal` at clamped unknowns."""

    @abstractmethod
    def _compile(self) -> Assembler:
        """Compile the forms; return what makes matrices of the pattern of all tangents."""

    @abstractmethod
    def spin_derivative(self, c_v: float, c_m: float) -> Any:
        """Return c_v ∂F/∂Omega + c_m ∂F/∂Omega' at the state: the speed along the axis varies; a PETSc vector."""

    def check_terms(self) -> None:  # noqa: B027
        """Refuse terms of a user that the equations cannot have."""

    @property
    def current(self) -> bool:
        """Whether M, C and K of the last tangent are those of this time; known of linear theories alone."""
        return False

    def leave_out(self, effects: Collection[str]) -> None:
        """Switch effects off, all others on."""
        self.left_out = frozenset(effects)
        self.model.switch_off(self.left_out)
        self.by_mode = None if EFFECT in effects else self._by_mode

    @per_composition
    def _spun(self) -> Any:
        return compat.create_vector(self.V)

    def with_modes(self, A: Any, c_v: float) -> Any:
        """Return A + c_v times the part of C that is damping by mode, of an A with c_v times all else in C."""
        return A if self.by_mode is None or c_v == 0.0 else PlusLowRank(A, self.by_mode, c_v)

    # --- state -------------------------------------------------------------------------------------------------------

    def zeros(self) -> Array:
        """Return a local dof array of the structure that is zero."""
        return np.zeros_like(self.q.x.array)

    def start(self, q: Array) -> tuple[Array, Array]:
        """Return (q, v) at t = 0 of a shape, given in the turning frame, that rests there."""
        return (q, np.zeros_like(q)) if self.clamp is None else self.clamp.rigid(q, 0.0)

    def local(self, x: Array) -> Array:
        """Return the local dof array of an owned one."""
        return with_ghosts(self.V, x) if self.shared else x

    def set_state(self, q: Array, v: Array | None = None, a: Array | None = None) -> None:
        """Write local dof arrays into the functions q, v, a that the forms are evaluated at; zero where None."""
        to_q, to_v, to_a = self._state
        to_q[:], to_v[:], to_a[:] = q, 0.0 if v is None else v, 0.0 if a is None else a

    @contextmanager
    def over_step(self, start: Instant, end: float, memory: Any) -> Iterator[Any]:
        """Take the equations over a whole step from a start to an end (s), in place of those at an instant.

        Yield what balances its energy (`rotfem.equations.nonlinear`); None of a linear theory, whose F does so itself.
        """
        yield None

    def set_time(self, t: float, motion: Motion | None = None, load_factor: float = 1.0) -> None:
        """Write the frame and load constants of time t (s), for the problem's motion unless another is given.

        The load factor multiplies loads, gravity and base acceleration, not the spin.
        """
        own, motion = motion is None and load_factor == 1.0 and self.hub is None, motion or self.motion
        self.model.time = t
        self.model.switch_off(self.left_out)
        if own:
            values = self._frame_at(t, self.view.side, self.view.line, len(self.model.frame.constants))
        else:
            values = self.model.frame.values(motion, t)
        if load_factor != 1.0:
            values = {n: v * load_factor if n in ("a_o", "gravity") else v for n, v in values.items()}
        self.model.frame.set(values)
        if self.structure.load_constants:
            for name, value in self.load_values(t, motion).items():
                self.structure.load_constants[name].value[...] = load_factor * value
            self.structure.update_loads(motion.rotation(t) if self.model.fixed else None)

    def load_values(self, t: float, motion: Motion) -> dict[str, Array]:
        """Return the amplitude of every load constant at time t (s); in a fixed frame dead loads turn with the hub."""
        turn = motion.rotation(t) if self.model.fixed else None
        values = {}
        for name, amplitude in self.structure.load_constants.items():
            value = np.atleast_1d(np.asarray(amplitude.at(t), dtype=float))
            values[name] = value if turn is None or not amplitude.dead else amplitude.turned(value, turn)
        return values

    def driven(self, t: float) -> Array:
        """Return all prescribed data at time t (s) in the present view, one after the other."""
        values = {**self.model.frame.values(self.motion, t), **self.load_values(t, self.motion)}
        clamp = () if self.clamp is None else self.clamp.at(t)
        return np.concatenate([np.ravel(v) for v in (*values.values(), *clamp)] or [np.empty(0)])

    def prescribe(self, t: float, q: Array, v: Array, a: Array) -> None:
        """Write the motion of the clamp at time t (s), exact in q, v and a, where the frame does not turn with it."""
        if self.clamp is not None:
            dofs = self.clamp.dofs
            q[dofs], v[dofs], a[dofs] = self.clamp.at(t)

    # --- solutions -------------------------------------------------------------------------------------------------

    def correction(self, shifts: tuple[float, float, float], before: Array | None = None) -> Array:
        """Return −(c_k K + c_v C + c_m M)⁻¹ F at the state, Newton's correction of q (a local array, reused)."""
        started = perf_counter()
        b = self.residual()
        A, changed = self.tangent(*shifts, before)
        return self._timed(started, b, A, changed)

    def chord(self) -> Array:
        """Return the correction of q at the state with the present factor."""
        started = perf_counter()
        return self._timed(started, self.residual())

    def _timed(self, started: float, b: Any, A: Any = None, changed: bool = False) -> Array:
        """Return the solution of A x = b, of the factor at hand without A, and count the time of its two parts."""
        assembled = perf_counter()
        dq = self.local(self.factor(A, changed).solve(b))
        self.seconds["assemble"] += assembled - started
        self.seconds["solve"] += perf_counter() - assembled
        return dq

    def imbalance(self) -> Array:
        """Return the owned part of −F at the state, a copy."""
        return np.array(self.residual().array)

    def factor(self, A: Any, changed: bool = True) -> DirectSolver:
        """Return the solver of the system's tangent A, with a new factor where it has changed."""
        if self._solver is None or changed:
            self._solver = self._solver or DirectSolver(A)
            self._solver.refresh(A)
        return self._solver

    @property
    def factorisations(self) -> int:
        """Number of matrix factorisations so far."""
        return self._solver.factorisations if self._solver else 0

    def acceleration(self) -> Array:
        """Return the correction δa with which F = 0 at the state and time set: M δa = −F.

        Unknowns without inertia (the rotation without rotary inertia) follow the others: K δa = 0 in their rows.
        """
        solver, massless = self.mass_solver()
        b = self.residual()
        b.array[massless] = 0.0
        return self.local(solver.solve(b))

    def mass_solver(self) -> tuple[DirectSolver | SingularSolver, Array]:
        """Return a solver with M at the state, where it has to be completed with K, and unknowns without inertia.

        A mass off the axis can leave a combination of rotations without inertia; then a multiple of K is added to M
        that is negligible for all motions with inertia.
        """
        M = self.matrix(0.0, 0.0, 1.0, 1.0)
        none = M.getDiagonal()
        none.array[:] = none.array == 0.0
        massless = np.asarray(none.array > 0.0)
        if none.norm() > 0.0:
            K = self.matrix(1.0, 0.0, 0.0, 1.0)
            K.diagonalScale(none)
            M.axpy(1.0, K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        solver = DirectSolver(M)
        if is_regular(M, solver):
            return solver, massless
        K = self.matrix(1.0, 0.0, 0.0, 1.0)
        K.scale(1e-9 * M.norm() / K.norm())
        return SingularSolver(M, K), massless

    # --- matrices --------------------------------------------------------------------------------------------------

    def mass_damping_stiffness(self, keep: bool = True) -> tuple[Any, Any, Any]:
        """Return (M, C, K) at the state and time set; clamped unknowns have 1 in K, 0 in M and C."""
        return self.matrix(0, 0, 1, 0.0), self.matrix(0, 1, 0, 0.0), self.matrix(1, 0, 0, 1.0)

    def matrices_at_rest(self) -> tuple[Any, Any]:
        """Return (M, K) of the undeformed structure at rest on its supports, without spin and loads.

        As `mass_damping_stiffness` does.

        To be asked for before effects are switched.
        """
        constants = [*self.model.frame.constants.values(), *self.structure.load_constants.values()]
        kept = [c.value.copy() for c in constants], [x.copy() for x in self._state]
        for constant in constants:
            constant.value[...] = 0.0
        frame = self.model.frame
        frame.set({name: of(0.0) for name, of in frame.of_supports.items()})
        self.set_state(self.zeros())
        out = self.matrix(0, 0, 1, 0.0), self.matrix(1, 0, 0, 1.0)
        for constant, value in zip(constants, kept[0], strict=True):
            constant.value[...] = value
        self.set_state(*kept[1])
        return out

    def with_hub(self, matrices: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        """Return M, C, K with the angle of a free hub as last unknown; there is none here."""
        return matrices

    def hub_work(self, new: Instant, old: Instant | None = None) -> Array | None:
        """Return (work, impulse, moment) of a free hub at the end of a step, or at a first instant; None without one.

        Work (J) of torque and brake and the angular impulse (N·m·s) of all forces from outside are since t = 0; the
        moment (N·m) of these forces but torque and brake is kept for the next step.
        """
        return None

    # --- readings of a state, the same on every process -----------------------------------------------------------

    @property
    def time(self) -> float:
        """Time that is set, s."""
        return self.model.time

    @abstractmethod
    def clamp_forces(self) -> Array:
        """Return this process's part of the clamp's work in its unit motions at the state and time set."""

    @abstractmethod
    def clamp_tangents(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of `clamp_forces` to q, v and a of the owned unknowns at an equilibrium that is set.

        Three arrays (unknowns, motions), of K, C and M.
        """

    def size(self, x: Array) -> float:
        """Return the largest entry of a local dof array in units of `scale`, over all ranks; a hub's angle apart."""
        here = float(np.maximum.reduce(np.abs(x[: len(self.scale)]) / self.scale, initial=0.0))
        return self.comm.allreduce(here, op=MPI.MAX) if self.shared else here

    def product(self, x: Array, y: Array) -> float:
        """Return the sum of the products of the entries of two local dof arrays in units of `scale`, over all ranks."""
        owned = slice(0, self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs)
        return float(summed(self.comm, (x[owned] / self.scale[owned]) @ (y[owned] / self.scale[owned])))

    increment_size = size  # of a correction by which Newton is judged; a hub's angle is among the unknowns then

    def tip(self, q: Array, t: float) -> Array:
        """Return the values of the unknowns at the tip, relative to the turning frame, shape (components,)."""
        tip = self.structure.whole_values(self.structure.tip_values(self.structure.total(q)))
        return np.asarray(self.seen_from_hub(tip[None, :], self.structure.length, t)[0])

    def seen_from_hub(self, values: Array, x: Any, t: float) -> Array:
        """Return all components (n, components) of points at x (m) at time t (s) in the frame that turns with the hub.

        That is the frame of the unknowns but in the inertial form, and under a pitch over time.
        """
        if self.clamp is not None:
            return self.clamp.relative(values, x, t)
        pitch = self.motion.pitch
        return values if pitch is None else pitch.in_hub_axes(values, t)

    def root_reaction(self) -> dict[str, float]:
        """Return force (N) and moment (N·m) of the hub on the structure at the state and time set, axes of the hub.

        The moment is about the root, `root.place`; keys f1, f2, … m3, as far as the structure has them.
        """
        values = summed(self.comm, self.clamp_forces())
        found = dict(zip(self.root.names, map(float, values), strict=True))
        if self.clamp is not None:
            c, s = np.cos(self.clamp.angle(self.time)), np.sin(self.clamp.angle(self.time))
            found |= {"f1": c * found["f1"] + s * found["f2"], "f2": c * found["f2"] - s * found["f1"]}
        if self.motion.pitch is not None:
            turned = self.motion.pitch.in_hub_axes(np.array(list(found.values())), self.time)
            found = dict(zip(found, map(float, turned), strict=True))
        return found

    def support_forces(self) -> dict[str, float]:
        """Return the forces (N) and moments (N·m) of the structure on its supports at the state and time set.

        Keys are support_0_f2, support_0_f3, …, components in the frame.
        """
        state, speed = (self.structure.total(self.q.x.array), self.v.x.array), float(self.motion.speed(self.time))
        found = self.structure.support_forces(self.model.frame, speed, *state)
        return {f"{name}{i}": float(x) for name, f in found.items() for i, x in zip((2, 3), f, strict=True)}

    def check_inside_out(self, time: float | None = None) -> None:
        """Refuse a state that is set and turned inside out, which Newton's method may have led to."""
        if not self.linear and self.model.inside_out():
            raise ComputationError("Newton met a state that is turned inside out (an axial strain below −1)", time=time)

    def shape(self) -> dict[str, Array]:
        """Return the deflected structure at the state: position x (m), u1, u2 (m), alpha, … in the turning frame."""
        coordinates, q = self.structure.nodes(self.structure.total(self.q.x.array))
        q = self.seen_from_hub(q, coordinates["x"], self.time)
        return {**coordinates, **{name: q[:, i] for i, name in enumerate(self.structure.components)}}

    @per_composition
    def _energies(self) -> Functionals:
        return Functionals(self.model.energies(), self.structure.mesh)

    @per_composition
    def _moment(self) -> Any:
        """Return the sum of all applied moments, compiled; None without. Of planar beams, whose axis is the spin's."""
        moments = [load for load in self.model.mechanics.loads if is_moment(load.name)]
        return forms.form(added(load.force * load.measure for load in moments)) if moments else None

    @per_composition
    def _outputs(self) -> dict[str, Any]:
        return {name: forms.form(form) for name, form in self.model.outputs().items()}

    def compile_readings(self) -> None:
        """Compile energies and outputs, which are otherwise compiled when first used."""
        _ = self._energies, self._outputs

    def total(self, form: Any) -> float:
        """Return the value of a compiled functional over all ranks; 0 of None."""
        return 0.0 if form is None else float(summed(self.comm, forms.functional(form)))

    def outputs(self) -> dict[str, float]:
        """Return the functionals of the problem at the state and time set."""
        return {name: self.total(form) for name, form in self._outputs.items()}

    def energies(self) -> dict[str, float]:
        """Return kinetic and strain energy and the Jacobi integral T2 − T0 + W + V, J.

        V is the potential of dead loads, gravity and base acceleration; the integral is constant while these and the
        spin are constant in the frame and nothing dissipates.
        """
        e = self._energies()
        kinetic = e["T2"] + e.get("T1", 0.0) + e.get("T0", 0.0) + e.get("origin", 0.0)
        if "momentum" in e:
            spin = self.motion.speed(self.time) * float(self.motion.axis[2])
            jacobi = kinetic - spin * e["momentum"] + e["strain"]
        else:
            jacobi = e["T2"] - e.get("T0", 0.0) + e["strain"]
        potential = e.get("potential", 0.0)
        if self.clamp is not None:  # a dead moment works on the rotation relative to the hub, alpha − psi
            potential += self.total(self._moment) * self.clamp.angle(self.time)
        return {"kinetic": kinetic, "strain": e["strain"], "jacobi": jacobi + potential}
