"""`rotfem explain`: which effects and which theory a scene calls for, and what each of them changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from rotfem.accuracy.answer import Answers, Setting, distance
from rotfem.accuracy.explain import (
    HISTORY,
    MODES,
    RESOLVED,
    STEADY,
    Change,
    Compared,
    Needed,
    compared,
    fails,
    needed,
)
from rotfem.accuracy.explain import explain as explain_change
from rotfem.accuracy.outputs import tip
from rotfem.analysis.equilibrium import check_steady, steady_state
from rotfem.analysis.fixed_frame import check_rotating
from rotfem.analysis.march import LARGEST_LINEAR_DEFLECTION, March, Steps
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.schemes import State
from rotfem.commands.advice import frozen_inputs
from rotfem.commands.first_state import first_state
from rotfem.commands.problem import Problem, scheme_of
from rotfem.commands.processes import communicator, summary
from rotfem.equations.compiled import compile_system
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError, input_of
from rotfem.listeners import Progress
from rotfem.mechanics.effects import Effect, Work
from rotfem.mechanics.theories import Theory, theories
from rotfem.numerics import forms
from rotfem.numerics.eigenproblem import Pencil
from rotfem.numerics.newton import Newton
from rotfem.results import ExplainResult
from rotfem.results.distance import Series, Spectrum
from rotfem.scene import Scene, as_scene

Array = npt.NDArray[Any]
T = TypeVar("T")

#: What follows from the size of a change: for an effect or a richer theory, and for a poorer theory.
NEEDED = {"negligible": "not needed", "noticeable": "needed where {:.1%} matters", "large": "needed"}
ENOUGH = {"negligible": "good enough", "noticeable": "good to {:.1%}", "large": "not good enough"}

#: Accuracy that the model is for if a scene names none: what is negligible is so for it.
ACCURACY = 1e-2


def explain(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    check: bool = False,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
    terms: Mapping[str, Work] | None = None,
) -> ExplainResult:
    """Return how much every effect and every theory changes the outputs of a scene, and the model that it calls for.

    Args:
        scene: scene, path of a scene file, or nested tables.
        check: also compute every change with the scene's own mesh and steps, next to the estimate.
        comm: MPI communicator; every rank gets the whole result.
        progress: called with the share of the work done, between 0 and 1.
        terms: further terms of the residual by name, in every model, (mechanics, variation) ↦ UFL form.

    Raises:
        SceneError: the scene is not valid.
    """
    scene = as_scene(scene)
    with input_of(scene.file):
        of = Explanation(scene, terms or {}, comm)
        check_rotating(of.problem, "explain")
        return of.result(check, progress or (lambda share: None))


def needed_model(scene: Scene, terms: Mapping[str, Work], comm: MPI.Comm) -> Needed:
    """Return the effects of a history or steady state that its accuracy calls for; all where nothing is known."""
    assert scene.accuracy is not None
    of = Explanation(scene, terms, comm, modes=False)
    of.compute(lambda share: None, ("effect",))
    return of.needed(scene.accuracy, theory=False)


@dataclass
class Outcome:
    """An output of one model.

    Attributes:
        output: of it.
        steps: that were taken; 0 of what has none.
        size: largest displacement over the length, or rotation in rad.
        stable, round_off: not asked for.
    """

    output: Any
    steps: int = 0
    size: float = 0.0
    stable: bool | None = None
    round_off: float | None = None

    def result(self) -> Any:
        """Return the output, which is all there is."""
        return self.output


class Explanation:
    """The changes of a scene's outputs by effects and theories.

    Args:
        scene: validated.
        terms: of a script, by name.
        comm: MPI communicator.
        modes: whether modes are among the outputs.

    Attributes:
        effects: all with data; `own` is the setting of the scene, with those of its model.
        absent: output ↦ why there is none; `answers` are those of the others.
        system: of the own model on the scene's mesh, effects switched by constants.
        speed: of the modes, rad/s.
        failed: output ↦ why the own model has none.
        pairs: output ↦ the own model in the settings of the comparison.
        changes: every effect there are data for, then every other theory.
    """

    def __init__(self, scene: Scene, terms: Mapping[str, Work], comm: MPI.Comm, modes: bool = True):
        self.given, self.terms, self.comm = scene, terms, comm
        changes: dict[str, Any] = {
            **dict.fromkeys(("accuracy", "accuracy_of", "accuracy_budget")),
            "output.error": False,
        }
        if scene.time is not None:  # an accuracy may have given its steps
            changes |= {"time.tolerance": scene.time.tolerance, "time.step": scene.time.step}
        if scene.model.effects == "needed":
            changes["model.effects"] = "auto"
        self.scene = scene = scene.replace({**changes, "model.frame": "rotating"})
        self.problem = problem = Problem.of(scene, terms=terms).replace(outputs={})
        self.inner, whole = communicator(problem, comm), problem.replace(effects=None)
        self.effects, kind = whole.effective_effects(), problem.structure.type
        self.own = replace(Setting.of(scene), effects=problem.effective_effects())
        self._systems: dict[tuple[str, str], Any] = {}
        self.system = self._switched(problem)
        self.own = replace(self.own, degree=self.system.V.element.basix_element.degree)  # a default differs by cell
        self.speed = self._reached()
        self.absent = self._absent()
        compute = {HISTORY: self._history, STEADY: self._steady, MODES: self._modes}
        self.answers = {
            name: Answers(scene, lambda variant, times, of=of: of(variant), moving=name == HISTORY)  # type: ignore[misc]
            for name, of in compute.items()
            if name not in self.absent and (modes or name != MODES)
        }
        self.failed, self.pairs = dict[str, str](), dict[str, Compared]()
        self.changes = [Change("effect", name, name in (self.own.effects or ())) for name in self.effects]
        others = [theory for theory in theories() if theory.holds_for(kind) and theory is not problem.theory]
        self.changes += [Change("theory", theory.name, False) for theory in others]

    def _absent(self) -> dict[str, str]:
        """Return output ↦ why there is none of it."""
        out = {STEADY: "the scene asks for a history"}
        if self.scene.time is None:
            out = {HISTORY: "the scene has no [time]"}
            try:
                self.scene.check_run()
                check_steady(self.problem.replace(effects=None))
            except InputError as error:
                out[STEADY] = str(error)
        return out

    def _reached(self) -> float:
        """Return the speed of the modes: the final one, of a free hub the largest with a rigid structure; rad/s."""
        motion, time = self.problem.motion, self.scene.time
        if motion.hub is None or time is None:
            return motion.final_speed(0.0 if time is None else time.end)
        times = np.unique([*np.linspace(0.0, time.end, 2001), *motion.hub.torque.knots])
        speeds = motion.hub.rigid_speeds(times, self.system.row.rest_inertia())
        return float(speeds[np.argmax(np.abs(speeds))])

    # --- the outputs of a model -------------------------------------------------------------------------------------

    def _switched(self, problem: Any) -> Any:
        """Return the system of a problem; those of one theory and mesh are one, with effects switched by constants."""
        whole = problem.replace(effects=None)
        key = problem.theory.name, repr(problem.mesh)
        if key not in self._systems:
            system = compile_system(whole, self.inner, self.scene.time is not None, parted=True)
            if system.linear:
                system.check_terms()
            self._systems[key] = system
        self._systems[key].leave_out(set(whole.effective_effects()) - set(problem.effective_effects()))
        return self._systems[key]

    def _of(self, variant: Scene) -> tuple[Any, Any]:
        problem = Problem.of(variant, terms=self.terms).replace(outputs={})
        return problem, self._switched(problem)

    def _history(self, variant: Scene) -> Outcome:
        problem, system = self._of(variant)
        return marched(variant, problem, system)

    def _steady(self, variant: Scene) -> Outcome:
        problem, system = self._of(variant)
        speed, newton = problem.motion.speed(0.0), Newton.of(variant.solver)
        q = with_plain_tangents(system, lambda: steady_state(system, speed, newton))
        values = tip(system, State.at_rest(system, *system.start(q)))
        return Outcome(Series(np.zeros(1), values[None, :]), size=float(system.size(q)))

    def _modes(self, variant: Scene) -> Outcome:
        """Compute the eigenvalues by size, without a rigid body, of an overdamped mode the slow one."""
        _, system = self._of(variant)
        count, newton = variant.modes.count, Newton.of(variant.solver)
        analysis = ModalAnalysis(system.model.problem, variant.modes.about, newton, system.comm, system)
        spinning = with_plain_tangents(system, lambda: analysis.at(self.speed, count))
        names = analysis.described(spinning).names[: count - int(spinning.rigid)]
        lasting = [name.rest != "fast" for name in names]
        return Outcome(Spectrum(np.asarray(spinning.pairs.resolved[: len(names)][lasting])))

    # --- what is made of them ---------------------------------------------------------------------------------------

    def compute(self, progress: Progress, kinds: tuple[str, ...] = ("effect", "theory")) -> None:
        """Compute the changes of some kinds."""
        changes = [change for change in self.changes if change.kind in kinds]
        for i, (output, answers) in enumerate(self.answers.items()):
            own = self.own if output == HISTORY else replace(self.own, scheme=None, tolerance=None, step=None)
            try:
                pair = self.pairs[output] = compared(answers, replace(own, max_step=None))
            except ComputationError as error:
                self.failed[output] = error.what
                fails(changes, output, error.what)
                continue
            for j, change in enumerate(changes):
                if not change.refused:
                    explain_change(change, output, answers, pair)
                progress((i + (j + 1) / len(changes)) / len(self.answers))

    def needed(self, accuracy: float, theory: bool = True) -> Needed:
        """Return the model that an accuracy calls for; the own one where an output of it cannot be computed."""
        effects = self.own.effects or ()
        if self.failed or not self.pairs:
            return Needed(self.own.theory, effects)
        return needed(self.changes, self.own, accuracy, self.answers, self.pairs, theory)

    def check(self, progress: Progress) -> None:
        """Compute every change in the scene's own setting, too."""
        there = [change for change in self.changes if not change.refused]
        for output, answers in self.answers.items():
            own = self.own if output == HISTORY else replace(self.own, scheme=None, tolerance=None, step=None)
            for i, change in enumerate(there, start=1):
                try:
                    change.truth[output] = distance(answers(own), answers(change.of(own))).size
                except ComputationError:
                    change.truth[output] = np.inf
                progress(i / len(there))

    def result(self, check: bool, progress: Progress) -> ExplainResult:
        """Return the result of a verb."""
        started, accuracy = perf_counter(), self.given.accuracy or ACCURACY
        self.compute(progress)
        model = self.needed(accuracy)
        spent = {"estimate": perf_counter() - started, "check": 0.0}
        if check:
            self.check(progress)
            spent["check"] = perf_counter() - started - spent["estimate"]
        self._switched(self.problem)
        numbers, theory = groups(self), self.problem.theory
        rows = [{**change.row(), "why": why(change, theory)} for change in self.changes]
        found: dict[str, Any] = {
            **summary("explain", self.given, self.comm, self.inner),
            "theory": theory.name,
            "effects": list(self.own.effects or ()),
            "groups": numbers,
            "meaning": {name: MEANING[name] for name in numbers},
            "outputs": list(self.answers),
            "resolution": RESOLVED,
            "absent_outputs": self.absent,
            "absent_effects": {e.name: e.reasons[1] for e in Effect.registry if e.name not in self.effects},
            "rows": rows,
            "needed": {
                "accuracy": accuracy,
                "theory": model.theory,
                "effects": list(model.effects),
                "dropped": list(model.dropped),
                "change": model.change,
                "seconds": model.seconds,
            },
            "speeds": [self.speed],
            "warnings": self._doubts(),
            "timings": {**spent, "total": sum(spent.values())},
        }
        return ExplainResult(found, rows)

    def _doubts(self) -> list[str]:
        """Return warnings about what the estimates are of."""
        out = [f"{name} of {self.problem.theory.name} cannot be computed: {what}" for name, what in self.failed.items()]
        if MODES in self.answers:
            out += [f"modes: {line}" for line in frozen_inputs(self.problem)]
        if self.given.model.frame == "inertial":
            out.append("estimates are of the rotating frame, where the same physics is a sum of effects")
        return out


