"""The time grid: jumps of functions, legs from knot to knot, and straight lines over what is denser."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rotfem import SceneError, run
from rotfem.analysis.time_grid import find_knots
from rotfem.mechanics.time_signals import TimeSignal
from tests.beams import STRUCTURE

TIMES = np.linspace(0.0, 2.0, 201)


def searched(f: Any) -> TimeSignal:
    signal = TimeSignal("loads.tip_force", f, np.empty(0), known=False)
    find_knots(signal, TIMES)
    return signal


@pytest.mark.parametrize("at", [0.5033, 1.0 / 3.0, 1.25])
def test_a_jump_is_found_to_round_off(at: float) -> None:
    """Halving goes on until two neighbouring numbers are left, one on each side."""
    signal = searched(lambda t: 3.0 if t >= at else -1.0)
    assert len(signal.knots) == 1
    assert signal.knots[0] == pytest.approx(at, rel=4e-16)


@pytest.mark.parametrize("f", [lambda t: np.sin(7 * t), lambda t: abs(t - 0.5033), lambda t: np.sqrt(t), lambda t: 2.0])
def test_what_is_continuous_has_no_knots(f: Any) -> None:
    assert len(searched(f).knots) == 0


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("knots", [[0.3, 0.41, 0.7], [], [0.2, 0.2 + 1e-12, 0.9]])
def test_a_fit_has_the_moments_of_its_signal(knots: list[float], degree: int) -> None:
    """∫ tᵏ f over the step up to the degree, of parabolas that jump at knots; a polynomial is its own fit."""

    def f(t: float) -> float:
        piece = float(np.searchsorted(knots, t))
        return piece**2 - 3.0 * piece + (piece + 1.0) * t * t

    begin, end = 0.1, 1.0
    edges, x, w = [begin, *knots, end], *np.polynomial.legendre.leggauss(5)
    exact, seen = np.zeros(2), np.zeros(2)
    signal = TimeSignal("a", f, np.array(knots))
    for a, b in pairwise(edges):
        s = (a + b) / 2 + (b - a) / 2 * x
        powers = (b - a) / 2 * w * s ** np.arange(2)[:, None]
        exact += powers @ np.array([f(t) for t in s])
        seen += powers @ signal.fitted(s, begin, end, degree)[:, 0]
    np.testing.assert_allclose(seen, exact, rtol=1e-12)
    if degree == 3:
        ends = np.array([begin, end])
        np.testing.assert_allclose(signal.fitted(ends, begin, end, degree)[:, 0], [f(begin), f(end)], rtol=1e-9)
    own = TimeSignal("b", lambda t: 2.0 - 3.0 * t**degree, np.array(knots))
    assert own.fitted(np.array([0.33]), begin, end, degree)[0, 0] == pytest.approx(2.0 - 3.0 * 0.33**degree, rel=1e-12)


def beam(**tables: Any) -> Any:
    still = {"motion": {"type": "constant", "speed": 0.0}}
    time = {"time": {"end": 1.0, "step": 0.01}}
    return run({"structure": STRUCTURE, "mesh": {"elements": 4}, **time, **still, **tables})


def test_a_blow_of_a_function_is_that_of_its_table() -> None:
    """2 ms between two steps; the table's flanks of 0.1 ns are all the two differ in."""
    rows = [[0, 0, 0], [0.5033, 0, 0], [0.5033000001, 0, 200.0], [0.5053, 0, 200.0], [0.5053000001, 0, 0], [9, 0, 0]]
    table = beam(loads={"tip_force": rows})
    function = {"tip_force": lambda t: [0.0, 200.0 if 0.5033 < t < 0.5053 else 0.0]}
    known = {"time": {"end": 1.0, "step": 0.01, "breakpoints": [0.5033, 0.5053]}}
    u2 = table.history["tip_u2"]
    assert np.abs(u2).max() > 0.01
    np.testing.assert_allclose(
        beam(loads=function, **known).history["tip_u2"], u2, rtol=0, atol=1e-3 * np.abs(u2).max()
    )


def test_a_speed_that_jumps_is_refused() -> None:
    with pytest.raises(SceneError, match=r"motion\.speed: jumps at t = 0\.5033 s"):
        beam(motion={"type": "callable", "speed": lambda t: 1.0 if t > 0.5033 else 0.0})
