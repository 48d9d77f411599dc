"""A time history, step after step: predict, solve by Newton's method, accept or halve.

A step from t_n to t_n + h solves the stages of a scheme one after the other (`rotfem.analysis.schemes`). A step that
cannot be solved is halved: a fixed one is taken in two halves, an adaptive one is tried with a shorter length. What one
step hands to the next is a `State`.

Adaptive steps have local errors that add up to a tolerance, relative to the largest displacement. The controller is
H211PI: h' = h (r_n r_{n−1})^(−1/6k) with errors r ∝ hᵏ, parts of what is allowed (Söderlind, ACM Trans. Math. Softw. 29
(2003) 1, table 1). No step grows after a rejected one (Hairer, Nørsett & Wanner 1993, section II.4).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain, pairwise
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.schemes import LONGEST, Array, Observer, Pace, Scheme, Shifts, Stage, State
from rotfem.analysis.time_grid import Interval, intervals, knots_of
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics.time_signals import SAME, View, has_ends
from rotfem.numerics.linear import DirectSolver, combine
from rotfem.numerics.newton import REACH, Factor, Newton
from rotfem.numerics.projection import PlusLowRank, sparse_part, with_ghosts


@dataclass(frozen=True)
class Steps:
    """When a history ends, and how it is stepped: by a fixed step or to a tolerance.

    Attributes:
        end: last time, s.
        step: fixed step, s; None for adaptive ones.
        tolerance: error of all adaptive steps together, relative to the largest displacement; None for fixed ones.
        max_step, min_step: bounds of an adaptive step, s; None for those of the program.
        breakpoints: times (s) at which something that is prescribed may jump, in addition to the knots of tables.
    """

    end: float
    step: float | None = None
    tolerance: float | None = None
    max_step: float | None = None
    min_step: float | None = None
    breakpoints: Sequence[float] = ()

    @classmethod
    def of(cls, time: Any) -> Steps:
        """Return the steps of anything with these attributes, as a scene's [time] table."""
        return cls(time.end, time.step, time.tolerance, time.max_step, time.min_step, time.breakpoints)


#: Displacement over the length, or rotation in rad, above which the result of a linear theory is refused.
LARGEST_LINEAR_DEFLECTION = 1.0

#: Halvings of a fixed step that cannot be solved.
HALVINGS = 5

#: Newton iterations after which a solution counts as a long one, and up to which the prediction was good.
LONG_SOLUTION, GOOD_PREDICTION = 6, 3

#: Error of a step that the controller aims at, as a part of the allowed one: a vibration's local error is its largest
#: times |cos φ|, ½ in the geometric mean over phases. Smallest ratio of two steps, also of one that was not solved.
AIM_OF_ERROR, SHRINK = 0.5, 0.2

#: Steps, rejected ones included, that a march may take.
MOST_STEPS = 500_000

#: Knots from which on adaptive steps, which may end at each, take more than some ten seconds: a warning beforehand.
MANY = 10_000

#: What to do beyond.
QUICKER = (
    "time.breakpoints where a function of motion or loads jumps; "
    "fixed steps (time.step); a looser time.tolerance; or an earlier time.end"
)

#: Filters of local errors are made for steps in this ratio.
COARSE = 1.5


@dataclass
class LastSolution:
    """What the last solution of a stage says of the next one.

    Attributes:
        shifts: (1, c_v, c_a) of the tangent whose factor is kept; None where none is.
        long: whether it took more than LONG_SOLUTION tangents; then the next ones have the stresses of `PointStresses`.
        confirmed: part of the predicted move that it confirmed; the next prediction is shortened to it.
    """

    shifts: Shifts | None = None
    long: bool = False
    confirmed: float = 1.0


