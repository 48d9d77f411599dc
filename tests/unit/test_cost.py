"""Parts of a work–precision study: references, front, recommendation, record, tuned scenes, advice."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.commands.cost.chain import Chain
from rotfem.commands.cost.front import Row, pareto, recommend
from rotfem.commands.cost.plot import ERRORS
from rotfem.commands.cost.record import Measurement, Record, fingerprint
from rotfem.commands.cost.reference import Samples, combined, distance, limit, observed_order
from rotfem.commands.cost.refinement import Plan, Refinement, finer_meshes
from rotfem.commands.cost.settings import OUTPUTS, Setting, check_choice, grid, ladder, own_setting
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


@pytest.mark.parametrize("order", [2.0, 3.0, 6.0])
def test_limit_finds_order_and_bounds_its_own_error(order: float) -> None:
    levels = [wave(h, order) for h in (0.1, 0.05, 0.025)]
    found = limit(levels, each=False)
    assert found.order == pytest.approx(order, abs=0.1)
    exact = Samples(np.sin(TIMES)[:, None], TIMES)
    true = distance(found.samples, exact, each=False)
    assert true < 0.2 * distance(levels[2], exact, each=False)
    assert true <= found.uncertainty < distance(levels[0], exact, each=False)
    assert found.error == pytest.approx(distance(levels[2], exact, each=False), rel=0.2)


@pytest.mark.parametrize("sizes", [(0.1, 0.06, 0.03), (0.1, 0.05, 0.03), (0.2, 0.05, 0.025)])
def test_limit_of_levels_that_are_not_halved(sizes: tuple[float, float, float]) -> None:
    """As with plates whose numbers of elements are odd, and where a level is missing."""
    found = limit([wave(h, 2.0) for h in sizes], each=False, ratios=(sizes[0] / sizes[1], sizes[1] / sizes[2]))
    assert found.order == pytest.approx(2.0, abs=0.1)
    exact = Samples(np.sin(TIMES)[:, None], TIMES)
    assert distance(found.samples, exact, each=False) <= found.uncertainty < distance(wave(sizes[2], 2.0), exact, False)


def test_limit_without_an_order_is_the_finest_level() -> None:
    levels = [wave(0.0, 2.0, noise) for noise in (1e-12, -2e-12, 3e-12)]
    found = limit(levels, each=False)
    assert found.order is None
    np.testing.assert_array_equal(found.samples.values, levels[2].values)
    assert found.uncertainty == pytest.approx(distance(levels[1], levels[2], each=False))
    assert observed_order(levels[0], levels[0], levels[0], each=False) is None
    assert limit(levels[:1], each=False).uncertainty == np.inf


def test_levels_that_agree_by_chance_are_not_extrapolated_beyond_the_order_of_the_method() -> None:
    """The differences shrink by 64 where the method says 4: a third of the last one is what may be missing."""
    levels = [Samples(np.full((1, 1), v), np.empty(0)) for v in (1.0 + 64e-3, 1.0, 1.0 - 1e-3)]
    found = limit(levels, each=False, highest=2.0)
    assert found.order == pytest.approx(6.0, abs=0.1)
    assert found.error == pytest.approx(1e-3 / 3, rel=1e-2)


def test_reference_counts_the_mesh_and_the_product_of_both_errors() -> None:
    """Of u(t; h, m) = w(t; h) + m c(t), refined in h for m = 1 and in m for h = 0.1, the limit is w(t; 0)."""
    time = limit([wave(h, 2.0) for h in (0.1, 0.05, 0.025)], each=False)
    change = np.cos(TIMES)[:, None]
    coarse = wave(0.1, 2.0)
    meshes = [Samples(coarse.values + 1e-3 * (m - 1.0) * change, TIMES) for m in (1.0, 0.25, 0.0625)]
    space = limit(meshes, each=False)
    found = combined(time, coarse, space, 0.02, each=False)
    np.testing.assert_allclose(found.samples.values, time.samples.values - 1e-3 * change, atol=1e-9)
    assert found.parts["mixed"] == pytest.approx(0.02 * 1e-3, rel=1e-2)
    assert found.uncertainty == pytest.approx(sum(found.parts.values()))


def measured(setting: Setting) -> Measurement:
    """Return a wave with an error of the order of the setting's scheme, which takes as long as there are steps."""
    assert setting.step is not None
    assert isinstance(setting.elements, int)
    order = {"generalised_alpha": 2.0, "newmark": 2.0, "esdirk4": 4.0}[setting.scheme or ""]
    samples = wave(setting.step, order)
    samples.values += setting.elements**-6.0 * np.cos(3 * TIMES)[:, None]
    wall = {"esdirk4": 5.0}.get(setting.scheme or "", 1.0) / setting.step
    return Measurement(
        samples=samples, wall=[wall], cpu=[wall], dofs=3 * setting.elements, steps=round(2 / setting.step)
    )


def test_reference_is_refined_with_the_scheme_that_gets_there_first() -> None:
    own = Setting("reissner", 8, 3, "generalised_alpha", 0.02)
    plan = Plan(own, each=False, first_step=0.08, interval=0.02, schemes=("newmark", "esdirk4"))
    asked: list[Setting] = []

    def get(setting: Setting, share: float) -> Measurement:
        asked.append(setting)
        return measured(setting)

    goal = 1e-9
    found = Refinement(plan, get).reference("reissner", goal, 0.5, plan.schemes)
    assert found is not None
    exact = Samples(np.sin(TIMES)[:, None], TIMES)
    assert distance(found.samples, exact, each=False) <= found.uncertainty
    assert found.parts["time"] <= goal
    assert found.order == pytest.approx(4.0, abs=0.3)
    shortest = {s: min(x.step or 1.0 for x in asked if x.scheme == s) for s in ("generalised_alpha", "esdirk4")}
    assert shortest["esdirk4"] < shortest["generalised_alpha"]


