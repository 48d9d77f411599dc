"""Amplitudes of a motion by frequency, and what steps and meshes put off of it.

A scheme whose steps are off a vibration by C (ωh)^m of its amplitude A adds T/h of that up in T seconds, but never to
more than two opposite vibrations differ, 2A, and where it damps a vibration out to no more than that, A. With the
amplitudes A_k of the tip's motion at ω_k and a factor s for safety,

    e(h) = Σ_k A_k min(2 or 1, s C (ω_k h)^m T/h),

so what is fast but small need not be resolved, and T at most the time in which vibrations fade.

Amplitudes are those of the Fourier transform under Hann's window, which makes a vibration half its amplitude in two
neighbours of its line, and a jump from the end to the start nearly nothing. The sum is above the truth, as vibrations
do not all come together.

A mesh that puts the frequency ω off by ε(ω) moves a motion likewise, by Σ_k A_k min(2, s ε(ω_k) ω_k T).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: The factor s for safety, with which true errors have been below the sum, and ωh from which a scheme damps.
SAFE, DAMPED = 1.2, 4.0

#: Part of its amplitude that a vibration which is damped out counts with: all of it is missing from then on, and a
#: little more in the step that damps it.
LOST = 1.25

#: Part of the lowest frequency below which a motion follows its loads, and how many times as far as that frequency it
#: is off then: stiffnesses are off by twice as much, 2/(1 − FOLLOWING²).
FOLLOWING, FOLLOWED = 0.5, 8 / 3


@dataclass(frozen=True)
class Vibrating:
    """What is known of the vibrations of a structure.

    Attributes:
        lowest: frequency, rad/s; what is far below it follows its loads and has no phase to lose. 0 where unknown.
        fading: rate at which vibrations fade at least, 1/s: a phase that is lost is forgotten after 1/fading.
        rates: frequencies of modes (increasing, rad/s) and at what rates these fade (1/s), at some instants each.
        length: of the structure, m; infinite where unknown. Of motions of that size frequencies follow amplitudes, so
            that an error of these puts phases off, too.
    """

    lowest: float = 0.0
    fading: float = 0.0
    rates: tuple[tuple[Array, Array], ...] = ()
    length: float = np.inf

    def fades(self, omega: Array) -> Array:
        """Return the rate (1/s) at which vibrations of frequencies (n,), rad/s, fade: of the modes beside them."""
        out = np.full(len(omega), np.inf if self.rates else self.fading)
        for frequencies, rates in self.rates:
            above = np.searchsorted(frequencies, omega)
            beside = [np.clip(above - one, 0, len(frequencies) - 1) for one in (0, 1)]
            out = np.minimum(out, np.minimum(*(rates[i] for i in beside)))
        return np.asarray(np.maximum(out, self.fading))


UNKNOWN = Vibrating()


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes of a motion.

    Attributes:
        omega: rad/s, (n,).
        amplitudes: relative to the largest displacement of the whole motion, (n,).
        duration: of the motion, s.
        structure: of the structure that moves so.
    """

    omega: Array
    amplitudes: Array
    duration: float
    structure: Vibrating = UNKNOWN

    @classmethod
    def of(cls, t: Array, motion: Array, scale: float, power: int = 1, structure: Vibrating = UNKNOWN) -> Spectrum:
        """Return the spectrum of a motion at equal distances of time.

        Args:
            t: times (n,), s.
            motion: of the tip, (n, components), m.
            scale: its largest displacement, m.
            power: of Hann's window; what a slow motion leaves at high frequencies falls with it.
            structure: of the structure.
        """
        n, step = len(t), float(t[1] - t[0])
        window = np.hanning(n)[:, None] ** power
        lines = np.fft.rfft(window * (motion - motion.mean(axis=0)), axis=0)
        beside = np.abs(np.fft.fft(window[:, 0])).sum() / window.sum()  # a line has neighbours
        amplitudes = np.linalg.norm(lines, axis=1) * 2 / window.sum() / scale / beside
        return cls(2 * np.pi * np.fft.rfftfreq(n, step), amplitudes, n * step, structure)

    def above(self, omega: float) -> Spectrum:
        """Return the part of it at frequencies from one (rad/s) on."""
        return self if omega <= 0.0 else replace(self, amplitudes=np.where(self.omega >= omega, self.amplitudes, 0.0))

    @cached_property
    def turned(self) -> Array:
        """Angle (rad) through which a vibration adds up what it is off, (n,)."""
        whole = self.omega * np.minimum(self.duration, 1.0 / np.maximum(self.structure.fades(self.omega), 1e-300))
        return np.where(self.omega < FOLLOWING * self.structure.lowest, np.minimum(whole, FOLLOWED), whole)

    def lost(self, h: float) -> float:
        """Return the error by what steps of h (s) damp out, with all amplitudes together."""
        return LOST * float(self.amplitudes[self.omega * h >= DAMPED].sum())

    def error(self, scheme: Any, h: float, turned: float = 0.0) -> float:
        """Return e(h) of a scheme, relative, of what its steps are off by so much (in rad at the end) at least."""
        coefficient, power, _ = scheme.estimate
        moves = self.omega * h < DAMPED
        each = SAFE * coefficient * (self.omega[moves] * h) ** (power - 1) * self.turned[moves]
        counts = each >= turned
        return float(self.amplitudes[moves][counts] @ np.minimum(2.0, each[counts])) + self.lost(h)

    def error_of_mesh(self, off: Array) -> float:
        """Return the relative error that frequencies which are off by so much (relative, (n,)) make."""
        return float(self.amplitudes @ np.minimum(2.0, SAFE * off * self.turned))
