"""How long the steps of a scheme may be for an accuracy, from answers that there are: their spectra say what moves.

Errors by frequency are those of spectra (`rotfem.selection.spectrum`). The window of a spectrum does not see the very
start, of which the largest value without the slow part counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.fft import dct, idct
from scipy.interpolate import CubicSpline

from rotfem.selection.spectrum import DAMPED, LOST, UNKNOWN, Spectrum, Vibrating

Array = npt.NDArray[np.float64]

#: Angle (rad) from which a vibration is out of phase.
OUT = 1.0

#: Power of the frequency by which a filter leaves out what is slow; a sharp one would see the end from the start.
SMOOTH = 8

#: Longest step, as a part of the history, by what a shorter one is tried, and how many are.
LONGEST, FINER, SHORTER = 1 / 20, 0.7, 70

#: Windows in which a motion is looked at by itself, and how many times the steps of windows of their own it may cost to
#: go with those of the worst one through all.
WINDOWS, UNEVEN = 8, 6.0

#: Power of Hann's window in these, which have few periods of what is slow.
SHARP = 3

#: Fewest instants from which steps are planned.
FEWEST = 10 * WINDOWS

#: What a step costs beside its stages, in stages: rows and what is watched.
BESIDE = 1.0


def longest(error: Callable[[float], float], duration: float, allowed: float) -> float:
    """Return the longest step (s) found whose error is below what is allowed.

    Errors need not fall with the step: what long steps damp out, shorter ones may put out of phase.
    """
    long, short = LONGEST * duration, LONGEST * duration
    for _ in range(SHORTER):
        if error(short) <= allowed:
            break
        long, short = short, FINER * short
    while long > 1.05 * short:
        middle = 0.5 * (long + short)
        if error(middle) <= allowed:
            short = middle
        else:
            long = middle
    return short


@dataclass(frozen=True)
class Motion:
    """Displacement of the tip in an answer.

    Attributes:
        t: times at equal distances, (n,), s.
        tips: displacements, (n, components), m.
        struck: vibrations that jumps of what drives the motion start, (frequency in rad/s, amplitude in m) each, where
            the answer itself has not resolved them.
        structure: of the structure.
    """

    t: Array
    tips: Array
    struck: tuple[tuple[float, float], ...] = ()
    structure: Vibrating = UNKNOWN

    @classmethod
    def between(cls, t: Array, tips: Array, structure: Vibrating = UNKNOWN) -> Motion:
        """Return the motion through displacements (n, components) at increasing times (n,) at any distances."""
        even = np.linspace(t[0], t[-1], len(t))
        # straight lines would have frequencies of their own
        return cls(even, np.asarray(CubicSpline(t, tips)(even)), structure=structure)

    @property
    def scale(self) -> float:
        """Largest displacement, m."""
        return float(np.linalg.norm(self.tips, axis=1).max(initial=0.0))

    @property
    def tells(self) -> bool:
        """Whether there is enough of it to plan steps from."""
        return len(self.t) >= FEWEST and 0.0 < self.scale < np.inf

    @cached_property
    def whole(self) -> Spectrum:
        """Spectrum of all of it."""
        return Spectrum.of(self.t, self.tips, self.scale, structure=self.structure)

    @cached_property
    def parts(self) -> list[Spectrum]:
        """Spectra of windows."""
        windows = np.array_split(np.arange(len(self.t)), WINDOWS)
        return [Spectrum.of(self.t[i], self.tips[i], self.scale, SHARP, self.structure) for i in windows]

    def error(self, scheme: Any, h: float, above: float = 0.0, turned: float = 0.0) -> float:
        """Return the relative error of steps of h (s): what they damp out counts where there is most of it.

        Args:
            scheme: of the steps.
            h: their length.
            above: frequency from which vibrations count, rad/s.
            turned: angle (rad) that they must be off by at the end to count, if they are not damped out.
        """
        omega, amplitudes = np.array(self.struck).reshape(-1, 2).T
        struck = Spectrum(omega, amplitudes / self.scale, self.whole.duration).above(above)
        whole, parts = self.whole.above(above), [part.above(above) for part in self.parts]
        start = LOST * self.start(max(DAMPED / h, above)) / self.scale
        lost = max(start, struck.lost(h), *(part.lost(h) for part in parts)) - whole.lost(h)
        moving = whole.error(scheme, h, turned) + struck.error(scheme, h, turned)
        return self.fed * (moving - struck.lost(h) + max(0.0, lost))

    @property
    def fed(self) -> float:
        """By what an error grows as it changes the frequencies of a motion that is large beside the structure."""
        return 1.0 + self.scale / self.structure.length

    def start(self, omega: float) -> float:
        """Return the largest displacement (m) at the start of what is quicker than a frequency (rad/s).

        The motion is carried on evenly before its start, as from rest, and oddly beyond its end.
        """
        lines, frequencies = self._lines
        if omega > frequencies[-1]:
            return 0.0
        quick = -np.expm1(-((frequencies[:, None] / omega) ** SMOOTH)) * lines
        first = idct(quick, type=3, axis=0)[: len(lines) // WINDOWS]
        return float(np.linalg.norm(first, axis=1).max(initial=0.0))

    @cached_property
    def _lines(self) -> tuple[Array, Array]:
        """Cosine transform of the motion against its end, and the frequencies, rad/s."""
        n = len(self.t) - 1
        omega = np.pi * (np.arange(n) + 0.5) / (self.t[-1] - self.t[0])
        return np.asarray(dct(self.tips[:-1] - self.tips[-1], type=3, axis=0)), omega

    def plan(self, scheme: Any, allowed: float) -> Plan:
        """Return the steps of a scheme."""
        step = longest(partial(self.error, scheme), self.whole.duration, allowed)
        own = [
            longest(partial(part.error, scheme), part.duration, allowed / (WINDOWS * self.fed)) for part in self.parts
        ]
        worst = self.whole.duration / min(min(own), step)
        adapted = sum(part.duration / h for part, h in zip(self.parts, own, strict=True))
        work = (scheme.stages + BESIDE) * self.whole.duration / step
        return Plan(scheme.name, step, worst > UNEVEN * adapted, work)


@dataclass(frozen=True)
class Plan:
    """Steps for an accuracy.

    Attributes:
        scheme: its name.
        step: s.
        uneven: whether steps that adapt themselves would be much fewer.
        work: what they cost, in stages.
    """

    scheme: str
    step: float
    uneven: bool
    work: float


def plan(motions: Sequence[Motion], allowed: float, schemes: Iterable[Any]) -> Plan | None:
    """Return the steps of the scheme that is expected to cost least; None where nothing is known to move.

    Args:
        motions: answers that there are, whose most demanding one counts.
        allowed: error of steps, relative to the largest displacement of the tip.
        schemes: to choose from, classes of `Scheme` with an estimate of their error.
    """
    motions = [motion for motion in motions if motion.tells]
    if not motions:
        return None
    each = [max((motion.plan(scheme, allowed) for motion in motions), key=lambda p: p.work) for scheme in schemes]
    return min(each, key=lambda found: found.work, default=None)


def unresolved_ahead(motions: Sequence[Motion], scheme: Any, step: float) -> float:
    """Return what fixed steps (s) of a scheme do not resolve of the most demanding motion, relative; 0 if none tells.

    That is what they damp out, and vibrations that are out of phase by the end: shorter steps may do no better, so
    that two runs do not show it.
    """
    return max((motion.error(scheme, step, turned=OUT) for motion in motions if motion.tells), default=0.0)


def error_ahead(motions: Sequence[Motion], scheme: Any, step: float, above: float = 0.0) -> float | None:
    """Return the relative error of fixed steps (s) of a scheme, of the most demanding motion; None where none tells.

    Args:
        motions: answers that there are.
        scheme: of the steps.
        step: s.
        above: frequency from which vibrations count, rad/s.
    """
    return max((motion.error(scheme, step, above) for motion in motions if motion.tells), default=None)
