"""What the mesh puts off vibrations by that steps are too long for.

Steps of h turn a vibration of frequency ω by θ = 2 arctan(ωh/2) (the trapezoidal rule; others are near), so that its
own frequency is another one: exact errors, which have ω, do not grow with what the mesh does to it.
A relative error ε of ω turns it by

    δθ = ε ωh / (1 + (ωh/2)²)

more in each step, and after n steps it is off by min(2, n δθ) of its amplitude; of several, phases being what they may,
the squares add up. Second differences of the samples have 4 sin²(θ/2) of an amplitude, and next to nothing of what is
slow.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_window import Window

Array = npt.NDArray[np.float64]

#: Phase (rad) that steps have to lose of a vibration until it is none that the exact equation follows.
LOST = 1.0

#: Relative difference of lengths up to which steps are alike.
ALIKE = 1e-6


def largest_unresolved(windows: Sequence[Window]) -> tuple[float, float]:
    """Return the largest error of the tip by the mesh in vibrations whose phase the steps lose, m, and when, s."""
    best, passed = (0.0, 0.0), 0
    for window in windows:
        passed += len(window.lengths)
        omega = np.sqrt(np.abs(window.shapes.squares))
        half = 0.5 * omega * window.step
        lost = 2.0 * passed * (half - np.arctan(half))
        # Shapes that were not compared are off by what the ones below are, or more.
        known = np.maximum.accumulate(np.abs(window.epsilon))
        off = np.minimum(2.0, passed * known * 2.0 * half / (1.0 + half**2)) * (lost > LOST)
        size = float(np.linalg.norm(window.shapes.tip * off * _amplitudes(window, half)))
        best = max(best, (size, float(window.t[-1])))
    return best


def _amplitudes(window: Window, half: Array) -> Array:
    """Return the amplitudes of the vibrations of shapes with these ωh/2, of the root mean squares, shape (r,)."""
    begin, end = window.ends
    h = window.lengths
    joined = (begin[1:] == end[:-1]) & (np.abs(np.diff(h)) <= ALIKE * h[1:])
    if not np.any(joined):
        return np.zeros(len(half))
    c = window.motion[0][:, : len(half)]
    bends = c[end[1:][joined]] - 2.0 * c[begin[1:][joined]] + c[begin[:-1][joined]]
    return np.asarray(np.sqrt(2.0 * (bends**2).mean(axis=0)) * (1.0 + half**2) / np.maximum(4.0 * half**2, 1e-300))
