"""The change of an answer by every effect and every theory: models that differ in one of them, against the scene's own.

A history is marched once as it is, in steps of twice the length and on half the cells, for its error. Then the own
model, and every model that differs by one effect or by the theory, is marched on half the cells in steps as long as
that error allows. Both have the same mesh and steps, so their distance is the change by the model,

    max_t |u_model − u_own| / max_t |u_own|,    max_i |λ_model,i − λ_own,i| / |λ_own,i|,

with u the displacement of the tip and λ the eigenvalues, sorted by size. Steps may damp or delay one model more than
the other. So changes that are neither negligible nor large are computed again in half the steps; so are all that are
not large if the error of the own answer is outside the asymptotic range. Steady states and modes are on half the cells,
too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.interpolate import CubicSpline

from rotfem.analysis.equilibrium import check_steady, steady_state
from rotfem.analysis.march import LARGEST_LINEAR_DEFLECTION, LONGEST, March, Steps
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.schemes import Scheme, State
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import theories
from rotfem.numerics.newton import Newton
from rotfem.refinement.coarser import OtherMesh, on_other_mesh
from rotfem.refinement.distance import distance, distance_each, tip
from rotfem.refinement.estimate import ASYMPTOTIC, error_of

Array = npt.NDArray[Any]
T = TypeVar("T")

#: Shape and velocities at t = 0 of a system, local dof arrays; None where it is undeformed, or at rest.
Start = Callable[[Any], tuple[Array | None, Array | None]]

#: Order up to which a scheme's order holds for all motions (Hairer & Wanner 1996, section IV.15).
CERTAIN = 2

#: Names of the outputs that models are compared by.
HISTORY, STEADY, MODES = "history", "steady", "modes"

#: Factor within which two computed changes must agree, else the larger one is a bound; relative changes from which one
#: is noticeable, and large. They define the words of a verdict.
SAFETY, NOTICEABLE, LARGE = 3.0, 1e-2, 1e-1

#: Smallest change that is resolved: Newton's increments, and round-off of eigenvalues.
RESOLVED = 1e-8

#: Relative error of a history above which changes are unknown: that of a sine delayed by a twelfth of its period.
FAR = 0.5


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem with what is to be computed of it.

    Attributes:
        problem: what moves, and how.
        steps: end and steps of the history; None where a steady state is wanted.
        scheme: time-stepping scheme of the history.
        first: system ↦ its (q, q̇) at t = 0, local dof arrays; None where it is undeformed, or at rest.
        mode_count: number of modes that are wanted.
        about: the state that modes are about: "steady" or "undeformed".
        newton: iteration control, of which everything takes its own.
        unsteady: why there is neither history nor steady state; "" if there is one.
    """

    problem: Problem
    steps: Steps | None = None
    scheme: Scheme | None = None
    first: Start
    mode_count: int = 6
    about: str = "steady"
    newton: Callable[[], Newton] = Newton
    unsteady: str = ""

    def absent(self) -> dict[str, str]:
        """Return output ↦ why there is none of it, among history, steady state and modes."""
        out = {STEADY: "the scene asks for a history"}
        if self.steps is None:
            out = {HISTORY: "the scene has no [time]"} | ({STEADY: self.unsteady} if self.unsteady else {})
        try:
            check_steady(self.problem.replace(effects=None))
        except InputError as error:
            out.setdefault(STEADY, str(error))
        return out

    def equilibrium(self, system: Any, speed: float) -> Array:
        """Return the equilibrium of a system at a speed (rad/s), a local dof array.

        Raises:
            ComputationError: there is none.
        """
        return with_plain_tangents(system, lambda: steady_state(system, speed, self.newton()))

    def start(self, system: Any) -> tuple[Array | None, Array | None]:
        """Return (q, q̇) of a system at t = 0, local dof arrays; None where it is undeformed, or at rest.

        Raises:
            ComputationError: there is no such state.
        """
        return with_plain_tangents(system, lambda: self.first(system))

    def eigenvalues(self, system: Any, speed: float) -> Array:
        """Return λ of the wanted modes at a speed (rad/s): no rigid body, of an overdamped mode the slow one.

        Raises:
            ComputationError: no equilibrium, or eigenpairs not to be trusted.
        """
        analysis = ModalAnalysis(system.model.problem, self.about, self.newton(), system.comm, system)
        spinning = with_plain_tangents(system, lambda: analysis.at(speed, self.mode_count))
        names = analysis.described(spinning).names[: self.mode_count - int(spinning.rigid)]
        lasting = [name.rest != "fast" for name in names]  # overdamped ones have two eigenvalues
        return np.asarray(spinning.pairs.resolved[: len(names)][lasting])