def with_plain_tangents(system: System, compute: Callable[[], T]) -> T:
    """Return what a computation gives with the plain tangent or, if it fails, the one that takes longer to compile."""
    if system.linear:
        return compute()
    system.plain = True
    try:
        return compute()
    except ComputationError:
        system.plain = False
        return compute()
    finally:
        system.plain = True


def marched(scene: Scene, problem: Any, system: System) -> Outcome:
    """Return the tip over time of a system, at all steps."""
    time = scene.time
    assert time is not None
    start = with_plain_tangents(system, lambda: first_state(scene, problem, system, judged=False))
    times, tips, largest = list[float](), list[Array](), 0.0
    for state in March(system, scheme_of(time), Steps.of(time), Newton.of(scene.solver), start.q, start.v):
        size = float(system.size(state.q))
        largest = max(largest, size)
        times.append(state.t)
        tips.append(tip(system, state))
        if system.linear and not size <= LARGEST_LINEAR_DEFLECTION:
            raise ComputationError(f"it diverges at t = {state.t:.4g} s")
    return Outcome(Series(np.array(times), np.array(tips)), len(times) - 1, largest)


def why(change: Change, own: Theory) -> str:
    """Return in a few words why an effect or theory is in a model or not, and whether it has to be."""
    if change.refused:
        return change.refused
    failed = "".join(f"; {name}: {text}" for name, text in change.notes.items())
    if change.verdict == "unknown":
        return "these steps do not show it" + failed
    if change.kind == "effect":
        reason = Effect.registry[change.name].reasons[0]
        if not change.included:
            reason += ", but it is not in model.effects"
        return f"{reason}; {NEEDED[change.verdict].format(change.worst)}{failed}"
    poorer = Theory.registry[change.name].rank < own.rank
    return (ENOUGH if poorer else NEEDED)[change.verdict].format(change.worst) + failed


