"""Adaptive steps: as long as a tolerance allows, and never over anything that is prescribed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.alpha_family import GeneralisedAlpha
from rotfem.analysis.error_measure import ErrorMeasure
from rotfem.analysis.fixed_steps import Steps, fixed_steps
from rotfem.analysis.schemes import State
from rotfem.analysis.stepper import Stepper, seen
from rotfem.analysis.switching import watched_switches
from rotfem.analysis.time_grid import LEAST, Leg, TimeGrid
from rotfem.errors import ComputationError
from rotfem.mechanics.courses import SAME, View

Array = npt.NDArray[Any]

#: Safety factor, smallest change, changes not worth a new factorisation, smallest relative scale.
SAFETY, SHRINK, KEEP, FLOOR = 0.9, 0.2, (0.9, 1.25), 1e-6

#: Local errors are estimates: the tolerance is divided by this.
MARGIN = 7.0

#: Growth, from step to step, of what errors allow: those of a vibration are small twice in a period, wherever it is.
STEADY = 1.2

#: Steps by which the scale of a motion is found, how alike their results must be, and errors that are noise, in units
#: of Newton's tolerance.
SCOUTED, ALIKE, NOISE = (20, 40), 0.6, 10.0

#: The first step, the longest and the shortest, and the stretch within which knots may be too dense to be met, as parts
#: of the end.
FIRST, LONGEST, SHORTEST, CELL = 1e-4, 1 / 20, 1e-9, 1 / 2000

#: Most a course may be off a straight line over a step, as a part of its largest value.
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
        self.stepper, self.state, self.steps, self.end = stepper, state, steps, float(steps.end)
        self.tolerance = float(steps.tolerance)
        self.longest = steps.max_step or LONGEST * self.end
        self.shortest = steps.min_step or SHORTEST * self.end
        self.measure = ErrorMeasure(stepper.system, stepper.scheme, self.end)
        cells = np.append(np.arange(round(1 / CELL)) * (CELL * self.end), self.end)
        self.cells = TimeGrid(stepper.system.courses, cells, CELL * self.end, fixed=False)
        self.landings, self.dense = self.cells.landings()
        self.least = NOISE * stepper.newton.tolerance
        self.wanted, self.allowed = min(self.longest, FIRST * self.end), np.inf
        if stepper.pace is not None:
            self.wanted, self.largest, self.allowed = stepper.pace
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
        state, wanted, stepper, allowed = self.state, self.wanted, self.stepper, self.allowed
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
            new, ratio = self._drifted(start, h, stop, finish) if drifts else self._tried(start, h, stop, finish)
            power, most = 1 / (stepper.scheme.estimate[1] - 1), stepper.scheme.growth
            if averaged and ratio > 1.0 and ratio != FAILED and h <= self.cells.step * (1 + 1e-9):
                ratio = 1.0  # the time grid has nothing finer; shorter steps would follow each breakpoint after all
            factor = float(np.clip(SAFETY * max(ratio, 1e-12) ** -power, SHRINK, most))
            if ratio > 1.0:
                stepper.rejected += 1
                allowed, least = (h, 0.0) if ratio == FAILED else (allowed, least)
                wanted = self._shorter(state.t, h * min(factor, SAFETY))
                continue
            least = self.cells.step
            allowed = min(h * max(ratio, 1e-12) ** -power, STEADY * allowed)
            factor = min(factor, max(SAFETY * allowed / h, SHRINK))
            if h >= wanted or factor < 1.0:
                wanted = min(self.longest, h if KEEP[0] <= factor <= KEEP[1] else h * factor)
            if switches is not None:
                switches.passed(number, start, new)
            if stepper.watch is not None:
                stepper.watch(start, new, Leg(stop, h, lands, averaged, drifts, plain=False))
            following = self._next(new.t, wanted, least)[1] if new.t < self.end else h
            if not drifts and following != h:
                new = stepper.scheme.resized(new, start, following)
            if lands or averaged:
                new = stepper.restart(new, finish, View(1 if lands else 0))
            state, stepper.pace = new, (wanted, self.largest, allowed)
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

    def _drifted(self, start: State, h: float, stop: float, finish: View) -> tuple[State, float]:
        """Return the state after a step between two knots that is too short to be solved for, and no error."""
        new = self.stepper.drift(start, h, stop)
        return (new if finish.window is None else self.stepper.struck(new, h)), 0.0

    def _next(self, t: float, wanted: float, least: float) -> tuple[float, float]:
        """Return end and length of a step from t that is about as long as wanted and steps over nothing.

        Where breakpoints are denser than the time grid it is not shorter than `least`, s.
        """
        i = int(np.searchsorted(self.landings, t * (1 + SAME), side="right"))
        stop = float(self.landings[i]) if i < len(self.landings) else self.end
        left, h = stop - t, min(wanted, self.longest)
        if h < least and self._averaged(t, t + min(h, left)):
            h = least
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
