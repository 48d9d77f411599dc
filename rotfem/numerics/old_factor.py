"""When the factor of an earlier tangent serves Newton's method, and when a new one pays.

Increments with an old factor shrink by a constant rate, often by two in turn: bending first, then what it stretches.
The rate of the last two says how many more there will be. Where these would cost more than a tangent and its factor,
which are dear where a factor is kept at all, it is made anew on the way.
"""

from __future__ import annotations

import math

#: Further iterations with an old factor that a new one would cost, and tangents after which the way is no good.
WORTH, MOST = 7.0, 3


class OldFactor:
    """Decides for every iteration whether the factor at hand serves.

    Args:
        serves: whether there is one for the first.

    Attributes:
        made: tangents that were made on the way.
        used: iterations with the last factor.
    """

    def __init__(self, serves: bool):
        self.serves = serves
        self.made, self.used = 0, 0
        self._sizes: list[float] = []

    @property
    def hopeless(self) -> bool:
        """Whether new tangents have not helped."""
        return self.made > MOST

    def took(self) -> bool:
        """Return whether the iteration that begins is one with the factor at hand, and count it."""
        old = self.serves
        if not old:
            self.made, self.used, self._sizes, self.serves = self.made + 1, 0, [], True
        self.used += 1
        return old

    def judge(self, size: float, wanted: float) -> None:
        """Take note of the size of an increment, which is to become as small as is wanted."""
        self._sizes.append(size)
        if len(self._sizes) < 3 or size <= wanted:
            return
        rate = math.sqrt(size / self._sizes[-3])
        self.serves = rate < 1.0 and math.log(size / wanted) <= WORTH * -math.log(rate)
