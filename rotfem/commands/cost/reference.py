"""Self-refinement: observed orders, extrapolated references and how far they can be trusted; errors against them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]

#: Observed orders below this are noise, or of levels not yet fine enough: nothing is extrapolated.
LEAST_ORDER = 1.0

#: Part of what an extrapolation of order 3/2 adds that is uncertain, however well levels agree; steeper, it is less.
DOUBT = 0.2

#: Ratios of the sizes of three levels that are halved, and the largest order that is looked for where they are not.
HALVED, STEEPEST = (2.0, 2.0), 30.0

#: Samples closer than this part of the interval are taken to be at the same time.
SAME_TIME = 1e-9


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
class Limit:
    """What a chain of refinements tends to.

    Attributes:
        samples: its values.
        uncertainty: relative, in the norm that errors are measured in; infinite where there is one level only.
        order: observed order of the refinement; None where it was not sensible and the finest level is taken as it is.
        error: about that of the finest level, relative.
    """

    samples: Samples
    uncertainty: float
    order: float | None
    error: float


@dataclass
class Reference:
    """The converged output of one theory.

    Attributes:
        samples: its values.
        uncertainty: relative, in the norm that errors are measured in.
        order: observed order of the refinement; None where it was not sensible and the finest level is taken as it is.
        parts: uncertainty by what was refined, `time` and `mesh`, and of their product, `mixed`.
    """

    samples: Samples
    uncertainty: float
    order: float | None
    parts: dict[str, float]


def distance(a: Samples, b: Samples, each: bool, scale: float | None = None) -> float:
    """Return the largest difference between the rows of a and b, relative.

    Args:
        a: what is judged; compared at its own times where b has them, interpolated by a cubic spline otherwise.
        b: what it is judged by.
        each: relative to each row of b (eigenvalues) instead of to the largest row (histories).
        scale: what the difference is relative to (m), instead of the largest row of b.
    """
    x, y = aligned(a, b)
    if x.shape != y.shape:
        return float("nan")
    difference = np.linalg.norm(x - y, axis=1)
    if each:
        return float(np.max(difference / np.maximum(np.linalg.norm(y, axis=1), 1e-300), initial=0.0))
    return float(np.max(difference, initial=0.0) / (size(b) if scale is None else scale))


def size(samples: Samples) -> float:
    """Return the largest norm of a row."""
    return float(np.max(np.linalg.norm(samples.values, axis=1), initial=0.0)) or 1e-300


def aligned(a: Samples, b: Samples) -> tuple[Array, Array]:
    """Return the values of a and b at common times: those of a where b has them, of the one with fewer otherwise."""
    if a.times.size == 0 or b.times.size == 0:
        return a.values, b.values
    close = SAME_TIME * float(b.times[-1])
    nearest = np.clip(np.searchsorted(b.times, a.times - close), 0, len(b.times) - 1)
    if np.all(np.abs(b.times[nearest] - a.times) <= close):
        return a.values, b.values[nearest]
    if len(a.times) < len(b.times):
        inside = a.times <= b.times[-1] + close
        return a.values[inside], CubicSpline(b.times, b.values)(a.times[inside])
    inside = b.times <= a.times[-1] + close
    return CubicSpline(a.times, a.values)(b.times[inside]), b.values[inside]


def observed_order(
    coarse: Samples, middle: Samples, fine: Samples, each: bool, ratios: tuple[float, float] = HALVED
) -> float | None:
    """Return p = log₂(|u_h − u_{h/2}| / |u_{h/2} − u_{h/4}|), None where the differences do not shrink as they should.

    Roache 1998, "Verification and Validation in Computational Science and Engineering", sec. 5.10. Sizes with other
    ratios r and s solve (r^p − 1) s^p / (s^p − 1) = |u_h − u_{h/r}| / |u_{h/r} − u_{h/rs}| for p.
    """
    first, second = distance(coarse, middle, each), distance(middle, fine, each)
    if not (np.isfinite(first) and np.isfinite(second)) or second <= 0.0 or first <= 0.0:
        return None
    r, s = ratios

    def excess(p: float) -> float:
        return float((r**p - 1.0) * s**p / (s**p - 1.0) - first / second)

    if excess(LEAST_ORDER) > 0.0:
        return None
    return float(np.log(first / second) / np.log(s)) if r == s else float(_root(excess))


def _root(excess: Callable[[float], float]) -> float:
    """Return where a function that increases with the order is zero, at most STEEPEST."""
    return STEEPEST if excess(STEEPEST) <= 0.0 else float(brentq(excess, LEAST_ORDER, STEEPEST))


def extrapolated(coarse: Samples, fine: Samples, order: float, ratio: float = 2.0) -> Samples:
    """Return Richardson's u_{h/r} + (u_{h/r} − u_h) / (r^p − 1), at the times of the fine one."""
    rough, good = aligned(coarse, fine)
    return shifted(fine, Samples((good - rough) / (ratio**order - 1.0), coarse.times))


