"""Parts of a study of cost: coarser settings, front, recommendation, record, tuned scenes; and advice."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.commands.advice import advise
from rotfem.commands.cost.bench import Measurement, Record, fingerprint
from rotfem.commands.cost.result import ERRORS, pareto, recommend, write_tuned
from rotfem.commands.cost.settings import OUTPUTS, allowed_by, check_choice, grid, own_setting
from rotfem.errors import SceneError
from rotfem.refinement.distance import distance, distance_each
from rotfem.refinement.refine import Setting
from rotfem.results.result import Row
from rotfem.scene import Scene, load_scene
from tests.beams import SPIN_UP

BEAM: dict[str, Any] = {
    **SPIN_UP,
    "time": {"end": 20.0, "step": 0.004, "output_every": 5},
}


@pytest.mark.parametrize("order", [2, 3, 4])
def test_the_difference_from_a_coarser_setting_bounds_the_error(order: int) -> None:
    """Of errors C h^p, p ≥ 2, and of C τ and C √τ in the tolerance of adaptive steps."""
    setting = Setting(({"theory": "reissner"},), 20, 3, "esdirk4", 1e-4)
    coarser = setting.coarser()
    assert setting.elements == 20
    assert isinstance(coarser["space"].elements, int)
    assert coarser["space"].elements ** -order - 20**-order >= 20**-order
    assert coarser["time"].tolerance == pytest.approx(4e-4)
    plate = replace(setting, elements=(8, 3))
    assert plate.coarser()["space"] == replace(plate, elements=(5, 2))
    assert "space" not in replace(plate, elements=(1, 1)).coarser()
    file = replace(plate, elements=None)
    assert file.coarser()["space"] == replace(file, degree=2)


def test_eigenvalues_are_each_relative_to_itself() -> None:
    truth, off = np.array([[1.0, 0.0], [100.0, 0.0]]), np.array([[1.1, 0], [100.5, 0]])
    assert distance_each(truth, off) == pytest.approx(0.1)
    assert distance(truth, off) == pytest.approx(0.005)
    assert distance_each(np.array([1j, 100j]), np.array([1.1j, 100.5j])) == pytest.approx(0.1)


def rows(number: int) -> list[Row]:
    """Return rows with random times and errors, some failed."""
    rng = np.random.default_rng(7)
    return [
        {"cost": float(t), "total_error": float(e), "status": "failed" if i % 9 == 0 else "done"}
        | {"candidate": i % 7 > 0}
        for i, (t, e) in enumerate(10.0 ** rng.uniform(-3, 0, (number, 2)))
    ]


def test_front_is_what_no_setting_beats() -> None:
    table = rows(60)
    front = pareto(table)
    done = [row for row in table if row["status"] == "done" and row["candidate"]]
    better = [
        row
        for row in done
        if not any(o["cost"] <= row["cost"] and o["total_error"] <= row["total_error"] and o is not row for o in done)
    ]
    assert sorted(map(id, front)) == sorted(map(id, better))
    assert 1 < len(front) < len(done)
    assert all(a["cost"] < b["cost"] and a["total_error"] > b["total_error"] for a, b in itertools.pairwise(front))


def test_recommendation_is_the_cheapest_that_is_good_enough() -> None:
    table = rows(60)
    good = [row for row in table if row["status"] == "done" and row["candidate"] and row["total_error"] + 1e-3 <= 0.03]
    assert recommend(table, 0.03, 1e-3) is min(good, key=lambda row: row["cost"])
    assert recommend(table, 1e-9) is None


def test_grid_holds_the_scene_itself() -> None:
    scene = Scene.from_dict(BEAM)
    for quick in (True, False):
        settings = grid(scene, "tip", quick, {}, 0.004)
        assert own_setting(scene) in settings
        assert len(settings) == len({setting.key() for setting in settings})
    assert len(grid(scene, "tip", True, {}, 0.004)) < 30


def test_only_what_is_in_the_lists_is_recommended() -> None:
    setting = own_setting(Scene.from_dict(BEAM))
    assert allowed_by(setting, {"theories": None, "steps": [0.004]})
    assert not allowed_by(setting, {"steps": [0.008]})
    assert allowed_by(replace(setting, elements=(4, 2)), {"elements": [[4, 2]]})


@pytest.mark.parametrize(
    ("choice", "says"),
    [
        ({"theories": ["reisner"]}, 'did you mean "reissner"'),
        ({"schemes": ["euler"]}, 'allowed: "generalised_alpha", "newmark"'),
        ({"elements": [0]}, "cost --elements = 0: must be at least 1"),
        ({"steps": [-0.1]}, "cost --steps = -0.1: must be greater than 0"),
        ({"steps": [21.0]}, "at most time.end = 20"),
        ({"degrees": [3, 9]}, "cost --degrees = 9: must be at most 6"),
    ],
)
def test_a_bad_choice_is_refused(choice: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        check_choice(Scene.from_dict(BEAM), choice)


def test_record_is_read_back_but_for_other_studies_and_torn_lines(tmp_path: Path) -> None:
    path = tmp_path / "cost.jsonl"
    values = np.random.default_rng(1).normal(size=(9, 2))
    done = Measurement(values=values, wall=[0.1, 0.3, 0.2], cpu=[0.1] * 3, setup=[0.05] * 3, dofs=9)
    Record(path, "one").put("a", done)
    Record(path, "two").put("b", done)
    with path.open("a") as file:
        file.write('{"study": "one", "setting": {"the')
    record = Record(path, "one")
    assert set(record.found) == {"a"}
    found = record.found["a"]
    assert found.median("wall") == 0.2
    assert found.values is not None
    np.testing.assert_array_equal(found.values, values)
    record.put("c", Measurement(status="failed", reason="why"))
    again = Record(path, "one")
    assert set(again.found) == {"a", "c"}
    assert again.found["c"].reason == "why"
    assert Record(path, "one", fresh=True).found == {}


def test_fingerprint_tells_studies_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.from_dict(BEAM)
    one = fingerprint(scene, "tip", 1)
    assert one == fingerprint(Scene.from_dict(BEAM), "tip", 1)
    others = {fingerprint(scene.replace({"motion.speed": 5.0}), "tip", 1), fingerprint(scene, "frequencies", 1)}
    monkeypatch.setattr("rotfem.commands.cost.bench.__version__", "0.0.0")
    assert one not in others | {fingerprint(scene, "tip", 1)}


def plate_on(mesh: Path) -> Scene:
    plate = {"type": "plate", "mesh": str(mesh), "thickness": 1e-3, "E": 2.1e11, "nu": 0.3, "rho": 7850.0}
    return Scene.from_dict({"structure": plate, "motion": {"type": "constant", "speed": 1.0}})


def test_fingerprint_sees_what_is_in_a_mesh_file(tmp_path: Path) -> None:
    mesh = tmp_path / "plate.msh"
    mesh.write_text("one")
    one = fingerprint(plate_on(mesh), "tip", 1)
    assert one == fingerprint(plate_on(mesh), "tip", 1)
    mesh.write_text("two")
    assert one != fingerprint(plate_on(mesh), "tip", 1)


def test_numbers_of_elements_are_refused_for_a_mesh_file(tmp_path: Path) -> None:
    (tmp_path / "plate.msh").write_text("")
    with pytest.raises(SceneError, match=r"cost --elements = 4: has no meaning with structure\.mesh"):
        check_choice(plate_on(tmp_path / "plate.msh"), {"elements": [4]})


def test_locking_degrees_are_refused() -> None:
    plate = {"type": "plate", "length": 1.0, "width": 1.0, "thickness": 1e-3, "E": 2.1e11, "nu": 0.3, "rho": 7850.0}
    motion = {"type": "constant", "speed": 1.0}
    scene = Scene.from_dict({"structure": plate, "motion": motion, "mesh": {"cell": "triangle"}})
    with pytest.raises(SceneError, match="cost --degrees = 1: triangles of degree 1.*at least 3"):
        check_choice(scene, {"degrees": [1]})


def test_tuned_scene_keeps_keys_and_finds_its_files(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "speed.csv").write_text("0, 0\n10, 3\n30, 6\n")
    (tmp_path / "scenes" / "push").write_text("0, 0, 0\n10, 3, 1\n")
    text = (
        '[structure]\ntype = "planar_beam"\nlength = 10.0\nhub_radius = 0.5\n'
        "[structure.section]\nEA = 2.8e7\nGA = 1.0e7\nEI = 1.4e4\nmass_per_length = 1.2\nrotary_inertia = 6e-4\n"
        '[motion]\ntype = "table"\ntable = "speed.csv"\n[time]\nend = 20.0\nstep = 0.004\noutput_every = 5\n'
        '[[loads.at]]\nx = 5.0\nforce = "push"\n'
    )
    (tmp_path / "scenes" / "beam.toml").write_text(text)
    scene = load_scene(tmp_path / "scenes" / "beam.toml", ["structure.tip_mass=0.25"])
    (tmp_path / "out").mkdir()
    setting = Setting(({"theory": "second_order"},), 5, 2, "newmark", step=0.01)
    tuned = load_scene(write_tuned(scene, setting, tmp_path / "out" / "tuned.toml", "# two\n# lines\n\n"))
    assert tuned.motion == scene.motion
    assert tuned.structure == scene.structure
    assert tuned.loads == scene.loads
    assert (tuned.model.theory, tuned.mesh.elements, tuned.mesh.degree) == ("second_order", 5, 2)
    assert tuned.time is not None
    assert (tuned.time.scheme, tuned.time.parameters.get("spectral_radius")) == ("newmark", None)
    assert tuned.time.step == 0.01
    assert tuned.time.output_step == pytest.approx(0.02)  # as before


def test_a_function_cannot_be_written(tmp_path: Path) -> None:
    scene = Scene.from_dict(BEAM | {"motion": {"type": "callable", "speed": lambda t: 1.0}})
    with pytest.raises(SceneError, match="Python function"):
        write_tuned(scene, own_setting(scene), tmp_path / "t.toml", "")


def test_advice_is_given_where_it_is_due() -> None:
    def said(changes: dict[str, Any], **more: float) -> list[str]:
        lines: list[str] = []
        assert advise(Scene.from_dict(BEAM).replace(changes), lines.append, **more) == lines
        return lines

    assert said({}) == []
    (theory,) = said({"model.theory": "linear"}, critical=3.8)
    assert "3.8 rad/s" in theory
    assert said({"model.theory": "linear", "motion.speed": 3.0}, critical=3.8) == []
    assert advise(Scene.from_dict(BEAM).replace({"model.theory": "linear"}), None, critical=3.8) == []


def test_the_figure_names_the_error_of_every_output() -> None:
    assert set(ERRORS) == set(OUTPUTS)
