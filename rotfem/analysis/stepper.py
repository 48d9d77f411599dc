"""One step of any scheme on any system: its stages solved one after the other, halved where Newton fails."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from rotfem.analysis.roots import came_true, check_root, fed, turned_with_clamp
from rotfem.analysis.schemes import Array, Scheme, Shifts, Stage, State, Watch
from rotfem.analysis.turning import keep_rotations_small
from rotfem.errors import ComputationError
from rotfem.mechanics.courses import View
from rotfem.numerics.newton import REACH, Newton

#: Iterations with an old factor after which the next step gets a new one.
LONG = 5

#: After an old factor has failed k times in a row, none is tried for 2^k steps; k grows to this.
PATIENCE = 5

#: Newton iterations after which a way is long; halvings left with which a step is taken though it feeds the motion.
SOON, STUBBORN = 6, 3

#: Newton iterations after which the prediction of the next step is questioned, and its share that is taken for all.
MANY, WHOLE = 3, 0.9

#: A linear step is refined with an old factor up to this relative error, as long as that shrinks at this rate, or to
#: where it stays at round-off.
REFINED, RATE, ROUND_OFF = 1e-11, 0.3, 1e-8

#: Relative jump of what is prescribed that is none.
STEADY = 1e-7


@contextmanager
def seen(system: Any, view: View) -> Iterator[None]:
    """Let a system see what is prescribed as a view shows it."""
    system.view.side, system.view.window = view.side, view.window
    try:
        yield
    finally:
        system.view.side, system.view.window = 0, None


class Stepper:
    """Advances a system in time.

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        scheme: of stages and update maps.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.

    Attributes:
        substeps, rejected: steps that were halved (Newton failed, or energy rose), and adaptive ones taken back.
        pace: length of the next adaptive step (s), and largest displacement so far (scaled); None before the first.
        watch: told of every step that counts; None tells nobody.
    """

    def __init__(self, system: Any, scheme: Scheme, newton: Newton):
        self.system, self.scheme, self.newton = system, scheme, newton
        self.substeps = self.rejected = 0
        self.pace: tuple[float, float] | None = None
        self.watch: Watch | None = None
        self._held: Shifts | None = None
        #: Whether Newton's way is a long one, so that tangents that know where it came from are worth compiling.
        self._far = False
        #: Whether a step was hard to solve, and whether the scheme keeps the balance of energy by itself.
        self._hard = self._balanced = False
        #: Energy at the first step that was hard, and ranges of the energies that were seen since (see `fed`).
        self._exchange: tuple[float, ...] | None = None
        #: Share of the last predicted move that came true.
        self._share = 1.0
        #: How often in a row an old factor has failed, and for how many steps none is tried for that.
        self._failed = self._pause = 0

    def start(self, t: float, q: Array, v: Array) -> State:
        """Return the state at t (s) with the acceleration that the equations of motion give."""
        s = self.system
        state = State(t, q.copy(), v.copy(), np.zeros_like(q), datum=s.datum)
        with seen(s, View(1)):
            s.prescribe(t, state.q, state.v, state.a)
            s.set_time(t)
            s.set_state(state.q, state.v, state.a)
            state.a += s.acceleration(t)
            state.given = s.given(state)
        return self.scheme.start(state)

    def restart(self, state: State, before: View, after: View) -> State:
        """Return a state with the accelerations that hold after a jump of what drives the system.

        Args:
            state: at the end of a step.
            before: how that step sees what is prescribed here.
            after: how the next one does.
        """
        s, t = self.system, state.t
        if self.watch is not None:
            self.watch.landed()
        s.count_rotations_from(state.datum)
        with seen(s, before):
            old = s.driven(t)
        with seen(s, after):
            if np.allclose(s.driven(t), old, rtol=STEADY, atol=0.0):
                return state
            new = state.changed(q=state.q.copy(), v=state.v.copy(), a=state.a.copy())
            s.prescribe(t, new.q, new.v, new.a)
            s.set_time(t)
            s.set_state(new.q, new.v, new.a)
            new.a += s.acceleration(t)
            new.given = s.given(new)
        if new.given is not None and state.given is not None:
            new.given[:2] = state.given[:2]
        return self.scheme.jumped(new, new.a - state.a)

    def drift(self, state: State, h: float, end: float) -> State:
        """Return the state at the end of a step too short to be solved for: round-off of q would spoil a."""
        q, v = state.q + h * state.v + 0.5 * h * h * state.a, state.v + h * state.a
        given = state.given
        if given is not None:
            given = given + np.array([0.0, self.system.hub.torque.impulse(state.t, end), 0.0])
        return state.changed(t=end, q=q, v=v, given=given)

    def struck(self, state: State, h: float) -> State:
        """Return a state that drifted through a blow, with the second half of its impulse from the end of the blow."""
        after = self.restart(state, View(window=(0.0, h)), View(window=(h, 0.0)))
        return after.changed(v=after.v + 0.5 * h * (after.a - state.a))

    def step(self, state: State, h: float, end: float | None = None) -> State:
        """Return the state at state.t + h.

        Args:
            state: where the step starts.
            h: length of the step, s.
            end: its last instant, where state.t + h must not be off by a rounding (a jump, that is before it).

        Raises:
            ComputationError: Newton failed; the given state is untouched.
        """
        end = state.t + h if end is None else end
        self._hard = False
        stages: list[Stage] = []
        for i in range(self.scheme.stages):
            stage = self.scheme.stage(i, state, h, end, stages)
            if self.system.clamp is not None:  # a prediction that turns with the hub is the better one
                turned = turned_with_clamp(self.system.clamp, state, stage)
                stage.correct(turned - stage.q)
            self._solve(stage, state)
            stages.append(stage)
        new = self.scheme.finish(state, h, stages)
        new.datum = state.datum
        self.system.check_reach(new.q, new.t)
        new.given = self.system.given(new, state)
        return new

    def _solve(self, stage: Stage, state: State) -> None:
        """Solve a stage of a step from a state, with the factor of an earlier one if that serves."""
        if self._held == stage.shifts and self.system.keeps_factor and not self._new_factor_pays(stage.t):
            if self._pause == 0:
                predicted = stage.q.copy(), stage.v.copy(), stage.a.copy()
                try:
                    self._iterate(stage, state, chord=True)
                except ComputationError:  # the old factor does not serve here; nor will the next ones, perhaps
                    self._held, self._failed = None, min(self._failed + 1, PATIENCE)
                    self._pause = 2**self._failed
                    stage.q, stage.v, stage.a = predicted
                else:
                    self._failed = 0
                    return
            self._pause = max(self._pause - 1, 0)
        if self.system.solved_at_once:
            self._iterate(stage, state)
            return
        move = stage.q - state.q
        if self._share < WHOLE:
            stage.correct((self._share - 1.0) * move)
        v, a = stage.v - stage.c_v * stage.q, stage.a - stage.c_a * stage.q
        try:
            iterations = self._root(stage, state)
        except ComputationError:
            if self._share == 0.0:
                raise
            stage.q[:] = state.q  # from where the step starts, whatever was predicted
            self._share, self._far = 0.0, True
            stage.v[:], stage.a[:] = v + stage.c_v * stage.q, a + stage.c_a * stage.q
            iterations = self._root(stage, state)
        self._hard |= self.newton.strayed or iterations > MANY
        self._balanced = stage.over is not None
        if self._share < WHOLE or iterations > MANY:
            self._share = came_true(self.system, stage.q - state.q, move)

    def _root(self, stage: Stage, state: State) -> int:
        """Solve a stage of a nonlinear system, see that it is the motion's and return the iterations."""
        iterations = self._iterate(stage, state)
        if self.newton.strayed:
            check_root(self.system, stage, state)
        return iterations

    def _new_factor_pays(self, t: float) -> bool:
        """Return whether the matrix stays as it is from now on, while the factor is that of another."""
        s = self.system
        if not s.linear:
            return False
        s.set_time(t)
        return bool(s.settled and not s.current)

    def _iterate(self, stage: Stage, state: State, chord: bool = False) -> int:
        """Solve a stage by Newton's method, or with the factor of an earlier step throughout; return the iterations."""
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
            self._far |= followed >= SOON or self.newton.strayed
            dq = s.chord() if chord else s.correction(stage.shifts, before if self._far else None)
            followed += 1
            size = float(s.increment_size(dq))
            if not s.solved_at_once:
                before = stage.q.copy()
            stage.correct(dq if s.solved_at_once or size <= REACH else dq * (REACH / size))
            return size

        try:
            if s.solved_at_once:
                iterations = self._solve_linear(increment, stage, chord)
            else:
                iterations = self.newton.solve(increment, lambda: s.size(stage.q), chord)
        except ComputationError as error:
            raise ComputationError(error.what, time=stage.t, advice=error.advice) from None
        self._held = stage.shifts if s.keeps_factor and not (chord and iterations > LONG) else None
        self._far = iterations > SOON
        if span is not None:
            stage.memory = s.finish(stage)
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
            if not np.isfinite(d):
                raise ComputationError("the solution is not finite")
            size = self.system.size(stage.q)
            if not chord or self.system.current or d <= REFINED * size:
                return k
            if d > RATE * previous:
                if d <= ROUND_OFF * size:
                    return k
                break
            previous = d
        raise ComputationError("the old factor is too far from the matrix")

    def advance(self, state: State, h: float, end: float | None = None, halvings: int = 5) -> State:
        """Return the state at state.t + h (see `step`), in halved steps where the whole one fails or feeds the motion.

        Raises:
            ComputationError: Newton failed at the smallest step too; says how small it was.
        """
        if keep_rotations_small(self.system, self.scheme, state, h):
            self._held = None
        try:
            new = self.step(state, h, end)
            if halvings <= STUBBORN or not self._feeds(new, state):
                return new
        except ComputationError as error:
            if self.system.solved_at_once:
                raise
            if halvings == 0:
                raise ComputationError(
                    f"{error.what} (the step was cut down to {h:.3g} s)",
                    time=error.time,
                    advice='a smaller time.step, time.scheme = "energy_conserving", or a look at load and speed then',
                ) from None
        self.substeps += 1
        middle = self.advance(state, h / 2, None, halvings - 1)
        return self.advance(middle, h / 2, state.t + h if end is None else end, halvings - 1)

    def _feeds(self, new: State, state: State) -> bool:
        """Return whether a step that was hard to solve raises an energy that is too large already (see `fed`)."""
        if not self._hard or self._balanced or self.system.linear or not self.system.model.closed:
            return False
        self._exchange, feeds = fed(self.system, new, state, self._exchange)
        return feeds
