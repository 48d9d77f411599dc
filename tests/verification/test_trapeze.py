"""Torsion under tension: the fibers beside the axis of twist, against the equation of a twisting bar and a plate."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import Scene, explain, modes, run
from rotfem.registry import effects

Array = npt.NDArray[np.float64]

LENGTH, WIDTH, HEIGHT, HUB = 1.0, 0.04, 0.001, 0.2
MATERIAL = {"E": 7e10, "nu": 0.0, "rho": 2700.0}

STRIP: dict[str, Any] = {
    "structure": {
        "type": "spatial_beam",
        "length": LENGTH,
        "hub_radius": HUB,
        "section": {**MATERIAL, "shape": "rectangle", "width": WIDTH, "height": HEIGHT},
    },
    "motion": {"type": "constant", "speed": 200.0},
    "model": {"theory": "consistent_linear"},
    "mesh": {"elements": 8, "degree": 3},
    "modes": {"count": 9},
}

#: Without the Coriolis force, which couples torsion with lag where the axis lies in the section: the bar alone.
UNCOUPLED = ["centrifugal", "rotary_inertia", "trapeze"]


def scene(changes: dict[str, Any], tables: dict[str, Any] | None = None) -> Scene:
    return Scene.from_dict(copy.deepcopy(tables or STRIP)).replace(changes)


def torsion(s: Scene) -> float:
    return float(next(row["frequency"] for row in modes(s).rows if row["label"] == "1st torsion"))


def frequencies(s: Scene) -> Array:
    return np.array([row["frequency"] for row in modes(s).rows])


#: Axis of the spin ↦ speed (rad/s) ↦ first torsional frequency (rad/s) of the strip, by Ritz with 12 polynomials:
#: ((GJ + N I_p/A) θ')' + ω² ρI_p θ ∓ Ω² ρ(I_3 − I_2) θ = 0 with the tension N of the centrifugal force; the propeller
#: moment holds the strip in the plane of rotation, so it stiffens for an axis across the strip, 3, and softens for 2.
TWISTING = {
    2: {0.0: 280.4514475, 80.0: 285.1289743, 200.0: 306.884087},
    3: {0.0: 280.4514475, 80.0: 306.7287759, 200.0: 417.2264437},
}
#: The same at 200 rad/s about 3 without N in it.
WITHOUT = 344.387929
#: The two lowest frequencies of torsion and lag that spin about 2 at 200 rad/s, by Ritz: turns of the section about 1
#: and 3 are coupled by its Coriolis moments ±2Ωρ I_3; lag is Timoshenko's beam under N.
TORSION_AND_LAG = [305.3009837, 321.3071493]


def about(axis: int, speed: float) -> dict[str, Any]:
    return {"motion.axis": [0.0, 0.0, 1.0] if axis == 3 else [0.0, 1.0, 0.0], "motion.speed": speed}


# --- spinning strips ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [2, 3])
def test_linear_beam_is_the_bar(axis: int) -> None:
    """The prestress of the undeformed strip is the N of the equation: 1e-7 is the error of the mesh."""
    for speed in (0.0, 80.0, 200.0):
        found = torsion(scene(about(axis, speed) | {"model.effects": UNCOUPLED}))
        assert found == pytest.approx(TWISTING[axis][speed], rel=1e-7)
    found = torsion(scene(about(axis, 200.0)))
    expected = TWISTING[3][200.0] if axis == 3 else TORSION_AND_LAG[0]
    assert found == pytest.approx(expected, rel=1e-7)


def test_without_the_effect() -> None:
    bare = [effect.name for effect in effects if effect.name != "trapeze"]
    assert torsion(scene({"model.effects": bare})) == pytest.approx(WITHOUT, rel=1e-7)


def test_against_the_plate() -> None:
    """What the spin adds to ω² is the same; the clamp hinders warping in the plate, which is 1 % of ω at rest."""
    plate = {"type": "plate", "length": LENGTH, "width": WIDTH, "thickness": HEIGHT, "hub_radius": HUB, **MATERIAL}
    tables = STRIP | {"structure": plate, "mesh": {"elements": [24, 2]}}
    for axis in (2, 3):
        bare = {"model.effects": UNCOUPLED}
        still, spinning = (torsion(scene(about(axis, speed) | bare, tables)) for speed in (0.0, 200.0))
        beam = TWISTING[axis][200.0] ** 2 - TWISTING[axis][0.0] ** 2
        assert spinning**2 - still**2 == pytest.approx(beam, rel=0.02)


def test_explain_says_how_much_it_is() -> None:
    """Of the four lowest modes torsion changes most: 1 − 344.4/417.2."""
    rows = {row["name"]: row for row in explain(scene({})).rows}
    expected = 1 - WITHOUT / TWISTING[3][200.0]
    assert rows["trapeze"]["estimate"]["modes"] == pytest.approx(expected, rel=1e-2)


# --- sections -------------------------------------------------------------------------------------------------------


def test_sections_given_in_other_ways() -> None:
    """By shape, by matrices, with the polar radius given: the same strip; fibers along the axis alone: no effect."""
    s = scene({})
    matrices = dict(s.structure.section.at(0.0))
    radius = np.sqrt((WIDTH**2 + HEIGHT**2) / 12)
    expected = torsion(s)
    for section in (matrices, matrices | {"polar_radius": radius}):
        assert torsion(s.replace({"structure.section": section})) == pytest.approx(expected, rel=1e-9)
    without = s.replace({"structure.section.polar_radius": 0.0})
    assert torsion(without) == pytest.approx(WITHOUT, rel=1e-7)


def test_centers_apart() -> None:
    """Centers or full 6×6 matrices of the same section: tension acts on its distance from the axis of twist too."""
    changes = {"structure.section.shear_center": [0.01, 0.002], "structure.section.tension_center": [-0.005, 0.001]}
    s = scene(changes | {"motion.axis": [0.0, 1.0, 0.0]})
    expected = frequencies(s)
    by_matrices = s.replace({"structure.section": dict(s.structure.section.at(0.0))})
    np.testing.assert_allclose(frequencies(by_matrices), expected, rtol=1e-8)
    radius = np.hypot(np.sqrt((WIDTH**2 + HEIGHT**2) / 12), np.hypot(0.015, 0.001))
    np.testing.assert_allclose(frequencies(s.replace({"structure.section.polar_radius": radius})), expected, rtol=1e-9)
    about_one = s.replace({"structure.section.polar_radius": np.sqrt((WIDTH**2 + HEIGHT**2) / 12)})
    assert np.max(np.abs(frequencies(about_one) / expected - 1)) > 1e-3


# --- pretwist -------------------------------------------------------------------------------------------------------

PULLED: dict[str, Any] = {
    "structure": STRIP["structure"] | {"pretwist": [[0.0, 0.0], [LENGTH, 0.5]]},
    "motion": {"type": "constant", "speed": 0.0},
    "model": {"theory": "consistent_linear"},
    "loads": {"tip_force": [1000.0, 0.0, 0.0]},
    "mesh": {"elements": 4, "degree": 3},
}


def untwisted(s: Scene) -> float:
    """Return the twist of the tip about the axis in the equilibrium under a pull, rad."""
    return float(run(s).history["tip_theta1"][-1])


def test_pull_untwists_a_strip() -> None:
    """GJ K + N (k⁰ (r² − J/A) + r² K) = 0 for a uniform beam, in every theory: both sides of Γ₁ = N/EA hold."""
    s = scene({}, PULLED)
    at = s.structure.section.central(0.0)
    squared, warping = (at["EI2"] + at["EI3"]) / at["EA"], 2 * at["GJ"] / at["EA"]
    K = -1000.0 * 0.5 * (squared - warping) / (at["GJ"] + 1000.0 * squared)
    assert untwisted(s) == pytest.approx(K * LENGTH, rel=1e-8)
    assert abs(K + 0.1123) < 1e-4


def test_pretwist_of_a_round_bar_means_nothing() -> None:
    """J is all of I_p there: what a pull does to a thin strip it does not do to a bar that only has turned axes."""
    round_bar = {**MATERIAL, "nu": 0.3, "shape": "circle", "radius": 0.01}
    found = untwisted(scene({"structure.section": round_bar}, PULLED))
    assert abs(found) < 1e-12
