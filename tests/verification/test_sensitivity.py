"""Derivatives of eigenvalues from known vectors against differences of eigenvalues, and what is known exactly."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import Scene, modes
from rotfem.analysis.modal import ModalAnalysis
from rotfem.commands.problem import Problem

Array = npt.NDArray[Any]

SECTION = {"EA": 400.0, "GA": 130.0, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 0.0025}

#: Damped, with a follower force that bends the beam in its steady state: nothing is symmetric and all terms of the
#: formula count. Few elements, so that round-off stays below the differences.
SCENE: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 1.0,
        "hub_radius": 0.5,
        "tip_mass": 0.2,
        "damping": {"kelvin_voigt": 1e-3},
        "section": SECTION,
    },
    "motion": {"type": "constant", "speed": 4.0},
    "loads": {"tip_force": {"value": [0.1, 0.4], "kind": "follower"}},
    "modes": {"count": 3},
    "mesh": {"elements": 4, "degree": 3},
    "solver": {"increment_tolerance": 1e-12},
}


def eigenvalues(scene: Scene, speed: float) -> Array:
    return ModalAnalysis(Problem.of(scene)).at(speed, 3).pairs.values[:3]


def key(parameter: str) -> str:
    return f"structure.section.{parameter}" if parameter in SECTION else f"structure.{parameter}"


def difference(scene: Scene, parameter: str, value: float) -> Array:
    """Return dλ/dp by central differences; their error is about 1e-8, as is that of round-off."""
    h, pair = 1e-4 * value, []
    for p in (value + h, value - h):
        changed = scene if parameter == "speed" else scene.replace({key(parameter): p})
        pair.append(eigenvalues(changed, p if parameter == "speed" else scene.motion.speed))
    return (pair[0] - pair[1]) / (2 * h)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_against_differences(theory: str) -> None:
    """All parameters of the scene, three modes. Where p/λ dλ/dp is small, the noise of the differences is the limit."""
    scene = Scene.from_dict(SCENE).replace({"model.theory": theory})
    result = modes(scene, sensitivities=True)
    values = result.spinning.pairs.values
    parameters = list(dict.fromkeys(row["parameter"] for row in result.sensitivities))
    assert parameters == [*SECTION, "hub_radius", "tip_mass", "speed"]
    worst = 0.0
    for parameter in parameters:
        rows = [row for row in result.sensitivities if row["parameter"] == parameter]
        slopes = np.array([row["dgrowth"] + 1j * row["dfrequency"] for row in rows])
        value = rows[0]["value"]
        expected = difference(scene, parameter, value)
        error = np.abs(slopes - expected)
        # Eigenvalues are good to about 1e-13, differences of them to 1e-13/1e-4.
        noise = 2e-9 * np.abs(values) / value
        assert np.all(error < 1e-6 * np.abs(expected) + noise), (parameter, error / np.abs(expected))
        clear = np.abs(value * expected) > 1e-2 * np.abs(values)
        worst = max(worst, float(np.max(error[clear] / np.abs(expected[clear]), initial=0.0)))
        for row, lam in zip(rows, values, strict=True):
            assert row["relative"] == pytest.approx(value * row["dfrequency"] / lam.imag, rel=1e-12)
    print(f"F {theory}: {worst:.1e}")
    assert worst < 1e-6


def test_scaling_laws(tmp_path: Path) -> None:
    """At rest ω² is of degree 1 in (EA, GA, EI) and −1 in (A_rho, I_rho): the relative derivatives add up to ±½."""
    plain = {"structure.damping": {}, "structure.tip_mass": 0.0, "loads": {}, "motion.speed": 0.0}
    result = modes(Scene.from_dict(SCENE).replace(plain | {"model.theory": "linear"}), sensitivities=True)
    for mode in (1, 2, 3):
        relative = {row["parameter"]: row["relative"] for row in result.sensitivities if row["mode"] == mode}
        assert relative["EA"] + relative["GA"] + relative["EI"] == pytest.approx(0.5, rel=1e-8)
        assert relative["mass_per_length"] + relative["rotary_inertia"] == pytest.approx(-0.5, rel=1e-8)
        assert abs(relative["hub_radius"]) < 1e-12
    result.write(tmp_path)
    with (tmp_path / "sensitivities.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["dfrequency"]) for row in rows] == [row["dfrequency"] for row in result.sensitivities]


def test_taper_counts_as_a_factor() -> None:
    """A property that varies along the beam: the derivative is that of a common factor, whose value is 1."""
    taper = {"structure.section.EI": [[0.0, 1.0], [1.0, 0.5]], "structure.section.EA": [[0.0, 400.0], [1.0, 200.0]]}
    scene = Scene.from_dict(SCENE).replace(taper | {"model.theory": "consistent_linear", "loads": {}})
    result = modes(scene, sensitivities=True)
    (row,) = [r for r in result.sensitivities if r["mode"] == 1 and r["parameter"] == "EI"]
    assert row["value"] == 1.0
    h, pair = 1e-4, []
    for factor in (1 + h, 1 - h):
        scaled = {"structure.section.EI": [[0.0, factor], [1.0, 0.5 * factor]]}
        pair.append(eigenvalues(scene.replace(scaled), 4.0)[0])
    assert row["dfrequency"] == pytest.approx((pair[0] - pair[1]).imag / (2 * h), rel=1e-6)


def test_pairs_of_one_frequency() -> None:
    """A round beam: 0.6131, 0.1883, 0.0647 of its mass along each axis (Young & Felgar 1949), dω/dEI = ω/2 and 0."""
    section = {"EA": 1e8, "GA2": 32690421.7, "GA3": 32690421.7, "GJ": 0.77, "EI2": 1.0, "EI3": 1.0}
    section |= {"mass_per_length": 1.0, "rotary_inertia2": 1e-8, "rotary_inertia3": 1e-8}
    scene = {"structure": {"type": "spatial_beam", "length": 1.0, "section": section}, "modes": {"count": 6}}
    found = modes(scene | {"motion": {"type": "constant", "speed": 0.0}}, sensitivities=True, participation=True)
    masses = np.array([[row[f"effective_mass_{i}"] for i in (2, 3)] for row in found.rows])
    expected = np.kron([[0.6131], [0.1883], [0.0647]], np.eye(2))
    np.testing.assert_allclose(masses, expected, atol=1e-4)
    slopes = {name: [r["dfrequency"] for r in found.sensitivities if r["parameter"] == name] for name in ("EI2", "EI3")}
    halves = found.frequencies / 2
    np.testing.assert_allclose(slopes["EI3"], halves * [1, 0, 1, 0, 1, 0], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(slopes["EI2"], halves * [0, 1, 0, 1, 0, 1], rtol=1e-5, atol=1e-9)


def test_pair_that_a_parameter_mixes() -> None:
    """Sections turned by half a radian: the axes of the pair are not those of shapes; dω/dEI2 is still ω/2 and 0."""
    section = {"EA": 1e8, "GA2": 3e7, "GA3": 3e7, "GJ": 0.77, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0}
    section |= {"rotary_inertia2": 1e-8, "rotary_inertia3": 1e-8}
    structure = {"type": "spatial_beam", "length": 1.0, "section": section, "pretwist": [[0.0, 0.5], [1.0, 0.5]]}
    scene = {"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 2}}
    found = modes(scene, sensitivities=True)
    slopes = [row["dfrequency"] for row in found.sensitivities if row["parameter"] == "EI2"]
    np.testing.assert_allclose(sorted(slopes), [0.0, found.frequencies[0] / 2], rtol=1e-5, atol=1e-5)
