"""Newton's method, judged by its increments; no physics."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rotfem.errors import ComputationError


class Factor:
    """Decides for every iteration whether the factor of an earlier tangent serves, or a new one pays.

    Increments with an old factor shrink by a constant rate, often by two in turn. The rate of the last two says how
    many more there will be. Where these would cost more than a tangent and its factor, it is made anew. After three on
    the way every iteration makes its own.

    Args:
        serves: whether there is one for the first.
    """

    def __init__(self, serves: bool):
        self.serves = serves
        self._made, self._sizes = 0, list[float]()

    def renewed(self) -> bool:
        """Return whether the iteration that begins makes a new one, and count it."""
        if self.serves:
            return False
        self._made, self._sizes, self.serves = self._made + 1, [], self._made < 3
        return True

    def judge(self, size: float, wanted: float) -> None:
        """Take note of the size of an increment, which is to become as small as is wanted."""
        self._sizes.append(size)
        if len(self._sizes) < 3 or size <= wanted:
            return
        rate = math.sqrt(size / self._sizes[-3])
        self.serves = rate < 1.0 and math.log(size / wanted) <= 7.0 * -math.log(rate)  # a tangent costs 7 iterations


#: Longest correction that is taken whole, in the units of the unknowns (the length of a structure, 1 rad): of what is
#: farther away a tangent says nothing.
REACH = 0.5


@dataclass
class Newton:
    """Newton iteration that is judged by its increments.

    A residual tolerance would lie below round-off where axial and bending stiffness differ by ten orders; the size of
    the increment, in the units of the unknowns, does not. Once the quadratic constants kappa = |d_2|/|d_1|² and
    |d_3|/|d_2|² are known from earlier solves, a first iteration whose predicted successor is below tolerance is the
    last, and a second one whose successor is below a ten-thousandth of it, as errors of q are c_a times as large in a.

    Attributes:
        tolerance: largest accepted increment, relative to the scale of each unknown.
        max_iterations: iterations before failure.
        iterations: total over all solves.
        diverging: whether increments were large or grew on the way of the last solve. They do where a structure is
            slender, on the way to the right root too; but that it is close to the start is no argument for it then.
        wandered: whether an increment after the first of the last solve was beyond where its tangent says anything.
        roundoff: largest increment accepted because it had stopped shrinking at round-off level.
    """

    tolerance: float = 1e-9
    max_iterations: int = 25
    iterations: int = 0
    diverging: bool = False
    wandered: bool = False
    roundoff: float = 0.0
    _kappa: list[float] = field(default_factory=lambda: [np.inf, np.inf], repr=False)
    _longest: list[float] = field(default_factory=lambda: [0.0, 0.0], repr=False)

    @classmethod
    def of(cls, settings: Any) -> Newton:
        """Return the control that settings (`increment_tolerance`, `max_iterations`) ask for."""
        return cls(settings.increment_tolerance, settings.max_iterations)

    def solve(
        self,
        increment: Callable[[bool], tuple[float, bool]],
        size: Callable[[], float],
        factor: Factor | None = None,
    ) -> int:
        """Repeat `increment` until it is small; return the number of iterations."""
        self.diverging = self.wandered = False
        previous, first, stalled, k, tangents = np.inf, np.inf, 0, 0, 0
        while tangents < self.max_iterations and k < 3 * self.max_iterations:
            k += 1
            new = factor is None or factor.renewed()
            tangents += new
            d, exact = increment(new)
            self.iterations += 1
            if not math.isfinite(d):
                raise ComputationError(f"Newton iteration {k} gave an increment that is not finite")
            if exact:
                return k
            if k == 1:
                first = d
            if factor is None and 1 < k < 4 and 0 < previous <= REACH:
                i = k - 2
                self._kappa[i] = max(0.5 * self._kappa[i] if math.isfinite(self._kappa[i]) else 0.0, d / previous**2)
                self._longest[i] = max(previous, 0.5 * self._longest[i])
            if factor is not None:
                # Newton's last increment leaves an error of its square; those with an old factor leave a part of
                # themselves, the same way in every step, which adds up. Round-off lets them reach 1e-12.
                enough = max(1e-2 * self.tolerance, min(self.tolerance, 1e-12))
                if d <= enough or (d <= self.tolerance and d > 0.3 * previous):
                    return k
                factor.judge(d, enough)
            elif d <= self.tolerance or (k < 3 and self._is_last(k - 1, d)):
                return k
            stalled = stalled + 1 if d > 0.3 * previous and new else 0
            if stalled >= 3 and d <= 1e-5 * max(size(), self.tolerance):  # larger ones wander
                self.roundoff = max(self.roundoff, d)
                return k
            self.diverging |= d > 0.1 or (k > 1 and d > max(previous, 1e-3))  # the root may be another one
            self.wandered |= k > 1 and d > REACH
            if k > 4 and d > 10 * first and d > 1:
                raise ComputationError(f"Newton diverged: increments grew from {first:.1e} to {d:.1e} (scaled)")
            previous = d
        raise ComputationError(
            f"Newton did not converge in {k} iterations: last increment {previous:.1e} (scaled), "
            f"wanted {self.tolerance:.0e}"
        )

    def _is_last(self, i: int, d: float) -> bool:
        """Return whether the successor of increment i, 0 or 1, of size d is predicted to be small enough.

        Of increments twice as long as any that kappa was found with it says nothing, as along an axis on which the
        equations are linear.
        """
        return d <= 2.0 * self._longest[i] and 4 * self._kappa[i] * d**2 <= (self.tolerance, 1e-4 * self.tolerance)[i]
