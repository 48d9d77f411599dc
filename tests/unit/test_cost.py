"""Front and recommendation of a study of cost; advice."""

from __future__ import annotations

import itertools
from functools import partial
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from rotfem.accuracy.answer import Answers
from rotfem.accuracy.ladder import Clock
from rotfem.commands.cost import Study, pareto, recommend
from rotfem.commands.explain import Output
from rotfem.errors import SceneError
from rotfem.results.distance import Series, Spectrum
from rotfem.results.result import Row
from rotfem.scene import Scene, load_scene
from tests.beams import SPIN_UP

BEAM: dict[str, Any] = {**SPIN_UP, "time": {"end": 20.0, "step": 0.004, "output_every": 5}}


def rows(number: int) -> list[Row]:
    """Return rows with random times and errors, some failed; errors below 1e-2 are bounds of that."""
    rng = np.random.default_rng(7)
    return [
        {"cost": float(t), "total_error": max(float(e), 1e-2), "at_most": e <= 1e-2}
        | {"status": "failed" if i % 9 == 0 else "done"}
        for i, (t, e) in enumerate(10.0 ** rng.uniform(-3, 0, (number, 2)))
    ]


def test_front_is_what_no_setting_beats() -> None:
    table = rows(60)
    front = pareto(table)
    done = [row for row in table if row["status"] == "done"]
    assert 1 < len(front) < len(done)
    for row in done:
        assert any(o["cost"] <= row["cost"] and o["total_error"] <= row["total_error"] for o in front)
    assert all(a["cost"] < b["cost"] and a["total_error"] > b["total_error"] for a, b in itertools.pairwise(front))


def test_a_row_cannot_win_by_being_nearer_than_the_reference_is_known() -> None:
    """All bounds are one error: the cheapest of them is recommended, and the others are not on the front."""
    table = rows(200)
    bounds = [row for row in table if row["at_most"] and row["status"] == "done"]
    assert len(bounds) > 3
    cheapest = min(bounds, key=lambda row: float(row["cost"]))
    assert [row for row in pareto(table) if row["at_most"]] == [cheapest]
    assert recommend(table, 1e-2, 1e-2) is cheapest
    assert recommend(table, 0.9e-2, 1e-2) is None


def test_errors_are_unknown_where_that_of_the_reference_is() -> None:
    """The budget leaves one rung, which is as far from the truth as nobody knows."""
    scene = Scene.from_dict(BEAM)
    answers = partial(Answers, scene, lambda variant, times: Output(Spectrum(np.ones(2))), moving=False)
    study = Study(answers, 1e-2, Clock(0.0), MPI.COMM_SELF, lambda share: None)
    study.climb(["reissner"], ["esdirk4"])
    assert study.refused
    assert {row["total_error"] for row in study.rows()} == {None}
    assert recommend(study.rows(), 1.0, study.known) is None


def test_distances() -> None:
    """Of eigenvalues each is relative to itself, of a history to the largest; steps may differ."""
    assert Spectrum(np.array([1j, 100j])).apart(Spectrum(np.array([1.1j, 100.5j]))).size == pytest.approx(0.1)
    t, s = np.linspace(0.0, 3.0, 61), np.linspace(0.0, 3.0, 97)
    one, other = Series(t, np.sin(t)[:, None]), Series(s, 1.01 * np.sin(s)[:, None])
    found = one.apart(other)
    assert found.size == pytest.approx(0.01, rel=1e-3)
    assert found.at == pytest.approx(np.pi / 2, abs=0.05)
    assert Series(t, np.zeros((61, 1))).apart(other).size == np.inf
    assert one.apart(one).size == 0.0


def test_tuned_scene_keeps_keys_and_finds_its_files(tmp_path: Any) -> None:
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "speed.csv").write_text("0, 0\n10, 3\n30, 6\n")
    text = (
        '[structure]\ntype = "planar_beam"\nlength = 10.0\n'
        "[structure.section]\nEA = 2.8e7\nGA = 1.0e7\nEI = 1.4e4\nmass_per_length = 1.2\nrotary_inertia = 6e-4\n"
        '[motion]\ntype = "table"\ntable = "speed.csv"\n[time]\nend = 20.0\nstep = 0.004\n'
    )
    (tmp_path / "scenes" / "beam.toml").write_text(text)
    scene = load_scene(tmp_path / "scenes" / "beam.toml", ["structure.tip_mass=0.25"])
    (tmp_path / "out").mkdir()
    path = scene.replace({"model.theory": "second_order"}).write(tmp_path / "out" / "t.toml", "# two\n# lines\n\n")
    tuned = load_scene(path)
    assert (tuned.motion, tuned.structure, tuned.model.theory) == (scene.motion, scene.structure, "second_order")
    law = Scene.from_dict(BEAM | {"motion": {"type": "callable", "speed": lambda t: 1.0}})
    with pytest.raises(SceneError, match="Python function"):
        law.write(tmp_path / "t.toml")
