"""Work–precision studies against what is known: true errors, errors of theories, failures, budgets."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import rotfem
from rotfem.commands.cost import CostResult, changes_of
from rotfem.errors import Stopped

from .conftest import SPIN_UP, reference_file

pytestmark = pytest.mark.estimated

END = 10.0
SCENE = {**SPIN_UP, "time": {"end": END, "step": 0.01, "output_every": 2}}
SHORT = {**SPIN_UP, "mesh": {"elements": 4, "degree": 2}, "time": {"end": 1.0, "step": 0.02}}


def truth(theory: str) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return times (s) to the end, and tip (u1, u2) (m), of the spectral solution; beyond the peak, at 6.8 s."""
    table = np.array(json.loads(reference_file("spin_up.json").read_text())[theory]["table t,u1,u2,alpha"])
    table = table[table[:, 0] <= END]
    return table[:, 0], table[:, 1:3]


def true_error(row: dict[str, Any]) -> float:
    """Return how far a row's setting is from the spectral solution, at the times that this has."""
    times, tip = truth("reissner")
    scene = rotfem.Scene.from_dict(SCENE)
    history = rotfem.run(scene.replace({**changes_of(scene, row), "output.error": False})).history
    found = np.column_stack([history["tip_u1"], history["tip_u2"]])[np.rint(times / 0.02).astype(int)]
    return float(np.linalg.norm(found - tip, axis=1).max() / np.linalg.norm(tip, axis=1).max())


@pytest.fixture(scope="module")
def spin_up() -> CostResult:
    """Return a study of the spin-up in two theories."""
    return rotfem.cost(SCENE, theories=["consistent_linear", "reissner"], schemes=["esdirk4"])


def test_errors_are_the_true_ones_as_far_as_the_reference_is_known(spin_up: CostResult) -> None:
    known = spin_up.summary["uncertainty"]
    assert 0.0 < known <= 1e-4
    own = [row for row in spin_up.rows if row["theory"] == "reissner" and row["status"] == "done"]
    assert len(own) >= 4
    for row in own:
        true = true_error(row)
        assert true <= row["total_error"] + known
        if not row["at_most"]:  # the largest over all rows, not only those that the spectral solution is given at
            assert row["total_error"] <= 2.0 * true + known


def test_error_of_the_model_is_that_of_the_spectral_solutions(spin_up: CostResult) -> None:
    (_, exact), (_, linear) = truth("reissner"), truth("consistent_linear")
    there = np.linalg.norm(exact - linear, axis=1).max() / np.linalg.norm(exact, axis=1).max()
    assert there * 0.99 < spin_up.summary["model_errors"]["consistent_linear"] < there * 1.1
    for row in spin_up.rows:
        if row["theory"] == "consistent_linear":
            assert row["total_error"] == pytest.approx(there, rel=0.15)


def test_recommended_setting_keeps_its_promise(spin_up: CostResult, tmp_path: Path) -> None:
    row = spin_up.recommend(1e-3)
    assert row is not None
    assert row["total_error"] < 1e-3
    cheaper = [r for r in spin_up.rows if r["status"] == "done" and r["cost"] < row["cost"]]
    assert all(r["total_error"] + spin_up.summary["uncertainty"] > 1e-3 for r in cheaper)
    assert spin_up.recommend(1e-9) is None
    tuned = rotfem.load_scene(spin_up.write_tuned(tmp_path / "tuned.toml", 1e-3))
    assert (tuned.mesh.elements, tuned.mesh.degree) == (row["elements"], row["degree"])
    assert true_error(row) <= 1e-3
    with pytest.raises(rotfem.ComputationError, match="no setting is known to be within 1e-09"):
        spin_up.write_tuned(tmp_path / "none.toml", 1e-9)


def test_frequencies_of_a_beam_at_rest() -> None:
    """The recommended setting is as near to a fine mesh as it says."""
    scene = copy.deepcopy(SPIN_UP) | {"motion": {"type": "constant", "speed": 0.0}, "modes": {"count": 2}}
    result = rotfem.cost(scene, theories=["reissner"], accuracy=1e-6)
    assert result.summary["output"] == "frequencies"
    row = result.recommend(1e-6)
    assert row is not None
    own, fine = changes_of(result.scene, row), {"mesh.elements": 20, "mesh.degree": 4}
    found, true = (rotfem.modes(result.scene.replace(mesh)).frequencies for mesh in (own, fine))
    assert found == pytest.approx(true, rel=1e-6)
    assert true[0] == pytest.approx(3.79773, rel=2e-4)  # 1.8751² √(EI/ρ)/L², less some by shear and rotary inertia


def test_steady_state() -> None:
    """The stretched rod: u₁(L) = sin(kL)/(k cos kL) − L with k = Ω √(A_ρ/EA)."""
    scene = copy.deepcopy(SPIN_UP) | {"motion": {"type": "constant", "speed": 100.0}}
    result = rotfem.cost(scene, theories=["reissner"], accuracy=1e-6)
    k = 100.0 * np.sqrt(1.2 / 2.8e7)
    exact = np.sin(10 * k) / (k * np.cos(10 * k)) - 10
    assert result.summary["output"] == "tip"
    for row in result.rows:
        tip = rotfem.run(rotfem.Scene.from_dict(scene).replace(changes_of(result.scene, row))).history["tip_u1"][0]
        assert abs(tip / exact - 1) <= row["total_error"] + result.summary["uncertainty"] + 1e-10  # Newton's increments


def test_a_theory_that_diverges_is_a_failed_point() -> None:
    motion = {"type": "spin_up", "speed": 6.0, "duration": 5.0}
    scene = SPIN_UP | {"motion": motion, "time": {"end": 6.0, "step": 0.05}}
    result = rotfem.cost(scene, theories=["linear", "reissner"], schemes=["esdirk4"], accuracy=1e-2)
    linear = [row for row in result.rows if row["theory"] == "linear"]
    assert linear
    assert all((row["status"], row["total_error"], row["pareto"]) == ("failed", None, False) for row in linear)
    assert all("diverged" in row["reason"] for row in linear)
    assert result.recommend(1e-2) is not None


def test_a_budget_that_is_too_small_is_said() -> None:
    result = rotfem.cost(SHORT, accuracy=1e-12, budget=1.0, theories=["reissner"])
    assert result.summary["budget"]["refused"]
    assert result.summary["recommended"] is None
    assert result.rows


def test_an_interrupted_study_keeps_what_is_measured() -> None:
    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(Stopped) as stopped:
        rotfem.cost(SHORT, accuracy=1e-2, theories=["reissner"], progress=stop)
    result = stopped.value.result
    assert result.status == "interrupted"
    assert result.recommend(1e-2) is not None
