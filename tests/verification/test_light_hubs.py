"""Energy and momentum of free hubs that steps do not resolve; what comes from nowhere is in the estimated error."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import run
from tests.beams import STRUCTURE

pytestmark = pytest.mark.estimated


def released(**time: Any) -> dict[str, Any]:
    """Return the beam let go from 0.2 L at 3 rad/s."""
    return {
        "structure": STRUCTURE,
        "motion": {"type": "constant", "speed": 3.0},
        "mesh": {"elements": 3, "degree": 3},
        "initial": {"tip_displacement": 2.0},
        "time": {"end": 11.0, "step": 0.02, **time},
    }


#: A spatial beam on a hub of next to no inertia under a torque that jumps: its first part answers with 1e3 rad/s².
THROWN: dict[str, Any] = {
    "structure": {
        "type": "spatial_beam",
        "length": 10.0,
        "section": {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 1.1e4, "EI2": 1.4e4, "EI3": 1.4e4}
        | {"mass_per_length": 1.2, "rotary_inertia2": 6e-4, "rotary_inertia3": 6e-4},
    },
    "motion": {"type": "torque", "hub_inertia": 1e-6, "pulses": [[0.0, 0.3, 50.0], [0.3, 0.6, -50.0]]},
    "mesh": {"elements": 4},
    "output": {"error": False},
}


def test_a_jump_of_torque_that_no_step_resolves_keeps_the_angular_momentum() -> None:
    """To a part in 200 of the impulse of a pulse; the tip is where a fifth of the step with conserved energy has it."""
    step = {"end": 0.8, "step": 0.005}
    history = run(THROWN | {"time": step | {"scheme": "generalised_alpha"}}).history
    finer = run(THROWN | {"time": step | {"step": 0.001, "output_every": 5, "scheme": "energy_conserving"}}).history
    np.testing.assert_allclose(history["angular_momentum"], history["impulse"], atol=15.0 / 200)
    moved, exact = ((10.0 + h["tip_u1"]) * np.sin(h["psi"]) + h["tip_u2"] * np.cos(h["psi"]) for h in (history, finer))
    np.testing.assert_allclose(moved, exact, atol=0.1 * np.abs(exact).max())  # m; 0.057, half the finer step 0.016


def test_momentum_from_nowhere_is_in_the_error() -> None:
    """The explicit first stage of esdirk4 starts with accelerations after the jump that its steps do not resolve."""
    result = run(THROWN | {"time": {"end": 0.1, "step": 0.005, "scheme": "esdirk4"}, "output": {"error": True}})
    assert abs(result.history["angular_momentum"][-1] - result.history["impulse"][-1]) > 1.0
    assert result.summary["error"]["total"] > 0.1


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_a_hub_without_inertia_has_that_of_the_structure(theory: str) -> None:
    """What the hub's own inertia is no longer matters below that of the beam's first element."""
    tables = {k: v for k, v in released().items() if k != "initial"}
    ends = []
    for inertia in (1e-5, 1e-12):
        motion = {"type": "torque", "hub_inertia": inertia, "pulses": [[0.0, 0.5, 20.0]]}
        time = {"end": 1.0, "step": 0.01, "scheme": "energy_conserving"}
        history = run(tables | {"motion": motion, "model": {"theory": theory}, "time": time}).history
        ends.append([history["psi"][-1], history["angular_momentum"][-1]])
    assert ends[0] == pytest.approx(ends[1], rel=1e-3)
    assert ends[1][1] == pytest.approx(10.0, rel=2e-3)  # 20 N·m for 0.5 s


def test_energy_on_a_free_hub() -> None:
    """Beyond the work of the torque it has none; a hub without inertia whose motion steps do not resolve gains some."""

    def gained(inertia: float) -> tuple[float, Any]:
        motion = {"type": "torque", "hub_inertia": inertia, "pulses": [[0.0, 0.3, 20.0]]}
        time = {"end": 4.0, "step": 0.02, "scheme": "energy_conserving"}
        result = run({"structure": STRUCTURE, "motion": motion, "mesh": {"elements": 4}, "time": time})
        h = result.history
        kinetic = h["kinetic"] + h["hub_kinetic"]
        return float((kinetic + h["strain"] - h["work"])[-1] / np.ptp(kinetic)), result

    share, light = gained(1e-4)
    assert share > 0.1
    assert light.summary["error"]["total"] > 0.3  # which a warning says
    assert any("may be in error" in warning for warning in light.warnings)
    assert abs(gained(100.0)[0]) < 1e-4