def test_schemes_that_may_need_forms_wait_for_one_that_gets_there_without() -> None:
    """Where compiling takes long, one of higher order starts; the lower ones do where none is more exact."""
    own = Setting("reissner", 8, 3, "generalised_alpha", 0.02)
    plan = Plan(own, each=False, first_step=0.08, interval=0.02, schemes=("newmark", "esdirk4"), warming=lambda: 1e9)
    asked: set[str | None] = set()

    def get(setting: Setting, share: float) -> Measurement:
        asked.add(setting.scheme)
        return measured(setting)

    assert Refinement(plan, get).reference("reissner", 1e-6, 0.5, plan.schemes) is not None
    assert asked == {"generalised_alpha", "esdirk4"}


def test_meshes_are_refined_again_in_steps_that_resolve_what_they_move() -> None:
    """A finer mesh moves something in steps below 0.03 s that longer ones damp: 4⁻⁶ in four elements."""
    own = Setting("reissner", 8, 3, "newmark", 0.02)
    plan = Plan(own, each=False, first_step=0.32, interval=0.32, schemes=("esdirk4",))

    def get(setting: Setting, share: float) -> Measurement:
        found = measured(setting)
        assert isinstance(setting.elements, int)
        if (setting.step or 0.0) < 0.03:
            found.samples.values += 50 * setting.elements**-6.0 * np.sin(7 * TIMES)[:, None]
        return found

    found = Refinement(plan, get).reference("reissner", 1e-5, 0.5, plan.schemes)
    assert found is not None
    exact = Samples(np.sin(TIMES)[:, None], TIMES)
    assert distance(found.samples, exact, each=False) <= found.uncertainty < 1e-4


def test_steps_of_a_large_mesh_that_would_take_too_long_are_refined_on_a_coarser_one() -> None:
    """The budget takes 200 cells at most: the mesh of 800 is never asked for but with a part of the share."""
    own = Setting("reissner", (40, 20), 2, "newmark", 0.02)
    plan = Plan(own, each=False, first_step=0.08, interval=0.02)
    shares: dict[Any, list[float]] = {}

    def get(setting: Setting, share: float) -> Measurement | None:
        shares.setdefault(setting.elements, []).append(share)
        assert isinstance(setting.elements, tuple)
        there = measured(replace(setting, elements=setting.elements[0]))
        return there if setting.elements[0] <= 20 else None

    found = Refinement(plan, get).reference("reissner", 1e-4, 0.4)
    assert found is not None
    exact = Samples(np.sin(TIMES)[:, None], TIMES)
    assert distance(found.samples, exact, each=False) <= found.uncertainty < 1e-3
    assert next(iter(shares)) == (10, 5)  # by which the time of others is known
    assert shares[40, 20][0] < 0.4 == shares[10, 5][0]


def test_what_a_chain_would_take_goes_with_its_order() -> None:
    """Errors of order 2 that take twice as long when halved: two levels to a tenth of what is uncertain."""
    levels = (Setting("reissner", 8, 3, "newmark", 0.08 / 2**i) for i in range(9))
    chain = Chain(levels, each=False)
    assert chain.to_take(1e-3) == np.inf
    for _ in range(4):
        chain.extend(lambda setting, share: measured(setting), 1.0)
    uncertain, last = chain.limit().uncertainty, chain.costs[-1]
    assert chain.to_take(uncertain) == 0.0
    assert chain.to_take(uncertain / 10) == pytest.approx(last * (2 + 4), rel=1e-6)
    chain.costs[-1], chain.doubt = 1e200 * last, np.inf  # whatever that is, it is no time
    assert chain.to_take(1e-3) == np.inf
    chain.doubt = 0.0
    assert chain.to_take(uncertain / 1e3) == np.inf


def test_reference_says_what_the_budget_leaves_uncertain() -> None:
    plan = Plan(Setting("reissner", 8, 3, "newmark", 0.02), each=False, first_step=0.08, interval=0.02)
    found = Refinement(plan, lambda s, share: measured(s) if s.elements in (2, 4, 8) else None)
    there = found.reference("reissner", 1e-9, 0.5)
    assert there is not None
    assert 1e-9 < there.parts["mesh"] < 1e-6  # 8⁻⁶ is 4e-6
    refused = Refinement(plan, lambda s, share: None)
    assert refused.reference("reissner", 1e-6, 0.5) is None
    assert "budget" in refused.reasons["reissner"]


@pytest.mark.parametrize(
    ("elements", "there"),
    [
        (8, [2, 4, 8, 16]),
        (10, [5, 10, 20, 40]),
        ((6, 1), [(6, 1), (12, 2), (24, 4), (48, 8)]),
        ((8, 3), [(4, 2), (8, 3), (16, 6), (32, 12)]),
        ((10, 8), [(3, 2), (5, 4), (10, 8), (20, 16)]),
    ],
)
def test_meshes_of_a_chain_are_halved(elements: Any, there: list[Any]) -> None:
    """Exactly where it is cheap to refine on; of plates to the next larger numbers, so that there are coarser ones."""
    assert [s.elements for s in finer_meshes(Setting("reissner", elements, 2))][:4] == there


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
    assert np.isnan(distance(Samples(np.ones((1, 2)), none), truth, each=True))


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
