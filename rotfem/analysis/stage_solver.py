"""The solution of a stage of a step: Newton's method, or the factor of an earlier step where that serves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rotfem.analysis.patience import Patience
from rotfem.analysis.roots import came_true, check_root, turned_with_clamp
from rotfem.analysis.schemes import Array, Shifts, Stage, State
from rotfem.errors import ComputationError
from rotfem.numerics.newton import REACH, Newton, OldFactor

#: Iterations with an old factor after which the next step gets a new one, of a linear and of a nonlinear system.
LONG, NONLINEAR = 5, 8

#: Newton iterations after which a way is long.
SOON = 6

#: Newton iterations after which the prediction of the next step is questioned, and its share that is taken for all.
MANY, WHOLE = 3, 0.9

#: A linear step is refined with an old factor up to this relative error, as long as that shrinks at this rate, or to
#: where it stays at round-off.
REFINED, RATE, ROUND_OFF = 1e-11, 0.3, 1e-8


class StageSolver:
    """The equations that a scheme's stages are solved with (see `Equations`).

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.

    Attributes:
        patience: with old factors.
    """

    def __init__(self, system: Any, newton: Newton):
        self.system, self.newton = system, newton
        self._held: Shifts | None = None
        #: Matrices, and the stage that they are about.
        self._linearised: Any = None
        self._about: Stage | None = None
        #: Whether Newton's way is a long one, so that tangents that know where it came from are worth compiling.
        self._far = False
        #: Whether a step was hard to solve, and whether the scheme keeps the balance of energy by itself.
        self._hard = self._balanced = False
        #: Share of the last predicted move that came true.
        self._share = 1.0
        self.patience = Patience()

    def predicted(self, stage: Stage, state: State) -> Array:
        """Return q of a stage that turns with the clamp where that moves: it is the better prediction."""
        return stage.q if self.system.clamp is None else turned_with_clamp(self.system.clamp, state, stage)

    def imbalance(self, stage: Stage) -> Array:
        """Return −F at a stage (see `Equations`)."""
        s = self.system
        s.set_time(stage.t)
        s.prescribe(stage.t, stage.q, stage.v, stage.a)
        s.set_state(stage.q, stage.v, stage.a)
        return np.asarray(s.imbalance())

    def linearised(self, stage: Stage | None) -> Any:
        """Return M, C and K about a stage, of None those of an earlier one if they still serve (see `Equations`)."""
        known = self._linearised
        if stage is None:
            return known if known is not None and known.serves and known.datum is self.system.datum else None
        self.imbalance(stage)
        self._linearised = self.system.linearised()
        self._about = replace(stage, q=stage.q.copy(), v=stage.v.copy(), a=stage.a.copy())
        return self._linearised

    @property
    def matrices(self) -> dict[str, Any] | None:
        """What makes the matrices at hand again: time, q, v, a and datum that they are about, and if they serve."""
        if self._about is None:
            return None
        known, about = self._linearised, self._about
        at = {"t": about.t, "q": about.q, "v": about.v, "a": about.a}
        return {**at, "datum": known.datum, "serves": known.serves}

    def make_matrices(self, known: dict[str, Any] | None) -> None:
        """Make matrices again from what is known of them (see `matrices`); nothing from None."""
        if known is not None:
            self.system.count_rotations_from(known["datum"])
            self.linearised(Stage(known["t"], known["q"], known["v"], known["a"], 0.0, 0.0)).serves = known["serves"]

    def solve(self, stage: Stage, state: State) -> None:
        """Solve a stage of a step from a state, with the factor of an earlier one if that serves."""
        factor = self._old_factor(stage)
        if factor is not None and self.patience.over():
            predicted = stage.q.copy(), stage.v.copy(), stage.a.copy()
            try:
                self._iterate(stage, state, factor)
                if factor.made and self.newton.strayed:
                    check_root(self.system, stage, state)
            except ComputationError:  # the old factor does not serve here; nor will the next ones, perhaps
                self._held = None
                self.patience.failed()
                stage.q, stage.v, stage.a = predicted
            else:
                self.patience.worked()
                return
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

    def _old_factor(self, stage: Stage) -> OldFactor | None:
        """Return who says for how long a factor serves; None where every iteration of a stage has one of its own.

        A nonlinear stage may begin with a new one; a long way, and a balance of energy, need one in every iteration.
        """
        held = self._held == stage.shifts
        if not self.system.keeps_factor or self._new_factor_pays(stage.t):
            return None
        if not held and (self.system.linear or stage.over is not None or self._far or self._share < WHOLE):
            return None
        return OldFactor(held)

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

    def _iterate(self, stage: Stage, state: State, factor: OldFactor | None = None) -> int:
        """Solve a stage by Newton's method, with old factors as long as they serve if any do; return the iterations."""
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
        self._held = stage.shifts if s.keeps_factor and used <= (LONG if s.linear else NONLINEAR) else None
        self._far = iterations > SOON if factor is None else factor.made > MANY
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
