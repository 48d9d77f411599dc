"""The march through a time history, in fixed steps or adaptive ones.

A fixed step is taken in legs where breakpoints of what is prescribed lie in it.

At a kink of what is prescribed the memory of a scheme goes on along another line than it came.
Generalised-α keeps an acceleration that stands for an instant θ h before the start of the next step, θ = α_f − α_m.
Where the accelerations jump there, it jumps with them; where their rate jumps by Δȧ, its error is θ h Δȧ, and that of
velocities θ² h² Δȧ/2 from then on. Over steps of one length that adds up to an error of the order of the
scheme. Where a step is taken in legs, short and long ones, it does not: a blow of two short legs has up to eight
times its impulse with ρ∞ = 0. So the memory is put on the line that the accelerations take after the kink.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotfem.analysis.alpha_family import GeneralisedAlpha
from rotfem.analysis.error_measure import ErrorMeasure
from rotfem.analysis.schemes import Array, Scheme, State
from rotfem.analysis.stepper import STEADY, Stepper, seen
from rotfem.analysis.switching import watched_switches
from rotfem.analysis.time_grid import LEAST, Leg, TimeGrid
from rotfem.errors import ComputationError
from rotfem.mechanics.time_signals import SAME, View
from rotfem.numerics.newton import Newton

#: Lag of a memory, in steps, up to which kinks between plain steps are left to the order of the scheme.
PLAIN = 0.06


@dataclass(frozen=True)
class Steps:
    """When a history ends, and how it is stepped: by a fixed step or to a tolerance.

    Attributes:
        end: last time, s.
        step: fixed step, s; None for adaptive ones.
        tolerance: error of all adaptive steps together, relative to the largest displacement; None for fixed ones.
        max_step, min_step: bounds of an adaptive step, s; None for those of the program.
    """

    end: float
    step: float | None = None
    tolerance: float | None = None
    max_step: float | None = None
    min_step: float | None = None

    @classmethod
    def of(cls, time: Any) -> Steps:
        """Return the steps of anything with these attributes, as a scene's [time] table."""
        return cls(time.end, time.step, time.tolerance, time.max_step, time.min_step)


def fixed_steps(stepper: Stepper, state: State, steps: Steps) -> Iterator[State]:
    """Yield the states at step, 2 step, … and end (s); the last distance may be shorter.

    Raises:
        ComputationError: a step failed, however short.
    """
    assert steps.step is not None
    reached = state.t
    legs = (leg for leg in TimeGrid(stepper.system.signals, *grid(steps), stepper.scheme.order) if leg.end > reached)
    leg = next(legs, None)
    if leg is not None and reached == 0.0:
        state = started(stepper, state, leg)
    while leg is not None:
        after = next(legs, None)
        state = travel(stepper, state, leg, after)
        if leg.whole:
            yield state
        leg = after


def grid(steps: Steps) -> tuple[Array, float]:
    """Return the ends of fixed steps, the first at 0, and their length (s)."""
    assert steps.step is not None
    n = int(np.ceil(steps.end / steps.step - 1e-9))
    return np.append(np.arange(n) * steps.step, steps.end), steps.step


def started(stepper: Stepper, state: State, first: Leg) -> State:
    """Return the state at t = 0 as the first leg starts from it."""
    return stepper.restart(state, View(1), View(window=(0.0, first.length))) if first.averaged else state


def travel(stepper: Stepper, state: State, leg: Leg, after: Leg | None) -> State:
    """Return the state at the end of a leg, as the one after it starts from it.

    Raises:
        ComputationError: the step failed, however short.
    """
    old = state
    if leg.free:
        state = stepper.advance(old, leg.length, leg.end)
    elif leg.drifts:
        state = stepper.drift(old, leg.length, leg.end, leg.finish)
    else:
        joined = after is not None and leg.joins(after)
        window = (leg.length, after.length if after is not None and joined else 0.0) if leg.averaged else None
        with seen(stepper.system, View(-1 if leg.lands else 0, window)):
            state = stepper.advance(old, leg.length, leg.end)
    if stepper.observer is not None:
        stepper.observer(old, state, leg)
    if after is None or (leg.length == after.length and leg.doubles(after)):
        return state
    if not leg.drifts and not after.drifts and after.length != leg.length:
        state = stepper.scheme.resized(state, old, after.length)
    if leg.lands or ((leg.averaged or after.averaged) and not leg.joins(after)):
        ahead = View(1 if leg.lands else 0, (0.0, after.length) if after.averaged else None)
        state = stepper.restart(state, leg.finish, ahead)
    drifts, averaged = leg.drifts or after.drifts, leg.averaged or after.averaged
    if not (drifts or averaged) and bends(stepper.scheme, leg, after):
        state = bent(stepper, state, leg.length, after.length)
    return state


