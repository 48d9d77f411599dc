"""An accuracy that is asked for is kept, against answers that are finer by far."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.results.distance import Series
from tests.beams import STRUCTURE

pytestmark = pytest.mark.estimated

SECTION = STRUCTURE["section"]
BEAM = {"type": "planar_beam", "length": 10.0, "section": SECTION}
T = np.linspace(0.0, 3.0, 151)
SCENES: dict[str, dict[str, Any]] = {
    "spin-up": {
        "structure": BEAM,
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
        "time": {"end": 6.0},
    },
    "pulse": {
        "structure": {**BEAM, "tip_mass": 3.0},
        "motion": {"type": "constant", "speed": 2.0},
        "loads": {"tip_force": [[0.0, 0.0, 0.0], [0.1, 0.0, 40.0], [0.2, 0.0, 0.0]]},
        "time": {"end": 3.0},
    },
    "hub": {
        "structure": BEAM,
        "motion": {"type": "torque", "hub_inertia": 200.0, "pulses": [[0.0, 1.0, 300.0]]},
        "time": {"end": 3.0},
    },
    "plate": {
        "structure": {
            **{"type": "plate", "length": 0.7, "width": 0.35, "thickness": 0.004},
            **{"E": 7e10, "nu": 0.33, "rho": 2700.0},
        },
        "motion": {"type": "constant", "speed": 10.0},
        "loads": {"pressure": {"over_time": [[0, 0], [0.05, 90.0], [0.1, 0]]}},
        "time": {"end": 0.1},
    },
}
FINE = {"plate": {"elements": [8, 4], "degree": 3}}


def output(run: Any, of: str) -> Series:
    """Return the tip, or the moment at the root, over a run."""
    names = [n for n in run.history if n.startswith("tip_u" if of == "tip" else "root_m")]
    return Series(run.t, np.column_stack([run.history[n] for n in names]))


@cache
def reference(name: str) -> Any:
    scene = SCENES[name]
    time = {**scene["time"], "tolerance": 1e-5 if name != "plate" else 5e-4}
    time["output_step"] = time["end"] / 1000
    mesh = FINE.get(name, {"elements": 6, "degree": 5})
    return rotfem.run({**scene, "time": time, "mesh": mesh, "output": {"error": False}})


@pytest.mark.parametrize(
    ("name", "accuracy", "of"),
    [
        *((name, accuracy, "tip") for name in ("spin-up", "pulse", "hub") for accuracy in (1e-2, 1e-3, 1e-4)),
        ("plate", 1e-2, "tip"),
        ("pulse", 1e-2, "root_moment"),
    ],
)
def test_the_truth_is_as_near_as_was_asked(name: str, accuracy: float, of: str) -> None:
    run = rotfem.run({**SCENES[name], "accuracy": accuracy, "accuracy_of": of})
    found = run.summary["accuracy"]
    assert found["met"]
    assert found["estimated"] <= accuracy
    assert output(reference(name), of).apart(output(run, of)).size <= accuracy
    assert len(run.t) == 1001
    settings = run.summary["settings"]
    assert settings[-1].get("extrapolated") or name == "plate"
    assert found["estimated"] == [row["error"] for row in settings if not row.get("extrapolated")][-1]


def test_steps_that_rows_of_a_table_make_are_not_taken_for_those_of_the_tolerance() -> None:
    """A gust by 101 linear rows: 97 steps to 3e-4, 113 to 5e-5, and so an error that hardly changes."""
    t = np.linspace(0.0, 5.0, 101)
    force = 100.0 + 400.0 * ((t > 0.5) & (t < 2.5)) * (1.0 - np.cos(np.pi * (t - 0.5)))
    scene = {
        "structure": {
            **{"type": "spatial_beam", "length": 20.0, "hub_radius": 1.0, "precone": -0.03},
            "section": {"shape": "rectangle", "width": 1.0, "height": 0.18, "E": 7e10, "nu": 0.3, "rho": 2700.0},
            "pretwist": [[0, 0.2], [20, 0.0]],
            "damping": {"kelvin_voigt": 2e-3},
        },
        "motion": {"type": "constant", "speed": 2.0},
        "loads": {"distributed": {"over_time": np.column_stack([t, 0.0 * t, force]).tolist()}},
    }
    run = rotfem.run({**scene, "time": {"end": 5.0, "output_step": 0.01}, "accuracy": 1e-4})
    time = {"end": 5.0, "output_step": 0.01, "tolerance": 1e-6}
    fine = rotfem.run({**scene, "time": time, "mesh": {"elements": 8, "degree": 5}, "output": {"error": False}})
    true = output(fine, "tip").apart(output(run, "tip")).size
    assert 0.5 * true < run.summary["error"]["total"] <= 1e-4


def test_rows_are_where_they_were_asked_for() -> None:
    for time in ({"output_step": 0.05}, {"step": 0.01, "output_every": 5}):
        run = rotfem.run({**SCENES["spin-up"], "time": {"end": 1.0, **time}, "accuracy": 1e-2})
        np.testing.assert_allclose(run.t, np.linspace(0.0, 1.0, 21), atol=1e-12)


def test_a_theory_out_of_its_range_does_not_meet_an_accuracy() -> None:
    """Files and summary are then of one answer, the best."""
    bent = {"tip_force": [[0.0, 0.0, 0.0], [1.0, 0.0, 60.0], [2.0, 0.0, 60.0]]}
    scene = {"structure": BEAM, "motion": {"type": "constant", "speed": 0.0}, "loads": bent, "time": {"end": 2.0}}
    with pytest.raises(rotfem.ComputationError, match="accuracy of 0.01 was not met") as caught:
        rotfem.run({**scene, "model": {"theory": "consistent_linear"}, "accuracy": 1e-2})
    best = caught.value.result  # type: ignore[attr-defined]
    chosen = best.summary["accuracy"]["chosen"]
    assert (best.summary["status"], best.summary["elements"]) == ("failed", chosen["elements"])
    time = {"end": 2.0, "tolerance": chosen["tolerance"], "output_step": 2.0 / 1000}
    mesh = {"elements": chosen["elements"], "degree": chosen["degree"]}
    same = {"time": time, "mesh": mesh, "model": {"theory": "consistent_linear"}, "output": {"error": False}}
    again = rotfem.run({**scene, **same})
    np.testing.assert_allclose(again.history["tip_u2"], best.history["tip_u2"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("accuracy", [1e-3, 1e-7])
def test_frequencies_to_an_accuracy(accuracy: float) -> None:
    scene = {"structure": BEAM, "motion": {"type": "constant", "speed": 4.0}, "modes": {"count": 5}}
    exact = rotfem.modes({**scene, "mesh": {"elements": 16, "degree": 5}}).frequencies
    found = rotfem.modes({**scene, "accuracy": accuracy})
    assert found.summary["accuracy"]["met"]
    assert np.max(np.abs(found.frequencies / exact - 1.0)) <= accuracy
    assert max(row["mesh_error"] for row in found.rows) <= accuracy
    diagram = rotfem.campbell({**scene, "accuracy": accuracy}, [0.0, 2.0, 4.0])
    last = [row["frequency"] for row in diagram.rows if row["speed"] == 4.0]
    assert np.max(np.abs(np.sort(last) / exact - 1.0)) <= accuracy


def test_an_accuracy_of_something_else_is_refused() -> None:
    scene = {"structure": BEAM, "motion": {"type": "constant", "speed": 4.0}, "accuracy": 1e-3}
    with pytest.raises(rotfem.InputError, match="accuracy_of"):
        rotfem.modes({**scene, "accuracy_of": "tip"})
    with pytest.raises(rotfem.InputError, match="accuracy_of"):
        rotfem.run({**scene, "accuracy_of": "frequencies"})
