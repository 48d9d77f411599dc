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
    """18 beams, from 1e-12 to no digit at all, against 50 digits."""
    rows = list(frequency_bounds.in_decimals())
    assert len({row.case for row in rows}) == 18
    assert min(row.bound for row in rows) < 1e-12
    assert max(row.bound for row in rows) > 1.0
    check(rows)


@pytest.mark.nightly
def test_bounds_in_the_limit() -> None:
    """Spinning beams, a pretwisted spatial one and plates, against the limit of great stiffness."""
    rows = list(frequency_bounds.in_the_limit())
    assert len({row.case for row in rows}) >= 12
    check(rows)


def test_what_is_lost_is_said() -> None:
    """Where a bound is above 1e-4 there is a warning that names the mode; a benign beam has none."""
    benign = modes(frequency_bounds.slender_beam(1e-2, 8))
    assert benign.summary["warnings"] == []
    assert np.max(benign.column("error_bound")) < 1e-8
    lost = modes(frequency_bounds.slender_beam(1e-6, 64))
    (warning,) = [text for text in lost.summary["warnings"] if text.startswith("unreliable")]
    assert "lag 1" in warning


@pytest.mark.parametrize("slenderness", [1e-6, 1e-7])
def test_no_instability_out_of_round_off(slenderness: float) -> None:
    """At rest nothing is unstable, whatever round-off makes of the eigenvalues; campbell says so, too."""
    scene = frequency_bounds.slender_beam(slenderness, 64)
    result = modes(scene)
    assert all(not row["stability"].endswith("instability") for row in result.rows)
    diagram = campbell(scene, [0.0, 0.1])
    assert diagram.summary["instabilities"] == []
    assert not any("instability" in text for text in (*result.summary["warnings"], *diagram.summary["warnings"]))


def test_an_instability_that_is_one() -> None:
    """The linear theory past its critical speed grows far beyond the bound."""
    scene: dict[str, Any] = frequency_bounds.slender_beam(1e-3, 8)
    result = modes(scene | {"motion": {"type": "constant", "speed": 5.0}})
    assert result.rows[0]["stability"] == "static instability"
    assert result.rows[0]["error_bound"] < 1e-4
