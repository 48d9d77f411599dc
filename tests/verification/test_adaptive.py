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
    "late pulse": ({"motion": STILL, "loads": {"tip_force": {"over_time": LATE}}}, 63.0),
    "sudden stop": ({"motion": STOP}, 3.0),
}


def moved(name: str, **time: Any) -> Any:
    tables, end = MOTIONS[name]
    return run({"structure": STRUCTURE, "mesh": {"elements": 4}, "time": {"end": end, **time}} | tables)


@cache
def exact(name: str, steps: int) -> Any:
    """Return a motion in so many fixed steps, which is computed once."""
    return moved(name, step=MOTIONS[name][1] / steps, scheme="esdirk4")


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
    """Without a scheme adaptive steps are of fourth order; generalised-α has fixed ones."""
    scene = {"structure": STRUCTURE, "motion": STILL, "time": {"end": 1.0, "tolerance": 1e-2}}
    assert rotfem.Scene.from_dict(scene).time.scheme == "esdirk4"
    alpha = rotfem.Scene.from_dict(scene).replace({"time.tolerance": None, "time.step": 0.1})
    assert alpha.replace({"time.spectral_radius": 0.8}).time.scheme == "generalised_alpha"
    with pytest.raises(rotfem.SceneError, match="does not estimate its error"):
        rotfem.Scene.from_dict(scene | {"time": scene["time"] | {"spectral_radius": 0.8}})


@pytest.mark.parametrize(("name", "tolerance"), [("spin-up", 1e-3), ("sudden stop", 1e-2), ("torque pulse", 1e-2)])
def test_error_and_steps(name: str, tolerance: float) -> None:
    check(name, tolerance, "esdirk4", 1500)


def test_a_light_hub_moves_with_vibrations() -> None:
    """They are no more than resolved: with the hub held their local errors would count several times as much."""
    reached = error(moved("light hub", tolerance=1e-2), exact("light hub", 2000))
    assert 2e-3 < reached < 1e-2


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


def rows(f: Any, end: float, number: int) -> list[list[float]]:
    return [[float(t), float(f(t))] for t in np.linspace(0.0, end, number)]


@pytest.mark.parametrize("kind", ["torque", "speed"])
def test_a_fine_table_costs_what_its_function_does(kind: str) -> None:
    """Rows closer than steps make no steps of their own, and the answers agree to the tolerance."""
    end, table = 10.0, rows(lambda t: 40 * (1 - np.cos(2 * np.pi * t / 5)), 10.0, 401)
    motions: list[Any] = [
        {"type": "torque", "hub_inertia": 150.0, "table": table},
        {"type": "torque", "hub_inertia": 150.0, "table": table[::4]},
    ]
    if kind == "speed":
        table = rows(lambda t: 0.4 * np.sin(np.pi * t / 10) ** 2, end, 401)
        motions = [{"type": "table", "table": table, "interpolation": how} for how in ("pchip", "cubic")]
    time = {"end": end, "tolerance": 1e-3, "output_step": 0.1}
    found = [run({"structure": STRUCTURE, "mesh": {"elements": 4}, "motion": m, "time": time}) for m in motions]
    tips = [result.history["tip_u2"] for result in found]
    assert np.max(np.abs(tips[0] - tips[1])) < 2e-3 * np.max(np.abs(tips[1]))
    assert found[0].summary["steps"] < 250


def test_a_burst_in_a_table_is_not_passed_over() -> None:
    """50 N forth and back over rows of 5 ms, after rest: of a soft mode its impulse alone would be left."""
    t = np.linspace(0.0, 1.0, 201)
    force = np.where(np.abs(t - 0.5) < 0.05, 50.0 * (-1.0) ** np.arange(201), 0.0)
    loads = {"tip_force": {"over_time": [[float(a), 0.0, float(b)] for a, b in zip(t, force, strict=True)]}}
    scene = {"structure": STRUCTURE, "motion": STILL, "mesh": {"elements": 2}, "loads": loads}
    fine = run({**scene, "time": {"end": 1.0, "step": 5e-4, "output_every": 10, "scheme": "esdirk4"}}).history
    found = run({**scene, "time": {"end": 1.0, "tolerance": 1e-2, "output_step": 5e-3}}).history
    assert np.max(np.abs(found["tip_u2"] - fine["tip_u2"])) < 1e-2 * np.max(np.abs(fine["tip_u2"]))