class March:
    """A time history, state after state.

    Args:
        system: equations of motion; its functions q, v, a are overwritten.
        scheme: of stages and update maps.
        steps: end and length of the steps.
        newton: iteration control, shared by all steps so that it learns the quadratic constant.
        q: shape at t = 0 in the turning frame, local dof array of the structure; undeformed if None.
        v: velocities there, relative to the turning frame; it is at rest if None.

    Attributes:
        reached: state that an earlier march has yielded, to go on from.
        observers: called with (old state, new state) after every accepted step or part of one.
        last: what the last solution of a stage says of the next one.
        parts: steps that were taken, parts of steps counted each.
        substeps, rejected: steps that were halved as Newton failed, and adaptive ones that were rejected.
    """

    def __init__(
        self,
        system: System,
        scheme: Scheme,
        steps: Steps,
        newton: Newton,
        q: Array | None = None,
        v: Array | None = None,
    ):
        self.system, self.scheme, self.steps, self.newton = system, scheme, steps, newton
        self.reached: State | None = None
        self.observers = list[Observer]()
        self.parts = self.substeps = self.rejected = 0
        self._q, self._v = np.zeros_like(system.q.x.array) if q is None else q, v
        self.last = LastSolution()

    def __iter__(self) -> Iterator[State]:
        """Yield the state at t = 0, unless it goes on from a later one, and at the end of every step.

        Raises:
            ComputationError: a step failed, however short.
        """
        state = self.reached
        if state is None:
            q, v = self.system.start(self._q)
            if self._v is not None:
                v[: len(self._v)] += self._v
            state = State(0.0, q, v, np.zeros_like(q), reference=self.system.reference)
            state = self.scheme.start(self.accelerated(state, View(1)))
            yield state
        yield from self._fixed(state) if self.steps.step is not None else self._adaptive(state)

    def warnings(self) -> list[str]:
        """Return the warnings of a run about functions that change within steps, and about halved steps."""
        out = [f"{self.substeps} steps were halved where Newton failed"] if self.substeps else []
        seen = [(signal.name, *signal.changes) for signal in self.system.signals if signal.changes is not None]
        what = (
            "{} changes within steps, as at t = {:.4g} s; sampled every {:.2g} s: time.breakpoints for what is shorter"
        )
        return [*(what.format(*of) for of in seen), *out]

    # --- fixed steps -------------------------------------------------------------------------------------------------

    def _fixed(self, state: State) -> Iterator[State]:
        """Yield the states at step, 2 step, … and end (s); the last step may be shorter."""
        steps, step, reached = self.steps, float(self.steps.step or 0.0), state.t
        times = np.append(np.arange(int(np.ceil(steps.end / step - 1e-9))) * step, steps.end)
        knots = knots_of(self.system.signals, times, steps.breakpoints, self.scheme.order > 2)
        grid = (part for part in intervals(*knots, times, step) if part.end > reached)
        for part, after in pairwise(chain(grid, [None])):
            assert part is not None
            start = self.begun(state, View(1), part) if state.t == 0.0 else state
            with self.system.view.as_in(part.finish):
                state = self.advance(start, part.length, part.end)
            self._observed(start, state)
            if after is not None:
                if after.length != part.length:
                    state = self.scheme.resized(state, start, after.length)
                state = self.begun(state, part.finish, after)
            if part.whole:
                yield state

    def _observed(self, old: State, new: State) -> None:
        self.parts += 1
        for observe in self.observers:
            observe(old, new)

    # --- adaptive steps ----------------------------------------------------------------------------------------------

    def _adaptive(self, start: State) -> Iterator[State]:
        """Yield states after steps whose local errors add up to the tolerance."""
        end, tolerance = float(self.steps.end), float(self.steps.tolerance or 0.0)
        longest, shortest = self.steps.max_step or LONGEST * end, self.steps.min_step or 1e-9 * end
        error, k = LocalError(self.system, self.scheme, end), self.scheme.order + 1
        knots, _ = knots_of(self.system.signals, np.linspace(0.0, end, 2001), self.steps.breakpoints)
        if len(knots) > MANY and self.system.comm.rank == 0:
            logging.getLogger("rotfem").warning(f"rotfem: adaptive steps may end at {len(knots)} knots; {QUICKER}")
        pace = start.pace or Pace(min(longest, 1e-4 * end), 1.0, error.displacement(start))
        state, seen, grows = start, View(1), True

        def following() -> tuple[Interval, State]:
            part = self._interval(state, min(pace.h, longest), knots, error, tolerance * pace.largest)
            return part, self.begun(state, seen, part) if seen.side else state  # between fits what jumps is negligible

        part, start = following()
        for _ in range(MOST_STEPS):
            # predict and solve
            with self.system.view.as_in(part.finish):
                try:
                    new = self.step(start, part.length, part.end)
                except ComputationError as failure:
                    if SHRINK * part.length < shortest:
                        raise too_short(shortest, state.t, failure) from failure
                    ratio = np.inf
                else:
                    largest = max(pace.largest, error.displacement(new))
                    allowed = max(tolerance * largest, 10 * self.newton.tolerance)  # below, errors are noise
                    ratio = error(self.scheme.local_error(new, start), part.length) / allowed
            # accept, or try a shorter one
            if ratio > 1.0:
                self.rejected, grows = self.rejected + 1, False
                pace = replace(pace, h=part.length * max((ratio / AIM_OF_ERROR) ** (-1 / k), SHRINK))
                if pace.h < shortest:
                    raise too_short(shortest, state.t)
                part, start = following()
                continue
            wanted, ratio = min(pace.h, longest), max(ratio / AIM_OF_ERROR, 1e-12)
            if part.length < SHRINK * wanted:  # cut short by a knot: of longer steps its error says nothing
                pace = replace(pace, largest=largest)
            else:
                ratio *= max(wanted / part.length, 1.0) ** k
                factor = np.clip((ratio * pace.error) ** (-1 / (6 * k)), SHRINK, self.scheme.growth if grows else 1.0)
                pace = Pace(float(max(wanted, part.length) * factor), ratio, largest)
            grows = True
            self._observed(start, new)
            state, seen = new, part.finish
            if state.t >= end:
                yield state
                return
            part, start = following()
            yield start.changed(pace=pace)
        raise ComputationError(f"{MOST_STEPS} steps have not reached the end", time=state.t, advice=QUICKER)

    def _interval(self, state: State, wanted: float, knots: Array, error: LocalError, allowed: float) -> Interval:
        """Return an interval from a state on that is about as long as wanted.

        It ends at a knot where a signal may jump or have a kink, unless what it loses of the signals is negligible:
        then cubics replace them in it.
        """
        t, end = state.t, float(self.steps.end)
        left = end - t
        h = left if wanted >= left * (1 - 1e-9) else left / 2 if wanted > 0.6 * left else wanted
        stop = end if h == left else t + h
        first, last = np.searchsorted(knots, (t * (1 + SAME) + SAME * end, stop - SAME * end), side="right")
        if first == last:
            at = last < len(knots) and knots[last] <= stop + SAME * end
            return Interval(stop, h, at_knot=bool(at))
        fitted = Interval(stop, h, line=(t, stop, 3))
        inside = knots[first:last]
        if self._lost(state, fitted, inside, error) <= allowed:
            return fitted
        stop = float(inside[0])
        return Interval(stop, stop - t, at_knot=True)

    def _lost(self, state: State, part: Interval, knots: Array, error: LocalError) -> float:
        """Return the displacement by what an interval loses of the signals, over all intervals like it (scaled).

        It is that of the tangent in a motion as quick as the knots follow each other, by the largest deviation.
        """
        s, n = self.system, len(knots)
        if s.clamp is not None or part.line is None:
            return np.inf
        times = np.append(knots, part.end)
        off = sum(signal.deviation(times, *part.line) for signal in s.signals)
        t, c = float(times[int(np.argmax(off))]), np.pi * n / part.length
        s.count_rotations_from(state.reference)
        moved = list[Array]()
        for view in (View(-1), View(0, part.line)):
            with s.view.as_in(view):
                s.set_time(t)
                s.set_state(state.q, state.v, state.a)
                moved.append(np.array(s.correction((1.0, c, c * c))))
        return error.size(moved[1] - moved[0]) * self.steps.end / part.length

    # --- one step ----------------------------------------------------------------------------------------------------

    def advance(self, state: State, h: float, end: float, halvings: int = HALVINGS) -> State:
        """Return the state at an end (s), state.t + h but for rounding, in halved steps where Newton fails."""
        try:
            return self.step(state, h, end)
        except ComputationError as failure:
            if self.system.solved_at_once:
                raise
            if halvings == 0:
                advice = 'a smaller time.step, time.scheme = "energy_conserving", or check load and speed then'
                what = f"{failure.what} (the step was cut down to {h:.3g} s)"
                raise ComputationError(what, failure.time, advice) from failure
        self.substeps += 1
        middle = self.advance(state, h / 2, state.t + h / 2, halvings - 1)
        return self.advance(middle, h / 2, end, halvings - 1)

    def step(self, state: State, h: float, end: float) -> State:
        """Return the state at an end (s), after a step of length h (s): its stages predicted and solved."""
        if keep_rotations_small(self.system, self.scheme, state, h):
            self.last.shifts = None
        start = state if state.jump is None else self._filtered(state, h)
        done = self.scheme.solved(start, h, end, self)
        for i in range(len(done), self.scheme.stages):
            done.append(self.solve(self.scheme.stage(i, start, h, end, done), start))
        new = self.scheme.finish(start, h, done)
        new.reference = start.reference
        self.system.check_reach(new.q, new.t)
        new.hub_work = self.system.hub_work(new, start)
        return new

    def solve(self, stage: Stage, state: State) -> Stage:
        """Return a stage of a step from a state, solved by Newton's method from its prediction.

        Where that fails it starts once more from the state. Of a large system a factor serves as long as increments
        shrink by it (see `Factor`).
        """
        s, newton, last, span = self.system, self.newton, self.last, stage.over
        s.set_time(stage.t)
        if s.clamp is not None:  # which moves the last shape: turned with it
            turned = s.clamp.turned(state.q, state.v, state.t, stage.t if span is None else span.end)
            stage.correct((turned if span is None else (state.q + turned) / 2) - stage.q)
        with nullcontext() if span is None else s.over_step(span.start, span.end, span.start.memory) as balance:
            s.prescribe(stage.t, stage.q, stage.v, stage.a)
            move, before, tangents = stage.q - state.q, state.q, 0
            if last.confirmed < 1.0 and not s.linear:
                stage.correct((last.confirmed - 1.0) * move)
            settles = s.linear and s.settled and not s.current  # the matrix stays from now on, the factor is of another
            keeps = s.keeps_factor and balance is None
            factor = Factor(last.shifts == stage.shifts and not settles) if keeps else None

            def increment(renewed: bool) -> tuple[float, bool]:
                """Correct the stage; return the size of the correction, and whether it is exact."""
                nonlocal before, tangents
                s.set_state(stage.q, stage.v, stage.a)
                far = not s.linear and (last.long or newton.diverging or tangents >= LONG_SOLUTION)
                dq = s.correction(stage.shifts, before if far else None) if renewed else s.chord()
                tangents, size = tangents + renewed, s.increment_size(dq)
                if s.solved_at_once:
                    stage.correct(dq)
                    return size / (s.size(stage.q) or 1.0), renewed or s.current
                before = stage.q.copy()
                stage.correct(dq if size <= REACH else dq * (REACH / size))
                return size, False

            try:
                try:
                    newton.solve(increment, lambda: s.size(stage.q), factor)
                except ComputationError:
                    if s.solved_at_once or last.confirmed == 0.0:
                        raise
                    last.long, last.confirmed, before, tangents = True, 0.0, state.q, 0
                    stage.correct(state.q - stage.q)
                    newton.solve(increment, lambda: s.size(stage.q))
            except ComputationError as error:
                last.shifts = None
                raise ComputationError(error.what, time=stage.t, advice=error.advice) from None
            last.shifts, last.long = stage.shifts if keeps else None, tangents > LONG_SOLUTION
            if tangents > GOOD_PREDICTION or last.confirmed < 1.0:
                last.confirmed = confirmed_part(s, stage.q - state.q, move)
            if balance is not None:
                s.set_state(stage.q, stage.v, stage.a)
                stage.memory = balance.finish()
        if newton.diverging and not s.solved_at_once:  # the root may be another one
            s.set_state(stage.q, stage.v, stage.a)
            s.check_inside_out(stage.t)
        return stage

    def imbalance(self, stage: Stage) -> Array:
        """Return −F at a stage (see `Equations`)."""
        s = self.system
        s.set_time(stage.t)
        s.prescribe(stage.t, stage.q, stage.v, stage.a)
        s.set_state(stage.q, stage.v, stage.a)
        return np.asarray(s.imbalance())

    # --- after jumps of what is prescribed ---------------------------------------------------------------------------

    def begun(self, state: State, before: View, part: Interval) -> State:
        """Return a state as an interval starts from it: with the accelerations after a jump of what drives the system.

        `before` is how the step that ends with it evaluates signals.
        """
        after = View(1, part.line)
        if before.side == 0 and (before.line == part.line or (has_ends(before.line) and has_ends(part.line))):
            return state
        s, t = self.system, state.t
        s.count_rotations_from(state.reference)
        with s.view.as_in(before):
            old = s.driven(t)
        with s.view.as_in(after):
            same = np.allclose(s.driven(t), old, rtol=1e-7, atol=0.0)
        if s.comm.allreduce(same, MPI.LAND):  # what moves a clamp is on the processes that hold it
            return state
        new = self.accelerated(state, after)
        return self.scheme.jumped(new, new.a - state.a)

    def accelerated(self, state: State, view: View) -> State:
        """Return a state with the accelerations that its equations of motion give, signals evaluated by a view."""
        s, t = self.system, state.t
        new = state.changed(q=state.q.copy(), v=state.v.copy(), a=state.a.copy(), balanced=True)
        with s.view.as_in(view):
            s.prescribe(t, new.q, new.v, new.a)
            s.set_time(t)
            s.set_state(new.q, new.v, new.a)
            change = np.asarray(s.acceleration())
            new.a += change
            new.jump = change if state.jump is None else state.jump + change
            new.hub_work = s.hub_work(new)
        if new.hub_work is not None and state.hub_work is not None:
            new.hub_work[:2] = state.hub_work[:2]
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
        with s.view.as_in(View(1, s.view.line)):
            s.count_rotations_from(state.reference)
            s.set_time(state.t)
            s.set_state(state.q, state.v, state.a - jump)
            change = shifts[2] * s.correction(shifts) - jump
        return self.scheme.jumped(state.changed(a=state.a + change), change)


