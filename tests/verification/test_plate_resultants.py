"""Stress resultants of plates: a strip that is a beam, exactly; what is asked of the largest equivalent stress."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.results.files import read_csv

LENGTH, WIDTH, H = 1.0, 0.4, 0.02
PLATE = {"type": "plate", "length": LENGTH, "width": WIDTH, "thickness": H, "E": 7e10, "nu": 0.0, "rho": 2700.0}
NAMES = ["n11", "n22", "n12", "q1", "q2", "m11", "m22", "m12", "von_mises"]
SCENE: dict[str, Any] = {
    "structure": PLATE,
    "motion": {"type": "constant", "speed": 0.0},
    "model": {"theory": "linear"},
    "mesh": {"elements": [4, 2]},
    "loads": {"tip_force": [100.0, 0.0, -30.0]},
    "output": {"quantities": NAMES, "error": False},
}


def test_a_strip_is_a_beam(tmp_path: Path) -> None:
    """ν = 0, force at the tip: n11 = F1/b, q1 = F3/b, |m11| = |F3| (L − x)/b, all else zero; stress of both."""
    result = rotfem.run(SCENE, folder=tmp_path)
    r = result.resultants
    np.testing.assert_allclose(r["n11"], 100.0 / WIDTH, rtol=1e-7)
    np.testing.assert_allclose(np.abs(r["q1"]), 30.0 / WIDTH, rtol=1e-6)
    moment = 30.0 / WIDTH * (LENGTH - r["x"])
    np.testing.assert_allclose(np.abs(r["m11"]), moment, atol=1e-6 * moment.max())
    for name in ("n22", "n12", "q2", "m22", "m12"):
        np.testing.assert_allclose(r[name], 0.0, atol=1e-5)
    stress = 100.0 / WIDTH / H + 6 * 30.0 / WIDTH * LENGTH / H**2
    found = result.summary["stress"]
    assert found["von_mises"] == pytest.approx(stress, rel=1e-6)
    assert found["x"] == pytest.approx(0.0, abs=1e-12)
    assert result.history["von_mises_max"][0] == found["von_mises"]
    columns = read_csv(tmp_path / "resultants.csv")
    np.testing.assert_array_equal(columns["m11"], r["m11"])
    assert {"fields.xdmf", "fields.h5"} <= {path.name for path in tmp_path.iterdir()}


def test_a_spinning_strip() -> None:
    """n11(x) = ∫ρh Ω² (R + X) dX from x on, but for displacements, 1e-6 of it."""
    structure = {**PLATE, "hub_radius": 0.1}
    spin = {"structure": structure, "motion": {"type": "constant", "speed": 50.0, "axis": [0, 0, 1]}, "loads": {}}
    r = rotfem.run({**SCENE, **spin, "model": {"theory": "linear"}}).resultants
    x = r["x"]
    exact = 2700.0 * H * 50.0**2 * (0.1 * (LENGTH - x) + (LENGTH**2 - x**2) / 2)
    inside = (np.abs(r["y"]) < 1e-9) & (x > 0.1)  # the clamp holds the width, which the spin strains too
    # Nodes have the line through two points of a parabola, off by h²/12 of its curvature at most, h = 1/4.
    off = 2700.0 * H * 50.0**2 * 0.25**2 / 12 * 1.1
    np.testing.assert_allclose(r["n11"][inside], exact[inside], atol=off)


@pytest.mark.parametrize("quantities", [["M"], ["n13"]])
def test_what_a_plate_has_not_is_refused(quantities: list[str]) -> None:
    with pytest.raises(rotfem.SceneError, match=r"output\.quantities"):
        rotfem.Scene.from_dict({**SCENE, "output": {"quantities": quantities}})
    with pytest.raises(rotfem.SceneError, match=r"output\.stations"):
        rotfem.Scene.from_dict({**SCENE, "output": {"stations": 3}})
