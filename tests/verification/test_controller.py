"""A torque of the hub that answers to its motion: closed forms of the rigid structure, and momentum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem

L, HUB = 10.0, 50.0
SECTION = {"EA": 1e8, "GA": 1e8, "EI": 1e7, "mass_per_length": 1.2}
#: Steps at a jump resolve the waves along the beam: these are three times slower, and their steps as much longer.
SLOWER = SECTION | {"EA": 1e7, "GA": 1e7}
INERTIA = HUB + 1.2 * L**3 / 3


def history(function: Any, theory: str = "reissner", **section: Any) -> Any:
    """Return the history of a hub under a controller."""
    tables = {
        "structure": {"type": "planar_beam", "length": L, "section": {**SECTION, **section}},
        "motion": {"type": "torque", "hub_inertia": HUB, "function": function},
        "model": {"theory": theory},
        "mesh": {"elements": 1},
        "time": {"end": 4.0, "step": 0.02},
        "output": {"error": False},
    }
    return rotfem.run(tables).history


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_a_spring_to_an_angle(theory: str) -> None:
    """I ψ̈ = −k (ψ − ψ₀): ψ = ψ₀ (1 − cos ωt); bending, and steps of 1/500 of a period, are below 1e-4 of ψ₀."""
    k, wanted = 200.0, 0.1
    found = history(lambda t, psi, psi_dot, tip: -k * (psi - wanted), theory)
    exact = wanted * (1 - np.cos(np.sqrt(k / INERTIA) * found["t"]))
    np.testing.assert_allclose(found["psi"], exact, rtol=0, atol=1e-4 * wanted)


def test_a_governor_of_the_speed() -> None:
    """I Ω̇ = K (Ω₀ − Ω): Ω = Ω₀ (1 − e^{−Kt/I}), but for the vibration that the sudden start leaves, 2e-3 here."""
    K, wanted = 100.0, 2.0
    found = history(lambda t, psi, psi_dot, tip: K * (wanted - psi_dot), EI=1e9, GA=1e10)
    exact = wanted * (1 - np.exp(-K * found["t"] / INERTIA))
    np.testing.assert_allclose(found["psi_dot"], exact, rtol=0, atol=2e-3 * wanted)


def test_momentum_is_the_impulse_of_what_the_tip_asks_for() -> None:
    """Of a soft beam: the trapezoidal sum of the torque is the impulse, to the order of the steps."""
    found = history(lambda t, psi, psi_dot, tip: 50.0 - 300.0 * tip["u2"], EI=1.4e4)
    assert found["angular_momentum"][-1] == pytest.approx(found["impulse"][-1], rel=1e-4)
    assert np.ptp(found["torque"]) > 50.0


def relay(below: float, above: float, wanted: float) -> Any:
    """Return the scene of a hub whose torque jumps at a speed (rad/s), from one value (N·m) to another."""
    return {
        "structure": {"type": "planar_beam", "length": L, "section": SLOWER},
        "motion": {
            "type": "torque",
            "hub_inertia": HUB,
            "function": lambda t, psi, psi_dot, tip: below if psi_dot < wanted else above,
        },
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": 1},
        "output": {"error": False},
    }


def test_a_relay_that_holds_the_hub_at_its_jump_fails_in_words() -> None:
    """I Ω̇ = ±M at Ω₀ holds Ω = Ω₀ (Filippov): the equations of a step there have no solution."""
    M, wanted = 400.0, 0.5
    with pytest.raises(rotfem.ComputationError, match="a torque jumps with the motion") as failure:
        rotfem.run({**relay(M, -M, wanted), "time": {"end": 4.0, "step": 0.05}})
    assert failure.value.time == pytest.approx(wanted * INERTIA / M, rel=0.1)


def test_a_relay_that_is_passed_is_no_hindrance() -> None:
    """I Ω̇ = M, then 3M/2: two straight lines, but for the vibration (0.08 rad/s) that the sudden start leaves."""
    M, wanted = 400.0, 0.5
    found = rotfem.run({**relay(M, 1.5 * M, wanted), "time": {"end": 0.8, "tolerance": 1e-2}}).history
    when = wanted * INERTIA / M
    exact = wanted + np.where(found["t"] < when, 1.0, 1.5) * M / INERTIA * (found["t"] - when)
    np.testing.assert_allclose(found["psi_dot"], exact, rtol=0, atol=0.1)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda t, psi, psi_dot, tip: 1 / 0, "raised ZeroDivisionError"),
        (lambda t, psi, psi_dot, tip: tip["u7"], "raised KeyError"),
        (lambda t, psi, psi_dot, tip: np.nan, "finite"),
        (lambda t: 1.0, "(t, psi, psi_dot, tip)"),
    ],
)
def test_controllers_that_are_refused(function: Any, words: str) -> None:
    with pytest.raises(rotfem.SceneError, match=r"motion.function") as caught:
        history(function)
    assert words in str(caught.value)


def test_a_torque_that_changes_its_sign_within_steps_has_no_mean() -> None:
    """±10 N·m by turns of 0.1 ms, all −10 at the ends of steps; a speed of −½ · 0.1 ms · 10 N·m/I is left."""
    found = history(lambda t, psi, psi_dot, tip: 10.0 if int(t * 1e4) % 2 else -10.0, EI=1e9, GA=1e10)
    assert np.abs(found["psi"]).max() < 1e-2 * 10.0 / INERTIA * 4.0**2 / 2
