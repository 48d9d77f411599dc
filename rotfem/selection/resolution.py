"""Where a trial needs shorter steps, so that nothing its problem prescribes is stepped over.

Loads, base acceleration, speed and torque are known before anything is solved. With f̂ the linear interpolation of such
a signal f at the steps, every interval between two samples of a trial is cut into as many steps as keep

    ∫ |f − f̂| dt ≤ MISSED · max_t ∫_t^{t + 1/ω₁} |f| dt

over it; the right side is the largest impulse that the slowest mode feels. So a blow of a few milliseconds is met.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.loads import AnyLoad, named
from rotfem.mechanics.problem import Problem

Array = npt.NDArray[Any]

#: Part of the impulse of a signal that may be missed in an interval.
MISSED = 1e-2

#: Most steps an interval is cut into.
MOST_PARTS = 1024

#: Times in an interval at which a smooth signal is looked at.
SMOOTH_LOOKS = 8

#: Fewest and most times at which a function is looked at: twice in every step of the case's own if it can be.
LOOKS = (20_000, 200_000)


@dataclass(frozen=True)
class Given:
    """A signal that is prescribed.

    Attributes:
        at: times (n,) in s ↦ values, shape (n, components).
        knots: times (s) between which it is smooth; it is looked at there and halfway between them.
        linear: whether it is linear between knots, so that nothing has to be looked at elsewhere.
        smooth: whether it is known to be smooth between knots, so that a few looks are enough.
    """

    at: Callable[[Array], Array]
    knots: Array
    linear: bool = False
    smooth: bool = False


def given(problem: Problem) -> list[Given]:
    """Return all that a problem prescribes and that changes with time."""
    motion, loads = problem.motion, problem.loads
    out = [_load(load) for load in named(loads).values() if not load.constant]
    if motion.is_accelerated and not motion.constant:
        linear = motion.base_knots is not None
        out.append(Given(_each(motion.base_acceleration), np.array(motion.base_knots or ()), linear))
    if motion.hub is not None:
        table = motion.hub.torque.table
        return out if table is None else [*out, _table(table)]  # pulses have their jumps met by every march
    if motion.changes_speed:
        knots = np.array(motion.knots)
        out += [Given(_each(f), knots, smooth=motion.smooth) for f in (motion.speed, motion.rate)]
    if (pitch := motion.pitch) is not None:
        smooth = pitch.known
        out += [Given(_each(f), np.array(pitch.knots), smooth=smooth) for f in (pitch.rate, pitch.acceleration)]
    if any(loads.gravity) and (motion.is_spinning or pitch is not None):
        g = np.array(loads.gravity)
        out.append(Given(_each(lambda t: motion.rotation(t).T @ g), np.empty(0), smooth=True))
    return out


def parts(signals: list[Given], times: Array, period: float, most: int, own: int | None = None) -> Array:
    """Return into how many steps every interval has to be cut, shape (intervals,).

    Args:
        signals: what is prescribed.
        times: ends of the intervals, s.
        period: 1/ω₁, s.
        most: steps there may be in all; they are longer everywhere where that is not enough.
        own: steps of the case itself, if they are fixed: what is too narrow for them need not be seen.
    """
    looks = int(np.clip(2 * (own or 0), *LOOKS))
    out: Array = np.ones(len(times) - 1, dtype=np.int64)
    for signal in signals:
        out = np.maximum(out, _parts(signal, times, period, looks))
    # Steps of half the case's own length see all that the run sees.
    longest = MOST_PARTS if own is None else min(MOST_PARTS, -(-2 * own // len(out)))
    out = np.minimum(out, longest)
    while out.sum() > max(most, len(out)):
        longest //= 2
        out = np.minimum(out, longest)
    return out


def _parts(signal: Given, times: Array, period: float, number: int) -> Array:
    looks = _looks(signal, times, number)
    values = signal.at(looks)
    size = np.linalg.norm(values, axis=1)
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * (size[1:] + size[:-1]) * np.diff(looks))])
    allowed = MISSED * float((np.interp(looks + period, looks, impulse) - impulse).max())
    out: Array = np.ones(len(times) - 1, dtype=np.int64)
    first = np.searchsorted(looks, times)
    missed = _missed(looks, values, times, values[first])
    for i in np.flatnonzero(np.diff(np.interp(times, looks, missed)) > allowed):
        inside = looks[first[i] : first[i + 1] + 1]
        n = 1
        while n < MOST_PARTS:
            n *= 2
            steps = np.linspace(times[i], times[i + 1], n + 1)
            here = np.union1d(inside, steps)
            if _missed(here, signal.at(here), steps, signal.at(steps))[-1] <= allowed:
                break
        out[i] = n
    return out


def _missed(looks: Array, values: Array, steps: Array, known: Array) -> Array:
    """Return ∫ |f − f̂| from the first look to each, f̂ linear between the values known at the steps."""
    linear = np.stack([np.interp(looks, steps, column) for column in known.T], axis=1)
    off = np.linalg.norm(values - linear, axis=1)
    return np.concatenate([[0.0], np.cumsum(0.5 * (off[1:] + off[:-1]) * np.diff(looks))])


def _looks(signal: Given, times: Array, number: int) -> Array:
    """Return at least so many times at which a signal is looked at, those given among them."""
    knots = signal.knots[(signal.knots > times[0]) & (signal.knots < times[-1])]
    found = np.union1d(times, knots)
    if signal.linear:
        return np.union1d(found, 0.5 * (found[1:] + found[:-1]))
    number = SMOOTH_LOOKS * (len(times) - 1) if signal.smooth else number
    n = -(-number // (len(found) - 1))
    between = np.linspace(found[:-1], found[1:], n, endpoint=False).ravel()
    return np.union1d(between, found)


def _load(load: AnyLoad) -> Given:
    return Given(load.many, np.array(load.knots), linear=load.linear)


def _table(rows: Sequence[Sequence[float]]) -> Given:
    t, *columns = np.array(rows).T
    return Given(lambda x: np.stack([np.interp(x, t, column) for column in columns], axis=1), t, linear=True)


def _each(function: Callable[[float], Any]) -> Callable[[Array], Array]:
    return lambda x: np.array([np.atleast_1d(function(float(t))) for t in x], dtype=float)
