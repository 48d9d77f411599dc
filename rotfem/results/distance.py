"""How far two outputs are apart: the one measure of errors, effects, cost and comparisons.

    distance = max |u_b − u_a| / max |u_a|,        max_i |λ_b,i − λ_a,i| / |λ_a,i|,

over all rows of a history, or over all eigenvalues.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Distance:
    """How far an output is from another one.

    Attributes:
        size: largest difference, relative to the largest value (of eigenvalues, to each); infinite if that is 0.
        at: time of the largest difference, s; None of what has no time.
        bent: the same as size of the second differences of rows, in which fast vibrations are not small; 0 without.
        each: of every eigenvalue, relative to its own size.
        partners: number of the eigenvalue of the other output that each is compared with.
    """

    size: float
    at: float | None = None
    bent: float = 0.0
    each: Array = field(default_factory=lambda: np.empty(0))
    partners: Array = field(default_factory=lambda: np.empty(0, dtype=int))


@dataclass(frozen=True)
class Series:
    """An output over time, frequency or speed, or of a steady state, which is one row.

    Attributes:
        times: (n,), s, rad/s.
        values: (n, components), real or complex.
    """

    times: Array
    values: Array

    @property
    def scale(self) -> float:
        """Largest value over all rows."""
        return float(np.linalg.norm(self.values, axis=-1).max(initial=0.0))

    def at(self, times: Array) -> Array:
        """Return the values at other times, by a cubic spline; after a jump those of the last row of its time."""
        if len(self.times) == 1:
            return np.broadcast_to(self.values, (len(times), self.values.shape[1]))
        last = np.append(np.diff(self.times) > 0.0, True)
        own, values = self.times[last], self.values[last]
        near = np.minimum(np.searchsorted(own, times - 1e-9 * own[-1]), len(own) - 1)
        if np.allclose(own[near], times, rtol=0.0, atol=1e-9 * own[-1]):
            return np.asarray(values[near])
        from scipy.interpolate import CubicSpline  # slow to load, and steps of twice the length end at own rows

        return np.asarray(CubicSpline(own, values)(times))

    def beside(self, other: Series) -> tuple[Series, Series]:
        """Return both at common rows: those of the one that has fewer, where both are; of a steady state the last."""
        if np.array_equal(self.times, other.times):
            return self, other
        if min(len(self.times), len(other.times)) == 1:
            return Series(self.times[-1:], self.values[-1:]), Series(self.times[-1:], other.values[-1:])
        few, many = (self, other) if len(self.times) <= len(other.times) else (other, self)
        inside = (few.times >= many.times[0]) & (few.times <= many.times[-1])
        times = few.times[inside]
        pair = Series(times, few.values[inside]), Series(times, many.at(times))
        return pair if few is self else pair[::-1]

    def difference(self, other: Series) -> Series:
        """Return other − self at the common rows."""
        here, there = self.beside(other)
        return Series(here.times, there.values - here.values)

    def apart(self, other: Series) -> Distance:
        """Return how far another one is from this one."""
        here, there = self.beside(other)
        change = here.difference(there)
        off = np.linalg.norm(change.values, axis=-1)
        largest = float(off.max(initial=0.0)) if np.all(np.isfinite(off)) else np.inf
        bent, of = (Series(s.times, np.diff(s.values, 2, axis=0)).scale for s in (change, here))
        at = float(change.times[np.argmax(off)]) if len(off) else None
        return Distance(relative(largest, self.scale), at, relative(bent, of))


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues, with the shapes of their modes.

    Attributes:
        values: λ, (modes,), rad/s; 0 of what is zero to round-off.
        shapes: sampled at the same places on every mesh, complex, (modes, samples), nan where one has none; None to
            pair modes by their order.
        count: number of the first modes that count; the others are there to be paired with. All of them if None.
    """

    values: Array
    shapes: Array | None = None
    count: int | None = None

    @property
    def scale(self) -> float:
        """Largest |λ|, rad/s."""
        return float(np.abs(self.values).max(initial=0.0))

    def apart(self, other: Spectrum) -> Distance:
        """Return how far the most similar mode of another one is, of every mode, relative to its |λ|.

        Of an eigenvalue that is zero it is relative to the smallest other one.
        """
        own, there = self.values[: self.count], other.values
        if len(own) == 0 or len(there) == 0:
            return Distance(0.0 if len(own) == 0 else np.inf)
        off = np.abs(there[None, :] - own[:, None])
        if self.shapes is None or other.shapes is None:
            off = np.where(np.eye(len(own), len(there), dtype=bool), off, np.inf)
        else:
            alike = alikeness(self.shapes[: self.count], other.shapes)
            off = np.where(alike >= 0.9 * alike.max(axis=1, keepdims=True), off, np.inf)
        each = off.min(axis=1) / sizes(own)
        return Distance(float(each.max()), each=each, partners=off.argmin(axis=1))


def alikeness(one: Array, other: Array) -> Array:
    """Return |a^H b|/(|a| |b|), (modes, modes), of shapes over the samples that both sets have; 0 of no shape."""
    there = ~(np.isnan(one[0]) | np.isnan(other[0]))
    here, others = one[:, there], other[:, there]
    norms = np.outer(np.linalg.norm(here, axis=1), np.linalg.norm(others, axis=1))
    return np.asarray(np.abs(here.conj() @ others.T) / np.where(norms > 0.0, norms, np.inf))


def sizes(values: Array) -> Array:
    """Return |λ|, of a zero that of the smallest other one."""
    out = np.abs(values)
    out[out == 0.0] = out[out > 0.0].min(initial=np.inf)
    return out


def relative(difference: float, scale: float) -> float:
    """Return a difference over a scale; infinite where that is zero and the difference is not."""
    return 0.0 if difference == 0.0 else float(difference / scale) if scale > 0.0 else np.inf
