"""Error bounds of frequencies: never below the error, seldom far above it; and what is said where they are large."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import campbell, modes
from tests import frequency_bounds

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
    """Return a beam of 64 elements whose digits are not kept: its strains are viscous."""
    scene = frequency_bounds.slender_beam(slenderness, 64)
    return scene | {"structure": scene["structure"] | {"damping": {"kelvin_voigt": 1e-9}}}


def test_what_is_lost_is_said() -> None:
    """Where a bound is above 1e-4 there is a warning that names the mode; other beams have none."""
    for beam in (frequency_bounds.slender_beam(1e-2, 8), frequency_bounds.slender_beam(1e-6, 64)):
        result = modes(beam)
        assert result.summary["warnings"] == []
        assert np.max(result.column("error_bound")) < 1e-8
    lost = modes(viscous(1e-6))
    (warning,) = [text for text in lost.summary["warnings"] if text.startswith("unreliable")]
    assert "lag 1" in warning


@pytest.mark.parametrize("slenderness", [1e-6, 1e-7])
def test_no_instability_out_of_round_off(slenderness: float) -> None:
    """At rest nothing is unstable, whatever round-off makes of the eigenvalues; campbell says so, too."""
    for scene in (frequency_bounds.slender_beam(slenderness, 64), viscous(slenderness)):
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
