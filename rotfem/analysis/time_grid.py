"""The time grid of a march: its steps, and the knots of prescribed data.

Knots are the instants at which a signal or its rate may jump: rows of tables, ends of pulses, jumps of functions, and
`time.breakpoints`. In a step with a knot inside, schemes of second order replace every signal by the straight line with
its mean and its first moment (`rotfem.mechanics.time_signals`), with an error of second order; where all of them are
near straight lines already, as tables of what steps resolve, by their values. Lines of neighbouring steps with several
knots each join. In steps of higher order cubics replace the signals, with the values at the ends of the step as well.
Such steps end at jumps that are rare or large, if they are few in a step; with more of them straight lines serve too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.mechanics.time_signals import SAME, Fit, TimeSignal, View

Array = npt.NDArray[np.float64]

#: Most jumps in a step at which intervals end; shortest one, and distance of equal instants, as parts of a step.
FEW, SHORTEST, CLOSE = 4, 1e-3, 1e-9

#: Distance of a signal from its chord over a step, as a part of its largest value, that a scheme of second order leaves
#: to itself: that of a wave of 22 steps a period, (ωh)²/8.
RESOLVED = 1e-2

#: Part of a signal's largest value from which on a step of fourth order ends at a jump, however many there are.
LARGE = 0.1

#: Steps for each knot from which on straight lines in those with knots, each as dear as four, cost no third of a march.
RARE = 12

#: Samples of a function over a march, with eight at least and 128 at most in a step.
SAMPLES = 20_000

#: Smallest change, as a part of the largest value, that is searched for a jump; halvings that confirm one.
JUMP, CONFIRMED = 1e-3, 10


@dataclass(slots=True)
class Interval:
    """A step, or a part of one.

    Attributes:
        end: its last instant, s.
        length: s.
        at_knot: whether it ends at a knot; the next one starts with the accelerations after it.
        line: step over which polynomials replace the signals; None for their values.
        whole: whether it ends its step.
    """

    end: float
    length: float
    at_knot: bool = False
    line: Fit | None = None
    whole: bool = True

    @property
    def finish(self) -> View:
        """How signals are evaluated at its end."""
        return View(-1 if self.at_knot else 0, self.line)


def intervals(knots: Array, jumps: Array | None, times: Array, step: float) -> Iterator[Interval]:
    """Yield the intervals of steps between times (s), nominally `step` long (s), with knots (s) in them.

    Of schemes of fourth order they end at the jumps (s) among the knots, if these are few; others have None.
    """
    close = CLOSE * step
    before, after = (np.searchsorted(knots, times + side * close) for side in (-1, 1))
    ends, there = [float(t) for t in times], after[1:] > after[:-1]
    fine = [False, *(before[1:] - after[:-1] > 1) & (jumps is None), False]  # of the steps, with one more at both ends
    begin, length = ends[0], step
    for i, end in enumerate(ends[1:]):
        inside: Any = knots[after[i] : before[i + 1]] if there[i] else np.empty(0)
        at_knot = bool(there[i] and before[i + 1] < after[i + 1])
        last = float(knots[before[i + 1]]) if at_knot else end
        cuts = [] if jumps is None else inside[np.isin(inside, jumps)].tolist()
        stops = [*cuts, last] if len(cuts) <= FEW else [last]
        if len(stops) > 1 and min(b - a for a, b in pairwise([begin, *stops])) < SHORTEST * step:
            stops = [last]
        for stop in stops:
            line: Fit | None = None
            if fine[i + 1]:
                line = (ends[i - 1] if fine[i] else begin, begin, last, ends[i + 2] if fine[i + 2] else last)
            elif np.any((inside > begin) & (inside < stop)):
                line = (begin, stop, 3 if jumps is not None and len(cuts) < len(stops) else 1)
            taken = stop - begin  # of one length to the last digit, so that the matrix stays
            if abs(taken - step) <= close:
                length = step
            elif abs(taken - length) > close:
                length = taken
            yield Interval(stop, length, at_knot or stop != last, line, stop == last)
            begin = stop


def knots_of(
    signals: Sequence[TimeSignal], times: Any, breakpoints: Sequence[float] = (), divided: bool = True
) -> tuple[Array, Array | None]:
    """Return the knots (s) of all signals, and those at which steps of fourth order (`divided`) end; else None.

    Knots are searched between times (s) where they are not known. Steps of second order do without those that they
    resolve. Others end at breakpoints, and at jumps that are rare or large.
    """
    knots, jumps = [np.array(breakpoints, dtype=np.float64)], [np.array(breakpoints, dtype=np.float64)]
    for signal in signals:
        find_knots(signal, times, breakpoints)
        there = signal.knots[(signal.knots >= times[0]) & (signal.knots <= times[-1])]
        if divided:
            knots.append(signal.bent)
        if not len(there):
            continue
        before, after = (signal.values(there * (1 + side * SAME)) for side in (-1, 1))
        size = max(np.abs(x).max() for x in (before, after))
        change = np.linalg.norm(after - before, axis=1)
        jump = change > CLOSE * size
        jumps.append(there[jump if RARE * jump.sum() < len(times) else change > LARGE * size])
        if divided or RARE * len(there) < len(times):
            knots.append(there)
        else:
            step = np.clip(np.searchsorted(times, there), 1, len(times) - 1)
            share = ((there - times[step - 1]) / (times[step] - times[step - 1]))[:, None]
            f = signal.values(times)
            chord = (1 - share) * f[step - 1] + share * f[step]
            off = np.linalg.norm(before - chord, axis=1) > RESOLVED * max(size, np.abs(f).max())
            knots.append(there[np.isin(step, step[jump | off])])
    return np.unique(np.concatenate(knots)), np.unique(np.concatenate(jumps)) if divided else None


def find_knots(signal: TimeSignal, times: Array, breakpoints: Sequence[float] = ()) -> None:
    """Add breakpoints (s), jumps and what changes within steps to the knots of a signal, where these are not known.

    It is sampled in steps between times (s). Where the best cubic of a step is not near the samples, and no jump is the
    reason, these become knots, and are sampled between once more.
    """
    if signal.known:
        return
    signal.known = True
    if signal.primitive is not None:
        find_jumps(signal, times, 0.0)
        signal.knots = np.union1d(signal.knots, signal.primitive.knots)
        return
    cells, n, found, size = np.stack([times[:-1], times[1:]], axis=1), SAMPLES // len(times), list[Array](), 0.0
    n = min(max(n, 8), 128)
    for level in range(3):
        x = (np.arange(n) + 0.618 * np.arange(1, n + 1) % 1.0) / n  # uneven, or what alternates may look constant
        cubic = np.vander(x - 0.5, 4)
        t = cells[:, :1] + np.diff(cells) * x
        f = signal.values(t.ravel()).reshape(len(cells), n, -1)
        size = max(size, float(np.abs(f).max()))
        off = np.abs(f - cubic @ (np.linalg.pinv(cubic) @ f)).max(axis=(1, 2)) > RESOLVED * size
        cuts = cells[off, :1] + np.diff(cells[off]) * (np.arange(n + 1) / n)
        if level == 0:
            find_jumps(signal, np.unique([*times, *t[off].ravel()]), size)
            signal.knots = np.unique([*signal.knots, *breakpoints])
            jumps = np.diff(np.searchsorted(signal.knots, cells[off])).ravel()
            cuts = cuts[(jumps == 0) | (jumps > FEW)]  # of many jumps some lie between samples
            if len(cuts):
                signal.changes = float(cuts[0, 0]), float(cuts[0, 1] - cuts[0, 0])
        found.append(cuts.ravel())
        cells, n = np.stack([cuts[:, :-1].ravel(), cuts[:, 1:].ravel()], axis=1), 8
        if not 0 < len(cells) * n <= 10 * SAMPLES:
            break
    signal.knots = np.unique([*signal.knots, *np.concatenate(found)])


def find_jumps(signal: TimeSignal, times: Array, size: float) -> None:
    """Add jumps between times (s) to the knots of a signal that is known to reach a size.

    By bisection: a large change between two is followed into the half with more of it, down to neighbouring numbers. It
    is a jump if it does not become smaller.
    """
    edges, f = np.stack([times[:-1], times[1:]]), signal.values(times)
    values, size = np.stack([f[:-1], f[1:]]), max(size, float(np.abs(f).max()))
    change = np.linalg.norm(values[1] - values[0], axis=1)
    left, halvings = np.flatnonzero(change > JUMP * size), np.zeros(len(change), dtype=int)
    while len(left):
        middle = 0.5 * (edges[0, left] + edges[1, left])
        f = signal.values(middle)
        upper = (np.linalg.norm(f - values[0, left], axis=1) >= np.linalg.norm(values[1, left] - f, axis=1)).astype(int)
        ends = edges[upper, left] == middle  # two neighbouring numbers
        edges[upper, left], values[upper, left] = middle, f
        jumps = np.linalg.norm(values[1, left] - values[0, left], axis=1) > 0.5 * change[left]
        halvings[left[jumps]] += 1
        halvings[left[jumps & ends]] += CONFIRMED
        left = left[jumps & ~ends]
    knots = edges[1, halvings >= CONFIRMED]
    if len(knots) and signal.continuous:
        what = f"jumps at t = {knots[0]:.9g} s, which takes a force without bound: give a ramp or round it off"
        raise InputError(signal.name, None, what)
    signal.knots = np.unique([*signal.knots, *knots])
