"""Masses along a beam against the exact frequency equation, by transfer matrices, and against the mass at the tip."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem

L, EI, GA, EA, RHO = 10.0, 1.4e4, 1.0e7, 2.8e7, 1.2
PLANAR = {"type": "planar_beam", "length": L, "section": {"EA": EA, "GA": GA, "EI": EI, "mass_per_length": RHO}}
SPATIAL_SECTION = {"EA": EA, "GA2": GA, "GA3": GA, "GJ": 1e4, "EI2": EI, "EI3": 2 * EI, "mass_per_length": RHO}
SPATIAL = {"type": "spatial_beam", "length": L, "section": SPATIAL_SECTION}
STILL = {"type": "constant", "speed": 0.0}


#: (x, mass, inertia, arm) of a body ahead along the beam ↦ frequencies of a Timoshenko cantilever, by transfer
#: matrices: Q grows by −m ω² (w + arm ψ) over it, and M by −ω² ((J + m arm²) ψ + m arm w).
FREQUENCIES = {
    (3.7, 4.0, 0.0, 0.0): [3.698745355, 19.05748281, 57.8921965],
    (6.1, 2.0, 1.5, 0.4): [3.477886811, 22.08514815, 58.44006855],
}


@pytest.mark.parametrize("given", FREQUENCIES, ids=str)
def test_exact_frequency_equation(given: tuple[float, float, float, float]) -> None:
    """The first three frequencies, 16 elements of degree 3: their error is below 1e-6."""
    x, mass, inertia, arm = given
    body = {"x": x, "mass": mass, "inertia": inertia, "offset": [arm, 0.0]}
    tables = {"structure": {**PLANAR, "masses": [body]}, "motion": STILL, "modes": {"count": 4}}
    found = rotfem.modes({**tables, "model": {"theory": "linear"}})
    bending = [row["frequency"] for row in found.rows if row["label"].endswith("edgewise")][:3]
    np.testing.assert_allclose(bending, FREQUENCIES[given], rtol=1e-6)


def test_the_spatial_beam_has_the_same_in_its_plane() -> None:
    """In flap, EI₂ about axis 2, with the tensor of the body."""
    inertia = [[0.3, 0, 0], [0, 1.5, 0], [0, 0, 0.7]]
    body = {"x": 6.1, "mass": 2.0, "inertia": inertia, "offset": [0.4, 0.0, 0.0]}
    tables = {"structure": {**SPATIAL, "masses": [body]}, "motion": STILL}
    found = rotfem.modes({**tables, "model": {"theory": "linear"}, "modes": {"count": 6}})
    flap = [row["frequency"] for row in found.rows if row["label"].endswith("flapwise")][:2]
    np.testing.assert_allclose(flap, FREQUENCIES[6.1, 2.0, 1.5, 0.4][:2], rtol=1e-6)


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
