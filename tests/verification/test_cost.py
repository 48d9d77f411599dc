"""Work–precision studies against what is known: true errors, orders, failures; and that they can be gone on with."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rotfem
from rotfem.commands.accuracy import changes_of
from rotfem.commands.cost.bench import Bench, Measurement
from rotfem.commands.cost.result import CostResult
from rotfem.refinement.distance import distance, largest
from rotfem.refinement.refine import Setting

from .conftest import SPIN_UP, reference_file

END = 10.0
SCENE = {**SPIN_UP, "time": {"end": END, "step": 0.01, "output_every": 2}}
SHORT = {**SPIN_UP, "mesh": {"elements": 4, "degree": 2}, "time": {"end": 1.0, "step": 0.02}}


def truth(theory: str) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return times (s) to the end, and tip (u1, u2) (m), of the spectral solution; beyond the peak, at 6.8 s."""
    table = np.array(json.loads(reference_file("spin_up.json").read_text())[theory]["table t,u1,u2,alpha"])
    table = table[table[:, 0] <= END]
    return table[:, 0], table[:, 1:3]


def grid_of(result: CostResult) -> list[dict[str, Any]]:
    """Return the rows of the settings that were asked for."""
    return [row for row in result.rows if row["purpose"] == "grid"]


@pytest.fixture(scope="module")
def spin_up() -> CostResult:
    """Return a study of the spin-up with few settings."""
    return rotfem.cost(
        SCENE,
        theories=["consistent_linear", "reissner"],
        steps=[0.04, 0.02],
        elements=[5, 10],
        repeat=1,
        degrees=[3],
        schemes=["generalised_alpha"],
    )