def with_plain_tangents(system: Any, compute: Callable[[], T]) -> T:
    """Return the result of a computation with the plain tangent; if that fails, with that of `PointStresses`."""
    held = system.held
    held.plain = True
    try:
        return compute()
    except ComputationError:
        if held.linear:
            raise
        held.plain = False
        return compute()
    finally:
        held.plain = True


@dataclass(frozen=True)
class History:
    """The displacement of the tip over time: `times` (n,) s, `tips` (n, components) m."""

    times: Array
    tips: Array

    def distance(self, coarse: History) -> float:
        """Return the largest distance to one in longer steps, at its times, relative to the largest displacement."""
        return distance(CubicSpline(self.times, self.tips)(coarse.times), coarse.tips)


@dataclass
class Change:
    """A change of the answer by an effect or a theory, or the error by steps or mesh.

    Attributes:
        kind: "effect", "theory" or "discretisation".
        name: of the effect, of the other theory, or the key of steps or mesh.
        included: whether the own model has it.
        estimate: output ↦ relative change; infinite where the other model fails, None where unknown.
        notes: output ↦ why a model fails.
        truth: output ↦ relative change on the case's own mesh and steps, where it was computed.
        bounds: outputs whose estimate is an upper bound.
    """

    kind: str
    name: str
    included: bool
    estimate: dict[str, float | None] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    truth: dict[str, float] = field(default_factory=dict)
    bounds: list[str] = field(default_factory=list)

    def settle(self, output: str, size: float | None, rough: float | None, error: float) -> bool:
        """Set the size of the change of an output; return whether it is known.

        It is known if it is large, if it is negligible with the own answer in the asymptotic range, or if it agrees
        within SAFETY with that in steps of twice the length.

        Args:
            output: name.
            size: computed; None where that failed.
            rough: the same in longer steps; None where there is none.
            error: of the own answer, relative.
        """
        size = size if error <= FAR else None
        self.estimate[output], self.bounds = size, [name for name in self.bounds if name != output]
        if size is None or size >= LARGE:
            return size is not None
        if error <= ASYMPTOTIC and SAFETY * size < NOTICEABLE:
            return True
        if rough is not None and max(size, rough) > SAFETY * min(size, rough):
            self.estimate[output] = max(size, rough)
            self.bounds.append(output)
        return rough is not None and output not in self.bounds

    @property
    def worst(self) -> float:
        """Largest known estimate over the outputs."""
        return max((x for x in self.estimate.values() if x is not None), default=0.0)

    @property
    def verdict(self) -> str:
        """Word for it: "negligible" (SAFETY times it is below 1 %), "noticeable", "large" or "unknown"."""
        if self.worst >= LARGE:
            return "large"
        if None in self.estimate.values():
            return "unknown"
        return "negligible" if SAFETY * self.worst < NOTICEABLE else "noticeable"

    def row(self) -> dict[str, Any]:
        """Return it as a dictionary for JSON."""
        row: dict[str, Any] = {"kind": self.kind, "name": self.name, "included": self.included}
        row |= {"estimate": self.estimate, "worst": self.worst, "verdict": self.verdict}
        more = {"notes": self.notes, "truth": self.truth, "bounds": self.bounds}
        return row | {name: value for name, value in more.items() if value}


