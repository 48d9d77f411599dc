"""Self-refinement: observed orders, extrapolated references and how far they can be trusted; errors against them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]

#: Observed orders below this are noise, or of levels not yet fine enough: nothing is extrapolated.
LEAST_ORDER = 1.5

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
class Reference:
    """The converged output of one theory.

    Attributes:
        samples: its values.
        uncertainty: relative, in the norm that errors are measured in.
        order: observed order of the refinement; None where it was not sensible and the finest level is taken as it is.
        parts: uncertainty by what was refined, `time` and `mesh`.
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
    """Return the values of a and b at common times."""
    if a.times.size == 0 or b.times.size == 0:
        return a.values, b.values
    close = SAME_TIME * float(b.times[-1])
    nearest = np.clip(np.searchsorted(b.times, a.times - close), 0, len(b.times) - 1)
    if np.all(np.abs(b.times[nearest] - a.times) <= close):
        return a.values, b.values[nearest]
    inside = b.times <= a.times[-1] + close
    return CubicSpline(a.times, a.values)(b.times[inside]), b.values[inside]


def observed_order(coarse: Samples, middle: Samples, fine: Samples, each: bool) -> float | None:
    """Return p = log₂(|u_h − u_{h/2}| / |u_{h/2} − u_{h/4}|), None where the differences do not shrink as they should.

    Roache 1998, "Verification and Validation in Computational Science and Engineering", sec. 5.10.
    """
    first, second = distance(coarse, middle, each), distance(middle, fine, each)
    if not (np.isfinite(first) and np.isfinite(second)) or second <= 0.0:
        return None
    order = float(np.log2(first / second)) if first > 0.0 else -np.inf
    return order if order >= LEAST_ORDER else None


def extrapolated(coarse: Samples, fine: Samples, order: float) -> Samples:
    """Return Richardson's u_{h/2} + (u_{h/2} − u_h) / (2^p − 1), at the times of the fine one."""
    rough, good = aligned(coarse, fine)
    return Samples(good + (good - rough) / (2.0**order - 1.0), fine.times)


def reference(levels: list[Samples], each: bool, finer_mesh: Samples | None = None) -> Reference:
    """Return the reference that three levels of refinement give, and its uncertainty.

    Where the differences shrink with an order p, the two finest levels are extrapolated; the uncertainty is the
    difference to what the two coarsest ones give. Otherwise it is the finest level, and the larger of the differences
    between levels. The change that half the element size makes at the coarsest step is added to the value, and in full
    to the uncertainty.

    Args:
        levels: the output for h, h/2, h/4, sampled at the same times.
        each: see `distance`.
        finer_mesh: the output for h on a mesh of half the size, of a history refined in time.
    """
    order = observed_order(levels[0], levels[1], levels[2], each)
    if order is None:
        best = levels[2]
        uncertain = max(distance(levels[0], levels[1], each), distance(levels[1], best, each))
    else:
        best = extrapolated(levels[1], levels[2], order)
        uncertain = distance(extrapolated(levels[0], levels[1], order), best, each)
    parts = {"time" if finer_mesh is not None else "mesh": uncertain}
    if finer_mesh is not None:
        parts["mesh"] = distance(levels[0], finer_mesh, each)
        best = Samples(best.values + (finer_mesh.values - levels[0].values), best.times)
    return Reference(best, sum(parts.values()), order, parts)
