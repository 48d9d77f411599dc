"""Scenes: what is accepted, what it becomes, and what every bad scene is told."""

from __future__ import annotations

import copy
import json
import pickle
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import rotfem
from rotfem.commands.problem import motion_of
from rotfem.errors import Fault, SceneError
from rotfem.scene import (
    PlateStructure,
    Scene,
    SpatialBeamStructure,
    load_scene,
)
from rotfem.scene.motion import TableMotion
from tests.beams import STRUCTURE

SECTION = STRUCTURE["section"]
PLANAR = {"type": "planar_beam", "length": 10.0, "section": SECTION}
SPATIAL_SECTION = {"EA": 3.0, "GA2": 1.0, "GA3": 2.0, "GJ": 5.0, "EI2": 7.0, "EI3": 11.0, "mass_per_length": 13.0}
SPATIAL = {"type": "spatial_beam", "length": 2.0, "section": SPATIAL_SECTION}
PLATE = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, "E": 70e9, "nu": 0.3, "rho": 2700.0}
STRUCTURES = {"planar": PLANAR, "spatial": SPATIAL, "plate": PLATE}
SPIN_UP = {"type": "spin_up", "speed": 6.0, "duration": 15.0}

SCENES = Path(__file__).resolve().parents[1] / "scenes"
SPIN = ("coriolis", "centrifugal")
#: The example scenes, and the effects each of them has.
EXAMPLES = {
    "blade_modes": (*SPIN, "rotary_inertia", "trapeze", "tip_mass"),
    "hub_torque": (*SPIN, "euler", "rotary_inertia", "hub_coupling"),
    "iccia_hub_beam": (*SPIN, "euler", "rotary_inertia"),
    "plate_modes": (*SPIN, "rotary_inertia"),
    "spin_up": (*SPIN, "euler", "rotary_inertia"),
}


def tables(kind: str = "planar", /, **changes: Any) -> dict[str, Any]:
    """Returns tables of a valid scene, changed at dotted keys (written with __ for the dot)."""
    data: dict[str, Any] = {
        "structure": copy.deepcopy(STRUCTURES[kind]),
        "motion": {"type": "constant", "speed": 3.0},
    }
    for path, value in changes.items():
        *parents, key = path.split("__")
        table = data
        for parent in parents:
            table = table.setdefault(parent, {})
        table[key] = value
    return data


def scene(kind: str = "planar", /, **changes: Any) -> Scene:
    return Scene.from_dict(tables(kind, **changes), "test.toml")


def refused(kind: str = "planar", /, **changes: Any) -> SceneError:
    with pytest.raises(SceneError) as caught:
        scene(kind, **changes)
    assert caught.value.file == "test.toml"
    assert str(caught.value).startswith("test.toml: ")
    return caught.value


# --- the example scenes ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_example_scenes_are_valid_and_survive_a_round_trip(name: str) -> None:
    loaded = load_scene(SCENES / f"{name}.toml")
    assert loaded.name == name
    loaded.check_run()
    assert json.loads(json.dumps(loaded.to_dict())) == loaded.to_dict()
    written = tomllib.loads(tomli_w.dumps(loaded.to_dict()))
    assert Scene.from_dict(written).to_dict() == loaded.to_dict()
    assert rotfem.Problem.of(loaded).effective_effects() == EXAMPLES[name]


# --- defaults and normal forms --------------------------------------------------------------------------------------


def test_plate_elements_may_be_one_number() -> None:
    assert scene("plate", mesh__elements=4).mesh.elements == (4, 4)
    assert scene("plate", mesh__elements=[2, 3]).mesh.elements == (2, 3)


def test_pretwist_and_precone_in_either_table() -> None:
    twist = [[0, 0], [2, 0.3]]
    inside = scene("spatial", structure__section__pretwist=twist, structure__section__precone=0.1)
    outside = scene("spatial", structure__pretwist=twist, structure__precone=0.1)
    assert inside.to_dict() == outside.to_dict()
    assert isinstance(inside.structure, SpatialBeamStructure)
    assert inside.structure.pretwist == ((0.0, 0.0), (2.0, 0.3))


