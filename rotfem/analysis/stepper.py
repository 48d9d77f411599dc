"""One step of any scheme on any system: its stages solved one after the other, halved where Newton fails."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Scheme, Shifts, Stage, State
from rotfem.errors import ComputationError
from rotfem.numerics.newton import Newton

#: Iterations with an old factor after which the next step gets a new one.
LONG = 5

#: After an old factor has failed k times in a row, none is tried for 2^k steps; k grows to this.
PATIENCE = 5

#: A linear step is refined with an old factor up to this relative error, as long as that shrinks at this rate, or to
#: where it stays at round-off.
REFINED, RATE, ROUND_OFF = 1e-11, 0.3, 1e-8


class Stepper:
    """Advances a system in time.

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        scheme: of stages and update maps.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.

    Attributes:
        substeps, rejected: steps that were halved because Newton failed, and adaptive ones that were taken back.
    """

    def __init__(self, system: Any, scheme: Scheme, newton: Newton):
        self.system, self.scheme, self.newton = system, scheme, newton
        self.substeps = self.rejected = 0
        self._held: Shifts | None = None
        #: How often in a row an old factor has failed, and for how many steps none is tried for that.
        self._failed = self._pause = 0

    def start(self, t: float, q: Array, v: Array) -> State:
        """Return the state at t (s) with the acceleration that the equations of motion give."""
        s = self.system
        state = State(t, q.copy(), v.copy(), np.zeros_like(q))
        s.prescribe(t, state.q, state.v, state.a)
        s.set_time(t)
        s.set_state(state.q, state.v, state.a)
        state.a += s.acceleration(t)
        state.given = s.given(state)
        return self.scheme.start(state)

    def restart(self, state: State) -> State:
        """Return a state with the accelerations that hold after a jump of what drives the system."""
        new = self.start(state.t, state.q, state.v)
        if new.given is not None and state.given is not None:
            new.given[:2] = state.given[:2]
        return new

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
        stages: list[Stage] = []
        for i in range(self.scheme.stages):
            stage = self.scheme.stage(i, state, h, end, stages)
            if self.system.clamp is not None:  # a prediction that turns with the hub is the better one
                turned = self.system.clamp.turned(state.q, state.v, state.t, stage.t)
                stage.correct(turned - stage.q)
            self._solve(stage)
            stages.append(stage)
        new = self.scheme.finish(state, h, stages)
        new.given = self.system.given(new, state)
        return new

    def _solve(self, stage: Stage) -> None:
        """Solve a stage, with the factor of an earlier one if that serves."""
        if self._held == stage.shifts and self.system.keeps_factor and not self._new_factor_pays(stage.t):
            if self._pause == 0:
                predicted = stage.q.copy(), stage.v.copy(), stage.a.copy()
                try:
                    self._iterate(stage, chord=True)
                except ComputationError:  # the old factor does not serve here; nor will the next ones, perhaps
                    self._held, self._failed = None, min(self._failed + 1, PATIENCE)
                    self._pause = 2**self._failed
                    stage.q, stage.v, stage.a = predicted
                else:
                    self._failed = 0
                    return
            self._pause = max(self._pause - 1, 0)
        self._iterate(stage)

    def _new_factor_pays(self, t: float) -> bool:
        """Return whether the matrix stays as it is from now on, while the factor is that of another."""
        s = self.system
        if not s.linear:
            return False
        s.set_time(t)
        return bool(s.settled and not s.current)

    def _iterate(self, stage: Stage, chord: bool = False) -> None:
        """Solve a stage by Newton's method, or with the factor of an earlier step throughout."""
        s = self.system
        s.set_time(stage.t)
        s.prescribe(stage.t, stage.q, stage.v, stage.a)

        def increment() -> float:
            s.set_state(stage.q, stage.v, stage.a)
            dq = s.chord() if chord else s.correction(stage.shifts)
            stage.correct(dq)
            return float(s.increment_size(dq))

        try:
            if s.solved_at_once:
                iterations = self._solve_linear(increment, stage, chord)
            else:
                iterations = self.newton.solve(increment, lambda: s.size(stage.q), chord)
        except ComputationError as error:
            raise ComputationError(error.what, time=stage.t, advice=error.advice) from None
        self._held = stage.shifts if s.keeps_factor and not (chord and iterations > LONG) else None

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
        """Return the state at state.t + h (see `step`), in halved steps where Newton does not manage the whole one.

        Raises:
            ComputationError: Newton failed at the smallest step too; says how small it was.
        """
        try:
            return self.step(state, h, end)
        except ComputationError as error:
            if self.system.linear:
                raise
            if halvings == 0:
                raise ComputationError(
                    f"{error.what} (the step was cut down to {h:.3g} s)",
                    time=error.time,
                    advice="a smaller time.step, or a look at the load and speed at this time",
                ) from None
            self.substeps += 1
            middle = self.advance(state, h / 2, None, halvings - 1)
            return self.advance(middle, h / 2, state.t + h if end is None else end, halvings - 1)

    def local_error(self, new: State, old: State) -> float:
        """Return the scheme's estimate of the local error of a step, in units of the unknowns' scale."""
        error = self.scheme.local_error(new, old)
        assert error is not None
        return float(self.system.size(error))
