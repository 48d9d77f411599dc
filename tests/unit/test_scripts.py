"""What a script meets: short representations, signatures with types, units, errors of its own functions."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

import pytest

import rotfem
from rotfem.errors import InputError

SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2}


def tables(**more: Any) -> dict[str, Any]:
    return {
        "structure": {"type": "planar_beam", "length": 10.0, "section": SECTION},
        "motion": {"type": "constant", "speed": 3.0},
        "mesh": {"elements": 2},
        "time": {"end": 0.2, "step": 0.05},
        "output": {"error": False},
        **more,
    }


def problem() -> rotfem.Problem:
    beam, mesh = rotfem.PlanarBeam(length="1000 cm", section=SECTION), rotfem.BeamMesh(elements=2)
    return rotfem.Problem(structure=beam, motion=rotfem.Motion.constant_speed("30 rpm"), mesh=mesh)


# --- representations --------------------------------------------------------------------------------------------------


def test_representations_are_short() -> None:
    many = [[float(t), 1.0 + t] for t in range(500)]
    scene = rotfem.Scene.from_dict(tables(motion={"type": "table", "table": many}))
    pulses = tuple((float(t), t + 0.5, 2.0) for t in range(500))
    shown = [
        scene,
        *(getattr(scene, name) for name in type(scene).model_fields),
        rotfem.Problem.of(scene),
        problem(),
        rotfem.Motion.from_table(many),
        rotfem.FreeHub(3.0, rotfem.Torque(pulses)),
        rotfem.Loads(tip_force=[0.0, 1.0]),
        problem().replace(loads=rotfem.Loads(tip_force=[0.0, 1.0])).loads,
        rotfem.GeneralisedAlpha(),
        next(iter(problem().march(end=0.1, step=0.1))),
    ]
    for thing in shown:
        assert len(repr(thing)) < 500, type(thing)
        assert len(str(thing)) < 500, type(thing)
    assert repr(problem().structure).startswith("PlanarBeamStructure(length=10.0, section=PlanarSection(EA=28000000.0")


# --- units ------------------------------------------------------------------------------------------------------------


def test_scripts_take_the_units_that_scenes_take() -> None:
    made = problem()
    assert made.structure.length == pytest.approx(10.0, rel=1e-15)
    assert made.motion.speed(0.0) == pytest.approx(3.141592653589793, rel=1e-15)
    assert rotfem.PlanarBeam(length=1.0, section=SECTION | {"EA": "28 MN"}).section.EA == 2.8e7
    assert rotfem.Motion.spin_up("6 rad/s", "0.25 min").settled == 15.0
    assert rotfem.FreeHub("3000 kg*cm^2", speed="60 rpm").inertia == pytest.approx(0.3, rel=1e-14)
    assert rotfem.Loads(gravity=(0, 0, "-981 cm/s^2")).gravity[2] == pytest.approx(-9.81, rel=1e-15)
    pushed = made.replace(loads=rotfem.Loads(tip_force={"over_time": [[0, 0, 0], ["1 s", 0, "2 kN"]]}))
    assert pushed.loads.named["tip_force"].at(0.5)[1] == 1000.0
    assert made.modes(count=1, speed="60 rpm").speed == pytest.approx(6.283185307179586, rel=1e-15)
    assert [moment.t for moment in made.march(end="100 ms", step="0.1 s")] == [0.0, 0.1]


@pytest.mark.parametrize(
    "make",
    [
        lambda: rotfem.PlanarBeam(length="3 kg", section=SECTION),
        lambda: rotfem.Motion.constant_speed("3 kg"),
        lambda: rotfem.Loads(tip_force=["3 kg", 0]),
        lambda: rotfem.FreeHub("much"),
        lambda: problem().steady(speed="12 rpn"),
    ],
)
def test_a_wrong_unit_is_bad_input(make: Callable[[], Any]) -> None:
    with pytest.raises(InputError, match=r"is no unit|must be a number"):
        make()


def test_speeds_are_shown_in_the_unit_that_they_are_given_in() -> None:
    given = tables(motion={"type": "constant", "speed": "30 rpm"})
    assert rotfem.Scene.from_dict(given).output.speed == "rpm"
    assert rotfem.Scene.from_dict(given | {"output": {"speed": "Hz"}}).output.speed == "Hz"
    assert rotfem.Scene.from_dict(tables()).output.speed == "rad/s"
    assert rotfem.Scene.from_dict(tables()).showing("speed", "0:60:7rpm").output.speed == "rpm"
    assert rotfem.Scene.from_dict(given).showing("speed", "0:1:7Hz").output.speed == "rpm", "what the scene says counts"


# --- functions of the user --------------------------------------------------------------------------------------------


def fails(*_: Any) -> float:
    raise KeyError("oops")


def fails_late(t: float) -> float:
    return 1.0 if t < 0.12 else {}["oops"]


CASES: dict[str, tuple[str, Callable[[], Any]]] = {
    "load": ("loads.tip_force", lambda: rotfem.run(tables(loads={"tip_force": lambda t: fails()}))),
    "over span": ("loads.distributed", lambda: rotfem.run(tables(loads={"distributed": {"over_span": fails}}))),
    "speed": ("motion.speed", lambda: rotfem.run(tables(motion={"type": "callable", "speed": fails_late}))),
    "base": (
        "motion.base_acceleration",
        lambda: rotfem.run(tables(motion={"type": "constant", "speed": 1.0, "base_acceleration": fails})),
    ),
    "torque": (
        "motion.function",
        lambda: rotfem.run(
            tables(motion={"type": "torque", "hub_inertia": 3.0, "function": lambda t, psi, psi_dot, tip: fails()})
        ),
    ),
    "term": ("terms.air", lambda: rotfem.run(tables(), terms={"air": fails})),
    "output": ("outputs.x", lambda: rotfem.run(tables(), outputs={"x": fails})),
    "motion": ("motion.speed", lambda: problem().replace(motion=rotfem.Motion.from_functions(fails)).steady()),
}


@pytest.mark.parametrize("case", CASES)
def test_an_error_of_a_function_is_bad_input_with_its_traceback(case: str) -> None:
    key, make = CASES[case]
    with pytest.raises(InputError, match="KeyError: 'oops'") as caught:
        make()
    assert caught.value.key == key
    assert isinstance(caught.value.__cause__, KeyError)
    assert "in fails" in "".join(traceback.format_exception(caught.value))
