"""Masses along a beam against the exact frequency equation, by transfer matrices, and against the mass at the tip."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import rotfem

L, EI, GA, EA, RHO = 10.0, 1.4e4, 1.0e7, 2.8e7, 1.2
PLANAR = {"type": "planar_beam", "length": L, "section": {"EA": EA, "GA": GA, "EI": EI, "mass_per_length": RHO}}
SPATIAL_SECTION = {"EA": EA, "GA2": GA, "GA3": GA, "GJ": 1e4, "EI2": EI, "EI3": 2 * EI, "mass_per_length": RHO}
SPATIAL = {"type": "spatial_beam", "length": L, "section": SPATIAL_SECTION}
STILL = {"type": "constant", "speed": 0.0}


def field(omega: float, length: float) -> Any:
    """Return what (w, ψ, M, Q) becomes over a length of a Timoshenko beam, w' = ψ + Q/GA, Q' = −ρA ω² w."""
    A = np.array([[0, 1, 0, 1 / GA], [0, 0, 1 / EI, 0], [0, 0, 0, -1], [-RHO * omega**2, 0, 0, 0]], dtype=float)
    return expm(length * A)


def jump(omega: float, mass: float, inertia: float, arm: float) -> Any:
    """Return what (w, ψ, M, Q) becomes over a body whose center is an arm ahead along the beam.

    Its center moves by w + arm ψ, so Q grows by −m ω² (w + arm ψ) and M by −ω² ((J + m arm²) ψ + m arm w).
    """
    P = np.eye(4)
    P[3, :2] -= mass * omega**2 * np.array([1.0, arm])
    P[2, :2] -= omega**2 * np.array([mass * arm, inertia + mass * arm**2])
    return P


def frequencies(count: int, x: float, body: tuple[float, float, float]) -> list[float]:
    """Return the first roots of the frequency equation of a cantilever with a body at x."""

    def determinant(omega: float) -> float:
        T = field(omega, L - x) @ jump(omega, *body) @ field(omega, x)
        return float(np.linalg.det(T[2:, 2:]))

    grid = np.linspace(0.05, 200.0, 4000)
    values = [determinant(w) for w in grid]
    brackets = [(a, b) for a, b, f, g in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True) if f * g < 0]
    return [brentq(determinant, a, b, xtol=1e-13) for a, b in brackets[:count]]


@pytest.mark.parametrize(("x", "mass", "inertia", "arm"), [(3.7, 4.0, 0.0, 0.0), (6.1, 2.0, 1.5, 0.4)])
def test_exact_frequency_equation(x: float, mass: float, inertia: float, arm: float) -> None:
    """The first three frequencies, 16 elements of degree 3: their error is below 1e-6."""
    body = {"x": x, "mass": mass, "inertia": inertia, "offset": [arm, 0.0]}
    tables = {"structure": {**PLANAR, "masses": [body]}, "motion": STILL, "modes": {"count": 4}}
    found = rotfem.modes({**tables, "model": {"theory": "linear"}})
    bending = [row["frequency"] for row in found.rows if row["label"].endswith("edgewise")][:3]
    np.testing.assert_allclose(bending, frequencies(3, x, (mass, inertia, arm)), rtol=1e-6)


def test_the_spatial_beam_has_the_same_in_its_plane() -> None:
    """In flap, EI₂ about axis 2, with the tensor of the body."""
    inertia = [[0.3, 0, 0], [0, 1.5, 0], [0, 0, 0.7]]
    body = {"x": 6.1, "mass": 2.0, "inertia": inertia, "offset": [0.4, 0.0, 0.0]}
    tables = {"structure": {**SPATIAL, "masses": [body]}, "motion": STILL}
    found = rotfem.modes({**tables, "model": {"theory": "linear"}, "modes": {"count": 6}})
    flap = [row["frequency"] for row in found.rows if row["label"].endswith("flapwise")][:2]
    np.testing.assert_allclose(flap, frequencies(2, 6.1, (2.0, 1.5, 0.4)), rtol=1e-6)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_a_mass_at_the_end_is_the_tip_mass(theory: str) -> None:
    """Spinning, with everything that a mass feels: centrifugal, Coriolis, its part of the prestress."""
    common = {"motion": {"type": "constant", "speed": 4.0}, "mesh": {"elements": 4}, "model": {"theory": theory}}
    tip = rotfem.modes({**common, "structure": {**PLANAR, "tip_mass": 2.0, "tip_inertia": 0.3}})
    masses = [{"x": L, "mass": 2.0, "inertia": 0.3}]
    end = rotfem.modes({**common, "structure": {**PLANAR, "masses": masses}})
    np.testing.assert_allclose(end.frequencies, tip.frequencies, rtol=1e-10)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"x": 11.0, "mass": 1.0}, "from 0 to the length"),
        ({"mass": 1.0}, "required"),
        ({"x": 1.0}, "mass, inertia, or both"),
        ({"x": 1.0, "mass": -1.0}, "at least 0"),
        ({"x": 1.0, "mass": 1.0, "offset": [0, 0, 1]}, "third component"),
        ({"x": 1.0, "inertia": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "about axis 3"),
    ],
)
def test_masses_that_are_refused(body: dict[str, Any], words: str) -> None:
    with pytest.raises(rotfem.SceneError, match=r"structure.masses.0") as caught:
        rotfem.Scene.from_dict({"structure": {**PLANAR, "masses": [body]}, "motion": STILL})
    assert words in str(caught.value)


def test_places_are_at_the_tip_but_for_round_off() -> None:
    """As 0.1 + 0.2 is 0.3: stations of a beam, and a mass of a plate, which has its moment about the root."""
    near = L * (1 + 1e-12)
    beam = {"structure": PLANAR, "motion": STILL, "loads": {"tip_force": [0.0, 2.0]}, "model": {"theory": "linear"}}
    stations = rotfem.run({**beam, "output": {"stations": [0.0, near], "error": False}}).stations
    assert stations is not None
    np.testing.assert_allclose(stations["Q"], 2.0, rtol=1e-7)
    plate = {"type": "plate", "length": L, "width": 1.0, "thickness": 0.1, "E": 7e10, "nu": 0.3, "rho": 1.0}
    there = rotfem.check({"structure": {**plate, "point_masses": [[near, 0.5, 3.0]]}, "motion": STILL})
    assert there.summary["mass"] == pytest.approx(0.1 * L + 3.0)
