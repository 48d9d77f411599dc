"""What nothing moves is left out: the same motion, exact zeros, and all that moves stays in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem import run
from rotfem.commands.problem import Problem
from rotfem.mechanics.problem import inactive_unknowns
from rotfem.registry import damping_models
from rotfem.scene import as_scene
from rotfem.scene.beams import PointMass, SpatialBeamStructure
from rotfem.scene.plates import PlateStructure
from rotfem.scene.structure import SpatialRoot
from rotfem.scene.supports import SupportTable

BEAM: dict[str, Any] = {
    "type": "spatial_beam",
    "length": 10.0,
    "section": {
        "EA": 2.8e7,
        "GA2": 1e7,
        "GA3": 1e7,
        "GJ": 1e4,
        "EI2": 1.4e4,
        "EI3": 2.0e4,
        "mass_per_length": 1.2,
        "rotary_inertia2": 6e-4,
        "rotary_inertia3": 9e-4,
    },
}
PLATE: dict[str, Any] = {
    "type": "plate",
    "length": 4.0,
    "width": 1.0,
    "thickness": 0.05,
    "E": 7e10,
    "nu": 0.3,
    "rho": 2700.0,
}
ACROSS = {"over_time": [[0.0, 0.0, 0.0, 0.0], [0.3, 0.0, 0.0, 2.0]]}
WITHIN = {"over_time": [[0.0, 0.0, 0.0, 0.0], [0.3, 1.0, 2.0, 0.0]]}


def scene(structure: dict[str, Any], theory: str, spin: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return a history of 60 steps."""
    elements = 2 if structure["type"] == "spatial_beam" else [4, 2]
    return {
        "structure": structure,
        "motion": spin,
        "model": {"theory": theory},
        "mesh": {"elements": elements},
        "time": {"end": 0.3, "step": 5e-3},
        **more,
    }


def spun(axis: list[float], speed: float = 2.0) -> dict[str, Any]:
    return {"type": "spin_up", "speed": speed, "duration": 0.5, "axis": axis}


STILL = {"type": "constant", "speed": 0.0}
SWEPT = BEAM | {"sweep": [[0.0, 0.1], [10.0, 0.3]], "tip_mass": 1.0, "tip_offset": [0.1, 0.2, 0.0]}
CONED = BEAM | {
    "precone": 0.1,
    "section": BEAM["section"] | {"mass_center": [0.0, 0.1], "tension_center": [0.0, 0.05]},
}
WITHIN_PLANE = {"u3", "theta1", "theta2"}
#: Other structures, theories and schemes in `tests.pairs`.
LEFT_OUT = {
    "in the plane of rotation": (BEAM, "reissner", spun([0, 0, 1]), {"loads": {"tip_force": WITHIN}}, WITHIN_PLANE),
    "swept, with a body on an arm": (
        SWEPT,
        "consistent_linear",
        spun([0, 0, 1]),
        {"loads": {"tip_force": WITHIN}},
        WITHIN_PLANE,
    ),
    "plate in its plane": (PLATE, "reissner", spun([0, 0, 1]), {}, {"u3", "alpha1", "alpha2"}),
    "plate that bends": (PLATE, "linear", STILL, {"loads": {"distributed": ACROSS}}, {"u1", "u2"}),
}


@pytest.mark.parametrize("case", LEFT_OUT)
def test_the_motion_is_that_with_all_unknowns(case: str) -> None:
    """To the tolerances of Newton and of old factors, 1e-9 of the largest value; what is left out is 0 exactly."""
    structure, theory, spin, more, names = LEFT_OUT[case]
    data = scene(structure, theory, spin, **more)
    less, full = run(data), run({**data, "model": {"theory": theory, "all_unknowns": True}})
    assert names == set(less.summary["left_out"]["unknowns"])
    assert "left_out" not in full.summary
    assert less.summary["dofs"] < 0.7 * full.summary["dofs"]
    assert list(less.history) == list(full.history)
    length = structure["length"]
    for name, values in full.history.items():
        size = length if name.startswith("tip_u") else max(1.0, np.max(np.abs(values)))
        # Forces are the last increments times the stiffness EA/h.
        digits = 1e-7 if name.startswith("root_") else 1e-9
        np.testing.assert_allclose(less.history[name], values, rtol=0.0, atol=digits * size, err_msg=name)
    for name in less.summary["left_out"]["unknowns"]:
        assert np.all(less.history[f"tip_{name}"] == 0.0)


COUPLED = np.diag([2.8e7, 1e7, 1e7, 1e4, 1.4e4, 2e4])
COUPLED[3, 5] = COUPLED[5, 3] = 1e-3 * 1e4
MASS = np.diag([1.2, 1.2, 1.2, 1.5e-3, 6e-4, 9e-4])
LINED = {key: value for key, value in BEAM.items() if key != "length"} | {"line": [[0, 0, 0], [5, 0, 0], [10, 0, 1]]}
STIRRED = {
    "an axis beside the normal": (BEAM, {"motion": spun([0, 0.01, 1])}),
    "a load across": (BEAM, {"loads": {"tip_force": ACROSS}}),
    "a moment about an axis in the plane": (BEAM, {"loads": {"tip_moment": [0.0, 1.0, 0.0]}}),
    "a moment per length about one": (BEAM, {"loads": {"distributed_moment": [1.0, 0.0, 0.0]}}),
    "sweep out of the plane": (BEAM | {"sweep": 0.1}, {"motion": spun([0, 1, 0])}),
    "precone out of the plane": (BEAM | {"precone": 0.1}, {}),
    "a pitched root": (BEAM | {"root": {"pitch": 0.1}}, {}),
    "a line out of the plane": (LINED, {}),
    "damping by mode": (BEAM | {"damping": {"modal": 0.01}}, {}),
    "gravity across": (BEAM, {"loads": {"gravity": [0.0, 0.0, -9.81]}}),
    "pretwist": (BEAM | {"pretwist": 0.01}, {}),
    "a tip body beside the plane": (BEAM | {"tip_mass": 1.0, "tip_offset": [0.0, 0.0, 1e-3]}, {}),
    "a hub beside the plane": (BEAM | {"hub_offset": [0.1, 0.0, 1e-3]}, {"motion": spun([0, 1, 1])}),
    "a section that couples": (BEAM | {"section": {"stiffness": COUPLED.tolist(), "mass": MASS.tolist()}}, {}),
}


