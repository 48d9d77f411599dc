"""Loads over the span and at points of it: closed forms, and every way to say one load against the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem

L, EI, GA, EA, RHO = 10.0, 1.4e4, 1.0e7, 2.8e7, 1.2
SECTION = {"EA": EA, "GA": GA, "EI": EI, "mass_per_length": RHO}
BEAM = {"type": "planar_beam", "length": L, "section": SECTION}
STILL, SPIN = {"type": "constant", "speed": 0.0}, {"type": "constant", "speed": 3.0}
Q = 3.0
TRIANGLE = [[0, 0, 0], [L, 0, Q]]
TIME = {"end": 0.4, "step": 0.01}
TIMES = np.linspace(0.0, 0.4, 401).tolist()


def computed(loads: Any, theory: str = "reissner", motion: Any = STILL, **more: Any) -> Any:
    """Return the result of the beam under loads."""
    tables = {"structure": BEAM, "motion": motion, "mesh": {"elements": 4}, "model": {"theory": theory}}
    return rotfem.run({**tables, "output": {"error": False}, "loads": loads, **more})


def test_triangle_at_rest() -> None:
    """u₂(L) = 11 q L⁴/120 EI + q L²/3 GA, exact in elements of degree 3 but for round-off."""
    exact = 11 * Q * L**4 / (120 * EI) + Q * L**2 / (3 * GA)
    assert computed({"distributed": {"over_span": TRIANGLE}}, "linear").tip["u2"][0] == pytest.approx(exact, rel=1e-9)


def test_more_stations_than_elements() -> None:
    """u₂(L) = ∫ q (x² (3L − x)/6EI + x/GA) dx: the work of dead loads is exact however few elements there are."""
    x = np.linspace(0.0, L, 41)
    q = Q * (1.0 + x / L + np.sin(7.0 * np.arange(41)))
    points, w = np.polynomial.legendre.leggauss(3)
    at = ((x[:-1] + x[1:]) / 2)[:, None] + np.diff(x)[:, None] / 2 * points
    influence = at**2 * (3 * L - at) / (6 * EI) + at / GA
    exact = np.sum(np.diff(x)[:, None] / 2 * w * np.interp(at, x, q) * influence)
    rows = [[a, 0.0, b] for a, b in zip(x.tolist(), q.tolist(), strict=True)]
    few = computed({"distributed": {"over_span": rows}}, "linear", mesh={"elements": 3})
    assert few.summary["dofs"] == 3 * 10
    assert few.tip["u2"][0] == pytest.approx(exact, rel=1e-9)


def test_triangle_spinning() -> None:
    """The equations of the consistent linear theory (docs/theory.md, the second-order family), by collocation to 1e-10.

    With N⁰ = ½ ρ Ω² (L² − x²): (GA (u' − α) + N⁰ α)' + ρ Ω² u + q x/L = 0, EI α'' + (GA − N⁰) (u' − α) = 0.
    """
    steady = computed({"distributed": {"over_span": TRIANGLE}}, "consistent_linear", SPIN)
    # 4 elements of degree 3: error of the mesh 1e-7 here
    assert steady.tip["u2"][0] == pytest.approx(0.1748499884, rel=1e-6)


def test_force_and_moment_inside() -> None:
    """u₂(L) = F a² (3L − a)/6EI + F a/GA + M a (2L − a)/2EI: the place becomes a node, so it is exact."""
    a, F, M = 3.7, 5.0, 2.0
    exact = F * a**2 * (3 * L - a) / (6 * EI) + F * a / GA + M * a * (2 * L - a) / (2 * EI)
    done = computed({"at": [{"x": a, "force": [0, F], "moment": M}]}, "linear")
    assert done.tip["u2"][0] == pytest.approx(exact, rel=1e-9)


def test_a_jump_is_two_loads() -> None:
    """A load on a part of the span is the difference of two; linear, so exactly."""

    def tip(rows: Any) -> float:
        return float(computed({"distributed": {"over_span": rows}}, "linear").tip["u2"][0])

    part = tip([[2.0, 0, 1.0], [6.0, 0, 2.0]])
    rest = tip([[0, 0, 0], [2.0, 0, 0], [2.0, 0, 1.0], [6.0, 0, 2.0], [6.0, 0, 0], [L, 0, 0]])
    exact = sum(w * (1 + (x - 2) / 4) * x**2 * (3 * L - x) / (6 * EI) for x, w in gauss(2.0, 6.0))
    exact += sum(w * (1 + (x - 2) / 4) * x / GA for x, w in gauss(2.0, 6.0))
    assert part == pytest.approx(rest, rel=1e-10)
    assert part == pytest.approx(exact, rel=1e-9)


def gauss(a: float, b: float) -> Any:
    """Return Gauss points and weights on [a, b], exact to the seventh degree."""
    x, w = np.polynomial.legendre.leggauss(4)
    return zip(0.5 * (a + b) + 0.5 * (b - a) * x, 0.5 * (b - a) * w, strict=True)


#: Loads that are the same, said in different ways.
SAME: dict[str, list[Any]] = {
    "over the span": [
        {"over_span": TRIANGLE},
        {"over_span": [[0, 0, 0], [5, 0, Q / 2], [L, 0, Q]]},
        {"over_span": lambda x: (0.0, Q * x / L)},
        {"over_span_and_time": [[x, t, 0, Q * x / L] for x in (0, L) for t in (0, 1)]},
        lambda x, t: (0.0, Q * x / L),
    ],
    "harmonic": [
        {"harmonic": {"amplitude": TRIANGLE, "frequency": 6.0, "phase": 0.3}, "value": [0.0, 1.0]},
        {"harmonic": {"amplitude": TRIANGLE, "per_rev": 2, "phase": 0.3}, "value": [0.0, 1.0]},
        lambda x, t: (0.0, 1.0 + Q * x / L * np.cos(6.0 * t + 0.3)),
    ],
    "ramp": [
        {"over_span_and_time": [[x, t, 0, Q * x / L * min(t, 0.123)] for x in (0, L) for t in (0, 0.123, 1)]},
        lambda x, t: (0.0, Q * x / L * min(t, 0.123)),
    ],
}


@pytest.mark.parametrize(("case", "theory"), [(case, "reissner") for case in SAME])
def test_one_load_in_many_ways(case: str, theory: str) -> None:
    """Meshes and shapes differ, not what is computed, to the convergence of Newton and the error of the mesh.

    A function has no knots that are known, so its kinks are met to the order of the step.
    """
    tips = [computed({"distributed": load}, theory, SPIN, time=TIME).history["tip_u2"] for load in SAME[case]]
    size = np.abs(tips[0]).max()
    allowed = 1e-3 if case == "ramp" else 1e-7
    for tip in tips[1:]:
        np.testing.assert_allclose(tip, tips[0], rtol=0, atol=allowed * size)


def test_a_gust_is_one_minus_cosine() -> None:
    """It is the function ½ a (1 − cos 2π(t − t₀)/T) of its parameters, added to what else there is."""
    start, duration = 0.1, 0.2

    def gust(t: float) -> list[float]:
        part = min(max((t - start) / duration, 0.0), 1.0)
        return [0.0, 4.0 + 10.0 * (1.0 - np.cos(2 * np.pi * part))]

    said = {"value": [0, 4], "gust": {"amplitude": [0, "20 N"], "duration": "200 ms", "start": start}}
    one, other = (computed({"tip_force": load}, time=TIME) for load in (said, gust))
    np.testing.assert_allclose(one.tip["u2"], other.tip["u2"], atol=1e-9 * np.max(np.abs(other.tip["u2"])))
    spread = {"gust": {"amplitude": [[0, 0, 0], [L, 0, Q]], "duration": duration}}
    there = computed({"distributed": spread}, "linear", time=TIME)
    table = [[t, *(0.5 * (1 - np.cos(2 * np.pi * min(t / duration, 1.0))) * np.array([0, Q]))] for t in TIMES]
    rows = [[x, t, a * x / L, b * x / L] for x in (0.0, L) for t, a, b in table]
    by_rows = computed({"distributed": {"over_span_and_time": rows}}, "linear", time=TIME)
    np.testing.assert_allclose(there.tip["u2"], by_rows.tip["u2"], atol=1e-4 * np.max(np.abs(by_rows.tip["u2"])))


def test_places_of_a_table_have_times_of_their_own() -> None:
    """What is linear between the times of a place, and constant outside, is the table with all times at all places."""
    few = [[0, 0, 0, 0], [0, 0.4, 0, 8], [5, 0.1, 0, 1], [5, 0.2, 0, 3], [L, 0.3, 0, 2]]
    at = {0.0: lambda t: 20 * t, 5.0: lambda t: 1 + 20 * min(max(t - 0.1, 0.0), 0.1), L: lambda t: 2.0}
    times = (0.0, 0.1, 0.2, 0.3, 0.4)
    all_of_them = [[x, t, 0.0, f(t)] for x, f in at.items() for t in times]
    one, other = (computed({"distributed": {"over_span_and_time": r}}, "linear", time=TIME) for r in (few, all_of_them))
    np.testing.assert_allclose(one.tip["u2"], other.tip["u2"], rtol=1e-10, atol=1e-12)
