"""`rotfem explain`: which effects and which theory a scene calls for, and what each of them changes.

The change of an output is the distance of two answers in one setting: with and without an effect, or in another theory.
The setting is the first one, from half the cells and a loose tolerance on, whose own answer is near to that of the next
finer one. Steps are then of equal length, as many as the adaptive ones of the own model, so that errors by steps cancel
in the difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from time import perf_counter
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.accuracy.answer import Answer, Answers, Setting, distance
from rotfem.accuracy.errors import ASYMPTOTIC, finer, on_other_meshes
from rotfem.accuracy.ladder import TOLERANCES
from rotfem.accuracy.outputs import tip
from rotfem.analysis.equilibrium import check_steady, steady_state
from rotfem.analysis.march import LARGEST_LINEAR_DEFLECTION, March, Steps
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.schemes import State
from rotfem.commands.advice import beyond, frozen_inputs
from rotfem.commands.answers import in_own_setting
from rotfem.commands.first_state import first_state
from rotfem.commands.problem import Problem, scheme_of
from rotfem.commands.processes import communicator, summary
from rotfem.equations.compiled import compile_system
from rotfem.equations.system import System
from rotfem.errors import ComputationError, InputError
from rotfem.listeners import Progress
from rotfem.mechanics.effects import Effect, Work
from rotfem.mechanics.theories import Theory, theories
from rotfem.numerics.newton import Newton
from rotfem.results.distance import Series, Spectrum
from rotfem.results.of_scene import ExplainResult
from rotfem.scene import Scene

Array = npt.NDArray[Any]
T = TypeVar("T")

#: Names of the outputs that models are compared by.
HISTORY, STEADY, MODES = "history", "steady", "modes"

#: Factor by which a computed change may be wrong; relative changes from which one is noticeable, and large. They define
#: the words of a verdict.
SAFETY, NOTICEABLE, LARGE = 3.0, 1e-2, 1e-1

#: Smallest change that is resolved: Newton's increments, and round-off of eigenvalues.
RESOLVED = 1e-8

#: Relative error of an answer above which changes are unknown: that of a sine delayed by a twelfth of its period.
FAR = 0.5

#: Distance of two settings that are near, of a history and of what has no steps; settings of a history that are tried.
NEAR, MOST = {True: ASYMPTOTIC / SAFETY, False: NOTICEABLE}, 5

#: Accuracy that the model is for if a scene names none, and the part of it that all that is left out may change.
ACCURACY, SHARE = 1e-2, 0.25

#: What follows from the size of a change: for an effect or a richer theory, and for a poorer theory.
NEEDED = {"negligible": "not needed", "noticeable": "needed where {:.1%} matters", "large": "needed"}
ENOUGH = {"negligible": "good enough", "noticeable": "good to {:.1%}", "large": "not good enough"}


def needed_model(scene: Scene, terms: Mapping[str, Work], comm: MPI.Comm) -> Needed:
    """Return the effects of a history or steady state that its accuracy calls for; all where nothing is known."""
    of = Explanation(scene, terms, comm, whole=False)
    of.compute(lambda share: None)
    return of.needed()


@dataclass
class Change:
    """A change of the answer by an effect or a theory.

    Attributes:
        kind: "effect" or "theory".
        name: of the effect, or of the other theory.
        included: whether the own model has it.
        estimate: output ↦ relative change; infinite where the other model fails, None where it is unknown.
        notes: output ↦ why a model fails.
        refused: why the scene cannot have it; "" if it can.
    """

    kind: str
    name: str
    included: bool
    estimate: dict[str, float | None] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    refused: str = ""

    def of(self, own: Setting) -> Setting:
        """Return a setting of the own model with this change."""
        if self.kind == "theory":
            return replace(own, theory=self.name)
        return replace(own, effects=tuple(sorted(set(own.effects or ()) ^ {self.name})))

    @property
    def worst(self) -> float:
        """Largest known estimate over the outputs."""
        return max((x for x in self.estimate.values() if x is not None), default=0.0)

    @property
    def verdict(self) -> str:
        """Word for it: "negligible" (SAFETY times it is below 1 %), "noticeable", "large" or "unknown"."""
        if self.refused:
            return "not available"
        if self.worst >= LARGE:
            return "large"
        if None in self.estimate.values():
            return "unknown"
        return "negligible" if SAFETY * self.worst < NOTICEABLE else "noticeable"

    def why(self, own: Theory) -> str:
        """Return in a few words why it is in a model or not, and whether it has to be."""
        if self.refused:
            return self.refused
        failed = "".join(f"; {name}: {text}" for name, text in self.notes.items())
        if self.verdict == "unknown":
            return "these steps do not show it" + failed
        poorer = self.kind == "theory" and Theory.registry[self.name].rank < own.rank
        follows = (ENOUGH if poorer else NEEDED)[self.verdict].format(self.worst) + failed
        if self.kind == "theory":
            return follows
        reason = Effect.registry[self.name].reasons[0]
        return f"{reason}{'' if self.included else ', but it is not in model.effects'}; {follows}"

    def row(self, own: Theory) -> dict[str, Any]:
        """Return it as a dictionary for JSON."""
        row = asdict(self) | {"worst": self.worst, "verdict": self.verdict, "why": self.why(own)}
        return {name: row[name] for name in row if name != "refused" and (row[name] or name in ("included", "worst"))}


@dataclass(frozen=True)
class Needed:
    """The poorest model whose answer is within a part of an accuracy of the own one.

    Attributes:
        accuracy: relative.
        theory: name.
        effects: those that it has.
        dropped: names of effects that it has not.
        change: of the answer by all that is dropped together, and by the theory, relative.
        seconds: CPU times of a history with this model and with the own one in the setting of the comparison, s.
    """

    accuracy: float
    theory: str
    effects: tuple[str, ...]
    dropped: tuple[str, ...] = ()
    change: float = 0.0
    seconds: tuple[float, float] | None = None


class Explanation:
    """The changes of a scene's outputs by effects and theories.

    Args:
        scene: validated.
        terms: of a script, by name.
        comm: MPI communicator.
        whole: whether modes are among the outputs, and theories among the changes.

    Attributes:
        problem: of the own model; `system` is that on the scene's mesh, effects switched by constants.
        own: setting of the scene, with the effects of its model.
        absent: output ↦ why there is none; `answers` are those of the others.
        speed: of the modes, rad/s.
        failed: output ↦ why the own model has none.
        whole: output ↦ answer of the own model in the setting of the comparison, and its relative error.
        changes: every effect there are data for, then every other theory.
    """

    def __init__(self, scene: Scene, terms: Mapping[str, Work], comm: MPI.Comm, whole: bool = True):
        self.given, self.terms, self.comm = scene, terms, comm
        frame = "rotating" if scene.model.frame == "inertial" else scene.model.frame
        self.scene = scene = in_own_setting(scene).replace({"output.error": False, "model.frame": frame})
        problem = Problem.of(scene, terms=terms).replace(outputs={})
        self.inner, self.effects = communicator(problem, comm), problem.replace(effects=None).effective_effects()
        self._systems, self._unable = dict[tuple[str, str], Any](), dict[str, dict[str, InputError]]()
        while not hasattr(self, "system"):
            try:
                self.system = self._switched(problem)
            except InputError as error:
                if isinstance(scene.model.effects, tuple) or error.key != "model.effects":
                    raise
                able = tuple(name for name in problem.effective_effects() if name != error.value)
                problem = problem.replace(effects=able)  # "auto" takes what the theory can have
        self.problem = problem
        degree = self.system.V.element.basix_element.degree  # a default differs by cell
        self.own = replace(Setting.of(scene), degree=degree, effects=problem.effective_effects())
        self.absent, hub = self._absent(), problem.motion.hub
        self.speed = problem.motion.final_speed(0.0 if scene.time is None else scene.time.end)
        if hub is not None and scene.time is not None:  # the largest of the rigid structure
            times = np.unique([*np.linspace(0.0, scene.time.end, 401), *hub.torque.knots])
            self.speed = max(hub.rigid_speeds(times, self.system.row.rest_inertia()), key=abs)
        compute: dict[str, Any] = {HISTORY: self._history, STEADY: self._steady, MODES: self._modes}
        self.answers = {
            name: Answers(scene, of, moving=name == HISTORY)
            for name, of in compute.items()
            if name not in self.absent and (whole or name != MODES)
        }
        self.failed, self.whole = dict[str, str](), dict[str, tuple[Answer, float]]()
        self.changes = [Change("effect", name, name in (self.own.effects or ())) for name in self.effects]
        if whole:
            there = [t for t in theories() if t.holds_for(problem.structure.type) and t is not problem.theory]
            self.changes += [Change("theory", theory.name, False) for theory in there]

    def _absent(self) -> dict[str, str]:
        """Return output ↦ why there is none of it."""
        if self.scene.time is not None:
            return {STEADY: "the scene asks for a history"}
        out = {HISTORY: "the scene has no [time]"}
        try:
            self.scene.check_run()
            check_steady(self.problem.replace(effects=None))
        except InputError as error:
            out[STEADY] = str(error)
        return out

    # --- the outputs of a model -------------------------------------------------------------------------------------

    def _switched(self, problem: Problem) -> Any:
        """Return the system of a problem; those of one theory and mesh are one, with effects switched by constants."""
        whole = problem.replace(effects=None)
        key, wanted = (problem.theory.name, repr(problem.mesh)), set(problem.effective_effects())
        unable = self._unable.setdefault(problem.theory.name, {})
        while key not in self._systems or wanted & set(unable):
            for name in wanted & set(unable):
                raise unable[name]
            able = tuple(name for name in whole.effective_effects() if name not in unable)
            system = compile_system(whole.replace(effects=able), self.inner, self.scene.time is not None, parted=True)
            try:
                system.check_terms()
            except InputError as error:
                if error.key != "model.effects":
                    raise
                unable[error.value] = error  # of a linear theory, in which the others are seen without it
            else:
                self._systems[key] = system
        self._systems[key].leave_out(set(whole.effective_effects()) - set(unable) - wanted)
        return self._systems[key]

    def _of(self, variant: Scene) -> tuple[Problem, Any, Newton]:
        problem = Problem.of(variant, terms=self.terms).replace(outputs={})
        return problem, self._switched(problem), Newton.of(variant.solver)

    def _history(self, variant: Scene, times: Array | None) -> Output:
        """Return the tip at all steps."""
        (problem, system, newton), time = self._of(variant), variant.time
        assert time is not None
        start = with_plain_tangents(system, lambda: first_state(variant, problem, system, judged=False))
        t, tips = list[float](), list[Array]()
        for state in March(system, scheme_of(time), Steps.of(time), newton, start.q, start.v):
            t.append(state.t)
            tips.append(tip(system, state))
            if system.linear and not system.size(state.q) <= LARGEST_LINEAR_DEFLECTION:
                raise ComputationError(f"it diverges at t = {state.t:.4g} s")
        return Output(Series(np.array(t), np.array(tips)), len(t) - 1)

    def _steady(self, variant: Scene, times: Array | None) -> Output:
        problem, system, newton = self._of(variant)
        q = with_plain_tangents(system, lambda: steady_state(system, problem.motion.speed(0.0), newton))
        values = tip(system, State.at_rest(system, *system.start(q)))
        return Output(Series(np.zeros(1), values[None, :]))

    def _modes(self, variant: Scene, times: Array | None) -> Output:
        """Return the eigenvalues by size, without a rigid body, of an overdamped mode the slow one."""
        (_, system, newton), count = self._of(variant), variant.modes.count
        analysis = ModalAnalysis(system.model.problem, variant.modes.about, newton, system.comm, system)
        spinning = with_plain_tangents(system, lambda: analysis.at(self.speed, count))
        names = spinning.names[: count - int(spinning.rigid)]
        lasting = [name.rest != "fast" for name in names]
        return Output(Spectrum(np.asarray(spinning.pairs.resolved[: len(names)][lasting])))

    # --- what is made of them ---------------------------------------------------------------------------------------

    def _setting(self, output: str) -> Setting:
        still = {} if output == HISTORY else dict.fromkeys(("scheme", "tolerance", "step", "max_step"))
        return replace(self.own, **still)  # type: ignore[arg-type]

    def compute(self, progress: Progress) -> None:
        """Compute all changes."""
        for i, (output, answers) in enumerate(self.answers.items()):
            try:
                own, error = self.whole[output] = compared(answers, self._setting(output))
            except ComputationError as failure:
                self.failed[output] = failure.what
            for j, change in enumerate(self.changes):
                if output in self.failed:
                    change.estimate[output], change.notes[output] = np.inf, self.failed[output]
                    continue
                try:
                    size = distance(own, answers(change.of(own.setting))).size
                    change.estimate[output] = None if error > FAR else size
                except ComputationError as failure:
                    change.estimate[output], change.notes[output] = np.inf, failure.what
                except InputError as failure:
                    change.refused, change.estimate[output] = failure.allowed, None
                progress((i + (j + 1) / len(self.changes)) / len(self.answers))

    def needed(self) -> Needed:
        """Return the model that the accuracy calls for; the own one where an output of it cannot be computed.

        Effects go from the smallest one on, and the poorest theory is taken, while each change is within SHARE of the
        accuracy. Then all is left out together. While that changes an output by more, the largest of it is put back.
        """
        accuracy = self.given.accuracy or ACCURACY
        own = Needed(accuracy, self.own.theory, self.own.effects or ())
        if self.failed:
            return own
        rank = {theory.name: theory.rank for theory in theories()}
        small = [c for c in self.changes if c.worst <= SHARE * accuracy and c.verdict in NEEDED]
        out = sorted((c for c in small if c.kind == "effect" and c.included), key=lambda c: c.worst)
        poorer = [c for c in small if c.kind == "theory" and rank[c.name] < rank[own.theory]]
        out += sorted(poorer, key=lambda c: rank[c.name])[:1]
        while out:
            dropped = tuple(c.name for c in out if c.kind == "effect")
            effects = tuple(name for name in own.effects if name not in dropped)
            theory = out[-1].name if out[-1].kind == "theory" else own.theory
            change, seconds = 0.0, None
            for output, (whole, _) in self.whole.items():
                try:
                    less = self.answers[output](replace(whole.setting, theory=theory, effects=effects))
                    change = max(change, distance(whole, less).size)
                except (ComputationError, InputError):
                    change = np.inf
                    break
                if output == HISTORY:  # others are too short
                    seconds = less.seconds, whole.seconds
            if change <= SHARE * accuracy:
                return Needed(accuracy, theory, effects, dropped, change, seconds)
            out.remove(max(out, key=lambda c: c.worst))
        return own

    def result(self, progress: Progress) -> ExplainResult:
        """Return the result of the verb."""
        started, theory = perf_counter(), self.problem.theory
        self.compute(progress)
        model = self.needed()
        warnings = [f"{output} of {theory.name} cannot be computed: {what}" for output, what in self.failed.items()]
        if MODES in self.answers:
            warnings += [f"modes: {line}" for line in frozen_inputs(self.problem)]
        warnings += beyond(self.problem, [self.problem.motion.top_speed(None)])
        if self.given.model.frame == "inertial":
            warnings.append("estimates are of the rotating frame, where the same physics is a sum of effects")
        rows = [change.row(theory) for change in self.changes]
        found: dict[str, Any] = {
            **summary("explain", self.given, self.comm, self.inner),
            "theory": theory.name,
            "effects": list(self.own.effects or ()),
            "outputs": list(self.answers),
            "resolution": RESOLVED,
            "absent_outputs": self.absent,
            "absent_effects": {e.name: e.reasons[1] for e in Effect.registry if e.name not in self.effects},
            "rows": rows,
            "needed": {key: list(x) if isinstance(x, tuple) else x for key, x in asdict(model).items()},
            "speeds": [self.speed],
            "warnings": warnings,
            "timings": {"total": perf_counter() - started},
        }
        return ExplainResult(found, rows)


@dataclass(frozen=True)
class Output:
    """An outcome that is an output and no more."""

    output: Any
    steps: int = 0


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


# --- the settings of a comparison -------------------------------------------------------------------------------------


def settings(own: Setting) -> Iterator[Setting]:
    """Yield settings from the coarsest on: half the cells, the scene's own, twice them where nothing moves."""
    coarse = on_other_meshes(own)[0]
    first = own if coarse.setting.degree > own.degree else coarse.setting
    if not own.moving:
        yield from dict.fromkeys((first, own, finer(own)))
        return
    for mesh, tolerance in zip((first, *[own] * MOST), TOLERANCES[:MOST], strict=False):
        yield replace(mesh, scheme="esdirk4", tolerance=tolerance, step=None, max_step=None)


def compared(answers: Answers, own: Setting) -> tuple[Answer, float]:
    """Return the own model in the first setting whose answer is near that of the next one, and its relative error.

    Args:
        answers: of the scene.
        own: the setting that it says.

    Raises:
        ComputationError: the own model has no answer.
        InputError: likewise.
    """
    found: list[Answer] = []
    failure: ComputationError | InputError = ComputationError("no setting has an answer")
    for setting in settings(own):
        try:
            found.append(answers(setting))
        except (ComputationError, InputError) as error:  # elements of a lower degree lock, long steps may fail
            failure = error
            continue
        if len(found) > 1 and distance(*found[:-3:-1]).size <= NEAR[own.moving]:
            break
    if len(found) < 2:
        raise failure
    *_, coarse, fine = found
    apart = distance(fine, coarse).size
    answer, time = coarse if apart <= NEAR[own.moving] else fine, answers.scene.time
    if own.moving and time is not None:
        step = time.end / max(answer.outcome.steps, 1)
        answer = answers(replace(answer.setting, tolerance=None, step=step))
        apart = max(apart, distance(fine, answer).size)
    return answer, apart
