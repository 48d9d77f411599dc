"""Reduced models on a free hub: the full march's motion, and what a torque gives is what hub and structure have."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import run

SCENE: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 0.5,
        "hub_radius": 0.05,
        "tip_mass": 0.01,
        "section": {"EA": 2.1e6, "GA": 6.8e5, "EI": 5.5, "mass_per_length": 0.0858, "rotary_inertia": 2.2e-7},
    },
    "motion": {
        "type": "torque",
        "hub_inertia": 2.4e-3,
        "hub_damping": 2e-3,
        "speed": 4.0,
        "table": [[0.0, 0.0], [0.1, 0.2], [0.2, 0.1], [0.3, 0.0]],
    },
    "loads": {"tip_force": {"kind": "follower", "table": [[0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [0.3, 0.0, 0.1]]}},
    "model": {"theory": "consistent_linear"},
    "mesh": {"elements": 4},
    "time": {"end": 0.3, "step": 2e-4, "output_every": 10},
}

#: Of a history that others are compared with.
ALONE = {"output": {"error": False}}


@pytest.mark.parametrize("coupled", [True, False])
def test_motion_on_a_free_hub_is_that_of_the_full_march(coupled: bool) -> None:
    """To the second-order error of the full march, 1e-3 of the tip's; a hub that moves otherwise shows in the angle."""
    scene = SCENE | {"motion": SCENE["motion"] | {"coupled": coupled}}
    full = run(scene | ALONE).history
    reduced = run(scene | {"model": SCENE["model"] | {"reduced": 1e-5}})
    assert all(line.startswith("small components") for line in reduced.summary["warnings"])  # tip_u1 of a linear theory
    assert list(reduced.history) == list(full)
    tolerances = {
        "psi": 1e-6,
        "psi_dot": 2e-4,
        "tip_u2": 2e-3,
        "strain": 2e-3,
        "kinetic": 2e-4,
        "angular_momentum": 2e-6,
    }
    for name, tolerance in (tolerances | {"work": 2e-6, "impulse": 2e-6, "torque": 1e-12}).items():
        scale = np.abs(full[name]).max()
        assert np.abs(reduced.history[name] - full[name]).max() < tolerance * scale, name


def test_momentum_is_the_impulse_given() -> None:
    """Coupled, angular momentum = its start + the impulse of torque, brake and loads, to the accuracy of the steps."""
    history = run(SCENE | {"model": SCENE["model"] | {"reduced": 1e-5}}).history
    gained = history["angular_momentum"] - history["angular_momentum"][0]
    assert np.abs(gained - history["impulse"]).max() < 1e-6 * np.abs(gained).max()


def test_a_last_window_of_one_short_step() -> None:
    """The knot of the torque leaves one step of 1.2 ms; momentum and impulse stay alike to the projection."""
    section = {"EA": 1e6, "GA2": 4e5, "GA3": 3e5, "GJ": 100.0, "EI2": 200.0, "EI3": 400.0, "mass_per_length": 2.0}
    inertia = {"rotary_inertia2": 1e-3, "rotary_inertia3": 2e-3}
    blade = {"type": "spatial_beam", "length": 1.0, "hub_radius": 0.2, "section": section | inertia, "precone": 0.1}
    blade |= {"pretwist": [[0.0, 0.3], [1.0, 0.0]], "tip_mass": 0.2, "tip_offset": [0.02, 0.03, 0.01]}
    hub = {"type": "torque", "hub_inertia": 0.5, "table": [[0.0, 1.0], [0.1, 3.0], [0.3, -1.0]], "speed": 4.0}
    tables = {"structure": blade, "motion": hub, "mesh": {"elements": 2, "degree": 2}, **ALONE}
    time, model = {"end": 0.3, "step": 0.1}, {"theory": "consistent_linear", "reduced": 1e-6}
    found = run({**tables, "time": time, "model": model})
    assert not any("full system" in line for line in found.warnings)
    momentum = found.history["angular_momentum"] - found.history["impulse"]
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-6)


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_what_is_given_as_error_is_not_under_the_true_one_by_two(factor: float) -> None:
    """Of a free hub, with its foreshortening or without, at two sizes of the torque."""
    torque = [[0.0, 0.0], [0.05, 0.6], [0.15, 0.6], [0.2, -0.6], [0.3, 0.0]]
    table = [[t, factor * moment] for t, moment in torque]
    scene = SCENE | {"loads": {}, "motion": SCENE["motion"] | {"table": table}, "time": {"end": 0.3, "step": 1e-3}}
    exact = run(scene | {"model": {"theory": "reissner"}, "time": scene["time"] | {"scheme": "esdirk4"}} | ALONE)
    truth = exact.history["tip_u2"]
    for bent in (False, True):
        model = {"theory": "consistent_linear", "reduced": 1e-5, "foreshortening": bent}
        reduced = run(scene | {"model": model})
        off = float(np.abs(reduced.history["tip_u2"] - truth).max() / np.abs(truth).max())
        assert off < 2 * reduced.summary["error"]["model"]


def test_a_pulse_that_begins_with_the_history_is_there() -> None:
    """Of a rigid arm: its speed is the impulse over the inertia of hub and arm, to what bending leaves of it."""
    motion = {"type": "torque", "hub_inertia": 2.4e-3, "pulses": [[0.0, 0.1, 0.5]]}
    stiff = SCENE["structure"] | {"section": SCENE["structure"]["section"] | {"EI": 5.5e5, "EA": 5e8, "GA": 5e8}}
    scene = SCENE | {"structure": stiff, "loads": {}, "motion": motion}
    history = run(scene | {"model": SCENE["model"] | {"reduced": 1e-4}, "time": {"end": 0.2, "step": 0.01}}).history
    assert history["impulse"][-1] == pytest.approx(0.05, rel=1e-9)
    assert history["angular_momentum"][-1] == pytest.approx(0.05, rel=1e-6)


def test_what_a_coarse_mesh_puts_off_by_the_end_is_told() -> None:
    """Vibrations after a short pulse on two elements, against six: phases are lost that no shape of an instant shows.

    Estimates by spectra are above the truth, as vibrations do not all come together: 5.5 times here. The shapes of
    instants tell a hundredth of the truth.
    """
    motion = {"type": "torque", "hub_inertia": 2.4e-3, "pulses": [[0.0, 0.004, 1.0], [0.02, 0.024, -1.0]]}
    scene = SCENE | {"loads": {}, "motion": motion, "model": SCENE["model"] | {"reduced": 1e-4}}
    coarse, fine = (run(scene | {"mesh": {"elements": n}, "time": {"end": 0.2, "step": 5e-4}}) for n in (2, 6))
    truth = fine.history["tip_u2"]
    off = float(np.abs(coarse.history["tip_u2"] - truth).max() / np.abs(truth).max())
    assert off < coarse.summary["error"]["space"] < 8 * off
