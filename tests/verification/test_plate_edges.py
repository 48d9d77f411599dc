"""Edges and tapers of plates: squares and disks, against classical frequencies, and what is refused.

ω a² √(ρh/D) of squares, ν = 0.3. Thin: simply supported all round (m² + n²) π² (Navier); clamped, cantilever and two
opposite edges simply supported: Leissa, "The free vibration of rectangular plates", Journal of Sound and Vibration 31
(1973) 257, whose values of cantilevers are 0.6 % high; converged Ritz values are used for these. Thick, t/a = 0.1,
κ = 5/6: Mindlin's closed form where the director does not tilt along the edge, converged Ritz values else. Disks, ν =
0.3: Leissa, "Vibration of Plates", NASA SP-160 (1969), tables 2.1 and 2.3.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gmsh
import numpy as np
import pytest

import rotfem

HARD, SOFT = "simply_supported", "simply_supported_soft"


def around(kind: Any) -> dict[str, Any]:
    return dict.fromkeys(("clamped", "tip", "lower", "upper"), kind)


def plate(thickness: float, edges: dict[str, Any], **more: Any) -> dict[str, Any]:
    shape = {"length": 1.0, "width": 1.0} if "mesh" not in more else {}
    structure = {"type": "plate", **shape, "thickness": thickness, "E": 1e9, "nu": 0.3, "rho": 1000.0}
    motion = {"type": "constant", "speed": 0.0}
    return {"structure": {**structure, "edges": edges, **more}, "motion": motion, "output": {"error": False}}


def frequencies(scene: dict[str, Any], count: int = 4) -> Any:
    """Return ω √(ρh/D) of the first modes, 1/m²."""
    s = scene["structure"]
    found = rotfem.modes({**scene, "modes": {"count": count}}).frequencies
    return found * math.sqrt(12 * (1 - s["nu"] ** 2) * s["rho"] / s["E"]) / s["thickness"]


PI2 = math.pi**2
SQUARES = {
    "simply supported": (0.001, around(HARD), [2 * PI2, 5 * PI2, 5 * PI2, 8 * PI2]),
    "clamped": (0.001, around("clamped"), [35.985, 73.394, 73.394, 108.22]),
    "cantilever": (0.001, {}, [3.4710, 8.506, 21.284, 27.199]),
    "two opposite edges": (0.001, {"clamped": HARD, "tip": HARD}, [9.6314, 16.135]),
    "thick": (0.1, around(HARD), [19.0650, 45.4827, 45.4827, 69.7944]),
    "thick, soft": (0.1, around(SOFT), [18.317, 44.425, 44.425, 67.411]),
    "thick, clamped": (0.1, around("clamped"), [32.5243, 62.0386]),
}


@pytest.mark.parametrize("name", SQUARES)
def test_squares(name: str) -> None:
    """All within 1.2e-3: the free corners of thin plates are what the mesh resolves least."""
    thickness, edges, expected = SQUARES[name]
    scene = {**plate(thickness, edges), "mesh": {"elements": [6, 6], "degree": 3}}
    np.testing.assert_allclose(frequencies(scene, len(expected)), expected, rtol=1.2e-3)


@pytest.mark.parametrize(
    ("thickness", "expected"), [(0.001, [13.468, 19.596, 24.270]), (0.1, [12.7189, 18.9434, 23.3245])]
)
def test_a_plate_that_nothing_holds_has_six_rigid_motions(thickness: float, expected: list[float]) -> None:
    scene = {**plate(thickness, around("free")), "mesh": {"elements": [6, 6], "degree": 3}}
    found = rotfem.modes({**scene, "modes": {"count": 9}})
    assert [label.partition(",")[0] for label in found.labels[:6]] == ["rigid body"] * 6
    np.testing.assert_allclose(frequencies(scene, 9)[6:], expected, rtol=1e-3)


def test_a_quarter_with_two_planes_of_symmetry_is_the_whole() -> None:
    quarter = {"clamped": "symmetric", "lower": "symmetric", "tip": HARD, "upper": HARD}
    expected = [2 * PI2, 10 * PI2, 10 * PI2, 18 * PI2]
    np.testing.assert_allclose(4 * frequencies(plate(0.001, quarter)), expected, rtol=1e-3)


def write(path: Path, turn: float | None = None, inner: float = 0.0, size: float = 0.17, radius: float = 1.0) -> Path:
    """Write a square with the edges a to d, turned by an angle (rad), or a disk with the edges "rim" and "hole"."""
    gmsh.initialize([], False, False, False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        model, occ = gmsh.model, gmsh.model.occ
        face = occ.addDisk(0, 0, 0, radius, radius) if turn is None else occ.addRectangle(0, 0, 0, 1, 1)
        if inner:
            occ.cut([(2, face)], [(2, occ.addDisk(0, 0, 0, inner, inner))])
        occ.rotate([(2, face)], 0, 0, 0, 0, 0, 1, turn or 0.0)
        occ.synchronize()
        for name, (_, curve) in zip("abcd", model.getBoundary([(2, face)]), strict=False):
            round_edge = "rim" if model.getBoundingBox(1, abs(curve))[3] > 0.9 * radius else "hole"
            model.addPhysicalGroup(1, [abs(curve)], name=round_edge if turn is None else name)
        model.addPhysicalGroup(2, [face], name="plate")
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def test_edges_along_no_axis_are_held_as_those_along_one(tmp_path: Path) -> None:
    """Springs hold their tilt, to 1e-4 of a layer as wide as the thickness."""
    found = [
        frequencies(plate(0.1, dict.fromkeys("abcd", HARD), mesh=str(write(tmp_path / "square.msh", turn))), 3)
        for turn in (0.0, 0.5)
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-5)
    np.testing.assert_allclose(found[0], [19.0650, 45.4827, 45.4827], rtol=1e-4)


@pytest.mark.parametrize(("kind", "expected"), [(HARD, [4.9351, 13.898, 13.898]), ("clamped", [10.2158, 21.26, 21.26])])
def test_disks_without_a_group_clamped(tmp_path: Path, kind: str, expected: list[float]) -> None:
    scene = plate(0.001, {"rim": kind}, mesh=str(write(tmp_path / "disk.msh")))
    np.testing.assert_allclose(frequencies(scene, 3), expected, rtol=1e-3)


def test_stiff_springs_hold_and_soft_ones_let_a_rigid_plate_move() -> None:
    """The limits of elastic edges: ω of the plate that is simply supported; √(4 k/m a) of a rigid one on springs."""
    stiff = around({"kind": "elastic", "stiffness": 1e16, "in_plane": "held"})
    expected = frequencies(plate(0.1, around(SOFT)), 2)
    np.testing.assert_allclose(frequencies(plate(0.1, stiff), 2), expected, rtol=1e-5)
    soft = plate(0.1, around({"kind": "elastic", "stiffness": 1.0, "in_plane": "held"}))
    found = rotfem.modes({**soft, "modes": {"count": 1}}).frequencies[0]
    np.testing.assert_allclose(found, math.sqrt(4 * 1.0 / 100.0), rtol=1e-5)


def test_a_stiff_spring_under_the_corner_holds_it() -> None:
    """A cantilever on a spring at both corners of its tip bends as one whose tip is held, across which it is stiff."""
    narrow = plate(0.01, {}, width=0.02, point_supports=[[1.0, -0.01, 1e9], [1.0, 0.01, 1e9]])
    held = plate(0.01, {"tip": {"kind": SOFT, "in_plane": "free"}}, width=0.02)
    np.testing.assert_allclose(frequencies(narrow, 1), frequencies(held, 1), rtol=1e-4)


@pytest.mark.parametrize(
    ("edges", "said"),
    [
        ({"rim": HARD}, "structure.edges = rim: is no named edge of the plate; there are clamped, tip, lower, upper"),
        ({"tip": "pinned"}, "structure.edges.tip.kind"),
        (
            {"tip": {"kind": "elastic"}},
            'structure.edges.tip.stiffness: missing; kind = "elastic" needs it, or rotation',
        ),
        ({"tip": {"kind": HARD, "stiffness": 1.0}}, "structure.edges.tip.stiffness"),
        ({"tip": {"kind": "symmetric", "in_plane": "free"}}, "structure.edges.tip.in_plane"),
    ],
)
def test_bad_edges_are_named(edges: dict[str, Any], said: str) -> None:
    with pytest.raises(rotfem.SceneError) as error:
        rotfem.modes(plate(0.01, edges))
    assert said.replace('"', "") in str(error.value).replace('"', "")


# --- tapers -----------------------------------------------------------------------------------------------------------

#: Frequencies (Hz) of a steel disk of 0.05 and 0.25 m, clamped inside, 12 mm thick there and 4 mm at the rim, at 900
#: rad/s, from a converged Ritz solution of the thin ring with its prestress.
TAPERED = [301.92, 305.66, 305.66, 353.89, 353.89, 489.64]


@pytest.mark.parametrize("way", ["over r", "function", "file"])
def test_a_taper_over_the_radius_needs_no_rings(tmp_path: Path, way: str) -> None:
    (tmp_path / "taper.csv").write_text("0.05,12e-3\n0.25,4e-3\n")
    thickness: Any = {
        "over r": {"over": "r", "table": [[0.05, "12 mm"], [0.25, "4 mm"]]},
        "file": {"over": "r", "table": str(tmp_path / "taper.csv")},
        "function": lambda x, y: 12e-3 - 8e-3 * (math.hypot(x, y) - 0.05) / 0.2,
    }[way]
    mesh = str(write(tmp_path / "ring.msh", inner=0.05, size=0.03, radius=0.25))
    scene = plate(1.0, {"hole": "clamped"}, mesh=mesh, E=210e9, rho=7850.0) | {"modes": {"count": 6}}
    scene["structure"]["thickness"], scene["motion"]["speed"] = thickness, 900.0
    np.testing.assert_allclose(rotfem.modes(scene).frequencies_hz, TAPERED, rtol=1e-3)


def test_a_material_over_the_place_is_that_of_the_middle_where_it_does_not_change() -> None:
    same = plate(0.01, {}) | {"mesh": {"elements": [4, 4], "degree": 2}}
    varying = {
        "E": {"over": "x", "table": [[0, 1e9], [0.5, 1e9], [1, 1e9]]},
        "rho": lambda x, y: 1000.0,
        "nu": [[0, 0.3], [1, 0.3]],
    }
    other = same | {"structure": same["structure"] | varying}
    found = [rotfem.modes({**scene, "modes": {"count": 3}}).frequencies for scene in (same, other)]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


@pytest.mark.parametrize(
    ("thickness", "said"),
    [
        ([[0.0, 0.01], [1.0, 0.02]], "say what the table of a mesh is over"),
        ({"over": "z", "table": [[0.0, 0.01], [1.0, 0.02]]}, "structure.thickness.over"),
        (lambda x, y: x, "must be greater than 0, as at"),
        ({"plate": 0.01, "wing": 0.01}, "wing"),
    ],
)
def test_bad_tapers_are_named(tmp_path: Path, thickness: Any, said: str) -> None:
    scene = plate(1.0, {"rim": "clamped"}, mesh=str(write(tmp_path / "disk.msh", size=0.5)))
    scene["structure"]["thickness"] = thickness
    with pytest.raises(rotfem.SceneError, match=said):
        rotfem.modes(scene)