class Explanation:
    """The changes of a case's outputs by effects, theories, steps and mesh.

    Args:
        case: what is computed.
        comm: MPI communicator.

    Raises:
        InputError: a mesh or a section that cannot be computed with.

    Attributes:
        effects: all with data; `own` are those of the model.
        absent: output ↦ why there is none; `wanted` are the others.
        system: of the own model on the case's mesh.
        speed: of the modes, rad/s.
        scale: largest displacement of the tip, m; and `size`, the largest displacement over the length or rotation.
        values: λ of the own model.
        failed: output ↦ why the own model has none.
    """

    def __init__(self, case: Case, comm: MPI.Comm = MPI.COMM_WORLD):
        self.case, self.absent = case, case.absent()
        self.wanted = tuple(name for name in (HISTORY, STEADY, MODES) if name not in self.absent)
        problem = case.problem.replace(frame="rotating", outputs={})
        self.own = problem.effective_effects()
        problem = problem.replace(effects=None)
        self.effects, kind = problem.effective_effects(), problem.structure.type
        others = sorted((t for t in theories() if t.holds_for(kind)), key=lambda t: t.rank)
        self.problem, self.moving, steps = problem, HISTORY in self.wanted, case.steps
        self._time: Any = case.steps
        self._scheme: Any = case.scheme
        self.system = self._compiled(problem, comm, set(self.effects) - set(self.own))
        self.speed, self.failed = self._reached(), dict[str, str]()
        self.scale = self.size = 0.0
        self.values: Array = np.empty(0)
        self.changes = [Change("effect", name, name in self.own) for name in self.effects]
        self.changes += [Change("theory", t.name, False) for t in others if t is not problem.theory]
        length = "time.tolerance" if steps is not None and steps.step is None else "time.step"
        self.steps = Change("discretisation", length, True, dict.fromkeys(self.wanted, 0.0))
        from_file = getattr(problem.structure, "mesh", None) is not None
        self.mesh = Change("discretisation", "mesh.degree" if from_file else "mesh.elements", True)
        self._others: dict[tuple[str, str], Any] = {}

    def all(self) -> list[Change]:
        """Return every effect there are data for, then every other theory, the steps of a history, and the mesh."""
        other = self._history() if self.moving else on_other_mesh(self.problem, self.system, moving=False)
        for name, of, measure in ((STEADY, self._tip, distance), (MODES, self._modes, distance_each)):
            if name in self.wanted:
                self._compare(name, of, measure, other)
        return [*self.changes, *([self.steps] if self.case.steps else []), self.mesh]

    # --- systems ------------------------------------------------------------------------------------------------------

    def _compiled(self, problem: Problem, comm: MPI.Comm, without: set[str]) -> Any:
        system = compile_system(problem, comm, self.moving, parted=True)
        if system.linear:
            system.held.check_terms()
        if without:
            system.leave_out(without)
        return system

    def _variants(self, own: Any, changes: Sequence[Change]) -> list[Any]:
        """Return the systems of changes on the mesh of one of the own model; None of a theory without all terms."""
        off, mesh = set(self.effects) - set(self.own), own.model.problem.mesh
        out = []
        for change in changes:
            if change.kind == "effect":
                out.append(own.twin())
                out[-1].leave_out(off ^ {change.name})
                continue
            if (change.name, repr(mesh)) not in self._others:
                problem = self.problem.replace(mesh=mesh, theory=change.name)
                try:
                    self._others[change.name, repr(mesh)] = self._compiled(problem, self.system.comm, off)
                except InputError as error:
                    self._others[change.name, repr(mesh)] = None
                    change.notes |= dict.fromkeys(self.wanted, str(error))
                    change.estimate |= dict.fromkeys(self.wanted, np.inf)
            out.append(self._others[change.name, repr(mesh)])
        return out

    def _reached(self) -> float:
        """Return the speed of the modes: the final one, of a free hub the largest with a rigid structure; rad/s."""
        motion, steps = self.problem.motion, self.case.steps
        hub, end = motion.hub, 0.0 if steps is None else steps.end
        if hub is None or steps is None:
            return motion.final_speed(end)
        times = np.unique([*np.linspace(0.0, end, 2001), *hub.torque.knots])
        speeds = hub.rigid_speeds(times, self.system.row.rest_inertia())
        return float(speeds[np.argmax(np.abs(speeds))])

    # --- a history ----------------------------------------------------------------------------------------------------

    def _history(self) -> OtherMesh | None:
        """March the own model, in longer steps and on another mesh, then the changes; return that mesh."""
        other = on_other_mesh(self.problem, self.system)
        try:
            own = self._marched(self.system, self._time)
        except ComputationError as error:
            self._fails(HISTORY, error.what)
            return other
        system, of_steps = self.system, self._apart(own, self.system, self._steps(2.0))
        of_mesh = None if other is None else self._apart(own, other.system, self._time)
        known = None if of_steps is None else error_of(of_steps, min(self._scheme.order, CERTAIN))
        self.steps.estimate[HISTORY] = known
        self.mesh.estimate[HISTORY] = None if other is None or of_mesh is None else other.error(of_mesh)
        if other is not None and other.ratio > 1.0 and of_mesh is not None and of_mesh <= ASYMPTOTIC:
            system = other.system
        self._refine(system, own, known)
        return other

    def _apart(self, own: History, system: Any, steps: Steps) -> float | None:
        """Return how far the history of a system is from the own one, relative; None if it fails."""
        size, scale = self.size, self.scale
        try:
            return own.distance(self._marched(system, steps))
        except ComputationError:
            return None
        finally:
            self.size, self.scale = size, scale

    def _refine(self, system: Any, own: History, error: float | None) -> None:
        """Compute the changes in steps as long as the error allows, and those not known again in halved steps.

        Args:
            system: of the own model, on the mesh of the comparison.
            own: its history in the case's own steps.
            error: of that by the steps, relative; None where it is unknown.
        """
        scheme, pending, before, rough = self._scheme, self.changes, own, dict[str, float | None]()
        if error is None or error > FAR:
            error, ratio = np.inf, 0.5
        elif error > ASYMPTOTIC:
            ratio = 2.0
        else:
            ratio = max(2.0, (ASYMPTOTIC / SAFETY / max(error, RESOLVED)) ** (1 / scheme.order) // 1)
        while pending and ratio >= 0.25:
            try:
                history, found = self._changed(system, ratio, pending)
            except ComputationError:
                history, found, reached = own, dict[str, float | None](), np.inf
            else:
                longer = ratio >= 1.0
                apart = own.distance(history) if longer else history.distance(before)
                reached = error + apart if longer else error_of(apart, min(scheme.order, CERTAIN))
            pending = [
                change
                for change in pending
                if not change.settle(HISTORY, found.get(change.name), rough.get(change.name), reached)
            ]
            before, rough, ratio = own if ratio > 1.0 else history, found, ratio / 2.0

    def _steps(self, ratio: float) -> Steps:
        """Return the case's steps in another length; adaptive ones by the tolerance."""
        steps: Any = self._time
        changed = {"step": min(steps.step * ratio, max(LONGEST * steps.end, steps.step))} if steps.step else {}
        if not changed:
            changed = {"tolerance": min(steps.tolerance * ratio**self._scheme.order, ASYMPTOTIC)}
        return Steps(**(vars(steps) | changed))

    def _marched(self, system: Any, steps: Steps) -> History:
        """Return the history of a system."""
        case, times, tips = self.case, list[float](), list[Array]()
        for state in March(system, self._scheme, steps, case.newton(), *case.start(system)):
            size = float(system.size(state.q))
            tips.append(tip(system, state))
            if system is self.system:  # at every step, for marches that fail
                self.size, self.scale = max(self.size, size), max(self.scale, float(np.linalg.norm(tips[-1])))
            if system.linear and not size <= LARGEST_LINEAR_DEFLECTION:
                raise ComputationError(f"it diverges at t = {state.t:.4g} s")
            times.append(state.t)
        return History(np.array(times), np.array(tips))

    def _changed(self, system: Any, ratio: float, changes: Sequence[Change]) -> tuple[History, dict[str, float | None]]:
        """Return the history of the own model in steps of another length, and name ↦ size of changes.

        Args:
            system: of the own model.
            ratio: of the steps to the case's own.
            changes: those that are wanted.
        """
        known, steps = (self.size, self.scale), self._steps(ratio)
        history, out = self._marched(system, steps), dict[str, float | None]()
        for change, other in zip(changes, self._variants(system, changes), strict=True):
            out[change.name] = np.inf
            if other is None:
                continue
            change.notes.pop(HISTORY, None)
            try:
                out[change.name] = history.distance(self._marched(other, steps))
            except ComputationError as error:
                change.notes[HISTORY] = error.what
        self.size, self.scale = known
        return history, out

    # --- steady state and modes ---------------------------------------------------------------------------------------

    def _tip(self, system: Any) -> Array:
        q = self.case.equilibrium(system, self.problem.motion.speed(0.0))
        if system is self.system:
            self.size = float(system.size(q))
        values = tip(system, State.at_rest(system, *system.start(q)))
        self.scale = float(np.linalg.norm(values)) if system is self.system else self.scale
        return values[None, :]

    def _modes(self, system: Any) -> Array:
        return self.case.eigenvalues(system, self.speed)

    def _compare(
        self,
        name: str,
        of: Callable[[Any], Array],
        measure: Callable[[Array, Array], float],
        other: OtherMesh | None,
    ) -> None:
        """Write the changes of an output that needs no history.

        They are computed on half the cells. If the error there is above NOTICEABLE they are computed on all cells,
        whose error is that to a finer mesh, and if this is above ASYMPTOTIC on the finer mesh.

        Args:
            name: of the output.
            of: system ↦ its output.
            measure: distance of two of them, relative to the first.
            other: the own model on another mesh; None without one.
        """
        try:
            own = of(self.system)
            there = own if other is None else of(other.system)
            apart, at = measure(own, there), self.system
            if other is not None and other.ratio > 1.0 and apart <= NOTICEABLE:
                at = other.system
            elif other is not None and other.ratio > 1.0:
                other = on_other_mesh(self.problem, self.system, self.moving, finer=True) or other
                there = of(other.system)
                apart = measure(own, there)
                at = other.system if apart > ASYMPTOTIC else at
        except ComputationError as error:
            self._fails(name, error.what)
            return
        if name == MODES:
            self.values = own
        self.mesh.estimate[name] = None if other is None else other.error(apart)
        off, known = set(self.effects) - set(self.own), (self.size, self.scale)
        others = [change for change in self.changes if change.kind == "theory"]
        systems = dict(zip((t.name for t in others), self._variants(at, others), strict=True))
        for change in self.changes:
            system = systems.get(change.name) if change in others else at
            if system is None:
                continue
            try:
                if system is at:
                    at.leave_out(off ^ {change.name})
                change.estimate[name] = measure(own if at is self.system else there, of(system))
            except ComputationError as error:
                change.estimate[name], change.notes[name] = np.inf, error.what
        at.leave_out(off)
        self.size, self.scale = known

    def _fails(self, name: str, what: str) -> None:
        """Note that the own model has no such output."""
        self.failed[name] = what
        for change in self.changes:
            change.estimate[name], change.notes[name] = np.inf, what
        self.mesh.estimate[name] = None
        if name == HISTORY:
            self.steps.estimate[name] = None