def test_tip_inertia_of_a_spatial_beam() -> None:
    isotropic = scene("spatial", structure__tip_inertia=2.0).structure
    full = scene("spatial", structure__tip_inertia=[[2, 0.1, 0], [0.1, 3, 0], [0, 0, 4]]).structure
    assert isinstance(isotropic, SpatialBeamStructure)
    assert isinstance(full, SpatialBeamStructure)
    np.testing.assert_array_equal(isotropic.bodies["tip"].inertia_matrix, 2 * np.eye(3))
    np.testing.assert_array_equal(full.bodies["tip"].inertia_matrix, [[2, 0.1, 0], [0.1, 3, 0], [0, 0, 4]])


def test_loads_in_all_their_forms() -> None:
    def made(kind: str = "planar", /, **loads: Any) -> Any:
        """Return the loads of a scene as sums of shapes times amplitudes, by name."""
        return rotfem.Problem.of(scene(kind, loads=loads)).loads.named

    bare = made(tip_force=[1, 2])["tip_force"]
    np.testing.assert_array_equal(bare.at(7.0), [1, 2, 0])
    assert (bare.kind, bare.constant, bare.is_zero) == ("dead", True, False)
    table = made(distributed={"over_time": [[0, 0, 0], [2, 4, 8]], "kind": "follower"})["distributed"]
    np.testing.assert_allclose([table.at(t) for t in (-1, 0.5, 9)], [[0, 0, 0], [1, 2, 0], [4, 8, 0]])
    assert (table.kind, table.constant) == ("follower", False)
    np.testing.assert_array_equal(made(tip_moment=5)["tip_moment"].at(0.0), [5.0])
    spatial = made("spatial", distributed_moment={"value": [1, 2, 3]})["distributed_moment"]
    np.testing.assert_array_equal(spatial.at(0.0), [1, 2, 3])
    zero = made(tip_force=[[0, 0, 0], [1, 0, 0]])["tip_force"]
    assert zero.is_zero
    assert zero.constant


def test_base_acceleration_as_table_and_function() -> None:
    table = motion_of(scene(motion__base_acceleration=[[0, 1, 0, 0], [2, 3, 0, 0]]))
    np.testing.assert_allclose(table.base_acceleration(1.0), [2, 0, 0])
    assert table.base is not None
    assert (table.constant, table.is_accelerated, table.base.knots) == (False, True, (0.0, 2.0))
    function = motion_of(scene(motion__base_acceleration=lambda t: (t, -t)))
    assert (function.constant, function.is_accelerated) == (False, True)
    np.testing.assert_allclose(function.base_acceleration(2.0), [2, -2, 0])


def test_numpy_values_are_welcome() -> None:
    s = scene(
        structure__length=np.float64(10),
        structure__hub_radius=1,
        mesh__elements=np.int64(4),
        loads__gravity=np.array([0, -9.81]),
    )
    assert (s.mesh.elements, type(s.structure.hub_radius)) == (4, float)
    assert s.loads.gravity == (0.0, -9.81, 0.0)


def test_scene_is_frozen_and_survives_pickling() -> None:
    s = scene()
    with pytest.raises(SceneError, match="length: cannot be set"):
        s.structure.length = 3.0
    again = pickle.loads(pickle.dumps(s))
    assert (again.to_dict(), again.name) == (s.to_dict(), s.name)


def test_from_dict_does_not_change_its_argument() -> None:
    data = tables("spatial", structure__section__pretwist=0.1, mesh__elements=3)
    before = copy.deepcopy(data)
    Scene.from_dict(data)
    assert data == before


def test_to_dict_shows_functions_by_name() -> None:
    def whirl(t: float) -> float:
        return 2.0 * t

    d = scene(motion={"type": "callable", "speed": whirl}).to_dict()
    assert d["motion"]["speed"] == "<callable whirl>"
    assert "rate" not in d["motion"]
    tomli_w.dumps(d)


def test_replace() -> None:
    s = scene(time={"end": 1, "step": 0.1})
    adaptive = s.replace({"time.scheme": "esdirk4", "time.step": None, "time.tolerance": 1e-3})
    assert adaptive.time is not None
    assert s.time is not None
    assert (adaptive.time.scheme, adaptive.time.step, adaptive.time.tolerance) == ("esdirk4", None, 1e-3)
    assert (s.time.step, adaptive.name) == (0.1, s.name)
    with pytest.raises(SceneError, match="model.theory"):
        s.replace({"model.theory": "exact"})


# --- effects --------------------------------------------------------------------------------------------------------

