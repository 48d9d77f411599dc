"""What a script meets: short representations, signatures with types, units, errors of its own functions."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from inspect import signature
from pathlib import Path
from typing import Any

import pytest
import typer
import ufl
from matplotlib.figure import Figure

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


# --- as in a notebook -------------------------------------------------------------------------------------------------

CELL = """
import rotfem

def spring(m, delta):
    return sum(STIFFNESS * m.k.q[1] * delta.of(body)[1] * body.measure for body in m.positions())

rotfem.register(rotfem.Effect("bed", spring))
"""


@pytest.fixture
def bed() -> Iterator[None]:
    yield
    rotfem.registry.effects.remove("bed")


def test_a_cell_registers_a_name_again(bed: None) -> None:
    """A bed of stiffness k under a rod of mass ρA adds k/ρA to ω²."""
    squares = []
    for stiffness in ("0.0", "1.2"):
        exec(CELL.replace("STIFFNESS", stiffness), {})
        squares.append(rotfem.modes(tables(motion={"type": "constant", "speed": 0.0}), error=False).frequencies[0] ** 2)
    assert squares[1] - squares[0] == pytest.approx(1.0, rel=1e-6)
    with pytest.raises(ValueError, match="'bed' is the name of another effect already; replace=True"):
        exec(CELL, {"__file__": "two.py"})
    exec(CELL.replace("spring))", "spring), replace=True)"), {"__file__": "two.py"})
    with pytest.raises(ValueError, match="'coriolis' is the name of another effect"):
        exec(CELL.replace("bed", "coriolis"), {})


def test_campbell_on_axes_of_a_figure_of_ones_own() -> None:
    diagram = rotfem.campbell(tables(modes={"count": 2}), "0:30:3rpm", orders=2, error=False)
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert diagram.plot(ax=left, orders=[1, 3]) is figure
    assert {"Ω", "3Ω", "1st edgewise"} <= {text.get_text() for text in left.texts}
    assert "2Ω" not in {text.get_text() for text in left.texts}
    assert left.lines
    assert not right.lines


def test_a_scene_that_is_written_reads_back_equal(tmp_path: Path) -> None:
    (tmp_path / "spin.csv").write_text("0, 0\n1, 2\n")
    given = tables(
        motion={"type": "table", "table": "spin.csv"}, loads={"tip_force": {"over_time": [[0, 0, 1], [1, 0, 2]]}}
    )
    scene = rotfem.Scene.from_dict(given, directory=tmp_path)
    back = rotfem.load_scene(scene.write(tmp_path / "there" / "scene.toml", "# a remark\n"))
    assert back == scene
    assert back != scene.replace({"time.end": 0.3})
    with pytest.raises(rotfem.SceneError, match="holds a Python function"):
        scene.replace({"loads.tip_force": lambda t: [0.0, t]}).write(tmp_path / "scene.toml")


def test_a_scene_is_not_changed_and_says_so_in_a_line() -> None:
    scene = rotfem.Scene.from_dict(tables())
    with pytest.raises(InputError, match=r"^ConstantMotion: speed: cannot be set, .*scene\.replace.*$"):
        scene.motion.speed = 2.0


@pytest.mark.parametrize(
    ("strains", "said"),
    [
        (lambda q: (q[0].dx(0), q[2].dx(0)), "returns 2 strains, a planar beam needs 3"),
        (lambda q: (q[0].dx(0), q[1].dx(0) - q[3], q[2].dx(0)), r"q has 3 entries \(u1, u2, alpha\)"),
    ],
)
def test_what_a_theory_of_a_user_lacks(strains: Any, said: str) -> None:
    rotfem.register(rotfem.Theory("of_mine", 3.5, {"planar_beam": strains}))
    try:
        with pytest.raises(ValueError, match=said):
            rotfem.Problem.of(tables(model={"theory": "of_mine"})).system()
    finally:
        rotfem.registry.theories.remove("of_mine")


def test_explain_goes_on_without_an_effect_that_the_theory_cannot_have(bed: None) -> None:
    def root(m: Any, delta: Any) -> Any:
        size = ufl.sqrt(1 + ufl.inner(m.frame.w, m.frame.w))
        return sum(size * m.k.q[1] * delta.of(body)[1] * body.measure for body in m.positions())

    rotfem.register(rotfem.Effect("bed", root))
    rows = rotfem.explain(tables(model={"theory": "linear"}, mesh={"elements": 1})).to_pandas()
    assert rows.loc["bed", "verdict"] == "not available"
    assert "is no polynomial" in rows.loc["bed", "why"]
    assert rows.loc["centrifugal", "verdict"] != "not available"


def test_a_problem_has_the_diagram_and_the_response_of_its_scene() -> None:
    force = {"tip_force": {"harmonic": {"amplitude": [0, 1], "frequency": 1}}}
    scene = rotfem.Scene.from_dict(tables(modes={"count": 2}, loads=force, model={"theory": "consistent_linear"}))
    of_scene = rotfem.Problem.of(scene)
    one, other = of_scene.campbell("0:30:3rpm", count=2), rotfem.campbell(scene, "0:30:3rpm", error=False)
    assert one.frequencies == pytest.approx(other.frequencies, rel=1e-12)
    assert one.critical_speeds == other.critical_speeds
    answer = of_scene.response("0.1 Hz", "2 Hz", number=20, count=2, speed="10 rpm")
    at = rotfem.response(scene.replace({"motion.speed": "10 rpm"}), "0.1 Hz", "2 Hz", number=20)
    assert abs(answer.direct - at.direct).max() <= 1e-12 * abs(at.direct).max()
    script = problem().replace(loads=rotfem.Loads(**force))
    assert script.response(number=5, count=1).outputs == answer.outputs
    with pytest.raises(InputError, match="needs a harmonic load"):
        problem().response()


@pytest.mark.parametrize(("verb", "option"), [("modes", "matrices"), ("modes", "animate"), ("check", "report")])
def test_what_is_written_needs_a_folder(verb: str, option: str) -> None:
    with pytest.raises(InputError, match="folder: must be given"):
        getattr(rotfem, verb)(tables(), **{option: 1})