# --- dimensionless numbers --------------------------------------------------------------------------------------------

#: What each number is, in words and symbols.
MEANING = {
    "speed_ratio": "Ω/ω₁, largest speed to first frequency at rest",
    "slenderness": "L/r, length to radius of gyration of the section at the clamp",
    "deflection": "largest tip displacement/L",
    "rotation": "largest displacement/L or rotation in rad",
    "hub_ratio": "R/L, hub radius to length",
    "spin_rate_change": "largest |dΩ/dt|/ω₁²",
    "damping": "ζ, damping ratio of the first mode",
    "tip_mass_ratio": "tip (or other added) mass/mass of the structure",
    "steps_per_period": "time steps per period of the last of modes.count modes",
}


def groups(of: Explanation) -> dict[str, float]:
    """Return name ↦ number, those that a case has; `MEANING` says what they are."""
    system, time, problem = of.system, of.scene.time, of.problem
    structure, tips = problem.structure, of.pairs.get(HISTORY) or of.pairs.get(STEADY)
    values = np.empty(0) if MODES not in of.pairs else of.pairs[MODES].own[1].output.values
    # Neither a mesh file's plate nor any other structure need have a length of its own.
    length = float(getattr(structure, "length", None) or system.structure.length)
    at_rest = _frequencies_at_rest(of)
    first = float(at_rest[0]) if at_rest.size else 0.0
    speeds, rates = _turning(of)
    out = {"speed_ratio": float(np.abs(speeds).max()) / first} if first > 0.0 else {}
    if system.structure.radius > 0.0:
        out["slenderness"] = length / system.structure.radius
    if tips is not None:
        answer = tips.own[1]
        out |= {"deflection": answer.output.scale / length, "rotation": getattr(answer.outcome, "size", 0.0)}
    root = getattr(structure, "root_position", structure.hub_radius)
    out["hub_ratio"] = float(np.linalg.norm(root)) / length
    if first > 0.0:
        out["spin_rate_change"] = float(np.abs(rates).max()) / first**2
    if np.any(values[:1]) and not structure.damping.is_zero:
        out["damping"] = float(-values[0].real / abs(values[0]))
    if structure.has_tip_mass:
        out["tip_mass_ratio"] = _added_mass(system, "tip_mass")
    if time is not None and time.step is not None and (at_rest.size or len(values)):
        fastest = float(np.abs(values).max()) if len(values) else float(at_rest[-1])
        out["steps_per_period"] = 2 * np.pi / fastest / time.step
    return out


