"""Error bounds of frequencies: never below the error; and what is said where they are large."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import campbell, modes
from tests.hard.cases.modes import ELEMENTS, beam


def test_bounds_in_decimals() -> None:
    """Beams of r/L from 1e-2 to 1e-7 against 50 digits: errors below their bounds, and slender ones below 1e-11."""
    for (elements, slenderness), truth in ELEMENTS.items():
        result = modes(beam(slenderness, elements))
        errors = np.abs(result.eigenvalues[:3] - 1j * truth) / truth
        assert np.all(errors <= result.column("error_bound")[:3]), (elements, slenderness)
        assert slenderness > 1e-5 or np.max(errors) < 1e-11
        assert not any(text.startswith("unreliable") for text in result.summary["warnings"])
        assert np.max(result.column("error_bound")) < 1e-5


def viscous(slenderness: float) -> dict[str, Any]:
    """Return a beam of 64 elements whose digits are not kept: its strains are so viscous that C loses them too."""
    scene = beam(slenderness, 64)
    return scene | {"structure": scene["structure"] | {"damping": {"kelvin_voigt": 1e-3}}}


def test_what_is_lost_is_said() -> None:
    """Where a bound is above 1e-4 there is a warning that names the mode."""
    lost = modes(viscous(1e-6))
    (warning,) = [text for text in lost.summary["warnings"] if text.startswith("unreliable")]
    assert "1st edgewise" in warning


def test_no_instability_out_of_round_off() -> None:
    """At rest nothing is unstable, whatever round-off makes of the eigenvalues; campbell says so, too."""
    diagram = campbell(beam(1e-7, 64), [0.0, 0.1])
    assert diagram.summary["instabilities"] == []
    for result in (diagram, modes(beam(1e-7, 64)), modes(viscous(1e-7))):
        assert not any(str(row.get("stability")).endswith("instability") for row in result.rows)
        assert not any("instability" in text for text in result.summary["warnings"])


def test_an_instability_that_is_one() -> None:
    """The linear theory past its critical speed grows far beyond the bound."""
    result = modes(beam(1e-3, 8) | {"motion": {"type": "constant", "speed": 5.0}})
    assert result.rows[0]["stability"] == "static instability"
    assert result.rows[0]["error_bound"] < 1e-4


@pytest.mark.parametrize(("slenderness", "viscosity"), [(1e-4, 1e-3), (1e-6, 1e-5)])
def test_stiff_strains_as_unknowns_with_viscosity(slenderness: float, viscosity: float) -> None:
    """Digits are kept of lightly damped modes too: Euler's beam, λ² + η ω² λ + ω² = 0, but for (r/L)² β² of shear."""
    scene = beam(slenderness, 64) | {"modes": {"count": 2}}
    scene["structure"]["damping"] = {"kelvin_voigt": viscosity}
    result = modes(scene)
    omega = np.array([1.8751040687, 4.6940911330]) ** 2
    exact = omega * (-viscosity * omega / 2 + 1j * np.sqrt(1 - (viscosity * omega / 2) ** 2))
    errors = np.abs(result.eigenvalues[:2] - exact) / np.abs(exact)
    assert np.all(errors < 5e-6)
    bounds = result.column("error_bound")[:2]
    assert np.all(bounds < 1e-3)
    assert np.all(errors < bounds + 150 * slenderness**2)


@pytest.mark.estimated
def test_a_stiff_shaft_on_soft_springs() -> None:
    """It moves like a rigid body, ω² = 2k/m and 6k/(m + 12 m r²/L²), 1e-6 of the bending stiffness; both are known."""
    k, length, outer, inner = 1.0, 0.3, 0.01504, 0.0035
    section = {"shape": "tube", "outer_radius": outer, "inner_radius": inner, "E": 2.1e11, "nu": 0.3, "rho": 7850.0}
    shaft = {"type": "spatial_beam", "length": length, "section": section, "root": {"driven": True}}
    shaft["supports"] = [{"x": 0.0, "stiffness": k}, {"x": length, "stiffness": k}]
    result = modes({"structure": shaft, "motion": {"type": "constant", "speed": 0.0, "axis": [1, 0, 0]}})
    m = 7850.0 * np.pi * (outer**2 - inner**2) * length
    rigid = np.sqrt([2 * k / m, 6 * k / (m * (1 + 3 * (outer**2 + inner**2) / length**2))])
    np.testing.assert_allclose(result.frequencies[:4], np.repeat(rigid, 2), rtol=1e-6)
    assert np.all(result.column("error_bound") < 1e-5)
    assert result.summary["error"]["total"] < 1e-4
    assert result.summary["warnings"] == []
