"""The time grid of a march: its steps, and the breakpoints of all prescribed data between their ends.

Tables have known breakpoints. A function of time is sampled a number of times in every step before the march. Where it
jumps, bisection finds the instant; where it is far off a straight line within a step the samples themselves are marks,
between which it is nearly straight. What is narrower than the distance of two samples is not seen: there `breakpoints`
say where it is.

A step with a breakpoint inside is taken in legs from one to the next. Where there are too many of them, those
that matter least are passed, and the legs that pass them see the signals averaged (see
`rotfem.mechanics.time_signals`), as
do legs that are as short as LEAST: a ramp of a microsecond is a blow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.mechanics.time_signals import SAME, TimeSignal, View

Array = npt.NDArray[Any]

#: End of a leg (s), whether it lands there, and whether it is averaged.
Stop = tuple[float, bool, bool]

#: Part of a step that is one instant, and shortest leg that is stepped: below it, round-off of q spoils a.
CLOSE, LEAST = 1e-9, 1e-3

#: Knots in a step from which only those are landed on that matter this many times as much as the others.
MOST, OUTSTANDING = 4, 10.0

#: Deviation of a signal from a straight line over a step, as a part of its largest value, from which knots are landed
#: on where there are many, and from which marks are by a scheme of second order; by one of order p a power p/2 of that.
KINKED, CURVED = 1e-3, 5e-2

#: Deviation over a step from which what is smooth between marks is averaged there, a parabola in up to three steps; and
#: order of the schemes that averages by hats serve: those of higher order sum up what is smooth in a step as it is.
SMOOTH, AVERAGING = 0.1, 2


#: Samples of a function in all, and fewest and most in a step.
SAMPLES, FEWEST, DENSEST = 200_000, 4, 64

#: Part of the largest value by which a function changes between two samples where it may jump, jumps that are looked
#: for, halvings that find one, and part of the change that is left then if it is one.
STEEP, JUMPS, BISECTIONS, LEFT = 1e-3, 1000, 60, 0.5

#: Changes of the slope that are followed, parts that an interval is divided into, and how often, to find a kink.
BENDS, PARTS, REFINEMENTS = 20, 8, 6

#: Part of the first change of a slope that is left at a kink, refinements at least, and round-off of a value.
SLOPE_LEFT, SURE, ROUND_OFF = 0.4, 3, 4e-16

#: Part of the largest value by which a function differs from a straight line in a step that has to be taken in parts.
FAST = 5e-2


@dataclass(slots=True)
class Leg:
    """A part of a step.

    Attributes:
        end: its last instant, s.
        length: s.
        lands: whether it ends on a knot, where it goes on with the accelerations that hold after it.
        averaged: whether it sees the signals averaged.
        drifts: whether it is too short to be solved for.
        whole: whether the step ends with it.
        plain: whether it is a step as long as the others.
    """

    end: float
    length: float
    lands: bool = False
    averaged: bool = False
    drifts: bool = False
    whole: bool = True
    plain: bool = True

    @property
    def free(self) -> bool:
        """Whether it is stepped with nothing prescribed in it or at its end."""
        return not (self.lands or self.averaged or self.drifts)

    @property
    def finish(self) -> View:
        """How it sees at its end what is prescribed."""
        return View(-1 if self.lands else 0, (self.length, 0.0) if self.averaged else None)

    def doubles(self, after: Leg) -> bool:
        """Return whether this leg and the one after it may be taken as one: nothing prescribed is between them."""
        return not (self.lands or self.averaged or self.drifts or after.averaged or after.drifts)

    def joins(self, after: Leg) -> bool:
        """Return whether this leg and the one after it see one average at the instant between them."""
        return self.averaged and after.averaged and not (self.lands or self.drifts or after.drifts)


@dataclass
class BreakpointData:
    """A signal at its breakpoints: values just before and just after each, evaluated once.

    Attributes:
        signal: what is prescribed.
        points: its knots, marks and looks in a march, s.
        before, after: values there, (n, components).
        size: largest of these, and of those at the ends of the first steps that were asked for.
    """

    signal: TimeSignal
    points: Array
    before: Array
    after: Array
    size: float = 0.0

    @classmethod
    def of(cls, signal: TimeSignal, inside: Callable[[Array], Array]) -> BreakpointData:
        """Return the data of a signal at those of its points that are inside a march; the same for the same points."""
        points = inside(np.concatenate([signal.knots, signal.marks, signal.probes]))
        known: BreakpointData | None = signal.data
        if known is not None and np.array_equal(known.points, points):
            return replace(known, size=0.0)
        before: Array = np.empty((len(points), 0))
        after = before
        if len(points):
            fresh = np.ones(len(points), dtype=bool)
            if signal.samples is not None:
                t, f = signal.samples
                place = np.minimum(np.searchsorted(t, points), len(t) - 1)
                fresh = (t[place] != points) | np.isin(points, signal.knots)
                before, after = f[place].copy(), f[place].copy()
            if fresh.any():
                sides = [signal.values(points[fresh] * (1 + side * SAME)) for side in (-1, 1)]
                if fresh.all():
                    before, after = sides
                before[fresh], after[fresh] = sides
        signal.data = found = cls(signal, points, before, after)
        return found

    def inside(self, begin: float, end: float) -> slice | None:
        """Return which points are between two times (s); None if none is."""
        i, j = int(np.searchsorted(self.points, begin, "right")), int(np.searchsorted(self.points, end, "left"))
        return slice(i, j) if i < j else None

    def deviation(self, part: slice, times: Array, close: float) -> Array:
        """Return how far the signal is off the straight line over the step at each point, parts of its largest value.

        Args:
            part: of the points.
            times: ends of the steps, s.
            close: distance (s) from the end of a step at which a point is in it.
        """
        points, before, after = self.points[part], self.before[part], self.after[part]
        steps = np.clip(np.searchsorted(times + close, points, side="left"), 1, len(times) - 1)
        own, which = np.unique(steps, return_inverse=True)
        first, last = times[own - 1], times[own]
        start, stop = self.signal.values(first * (1 + SAME)), self.signal.values(last * (1 - SAME))
        share = np.clip((points - first[which]) / (last - first)[which], 0.0, 1.0)[:, None]
        chord = start[which] + share * (stop - start)[which]
        sides = [np.linalg.norm(f - chord, axis=1) for f in (before, after)]
        if self.size == 0.0:
            self.size = max(float(np.linalg.norm(f, axis=1).max()) for f in (before, after, start, stop))
        off: Array = (np.maximum(*sides) + np.linalg.norm(after - before, axis=1)) / (self.size or 1.0)
        return off


class TimeGrid:
    """The legs of all steps.

    Args:
        signals: what is prescribed.
        times: ends of the steps, the first the start of the march, s.
        step: nominal length of a step, s.
        order: of the scheme that goes there.
        fixed: whether these are the steps that are gone, and not cells of some that adapt themselves to what is quick.
    """

    def __init__(self, signals: Sequence[TimeSignal], times: Array, step: float, order: int = 2, fixed: bool = True):
        self.times, self.step, self.close, self.order, self.fixed = times, step, CLOSE * step, order, fixed
        self.curved = CURVED ** (order / 2)
        for signal in signals:
            find_breakpoints(signal, times)
        self._data = [data for c in signals if len((data := BreakpointData.of(c, self._points)).points)]
        self._special: dict[int, list[Stop]] = {}
        if self._data:
            self._plan()

    def __iter__(self) -> Iterator[Leg]:
        """Yield the legs of all steps."""
        times = as_list(self.times)
        length, begin = self.step, times[0]
        for i, end in enumerate(times[1:], start=1):
            stops: list[Stop] = self._special.get(i) or [(end, False, False)]
            for stop, lands, averaged in stops:
                gone = stop - begin  # of one length to the last digit, so that the matrix stays
                if abs(gone - self.step) <= self.close:
                    length = self.step
                elif abs(gone - length) > self.close:
                    length = gone
                drifts = length < LEAST * self.step * (1 + 1e-6)
                yield Leg(stop, length, lands, averaged, drifts, stop == stops[-1][0], length == self.step)
                begin = stop

    def landings(self) -> tuple[Array, Array]:
        """Return the times that are landed on, and rows (begin, end) of the legs that are averaged (s)."""
        landed, averaged = [], []
        for i, stops in sorted(self._special.items()):
            begin = self._special[i - 1][-1][0] if i - 1 in self._special else float(self.times[i - 1])
            for stop, lands, dense in stops:
                landed += [stop] if lands else []
                averaged += [(begin, stop)] if dense else []
                begin = stop
        return np.array(landed), np.array(averaged).reshape(-1, 2)

    def bent(self, begin: float, end: float) -> float:
        """Return how far a signal is off a straight line over a stretch (s), as a part of its largest value."""
        ends = np.array([begin, end])
        parts = [(data, part) for data in self._data if (part := data.inside(begin, end)) is not None]
        return max((float(data.deviation(part, ends, self.close).max()) for data, part in parts), default=0.0)

    # --- the plan ----------------------------------------------------------------------------------------------------

    def _points(self, points: Array) -> Array:
        """Return points in the march, increasing."""
        inside: Array = np.unique(points[(points > self.close) & (points < self.times[-1] + self.close)])
        return inside

    def _quick(self) -> Array:
        """Return rows (begin, end) of the stretches (s) between marks that are smooth, but not within a step."""
        rows = [np.empty((0, 2))]
        for signal in (d.signal for d in self._data) if self.fixed and self.order <= AVERAGING else ():
            if len(probes := signal.probes):
                begin, end = signal.marks[:-1], signal.marks[1:]
                first, last = np.maximum(begin, probes - 0.5 * self.step), np.minimum(end, probes + 0.5 * self.step)
                start, middle, stop = (signal.values(t) for t in (first * (1 + SAME), probes, last * (1 - SAME)))
                off = np.linalg.norm(middle - 0.5 * (start + stop), axis=1)
                size = float(np.linalg.norm([start, middle, stop], axis=2).max())
                rows.append(np.column_stack([begin, end])[off > SMOOTH * size])
        return np.concatenate(rows)

    def _step_of(self, points: Array) -> npt.NDArray[np.int64]:
        """Return the number, from 1, of the step that each point is in or ends."""
        index = np.searchsorted(self.times + self.close, points, side="left")
        return np.clip(index, 1, len(self.times) - 1)

    def _plan(self) -> None:
        """Choose landings, and which legs are averaged."""
        n = len(self.times) - 1
        sharp = self._points(np.concatenate([d.signal.knots for d in self._data]))
        soft = self._points(np.concatenate([d.signal.marks for d in self._data]))
        points = np.unique(np.concatenate([d.points for d in self._data]))
        off, weight = np.zeros(n + 1), np.zeros(len(points))
        for data in self._data:
            each = data.deviation(slice(None), self.times, self.close)
            np.maximum.at(off, self._step_of(data.points), each)
            np.maximum.at(weight, np.minimum(np.searchsorted(points, data.points), len(points) - 1), each)
        chosen = sharp if len(sharp) <= n else sharp[off[self._step_of(sharp)] > KINKED]
        chosen = np.union1d(chosen, soft[off[self._step_of(soft)] > self.curved])
        landings, edges = self._spaced(self._foremost(chosen, weight[np.searchsorted(points, chosen)]))
        counts = np.isin(points, sharp if self.order > AVERAGING else np.union1d(sharp, soft))
        self._lay(landings, edges, (points[counts], np.isin(points[counts], sharp)), off)

    def _foremost(self, points: Array, weight: Array) -> Array:
        """Return points without those that do not stand out where a step has more than MOST."""
        step = self._step_of(points)
        count = np.searchsorted(step, step, side="right") - np.searchsorted(step, step)
        keep = count <= MOST
        for i in np.unique(step[~keep]):
            own = np.arange(*np.searchsorted(step, [i, i + 1]))
            first = own[np.argsort(-weight[own], kind="stable")[:MOST]]
            others = weight[np.setdiff1d(own, first)]
            keep[first] = weight[first] > OUTSTANDING * max(float(np.mean(others)), float(np.median(weight[own])))
        return points[keep]

    def _spaced(self, points: Array) -> tuple[Array, Array]:
        """Return landings, none closer than LEAST, and the ends of legs that stand for points that are."""
        least = LEAST * self.step
        single: list[float] = []
        edges: list[float] = []
        for group in np.split(points, np.flatnonzero(np.diff(points) > least) + 1):
            if len(group) < 2:
                single += as_list(group)
                continue
            first, last = float(group[0]), max(float(group[-1]), float(group[0]) + least)
            near = float(self.times[np.argmin(np.abs(self.times - first))])
            if first - least < near < last + least:  # a step ends here: legs of that length before and after it
                first, last = min(first, near - least), max(last, near + least)
            edges += [max(first, edges[-1] if edges else 0.0), min(last, float(self.times[-1]))]
        return np.array(single), np.array(edges)

    def _lay(self, landings: Array, edges: Array, knots: tuple[Array, Array], off: Array) -> None:
        """Write the legs of all steps that have points or edges of legs in them; `knots` are points, and which jump."""
        (points, sharp), quick = knots, self._quick()
        inner = np.union1d(landings, edges)
        of_point, of_inner = self._step_of(points), self._step_of(inner)
        of_quick = [np.arange(a, b + 1) for a, b in zip(*self._step_of(quick.T), strict=True)]
        for i in np.unique(np.concatenate([of_point, of_inner, *of_quick])):
            begin, end = float(self.times[i - 1]), float(self.times[i])
            inside = points[slice(*np.searchsorted(of_point, [i, i + 1]))]
            kinks = sharp[slice(*np.searchsorted(of_point, [i, i + 1]))]
            landed = as_list(inner[slice(*np.searchsorted(of_inner, [i, i + 1]))])
            last = min((t for t in landed if abs(t - end) <= self.close), default=end)
            stops = [*(t for t in landed if begin + self.close < t < end - self.close), last]
            legs: list[Stop] = []
            self._special[i] = legs
            for stop in stops:
                passes = (inside > begin + self.close) & (inside < stop - self.close)
                allowed = KINKED if np.any(passes & kinks) else CURVED
                averaged = np.any(passes) and (off[i] if len(stops) == 1 else self.bent(begin, stop)) > allowed
                averaged |= np.any((quick[:, 0] < stop - self.close) & (quick[:, 1] > begin + self.close))
                window = np.searchsorted(edges, 0.5 * (begin + stop)) % 2 == 1
                legs.append((stop, stop in landed, bool(averaged or window)))
                begin = stop


# --- breakpoints of functions ---------------------------------------------------------------------------------------


def find_breakpoints(signal: TimeSignal, times: Array) -> None:
    """Find the knots and marks of a signal that are not known, between the ends of steps (s).

    Raises:
        InputError: it, or its rate, jumps and must not (see `Course.continuous`).
    """
    if signal.known:
        return
    signal.known = True
    if signal.continuous > 1:
        check_bends(signal, times)
        return
    number = int(np.clip(SAMPLES // (len(times) - 1), FEWEST, DENSEST))
    shares = np.arange(number) / number
    t = np.append((times[:-1, None] + np.diff(times)[:, None] * shares).ravel(), times[-1])
    f = signal.values(t)
    size = float(np.abs(f).max())
    if not size > 0.0:
        return
    knots = _jumps(signal, t, f, size)
    if len(knots) and signal.continuous:
        raise InputError(
            signal.name,
            None,
            f"jumps at t = {knots[0]:.9g} s; a speed that changes at once takes a force without bound: give a ramp",
        )
    signal.knots = np.union1d(signal.knots, knots)
    signal.marks = np.union1d(signal.marks, _fast(t, f, number, size))
    sides = np.concatenate([knots * (1 - SAME), knots * (1 + SAME)])
    if len(sides):
        t, f = np.concatenate([t, sides]), np.concatenate([f, signal.values(sides)])
    order = np.argsort(t, kind="stable")
    signal.samples = t[order], f[order]


def check_bends(signal: TimeSignal, times: Array) -> None:
    """Refuse a signal with a kink or a jump, looked for between the ends of steps (s).

    Where the slope changes much between two samples, it is followed to ever shorter intervals: that of a smooth signal
    changes by a part of it there, at a kink by all of it, at a jump by more.

    Raises:
        InputError: there is one; says when.
    """
    number = int(np.clip(SAMPLES // (len(times) - 1), FEWEST, DENSEST))
    t = np.linspace(times[0], times[-1], number * (len(times) - 1) + 1)
    values = signal.values(t)[:, 0]
    slopes, noise = np.diff(values) / np.diff(t), ROUND_OFF * float(np.abs(values).max())
    changes, size = np.abs(np.diff(slopes)), float(np.abs(slopes).max())
    steep = np.flatnonzero(changes > STEEP * size)
    for i in steep[np.argsort(-changes[steep])][:BENDS]:
        where, depth = _followed(signal, (float(t[i]), float(t[i + 2])), float(changes[i]), noise)
        if depth >= SURE:
            raise InputError(
                signal.name,
                None,
                f"its rate jumps at t = {where:.9g} s, which takes a moment without bound: round it off",
            )


def _followed(signal: TimeSignal, interval: tuple[float, float], change: float, noise: float) -> tuple[float, int]:
    """Return where a change of slope in an interval (s) is, and how often that can be refined; 0 where it is none."""
    first, last = interval
    for depth in range(REFINEMENTS):
        inner = np.asarray(np.linspace(first, last, PARTS + 1))
        if noise > 0.1 * change * (inner[1] - inner[0]):
            return 0.5 * (first + last), depth
        bends = np.abs(np.diff(np.diff(signal.values(inner)[:, 0]) / np.diff(inner)))
        k = int(np.argmax(bends))
        if bends[k] < SLOPE_LEFT * change:
            return 0.5 * (first + last), 0
        first, last = float(inner[k]), float(inner[k + 2])
    return 0.5 * (first + last), REFINEMENTS


def _jumps(signal: TimeSignal, t: Array, f: Array, size: float) -> Array:
    """Return the instants at which a signal jumps, of the samples at t (n,) that gave f (n, components)."""
    change = np.linalg.norm(np.diff(f, axis=0), axis=1)
    steep = np.flatnonzero(change > STEEP * size)
    found = []
    for i in steep[np.argsort(-change[steep])][:JUMPS]:
        a, b = float(t[i]), float(t[i + 1])
        f_a, f_b = f[i], f[i + 1]
        for _ in range(BISECTIONS):
            middle = 0.5 * (a + b)
            if not a < middle < b:
                break
            f_m = signal.values(np.array([middle]))[0]
            if np.linalg.norm(f_m - f_a) >= np.linalg.norm(f_b - f_m):
                b, f_b = middle, f_m
            else:
                a, f_a = middle, f_m
            if np.linalg.norm(f_b - f_a) < LEFT * change[i]:
                break
        if np.linalg.norm(f_b - f_a) >= LEFT * change[i]:
            found.append(b)
    instants: Array = np.unique(np.array(found, dtype=float))
    return instants


def _fast(t: Array, f: Array, number: int, size: float) -> Array:
    """Return the samples within the steps in which f is far off a straight line."""
    inside = f[:-1].reshape(-1, number, f.shape[1])
    first, last = inside[:, 0], f[number::number]
    chord = first[:, None, :] + (np.arange(number) / number)[None, :, None] * (last - first)[:, None, :]
    off = np.linalg.norm(inside - chord, axis=2).max(axis=1) > FAST * size
    samples: Array = t[:-1].reshape(-1, number)[off].ravel()
    return samples


def as_list(values: Array) -> list[float]:
    """Return an array as a list of floats."""
    return [float(value) for value in values]
