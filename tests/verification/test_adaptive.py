"""Adaptive steps: the error asked for, on motions of every kind, in about as many steps as fixed ones take."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import CubicSpline

import rotfem
from rotfem import run
from tests.beams import STRUCTURE

pytestmark = pytest.mark.usefixtures("unestimated")

Array = npt.NDArray[np.float64]

STILL = {"type": "constant", "speed": 0.0}
LATE = [[0.0, 0.0, 0.0], [61.0, 0.0, 0.0], [61.001, 0.0, 5.0], [62.0, 0.0, 5.0], [62.001, 0.0, 0.0]]
STOP = {"type": "table", "table": [[0.0, 0.2], [1.0033, 0.2], [1.0043, 0.0]], "interpolation": "linear"}

#: Tables of a motion of Kane's beam, and its end (s).
MOTIONS: dict[str, tuple[dict[str, Any], float]] = {
    "spin-up": ({"motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0}}, 20.0),
    "torque pulse": ({"motion": {"type": "torque", "hub_inertia": 100.0, "pulses": [[0.5, 1.5, 100.0]]}}, 4.0),
    "light hub": ({"motion": {"type": "torque", "hub_inertia": 1.0, "pulses": [[0.2, 0.7, 40.0]]}}, 2.0),
    "tip release": ({"motion": STILL, "initial": {"tip_displacement": 1.0}}, 5.0),
    "late pulse": ({"motion": STILL, "loads": {"tip_force": {"table": LATE}}}, 63.0),
    "sudden stop": ({"motion": STOP}, 3.0),
}


def moved(name: str, **time: Any) -> Any:
    tables, end = MOTIONS[name]
    return run({"structure": STRUCTURE, "mesh": {"elements": 4}, "time": {"end": end, **time}} | tables)


#: Fixed steps of Radau's method by which a motion is known to a tenth of the smallest tolerance; where axial vibrations
#: are struck its error falls with the step only.
EXACT = {"spin-up": 2_000, "torque pulse": 8_000, "light hub": 8_000, "sudden stop": 20_000} | dict.fromkeys(
    ("tip release", "late pulse"), 40_000
)


@cache
def exact(name: str, steps: int) -> Any:
    """Return a motion in so many fixed steps of Radau's method, which is computed once."""
    return moved(name, step=MOTIONS[name][1] / steps, scheme="radau5")


def error(result: Any, truth: Any) -> float:
    """Return the largest error of u2 at the rows of a result as a part of the largest u2."""
    at = CubicSpline(truth.history["t"], truth.history["tip_u2"])(result.history["t"])
    return float(np.abs(result.history["tip_u2"] - at).max() / np.abs(at).max())


