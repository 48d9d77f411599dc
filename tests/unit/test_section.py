"""Cross-sections: every way of giving one yields the properties of the closed formulas."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem import registry
from rotfem.errors import SceneError
from rotfem.scene import PlanarBeamStructure, Scene, SpatialBeamStructure
from rotfem.scene.section import PlanarSection, SpatialSection
from rotfem.scene.section_shapes import Shape, rectangle

MATERIAL = {"E": 210e9, "nu": 0.3, "rho": 7800.0}
G = 210e9 / 2.6
SPATIAL = {"EA": 3.0, "GA2": 1.0, "GA3": 2.0, "GJ": 5.0, "EI2": 7.0, "EI3": 11.0, "mass_per_length": 13.0}
X = np.array([0.0, 0.5, 2.0])


def planar(**section: Any) -> PlanarSection:
    structure = {"type": "planar_beam", "length": 2.0, "section": section}
    scene = Scene.from_dict({"structure": structure, "motion": {"type": "constant", "speed": 1.0}})
    assert isinstance(scene.structure, PlanarBeamStructure)
    return scene.structure.section


def spatial(**section: Any) -> SpatialSection:
    structure = {"type": "spatial_beam", "length": 2.0, "section": section}
    scene = Scene.from_dict({"structure": structure, "motion": {"type": "constant", "speed": 1.0}})
    assert isinstance(scene.structure, SpatialBeamStructure)
    return scene.structure.section


def test_material_way_default_and_given_shear_correction() -> None:
    default = planar(**MATERIAL, area=2e-3, second_moment=4e-6).at(X)
    np.testing.assert_allclose(default["EA"], 210e9 * 2e-3)
    np.testing.assert_allclose(default["GA"], 5 / 6 * G * 2e-3)
    np.testing.assert_allclose(default["EI"], 210e9 * 4e-6)
    np.testing.assert_allclose(default["mass_per_length"], 7800 * 2e-3)
    np.testing.assert_allclose(default["rotary_inertia"], 7800 * 4e-6)
    given = planar(**MATERIAL, area=2e-3, second_moment=4e-6, shear_correction=0.5).at(X)
    np.testing.assert_allclose(given["GA"], 0.5 * G * 2e-3)


@pytest.mark.parametrize(
    ("shape", "area", "second_moment", "correction"),
    [
        ({"shape": "rectangle", "width": 0.1, "height": 0.2}, 0.02, 0.1 * 0.2**3 / 12, 10 * 1.3 / (12 + 11 * 0.3)),
        ({"shape": "circle", "radius": 0.1}, np.pi * 0.01, np.pi / 4 * 1e-4, 6 * 1.3 / (7 + 6 * 0.3)),
        (
            {"shape": "tube", "outer_radius": 0.1, "inner_radius": 0.05},
            np.pi * 0.0075,
            np.pi / 4 * (0.1**4 - 0.05**4),
            6 * 1.3 * 1.25**2 / (8.8 * 1.25**2 + 23.6 * 0.25),
        ),
        # A thin tube tends to Cowper's own limit 2(1+ν)/(4+3ν).
        (
            {"shape": "tube", "outer_radius": 1.0, "wall": 1e-6},
            2 * np.pi * 1e-6,
            np.pi * 1e-6,
            2 * 1.3 / (4 + 3 * 0.3),
        ),
    ],
)
def test_shapes(shape: dict[str, Any], area: float, second_moment: float, correction: float) -> None:
    values = planar(**MATERIAL, **shape).at(0.0)
    np.testing.assert_allclose(values["EA"], 210e9 * area, rtol=3e-6)
    np.testing.assert_allclose(values["EI"], 210e9 * second_moment, rtol=3e-6)
    np.testing.assert_allclose(values["GA"], correction * G * area, rtol=3e-6)
    np.testing.assert_allclose(values["mass_per_length"], 7800 * area, rtol=3e-6)


def test_taper_interpolates_dimensions_before_properties() -> None:
    section = planar(**MATERIAL, shape="rectangle", width=0.1, height=[[0.0, 0.2], [0.5, 0.15], [2.0, 0.1]])
    assert not section.uniform
    assert section.knots[1:-1] == [0.5]
    height = np.array([0.2, 0.15, 0.1])
    np.testing.assert_allclose(section.at(X)["EI"], 210e9 * 0.1 * height**3 / 12)
    np.testing.assert_allclose(section.at(1.25)["EI"], 210e9 * 0.1 * 0.125**3 / 12)


def test_incomplete_section_lists_the_possible_sets() -> None:
    with pytest.raises(SceneError) as caught:
        planar(EA=1)
    assert "EA, GA, EI, mass_per_length (optional: rotary_inertia)" in str(caught.value)
    assert 'shape = "tube", outer_radius, wall' in str(caught.value)


def test_a_planar_beam_refuses_a_centroid_off_its_axis_in_the_plane() -> None:
    """The height, along axis 3, is in the plane: a centroid at z bends there under axial forces, one at y does not."""

    def moved(nu: Any, width: Any, height: Any) -> Any:
        return replace(rectangle(nu, width, height), centroid=(width / 2, height - 0.1))

    rotfem.register(Shape("moved", ("width", "height"), moved))
    try:
        assert planar(**MATERIAL, shape="moved", width=0.2, height=0.1).at(0.0)["EA"] == pytest.approx(0.02 * 210e9)
        with pytest.raises(SceneError, match=r"centroid off the axis.*spatial_beam") as caught:
            planar(**MATERIAL, shape="moved", width=0.2, height=[[0.0, 0.1], [2.0, 0.2]])
        assert caught.value.key == "structure.section.shape"
    finally:
        registry.shapes.remove("moved")


def test_spatial_offsets_follow_rigid_body_kinematics() -> None:
    offsets = {"mass_center": [0.1, 0.2], "shear_center": [0.3, -0.1], "tension_center": [-0.2, 0.4]}
    values = spatial(**SPATIAL, rotary_inertia2=0.5, rotary_inertia3=0.25, **offsets).at(0.0)
    rng = np.random.default_rng(1)
    v, w = rng.normal(size=3), rng.normal(size=3)
    motion = np.concatenate([v, w])

    at_mass = v + np.cross(w, [0, 0.1, 0.2])
    kinetic = 13 * at_mass @ at_mass + np.array([0.75, 0.5, 0.25]) @ w**2
    assert motion @ values["mass"] @ motion == pytest.approx(kinetic)

    axial = (v + np.cross(w, [0, -0.2, 0.4]))[0]
    shear = (v + np.cross(w, [0, 0.3, -0.1]))[1:]
    energy = 3 * axial**2 + np.array([1, 2]) @ shear**2 + np.array([5, 7, 11]) @ w**2
    assert motion @ values["stiffness"] @ motion == pytest.approx(energy)


def test_spatial_axial_force_at_the_tension_center_does_not_bend() -> None:
    stiffness = spatial(**SPATIAL, tension_center=[-0.2, 0.4]).at(0.0)["stiffness"]
    y, z, force = -0.2, 0.4, 2.0
    strain = np.linalg.solve(stiffness, [force, 0, 0, 0, z * force, -y * force])
    np.testing.assert_allclose(strain, [force / 3, 0, 0, 0, 0, 0], atol=1e-15)


def test_definiteness_does_not_depend_on_units() -> None:
    section = spatial(stiffness=np.diag([1e12, 1e12, 1e12, 1e-3, 1e-3, 1e-3]), mass=np.diag([1.0, 1, 1, 1, 1, 0]))
    assert section.at(0.0)["stiffness"][5, 5] == 1e-3


@pytest.mark.parametrize(
    ("width", "height", "constant"),
    # Timoshenko & Goodier, Theory of Elasticity, §109: k₁ for side ratios 1, 2 and 10.
    [(1.0, 1.0, 0.1406), (2.0, 1.0, 0.229 * 2), (1.0, 2.0, 0.229 * 2), (10.0, 1.0, 0.312 * 10)],
)
def test_torsion_of_a_rectangle(width: float, height: float, constant: float) -> None:
    stiffness = spatial(**MATERIAL, shape="rectangle", width=width, height=height).at(0.0)["stiffness"]
    assert stiffness[3, 3] / G == pytest.approx(constant, rel=3e-3)


def test_spatial_rectangle_axes_and_mass() -> None:
    values = spatial(**MATERIAL, shape="rectangle", width=0.3, height=0.1).at(0.0)
    stiffness, mass = values["stiffness"], values["mass"]
    flap, lag = 0.3 * 0.1**3 / 12, 0.1 * 0.3**3 / 12
    assert stiffness[4, 4] == pytest.approx(210e9 * flap)
    assert stiffness[5, 5] == pytest.approx(210e9 * lag)
    np.testing.assert_allclose(np.diag(mass)[3:], 7800 * np.array([flap + lag, flap, lag]))


# --- files ----------------------------------------------------------------------------------------------------------

BLADE_CSV = """\
# a blade
x, EA, GA2, GA3, GJ, EI2, EI3, mass_per_length, mass_center_y, pretwist
0, 3, 1, 2, 5, 7, 11, 13, 0.1, 0.5
2, 1.5, 1, 2, 5, 7, 11, 13, 0.3, -0.5
"""


def of_files(folder: Path, section: dict[str, Any], **structure: Any) -> Any:
    structure = {"type": "spatial_beam", "length": 2.0, "section": section, **structure}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 1.0}}
    return Scene.from_dict(tables, directory=folder).structure


def test_file_with_a_column_for_each_property(tmp_path: Path) -> None:
    (tmp_path / "blade.csv").write_text(BLADE_CSV)
    beam = of_files(tmp_path, {"file": "blade.csv", "shear_center": [0.2, 0.0]})
    assert beam.section.EA == ((0.0, 3.0), (2.0, 1.5))
    assert beam.section.mass_center == ((0.0, (0.1, 0.0)), (2.0, (0.3, 0.0)))
    assert beam.pretwist == ((0.0, 0.5), (2.0, -0.5))
    np.testing.assert_allclose(beam.section.center("mass_center", 1.0), [0.2, 0.0])
    np.testing.assert_allclose(beam.section.center("shear_center", 1.0), [0.2, 0.0])


def test_matrices_in_columns_and_in_files_of_their_own(tmp_path: Path) -> None:
    K = np.diag([6.0, 5.0, 4.0, 3.0, 2.0, 1.0]) + 0.1
    upper = K[np.triu_indices(6)]
    names = [f"stiffness_{i + 1}{j + 1}" for i, j in zip(*np.triu_indices(6), strict=True)]
    rows = [",".join(map(str, [x, *upper])) for x in (0.0, 2.0)]
    (tmp_path / "blade.csv").write_text("\n".join([",".join(["x", *names]), *rows]))
    (tmp_path / "upper.csv").write_text("\n".join(rows))
    (tmp_path / "full.csv").write_text("\n".join(",".join(map(str, [x, *K.ravel()])) for x in (0.0, 2.0)))
    mass = np.eye(6).tolist()
    for section in ({"file": "blade.csv"}, {"stiffness": "upper.csv"}, {"stiffness": "full.csv"}):
        beam = of_files(tmp_path, {**section, "mass": mass})
        np.testing.assert_allclose(beam.section.at(0.7)["stiffness"], K, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "section", "message"),
    [
        (BLADE_CSV, {"file": "blade.csv", "EA": 1.0}, r"section\.EA: given twice"),
        (BLADE_CSV.replace("x,", "r,"), {"file": "blade.csv"}, 'x first, not "r"'),
        (BLADE_CSV.replace("EI2", "EI3"), {"file": "blade.csv"}, 'column "EI3" stands twice'),
        (BLADE_CSV.replace("EI2", "EIy"), {"file": "blade.csv"}, r"section\.EIy: unknown key"),
        (
            BLADE_CSV.replace("mass_center_y", "mass_center_2"),
            {"file": "blade.csv"},
            r"section\.mass_center_2: unknown key",
        ),
        (BLADE_CSV.replace(", -0.5", ""), {"file": "blade.csv"}, "line 4 must be 10"),
        (BLADE_CSV.replace("\n2,", "\n1,"), {"file": "blade.csv"}, "it ends at 1"),
        ("0, 3\n2, 1", {"file": "blade.csv"}, "its first row must name the columns"),
        (BLADE_CSV, {"EA": "blade.csv"}, r"section\.EA.*must have at most 2 items"),
        (BLADE_CSV, {"stiffness": "blade.csv"}, r"section\.stiffness.*must be a symmetric 6×6"),
        (BLADE_CSV, {"file": "none.csv"}, r"section\.file.*file not found"),
        (BLADE_CSV, {"file": 1}, r"section\.file.*must be the path of a file"),
    ],
)
def test_bad_files(tmp_path: Path, text: str, section: dict[str, Any], message: str) -> None:
    (tmp_path / "blade.csv").write_text(text)
    with pytest.raises(SceneError, match=message):
        of_files(tmp_path, section)
