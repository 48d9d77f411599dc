"""Parts of a work–precision study: references, front, recommendation, record, tuned scenes, advice."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from rotfem import registry
from rotfem.commands.cost.budget import Budget
from rotfem.commands.cost.laboratory import Prediction
from rotfem.commands.cost.plot import ERRORS
from rotfem.commands.cost.record import Measurement, Record, fingerprint
from rotfem.commands.cost.reference import Array, Move, Refinement, Samples, distance, paired
from rotfem.commands.cost.result import Row, pareto, recommend
from rotfem.commands.cost.settings import (
    HIGHEST_DEGREE,
    OUTPUTS,
    Setting,
    check_choice,
    count,
    grid,
    ladder,
    own_setting,
    remeshed,
    restepped,
)
from rotfem.commands.cost.tuned import write_tuned
from rotfem.errors import SceneError
from rotfem.scene import Scene, load_scene
from rotfem.scene.advice import advise, estimates
from tests.beams import SPIN_UP

BEAM: dict[str, Any] = {
    **SPIN_UP,
    "time": {"end": 20.0, "step": 0.004, "output_every": 5},
}
TIMES = np.linspace(0.0, 2.0, 101)


def wave(h: float, order: float, noise: float = 0.0) -> Samples:
    """Return sin t with an error of an order in h, and the next one."""
    error = 0.3 * h**order * np.cos(TIMES) + 0.1 * h ** (order + 1) * TIMES
    return Samples((np.sin(TIMES) + error + noise * np.cos(999 * TIMES))[:, None], TIMES)


def mesh_part(elements: int) -> Array:
    """Return an error of order 6 in the size of elements."""
    return elements**-6.0 * np.cos(3 * TIMES)[:, None]


def computed(setting: Setting) -> Samples:
    """Return a wave with the errors of a step (order 2), of a mesh, and of their product."""
    assert setting.step is not None
    assert isinstance(setting.elements, int)
    samples = wave(setting.step, 2.0)
    return Samples(samples.values * (1.0 + mesh_part(setting.elements)) + mesh_part(setting.elements), TIMES)


MOVES: dict[str, Move] = {"time": lambda s: restepped(s, 0.5, 0.02), "mesh": lambda s: remeshed(s, 2.0)}
COARSE = Setting("reissner", 2, 3, "newmark", 0.08)
EXACT = Samples(np.sin(TIMES)[:, None], TIMES)


@pytest.mark.parametrize("goal", [1e-2, 1e-4, 1e-6])
def test_reference_is_as_near_to_the_truth_as_it_claims(goal: float) -> None:
    """The combination cancels both leading errors: it is better than the last difference by the next order."""
    found = Refinement(computed, COARSE, MOVES, each=False).reference(goal)
    assert found is not None
    assert distance(found.samples, EXACT, each=False) < found.uncertainty <= goal
    assert set(found.parts) == {"time", "mesh"}


def test_the_larger_difference_is_refined() -> None:
    refinement = Refinement(computed, COARSE, MOVES, each=False)
    found = refinement.reference(1e-4)
    assert found is not None
    for name in ("time", "mesh"):
        assert found.parts[name] == refinement.differences[name][-1][1]
    levels = zip(
        refinement.differences["time"], refinement.differences["mesh"], refinement.differences["mesh"][1:], strict=False
    )
    for (_, time), (before, space), (after, _) in levels:
        assert (after.elements != before.elements) == (space > time)


def test_order_is_that_of_the_steps() -> None:
    found = Refinement(computed, replace(COARSE, elements=64), MOVES, each=False).reference(1e-5)
    assert found is not None
    assert found.order == pytest.approx(2.0, abs=0.1)


def test_reference_says_what_the_budget_leaves_uncertain() -> None:
    found = Refinement(lambda s: computed(s) if s.elements in (2, 4) else None, COARSE, MOVES, each=False)
    there = found.reference(1e-9)
    assert there is not None
    assert there.uncertainty > 1e-4
    assert distance(there.samples, EXACT, each=False) <= there.uncertainty
    assert Refinement(lambda s: None, COARSE, MOVES, each=False).reference(1e-6) is None


def test_a_theory_beside_another_is_off_by_the_product_of_two_errors() -> None:
    known = Refinement(computed, COARSE, MOVES, each=False).reference(1e-6)
    assert known is not None
    change = 0.01 * np.cos(TIMES)[:, None]
    here = computed(COARSE)
    there = Samples(here.values + change, TIMES)
    found = paired(known, there, here, each=False)
    np.testing.assert_allclose(found.samples.values, known.samples.values + change, atol=1e-12)
    assert found.parts["theory"] == pytest.approx(
        distance(there, here, each=False) * distance(here, known.samples, each=False)
    )
    assert found.uncertainty > known.uncertainty


def test_finer_and_coarser_settings() -> None:
    plate = Setting("reissner", (8, 3), 2)
    assert remeshed(plate, 2.0) == replace(plate, elements=(16, 6))
    assert remeshed(replace(plate, elements=(1, 1)), 0.5) is None
    file = replace(plate, elements=None)
    assert remeshed(file, 2.0) == replace(file, degree=3)
    assert remeshed(replace(file, degree=HIGHEST_DEGREE), 2.0) is None
    assert restepped(COARSE, 0.125, 0.02) == replace(COARSE, step=0.01, every=2)
    assert restepped(plate, 0.5, 0.0) is None


def measured(setting: Setting, cpu: float, steps: int = 100) -> Measurement:
    """Return a measurement without an output."""
    return Measurement(cpu=[cpu], wall=[cpu], setup_cpu=[0.0], memory=1e6, dofs=3 * count(setting), steps=steps)


def test_time_is_predicted_by_steps_stages_and_unknowns() -> None:
    prediction = Prediction(plate=False)
    assert prediction.of(COARSE)["cpu"] is None
    prediction.learn(COARSE, measured(COARSE, 1.0))
    assert prediction.of(COARSE)["cpu"] == 1.0
    assert prediction.of(replace(COARSE, step=0.02))["cpu"] == pytest.approx(4.0)
    stages = registry.schemes["esdirk4"].stages
    assert prediction.of(replace(COARSE, scheme="esdirk4"))["cpu"] == pytest.approx(stages)
    assert prediction.of(replace(COARSE, elements=4))["cpu"] == pytest.approx(13 / 7)  # nodes of degree 3
    adaptive = replace(COARSE, scheme="esdirk4", step=None, tolerance=1e-3)
    prediction.learn(adaptive, measured(adaptive, 2.0))
    assert prediction.of(replace(adaptive, tolerance=1e-7))["cpu"] == pytest.approx(20.0)  # order 4
    wide = Setting("reissner", (8, 8), 2)
    plates = Prediction(plate=True)
    plates.learn(wide, measured(wide, 1.0, steps=0))
    assert plates.of(replace(wide, elements=(16, 16)))["cpu"] == pytest.approx((33 / 17) ** 3)  # n^(3/2), n nodes


def test_a_budget_lets_nothing_take_more_than_half_of_what_is_left() -> None:
    budget = Budget(100.0, MPI.COMM_SELF)
    assert budget.allows(COARSE, {"cpu": None, "memory": None})
    assert budget.allows(COARSE, {"cpu": 49.0, "memory": 1.0})
    assert not budget.allows(COARSE, {"cpu": 51.0, "memory": 1.0})
    assert not budget.allows(COARSE, {"cpu": 1.0, "memory": 1e18})
    (refused,) = budget.refused
    assert "would take about 51 s" in refused["why"]


def test_samples_at_other_times_are_interpolated() -> None:
    exact = Samples(np.sin(TIMES)[:, None], TIMES)
    odd = np.sort(np.append(np.linspace(0.0, 2.0, 67), 0.777))
    off = Samples(np.sin(odd)[:, None] + 1e-4, odd)
    assert distance(off, exact, each=False) == pytest.approx(1e-4, rel=1e-2)
    coarse = Samples(exact.values[::5] + 1e-4, TIMES[::5])
    assert distance(coarse, exact, each=False) == pytest.approx(1e-4 / np.max(exact.values), rel=1e-9)


def test_eigenvalues_are_each_relative_to_itself() -> None:
    none = np.empty(0)
    truth, off = Samples(np.array([[1.0, 0.0], [100.0, 0.0]]), none), Samples(np.array([[1.1, 0], [100.5, 0]]), none)
    assert distance(off, truth, each=True) == pytest.approx(0.1)
    assert distance(off, truth, each=False) == pytest.approx(0.005)
    assert distance(Samples(np.ones((1, 2)), none), truth, each=True) == np.inf


def rows(number: int) -> list[Row]:
    """Return rows with random times and errors, some failed."""
    rng = np.random.default_rng(7)
    return [
        {"cost": float(t), "total_error": float(e), "error": float(e), "status": "failed" if i % 9 == 0 else "done"}
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


def test_grid_holds_the_scene_itself_and_samples_coincide() -> None:
    scene = Scene.from_dict(BEAM)
    for quick in (True, False):
        settings = grid(scene, "tip", quick, 0.004, {})
        assert own_setting(scene) in settings
        assert len(settings) == len(set(settings))
        for s in settings:
            assert s.step is not None
            interval = s.step * s.every
            assert interval / 0.02 == pytest.approx(round(interval / 0.02))
    assert len(grid(scene, "tip", True, 0.004, {})) < 30


def test_ladder_is_one_of_powers_of_two() -> None:
    steps = ladder(0.004, 0.02, 20.0, 0.4, 11.0)
    assert steps == pytest.approx([0.04, 0.02, 0.01, 0.005, 0.004, 0.0025])
    assert max(ladder(0.4, 0.4, 4.0, 0.4, 11.0)) == 0.4


@pytest.mark.parametrize(
    ("choice", "says"),
    [
        ({"theories": ["reisner"]}, 'did you mean "reissner"'),
        ({"schemes": ["euler"]}, "allowed: .*generalised_alpha, newmark"),
        ({"elements": [0]}, "integers greater than 0"),
        ({"steps": [-0.1]}, "numbers greater than 0"),
        ({"steps": [21.0]}, "at most time.end = 20"),
        ({"degrees": [3, 9]}, "cost --degrees = 9: must be an integer at least 1 and at most 6"),
    ],
)
def test_a_bad_choice_is_refused(choice: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        check_choice(Scene.from_dict(BEAM), choice)


def test_record_is_read_back_but_for_other_studies_and_torn_lines(tmp_path: Path) -> None:
    path = tmp_path / "cost.jsonl"
    a, b, c = (Setting("reissner", n, 3) for n in (1, 2, 3))
    done = Measurement(samples=wave(0.1, 2.0), wall=[0.1, 0.3, 0.2], cpu=[0.1] * 3, setup=[0.05] * 3, dofs=9)
    Record(path, "one").put(a, done)
    Record(path, "two").put(b, done)
    with path.open("a") as file:
        file.write('{"study": "one", "setting": {"the')
    record = Record(path, "one")
    assert record.resumed == 1
    found = record.get(a, 3)
    assert found is not None
    assert found.samples is not None
    assert found.median("wall") == 0.2
    np.testing.assert_array_equal(found.samples.values, done.samples.values if done.samples else None)
    assert record.get(a, 4) is None
    assert record.get(b, 1) is None
    record.put(c, Measurement(status="failed", reason="why"))
    assert record.is_earlier(a)
    assert not record.is_earlier(c)
    record.put(a, done)
    assert not record.is_earlier(a)
    again = Record(path, "one")
    failed = again.get(c, 3)
    assert again.resumed == 2
    assert failed is not None
    assert failed.reason == "why"
    assert Record(path, "one", fresh=True).resumed == 0


def test_fingerprint_tells_studies_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene.from_dict(BEAM)
    one = fingerprint(scene, "tip", 1)
    assert one == fingerprint(Scene.from_dict(BEAM), "tip", 1)
    others = {fingerprint(scene.replace({"motion.speed": 5.0}), "tip", 1), fingerprint(scene, "frequencies", 1)}
    monkeypatch.setattr("rotfem.commands.cost.record.__version__", "0.0.0")
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
    text = (
        '[structure]\ntype = "planar_beam"\nlength = 10.0\nhub_radius = 0.5\n'
        "[structure.section]\nEA = 2.8e7\nGA = 1.0e7\nEI = 1.4e4\nmass_per_length = 1.2\nrotary_inertia = 6e-4\n"
        '[motion]\ntype = "table"\ntable = "speed.csv"\n[time]\nend = 20.0\nstep = 0.004\noutput_every = 5\n'
    )
    (tmp_path / "scenes" / "beam.toml").write_text(text)
    scene = load_scene(tmp_path / "scenes" / "beam.toml", ["structure.tip_mass=0.25"])
    (tmp_path / "out").mkdir()
    setting = Setting("second_order", 5, 2, "newmark", step=0.01, every=7)
    tuned = load_scene(write_tuned(scene, setting, tmp_path / "out" / "tuned.toml", "two\nlines"))
    assert tuned.motion == scene.motion
    assert tuned.structure == scene.structure
    assert (tuned.model.theory, tuned.mesh.elements, tuned.mesh.degree) == ("second_order", 5, 2)
    assert tuned.time is not None
    assert (tuned.time.scheme, tuned.time.spectral_radius) == ("newmark", None)
    assert tuned.time.step == 0.01
    assert tuned.time.output_every == 2  # a row every 0.02 s, as before


def test_a_function_cannot_be_written(tmp_path: Path) -> None:
    scene = Scene.from_dict(BEAM | {"motion": {"type": "callable", "speed": lambda t: 1.0}})
    with pytest.raises(SceneError, match="Python function"):
        write_tuned(scene, own_setting(scene), tmp_path / "t.toml", "")


def said(changes: dict[str, Any], command: str = "run", **more: float) -> list[str]:
    """Return the advice for the beam with changes, as it is handed on."""
    lines: list[str] = []
    assert advise(Scene.from_dict(BEAM).replace(changes), command, lines.append, **more) == lines
    return lines


def test_advice_is_given_where_it_is_due() -> None:
    assert said({}) == []
    (step,) = said({"time.step": 0.2})
    assert "time.step = 0.2 s" in step
    assert "mode 1" in step
    (fourth,) = said({"modes.count": 4})
    assert "mode 4" in fourth
    (mesh,) = said({"mesh.elements": 3, "modes.count": 8}, "modes")
    assert "9 nodes" in mesh
    assert "lag 8" in mesh
    assert said({"mesh.elements": 12, "modes.count": 8}, "modes") == []
    (theory,) = said({"model.theory": "linear"}, critical=3.8)
    assert "3.8 rad/s" in theory
    assert said({"model.theory": "linear", "motion.speed": 3.0}, critical=3.8) == []
    assert advise(Scene.from_dict(BEAM).replace({"time.step": 0.2}), "run", None) == []


def test_estimates_are_close_to_the_modes() -> None:
    """Lag 1 … 4 of the spun-up beam, rad/s, as `rotfem modes` has them."""
    computed = (4.511443, 27.625833, 70.980526, 135.143912)
    found = [mode.frequency for mode in estimates(Scene.from_dict(BEAM), 6.0, 4)]
    np.testing.assert_allclose(found, computed, rtol=0.05)


def test_estimates_of_the_tiniest_beam_are_numbers() -> None:
    """A fourth power of its length is none any more."""
    tiny = Scene.from_dict(BEAM).replace({"structure.length": 1e-90, "structure.hub_radius": 0.0})
    assert all(mode.frequency > 0.0 for mode in estimates(tiny, 6.0, 4))


def test_the_figure_names_the_error_of_every_output() -> None:
    assert set(ERRORS) == set(OUTPUTS)


def test_record_lines_are_json(tmp_path: Path) -> None:
    path = tmp_path / "cost.jsonl"
    Record(path, "x").put(Setting("reissner", (2, 3), 2), Measurement(status="failed", reason="no"))
    entry = json.loads(path.read_text())
    assert entry["setting"]["elements"] == [2, 3]
    assert entry["measurement"]["status"] == "failed"