def _frequencies_at_rest(of: Explanation) -> Array:
    """Return the frequencies (rad/s) of the resting structure, its hub held; none where they cannot be computed."""
    system = of.system
    system.set_time(0.0, of.problem.motion.at_speed(0.0))
    system.set_state(system.zeros())
    try:
        return np.sort(np.abs(Pencil(*system.mass_damping_stiffness()).solve(max(2, of.scene.modes.count)).resolved))
    except ComputationError:
        return np.empty(0)


def _turning(of: Explanation) -> tuple[Array, Array]:
    """Return Ω and dΩ/dt at some times of the motion; of a free hub those of the rigid structure."""
    motion, end = of.problem.motion, of.scene.time.end if of.scene.time is not None else 0.0
    times = np.linspace(0.0, max(end, motion.settled), 401)
    if motion.hub is None:
        return np.array([motion.speed(t) for t in times]), np.array([motion.rate(t) for t in times])
    speeds = motion.hub.rigid_speeds(np.asarray(times), of.system.row.rest_inertia())
    return speeds, np.gradient(speeds, times) if end else np.zeros(len(times))


def _added_mass(system: System, effect: str) -> float:
    """Return the masses that an effect brings, as a share of the mass of the structure without them."""
    switch = system.structure.constant(1.0)
    bodies = [b for b in system.structure.bodies((effect,)) if b.is_position]
    mass = forms.form(sum((switch if b.effect == effect else 1.0) * b.density * b.measure for b in bodies), once=True)

    def total() -> float:
        return float(system.comm.allreduce(float(fem.assemble_scalar(mass))))

    whole = total()
    switch.value = 0.0
    return whole / total() - 1.0