def bends(scheme: Scheme, leg: Leg, after: Leg) -> bool:
    """Return whether a kink between two legs matters to the memory of a scheme, or the second one starts without it."""
    if leg.plain and after.plain and scheme.lag <= PLAIN:
        return False
    return scheme.lag > 0.0 and (leg.lands or scheme.forgets(leg.length, after.length))


def bent(stepper: Stepper, state: State, last: float, h: float) -> State:
    """Return a state whose memory is on the line that what drives the system takes from here.

    Args:
        stepper: what takes the steps.
        state: at the end of a step, with the accelerations and the memory that the next one starts from.
        last: length of that step, s.
        h: length of the next one, s.
    """
    s, t, scheme = stepper.system, state.t, stepper.scheme
    if s.clamp is not None:  # its motion is exact, and what it drives follows by waves
        return state
    weights = {(t + h, -1): 1.0, (t, 1): -1.0}
    if not scheme.forgets(last, h):
        weights |= {(t, -1): -h / last, (t - last, 1): h / last}

    def parts(values: Callable[[float], Array]) -> list[Array]:
        out = []
        for (at, side), weight in weights.items():
            with seen(s, View(side)):
                out.append(weight * values(at))
        return out

    def forces(at: float) -> Array:
        s.set_time(at)
        s.set_state(state.q, state.v, state.a)
        return np.asarray(s.forces(at))

    driven = np.array(parts(s.driven))
    if np.max(np.abs(driven.sum(axis=0)), initial=0.0) <= STEADY * np.max(np.abs(driven), initial=0.0):
        return state
    s.count_rotations_from(state.reference)
    change = np.sum(parts(forces), axis=0)
    s.set_time(t)
    s.set_state(state.q, state.v, state.a)
    return scheme.bent(state, s.accelerated(change))


__all__ = ["LARGEST_LINEAR_DEFLECTION", "March", "Steps"]

#: A linear theory has lost its meaning when a displacement exceeds the structure's own length, or a rotation 1 rad.
LARGEST_LINEAR_DEFLECTION = 1.0


class March:
    """A time history, state after state.

    Args:
        system: equations of motion.
        scheme: time-stepping scheme.
        steps: end and length of the steps.
        newton: iteration control of the steps.
        q: shape at t = 0 in the turning frame, local dof array of the structure; undeformed if None.
        v: velocities there, relative to the turning frame; it is at rest if None.

    Attributes:
        stepper: what advances the system, with its counts.
        reached: state that an earlier march has yielded, to go on from; its stepper's numbers must be this one's.
    """

    def __init__(
        self, system: Any, scheme: Scheme, steps: Steps, newton: Newton, q: Array | None = None, v: Array | None = None
    ):
        self.system, self.steps = system, steps
        self.stepper = Stepper(system, scheme, newton)
        self.reached: State | None = None
        self._q = np.zeros_like(system.q.x.array) if q is None else q
        self._v = v

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
            state = self.stepper.start(0.0, q, v)
            yield state
        steps = fixed_steps if self.steps.step is not None else AdaptiveSteps
        yield from steps(self.stepper, state, self.steps)


#: Safety factor, smallest change, smallest relative scale.
SAFETY, SHRINK, FLOOR = 0.9, 0.2, 1e-6

#: Both gains of the controller H211PI: h' = h (r_n r_{n−1})^(−GAIN/k) with errors r ∝ hᵏ, parts of what is allowed. It
#: filters what vibrations make of them (Söderlind, ACM Trans. Math. Softw. 29 (2003) 1, table 1). No step grows after
#: one that was taken back (Hairer, Nørsett & Wanner 1993, section II.4).
GAIN = 1 / 6

#: Local errors are estimates: the tolerance is divided by this.
MARGIN = 7.0

#: Steps by which the scale of a motion is found, how alike their results must be, and errors that are noise, in units
#: of Newton's tolerance.
SCOUTED, ALIKE, NOISE = (20, 40), 0.6, 10.0

#: The first step, the longest and the shortest, and the stretch within which knots may be too dense to be met, as parts
#: of the end.
FIRST, LONGEST, SHORTEST, CELL = 1e-4, 1 / 20, 1e-9, 1 / 2000

