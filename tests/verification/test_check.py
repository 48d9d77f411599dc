"""`rotfem check`: integrals over structures against closed forms, and what it says of slips."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

import rotfem
from rotfem.scene import Scene

CONSTANT = {"type": "constant", "speed": 1.0}


def checked(structure: dict[str, Any], **more: Any) -> Any:
    return rotfem.check(Scene.from_dict({"structure": structure, "motion": CONSTANT, "mesh": {"elements": 4}, **more}))


def test_tapered_beam_with_a_tip() -> None:
    # m = 3 − x on 0 … 2, hub 0.5, a tip mass of 4: ∫m = 4, ∫m x = 10/3, ∫m x² = 4; rotary inertia 0.1 along all.
    section = {"EA": 1.0, "GA": 1.0, "EI": 1.0, "mass_per_length": [[0, 3], [2, 1]], "rotary_inertia": 0.1}
    found = checked({"type": "planar_beam", "length": 2.0, "hub_radius": 0.5, "tip_mass": 4.0, "section": section})
    assert found.mass == pytest.approx(8.0, rel=1e-12)
    first = 10 / 3 + 4.0 * 2.0
    np.testing.assert_allclose(found.summary["first_moment_root"], [first, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.center_of_mass, [0.5 + first / 8.0, 0.0, 0.0], atol=1e-12)
    second = 4.0 + 4.0 * 4.0
    assert found.inertia[2, 2] == pytest.approx(second + 0.2, rel=1e-12)
    about_axis = second + 2 * 0.5 * first + 0.25 * 8.0 + 0.2
    assert found.summary["inertia_axis"] == pytest.approx(about_axis, rel=1e-12)


def test_blade_with_everything_turned() -> None:
    # A straight blade by a line in any direction: its tensor is that along axis 1, turned. Uniform, mass centre beside
    # the axis by c: E = ∫ x xᵀ dm with x = s t₁ + c, and 3 and 5 of rotary inertia about section axes 2 and 3.
    section = {"EA": 1e3, "GA2": 1e3, "GA3": 1e3, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 2.0}
    section |= {"rotary_inertia2": 3.0, "rotary_inertia3": 5.0, "mass_center": [0.1, -0.2]}
    tip = {"tip_mass": 1.5, "tip_offset": [0.3, 0.0, 0.1], "tip_inertia": 0.4}
    direction = np.array([0.8, 0.36, 0.48])
    line = [[0.0, 0.0, 0.0], (3.0 * direction).tolist()]
    structure = {"type": "spatial_beam", "line": line, "section": section, "hub_offset": [1.0, 2.0, 3.0], **tip}
    found = checked(structure, model={"effects": ["gravity"]})
    second = np.cross([0.0, 0.0, 1.0], direction)
    second /= np.linalg.norm(second)
    T = np.stack([direction, second, np.cross(direction, second)], axis=-1)
    c, end = T @ [0.0, 0.1, -0.2], T @ [3.3, 0.0, 0.1]
    mass, first = 7.5, 6.0 * (1.5 * direction + c) + 1.5 * end
    assert found.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(found.summary["first_moment_root"], first, rtol=1e-9)
    E = 2.0 * 9.0 * np.outer(direction, direction) + 9.0 * (np.outer(direction, c) + np.outer(c, direction))
    E += 6.0 * np.outer(c, c) + T @ np.diag([0.0, 15.0, 9.0]) @ T.T + 1.5 * np.outer(end, end) + 0.2 * np.eye(3)
    np.testing.assert_allclose(found.inertia, np.trace(E) * np.eye(3) - E, rtol=1e-9, atol=1e-9)
    origin = found.summary["inertia_axis"]
    center = np.array(found.center_of_mass)
    steiner = np.array(found.summary["inertia_center"])[2, 2] + mass * (center[0] ** 2 + center[1] ** 2)
    assert origin == pytest.approx(steiner, rel=1e-10)


def test_columns_are_those_given_whatever_the_way() -> None:
    # Central properties come back out of the matrices that they were put into; axes are where the line is.
    section = {"EA": [[0, 1e4], [2, 5e3]], "GA2": 3e3, "GA3": 2e3, "GJ": 5.0, "EI2": 7.0, "EI3": 11.0}
    section |= {"mass_per_length": 2.0, "rotary_inertia2": 3e-3, "rotary_inertia3": 5e-3, "pretwist": 0.3}
    section |= {
        "mass_center": [0.01, -0.02],
        "shear_center": [0.03, 0.01],
        "tension_center": [[0, 0, 0], [2, 0.02, -0.01]],
    }
    found = checked({"type": "spatial_beam", "length": 2.0, "section": section, "sweep": [[0, 0], [2, 0.5]]})
    c = found.columns
    np.testing.assert_allclose(c["EA"], np.interp(c["x"], [0, 2], [1e4, 5e3]), rtol=1e-12)
    for name in ("GA2", "GA3", "GJ", "EI2", "EI3", "rotary_inertia2", "rotary_inertia3"):
        np.testing.assert_allclose(c[name], section[name], rtol=1e-10)
    np.testing.assert_allclose(c["tension_center_z"], -0.005 * c["x"], atol=1e-12)
    np.testing.assert_allclose([c["shear_center_y"], c["shear_center_z"]], [[0.03] * len(c["x"]), [0.01] * len(c["x"])])
    np.testing.assert_allclose([c["mass_center_y"], c["mass_center_z"]], [[0.01] * len(c["x"]), [-0.02] * len(c["x"])])
    radius = 2.0 / 0.5
    np.testing.assert_allclose(c["axis_1"], radius * np.sin(c["x"] / radius), atol=1e-12)
    np.testing.assert_allclose(c["axis_2"], radius * (1 - np.cos(c["x"] / radius)), atol=1e-12)
    assert found.warnings == []


def test_pitch_turns_a_bent_blade_at_its_root() -> None:
    # Uniform, and kinked at .5: centres of mass of axis and bodies are one; t2 at the root, and t1 beyond the kink.
    section = {"EA": 1e3, "GA2": 1e3, "GA3": 1e3, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 2.0}
    sweep, beta, pitch = [[0, 0], [0.5, 0], [0.5, 0.6], [1, 0.6]], 0.2, 0.5
    beam = {"type": "spatial_beam", "length": 1.0, "section": section, "sweep": sweep, "precone": beta}
    cone = np.array([[np.cos(beta), 0, -np.sin(beta)], [0, 1, 0], [np.sin(beta), 0, np.cos(beta)]])
    across = cone @ [0, np.cos(pitch), np.sin(pitch)]
    for over_time in (pitch, {"value": pitch - 0.1, "harmonic": {"amplitude": 0.1, "frequency": 1.0}}):
        found = checked(beam | {"root": {"pitch": over_time}})
        c = found.columns
        axis = np.stack([c[f"axis_{i}"] for i in (1, 2, 3)], axis=-1)
        np.testing.assert_allclose(trapezoid(axis, c["x"], axis=0), found.center_of_mass, atol=1e-12)
        np.testing.assert_allclose([c[f"t2_{i}"][0] for i in (1, 2, 3)], across, atol=1e-12)
        beyond = np.cos(0.6) * cone[:, 0] + np.sin(0.6) * across
        kink = int(np.argmin(np.abs(c["x"] - 0.5)))  # where the outer side counts
        np.testing.assert_allclose([c[f"t1_{i}"][kink] for i in (1, 2, 3)], beyond, atol=1e-12)


def test_plate() -> None:
    plate = {"type": "plate", "length": 2.0, "width": 1.0, "thickness": 0.1, "E": 1e9, "nu": 0.3, "rho": 1000.0}
    found = checked({**plate, "hub_radius": 1.0, "point_masses": [[2.0, 0.5, 10.0]]}, mesh={"elements": [4, 2]})
    assert found.mass == pytest.approx(210.0, rel=1e-12)
    np.testing.assert_allclose(found.center_of_mass, [(200 * 2.0 + 10 * 3.0) / 210, 5.0 / 210, 0.0], atol=1e-12)
    # About axis 1, through the middle: m (b² + h²)/12, with h² of the director, and the point.
    assert found.inertia[0, 0] == pytest.approx(200 * (1.0 + 0.01) / 12 + 10 * 0.25, rel=1e-10)


def test_slips_are_told(tmp_path: Path) -> None:
    section = {"EA": 1e9, "GA2": 1e8, "GA3": 1e8, "GJ": 1e5, "EI2": 1e7, "EI3": [[0, 1e7], [5, 1e4], [10, 1e4]]}
    section |= {"mass_per_length": 50.0, "rotary_inertia2": 0.5, "rotary_inertia3": 500.0, "mass_center": [0.0, 0.9]}
    found = checked({"type": "spatial_beam", "length": 10.0, "pretwist": 13.3, "section": section})
    said = "\n".join(found.warnings)
    for word in ("pretwist is 13.3 rad", "EI3 changes 1e+03 times", "gyration about axis 3", "mass_center lies"):
        assert word in said
    assert {path.name for path in found.write(tmp_path)} == {"check.csv", "summary.json"}
    assert found.plot(tmp_path / "check.png") is not None
