"""Error bounds of frequencies: never below the error, seldom far above it; and what is said where they are large."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import campbell, modes
from tests import frequency_bounds

pytestmark = pytest.mark.usefixtures("unestimated")

#: Largest allowed factor between a bound and the error in the middle of all cases: a bound that is always huge is none.
WORTH = 200.0


def check(rows: list[frequency_bounds.Row]) -> None:
    """Hold rows to their bounds."""
    ratios = np.array([row.ratio for row in rows])
    print(f"{len(rows)} frequencies: largest error/bound {ratios.max():.3f}, median {np.median(ratios):.4f}")
    assert np.all(ratios <= 1.0), [row for row in rows if row.ratio > 1.0]
    assert np.median(ratios) > 1 / WORTH


def test_bounds_in_decimals() -> None:
    """18 beams against 50 digits: K as assembled keeps from twelve digits to none, with stiff strains all keep ten."""
    rows = list(frequency_bounds.in_decimals())
    plain, kept = ([row for row in rows if row.case.endswith(", K") == is_plain] for is_plain in (True, False))
    assert len({row.case for row in plain}) == len({row.case for row in kept}) == 18
    assert min(row.bound for row in plain) < 1e-12
    assert max(row.bound for row in plain) > 1.0
    check(plain)
    check(kept)
    slender = [row for row in kept if row.case.split("r/L ")[1] in ("1e-05", "1e-06", "1e-07")]
    assert len(slender) == 27
    assert max(row.error for row in slender) < 1e-11


@pytest.mark.nightly
def test_bounds_in_the_limit() -> None:
    """Spinning beams, a pretwisted spatial one and plates, against the limit of great stiffness."""
    rows = list(frequency_bounds.in_the_limit())
    assert len({row.case for row in rows}) >= 12
    check(rows)


def viscous(slenderness: float) -> dict[str, Any]:
    """Return a beam of 64 elements whose digits are not kept: its strains are so viscous that C loses them too."""
    scene = frequency_bounds.slender_beam(slenderness, 64)
    return scene | {"structure": scene["structure"] | {"damping": {"kelvin_voigt": 1e-3}}}


def test_what_is_lost_is_said() -> None:
    """Where a bound is above 1e-4 there is a warning that names the mode; other beams have none."""
    for beam in (frequency_bounds.slender_beam(1e-2, 8), frequency_bounds.slender_beam(1e-6, 64)):
        result = modes(beam)
        assert result.summary["warnings"] == []
        assert np.max(result.column("error_bound")) < 1e-8
    lost = modes(viscous(1e-6))
    (warning,) = [text for text in lost.summary["warnings"] if text.startswith("unreliable")]
    assert "1st edgewise" in warning


def test_no_instability_out_of_round_off() -> None:
    """At rest nothing is unstable, whatever round-off makes of the eigenvalues; campbell says so, too."""
    for scene in (frequency_bounds.slender_beam(1e-7, 64), viscous(1e-7)):
        result = modes(scene)
        assert all(not row["stability"].endswith("instability") for row in result.rows)
        diagram = campbell(scene, [0.0, 0.1])
        assert diagram.summary["instabilities"] == []
        said = (*result.summary["warnings"], *diagram.summary["warnings"])
        assert not any("instability" in text for text in said)


def test_an_instability_that_is_one() -> None:
    """The linear theory past its critical speed grows far beyond the bound."""
    scene: dict[str, Any] = frequency_bounds.slender_beam(1e-3, 8)
    result = modes(scene | {"motion": {"type": "constant", "speed": 5.0}})
    assert result.rows[0]["stability"] == "static instability"
    assert result.rows[0]["error_bound"] < 1e-4


@pytest.mark.parametrize(("slenderness", "viscosity"), [(1e-4, 1e-3), (1e-5, 1e-5), (1e-6, 1e-5)])
def test_stiff_strains_as_unknowns_with_viscosity(slenderness: float, viscosity: float) -> None:
    """Digits are kept of lightly damped modes too: Euler's beam, whose λ solve λ² + η ω² λ + ω² = 0.

    Shear and rotary inertia make (r/L)² β² of it, 4e-7 at most; without the strains as unknowns 5.8e-2 is lost at 1e-6.
    """
    EI, L, mass = 1.4e4, 10.0, 1.2
    EA = EI / (slenderness * L) ** 2
    section = {"EA": EA, "GA": EA / 2.6, "EI": EI, "mass_per_length": mass}
    scene = {
        "structure": {
            "type": "planar_beam",
            "length": L,
            "section": section,
            "damping": {"kelvin_voigt": viscosity},
        },
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "linear"},
        "mesh": {"elements": 64},
        "modes": {"count": 2},
    }
    result = modes(scene)
    omega = np.array([1.8751040687, 4.6940911330]) ** 2 / L**2 * np.sqrt(EI / mass)
    exact = omega * (-viscosity * omega / 2 + 1j * np.sqrt(1 - (viscosity * omega / 2) ** 2))
    errors = np.abs(result.eigenvalues[:2] - exact) / np.abs(exact)
    assert np.all(errors < 5e-6)
    bounds = np.array([row["error_bound"] for row in result.rows[:2]])
    assert np.all(bounds < 1e-3)
    assert np.all(errors < bounds + 30 * slenderness**2 * 5)