SPUN = "coriolis centrifugal rotary_inertia"
TORQUE = "motion={type='torque', hub_inertia=1"
#: Override of a beam at constant speed ↦ the effects that it has.
EFFECTS = {
    "modes.count=6": SPUN,
    "motion.speed=0": "rotary_inertia",
    "motion={type='spin_up', speed=6, duration=15}": f"{SPUN} euler",
    "motion={type='table', table=[[0, 0], [1, 0]]}": "rotary_inertia",
    "motion={type='table', table=[[0, 0], [1, 1]]}": f"{SPUN} euler",
    f"{TORQUE}, coupled=false}}": f"{SPUN} euler",
    f"{TORQUE}}}": f"{SPUN} euler hub_coupling",
    "motion.base_acceleration=[1, 0]": f"{SPUN} base",
    "motion.base_acceleration=[0, 0]": SPUN,
    "loads.gravity=[0, -9.81]": f"{SPUN} gravity",
    "structure.section.rotary_inertia=0": "coriolis centrifugal",
    "structure.damping.kelvin_voigt=1e-3": f"{SPUN} damping",
    "structure.root.lag_stiffness=0": f"{SPUN} root_springs",
    "structure.tip_inertia=1e-3": f"{SPUN} tip_mass",
    "model.frame='inertial'": "rotary_inertia",
    "model.effects=['gravity', 'tip_mass', 'damping', 'base', 'centrifugal']": "centrifugal",
    "model.effects=[]": "",
}


@pytest.mark.parametrize("override", EFFECTS)
def test_effective_effects(scene_file: Path, override: str) -> None:
    effects = rotfem.Problem.of(load_scene(scene_file, [override])).effective_effects()
    assert set(effects) == set(EFFECTS[override].split())
    assert list(effects) == [name for name in rotfem.registry.effects.names if name in effects]


# --- check_run ------------------------------------------------------------------------------------------------------


def test_check_run() -> None:
    scene().check_run()
    scene(motion=SPIN_UP, time={"end": 1, "step": 0.1}).check_run()
    with pytest.raises(SceneError, match="spin_up") as caught:
        scene(motion=SPIN_UP).check_run()
    assert caught.value.key == "time"
    with pytest.raises(SceneError, match="accuracy = 1e-3 beside") as caught:
        scene(motion=SPIN_UP, time={"end": 1}).check_run()
    assert caught.value.key == "time.step"
    for key, start in (("tip_displacement", 0.1), ("velocity", [[0, 0, 0], [10, 0, 1]])):
        with pytest.raises(SceneError, match=r"needs \[time\]") as caught:
            scene(initial={key: start}).check_run()
        assert caught.value.key == f"initial.{key}"


# --- errors ---------------------------------------------------------------------------------------------------------


def test_orthotropic_plate() -> None:
    material = {"E1": 140e9, "E2": 10e9, "nu12": 0.3, "G12": 5e9}
    plate = {key: value for key, value in PLATE.items() if key not in ("E", "nu")} | material
    structure = scene(structure=plate).structure
    assert isinstance(structure, PlateStructure)
    assert structure.is_orthotropic
    assert "not stable" in str(refused(structure=plate | {"nu12": 4.0}))


def test_message_shows_file_key_value_and_what_is_allowed() -> None:
    assert str(refused(structure__length=-1.0)) == "test.toml: structure.length = -1.0: must be greater than 0"
    error = refused(structure__lenght=1.0)
    assert str(error).startswith(
        'test.toml: structure.lenght: unknown key; did you mean "length"? allowed: type, length'
    )


def test_all_problems_are_listed() -> None:
    error = refused(structure__length=-1.0, mesh__elements=0, model__theory="x")
    assert [problem.key for problem in error.problems] == ["structure.length", "model.theory", "mesh.elements"]
    first, *others = str(error).splitlines()
    assert first.endswith("(and 2 more)")
    assert others[1].strip() == "mesh.elements = 0: must be at least 1"


# --- files and overrides --------------------------------------------------------------------------------------------


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "my_beam.toml"
    path.write_text(tomli_w.dumps(tables()))
    return path


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"absent\.toml: no such file"):
        load_scene(tmp_path / "absent.toml")
    with pytest.raises(SceneError, match="is a directory"):
        load_scene(tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[structure]\nlength = = 3\n", r"not valid TOML: .*line 2, column 10"),
        (b"[structure\n", r"not valid TOML: .*line 1"),
        (b"a = '\xff'\n", "byte 5 is not UTF-8"),
        (b"", "structure: required key is missing"),
    ],
)
def test_unreadable_toml(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=message):
        load_scene(path)


