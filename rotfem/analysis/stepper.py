"""One step of any scheme on any system: its stages solved one after the other, halved where Newton fails."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from rotfem.analysis.patience import Patience
from rotfem.analysis.roots import fed
from rotfem.analysis.schemes import Array, Scheme, State, Watch
from rotfem.analysis.stage_solver import StageSolver
from rotfem.analysis.turning import keep_rotations_small
from rotfem.errors import ComputationError
from rotfem.mechanics.courses import View
from rotfem.numerics.newton import Newton

#: Halvings left with which a step is taken though it feeds the motion.
STUBBORN = 3

#: Parts in which another scheme takes a step that the scheme cannot: it is of lower order.
PARTS = 2

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


class Stepper(StageSolver):
    """Advances a system in time.

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        scheme: of stages and update maps.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.

    Attributes:
        substeps, rejected: steps that were halved (Newton failed, or energy rose), and adaptive ones taken back.
        stood_in: steps that the scheme could not take, by the name of the one that did.
        trust: in the scheme, where others may stand in for it.
        pace: length of the next adaptive step (s), largest displacement so far (scaled), and length that the errors so
            far allow (s); None before the first.
        watch: told of every step that counts; None tells nobody.
    """

    def __init__(self, system: Any, scheme: Scheme, newton: Newton):
        super().__init__(system, newton)
        self.scheme = scheme
        self.substeps = self.rejected = 0
        self.stood_in: dict[str, int] = {}
        self.trust = Patience()
        self.pace: tuple[float, float, float] | None = None
        self.watch: Watch | None = None
        #: Energy at the first step that was hard, and ranges of the energies that were seen since (see `fed`).
        self._exchange: tuple[float, ...] | None = None

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
        s.count_rotations_from(state.datum)
        with seen(s, before):
            old = s.driven(t)
        with seen(s, after):
            if np.allclose(s.driven(t), old, rtol=STEADY, atol=0.0):
                return self.scheme.kinked(state)
            new = state.changed(q=state.q.copy(), v=state.v.copy(), a=state.a.copy(), balanced=True)
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
            given = given + np.array([0.0, self.system.row.impulse(state.t, end), 0.0])
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
        stages = self.scheme.solved(state, h, end, self)
        new = self.scheme.finish(state, h, stages)
        new.datum = state.datum
        self.system.check_reach(new.q, new.t)
        new.given = self.system.given(new, state)
        return new

    def advance(self, state: State, h: float, end: float | None = None, halvings: int = 5) -> State:
        """Return the state at state.t + h (see `step`), in halved steps where the whole one fails or feeds the motion.

        Raises:
            ComputationError: Newton failed at the smallest step too; says how small it was.
        """
        if keep_rotations_small(self.system, self.scheme, state, h):
            self._held = None
        others, failure, feeds = self.scheme.fallbacks(), None, False
        if halvings == 0 or not others or self.trust.over():
            try:
                new = self.step(state, h, end)
            except ComputationError as error:
                failure = error
                self.trust.failed()
            else:
                self.trust.worked()
                feeds = halvings > STUBBORN and self._feeds(new, state)
                if not feeds:
                    return new
        if halvings > 0 and not feeds and (stood := self._stood_in(others, state, h, end)) is not None:
            return stood
        if failure is not None and (halvings == 0 or (self.system.solved_at_once and not others)):
            raise _cut_down(failure, h) if halvings == 0 else failure
        self.substeps += 1
        middle = self.advance(state, h / 2, None, halvings - 1)
        return self.advance(middle, h / 2, state.t + h if end is None else end, halvings - 1).after(middle)

    def _stood_in(self, others: Sequence[Scheme], state: State, h: float, end: float | None) -> State | None:
        """Return the state at the end of a step that one of other schemes takes, in parts; None if none can."""
        for scheme in others:
            other = Stepper(self.system, scheme, self.newton)
            now, last = scheme.start(state), state.t + h if end is None else end
            try:
                for part in range(1, PARTS + 1):
                    new = other.advance(now, h / PARTS, last if part == PARTS else None)
                    now = new.after(now) if part > 1 else new
            except ComputationError:
                continue
            self.stood_in[scheme.name] = self.stood_in.get(scheme.name, 0) + 1
            self.substeps += other.substeps
            return self.scheme.start(now)
        return None

    def _feeds(self, new: State, state: State) -> bool:
        """Return whether a step that was hard to solve raises an energy that is too large already (see `fed`)."""
        if not self._hard or self._balanced or self.system.linear or not self.system.model.closed:
            return False
        self._exchange, feeds = fed(self.system, new, state, self._exchange)
        return feeds

    def said(self) -> list[str]:
        """Return what a run says of its steps."""
        out = [f"{self.substeps} steps were halved where Newton failed or energy rose"] if self.substeps else []
        for name, number in self.stood_in.items():
            taken = f"{number} steps that {self.scheme.name} could not solve were taken by {name}"
            out.append(f"{taken}: their errors are those of that scheme")
        return out


def _cut_down(error: ComputationError, h: float) -> ComputationError:
    """Return the error of a step that failed however short, with its length (s)."""
    return ComputationError(
        f"{error.what} (the step was cut down to {h:.3g} s)",
        time=error.time,
        advice='a smaller time.step, time.scheme = "energy_conserving", or a look at load and speed then',
    )
