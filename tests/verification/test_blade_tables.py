"""Modes in the forms of other programs: polynomials and tables over the span, modal and effective masses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from rotfem import SceneError, modes
from rotfem.results.modes import POWERS, elastodyn_lines, fit
from tests.beams import STRUCTURE

#: At rest modes are the real ones of a cantilever; r/L = 2e-3, so that Euler and Bernoulli's values hold to 1e-3.
SCENE = {
    "structure": STRUCTURE,
    "motion": {"type": "constant", "speed": 0.0},
    "model": {"theory": "consistent_linear"},
    "mesh": {"elements": 8},
    "modes": {"count": 3},
}
MASS = STRUCTURE["section"]["mass_per_length"] * STRUCTURE["length"]


@pytest.fixture(scope="module")
def cantilever():
    return modes(SCENE, blade_tables=True, participation=True)


def bending_shape(number, x):
    """Return the mode of a clamped-free Euler–Bernoulli beam, 1 at the tip (Blevins 1979, table 8-1)."""
    k = brentq(lambda k: np.cos(k) + 1 / np.cosh(k), (number - 1) * np.pi, number * np.pi)
    sigma = (np.sinh(k) - np.sin(k)) / (np.cosh(k) + np.cos(k))
    shape = np.cosh(k * x) - np.cos(k * x) - sigma * (np.sinh(k * x) - np.sin(k * x))
    at_tip = np.cosh(k) - np.cos(k) - sigma * (np.sinh(k) - np.sin(k))
    return shape / at_tip


def test_fit_finds_the_polynomial_that_is_there():
    wanted = np.array([3.0, -4.0, 2.5, -1.0, 0.5])
    x = np.linspace(0.0, 1.0, 12)
    found, off = fit(x, (x[:, None] ** np.array(POWERS)) @ wanted)
    assert found == pytest.approx(wanted, abs=1e-10)
    assert np.max(np.abs(off)) < 1e-13


def test_polynomials_are_the_shapes_of_a_cantilever(cantilever):
    """Between the nodes too a polynomial is the shape, to the error that it says and that of the slender limit."""
    rows = cantilever.mode_polynomials()
    assert [(row["direction"], row["number"]) for row in rows] == [("lag", 1), ("lag", 2), ("lag", 3)]
    x = np.linspace(0.0, 1.0, 101)
    for row in rows:
        c = np.array([row[f"c{k}"] for k in POWERS])
        assert c.sum() == pytest.approx(1.0, abs=1e-12)
        off = np.max(np.abs((x[:, None] ** np.array(POWERS)) @ c - bending_shape(row["number"], x)))
        assert off <= 1.5 * row["fit_error"] + 1e-3
    assert rows[0]["fit_error"] < 1e-4 < 1e-2 < rows[2]["fit_error"] < 0.1


def test_torsion_has_a_polynomial_of_its_twist():
    """It is sin((2n − 1)πξ/2), from the first power on; shapes that no polynomial comes near are named, not written."""
    section = {"EA": 1e9, "GA2": 3e8, "GA3": 3e8, "GJ": 5e6, "EI2": 2e7, "EI3": 1e8, "mass_per_length": 100.0}
    section |= {"rotary_inertia2": 2.0, "rotary_inertia3": 10.0}
    structure = {"type": "spatial_beam", "length": 30.0, "section": section}
    result = modes({"structure": structure, "motion": SCENE["motion"], "modes": {"count": 10}}, blade_tables=True)
    rows, x = result.mode_polynomials(), np.linspace(0.0, 1.0, 101)
    twists = [row for row in rows if row["direction"] == "twist"]
    assert [row["label"] for row in twists] == ["1st torsion", "2nd torsion"]
    for n, row in enumerate(twists, start=1):
        found = sum(row[f"c{k}"] * x**k for k in range(1, 7))
        assert found == pytest.approx(np.sin((n - 0.5) * np.pi * x) * (-1) ** (n + 1), abs=3e-3)
    assert max(row["fit_error"] for row in rows) <= 0.1
    table = [row["twist"] for row in result.mode_table() if row["mode"] == twists[0]["mode"]]
    assert np.max(np.abs(table)) == pytest.approx(1 / 30.0)
    assert any("no mode polynomial of 4th flapwise, 5th flapwise" in text for text in result.summary["warnings"])


def test_table_over_the_span(cantilever):
    """The slope of the table is the derivative of its displacement, to shear (1e-4 here) and differences."""
    first = [row for row in cantilever.mode_table() if row["mode"] == 1]
    x = STRUCTURE["length"] * np.array([row["span"] for row in first])
    shape = np.array([row["lag_displacement"] for row in first])
    slope = np.array([row["lag_slope"] for row in first])
    assert shape[-1] == pytest.approx(1.0)
    assert slope == pytest.approx(np.gradient(shape, x, edge_order=2), abs=2e-2 * slope[-1])
    assert not any(name.startswith("flap") or name == "twist" for name in first[0])


def test_files_are_written(cantilever, tmp_path):
    names = {path.name for path in cantilever.write(tmp_path)}
    assert {"mode_table.csv", "mode_polynomials.csv", "elastodyn_modes.dat"} <= names
    lines = (tmp_path / "elastodyn_modes.dat").read_text().splitlines()
    assert [line.split()[1] for line in lines] == [f"BldEdgSh({k})" for k in POWERS]
    assert sum(float(line.split()[0]) for line in lines) == pytest.approx(1.0, abs=1e-9)
    assert elastodyn_lines([]) == "\n"


def test_effective_masses(cantilever):
    """0.6131, 0.1883 and 0.0647 of the mass move in the first modes, and 1/4 is the modal mass (Blevins, table 8-1)."""
    assert cantilever.summary["mass"] == {
        "effective_mass_1": pytest.approx(MASS, rel=1e-12),
        "effective_mass_2": pytest.approx(MASS, rel=1e-12),
    }
    shares = [row["effective_mass_2"] / MASS for row in cantilever.rows]
    assert shares == pytest.approx([0.6131, 0.1883, 0.0647], abs=2e-4)
    assert cantilever.rows[0]["modal_mass"] == pytest.approx(MASS / 4, rel=1e-3)
    assert all(row["effective_mass_1"] < 1e-12 * MASS for row in cantilever.rows)


def test_plates_have_no_tables():
    plate = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    with pytest.raises(SceneError, match="those of beams"):
        modes({"structure": plate, "motion": {"type": "constant", "speed": 0.0}}, blade_tables=True)
