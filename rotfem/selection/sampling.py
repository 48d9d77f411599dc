"""When the histories of a trial are sampled, and in how many steps each goes from one sample to the next.

Samples are as close as the first two modes ask for, so only histories of one sampling can be compared. Between them
there are as many steps as what is prescribed needs, or Newton, but never more than the case takes itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from rotfem.analysis.time_loop import Steps
from rotfem.selection.resolution import Given, parts

Array = npt.NDArray[Any]

#: Steps in a period of the first and of the second eigenfrequency, and the fewest and most of a history.
STEPS_A_PERIOD, FEWEST_STEPS, MOST_STEPS = (32, 10), 200, 1500

#: Error by its steps with which a history is still good to see what changes.
ROUGH = 0.1

#: By how much longer steps may be than the frequencies ask for, where they are known to be off by less than that.
LONGER = 2.0

#: And by how much shorter while the samples are as close; else each has several steps to the next.
SHORTER = 0.5

#: Steps between two samples of a history, tried one after the other as far as the case has as many steps itself.
FINER = (1, 2, 4, 16)

#: Samples at the start of a motion that does not begin at rest, and the steps that each of them has to the next.
FIRST, STRUCK = 6, 16

#: What steps may be too long by, relative, since their number is whole.
ROUNDED = 1e-2

#: Samples in 1/ω₁ where no frequency is known.
SAMPLES_A_RADIAN = 5


@dataclass(frozen=True)
class Sampling:
    """The samples of a history, and the steps between them.

    Attributes:
        end: last time, s.
        step: distance of the samples, s.
        own: steps of the case itself; None where they are adaptive.
        parts: steps between two samples that what is prescribed asks for, (samples,).
    """

    end: float
    step: float
    own: int | None
    parts: Array

    @classmethod
    def of(cls, steps: Steps, at_rest: Array, signals: list[Given], longer: float = 1.0) -> Self:
        """Return the samples of a history.

        Args:
            steps: of the case itself.
            at_rest: frequencies of the resting structure, rad/s, as far as they are known.
            signals: what is prescribed.
            longer: by how much the steps are to be longer than the frequencies ask for, or shorter (below 1).
        """
        end = steps.end
        own = None if steps.step is None else int(np.ceil(end / steps.step - 1e-9))
        wanted = max((w * n for w, n in zip(at_rest, STEPS_A_PERIOD, strict=False)), default=np.inf) / (2 * np.pi)
        number = ceil(min(np.clip(end * wanted, FEWEST_STEPS, MOST_STEPS) / longer, MOST_STEPS))
        step = end / min(number, own or MOST_STEPS)
        times = np.linspace(0.0, end, round(end / step) + 1)
        period = 1 / at_rest[0] if at_rest.size else SAMPLES_A_RADIAN * step
        most = own or FINER[-1] * len(times)
        return cls(end, step, own, parts(signals, times, float(period), most, own))

    @property
    def levels(self) -> tuple[int, ...]:
        """`FINER` as far as no history takes more steps than the case itself, and the most that does not."""
        finest = FINER[-1]
        while self.own is not None and finest > 1 and self.count(finest) > self.own:
            finest -= 1
        return tuple(dict.fromkeys(min(finer, finest) for finer in FINER))

    def shortened(self, wanted: float) -> Self:
        """Return the same samples with steps between them that are as short as wanted (s), if there may be so many."""
        most = max(1, MOST_STEPS // len(self.parts))
        finer = min(ceil(self.step / wanted - ROUNDED), most)
        if finer <= 1:
            return self
        parts = np.maximum(self.parts, finer)
        return replace(self, parts=parts, own=None if self.own is None else max(self.own, int(parts.sum())))

    def struck(self) -> Self:
        """Return the same samples with short steps at the start, where what begins in motion rings along its axis."""
        parts = self.parts.copy()
        parts[:FIRST] = np.maximum(parts[:FIRST], STRUCK)
        return replace(self, parts=parts, own=None if self.own is None else max(self.own, int(parts.sum())))

    def count(self, finer: int) -> int:
        """Return the steps of a history with at least so many between two samples."""
        return int(np.maximum(self.parts, finer).sum())

    def steps(self, finer: int) -> Steps:
        """Return the steps of a history with at least so many between two samples."""
        return Steps(self.end, self.step, parts=tuple(max(finer, int(n)) for n in self.parts))


def serving(error: float, step: float, order: int) -> float:
    """Return the length of steps (s) in which a history is just good enough to see what changes.

    Args:
        error: relative, of a history in steps of a length; more than 0.
        step: that length, s.
        order: of the scheme.
    """
    return float(step * (ROUGH / error) ** (1 / order))