def check(name: str, tolerance: float, scheme: str, reference: int) -> None:
    """The error is below the tolerance, in at most three times the steps of a fixed step of the same scheme as good."""
    end, truth = MOTIONS[name][1], exact(name, reference)
    adaptive = moved(name, tolerance=tolerance, scheme=scheme)
    reached = error(adaptive, truth)
    assert reached < tolerance
    assert adaptive.history["t"][-1] == end
    taken = adaptive.summary["steps"] + adaptive.summary.get("rejected_steps", 0)
    assert error(moved(name, step=end / (taken // 3), scheme=scheme), truth) > reached


def test_the_usual_scheme() -> None:
    """Without a scheme adaptive steps are of fourth order; a parameter of generalised-α asks for that."""
    scene = {"structure": STRUCTURE, "motion": STILL, "time": {"end": 1.0, "tolerance": 1e-2}}
    assert rotfem.Scene.from_dict(scene).time.scheme == "esdirk4"
    alpha = rotfem.Scene.from_dict(scene).replace({"time.spectral_radius": 0.8})
    assert alpha.time.scheme == "generalised_alpha"
    assert alpha.replace({"time.tolerance": None, "time.step": 0.1}).time.scheme == "generalised_alpha"


@pytest.mark.parametrize(("name", "tolerance"), [("spin-up", 1e-3), ("sudden stop", 1e-2), ("torque pulse", 1e-2)])
def test_error_and_steps(name: str, tolerance: float) -> None:
    check(name, tolerance, "esdirk4", 1500)


def test_a_light_hub_moves_with_vibrations() -> None:
    """They are no more than resolved: with the hub held their local errors would count several times as much."""
    reached = error(moved("light hub", tolerance=1e-2), exact("light hub", 2000))
    assert 2e-3 < reached < 1e-2


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("name", list(MOTIONS))
def test_error_and_steps_of_every_motion(name: str, tolerance: float) -> None:
    check(name, tolerance, "esdirk4", EXACT[name])


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["generalised_alpha", "radau5"])
@pytest.mark.parametrize("name", list(MOTIONS))
def test_errors_of_other_schemes(name: str, scheme: str) -> None:
    assert error(moved(name, tolerance=1e-2, scheme=scheme), exact(name, EXACT[name])) < 1e-2


def test_a_late_pulse_is_met() -> None:
    """One second of load after a minute of rest: 0.2337 m, as fixed steps of 2.5 ms find."""
    late = moved("late pulse", tolerance=3e-2).history["tip_u2"]
    assert np.abs(late).max() == pytest.approx(0.2337, rel=2e-2)


def test_work_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """More steps than a march may take: an error that says what to do, with the history until then."""
    monkeypatch.setattr("rotfem.analysis.march.MOST_STEPS", 50)
    with pytest.raises(rotfem.ComputationError, match="50 steps have not reached the end") as caught:
        moved("tip release", tolerance=1e-4)
    assert len(caught.value.result.history["t"]) > 10  # type: ignore[attr-defined]


def test_jumps_denser_than_steps_act_by_their_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    """A force that jumps 2000 times is its mean and a ripple at ω = 2000π/T, which moves less than its part of (ω₁/ω)².

    Of 400 cells of the time grid each has five jumps, and one or two steps but for the first ones; what is left is the
    tolerance.
    """
    monkeypatch.setattr("rotfem.analysis.march.CELL", 1 / 400)
    end, found = 0.5, []
    starts = np.arange(2000) * end / 2000
    rows = [[t, 0.0, 10.0 * (i % 2)] for i, start in enumerate(starts) for t in (start, start + end / 2001)]
    for force in ({"over_time": rows}, [0.0, 5.0]):
        scene = {"structure": STRUCTURE, "motion": STILL, "mesh": {"elements": 2}, "loads": {"tip_force": force}}
        scene["initial"] = {"state": "undeformed"}  # from the same state, whatever the load is at t = 0
        model, time = {"theory": "consistent_linear"}, {"end": end, "tolerance": 1e-3}
        found.append(run({**scene, "model": model, "time": time}))
    ripple, mean = (result.history for result in found)
    assert found[0].summary["steps"] < 1000
    off = np.interp(ripple["t"], mean["t"], mean["tip_u2"]) - ripple["tip_u2"]
    assert np.max(np.abs(off)) < 3e-3 * np.max(np.abs(mean["tip_u2"]))


def test_a_pace_that_reaches_no_end_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hub held at a speed by a switch slides on its jump in ever shorter steps: said when the pace is known.

    After some 200 of them the switch would be recognised.
    """
    monkeypatch.setattr("rotfem.analysis.march.PACE", 25)
    monkeypatch.setattr("rotfem.analysis.march.MOST_STEPS", 500)
    switch = {
        "type": "torque",
        "hub_inertia": 50.0,
        "function": lambda t, psi, speed, tip: -40.0 * np.sign(speed - 0.1),
    }
    scene = {"structure": STRUCTURE, "motion": switch, "mesh": {"elements": 2}}
    with pytest.raises(rotfem.ComputationError, match="do not reach the end") as caught:
        run({**scene, "time": {"end": 1.0, "tolerance": 1e-3}})
    assert "time.step" in caught.value.advice
    assert caught.value.time is not None


@pytest.mark.parametrize("damping", [{}, {"kelvin_voigt": 1e-3}], ids=str)
def test_advice_where_steps_are_too_short(damping: dict[str, float]) -> None:
    """Damping is no advice for what has it."""
    tables = {"structure": STRUCTURE | {"damping": damping}, "motion": STILL, "initial": {"state": "undeformed"}}
    time = {"end": 10.0, "tolerance": 1e-6, "min_step": 0.1}
    with pytest.raises(rotfem.ComputationError, match="smaller time.min_step") as caught:
        run({**tables, "loads": {"tip_force": [0.0, 50.0]}, "time": time})
    assert ("some damping" in str(caught.value)) == (not damping)
