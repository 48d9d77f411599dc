"""The spin-up manoeuvre (6 rad/s in 15 s) in every theory, against values computed without finite elements.

Source of all numbers, unless said otherwise: spin_up.json of the reference values (spectral in space, collocation in
time, converged to the digits shown). At the step of 0.004 s the time error of u2 is about 6e-6 m.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import ComputationError, run
from rotfem.results import RunResult

pytestmark = pytest.mark.usefixtures("unestimated")

TIME = {"end": 20.0, "step": 0.004, "output_every": 5, "spectral_radius": 0.9}
TOLERANCE = 1e-5  # m, on u1 and u2 at every time compared


class Expected(NamedTuple):
    """Least tip u2 (m), its time (s), mean tip u1 over 15–20 s (m), and time (s) ↦ tip (u1, u2) (m)."""

    min_u2: float
    t_min: float
    mean_u1: float
    tip: dict[float, tuple[float, float]]


EXPECTED = {
    "reissner": Expected(
        *(-0.573834759, 6.762003, 5.139525728e-4),
        {
            5.0: (-1.265463625e-2, -4.684761834e-1),
            10.0: (-7.072336300e-3, -3.628145156e-1),
            20.0: (5.145324045e-4, 7.265808241e-4),
        },
    ),
    "second_order": Expected(
        *(-0.571431088, 6.759676, 5.139883914e-4),
        {
            5.0: (-1.255515065e-2, -4.668854987e-1),
            10.0: (-7.052186803e-3, -3.624006230e-1),
            20.0: (5.144931566e-4, 9.682261058e-4),
        },
    ),
    "von_karman": Expected(
        *(-0.575336642, 6.765302, 5.139263749e-4),
        {
            5.0: (-1.270199747e-2, -4.693136517e-1),
            10.0: (-7.091817841e-3, -3.632777394e-1),
            20.0: (5.145558093e-4, 5.468566597e-4),
        },
    ),
    "consistent_linear": Expected(
        *(-0.574448569, 6.762380, 5.143156127e-4),
        {
            5.0: (1.901532651e-5, -4.688207937e-1),
            10.0: (3.340607571e-4, -3.629724500e-1),
            20.0: (5.145627097e-4, 7.150633467e-4),
        },
    ),
    "von_karman_linear": Expected(
        *(-0.574448568, 6.762380, 5.143156127e-4),
        {
            5.0: (1.901532651e-5, -4.688207936e-1),
            10.0: (3.340607572e-4, -3.629724451e-1),
            20.0: (5.145627096e-4, 7.150656377e-4),
        },
    ),
}


@pytest.fixture(scope="module", params=list(EXPECTED))
def case(request: pytest.FixtureRequest, spin_up: Any) -> tuple[str, RunResult]:
    """Return (theory, its run)."""
    return request.param, run(spin_up({"model.theory": request.param, "output.error": False}, time=TIME))


def at(history: dict[str, npt.NDArray[np.float64]], column: str, times: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return a column at times that are among those recorded."""
    rows = np.searchsorted(history["t"], np.asarray(times) - 1e-9)
    np.testing.assert_allclose(history["t"][rows], times, atol=1e-9)
    return history[column][rows]


def test_tip_history(case: tuple[str, RunResult]) -> None:
    theory, result = case
    for t, (u1, u2) in EXPECTED[theory].tip.items():
        assert at(result.history, "tip_u1", [t])[0] == pytest.approx(u1, abs=TOLERANCE)
        assert at(result.history, "tip_u2", [t])[0] == pytest.approx(u2, abs=TOLERANCE)


def test_tip_history_at_all_reference_times(case: tuple[str, RunResult], reference: Callable[[str], Path]) -> None:
    theory, result = case
    table = np.array(json.loads(reference("spin_up.json").read_text())[theory]["table t,u1,u2,alpha"])
    assert len(table) >= 20
    for column, values in zip(("tip_u1", "tip_u2"), table.T[1:3], strict=True):
        np.testing.assert_allclose(at(result.history, column, table[:, 0]), values, rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(at(result.history, "tip_alpha", table[:, 0]), table[:, 3], rtol=0, atol=2e-6)


def test_peak_and_final_stretch(case: tuple[str, RunResult]) -> None:
    theory, result = case
    expected, figures, h = EXPECTED[theory], result.summary["figures"], result.history
    assert figures["tip_u2_min"] == pytest.approx(expected.min_u2, abs=3e-6)
    assert figures["tip_u2_min_time"] == pytest.approx(expected.t_min, abs=3e-4)
    late = h["t"] >= 15.0 - 1e-9
    mean = np.trapezoid(h["tip_u1"][late], h["t"][late]) / 5.0
    # The axial vibration left by the spin-up has periods below 0.01 s and is undersampled; its amplitude is 1e-7 m.
    assert mean == pytest.approx(expected.mean_u1, abs=2e-8)


def test_inertial_frame(spin_up: Any) -> None:
    """The same beam with the spin as motion of its clamp; it needs a shorter step, for its rotation is resolved too."""
    time = {"end": 10.0, "step": 0.0025, "output_every": 8, "spectral_radius": 0.9}
    result = run(spin_up({"model.frame": "inertial"}, time=time))
    expected = EXPECTED["reissner"]
    assert result.summary["effects"] == ["rotary_inertia"]
    assert result.summary["figures"]["tip_u2_min"] == pytest.approx(expected.min_u2, abs=1e-4)
    for t in (5.0, 10.0):
        tip = [at(result.history, f"tip_{c}", [t])[0] for c in ("u1", "u2")]
        np.testing.assert_allclose(tip, expected.tip[t], rtol=0, atol=1e-4)


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
