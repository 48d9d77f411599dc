"""What nothing moves is left out: the same motion, exact zeros, and all that moves stays in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import run
from rotfem.commands.problem import Problem
from rotfem.scene import as_scene
from rotfem.selection.left_out import leave_out

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
ACROSS = {"table": [[0.0, 0.0, 0.0, 0.0], [0.3, 0.0, 0.0, 2.0]]}
WITHIN = {"table": [[0.0, 0.0, 0.0, 0.0], [0.3, 1.0, 2.0, 0.0]]}


def scene(structure: dict[str, Any], theory: str, spin: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return a history that is long enough to be looked at."""
    elements = 2 if structure["type"] == "spatial_beam" else [4, 2]
    steps = 1500 if structure["type"] == "spatial_beam" else 350
    return {
        "structure": structure,
        "motion": spin,
        "model": {"theory": theory},
        "mesh": {"elements": elements},
        "time": {"end": 0.3, "step": 0.3 / steps, "output_every": steps // 50},
        **more,
    }


def spun(axis: list[float], speed: float = 2.0) -> dict[str, Any]:
    return {"type": "spin_up", "speed": speed, "duration": 0.5, "axis": axis}


TORQUE = {"type": "torque", "hub_inertia": 20.0, "pulses": [[0.0, 0.1, 100.0]]}
STILL = {"type": "constant", "speed": 0.0}
LEFT_OUT = {
    "in the plane of rotation": (BEAM, "reissner", spun([0, 0, 1]), {"loads": {"tip_force": WITHIN}}, {"u3", "theta1"}),
    "across it": (BEAM, "von_karman", spun([0, 1, 0]), {"loads": {"tip_force": ACROSS}}, {"u2", "theta1", "theta3"}),
    "prestressed": (BEAM, "consistent_linear", spun([0, 0, -1]), {}, {"u3", "theta1", "theta2"}),
    "free hub": (BEAM, "reissner", TORQUE, {}, {"u3", "theta1", "theta2"}),
    "sprung about another axis": (
        BEAM | {"root": {"flap_stiffness": 1e3, "flap_damping": 5.0}},
        "reissner",
        spun([0, 0, 1]),
        {},
        {"u3", "theta1", "theta2"},
    ),
    "plate in its plane": (PLATE, "reissner", spun([0, 0, 1]), {}, {"u3", "alpha1", "alpha2"}),
    "plate that bends": (PLATE, "linear", STILL, {"loads": {"distributed": ACROSS}}, {"u1", "u2"}),
}


#: Of the beams one in every run: each has forms of its own, with all unknowns and without some.
SELDOM = ("across it", "prestressed", "free hub", "sprung about another axis")


@pytest.mark.parametrize("case", [pytest.param(c, marks=pytest.mark.nightly) if c in SELDOM else c for c in LEFT_OUT])
def test_the_motion_is_that_with_all_unknowns(case: str) -> None:
    """To the tolerances of Newton and of old factors, 1e-9 of the largest value; what is left out is 0 exactly."""
    structure, theory, spin, more, names = LEFT_OUT[case]
    data = scene(structure, theory, spin, **more)
    less, full = run(data), run({**data, "model": {"theory": theory, "all_unknowns": True}})
    assert names <= set(less.summary["left_out"]["unknowns"])
    assert less.summary["left_out"]["unstable_since"] is None
    assert "left_out" not in full.summary
    assert less.summary["dofs"] < 0.7 * full.summary["dofs"]
    assert list(less.history) == list(full.history)
    length = structure["length"]
    for name, values in full.history.items():
        size = length if name.startswith("tip_u") else max(1.0, np.max(np.abs(values)))
        digits = 1e-7 if name.startswith("root_") else 1e-9  # the last increments times the stiffness EA/h
        np.testing.assert_allclose(less.history[name], values, rtol=0.0, atol=digits * size, err_msg=name)
    for name in less.summary["left_out"]["unknowns"]:
        assert np.all(less.history[f"tip_{name}"] == 0.0)


COUPLED = np.diag([2.8e7, 1e7, 1e7, 1e4, 1.4e4, 2e4])
COUPLED[3, 5] = COUPLED[5, 3] = 1e-3 * 1e4
MASS = np.diag([1.2, 1.2, 1.2, 1.5e-3, 6e-4, 9e-4])
STIRRED = {
    "an axis beside the normal": (BEAM, {"motion": spun([0, 0.01, 1])}),
    "a load across": (BEAM, {"loads": {"tip_force": ACROSS}}),
    "gravity across": (BEAM, {"loads": {"gravity": [0.0, 0.0, -9.81]}}),
    "pretwist": (BEAM | {"pretwist": 0.01}, {}),
    "a tip body beside the plane": (BEAM | {"tip_mass": 1.0, "tip_offset": [0.0, 0.0, 1e-3]}, {}),
    "a hub beside the plane": (BEAM | {"hub_offset": [0.1, 0.0, 1e-3]}, {"motion": spun([0, 1, 1])}),
    "a section that couples": (BEAM | {"section": {"stiffness": COUPLED.tolist(), "mass": MASS.tolist()}}, {}),
}


def test_a_pressure_lets_a_plate_bend_alone() -> None:
    """It has one component, that along the normal."""
    loads = {"pressure": {"over_time": [[0.0, 0.0], [0.3, 2.0]]}}
    bends, within = (
        leave_out(Problem.of(as_scene(scene(PLATE, "linear", spin, loads=loads))))[0].left_out
        for spin in (STILL, spun([0, 0, 1]))
    )
    assert set(bends) == {"u1", "u2"}
    assert within == ()


@pytest.mark.parametrize("case", STIRRED)
def test_what_may_be_moved_stays_in(case: str) -> None:
    """Symmetric but for one thing, however small, of loads, spin or structure."""
    structure, more = STIRRED[case]
    data = scene(structure, "reissner", spun([0, 0, 1]), **{k: v for k, v in more.items() if k != "motion"})
    data["motion"] = more.get("motion", data["motion"])
    problem, beside = leave_out(Problem.of(as_scene(data)))
    assert problem.left_out == ()
    assert beside is None


def test_lateral_buckling_is_told() -> None:
    """A blade that is stiff in its plane leaves it above the tip force 4.013 √(EI GJ)/L² (Timoshenko & Gere 1961).

    A ramp of a hundred periods meets it at its time; of the motion 4 to 8 states are looked at, so it is told within
    a quarter of the ramp, and within 2 % before, for deflection and inertia in the plane.
    """
    section = BEAM["section"] | {"EI3": 2.0e7, "EI2": 1.4e4, "GJ": 1e4}
    critical = 4.0126 * np.sqrt(1.4e4 * 1e4) / 100.0
    ramp = {"table": [[0.0, 0.0, 0.0, 0.0], [6.0, 0.0, 2 * critical, 0.0]]}
    data = scene(BEAM | {"section": section}, "reissner", STILL, loads={"tip_force": ramp})
    data |= {"time": {"end": 6.0, "step": 4e-3}, "mesh": {"elements": 4}}
    result = run(data)
    since = result.summary["left_out"]["unstable_since"]
    assert 0.98 * 3.0 <= since <= 1.02 * 3.0 + 6.0 / 4
    assert any("left out" in line for line in result.summary["warnings"])


def test_stability_under_constant_conditions_is_that_in_all_directions() -> None:
    """The same blade under 1.5 times that force, held: its equilibrium in the plane is one that it would leave."""
    section = BEAM["section"] | {"EI3": 2.0e7}
    held = {"value": [0.0, 1.5 * 4.0126 * np.sqrt(1.4e4 * 1e4) / 100.0, 0.0]}
    data = scene(BEAM | {"section": section}, "reissner", STILL, loads={"tip_force": held})
    data["time"] = {"end": 1.0, "step": 1e-4, "output_every": 1000}
    less, full = run(data), run({**data, "model": {"theory": "reissner", "all_unknowns": True}})
    assert less.summary["dofs"] < full.summary["dofs"]
    assert less.summary["left_out"]["unstable_since"] is not None
    assert less.summary["stability"]["stable"] is False
    for name, value in full.summary["stability"].items():
        assert less.summary["stability"][name] == pytest.approx(value, rel=1e-6)
