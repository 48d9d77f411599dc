"""Zeros of functions that are computed, and so not always to be had."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import brentq


def root(f: Callable[[float], float], ends: tuple[float, float], at_ends: Sequence[float]) -> float | None:
    """Return a number between two where f changes sign; None where f has no value on the way.

    Args:
        f: the function.
        ends: the two numbers.
        at_ends: f there, of different signs. Computed anew, a value near zero may come out with the other sign.
    """
    known, lost = dict(zip(ends, at_ends, strict=True)), []

    def value(x: float) -> float:
        found = known[x] if x in known else f(x)
        lost.extend([] if np.isfinite(found) else [x])
        return found if np.isfinite(found) else 0.0

    found = float(brentq(value, *ends, xtol=1e-12, rtol=1e-10))
    return None if lost else found