def test_overrides(scene_file: Path) -> None:
    loaded = load_scene(
        scene_file,
        ["model.theory=linear", "motion.speed = 7", "time.end=2", "time.step=0.5", 'model.frame="rotating"',
         "loads.tip_force=[1, 2]", "motion.speed=8"],
    )  # fmt: skip
    assert (loaded.model.theory, loaded.to_dict()["motion"]["speed"]) == ("linear", 8.0)
    assert loaded.time is not None
    assert loaded.time.step == 0.5
    assert loaded.to_dict()["loads"]["tip_force"]["value"] == [1.0, 2.0, 0.0]


@pytest.mark.parametrize("override", ["model.theory", "=linear", "model.theory=", "model..theory=x", "a b=1", ""])
def test_bad_override_syntax(scene_file: Path, override: str) -> None:
    with pytest.raises(SceneError, match="table.key=value") as caught:
        load_scene(scene_file, [override])
    assert f'"{override}"' in str(caught.value)


def test_overrides_reach_entries_of_lists(scene_file: Path) -> None:
    set_ = ["structure.masses=[{x=1, mass=2}, {x=5, mass=3}]", "structure.masses.1.mass='4 kg'"]
    assert [body.mass for body in load_scene(scene_file, set_).structure.masses] == [2.0, 4.0]
    with pytest.raises(SceneError, match=r"structure.masses = .*: has no entry 2, so structure.masses.2.x"):
        load_scene(scene_file, [*set_, "structure.masses.2.x=1"])


def test_relative_paths_start_at_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "speed.csv").write_text("t, Omega  # s, rad/s\n0, 0\n# ramp\n1.5, 3\n")
    (folder / "blade.msh").write_text("")
    (folder / "a.toml").write_text(tomli_w.dumps(tables(motion={"type": "table", "table": "speed.csv"})))
    plate = {key: value for key, value in PLATE.items() if key not in ("length", "width")}
    plate |= {"mesh": "blade.msh", "thickness": {"skin": 0.01, "spar": 0.02}}
    (folder / "b.toml").write_text(tomli_w.dumps(tables(structure=plate)))
    monkeypatch.chdir(tmp_path)

    motion = load_scene("case/a.toml").motion
    assert isinstance(motion, TableMotion)
    assert motion.table == ((0.0, 0.0), (1.5, 3.0))

    loaded = load_scene("case/b.toml")
    assert isinstance(loaded.structure, PlateStructure)
    assert loaded.structure.mesh == str(folder / "blade.msh")
    assert loaded.structure.thickness == {"skin": 0.01, "spar": 0.02}
    assert Scene.from_dict(loaded.to_dict()).to_dict() == loaded.to_dict()
    with pytest.raises(SceneError, match="no meaning with structure.mesh"):
        load_scene("case/b.toml", ["mesh.elements=3"])


# --- the errors themselves ------------------------------------------------------------------------------------------


def test_scene_error_survives_pickling() -> None:
    error = SceneError("a.toml", "mesh.degree", 9, "must be at most 6", [Fault("time", None, "missing")])
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "a.toml: mesh.degree = 9: must be at most 6 (and 1 more)\n  time: missing"
    assert again.problems == error.problems


@pytest.mark.parametrize(
    ("length", "width", "elements"),
    [(1.0, 1.0, (8, 8)), (2.0, 1.0, (8, 8)), (10.0, 1.0, (16, 4)), (1.0, 20.0, (4, 16)), (1000.0, 1.0, (32, 2))],
)
def test_cells_by_the_aspect_ratio_of_a_plate(length: float, width: float, elements: tuple[int, int]) -> None:
    """64 cells, more of them along the longer side; those that are given stay, in a variant of another shape too."""
    s = scene("plate", structure__length=length, structure__width=width)
    assert s.mesh.elements == elements
    assert s.replace({"structure.length": width}).mesh.elements == (8, 8)
    given = scene("plate", structure__length=length, structure__width=width, mesh__elements=[3, 5])
    assert given.mesh.elements == (3, 5)
    assert given.replace({"structure.length": 7 * width}).mesh.elements == (3, 5)
