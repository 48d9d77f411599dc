"""Derivatives of functions of time that are known by their values alone, against exact ones."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest

from rotfem.mechanics.differentiation import CELL, Derivative

Function = Callable[[float], float]


def largest_error(derivative: Derivative, exact: Function, times: np.ndarray) -> float:
    """Return the largest error at times (s), relative to the largest exact value."""
    wanted = np.array([exact(float(t)) for t in times])
    found = np.array([derivative(float(t)) for t in times])
    return float(np.abs(found - wanted).max() / (np.abs(wanted).max() or 1.0))


@pytest.mark.parametrize("amplitude", [1e-1, 1e-6])
@pytest.mark.parametrize("hertz", [5.0, 50.0, 500.0, 2000.0, 20000.0])
def test_ripple_of_any_frequency(hertz: float, amplitude: float) -> None:
    """A ripple a sin ωt beside a mean of 5, whose round-off is η = 5ε/a of it: with truncation (ωh)⁶ and (ωh)⁵ and
    round-off η/ωh and η/(ωh)² the best step leaves η^(6/7) and η^(5/7); 10 and 100 times that are allowed.
    """
    eta = 5 * 2.2e-16 / amplitude
    omega, times = 2 * pi * hertz, np.arange(0.0, 4 / hertz, 1 / (37.7 * hertz))

    def ripple(t: float) -> float:
        return 5.0 + amplitude * sin(omega * t)

    first, second = (Derivative(ripple, order, cell=4 / hertz) for order in (1, 2))
    assert largest_error(first, lambda t: amplitude * omega * cos(omega * t), times) < 10 * eta ** (6 / 7)
    assert largest_error(second, lambda t: -amplitude * omega**2 * sin(omega * t), times) < 100 * eta ** (5 / 7)
    unknowing = Derivative(ripple)  # of the time grid
    assert largest_error(unknowing, lambda t: amplitude * omega * cos(omega * t), times) < 1e-6


def test_nothing_reaches_over_a_breakpoint() -> None:
    """|t − 1| has the slope of the piece that starts at 1, and of the one before just before it."""
    corner = Derivative(lambda t: 5 * abs(t - 1.0), breakpoints=(1.0,))
    times = np.array([0.3, np.nextafter(1.0, 0.0), 1.0, 1.0 + 1e-9, 1.7])
    assert largest_error(corner, lambda t: 5.0 if t >= 1.0 else -5.0, times) < 1e-9


def test_a_burst_between_the_points_of_a_cell_is_seen() -> None:
    """A bump of a hundredth of a cell, (1 − s²)⁴ with s from its middle, is resolved where it is asked for."""
    middle, width = 0.55 * CELL, 0.01 * CELL

    def bump(t: float) -> float:
        s = (t - middle) / width
        return t + (1 - s * s) ** 4 * (abs(s) < 1)

    def slope(t: float) -> float:
        s = (t - middle) / width
        return 1.0 - 8 * s * (1 - s * s) ** 3 / width * (abs(s) < 1)

    assert largest_error(Derivative(bump), slope, np.linspace(0.0, CELL, 401)[:-1]) < 1e-4
