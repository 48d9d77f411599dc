"""One step of any scheme on any system: its stages solved one after the other, halved where Newton fails."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.schemes import Array, Observer, Scheme, Shifts, Stage, State
from rotfem.errors import ComputationError
from rotfem.mechanics.time_signals import View
from rotfem.numerics.newton import REACH, Newton, OldFactor


class BackOff:
    """Exponential back-off: after k failures in a row, up to 5, the next 2^k − 1 chances are not used."""

    def __init__(self) -> None:
        self._failures = self._passing = 0

    def over(self) -> bool:
        """Return whether an attempt may be made now; otherwise count this chance as not used."""
        if self._passing == 0:
            return True
        self._passing -= 1
        return False

    def failed(self) -> None:
        """Count a failure."""
        self._failures = min(self._failures + 1, 5)
        self._passing = 2**self._failures - 1

    def worked(self) -> None:
        """Count a success."""
        self._failures = 0


#: Iterations with an old factor after which the next step gets a new one.
LONG = 8

#: Newton iterations of a long solution, and of one after which the prediction of the next step may be shortened; part
#: of a prediction above which it is not.
SOON, MANY, RELIABLE = 6, 3, 0.9

#: A linear step is refined with an old factor up to this relative error, as long as that shrinks at this rate, or to
#: where it stays at round-off.
REFINED, RATE, ROUND_OFF = 1e-11, 0.3, 1e-8


def keep_rotations_small(system: Any, scheme: Scheme, state: State, h: float) -> bool:
    """Count rotations from the present shape if a step of h (s) might leave their range; return whether that was done.

    The state is changed in place: the same motion in new coordinates. A memory of the scheme that is a second rate, as
    an auxiliary acceleration, is converted; any other is made anew by the scheme.
    """
    turns = system.structure.turns
    if turns is None:
        return False
    system.count_rotations_from(state.reference)
    if not turns.is_due(state.q, state.v, h):
        return False
    is_rate = isinstance(state.memory, np.ndarray) and state.memory.shape == state.a.shape
    q, v, a = state.q.copy(), state.v.copy(), state.a.copy()
    before = a if state.jump is None else a - state.jump
    second = [a, before.copy(), state.memory.copy()] if is_rate else [a, before.copy()]
    reference = turns.reset(q, v, second)
    system.count_rotations_from(reference)
    state.q, state.v, state.a, state.reference = q, v, a, reference
    state.jump = None if state.jump is None else a - second[1]
    state.memory = second[-1] if is_rate else scheme.start(state.changed(memory=None)).memory
    return True


@contextmanager
def seen(system: Any, view: View) -> Iterator[None]:
    """Evaluate the signals of a system as a view says, within the context."""
    before = vars(system.view).copy()
    vars(system.view).update(vars(view))
    try:
        yield
    finally:
        vars(system.view).update(before)


class Stepper:
    """Advances a system in time; to a scheme it is the equations that its stages are solved with (see `Equations`).

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        scheme: of stages and update maps.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.

    Attributes:
        back_off: with old factors.
        substeps, rejected: steps that were halved (Newton failed, or energy rose), and adaptive ones taken back.
        substituted: steps that the scheme could not take, by the name of the one that did.
        scheme_back_off: in the scheme, where others may stand in for it.
        pace: memory of the step-size controller: length of the next step (s), largest displacement so far (scaled), and
            error of the last step as a part of the allowed one; None before the first.
        observers: called with (old state, new state, leg) after every accepted step.
    """

    def __init__(self, system: Any, scheme: Scheme, newton: Newton):
        self.system, self.newton, self.scheme = system, newton, scheme
        self._factored: Shifts | None = None
        #: Matrices, and the stage that they are about.
        self._linearised: Any = None
        self._about: Stage | None = None
        #: Whether solutions are long, so that tangents with the stresses of the last correction pay their compilation.
        self._far = False
        #: Whether a step was hard to solve, and whether the scheme keeps the balance of energy by itself.
        self._hard = self._balanced = False
        #: Part of a predicted move that is taken, by the last step.
        self._reliable = 1.0
        self.back_off = BackOff()
        self.substeps = self.rejected = 0
        self.substituted: dict[str, int] = {}
        self.scheme_back_off = BackOff()
        self.pace: tuple[float, float, float] | None = None
        self.observers = list[Observer]()
        #: Jacobi integral at the first hard step, least and largest kinetic and strain energy since (J).
        self._exchange: tuple[float, ...] | None = None

    def start(self, t: float, q: Array, v: Array) -> State:
        """Return the state at t (s) with the acceleration that the equations of motion give."""
        state = State(t, q, v, np.zeros_like(q), reference=self.system.reference)
        return self.scheme.start(self._accelerated(state, View(1)))

    def restart(self, state: State, before: View, after: View) -> State:
        """Return a state with the accelerations that hold after a jump of what drives the system.

        Args:
            state: at the end of a step.
            before: how that step sees what is prescribed here.
            after: how the next one does.
        """
        s, t = self.system, state.t
        s.count_rotations_from(state.reference)
        with seen(s, before):
            old = s.driven(t)
        with seen(s, after):
            same = np.allclose(s.driven(t), old, rtol=1e-7, atol=0.0)
        if s.comm.allreduce(same, MPI.LAND):  # what moves a clamp is on the processes that hold it
            return self.scheme.kinked(state)
        new = self._accelerated(state, after)
        return self.scheme.jumped(new, new.a - state.a)

    def _accelerated(self, state: State, view: View) -> State:
        """Return a state with the accelerations that its equations of motion give, seen by a view."""
        s, t = self.system, state.t
        new = state.changed(q=state.q.copy(), v=state.v.copy(), a=state.a.copy(), balanced=True)
        with seen(s, view):
            s.prescribe(t, new.q, new.v, new.a)
            s.set_time(t)
            s.set_state(new.q, new.v, new.a)
            change = np.asarray(s.acceleration())
            new.a += change
            new.jump = change if state.jump is None else state.jump + change
            new.given = s.given(new)
        if new.given is not None and state.given is not None:
            new.given[:2] = state.given[:2]
        return new

    def step(self, state: State, h: float, end: float | None = None) -> State:
        """Return the state at state.t + h.

        Args:
            state: where the step starts.
            h: length of the step, s.
            end: its last instant, where state.t + h must not have a rounding error (a jump, that is before it).

        Raises:
            ComputationError: Newton failed; the given state is untouched.
        """
        end = state.t + h if end is None else end
        self._hard = False
        state = state if state.jump is None else self._filtered(state, h)
        stages = self.scheme.solved(state, h, end, self)
        new = self.scheme.finish(state, h, stages)
        new.reference = state.reference
        self.system.check_reach(new.q, new.t)
        new.given = self.system.given(new, state)
        return new

    def _filtered(self, state: State, h: float) -> State:
        """Return a state of a free hub after a jump of what drives it, with the accelerations of a step of h (s).

        Those of the equations turn the frame at once by what its smallest part does, which no step resolves; in a
        frame that is turned too far the angular momentum is lost. In their place are those of the step's own tangent,

            a ← a − Δa + δa,    (M + c_v/c_a C + 1/c_a K) δa = −F(q, v, a − Δa),    1/c_a = O(h²),

        which are right to O(h²) where the step resolves them, and bounded where it does not.
        """
        s, jump, small = self.system, state.jump, self.newton.tolerance
        if not self.scheme.filters_jumps or s.hub is None or jump is None or s.increment_size(h * h * jump) <= small:
            return state
        shifts = self.scheme.stage(0, state, h, state.t + h, ()).shifts
        with seen(s, View(1, s.view.line)):
            s.count_rotations_from(state.reference)
            s.set_time(state.t)
            s.set_state(state.q, state.v, state.a - jump)
            change = shifts[2] * s.correction(shifts) - jump
        return self.scheme.jumped(state.changed(a=state.a + change), change)

    def advance(self, state: State, h: float, end: float | None = None, halvings: int = 5) -> State:
        """Return the state at state.t + h (see `step`), in halved steps where the whole one fails or adds energy.

        Raises:
            ComputationError: Newton failed at the smallest step too; says how small it was.
        """
        if keep_rotations_small(self.system, self.scheme, state, h):
            self._factored = None
        others, failure, gains = self.scheme.fallbacks(), None, False
        if halvings == 0 or not others or self.scheme_back_off.over():
            try:
                new = self.step(state, h, end)
            except ComputationError as error:
                failure = error
                self.scheme_back_off.failed()
            else:
                self.scheme_back_off.worked()
                # after two halvings a step is taken though it adds energy
                gains = halvings > 3 and self._gains_energy(new, state)
                if not gains:
                    return new
        if halvings > 0 and not gains and (stood := self._substituted(others, state, h, end)) is not None:
            return stood
        if failure is not None and (halvings == 0 or (self.system.solved_at_once and not others)):
            if halvings > 0:
                raise failure
            advice = 'a smaller time.step, time.scheme = "energy_conserving", or check load and speed then'
            raise ComputationError(f"{failure.what} (the step was cut down to {h:.3g} s)", failure.time, advice)
        self.substeps += 1
        middle = self.advance(state, h / 2, None, halvings - 1)
        return self.advance(middle, h / 2, state.t + h if end is None else end, halvings - 1).after(middle)

    def _substituted(self, others: Sequence[Scheme], state: State, h: float, end: float | None) -> State | None:
        """Return the state at the end of a step that another scheme takes in two halves; None if none can."""
        for scheme in others:
            other = Stepper(self.system, scheme, self.newton)
            now, last = scheme.start(state), state.t + h if end is None else end
            try:
                middle = other.advance(now, h / 2)
                now = other.advance(middle, h / 2, last).after(middle)
            except ComputationError:
                continue
            self.substituted[scheme.name] = self.substituted.get(scheme.name, 0) + 1
            self.substeps += other.substeps
            return self.scheme.start(now)
        return None

    def _gains_energy(self, new: State, state: State) -> bool:
        """Return whether a step that was hard to solve raises the energy of a system that nothing gives energy to.

        A scheme that does not resolve the motion may do so, a little in each step; shorter steps do it less. The rise
        is allowed up to 0.3 % of the largest exchange between kinetic and strain energy.
        """
        s = self.system
        if not self._hard or self._balanced or s.linear or not s.model.closed:
            return False

        def energies(at: State) -> dict[str, float]:
            s.set_time(at.t)
            s.set_state(at.q, at.v, at.a)
            return dict(s.energies())

        first = None
        if self._exchange is None:
            first = energies(state)
            self._exchange = (first["jacobi"], *2 * (first["kinetic"],), *2 * (first["strain"],))
        now = energies(new)
        reference, low_t, high_t, low_w, high_w = self._exchange
        low_t, high_t = min(low_t, now["kinetic"]), max(high_t, now["kinetic"])
        low_w, high_w = min(low_w, now["strain"]), max(high_w, now["strain"])
        self._exchange = reference, low_t, high_t, low_w, high_w
        too_much = now["jacobi"] - reference > 0.003 * max(high_t - low_t, high_w - low_w)
        return bool(too_much and now["jacobi"] > (first or energies(state))["jacobi"])

    def warnings(self) -> list[str]:
        """Return the warnings of a run about halved and substituted steps."""
        out = [f"{self.substeps} steps were halved where Newton failed or energy rose"] if self.substeps else []
        for name, number in self.substituted.items():
            taken = f"{number} steps that {self.scheme.name} could not solve were taken by {name}"
            out.append(f"{taken}: their errors are those of that scheme")
        return out

    # --- stages ------------------------------------------------------------------------------------------------------

    def predicted(self, stage: Stage, state: State) -> Array:
        """Return the predicted q of a stage; where the clamp moves the last shape, turned with it."""
        clamp, end = self.system.clamp, stage.t if stage.over is None else stage.over.end
        if clamp is None:
            return stage.q
        turned = np.asarray(clamp.turned(state.q, state.v, state.t, end))
        return turned if stage.over is None else (state.q + turned) / 2

    def imbalance(self, stage: Stage) -> Array:
        """Return −F at a stage (see `Equations`)."""
        s = self.system
        s.set_time(stage.t)
        s.prescribe(stage.t, stage.q, stage.v, stage.a)
        s.set_state(stage.q, stage.v, stage.a)
        return np.asarray(s.imbalance())

    def linearised(self, stage: Stage | None) -> Any:
        """Return M, C and K at a stage; of None those of an earlier stage if they may be reused (see `Equations`)."""
        known = self._linearised
        if stage is None:
            return known if known is not None and known.serves and known.reference is self.system.reference else None
        self.imbalance(stage)
        self._linearised = self.system.linearised()
        self._about = replace(stage, q=stage.q.copy(), v=stage.v.copy(), a=stage.a.copy())
        return self._linearised

    @property
    def matrices(self) -> dict[str, Any] | None:
        """Data to assemble the current matrices again: t, q, v, a, reference, and whether they may be reused."""
        if self._about is None:
            return None
        known, about = self._linearised, self._about
        at = {"t": about.t, "q": about.q, "v": about.v, "a": about.a}
        return {**at, "reference": known.reference, "serves": known.serves}

    def make_matrices(self, known: dict[str, Any] | None) -> None:
        """Assemble matrices from their data (see `matrices`); do nothing of None."""
        if known is not None:
            self.system.count_rotations_from(known["reference"])
            self.linearised(Stage(known["t"], known["q"], known["v"], known["a"], 0.0, 0.0)).serves = known["serves"]

    def solve(self, stage: Stage, state: State) -> None:
        """Solve a stage of a step from a state, with an earlier factor if that converges."""
        factor, predicted = self._old_factor(stage), (stage.q.copy(), stage.v.copy(), stage.a.copy())
        if factor is not None and self.back_off.over():
            try:
                self._iterate(stage, state, factor)
            except ComputationError:  # the old factor does not converge
                self._factored = None
                self.back_off.failed()
                stage.begin_at(predicted)
            else:
                self.back_off.worked()
                return
        if self.system.solved_at_once:
            self._iterate(stage, state)
            return
        if self._reliable < RELIABLE:
            stage.correct((self._reliable - 1.0) * (stage.q - state.q))
        try:
            iterations = self._iterate(stage, state)
        except ComputationError:
            if self._reliable == 0.0:
                raise
            stage.begin_at(predicted)
            stage.correct(state.q - stage.q)  # from where the step starts, whatever was predicted
            self._reliable, self._far = 0.0, True
            iterations = self._iterate(stage, state)
        self._hard |= self.newton.diverging or iterations > MANY
        self._balanced = stage.over is not None
        if self._reliable < RELIABLE or iterations > MANY:
            self._reliable = reliable_part(self.system, stage.q - state.q, predicted[0] - state.q)

    def _old_factor(self, stage: Stage) -> OldFactor | None:
        """Return the control of an old factor; None where every iteration factorises its tangent.

        That is so of small systems, after long solutions, and where a balance of energy is kept.
        """
        s, reusable = self.system, self._factored == stage.shifts
        if not s.keeps_factor:
            return None
        if s.linear:
            s.set_time(stage.t)
            if s.settled and not s.current:  # the matrix stays as it is from now on, and the factor is that of another
                return None
        if not reusable and (s.linear or stage.over is not None or self._far or self._reliable < RELIABLE):
            return None
        return OldFactor(reusable)

    def _iterate(self, stage: Stage, state: State, factor: OldFactor | None = None) -> int:
        """Solve a stage by Newton's method, with an old factor if one is given; return the number of iterations.

        Raises:
            ComputationError: it does not converge, or to a root that is not the motion's (see `check_root`).
        """
        span = None if self.system.linear else stage.over
        s, before = self.system if span is None else self.system.balance, state.q
        followed = 0
        s.set_time(stage.t)
        if span is not None:
            s.begin(span.start, span.end)
        s.prescribe(stage.t, stage.q, stage.v, stage.a)

        def increment() -> float:
            nonlocal before, followed
            s.set_state(stage.q, stage.v, stage.a)
            self._far |= followed >= SOON or self.newton.diverging
            is_old = factor is not None and factor.took()
            dq = s.chord() if is_old else s.correction(stage.shifts, before if self._far else None)
            followed += 1
            size = float(s.increment_size(dq))
            if not s.solved_at_once:
                before = stage.q.copy()
            stage.correct(dq if s.solved_at_once or size <= REACH else dq * (REACH / size))
            return size

        try:
            if s.solved_at_once:
                iterations = self._solve_linear(increment, stage, factor is not None)
            else:
                iterations = self.newton.solve(increment, lambda: s.size(stage.q), factor)
        except ComputationError as error:
            raise ComputationError(error.what, time=stage.t, advice=error.advice) from None
        used = 0 if factor is None else factor.used
        self._factored = stage.shifts if s.keeps_factor and used <= LONG else None
        self._far = iterations > SOON if factor is None else factor.made > MANY
        if span is not None:
            stage.memory = s.finish(stage)
        if self.newton.diverging and (factor is None or factor.made) and not s.solved_at_once:
            check_root(self.system, stage, state)
        return iterations

    def _solve_linear(self, increment: Any, stage: Stage, chord: bool) -> int:
        """Solve the linear equations of a stage; return the iterations: one, or those that refine with an old factor.

        Raises:
            ComputationError: not finite, or the old factor is too far from the matrix.
        """
        previous = np.inf
        for k in range(1, LONG + 3):
            d = increment()
            self.newton.iterations += 1
            if not isfinite(d):
                raise ComputationError("the solution is not finite")
            if not chord or self.system.current or d <= REFINED * (size := self.system.size(stage.q)):
                return k
            if d > RATE * previous:
                if d <= ROUND_OFF * size:
                    return k
                break
            previous = d
        raise ComputationError("the old factor is too far from the matrix")


def check_root(system: Any, stage: Stage, state: State) -> None:
    """Refuse a root of a stage that is turned inside out, or has more energy than was there.

    Args:
        system: one that is solved by Newton's method, at the time of the stage.
        stage: solved.
        state: where the step started.

    Raises:
        ComputationError: it is one of these.
    """
    system.set_state(stage.q, stage.v, stage.a)
    if not system.linear and system.model.inside_out():
        raise ComputationError("Newton met a state turned inside out (an axial strain below −1)", time=stage.t)
    if not system.model.closed or stage.over is not None:
        return
    new = system.energies()
    system.set_state(state.q, state.v, state.a)
    old = system.energies()
    grown, there = new["jacobi"] - old["jacobi"], max(e["kinetic"] + e["strain"] for e in (old, new))
    if grown > 0.03 * there:
        what = f"Newton met a state with {grown:.2g} J more than there were, of {there:.2g} J"
        raise ComputationError(what, time=stage.t)


def reliable_part(system: Any, move: Array, predicted: Array) -> float:
    """Return the part c of a predicted move p that is closest to the computed move m: m·p/p·p, cut to 0 … 1.

    It is 1 where the motion is smooth. Of vibrations that the steps do not resolve a prediction by constant
    acceleration is worse than none, as h²q̈ is much larger than they are.
    """
    length = system.product(predicted, predicted)
    return float(np.clip(system.product(move, predicted) / length, 0.0, 1.0)) if length > 0.0 else 1.0