def too_short(shortest: float, t: float, failure: ComputationError | None = None) -> ComputationError:
    """Return the error of an adaptive step that would have to be shorter than allowed."""
    if failure is not None:
        return ComputationError(f"{failure.what} (the step was cut down to {shortest:.3g} s)", t, failure.advice)
    what = f"the step fell below {shortest:.3g} s without meeting the tolerance"
    return ComputationError(what, time=t, advice="a looser time.tolerance, a smaller time.min_step, or more damping")


def keep_rotations_small(system: System, scheme: Scheme, state: State, h: float) -> bool:
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


def confirmed_part(system: System, move: Array, predicted: Array) -> float:
    """Return the part c of a predicted move p that is closest to the computed move m: m·p/p·p, cut to 0 … 1.

    It is 1 where the motion is smooth. Of vibrations that the steps do not resolve a prediction by constant
    acceleration is worse than none, as h²q̈ is much larger than they are.
    """
    length = system.product(predicted, predicted)
    part = float(np.clip(system.product(move, predicted) / length, 0.0, 1.0)) if length > 0.0 else 1.0
    return part if part < 0.9 else 1.0


class LocalError:
    """Error at the end of a history that a step's local error e leads to if every step were like this one.

    A vibration of frequency ω and amplitude A has a local error e of C (ωh)ᵐ A in every step. N such steps add up to
    N C (ωh)ᵐ A, but never to more than 2 A, the vibration in opposite phase: what is small need not be resolved. With

        F = (M + τ C + τ² K)⁻¹ M,    N C (h/τ)ᵐ = 2,    n = (m + 1)/2,

    4 Fⁿ N e is N e/2 where that is 2A, and at most 2.1 · 2A beyond. An unresolved vibration has an e of up to
    (s ωh)² A, of which F with τ = s h leaves A: it counts with twice its amplitude. The error is the larger
    of both. With C, motions that strong damping stops within the step are filtered too (as any stiff component: Hairer
    & Wanner 1996, eq. (IV.8.20)). Matrices are those at the start. Without Fⁿ motions that ring take three to five
    times the steps.

    Args:
        system: equations of motion; state and time of the start are set in it.
        scheme: whose local errors are measured.
        end: length of the history, s.
    """

    def __init__(self, system: System, scheme: Scheme, end: float):
        self.system, self.end, self.scheme = system, end, scheme
        system.set_time(0.0, system.model.problem.motion)  # of a free hub the speed it starts with, not of now
        system.set_state(system.zeros())
        self._matrices = system.with_hub(system.mass_damping_stiffness())
        self._x, self._b = sparse_part(self._matrices[0]).createVecs()
        s = system.structure
        moved = dict(zip(s.components, np.where(s.moves, 1.0, s.radius / s.length), strict=True))
        nodes = len(system.scale) // len(s.unknowns)
        self._weights = np.tile([moved[name] for name in s.unknowns], nodes) / system.scale
        self._filters = lru_cache(maxsize=4)(self._made)

    def __call__(self, error: Array | None, h: float) -> float:
        """Return the largest displacement of an error of q (local dof array), scaled, at the end of the history."""
        assert error is not None
        adds_up, remains = self._filters(COARSE ** round(np.log(h) / np.log(COARSE)))
        e = np.full(self._x.getLocalSize(), error[-1])  # the last process has the angle of a hub
        owned = self.system.V.dofmap.index_map.size_local * self.system.V.dofmap.index_map_bs
        e[:owned] = error[:owned]
        once, often = self._filtered(remains, e), e
        for _ in range((self.scheme.estimate[1] + 1) // 2):
            often = self._filtered(adds_up, often)
        sizes = [self.size(with_ghosts(self.system.V, x[:owned])) for x in (often, once)]
        return max(4.0 * self.end / h * sizes[0], 2.0 * sizes[1])

    def _filtered(self, filter: DirectSolver, e: Array) -> Array:
        """Return F e of owned rows."""
        M, self._x.array[:] = self._matrices[0], e
        sparse_part(M).mult(self._x, self._b)
        if isinstance(M, PlusLowRank):
            self._b.array[:] += M.added(e)
        return filter.solve(self._b)

    def _made(self, h: float) -> list[DirectSolver]:
        """Return the filters of what adds up, and of unresolved vibrations, for steps of h (s)."""
        (M, C, K), (constant, order, lost) = self._matrices, self.scheme.estimate
        out = []
        for tau in (h * (0.5 * constant * self.end / h) ** (1 / order), lost * h):
            out.append(DirectSolver(combine(sparse_part(M).duplicate(), [M, C, K], np.array([1.0, tau, tau * tau]))))
        return out

    def size(self, x: Array) -> float:
        """Return the largest displacement of points of the sections in a local dof array, over the length."""
        here = float(np.max(np.abs(x[: len(self._weights)]) * self._weights, initial=0.0))
        return self.system.comm.allreduce(here, MPI.MAX) if self.system.shared else here

    def displacement(self, state: State) -> float:
        """Return the largest displacement of a state relative to the turning frame, in units of its scale."""
        q, clamp = state.q[: len(self.system.scale)], self.system.clamp
        if clamp is not None:
            x = self.system.V.tabulate_dof_coordinates()[:, 0]
            q = clamp.relative(q.reshape(len(x), -1), x, state.t).ravel()
        return max(1e-6, self.size(q))