def at(times: npt.NDArray[np.float64], values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the rows of an output at times (s), which are some of those of the scene, a row every 0.02 s."""
    found: npt.NDArray[np.float64] = values[np.rint(times / 0.02).astype(int)]
    return found


@pytest.mark.parametrize("theory", ["reissner", "consistent_linear"])
def test_reference_is_as_near_to_the_truth_as_it_claims(spin_up: CostResult, theory: str) -> None:
    times, tip = truth(theory)
    r = spin_up.references[theory]
    assert 0.0 < distance(tip, at(times, r.values[:, :2])) <= r.uncertainty <= 0.25e-4


def test_error_of_a_point_is_its_true_error(spin_up: CostResult) -> None:
    """Each setting is run again and compared with the spectral solution at the times that this has."""
    times, tip = truth("reissner")
    scene = rotfem.Scene.from_dict(SCENE)
    r = spin_up.references["reissner"]
    scale = largest(r.values)
    for row in (row for row in grid_of(spin_up) if row["theory"] == "reissner"):
        history = rotfem.run(scene.replace(changes_of(scene, Setting.of(row)))).history
        mine = at(times, np.column_stack([history["tip_u1"], history["tip_u2"]]))
        true, claimed = (largest(mine - x) / scale for x in (tip, at(times, r.values[:, :2])))
        assert abs(true - claimed) <= 1.01 * r.uncertainty < 0.1 * true
        # The table's error is the largest over all rows, not only those that the spectral solution is given at.
        assert true - r.uncertainty <= row["error"] * 1.001 < 2.0 * true


def test_errors_fall_with_the_square_of_the_step(spin_up: CostResult) -> None:
    error = {(row["theory"], row["elements"], row["step"]): row["error"] for row in grid_of(spin_up)}
    for theory in ("reissner", "consistent_linear"):
        assert error[theory, 10, 0.04] / error[theory, 10, 0.02] == pytest.approx(4.0, rel=0.05)


def test_error_of_the_model_is_that_of_the_spectral_solutions(spin_up: CostResult) -> None:
    (_, exact), (_, linear) = truth("reissner"), truth("consistent_linear")
    there = distance(exact, linear)
    floor = spin_up.summary["model_errors"]["consistent_linear"]
    assert there * 0.99 < floor < there * 1.1  # all times, not only the tabulated ones
    assert spin_up.summary["model_errors"]["reissner"] == 0.0
    for row in grid_of(spin_up):
        if row["theory"] == "consistent_linear":
            assert row["total_error"] == pytest.approx(floor, rel=0.1)
            assert row["error"] < floor


def test_recommended_setting_keeps_its_promise(spin_up: CostResult, tmp_path: Path) -> None:
    row = spin_up.recommend(5e-4)
    assert row is not None
    assert row["total_error"] < 5e-4
    assert spin_up.recommend(1e-9) is None
    tuned = rotfem.load_scene(spin_up.write_tuned(tmp_path / "tuned.toml", 5e-4))
    history = rotfem.run(tuned).history
    again = np.column_stack([history["tip_u1"], history["tip_u2"]])
    assert distance(spin_up.references["reissner"].values[:, :2], again) == pytest.approx(row["error"], rel=1e-6)
    with pytest.raises(rotfem.ComputationError, match="no setting tried is within 1e-09"):
        spin_up.write_tuned(tmp_path / "none.toml", 1e-9)


def test_frequencies_converge_with_twice_the_degree() -> None:
    scene = copy.deepcopy(SPIN_UP) | {"motion": {"type": "constant", "speed": 6.0}, "modes": {"count": 3}}
    result = rotfem.cost(scene, theories=["reissner"], elements=[8, 16], degrees=[2], repeat=1)
    assert result.summary["output"] == "frequencies"
    coarse, fine = (row["error"] for row in sorted(grid_of(result), key=lambda row: int(row["elements"])))
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.3)
    assert result.references["reissner"].uncertainty < 0.1 * fine


def test_steady_state() -> None:
    """The stretched rod: u₁(L) = sin(kL)/(k cos kL) − L with k = Ω √(A_ρ/EA)."""
    scene = copy.deepcopy(SPIN_UP) | {"motion": {"type": "constant", "speed": 100.0}}
    result = rotfem.cost(scene, theories=["reissner"], elements=[2, 4], degrees=[1, 2], repeat=1, accuracy=1e-8)
    k = 100.0 * np.sqrt(1.2 / 2.8e7)
    exact = np.sin(10 * k) / (k * np.cos(10 * k)) - 10
    assert result.summary["output"] == "tip"
    values = result.references["reissner"].values[0]
    assert abs(values[0] / exact - 1) <= result.references["reissner"].uncertainty + 1e-12  # rounding
    for row in result.rows:
        changed = {"mesh.elements": row["elements"], "mesh.degree": row["degree"]}
        tip = rotfem.run(rotfem.Scene.from_dict(scene).replace(changed)).history["tip_u1"][0]
        known = result.references["reissner"].uncertainty
        assert row["error"] == pytest.approx(abs(tip / exact - 1), rel=1e-6, abs=known + 1e-12)


def test_a_theory_that_diverges_is_a_failed_point(tmp_path: Path) -> None:
    """Where no other theory is asked for, there is nothing to compute, which is an error."""
    motion = {"type": "spin_up", "speed": 6.0, "duration": 5.0}
    scene = SPIN_UP | {"motion": motion, "mesh": {"elements": 4, "degree": 2}, "time": {"end": 6.0, "step": 0.05}}
    choice: dict[str, Any] = {"elements": [4], "steps": [0.05], "degrees": [2], "schemes": ["newmark"]}
    result = rotfem.cost(scene, theories=["linear", "reissner"], repeat=1, folder=tmp_path, **choice)
    linear, reissner = sorted(grid_of(result), key=lambda row: row["theory"])
    assert (linear["status"], linear["error"], linear["pareto"]) == ("failed", None, False)
    assert "diverged" in linear["reason"]
    assert linear["time"] > 0.0
    assert reissner["status"] == "done"
    assert "diverged" in result.summary["reference_failures"]["linear"]
    assert result.summary["failed"] == sum(row["theory"] == "linear" for row in result.rows)
    with pytest.raises(rotfem.ComputationError, match="no setting could be computed.*diverged"):
        rotfem.cost(scene, theories=["linear"], repeat=1, folder=tmp_path, **choice)


def study(folder: Path, **more: Any) -> CostResult:
    """Return a small study, kept in a folder."""
    chosen: dict[str, Any] = {"theories": ["reissner"], "steps": [0.04, 0.02], "elements": [2, 4], "degrees": [2]}
    chosen["schemes"] = ["generalised_alpha"]
    return rotfem.cost(SHORT, folder=folder, repeat=1, **(chosen | more))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, CostResult]:
    """Return a small study and its folder."""
    folder = tmp_path_factory.mktemp("study")
    return folder, study(folder)


def test_second_start_computes_only_what_is_new(
    finished: tuple[Path, CostResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, first = finished
    assert first.summary["measured"] > 0
    assert first.summary["resumed"] < first.summary["measured"]
    again = study(folder)
    assert again.summary["measured"] == 0
    assert again.rows == first.rows
    more = study(folder, steps=[0.08, 0.04, 0.02])
    assert more.summary["measured"] == 2
    before = {Setting.of(row).key(): row["time"] for row in first.rows}
    after = {Setting.of(row).key(): row["time"] for row in more.rows}
    assert all(after[setting] == time for setting, time in before.items())
    monkeypatch.setattr("rotfem.commands.cost.bench.__version__", "0.0.0")
    assert study(folder, steps=[0.04], elements=[2]).summary["resumed"] == 0


def test_an_interrupted_study_keeps_what_is_finished(
    finished: tuple[Path, CostResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measure, calls = Bench.measure, 0

    def interrupted(self: Bench, setting: Setting, repeat: int, *more: Any) -> Measurement:
        nonlocal calls
        calls += 1
        if calls == 3:
            raise KeyboardInterrupt
        return measure(self, setting, repeat, *more)

    monkeypatch.setattr(Bench, "measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        study(tmp_path)
    assert len((tmp_path / "cost.jsonl").read_text().splitlines()) == 2
    monkeypatch.setattr(Bench, "measure", measure)
    assert study(tmp_path).summary["measured"] == finished[1].summary["measured"] - 2 > 0


def test_adaptive_scene_is_studied_over_tolerances_too() -> None:
    scene = SHORT | {"time": {"end": 1.0, "tolerance": 1e-3}}
    result = rotfem.cost(scene, quick=True, theories=["reissner"], elements=[4], repeat=1, accuracy=1e-3)
    error = {row["tolerance"]: row["error"] for row in grid_of(result) if row["tolerance"] is not None}
    assert sorted(error) == pytest.approx([1e-3, 1e-2, 1e-1])
    assert max(error.values()) <= 1e-3  # all of them take the longest steps that rows allow
    assert any(row["step"] is not None for row in result.rows)


@pytest.mark.parametrize(
    ("more", "says"),
    [({"accuracy": -1.0}, "greater than 0"), ({"repeat": 0}, "at least 1"), ({"output": "tipp"}, "tip, frequencies")],
)
def test_bad_arguments_are_refused(more: dict[str, Any], says: str) -> None:
    with pytest.raises(rotfem.SceneError, match=says):
        rotfem.cost(SHORT, **more)