def shifted(samples: Samples, change: Samples) -> Samples:
    """Return samples with a change added, which is interpolated where it is known at fewer times."""
    values = change.values
    if len(values) != len(samples.values):
        values = CubicSpline(change.times, values)(samples.times)
    return Samples(samples.values + values, samples.times)


def limit(
    levels: Sequence[Samples], each: bool, highest: float = np.inf, ratios: tuple[float, float] = HALVED
) -> Limit:
    """Return what levels of refinement tend to, each with half the size of the one before; the last three count.

    Where the differences shrink with an order p, the two finest levels are extrapolated; the uncertainty is the
    difference to what the two before give, at most the last difference, which is all there is to come where differences
    halve, and at least a part of what was added. Otherwise it is the finest level, and the larger of the differences
    between levels. A degree raised by one may stand for half the size: only the ratio of
    the differences counts.

    Args:
        levels: the output for h, h/2, h/4, …
        each: see `distance`.
        highest: order of the method: levels that differ less than it says do so by chance.
        ratios: of the sizes of the last three levels, where they are not halved.
    """
    fine = levels[-1]
    if len(levels) == 1:
        return Limit(fine, np.inf, None, np.inf)
    last = _known(distance(levels[-2], fine, each))
    if len(levels) == 2:
        return Limit(fine, last, None, last)
    order = observed_order(levels[-3], levels[-2], fine, each, ratios)
    if order is None:
        worst = max(_known(distance(levels[-3], levels[-2], each)), last)
        return Limit(fine, worst, None, worst)
    p = min(order, highest)
    best = extrapolated(levels[-2], fine, p, ratios[1])
    added = distance(fine, best, each)
    unlike = min(distance(extrapolated(levels[-3], levels[-2], p, ratios[0]), best, each), last)
    uncertain = max(unlike, DOUBT * added / (p - 0.5))
    return Limit(best, uncertain, order, added)


def neighbour(known: Reference, there: Samples, here: Samples, error: float) -> Reference:
    """Return the reference of a theory from that of another, and the outputs of both for one setting.

    The errors of the setting are nearly the same in both, and leave the difference with a part of it uncertain.

    Args:
        known: the other's.
        there: output of the theory.
        here: output of the other.
        error: about that of the setting, relative.
    """
    a, b = aligned(there, here)
    times = there.times if len(a) == len(there.times) else here.times
    apart = distance(there, here, each=False)
    parts = {**known.parts, "theory": apart * min(error, 1.0)}
    return Reference(shifted(known.samples, Samples(a - b, times)), sum(parts.values()), None, parts)


def _known(value: float) -> float:
    """Return a distance, infinite where the samples cannot be compared."""
    return value if np.isfinite(value) else np.inf


def unlike(one: tuple[Samples, Samples], other: tuple[Samples, Samples], each: bool) -> float:
    """Return the distance of two changes (from, to), relative to what one of them is a change to."""
    changes = []
    for before, after in (one, other):
        fine, coarse = aligned(after, before)
        changes.append(Samples(fine - coarse, min(before.times, after.times, key=len)))
    a, b = aligned(*changes)
    difference = np.linalg.norm(a - b, axis=1)
    sizes = np.linalg.norm(one[1].values, axis=1) if each else size(one[1])
    return float(np.max(difference / np.maximum(sizes, 1e-300), initial=0.0))


def combined(time: Limit, base: Samples, mesh: Limit, mesh_step: float, each: bool, mixed: float = 0.0) -> Reference:
    """Return the reference of a history refined in time on one mesh, and in space at one step.

    What the refinement in space changes at that step is added to the limit in time. Both errors together change each
    other: the product of their sizes is counted as uncertain.

    Args:
        time: limit of the steps on one mesh.
        base: the output on that mesh at the step with which meshes are refined.
        mesh: limit of the meshes at that step.
        mesh_step: about the error of that step.
        each: see `distance`.
        mixed: what both errors make of each other at least, where it was looked at.
    """
    fine, coarse = aligned(mesh.samples, base)
    change = Samples(fine - coarse, mesh.samples.times)
    mixed = max(mixed, distance(base, mesh.samples, each) * min(mesh_step, 1.0))
    parts = {"time": time.uncertainty, "mesh": mesh.uncertainty, "mixed": mixed}
    return Reference(shifted(time.samples, change), sum(parts.values()), time.order, parts)
