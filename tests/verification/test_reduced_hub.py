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


@pytest.mark.parametrize("coupled", [True, False])
def test_motion_on_a_free_hub_is_that_of_the_full_march(coupled: bool) -> None:
    """To the second-order error of the full march, 1e-3 of the tip's; a hub that moves otherwise shows in the angle."""
    scene = SCENE | {"motion": SCENE["motion"] | {"coupled": coupled}}
    full = run(scene).history
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


def test_coupling_is_an_effect() -> None:
    """Its size is what the histories with and without it differ by."""
    from rotfem.analysis.reduced.effect_sizes import effect_sizes
    from rotfem.analysis.reduced.response import reduced_response
    from rotfem.commands.problem import Problem

    times = np.linspace(0.0, 0.3, 151)
    sizes = effect_sizes(reduced_response(Problem.of(SCENE).system(), times), ("hub_coupling", "rotary_inertia"))
    apart = [
        run(SCENE | {"motion": SCENE["motion"] | {"coupled": coupled}}).history["tip_u2"] for coupled in (True, False)
    ]
    truth = float(np.abs(apart[1] - apart[0]).max() / np.abs(apart[0]).max())
    assert sizes["hub_coupling"] == pytest.approx(truth, rel=0.05)
    assert sizes["rotary_inertia"] < 0.01 * truth


@pytest.mark.parametrize(("factor", "within"), [(1.0, 1.5e-4), (4.0, 8e-3)])
def test_a_free_hub_feels_the_foreshortening(factor: float, within: float) -> None:
    """The tip that is nearer to the axis leaves less inertia: without that reissner's motion would be 5e-3 away.

    What is left is of fifth order: with four times the torque 5e-3, and the estimate tells it; with the torque itself
    it is less than what the steps of the truth are off, 1e-4.
    """
    torque = [[0.0, 0.0], [0.05, 0.6], [0.15, 0.6], [0.2, -0.6], [0.3, 0.0]]
    table = [[t, factor * moment] for t, moment in torque]
    scene = SCENE | {"loads": {}, "motion": SCENE["motion"] | {"table": table}, "time": {"end": 0.3, "step": 1e-3}}
    exact = run(scene | {"model": {"theory": "reissner"}, "time": scene["time"] | {"scheme": "esdirk4"}})
    model = {"theory": "consistent_linear", "reduced": 1e-5, "foreshortening": True}
    reduced = run(scene | {"model": model})
    truth = exact.history["tip_u2"]
    off = float(np.abs(reduced.history["tip_u2"] - truth).max() / np.abs(truth).max())
    assert off < within
    assert off / 3 < reduced.summary["error"]["model"] < 3 * off


def test_loads_that_turn_leave_the_third_order_to_the_estimate() -> None:
    """A follower force has terms of third order that are not in the equations: what it may do is in the estimate."""
    model = {"theory": "consistent_linear", "reduced": 1e-5, "foreshortening": True}
    exact = run(SCENE | {"model": {"theory": "reissner"}, "time": {"end": 0.3, "step": 1e-3, "scheme": "esdirk4"}})
    reduced = run(SCENE | {"model": model, "time": {"end": 0.3, "step": 1e-3}})
    truth = exact.history["tip_u2"]
    off = float(np.abs(reduced.history["tip_u2"] - truth).max() / np.abs(truth).max())
    assert off < 5e-3
    assert reduced.summary["error"]["model"] > off / 3


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
