"""Blades whose sections vary along the span in all they have: against a linear beam code of their own, in numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial.transform import Rotation

import rotfem
from rotfem.scene import Scene, SpatialBeamStructure
from tests.beam_matrices import frequencies

Array = npt.NDArray[np.float64]

#: A blade with all its centres beside the axis, each with a table of its own, and 30° of twist.
CENTRES: dict[str, Any] = {
    "EA": [[0.0, 4e4], [0.4, 2e4], [1.0, 1e4]],
    "GA2": [[0.0, 1.3e4], [1.0, 4e3]],
    "GA3": [[0.0, 1.1e4], [1.0, 3e3]],
    "GJ": [[0.0, 1.0], [1.0, 0.3]],
    "EI2": [[0.0, 1.0], [0.4, 0.5], [1.0, 0.2]],
    "EI3": [[0.0, 8.0], [1.0, 2.0]],
    "mass_per_length": [[0.0, 1.0], [0.4, 0.8], [1.0, 0.3]],
    "rotary_inertia2": [[0.0, 3e-4], [1.0, 1e-4]],
    "rotary_inertia3": [[0.0, 2e-3], [1.0, 5e-4]],
    "mass_center": [[0.0, 0.0, 0.0], [0.4, -0.02, 0.005], [1.0, -0.01, 0.01]],
    "shear_center": [[0.0, 0.0, 0.0], [0.7, 0.03, -0.01], [1.0, 0.02, 0.0]],
    "tension_center": [[0.0, -0.01, 0.0], [1.0, 0.02, 0.01]],
}
#: Without the stretch of twisted fibers, which 6×6 sections do not have.
MODEL = {"theory": "consistent_linear", "effects": ["coriolis", "centrifugal", "rotary_inertia"]}
TWIST = [[0.0, 0.5], [0.4, 0.2], [1.0, -0.02]]


def blade(section: dict[str, Any], more: dict[str, Any] | None = None) -> Scene:
    structure = {"type": "spatial_beam", "length": 1.0, "pretwist": TWIST, "section": section}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 6}}
    return Scene.from_dict(tables | {"model": MODEL, "mesh": {"elements": 8}}).replace(more or {})


def found(scene: Scene) -> Array:
    return np.array([row["frequency"] for row in rotfem.modes(scene).rows])


def twisted(x: float) -> Array:
    """Return the section axes at x as columns: turned about axis 1 by the twist."""
    return Rotation.from_euler("x", np.interp(x, *np.array(TWIST).T)).as_matrix()


def matrices_of(scene: Scene) -> tuple[Any, Any]:
    structure = scene.structure
    assert isinstance(structure, SpatialBeamStructure)
    return structure.section.at, structure.section


def test_centres_by_tables() -> None:
    # Torsion, flap and lag are all coupled; 8 elements of degree 3 are good to 1.5e-5 here. The centres of the tables
    # change every frequency by far more than that.
    scene = blade(CENTRES)
    at, _ = matrices_of(scene)
    exact = frequencies([0.0, 0.4, 0.7, 1.0], lambda x: tuple(at(x).values()), twisted)[:6]
    np.testing.assert_allclose(found(scene), exact, rtol=2e-5)
    bare = {key: value for key, value in CENTRES.items() if not key.endswith("center")}
    straight, _ = matrices_of(blade(bare))
    without = frequencies([0.0, 0.4, 0.7, 1.0], lambda x: tuple(straight(x).values()), twisted)[:6]
    assert np.all(np.abs(without / exact - 1) > 1e-4)


def test_matrices_by_tables() -> None:
    # Full matrices at the rows, linear between, as the reader of the file would have them; with a skew product of
    # inertia, and a moment J₁ that is not J₂ + J₃, as printed digits have it.
    at, section = matrices_of(blade(CENTRES))
    rows = section.knots
    stiffness = [[x, at(x)["stiffness"]] for x in rows]
    mass = [[x, at(x)["mass"] + np.diag([0, 0, 0, 1e-6, 0, 0])] for x in rows]
    for _, M in mass:
        M[4, 5] = M[5, 4] = M[4, 5] + 1e-4
    scene = blade({"stiffness": stiffness, "mass": mass})

    def linear(x: float) -> tuple[Array, Array]:
        both = []
        for table in (stiffness, mass):
            flat = np.array([np.ravel(M) for _, M in table])
            both.append(np.array([np.interp(x, rows, column) for column in flat.T]).reshape(6, 6))
        return both[0], both[1]

    # 4e-5 is the mesh's: it falls to 2e-6 with twice the elements and to 7e-8 with four times.
    exact = frequencies(rows, linear, twisted)[:6]
    np.testing.assert_allclose(found(scene), exact, rtol=6e-5)


def test_same_blade_in_both_ways_spins_alike() -> None:
    # Uniform, so that tables of centres and of matrices mean the same blade: round-off and no more between them.
    uniform = {key: value[0][1:] if key.endswith("center") else value[0][1] for key, value in CENTRES.items()}
    uniform["shear_center"], uniform["mass_center"] = [0.03, -0.01], [-0.02, 0.005]
    spinning = {"motion": {"type": "constant", "speed": 3.0, "axis": [0.1, -0.2, 1.0]}}
    by_numbers = blade(uniform, spinning)
    M = matrices_of(by_numbers)[0](0.0)
    tables = {key: [[0.0, value], [1.0, value]] for key, value in M.items()}
    np.testing.assert_allclose(found(blade(tables, spinning)), found(by_numbers), rtol=1e-9)


def test_principal_axes_turned_in_the_section() -> None:
    # With centres on the axis that is pretwist; with centres beside it they stay where they are, as the matrices say.
    bare = {key: value for key, value in CENTRES.items() if not key.endswith("center")}
    still = {"motion": {"type": "constant", "speed": 3.0}}
    angle = [[x, value - 0.3] for x, value in TWIST]
    turned = blade(bare | {"principal_angle": angle}, still | {"structure.pretwist": 0.3})
    np.testing.assert_allclose(found(turned), found(blade(bare, still)), rtol=1e-9)
    angle = [[0.0, 0.4], [1.0, -0.2]]
    scene = blade(CENTRES | {"principal_angle": angle})
    at, _ = matrices_of(scene)
    exact = frequencies([0.0, 0.4, 0.7, 1.0], lambda x: tuple(at(x).values()), twisted)[:6]
    np.testing.assert_allclose(found(scene), exact, rtol=2e-5)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("stiffness", [[0.0, np.eye(6)], [0.5, np.eye(6)]], "must run from x = 0 to the length 1; it ends at 0.5"),
        ("stiffness", [[0.0, np.eye(6)], [1.0, np.eye(5)]], "at x = 1 it must be a symmetric 6×6 matrix"),
        ("stiffness", [[0.0, np.eye(6)], [1.0, -np.eye(6)]], "at x = 1 it .*positive definite"),
        ("stiffness", [[0.5, np.eye(6)], [1.0, np.eye(6)]], "must start at x = 0"),
        ("stiffness", [[0.0, np.eye(6)], [0.0, np.eye(6)]], "at least two rows at different x"),
        ("stiffness", [[0.0, np.eye(6)]], "at least two rows"),
        (
            "mass",
            [[0.0, np.eye(6)], [1.0, np.diag([1.0, 2.0, 1.0, 1.0, 1.0, 1.0])]],
            "at x = 1 it must be that of rigid",
        ),
        ("mass", np.diag([1.0, 2.0, 1.0, 1.0, 1.0, 1.0]), "must be that of rigid mass"),
    ],
)
def test_bad_tables_of_matrices(key: str, value: Any, message: str) -> None:
    section = {"stiffness": np.eye(6), "mass": np.eye(6)} | {key: value}
    with pytest.raises(rotfem.SceneError, match=rf"structure\.section\.{key}.*{message}"):
        blade(section)


@pytest.mark.parametrize("value", [[0.0], [[0.0, 1.0], [1.0, 2.0]], [[0.0, 0.0, 0.0]], [[0.0, 0, 0], [0.0, 1, 1]], "x"])
def test_bad_centres(value: Any) -> None:
    with pytest.raises(rotfem.SceneError, match=r"structure\.section\.mass_center"):
        blade(CENTRES | {"mass_center": value})
