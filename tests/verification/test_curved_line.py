"""Beams along a reference line in space: prebend, sweep and pretwist together, against arcs and a code of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import rotfem
from rotfem.scene import Scene, SpatialBeamStructure
from tests.beam_matrices import frequencies

Array = npt.NDArray[np.float64]

SECTION: dict[str, Any] = {
    "EA": 1e5,
    "GA2": 3e4,
    "GA3": 3e4,
    "GJ": 8.0,
    "EI2": 10.0,
    "EI3": 30.0,
    "mass_per_length": 1.0,
    "rotary_inertia2": 1e-3,
    "rotary_inertia3": 2e-3,
}
#: Without the stretch of twisted fibers, which 6×6 sections do not have.
MODEL = {"theory": "consistent_linear", "effects": ["coriolis", "centrifugal", "rotary_inertia"]}
STIFFNESS, MASS = np.diag([1e5, 3e4, 3e4, 8.0, 10.0, 30.0]), np.diag([1.0, 1.0, 1.0, 3e-3, 1e-3, 2e-3])


def scene(structure: dict[str, Any], speed: float = 0.0, **more: Any) -> Scene:
    structure = {"type": "spatial_beam", "section": SECTION, **structure}
    motion = {"type": "constant", "speed": speed, "axis": [0.1, 0.2, 1.0]}
    tables = {"structure": structure, "motion": motion, "mesh": {"elements": 16}, "modes": {"count": 5}}
    return Scene.from_dict(tables | {"model": MODEL} | more)


def found(scene: Scene) -> Array:
    return np.array([row["frequency"] for row in rotfem.modes(scene).rows])


def beam(scene: Scene) -> SpatialBeamStructure:
    assert isinstance(scene.structure, SpatialBeamStructure)
    return scene.structure


def circle(angle: float, length: float, points: int, across: int) -> Array:
    """Return points of an arc that starts along axis 1 and bends towards another."""
    s, out = np.linspace(0.0, angle, points), np.zeros((points, 3))
    out[:, 0], out[:, across] = np.sin(s), 1 - np.cos(s)
    return out * length / angle


def test_arc_by_points_is_the_arc_by_angle() -> None:
    # A spline through 17 points of an arc of 46° misses it by 1e-7 of its length.
    swept = scene({"length": 2.0, "sweep": [[0.0, 0.0], [2.0, 0.8]]}, 3.0)
    points = scene({"line": circle(0.8, 2.0, 17, 1)}, 3.0)
    assert beam(points).length == pytest.approx(2.0, rel=1e-6)
    np.testing.assert_allclose(found(points), found(swept), rtol=5e-6)


def test_prebend_is_sweep_on_its_side() -> None:
    # Turned by 90° about axis 1, with the section and the spin: the same beam.
    swept = scene({"line": circle(0.8, 2.0, 9, 1)}, 3.0)
    turned = SECTION | {"EI2": 30.0, "EI3": 10.0, "rotary_inertia2": 2e-3, "rotary_inertia3": 1e-3}
    line = circle(0.8, 2.0, 9, 2)
    motion = {"type": "constant", "speed": 3.0, "axis": [0.1, -1.0, 0.2]}
    bent = scene({"line": line, "section": turned}, motion=motion)
    np.testing.assert_allclose(found(bent), found(swept), rtol=1e-9)


def curve(t: Array) -> Array:
    return np.stack([t, 0.2 * t**2, -0.15 * t**2 + 0.02 * t**3], axis=-1)


def test_curve_in_space_with_twist() -> None:
    # At rest against polynomials of degree 9 along the exact curve, whose axis 2 is across it and direction 3.
    def rate(u: float) -> Array:
        return np.array([1.0, 0.4 * u, -0.3 * u + 0.06 * u**2])

    def arc(u: float) -> float:
        return quad(lambda v: float(np.linalg.norm(rate(v))), 0.0, u, epsabs=1e-12)[0]

    length = arc(2.0)
    twist = [[0.0, 0.4], [length, -0.2]]
    case = scene({"line": curve(np.linspace(0.0, 2.0, 17)), "pretwist": twist})
    # The spline is one over the chords and not over t, so it misses the curve by 2e-6 of its length.
    assert beam(case).length == pytest.approx(length, rel=1e-6)

    def triad(x: float) -> Array:
        tangent = rate(brentq(lambda u: arc(u) - x, -1e-9, 2.0 + 1e-9))
        tangent /= np.linalg.norm(tangent)
        second = np.cross([0.0, 0.0, 1.0], tangent)
        second /= np.linalg.norm(second)
        third = np.cross(tangent, second)
        c, s = np.cos(angle := 0.4 - 0.6 * x / length), np.sin(angle)
        return np.stack([tangent, c * second + s * third, c * third - s * second], axis=-1)

    exact = frequencies([0.0, length / 2, length], lambda x: (STIFFNESS, MASS), triad)[:5]
    np.testing.assert_allclose(found(case), exact, rtol=1e-5)


def test_kinked_line_is_the_kinked_sweep() -> None:
    kink = [[0.0, 0.0], [1.4, 0.0], [1.4, 0.6], [2.0, 0.6]]
    corner = [1.4, 0.0, 0.0]
    end = [1.4 + 0.6 * np.cos(0.6), 0.6 * np.sin(0.6), 0.0]
    line = [[0.0, 0.0, 0.0], corner, corner, end]
    case = scene({"line": line}, 3.0)
    assert beam(case).knots == pytest.approx((1.4,))
    swept = scene({"length": 2.0, "sweep": kink}, 3.0)
    np.testing.assert_allclose(found(case), found(swept), rtol=1e-9)
    for one in (case, swept):  # the outer side is that of the kink itself
        assert beam(one).reference_line.at(1.4)[1] == pytest.approx(np.array([[np.cos(0.6), np.sin(0.6), 0.0]]))


def test_line_in_a_file_and_its_length(tmp_path: Any) -> None:
    (tmp_path / "line.csv").write_text("x, y, z\n0,0,0\n1,0,0\n2,0,0.1\n")
    structure = {"type": "spatial_beam", "section": SECTION, "line": "line.csv"}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 1.0}}
    length = beam(Scene.from_dict(tables, directory=tmp_path)).length
    assert 2.0 < length < 2.01
    exact = Scene.from_dict({**tables, "structure": {**structure, "length": round(length, 8)}}, directory=tmp_path)
    assert beam(exact).length == length


@pytest.mark.parametrize(
    ("structure", "message"),
    [
        ({"line": [[0.1, 0, 0], [1, 0, 0]]}, r"structure\.line.*must start at the clamp"),
        ({"line": [[0, 0, 0]]}, r"structure\.line.*at least two"),
        ({"line": [[0, 0], [1, 0]]}, r"structure\.line"),
        ({"line": [[0, 0, 0], [0, 0, 1]]}, r"structure\.line.*direction 3"),
        ({"line": [[0, 0, 0], [1, 0, 0], [1, 0, 0]]}, "no kink at an end"),
        ({"line": [[0, 0, 0], [1, 0, 0]], "length": 2.0}, r"structure\.length = 2\.0.*arc length of the line, 1;"),
        ({"line": [[0, 0, 0], [1, 0, 0]], "sweep": 0.1}, r"structure\.sweep.*cannot be combined"),
        ({"line": [[0, 0, 0], [1, 0, 0]], "pretwist": [[0, 0], [2, 1]]}, r"structure\.pretwist.*length 1;"),
        ({"line": "none.csv"}, r"structure\.line.*file not found"),
    ],
)
def test_bad_lines(structure: dict[str, Any], message: str) -> None:
    with pytest.raises(rotfem.SceneError, match=message):
        scene(structure)
