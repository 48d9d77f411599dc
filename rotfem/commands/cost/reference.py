"""References by refinement: the output that ever finer settings tend to, and by how much their last ones differ.

With u(h, n) the output for a step h and a mesh n, the two differences of a level are

    d_t = |u(h/2, n) − u(h, n)|,   d_x = |u(h, 2n) − u(h, n)|.

The larger one is refined until d_t + d_x is small enough. The reference is the combination

    u(h/2, n) + u(h, 2n) − u(h, n),

in which the errors of step and mesh cancel to leading order (combination technique, Griebel, Schneider & Zenger 1992),
and d_t + d_x of the last level is what it is known to. No order is assumed, none is extrapolated. No dolfinx in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import log2
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from rotfem.commands.cost.settings import Setting

Array = npt.NDArray[np.float64]

#: Samples closer than this part of the interval are taken to be at the same time: round-off of n steps of h.
SAME_TIME = 1e-9

#: A number that nothing is: what an output that vanishes is divided by.
TINY = 1e-300


@dataclass
class Samples:
    """An output: rows over time, or one row an eigenvalue, or the single row of a steady state.

    Attributes:
        values: shape (rows, components); m, or real and imaginary part in rad/s.
        times: shape (rows,), s; empty outside a time history.
    """

    values: Array
    times: Array

    def to_json(self) -> dict[str, Any]:
        """Return lists that `from_json` reads without loss."""
        return {"times": self.times.tolist(), "values": self.values.tolist()}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Samples:
        """Return what `to_json` wrote."""
        values = np.array(data["values"], dtype=np.float64)
        return cls(values.reshape(len(data["values"]), -1), np.array(data["times"], dtype=np.float64))


@dataclass
class Reference:
    """The converged output of one theory.

    Attributes:
        samples: its values.
        parts: differences of the last level, `time` and `mesh`, relative; of a theory compared with the richest at one
            setting also `theory`, the product of their difference and that setting's error.
        order: log₂ of the ratio of the last two differences in time, in a steady state of the mesh; None of one level.
        setting: the finest one that all parts were refined from.
    """

    samples: Samples
    parts: dict[str, float]
    order: float | None
    setting: Setting

    @property
    def uncertainty(self) -> float:
        """How far it may be off, relative, in the norm that errors are measured in."""
        return sum(self.parts.values())


def size(samples: Samples) -> float:
    """Return the largest norm of a row."""
    return float(np.max(np.linalg.norm(samples.values, axis=1), initial=0.0)) or TINY


def aligned(a: Samples, b: Samples) -> tuple[Array, Array, Array]:
    """Return common times and the values of a and b there: those of a where b has them, else of the one with fewer.

    The one with more rows is interpolated by a cubic spline.
    """
    if a.times.size == 0 or b.times.size == 0:
        return a.times, a.values, b.values
    close = SAME_TIME * float(b.times[-1])
    nearest = np.clip(np.searchsorted(b.times, a.times - close), 0, len(b.times) - 1)
    if np.all(np.abs(b.times[nearest] - a.times) <= close):
        return a.times, a.values, b.values[nearest]
    few, many = (a, b) if len(a.times) < len(b.times) else (b, a)
    inside = few.times <= many.times[-1] + close
    times, values, spline = few.times[inside], few.values[inside], CubicSpline(many.times, many.values)
    return (times, values, spline(times)) if few is a else (times, spline(times), values)


def distance(a: Samples, b: Samples, each: bool, scale: float | None = None) -> float:
    """Return the largest difference between the rows of a and b, relative; infinite where they cannot be compared.

    Args:
        a: what is judged.
        b: what it is judged by.
        each: relative to each row of b (eigenvalues) instead of to the largest row (histories).
        scale: what the difference is relative to (m), instead of the largest row of b.
    """
    _, x, y = aligned(a, b)
    if x.shape != y.shape or not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        return float("inf")
    difference = np.linalg.norm(x - y, axis=1)
    if each:
        return float(np.max(difference / np.maximum(np.linalg.norm(y, axis=1), TINY), initial=0.0))
    return float(np.max(difference, initial=0.0) / (size(b) if scale is None else scale))


def moved(samples: Samples, to: Samples, of: Samples) -> Samples:
    """Return samples + (to − of), at the times of the samples."""
    times, end, start = aligned(to, of)
    change = end - start
    if len(change) != len(samples.values):
        change = CubicSpline(times, change)(samples.times)
    return Samples(samples.values + change, samples.times)


#: Returns the output of a setting; None where it failed or the budget refuses it.
Get = Callable[[Setting], Samples | None]

#: Returns the next finer setting in one direction; None where there is none.
Move = Callable[[Setting], Setting | None]


@dataclass
class Refinement:
    """Refines steps and mesh from one setting on.

    Args:
        get: computes a setting.
        base: the coarsest setting.
        moves: "time" and "mesh" ↦ the next finer setting.
        each: see `distance`.

    Attributes:
        differences: "time" and "mesh" ↦ (setting, difference to the next finer one), coarse to fine.
    """

    get: Get
    base: Setting
    moves: Mapping[str, Move]
    each: bool
    differences: dict[str, list[tuple[Setting, float]]] = field(default_factory=dict)

    def reference(self, goal: float) -> Reference | None:
        """Return what the settings tend to, known to a goal, or as well as can be had; None where nothing could be.

        Args:
            goal: relative difference of the last level that ends the refinement.
        """
        samples = self.get(self.base)
        found: Reference | None = None
        while samples is not None:
            finer = {name: self._finer(name, samples) for name in self.moves}
            parts = {name: self.differences[name][-1][1] for name in self.moves if self.differences.get(name)}
            if len(parts) < len(self.moves):
                return found  # one direction is not known at all
            worst = max(parts, key=lambda name: parts[name])
            best = samples
            for step in finer.values():
                best = best if step is None else moved(best, step[1], samples)
            found = Reference(best, parts, self._order("time" if "time" in parts else "mesh"), self.base)
            ahead = finer[worst]
            if sum(parts.values()) <= goal or ahead is None:
                return found
            self.base, samples = ahead
        return found

    def _finer(self, name: str, samples: Samples) -> tuple[Setting, Samples] | None:
        """Return the next finer setting in one direction with its output, and keep the difference."""
        following = self.moves[name](self.base)
        output = None if following is None else self.get(following)
        if following is None or output is None:
            return None
        self.differences.setdefault(name, []).append((self.base, distance(samples, output, self.each)))
        return following, output

    def _order(self, name: str) -> float | None:
        """Return log₂ of the ratio of the last two differences in a direction; None where they do not shrink."""
        if len(self.differences[name]) < 2:
            return None
        before, last = (d for _, d in self.differences[name][-2:])
        return log2(before / last) if before > last > 0.0 else None


def paired(known: Reference, there: Samples, here: Samples, each: bool) -> Reference:
    """Return the reference of a theory from that of another, and the outputs of both for one setting.

    The errors of the setting are nearly the same in both: the error of their difference is its product with the error.

    Args:
        known: the other's.
        there: output of the theory.
        here: output of the other.
        each: see `distance`.
    """
    error, apart = distance(here, known.samples, each), distance(there, here, each)
    parts = {**known.parts, "theory": apart * min(error, 1.0)}
    return Reference(moved(known.samples, there, here), parts, None, known.setting)
