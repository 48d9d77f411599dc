"""Spatial beams whose axis is not straight: arcs, kinks, and what they must not change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.scene import Scene

ARC = 100.0 * np.pi / 4


def arc(load: float, changes: dict[str, Any] | None = None) -> Scene:
    """Return Bathe & Bolourchi's 45° bend: radius 100, unit square, E = 1e7, ν = 0, polar torsion constant 1/6."""
    section = {
        "EA": 1e7,
        "GA2": 5e6,
        "GA3": 5e6,
        "GJ": 5e6 / 6,
        "EI2": 1e7 / 12,
        "EI3": 1e7 / 12,
        "mass_per_length": 1.0,
    }
    tables = {
        "structure": {
            "type": "spatial_beam",
            "length": ARC,
            "sweep": [[0.0, 0.0], [ARC, np.pi / 4]],
            "section": section,
        },
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [0.0, 0.0, load]},
        "mesh": {"elements": 8, "degree": 3},
    }
    return Scene.from_dict(tables).replace(changes or {})


def tip(scene: Scene) -> np.ndarray:
    """Return where the tip of the arc is, m."""
    f = rotfem.run(scene).summary["figures"]
    start = 100.0 * np.array([np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), 0.0])
    return start + [f[f"tip_u{i}_final"] for i in (1, 2, 3)]


# Published tip positions: Bathe & Bolourchi 1979 as computed by Simo & Vu-Quoc 1986 (CMAME 58, table 5) with eight
# linear elements, which are not converged to better than half a per cent of the deflection, 0.3 here.
@pytest.mark.parametrize(
    ("load", "published"), [(300.0, (58.84, 22.33, 40.08)), (600.0, (47.23, 15.79, 53.37))], ids=["300", "600"]
)
def test_bend_of_45_degrees(load: float, published: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(tip(arc(load)), published, atol=0.3)


def test_arc_straightened_by_its_own_moment() -> None:
    # Pure bending: the moment −EI/R takes the curvature 1/R away, and the tip lies at (L, 0, 0). Exact.
    moment = -1e7 / 12 / 100.0
    scene = arc(0.0, {"loads": {"tip_moment": {"value": [0.0, 0.0, moment], "kind": "follower"}}})
    np.testing.assert_allclose(tip(scene), [ARC, 0.0, 0.0], atol=1e-6)


def test_whole_beam_swept_is_a_beam_turned() -> None:
    # A constant sweep turns the beam in the plane of rotation about its clamp at the axis: nothing may change.
    blade = {
        "type": "spatial_beam",
        "length": 1.0,
        "section": {
            **{"EA": 900.0, "GA2": 300.0, "GA3": 300.0, "GJ": 0.8, "EI2": 1.0, "EI3": 2.0},
            **{"mass_per_length": 1.0, "rotary_inertia2": 1e-3, "rotary_inertia3": 2e-3},
        },
    }
    tables = {"motion": {"type": "constant", "speed": 3.0}, "mesh": {"elements": 6}, "modes": {"count": 5}}
    straight = rotfem.modes({"structure": blade, **tables}).rows
    for sweep in (0.7, [[0.0, 0.7], [0.5, 0.7], [1.0, 0.7]]):
        turned = rotfem.modes({"structure": {**blade, "sweep": sweep}, **tables}).rows
        for a, b in zip(straight, turned, strict=True):
            assert b["frequency"] == pytest.approx(a["frequency"], rel=1e-7)  # as far as Newton goes


#: The aluminium strip of Epps & Chandra 1996 (J. Am. Helicopter Soc. 41, 29): 1 × 0.063 in, inches and pounds.
WIDTH, THICKNESS, MODULUS, DENSITY = 1.0, 0.063, 1.06e7, 2.51e-4
SHEAR = MODULUS / (2 * 1.325)
STRIP = {
    "EA": MODULUS * WIDTH * THICKNESS,
    "GA2": SHEAR * WIDTH * THICKNESS * 5 / 6,
    "GA3": SHEAR * WIDTH * THICKNESS * 5 / 6,
    "GJ": SHEAR * WIDTH * THICKNESS**3 / 3 * (1 - 0.63 * THICKNESS / WIDTH),
    "EI2": MODULUS * WIDTH * THICKNESS**3 / 12,
    "EI3": MODULUS * THICKNESS * WIDTH**3 / 12,
    "mass_per_length": DENSITY * WIDTH * THICKNESS,
    "rotary_inertia2": DENSITY * WIDTH * THICKNESS**3 / 12,
    "rotary_inertia3": DENSITY * THICKNESS * WIDTH**3 / 12,
}


def swept_tip(angle: float, speed: float, count: int) -> list[dict[str, Any]]:
    """Return the modes of the strip whose last 6 in are swept back by an angle (rad), at a speed (rad/s)."""
    sweep = [[0.0, 0.0], [31.5, 0.0], [31.5, -angle], [37.5, -angle]]
    structure = {"type": "spatial_beam", "length": 37.5, "hub_radius": 2.5, "sweep": sweep, "section": STRIP}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": speed}, "mesh": {"elements": 12}}
    return rotfem.modes({**tables, "modes": {"count": count}}).rows


def test_swept_tip_of_epps_and_chandra_at_rest() -> None:
    # The frequencies of the very beam are zeros of a determinant of transfer matrices, in which (φ, β) and (T, M) are
    # turned at the kink. Measured were 1.6 and 10.4 Hz; docs/blades.md says why that is another thing.
    found = [row["frequency"] for row in swept_tip(np.pi / 4, 0.0, 2)]
    np.testing.assert_allclose(found, [9.512491424, 59.94715187], rtol=1e-6)


# GXBeam 0.5 (its example "Rotating Beam with a Swept Tip", the same theory), 1st flapwise at 750 rpm, four digits.
@pytest.mark.slow
@pytest.mark.parametrize(("angle", "gxbeam"), [(0.0, 13.55), (45.0, 13.56)])
def test_swept_tip_of_epps_and_chandra_spinning(angle: float, gxbeam: float) -> None:
    rows = swept_tip(np.radians(angle), 750 * np.pi / 30, 1)
    assert rows[0]["label"] == "1st flapwise"
    assert rows[0]["frequency_hz"] == pytest.approx(gxbeam, rel=1e-3)


def test_bad_sweeps() -> None:
    for sweep in ([[0.1, 0.0], [ARC, 0.1]], [[0.0, 0.0], [50.0, 0.1], [40.0, 0.1], [ARC, 0.0]], [[0.0, 0.0]], "x"):
        with pytest.raises(rotfem.SceneError, match=r"structure\.sweep"):
            arc(1.0, {"structure.sweep": sweep})
