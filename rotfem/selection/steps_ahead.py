"""How long the steps of a scheme may be for an accuracy, from a first answer: its spectrum says what is to be resolved.

A scheme whose steps are off a vibration by C (ωh)^m of its amplitude A adds T/h of that up in T seconds, but never to
more than the vibration itself, 2A. With the amplitudes A_k of the tip's motion at ω_k,

    e(h) = Σ_k A_k min(2, C (ω_k h)^m T/h),

so what is fast but small need not be resolved. Amplitudes are those of the Fourier transform under Hann's window, which
makes a vibration half its amplitude in two neighbours of its line, and a jump from the end to the start nearly nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Longest step, as a part of the history, and halvings that find one.
LONGEST, HALVINGS = 1 / 20, 40

#: Windows in which a motion is looked at by itself, and how many times the steps of windows of their own it may cost to
#: go with those of the worst one through all.
WINDOWS, UNEVEN = 8, 3.0

#: Fewest instants from which steps are planned.
FEWEST = 10 * WINDOWS


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes of a motion.

    Attributes:
        omega: rad/s, (n,).
        amplitudes: relative to the largest displacement of the whole motion, (n,).
        duration: of the motion, s.
    """

    omega: Array
    amplitudes: Array
    duration: float

    @classmethod
    def of(cls, t: Array, motion: Array, scale: float) -> Spectrum:
        """Return the spectrum of a motion at equal distances of time.

        Args:
            t: times (n,), s.
            motion: of the tip, (n, components), m.
            scale: its largest displacement, m.
        """
        n, step = len(t), float(t[1] - t[0])
        window = np.hanning(n)[:, None]
        lines = np.fft.rfft(window * (motion - motion.mean(axis=0)), axis=0)
        amplitudes = np.linalg.norm(lines, axis=1) * 2 / window.sum() / scale / 2  # halved: a line has neighbours
        return cls(2 * np.pi * np.fft.rfftfreq(n, step), amplitudes, n * step)

    def error(self, scheme: Any, h: float) -> float:
        """Return e(h) of a scheme, relative."""
        coefficient, power, _ = scheme.estimate
        each = coefficient * (self.omega * h) ** power * self.duration / h
        return float(self.amplitudes @ np.minimum(2.0, each))

    def step(self, scheme: Any, allowed: float) -> float:
        """Return the longest step (s) of a scheme whose error is below what is allowed."""
        long, short = LONGEST * self.duration, 0.0
        if self.error(scheme, long) <= allowed:
            return long
        for _ in range(HALVINGS):
            middle = 0.5 * (long + short) if short > 0.0 else 0.5 * long
            if self.error(scheme, middle) <= allowed:
                short = middle
                if long < 1.05 * short:
                    break
            else:
                long = middle
        return short or long


@dataclass(frozen=True)
class Plan:
    """Steps for an accuracy.

    Attributes:
        scheme: its name.
        step: s.
        uneven: whether steps that adapt themselves would be much fewer.
        work: stages of steps in all.
    """

    scheme: str
    step: float
    uneven: bool
    work: float


def plan(t: Array, tips: Array, allowed: float, schemes: Iterable[Any]) -> Plan | None:
    """Return the steps of the scheme that is expected to need the fewest stages; None where nothing moves.

    Args:
        t: times of a first answer, at equal distances, s.
        tips: displacement of the tip then, (n, components), m.
        allowed: error of steps, relative to its largest displacement.
        schemes: to choose from, classes of `Scheme` with an estimate of their error.
    """
    scale = float(np.linalg.norm(tips, axis=1).max(initial=0.0))
    if scale == 0.0 or len(t) < FEWEST:
        return None
    whole = Spectrum.of(t, tips, scale)
    parts = [Spectrum.of(t[i], tips[i], scale) for i in np.array_split(np.arange(len(t)), WINDOWS)]
    found = []
    for scheme in schemes:
        step = whole.step(scheme, allowed)
        own = [part.step(scheme, allowed / WINDOWS) for part in parts]
        worst = whole.duration / min(min(own), step)
        adapted = sum(part.duration / h for part, h in zip(parts, own, strict=True))
        found.append(Plan(scheme.name, step, worst > UNEVEN * adapted, scheme.stages * whole.duration / step))
    return min(found, key=lambda plan: plan.work, default=None)
