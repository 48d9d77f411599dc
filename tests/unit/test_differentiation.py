"""Derivatives of functions of time that are known by their values alone, against exact ones."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest

from rotfem.mechanics.differentiation import CELL, Derivative, weights

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


@pytest.mark.parametrize("late", [0.0, 1e4])
def test_slow_function(late: float) -> None:
    """A function of order one: round-off of the time itself is ε t a second."""
    times = late + np.arange(0.0, 2.0, 0.01)
    assert largest_error(Derivative(sin), cos, times) < 1e-9
    assert largest_error(Derivative(sin, 2), lambda t: -sin(t), times) < 1e-8


def test_values_of_few_digits() -> None:
    """Single precision, ε = 6e-8: a step of 0.1 s leaves ε/h and ε/h² times the sum of the weights, 30."""
    function = (
        Derivative(lambda t: float(np.float32(5 * sin(t)))),
        Derivative(lambda t: float(np.float32(5 * sin(t))), 2),
    )
    times = np.arange(0.0, 2.0, 0.01)
    assert largest_error(function[0], lambda t: 5 * cos(t), times) < 30 * 6e-8 / CELL
    assert largest_error(function[1], lambda t: -5 * sin(t), times) < 30 * 6e-8 / CELL**2


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


def test_what_does_not_change_has_none() -> None:
    assert {Derivative(lambda t: 3.7, order)(t) for order in (1, 2) for t in (0.0, 1.3)} == {0.0}


@pytest.mark.parametrize("place", [0.0, -1.0, 0.3])
@pytest.mark.parametrize("order", [1, 2])
def test_weights_are_exact_for_polynomials(order: int, place: float) -> None:
    """Of degree six at most with seven points, of four with the inner five."""
    w, inner, _, _ = weights(order, place)
    nodes = np.array([0.0, -1, 1, -1, 1, -1, 1]) * np.repeat(
        [0.0, 0.381966011250105, 0.618033988749895, 1.0], [1, 2, 2, 2]
    )
    for n, those in ((7, w), (5, inner)):
        p = np.polynomial.Polynomial(np.arange(1.0, n + 1))
        assert those @ p(nodes[:n]) == pytest.approx(p.deriv(order)(place), rel=1e-10)