#: Most a signal may be off a straight line over a step, as a part of its largest value.
BENT = 0.1

#: Error, as a part of what is allowed, of a step that could not be solved, and halvings of one that is short already.
FAILED, HALVINGS = 100.0, 5

#: Steps, with those taken back, after which a march is given up; steps over which its pace is measured, and by how much
#: that may be too slow for the rest.
MOST_STEPS, PACE, HOPELESS = 500_000, 5000, 10.0

#: What to do then.
QUICKER = (
    "fixed steps (time.step), which take the mean of what is quicker than they are; a looser time.tolerance; or an "
    "earlier time.end"
)


class Scout(Stepper):
    """Steps so long that the acceleration after a knot, or before it, would make the next one overshoot."""

    def restart(self, state: State, before: View, after: View) -> State:
        """Return the state without an acceleration."""
        return self.scheme.start(state.changed(a=np.zeros_like(state.a)))


class AdaptiveSteps:
    """States whose local errors add up to a tolerance, relative to the largest displacement so far.

    Args:
        stepper: what advances the system.
        state: at t = 0.
        steps: `Steps` with a tolerance.
    """

    def __init__(self, stepper: Stepper, state: State, steps: Any):
        self.stepper, self.state, self.end = stepper, state, float(steps.end)
        self.tolerance = float(steps.tolerance)
        self.longest = steps.max_step or LONGEST * self.end
        self.shortest = steps.min_step or SHORTEST * self.end
        self.measure = ErrorMeasure(stepper.system, stepper.scheme, self.end)
        cells = np.append(np.arange(round(1 / CELL)) * (CELL * self.end), self.end)
        self.cells = TimeGrid(stepper.system.signals, cells, CELL * self.end, fixed=False)
        self.landings, self.dense = self.cells.landings()
        self.least = NOISE * stepper.newton.tolerance
        self.wanted, self.before = min(self.longest, FIRST * self.end), 1.0
        if stepper.pace is not None:
            self.wanted, self.largest, self.before = stepper.pace
            return
        self.largest = self.measure.displacement(state)
        if self.largest < FLOOR:
            coarse, fine = (self._scouted(n) for n in SCOUTED)
            self.largest = max(FLOOR, 0.5 * min(coarse, fine) if ALIKE * max(coarse, fine) < min(coarse, fine) else 0.0)

    def __iter__(self) -> Iterator[State]:
        """Yield the state at the end of every step.

        Raises:
            ComputationError: a step failed, or would have to be shorter than allowed, or there are too many.
        """
        state, wanted, stepper, before = self.state, self.wanted, self.stepper, self.before
        order, most = stepper.scheme.estimate[1] - 1, stepper.scheme.growth
        least, switches = self.cells.step, watched_switches(stepper.system)
        began = state.t
        for number in range(1, MOST_STEPS + 1):
            if state.t >= self.end:
                return
            if number % PACE == 0:
                self._check_pace((state.t - began) / PACE, state.t)
                began = state.t
            stop, h = self._next(state.t, wanted, least)
            averaged, lands = self._averaged(state.t, stop), stop in self.landings
            start = stepper.restart(state, View(), View(window=(0.0, h))) if averaged else state
            finish = View(-1 if lands else 0, (h, 0.0) if averaged else None)
            drifts = h <= LEAST * (1 + 1e-6) * min(self.cells.step, wanted)
            new, ratio = (stepper.drift(start, h, stop, finish), 0.0) if drifts else self._tried(start, h, stop, finish)
            if averaged and ratio > 1.0 and ratio != FAILED and h <= self.cells.step * (1 + 1e-9):
                ratio = 1.0  # the time grid has nothing finer; shorter steps would follow each breakpoint after all
            if ratio > 1.0:
                stepper.rejected += 1
                least = 0.0 if ratio == FAILED else least
                wanted, most = self._shorter(state.t, h * max(SAFETY * ratio ** (-1 / order), SHRINK)), 1.0
                continue
            least, ratio = self.cells.step, max(ratio / SAFETY**order, 1e-12)
            factor = float(np.clip((ratio * before) ** (-GAIN / order), SHRINK, most))
            most = stepper.scheme.growth
            if h >= wanted or factor < 1.0:
                wanted, before = min(self.longest, h * factor), ratio
            if switches is not None:
                switches.passed(number, start, new)
            if stepper.observer is not None:
                stepper.observer(start, new, Leg(stop, h, lands, averaged, drifts, plain=False))
            following = self._next(new.t, wanted, least)[1] if new.t < self.end else h
            if not drifts and following != h:
                new = stepper.scheme.resized(new, start, following)
            if lands or averaged:
                new = stepper.restart(new, finish, View(1 if lands else 0))
            state, stepper.pace = new, (wanted, self.largest, before)
            yield state
        raise ComputationError(f"{MOST_STEPS} steps have not reached the end", time=state.t, advice=QUICKER)

    def _check_pace(self, advance: float, t: float) -> None:
        """Refuse a march whose last steps were so short (s, on average) that it would not reach its end.

        Raises:
            ComputationError: it would take more than HOPELESS times the steps that there may be.
        """
        if self.end - t > HOPELESS * MOST_STEPS * advance:
            what = f"the last {PACE} steps were of {advance:.3g} s on average: {MOST_STEPS} do not reach the end"
            raise ComputationError(what, time=t, advice=QUICKER)

    def _scouted(self, number: int) -> float:
        """Return the largest displacement (scaled) in so many steps, which see all that is prescribed; 0 if they fail.

        Where a motion starts from nothing, errors that are small beside what it becomes would be large beside what it
        is. The scale counts if steps of two lengths agree on it, half of it to be on the safe side.
        """
        system, size = self.stepper.system, 0.0
        scout = Scout(system, GeneralisedAlpha(0.0), self.stepper.newton)
        try:
            for state in fixed_steps(scout, scout.scheme.start(self.state), Steps(self.end, self.end / number)):
                size = max(size, self.measure.displacement(state))
                self.stepper.rejected += 1
        except ComputationError:
            return 0.0
        return size if np.isfinite(size) else 0.0

    def _tried(self, start: State, h: float, stop: float, finish: View) -> tuple[State, float]:
        """Return the state at the end of a step, and its error as a part of what is allowed."""
        stepper = self.stepper
        with seen(stepper.system, finish):
            try:
                new = stepper.advance(start, h, stop, 0 if h > LEAST * self.longest else HALVINGS)
            except ComputationError:
                if h <= LEAST * self.longest:
                    raise
                return start, FAILED
        local = stepper.scheme.local_error(new, start)
        self.largest = max(self.largest, self.measure.displacement(new))
        if local is None:  # a fallback has taken it
            return new, 1.0
        return new, MARGIN * self.measure(local, h) / max(self.tolerance * self.largest, self.least)

    def _next(self, t: float, wanted: float, least: float) -> tuple[float, float]:
        """Return end and length of a step from t that is about as long as wanted and steps over nothing.

        Where breakpoints are denser than the time grid it is not shorter than `least`, s.
        """
        i = int(np.searchsorted(self.landings, t * (1 + SAME), side="right"))
        stop = float(self.landings[i]) if i < len(self.landings) else self.end
        left, h = stop - t, min(wanted, self.longest)
        if self._averaged(t, t + min(h, left)):
            if self._is_blow(t):
                h = min(left, LEAST * self.cells.step)
                return (stop, left) if h >= left * (1 - 1e-9) else (t + h, h)
            h = max(h, least)
        while h > self.cells.step and self.cells.bent(t, t + min(h, left)) > BENT:
            h /= 2
        if h >= left * (1 - 1e-9):
            return stop, left
        h = left / 2 if h > 0.6 * left else h
        return t + h, h

    def _averaged(self, begin: float, end: float) -> bool:
        """Return whether a step meets what is denser than it can follow."""
        i = np.searchsorted(self.dense[:, 1], begin * (1 + SAME), side="right")
        return bool(i < len(self.dense) and self.dense[i, 0] < end * (1 - SAME))

    def _is_blow(self, t: float) -> bool:
        """Return whether what is averaged here is shorter than a cell: steps that drift have its whole impulse."""
        apart = np.flatnonzero(self.dense[1:, 0] > self.dense[:-1, 1] * (1 + SAME))
        begins, ends = self.dense[np.append(0, apart + 1), 0], self.dense[np.append(apart, -1), 1]
        i = int(np.searchsorted(ends, t * (1 + SAME), side="right"))
        return bool(begins[i] <= t * (1 + SAME) and ends[i] - begins[i] < self.cells.step)

    def _shorter(self, t: float, h: float) -> float:
        """Return the length (s) of a step to be tried again.

        Raises:
            ComputationError: it is shorter than allowed.
        """
        if h >= self.shortest:
            return h
        raise ComputationError(
            f"the step fell below {self.shortest:.3g} s without meeting the tolerance",
            time=t,
            advice="a looser time.tolerance, a smaller time.min_step, or some damping",
        )
