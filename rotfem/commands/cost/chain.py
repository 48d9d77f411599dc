"""A chain of settings that are refined one after the other, and what it tends to. No dolfinx in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import ceil, log2

from rotfem.commands.cost.prediction import order
from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import HALVED, Limit, Samples, distance, limit
from rotfem.commands.cost.settings import Setting, cells

#: Returns the measurement of a setting that may take a share of the time left; None where the budget refuses it.
Get = Callable[[Setting, float], Measurement | None]

#: Differences below this are round-off where they do not shrink.
ROUND_OFF = 1e-6

#: Failures in a row after which a chain is given up, and levels that it has at most.
MOST_FAILURES, MOST_LEVELS = 3, 14

#: Doublings of a time after which it is no number any more.
ENDLESS = 1000.0


@dataclass
class Chain:
    """Settings that were refined one after the other.

    Attributes:
        ahead: the settings to come.
        each: see `distance`.
        settings, samples: of the levels that could be computed.
        costs: their CPU times, s.
        reason: why the last one that failed did.
        ended: no further level is to be had.
        doubt: uncertainty at least, for what others say.
    """

    ahead: Iterator[Setting]
    each: bool
    settings: list[Setting] = field(default_factory=list)
    samples: list[Samples] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    reason: str = ""
    ended: bool = False
    doubt: float = 0.0
    _failures: int = 0

    def extend(self, get: Get, share: float) -> None:
        """Add the next level, if it is to be had."""
        setting = next(self.ahead, None)
        found = None if setting is None or len(self.samples) >= MOST_LEVELS else get(setting, share)
        if setting is None or found is None:
            self.ended = True
            self.reason = self.reason or "the budget is too small for it"
            return
        if found.samples is None:
            self.reason = found.reason
            self._failures += 1
            self.ended = self._failures >= MOST_FAILURES
            return
        self._failures = 0
        self.settings.append(setting)
        self.samples.append(found.samples)
        self.costs.append(found.median("cpu"))
        self.ended = self._at_round_off()

    def _at_round_off(self) -> bool:
        """Return whether levels differ by so little that the differences do not shrink any more."""
        if len(self.samples) < 4:
            return False
        before, last = (distance(self.samples[i], self.samples[i + 1], self.each) for i in (-3, -2))
        return last < ROUND_OFF and last > 0.7 * before

    def limit(self) -> Limit:
        """Return what the levels tend to."""
        ratios = [ratio(*pair) for pair in pairwise(self.settings[-3:])]
        found = limit(self.samples, self.each, self.highest, (ratios[0], ratios[-1]) if ratios else HALVED)
        return replace(found, uncertainty=max(found.uncertainty, self.doubt))

    @property
    def highest(self) -> float:
        """Order of the method that is refined."""
        first = self.settings[0]
        return float(order(first)) if len(self.settings) > 1 and first.step != self.settings[1].step else float("inf")

    def to_go(self, goal: float) -> float:
        """Return about how long (s) it will take until the limit is known to a goal; infinite where it never is."""
        if self.ended or not self.samples:
            return float("inf")
        found = self.limit()
        p = found.order or self.highest
        uncertain = found.uncertainty if len(self.samples) > 1 else 1.0
        further = (
            1 if uncertain <= goal or p == float("inf") else max(1, ceil(log2(uncertain / goal) / min(p, self.highest)))
        )
        return self.costs[-1] * 2.0 ** (further + 1)

    def to_take(self, goal: float) -> float:
        """Return about how long (s) it would take until the limit is known to a goal, were there no bound of time.

        Each level takes as many times as long as the last one did, at least twice; where no order shows, what is
        uncertain is taken to halve with each. Infinite where there are too few levels to say, and beyond all numbers.
        """
        if len(self.samples) < 2:
            return float("inf")
        found = self.limit()
        if found.uncertainty <= goal:
            return 0.0
        further = log2(found.uncertainty / goal) / min(found.order or 1.0, self.highest)
        growth = max(2.0, self.costs[-1] / max(self.costs[-2], 1e-9))
        if further * log2(growth) > ENDLESS:
            return float("inf")
        return self.costs[-1] * sum(growth**i for i in range(1, ceil(further) + 1))


def ratio(coarse: Setting, fine: Setting) -> float:
    """Return the ratio of steps, or of sizes of elements; 2 where only the degree is raised."""
    if coarse.step is not None and fine.step is not None and coarse.step != fine.step:
        return coarse.step / fine.step
    if coarse.elements == fine.elements:
        return 2.0
    more = cells(fine.elements) / cells(coarse.elements)
    return more**0.5 if isinstance(fine.elements, tuple) else more
