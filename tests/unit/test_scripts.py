"""What a script meets: short representations, signatures with types, units, errors of its own functions."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from inspect import signature
from pathlib import Path
from typing import Any

import pytest
import typer

import rotfem
from rotfem.commands.cli import app
from rotfem.commands.verbs import OF_SCRIPTS, VERBS
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


# --- Python is the command line ---------------------------------------------------------------------------------------

#: Options that are no keyword: of the terminal, `Scene.replace`, and `hint`.
OF_THE_TERMINAL = {"as_json", "quiet", "debug", "overrides", "no_advice", "help"}


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_is_a_keyword_and_every_keyword_an_option(verb: str) -> None:
    commands: Any = typer.main.get_command(app)
    options = {str(option.name) for option in commands.commands[verb].params}
    keywords = set(signature(getattr(rotfem, verb)).parameters)
    given = {name.removeprefix("no_") for name in options - OF_THE_TERMINAL}
    assert given == keywords - set(OF_SCRIPTS)
    assert all(option.help for option in commands.commands[verb].params)


@pytest.mark.parametrize(
    ("verb", "options", "wanted"),
    [
        ("run", {"plots": False}, {"history.csv", "shape.csv", "summary.json"}),
        ("modes", {"state_space": True, "matrices": True, "plots": False}, {"state_space.npz", "M.mtx"}),
        ("campbell", {"speeds": "0:30:3rpm", "orders": "1,2", "operating": "10:20rpm"}, {"campbell.png"}),
        ("check", {"report": True}, {"check.csv", "report.html"}),
    ],
)
def test_keywords_write_what_options_write(
    verb: str, options: dict[str, Any], wanted: set[str], tmp_path: Path
) -> None:
    getattr(rotfem, verb)(tables(), folder=tmp_path, **options)
    assert wanted <= {path.name for path in tmp_path.iterdir()}


def test_modes_at_a_speed_are_those_of_the_scene_at_that_speed() -> None:
    at = rotfem.modes(tables(), speed="60 rpm")
    scene = rotfem.Scene.from_dict(tables()).replace({"motion.speed": "60 rpm"})
    assert at.frequencies == pytest.approx(rotfem.modes(scene, error=False).frequencies, rel=1e-12)
    table = tables(motion={"type": "table", "table": [[0, 0], [1, 1]], "axis": [0, 0, -1]})
    assert rotfem.modes(table, speed=2.0).speed == 2.0


def test_sweep_over_a_key_with_its_table() -> None:
    scene = rotfem.Scene.from_dict(tables())
    swept = rotfem.sweep(scene, {"motion.speed": [1.0, "30 rpm"], "modes.count": [1]}, "modes", speed=None)
    alone = rotfem.modes(scene.replace({"motion.speed": "30 rpm", "modes.count": 1}))
    assert swept.to_pandas()["frequency_1"].iloc[1] == pytest.approx(alone.frequencies[0], rel=1e-12)
    with pytest.raises(InputError, match="unexpected keyword argument 'sped'"):
        rotfem.sweep(scene, {"motion.speed": [1.0, 2.0]}, "modes", sped=1)