def found(data: dict[str, Any]) -> set[str]:
    """Return the unknowns of a scene that are known to stay zero."""
    return set(inactive_unknowns(Problem.of(as_scene(data))))


def test_curved_and_coned_beams_keep_to_the_plane_that_holds_them() -> None:
    """A swept beam to that of its spin, a coned one to the other, with arms and centres in the plane too."""
    assert found(scene(SWEPT, "reissner", spun([0, 0, 1]))) == WITHIN_PLANE
    assert found(scene(CONED, "reissner", spun([0, 1, 0]))) == {"u2", "theta1", "theta3"}
    assert not found(scene(CONED, "reissner", spun([0, 0, 1])))


def test_a_pressure_lets_a_plate_bend_alone() -> None:
    """It has one component, that along the normal; one that follows the plate has others where it bends."""
    loads = {"pressure": {"over_time": [[0.0, 0.0], [0.3, 2.0]], "kind": "dead"}}
    assert found(scene(PLATE, "linear", STILL, loads=loads)) == {"u1", "u2"}
    assert found(scene(PLATE, "consistent_linear", STILL, loads=loads)) == {"u1", "u2"}
    assert not found(scene(PLATE, "reissner", STILL, loads=loads))
    assert not found(scene(PLATE, "linear", spun([0, 0, 1]), loads=loads))
    loads["pressure"]["kind"] = "follower"
    assert not found(scene(PLATE, "linear", STILL, loads=loads))


@pytest.mark.parametrize("case", STIRRED)
def test_what_may_be_moved_stays_in(case: str) -> None:
    """Symmetric but for one thing, however small, of loads, spin or structure."""
    structure, more = STIRRED[case]
    data = scene(structure, "reissner", spun([0, 0, 1]), **{k: v for k, v in more.items() if k != "motion"})
    data["motion"] = more.get("motion", data["motion"])
    assert not found(data)


def test_what_a_script_adds_is_not_known_to_be_symmetric() -> None:
    """A term or a damping model of its own may push anywhere, an output may ask for any component."""
    data = scene(BEAM, "reissner", spun([0, 0, 1]))
    assert found(data) == {"u3", "theta1", "theta2"}
    rotfem.register(rotfem.DampingModel("sideways", lambda m, delta, c: 0))
    try:
        assert not found(scene(BEAM | {"damping": {"sideways": 1.0}}, "reissner", spun([0, 0, 1])))
    finally:
        damping_models.remove("sideways")
    for more in ({"terms": {"push": lambda m, v: 0}}, {"outputs": {"twist": lambda m: 0}}):
        assert inactive_unknowns(Problem.of(as_scene(data), **more)) == ()


#: Keys of structures that `is_symmetric` knows, or that every plane of symmetry allows.
KNOWN = {
    SpatialBeamStructure: {
        *("type", "length", "hub_radius", "hub_offset", "tip_mass", "tip_inertia", "tip_offset", "masses", "section"),
        *("pretwist", "sweep", "line", "precone", "root", "supports", "couplings", "damping"),
    },
    SpatialRoot: {
        *("lag_stiffness", "lag_damping", "hinge_offset", "flap_stiffness", "flap_damping", "pitch_stiffness"),
        *("pitch_damping", "pitch", "driven", "free"),
    },
    PointMass: {"x", "mass", "offset", "inertia", "polar_inertia", "transverse_inertia", "disk"},
    SupportTable: {"x", "stiffness", "damping", "tilt_stiffness", "tilt_damping", "housing", "frame"},
    PlateStructure: {
        *("type", "length", "width", "mesh", "thickness", "E", "nu", "E1", "E2", "nu12", "G12", "G13", "G23", "rho"),
        *("shear_correction", "hub_radius", "hub_offset", "point_masses", "line_masses", "damping"),
        *("edges", "point_supports"),
    },
}


@pytest.mark.parametrize("table", KNOWN, ids=lambda table: table.__name__)
def test_every_key_of_a_structure_is_known_to_keep_its_symmetry_or_to_break_it(table: Any) -> None:
    """A new key has to be decided on in `is_symmetric`; what a section says is in its two matrices."""
    assert set(table.model_fields) == KNOWN[table]


def test_stability_under_constant_conditions_is_that_in_all_directions() -> None:
    """The same blade under 1.5 times that force, held: its equilibrium in the plane is one that it would leave."""
    section = BEAM["section"] | {"EI3": 2.0e7}
    held = {"value": [0.0, 1.5 * 4.0126 * np.sqrt(1.4e4 * 1e4) / 100.0, 0.0]}
    data = scene(BEAM | {"section": section}, "reissner", STILL, loads={"tip_force": held})
    data["initial"] = {"state": "undeformed"}
    less, full = run(data), run({**data, "model": {"theory": "reissner", "all_unknowns": True}})
    assert less.summary["dofs"] < full.summary["dofs"]
    assert less.summary["stability"]["stable"] is False
    for name, value in full.summary["stability"].items():
        assert less.summary["stability"][name] == pytest.approx(value, rel=1e-6)
