"""Where fixed steps land: on the knots of what is prescribed, between the ends of the steps themselves.

A step with a knot inside is gone in legs from knot to knot. Where there are more knots than legs are worth, those that
matter least are passed, and the legs that pass them see the courses averaged (see `rotfem.mechanics.courses`), as do
legs that are as short as LEAST: a ramp of a microsecond is a blow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.looks import look_at
from rotfem.mechanics.courses import SAME, Course

Array = npt.NDArray[Any]

#: End of a leg (s), whether it lands there, and whether it is averaged.
Stop = tuple[float, bool, bool]

#: Part of a step that is one instant, and shortest leg that is stepped: below it, round-off of q spoils a.
CLOSE, LEAST = 1e-9, 1e-3

#: Knots in a step from which only those are landed on that matter this many times as much as the others.
MOST, OUTSTANDING = 4, 10.0

#: Deviation of a course from a straight line over a step, as a part of its largest value, from which knots are landed
#: on where there are many, and from which marks are by a scheme of second order; by one of order p a power p/2 of that.
KINKED, CURVED = 1e-3, 5e-2

#: Deviation over a step from which what is smooth between marks is averaged there, a parabola in up to three steps; and
#: order of the schemes that averages by hats serve: those of higher order sum up what is smooth in a step as it is.
SMOOTH, AVERAGING = 0.1, 2


@dataclass(frozen=True)
class Leg:
    """A part of a step.

    Attributes:
        end: its last instant, s.
        length: s.
        lands: whether it ends on a knot, where it goes on with the accelerations that hold after it.
        averaged: whether it sees the courses averaged.
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

    def doubles(self, after: Leg) -> bool:
        """Return whether this leg and the one after it may be taken as one: nothing prescribed is between them."""
        return not (self.lands or self.averaged or self.drifts or after.averaged or after.drifts)

    def joins(self, after: Leg) -> bool:
        """Return whether this leg and the one after it see one average at the instant between them."""
        return self.averaged and after.averaged and not (self.lands or self.drifts or after.drifts)


class Itinerary:
    """The legs of all steps.

    Args:
        courses: what is prescribed.
        times: ends of the steps, the first the start of the march, s.
        step: nominal length of a step, s.
        order: of the scheme that goes there.
        fixed: whether these are the steps that are gone, and not cells of some that adapt themselves to what is quick.
    """

    def __init__(self, courses: Sequence[Course], times: Array, step: float, order: int = 2, fixed: bool = True):
        self.times, self.step, self.close, self.order, self.fixed = times, step, CLOSE * step, order, fixed
        self.curved = CURVED ** (order / 2)
        for course in courses:
            look_at(course, times)
        self._courses = [(c, p) for c in courses if len(p := self._points(np.concatenate([c.knots, c.marks, c.looks])))]
        self._sizes: dict[str, float] = {}
        self._special: dict[int, list[Stop]] = {}
        if self._courses:
            self._plan()

    def __iter__(self) -> Iterator[tuple[int, Leg]]:
        """Yield number of the step, from 1, and leg."""
        times = as_list(self.times)
        length = self.step
        for i in range(1, len(times)):
            begin, end = times[i - 1], times[i]
            if i - 1 in self._special:
                begin = self._special[i - 1][-1][0]
            stops: list[Stop] = self._special.get(i) or [(end, False, False)]
            for stop, lands, averaged in stops:
                # of one length to the last digit, so that the matrix stays
                known = (c for c in (self.step, length) if abs(stop - begin - c) <= self.close)
                length = next(known, stop - begin)
                drifts = length < LEAST * self.step * (1 + 1e-6)
                yield i, Leg(stop, length, lands, averaged, drifts, stop == stops[-1][0], length == self.step)
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
        """Return how far a course is off a straight line over a stretch (s), as a part of its largest value."""
        ends = np.array([begin, end])
        own = ((course, points[(points > begin) & (points < end)]) for course, points in self._courses)
        return max((float(self._deviation(course, mine, ends).max()) for course, mine in own if len(mine)), default=0.0)

    # --- the plan ----------------------------------------------------------------------------------------------------

    def _points(self, points: Array) -> Array:
        """Return points in the march, increasing."""
        inside: Array = np.unique(points[(points > self.close) & (points < self.times[-1] + self.close)])
        return inside

    def _quick(self) -> Array:
        """Return rows (begin, end) of the stretches (s) between marks that are smooth, but not within a step."""
        rows = [np.empty((0, 2))]
        for course, _ in self._courses if self.fixed and self.order <= AVERAGING else ():
            if len(looks := course.looks):
                begin, end = course.marks[:-1], course.marks[1:]
                first, last = np.maximum(begin, looks - 0.5 * self.step), np.minimum(end, looks + 0.5 * self.step)
                start, middle, stop = (course.values(t) for t in (first * (1 + SAME), looks, last * (1 - SAME)))
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
        sharp = self._points(np.concatenate([c.knots for c, _ in self._courses]))
        soft = self._points(np.concatenate([c.marks for c, _ in self._courses]))
        points = np.unique(np.concatenate([own for _, own in self._courses]))
        off, weight = np.zeros(n + 1), np.zeros(len(points))
        for course, own in self._courses:
            each = self._deviation(course, own, self.times)
            np.maximum.at(off, self._step_of(own), each)
            np.maximum.at(weight, np.minimum(np.searchsorted(points, own), len(points) - 1), each)
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
            keep[first] = weight[first] > OUTSTANDING * np.median(weight[own])
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
                stretch = np.searchsorted(edges, 0.5 * (begin + stop)) % 2 == 1
                legs.append((stop, stop in landed, bool(averaged or stretch)))
                begin = stop

    def _deviation(self, course: Course, points: Array, times: Array) -> Array:
        """Return how far a course is off the straight line over the step at each point, parts of its largest value."""
        steps = np.clip(np.searchsorted(times + self.close, points, side="left"), 1, len(times) - 1)
        first, last = times[steps - 1], times[steps]
        start, stop = course.values(first * (1 + SAME)), course.values(last * (1 - SAME))
        before, after = course.values(points * (1 - SAME)), course.values(points * (1 + SAME))
        share = np.clip((points - first) / (last - first), 0.0, 1.0)[:, None]
        chord = start + share * (stop - start)
        sides = [np.linalg.norm(f - chord, axis=1) for f in (before, after)]
        size = self._sizes.setdefault(course.name, float(np.linalg.norm([before, after, start, stop], axis=2).max()))
        off: Array = (np.maximum(*sides) + np.linalg.norm(after - before, axis=1)) / (size or 1.0)
        return off


def as_list(values: Array) -> list[float]:
    """Return an array as a list of floats."""
    return [float(value) for value in values]
