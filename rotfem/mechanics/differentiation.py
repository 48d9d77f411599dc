"""Derivatives of a function of time that is known by its values alone.

The function is interpolated at seven points around t: 0, ±g², ±g and ±1 times a step h, with the golden ratio g, so
that no period and no symmetry is met by all of them. With D the derivative of that polynomial and D₅ that of the one
through the inner five, the error is about

    E(h) = ρ |D − D₅| + ε (max |f| + |t D|) Σ |w|/hᵐ,        ρ = max(1, |w|/|w − w₅|),

the truncation, or noise of the values, and the round-off of the m-th derivative with weights w (Fornberg, SIAM Review
40 (1998) 685). Independent errors of the values make ρ times as much of D as of D − D₅.

In every cell of time one h serves, 2⁻ᵏ times the cell: that of least E, at the worst of some points in it, among those
whose D agree with those of all shorter steps (Lepskii, Theory Probab. Appl. 35 (1991) 454). That of a step longer than
a period does not. Noise at a step is taken to be at least 2⁻ᵐ of that at half of it. So h follows what the function
itself does, and the result depends on t alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import factorial, floor

import numpy as np

Scalar = Callable[[float], float]

GOLDEN = (5**0.5 - 1) / 2

#: Points of the interpolation in units of h, the inner five first.
NODES = (0.0, -(GOLDEN**2), GOLDEN**2, -GOLDEN, GOLDEN, -1.0, 1.0)

#: Length of a cell of time (s) where no time grid says it.
CELL = 0.1


@lru_cache(maxsize=64)
def weights(order: int, place: float) -> tuple[tuple[float, ...], tuple[float, ...], float, float]:
    """Return the weights, for h = 1, of all points and of the inner five at a place between −1 and 1, Σ |w|, and ρ.

    With the nodes ξ from there they fulfil Σ w_i ξ_iᵏ = (d/dx)ᵐ xᵏ at 0 for all k below the number of points.
    """
    out = np.zeros((2, 7))
    for row, n in zip(out, (7, 5), strict=True):
        right = np.zeros(n)
        right[order] = factorial(order)
        row[:n] = np.linalg.solve(np.vander(np.array(NODES[:n]) - place, increasing=True).T, right)
    w, inner = out
    rho = max(1.0, float(np.linalg.norm(w) / np.linalg.norm(w - inner)))
    return tuple(map(float, w)), tuple(map(float, inner[:5])), float(np.abs(w).sum()), rho


class Derivative:
    """The derivative of a function of time.

    Args:
        function: t (s) ↦ value.
        order: 1 or 2.
        cell: length of time (s) in which one step h serves, and the longest of these, as a time grid has it.
        breakpoints: times (s) between which the function is smooth: no difference reaches over them.
    """

    def __init__(self, function: Scalar, order: int = 1, cell: float | None = None, breakpoints: Sequence[float] = ()):
        self._function, self._order, self._cell = function, order, cell or CELL
        self._pieces = np.array([-np.inf, *sorted(breakpoints), np.inf])
        self._steps: dict[tuple[int, int], tuple[float, float]] = {}
        self._last = float("nan"), 0.0

    def __call__(self, t: float) -> float:
        """Return the derivative at time t (s); at a breakpoint that of the piece which starts there."""
        if self._last[0] == t:
            return self._last[1]
        piece, cell = int(np.searchsorted(self._pieces, t, side="right")), floor(t / self._cell)
        limits = float(self._pieces[piece - 1]), float(np.nextafter(self._pieces[piece], -np.inf))
        if (piece, cell) not in self._steps:
            probes = [min(max((cell + x) * self._cell, limits[0]), limits[1]) for x in (GOLDEN**4, GOLDEN**2, GOLDEN)]
            self._steps[piece, cell] = self._best(probes, limits)
        h, error = self._steps[piece, cell]
        value, here, _ = self._at(t, h, limits)
        if here > 10 * error:  # a burst between the probes: the time has a step of its own
            value = self._at(t, self._best([t], limits)[0], limits)[0]
        self._last = t, value
        return value

    def _best(self, times: Sequence[float], limits: tuple[float, float]) -> tuple[float, float]:
        """Return the step h (s) whose largest error at some times is least, and that error.

        From short to long, as far as the derivatives agree with those of all shorter steps within the errors of both.
        """
        longest = min(self._cell, 0.5 * (limits[1] - limits[0]))
        seen: list[tuple[list[float], float]] = []
        best, least, floor = longest, np.inf, 0.0
        for k in range(16, -1, -1):
            h = longest / 2**k
            found = [self._at(t, h, limits) for t in times]
            if k > 0 and not any(size for _, _, size in found):  # below the digits of a stair
                continue
            floor = max(floor / 2**self._order, *(error for _, error, _ in found))
            values = [D for D, _, _ in found]
            if any(np.max(np.abs(np.subtract(values, others))) > 4 * (floor + bound) for others, bound in seen):
                break
            seen.append((values, floor))
            if floor <= least:
                best, least = h, floor
        return best, least

    def _at(self, t: float, h: float, limits: tuple[float, float]) -> tuple[float, float, float]:
        """Return the derivative at a time with a step h (s), its error, and the largest change of the value."""
        middle = min(max(t, limits[0] + h), limits[1] - h)
        outer, inner, total, rho = weights(self._order, 0.0 if middle == t else round((t - middle) / h, 12))
        values = [float(self._function(min(max(middle + x * h, limits[0]), limits[1]))) for x in NODES]
        base, scale = values[0], h**self._order
        changes = [value - base for value in values]  # so that what does not change has no derivative
        size = max(map(abs, changes))
        if size == 0.0:
            return 0.0, 0.0, 0.0
        D = sum(w * x for w, x in zip(outer, changes, strict=True)) / scale
        coarse = sum(w * x for w, x in zip(inner, changes[:5], strict=True)) / scale
        shift = abs(t) * size / h  # of the value, by the round-off of t
        rounded = float(np.finfo(float).eps) * (abs(base) + size + shift) * total / scale
        return D, rho * abs(D - coarse) + rounded, size
