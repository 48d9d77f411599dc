"""States between steps: rows of a history at equal distances, wherever the steps of a march end.

Between two states the unknowns are the polynomial through what is known at both: through q and q̇ a cubic, of order 4,
and through q, q̇ and q̈ a quintic, of order 6 (Hermite). So what is between is as good as the ends are: the cubic for
schemes up to order 2, whose accelerations of vibrations that they do not resolve are noise, the quintic above. There
too an acceleration that the cubic knows nothing of is that of such a vibration, as of a rod that is spun at once, which
would throw the quintic far off: it gives way to the cubic's, and where it is beyond all that, both to a straight line.

The acceleration at the end of a march solves M δa = −F(q, v, a), with the factor of M at rest where that converges
quickly: M of a structure changes little with its deflection.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from rotfem.analysis.schemes import Array, Observer, State

#: Part of the cubic's accelerations by which those of a state may differ from them, and from which on neither counts.
KNOWN, BEYOND = 0.5, 20.0

#: Distance of two instants, as a part of the interval between rows, at which they are one.
CLOSE = 1e-9


class RowTimes:
    """Takes the steps of a march, and gives the states at multiples of an interval and at the end.

    Args:
        interval: from one row to the next, s.
        end: last time, s.
        order: of the scheme that steps.
        further: a further observer of the steps; None without one.
        passed: rows there are already, without that at t = 0.
    """

    def __init__(self, interval: float, end: float, order: int, further: Observer | None = None, passed: int = 0):
        self.interval, self.end, self.order, self.further = interval, end, order, further
        self._next, self._last = 1 + passed, int(np.ceil(end / interval - CLOSE))
        self._reached: list[State] = []

    def __call__(self, old: State, new: State, leg: Any) -> None:
        """Find the rows in a step from an old to a new state."""
        if self.further is not None:
            self.further(old, new, leg)
        close, times = CLOSE * self.interval, []
        while self._next <= self._last and (t := min(self._next * self.interval, self.end)) <= new.t + close:
            times.append(t)
            self._next += 1
        ends = [new] if times and times[-1] > new.t - close else []
        self._reached += between(old, new, times[: len(times) - len(ends)], self.order) + ends

    def taken(self) -> list[State]:
        """Return the states of the rows since the last call."""
        found, self._reached = self._reached, []
        return found


def between(old: State, new: State, times: list[float], order: int) -> list[State]:
    """Return the states at times (s) within a step; work and impulse of a free hub are linear in it.

    Args:
        old: state that the step starts from.
        new: state that it ends in.
        times: between them, s.
        order: of the scheme that made it.
    """
    if not times:
        return []
    h, known = new.t - old.t, [[s.q, s.v] for s in (old, new)] if order <= 2 else resolved(old, new)
    shares = (np.array(times, dtype=np.float64) - old.t) / np.float64(h)
    data = np.array([h**k * x for end in known for k, x in enumerate(end)])
    moved = [values @ data / h**k for k, values in enumerate(hermite(shares, len(known[0])))]
    out = []
    for t, share, q, v, a in zip(times, shares, *moved, strict=True):
        given = None
        if old.given is not None and new.given is not None:
            given = np.asarray(old.given + share * (new.given - old.given))
        out.append(new.changed(t=t, q=q, v=v, a=a, memory=None, given=given))
    return out


def hermite(shares: Array, known: int) -> list[Array]:
    """Return values and two derivatives of the polynomials that are 1 in one datum of two ends and 0 in the others.

    Args:
        shares: where, from 0 to 1, (n,).
        known: data of an end: value, first derivative, ….

    Returns:
        Three arrays (n, 2 known), the columns those of the first end, then those of the second.
    """
    return [monomials(shares, 2 * known, k) @ _coefficients(known) for k in range(3)]


@cache
def _coefficients(known: int) -> Array:
    """Return the coefficients of these polynomials, by power and datum."""
    ends = np.array([0.0, 1.0])
    at = np.stack([monomials(ends, 2 * known, k) for k in range(known)], axis=1)
    return np.asarray(np.linalg.inv(at.reshape(2 * known, 2 * known)), dtype=np.float64)


def monomials(x: Array, number: int, k: int) -> Array:
    """Return the k-th derivatives of 1, x, x² …, so many of them, (n, number)."""
    powers = np.arange(number)
    falling = np.prod([powers - i for i in range(k)], axis=0)
    return np.asarray(x[:, None] ** np.maximum(powers - k, 0) * falling)


def resolved(old: State, new: State) -> list[list[Array]]:
    """Return q, v and a of two states, as far as steps resolve the unknowns; those of a cubic or a line elsewhere."""
    h, mean = new.t - old.t, (new.q - old.q) / (new.t - old.t)
    cubic = [(6 * mean - 4 * old.v - 2 * new.v) / h, (2 * old.v + 4 * new.v - 6 * mean) / h]
    most = np.maximum(*np.abs(cubic))
    off = [np.abs(s.a - c) for s, c in zip((old, new), cubic, strict=True)]
    line = np.maximum(*off) > BEYOND * most
    out = []
    for s, c, o in zip((old, new), cubic, off, strict=True):
        a = np.where(o <= KNOWN * most, s.a, c)
        out.append([s.q, np.where(line, mean, s.v), np.where(line, 0.0, a)])
    return out


#: Corrections with the factor at rest, how fast they must shrink, and what may be left, relative to the acceleration.
MOST, RATE, LEFT = 8, 0.1, 1e-13


def end_acceleration(system: Any, state: State) -> Array:
    """Return q̈ of F(q, q̇, q̈) = 0 at a state, a local dof array; the time is set, the state is written on return."""
    a = state.a.copy()
    before, at_rest, left = np.inf, True, MOST
    while True:
        system.set_state(state.q, state.v, a)
        change = system.accelerated(system.forces(state.t), at_rest)
        a += change
        size, left = system.increment_size(change), left - 1
        if not at_rest or (before < np.inf and size * size <= LEFT * before * system.increment_size(a)):
            break
        at_rest = left > 0 and size <= RATE * before
        before = size
    system.set_state(state.q, state.v, a)
    return a
