"""The spin-up manoeuvre (6 rad/s in 15 s) in every theory, against values computed without finite elements.

Source of all numbers, unless said otherwise: spin_up.json of the reference values (spectral in space, collocation in
time, converged to the digits shown). At the step of 0.004 s the time error of u2 is about 6e-6 m.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import ComputationError, run
from rotfem.results.run import RunResult

TIME = {"end": 20.0, "step": 0.004, "output_every": 5, "spectral_radius": 0.9}
TOLERANCE = 1e-5  # m, on u1 and u2 at every time compared


THEORIES = ("reissner", "second_order", "von_karman", "consistent_linear", "von_karman_linear")


@pytest.fixture(scope="module")
def expected(reference: Callable[[str], Path]) -> dict[str, Any]:
    """Return theory ↦ reference values."""
    found: dict[str, Any] = json.loads(reference("spin_up.json").read_text())
    return found


def at(history: dict[str, npt.NDArray[np.float64]], column: str, times: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return a column at times that are among those recorded."""
    rows = np.searchsorted(history["t"], np.asarray(times) - 1e-9)
    np.testing.assert_allclose(history["t"][rows], times, atol=1e-9)
    return history[column][rows]


@pytest.mark.parametrize("theory", THEORIES)
def test_tip_history(spin_up: Any, expected: dict[str, Any], theory: str) -> None:
    """At all reference times, the peak, and the mean stretch at the end."""
    result = run(spin_up({"model.theory": theory}, time=TIME))
    wanted, figures, h = expected[theory], result.summary["figures"], result.history
    table = np.array(wanted["table t,u1,u2,alpha"])
    assert len(table) >= 20
    for column, values in zip(("tip_u1", "tip_u2"), table.T[1:3], strict=True):
        np.testing.assert_allclose(at(h, column, table[:, 0]), values, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(at(h, "tip_alpha", table[:, 0]), table[:, 3], rtol=0, atol=2e-6)
    assert figures["tip_u2_min"] == pytest.approx(wanted["min_u2"], abs=3e-6)
    assert figures["tip_u2_min_time"] == pytest.approx(wanted["t_min_u2"], abs=3e-4)
    late = h["t"] >= 15.0 - 1e-9
    mean = np.trapezoid(h["tip_u1"][late], h["t"][late]) / 5.0
    # The axial vibration left by the spin-up has periods below 0.01 s and is undersampled; its amplitude is 1e-7 m.
    assert mean == pytest.approx(wanted["u1_mean_15_20"], abs=2e-8)


def test_inertial_frame(spin_up: Any, expected: dict[str, Any]) -> None:
    """The same beam with the spin as motion of its clamp; it needs a shorter step, for its rotation is resolved too."""
    time = {"end": 10.0, "step": 0.0025, "output_every": 8, "spectral_radius": 0.9}
    result = run(spin_up({"model.frame": "inertial"}, time=time))
    wanted = expected["reissner"]
    assert result.summary["effects"] == ["rotary_inertia"]
    assert result.summary["figures"]["tip_u2_min"] == pytest.approx(wanted["min_u2"], abs=1e-4)
    for t, *tip, _ in wanted["table t,u1,u2,alpha"]:
        if 0.0 < t <= 10.0 and round(t / 0.02, 9).is_integer():
            found = [at(result.history, f"tip_{c}", [t])[0] for c in ("u1", "u2")]
            np.testing.assert_allclose(found, tip, rtol=0, atol=1e-4)


def test_linear_theory_diverges_and_keeps_what_it_had(spin_up: Any) -> None:
    with pytest.raises(ComputationError) as caught:
        run(spin_up({"model.theory": "linear"}, time={"end": 20.0, "step": 0.01}))
    error = caught.value
    assert "linear solution diverged" in error.what
    assert "consistent_linear" in error.advice
    assert "reissner" in error.advice
    result = error.result  # type: ignore[attr-defined]
    assert isinstance(result, RunResult)
    assert result.summary["status"] == "failed"
    assert result.summary["failure"]["time"] == error.time
    # 3.5160153 √(EI/(A_rho L⁴)) = 3.79766 rad/s for Euler–Bernoulli beams; shear and rotary inertia take off 2e-5 of it
    critical = result.summary["figures"]["critical_speed"]
    assert critical == pytest.approx(3.5160153 * np.sqrt(1.4e4 / (1.2 * 10.0**4)), rel=5e-5)
    h = result.history
    assert error.time is not None
    assert h["t"][-1] == pytest.approx(error.time - 0.01)
    assert len(h["t"]) == pytest.approx(error.time / 0.01)
    assert all(np.all(np.isfinite(column)) for column in h.values())
    # It lasts a while beyond the critical speed before it exceeds the length of the beam, and not before.
    assert h["psi_dot"][-1] > critical
    assert 1.0 < np.max(np.abs(h["tip_u2"])) <= 10.0
    # The displacement grows faster and faster at the end.
    assert np.all(np.diff(np.abs(h["tip_u2"][-30:]), n=2) > 0)
