"""What a scene may say of a pitch over time, and the signal that is made of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import SceneError
from rotfem.analysis.time_grid import find_knots
from rotfem.commands.problem import Problem
from rotfem.errors import InputError
from rotfem.mechanics.differentiation import Derivative
from rotfem.mechanics.pitch import Pitch, differentiated, tabulated_pitch
from rotfem.mechanics.time_signals import TimeSignal
from rotfem.scene import Scene

SECTION = {"EA": 1e8, "GA2": 1e8, "GA3": 1e8, "GJ": 1e5, "EI2": 1e4, "EI3": 5e4, "mass_per_length": 1.2}


def scene(pitch: Any, root: Any = None, **more: Any) -> Scene:
    """Return the scene of a blade with this pitch."""
    structure = {"type": "spatial_beam", "length": 10.0, "section": SECTION, "root": {**(root or {}), "pitch": pitch}}
    return Scene.from_dict({"structure": structure, "motion": {"type": "constant", "speed": 4.0}, **more})


def signal(pitch: Any, **more: Any) -> Pitch:
    """Return the pitch over time of that scene."""
    found = Problem.of(scene(pitch, **more)).motion.pitch
    assert found is not None
    return found


def test_a_table_is_at_rest_at_its_ends_and_its_rate_never_jumps() -> None:
    """A ramp of two rows is the cubic 3s² − 2s³; more rows keep to their bounds, and rates are those of the angle."""
    angle, rate, acceleration = tabulated_pitch([[1.0, 0.2], [3.0, 0.6]])
    s = np.array([0.25, 0.5])
    np.testing.assert_allclose([angle(1 + 2 * x) for x in s], 0.2 + 0.4 * (3 * s**2 - 2 * s**3), rtol=1e-14)
    assert [angle(0.0), angle(5.0), rate(0.5), rate(1.0), rate(3.5), acceleration(3.0)] == [0.2, 0.6, 0, 0, 0, 0]
    angle, rate, acceleration = tabulated_pitch([[0, 0.0], [1, 0.5], [1.5, 0.5], [4, -0.1]])
    t = np.linspace(-0.5, 4.5, 5001)
    rates = np.array([rate(x) for x in t])
    assert np.abs(np.diff(rates)).max() < 6 * 1.0 * 1e-3 * 2  # |θ̈| ≤ 6 (slope) / shortest row, no jump
    np.testing.assert_allclose(np.gradient([angle(x) for x in t], t), rates, atol=3e-3)
    assert all(abs(angle(x) - 0.5) < 1e-15 for x in (1.0, 1.2, 1.5))


def test_harmonics_and_functions_have_the_rates_of_their_sum() -> None:
    """Per revolution under a speed that changes: α = 2ψ, α̇ = 2Ω, α̈ = 2Ω̇; differences of fourth order."""
    motion = {"type": "spin_up", "speed": 5.0, "duration": 2.0}
    parts = [{"amplitude": 0.1, "per_rev": 2.0, "phase": 0.4}, {"amplitude": -0.05, "frequency": 7.0}]
    found = signal({"over_time": [[0, 0.1], [2, 0.3]], "harmonic": parts}, motion=motion)
    assert found.start == pytest.approx(0.1 + 0.1 * np.cos(0.4) - 0.05, rel=1e-14)
    _, rate, acceleration = differentiated(found.angle)
    for t in (0.3, 1.1, 1.9):
        assert found.rate(t) == pytest.approx(rate(t), abs=1e-9)
        assert found.acceleration(t) == pytest.approx(acceleration(t), abs=1e-6)


def test_units() -> None:
    given = {"over_time": [[0, "6 deg"], ["2 min", 0.2]], "harmonic": {"amplitude": "3 deg", "frequency": "1 Hz"}}
    pitch = scene(given).structure.root.pitch  # type: ignore[union-attr]
    assert pitch.over_time == ((0.0, pytest.approx(np.pi / 30)), (120.0, 0.2))  # type: ignore[union-attr]
    part = pitch.harmonic[0]  # type: ignore[union-attr]
    assert (*part.amplitude, part.frequency) == (pytest.approx(np.pi / 60), pytest.approx(2 * np.pi))
    assert scene("3 deg").structure.root.pitch.value == (pytest.approx(np.pi / 60),)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("pitch", "more", "key"),
    [
        ([[0, 0.1], [0, 0.2]], {}, "structure.root.pitch.over_time"),
        ([[0, 0.1, 3.0], [1, 0.2, 1.0]], {}, "structure.root.pitch.over_time"),
        ({"value": 0.1, "over_time": [[0, 0.1], [1, 0.2]]}, {}, "structure.root.pitch"),
        ({}, {}, "structure.root.pitch"),
        ({"harmonic": {"amplitude": 0.1}}, {}, "structure.root.pitch.harmonic.0.frequency"),
        ({"harmonic": {"frequency": 0.1}}, {}, "structure.root.pitch.harmonic.0.amplitude"),
        (lambda t, x: 0.1, {}, "structure.root.pitch.over_time"),
        ({"value": 0.1, "rate": lambda t: 0.0}, {}, "structure.root.pitch.rate"),
        ({"over_time": lambda t: 0.1, "rate": 0.0}, {}, "structure.root.pitch.rate"),
        ([[0, "3 m"], [1, 0]], {}, "structure.root.pitch.over_time"),
        ([[0, 0.1], [1, 0.2]], {"root": {"flap_stiffness": 0.0}}, "structure.root.lag_stiffness"),
        ([[0, 0.1], [1, 0.2]], {"motion": {"type": "torque", "hub_inertia": 1.0}}, "structure.root.pitch"),
    ],
)
def test_refused(pitch: Any, more: dict[str, Any], key: str) -> None:
    with pytest.raises(SceneError) as caught:
        Problem.of(scene(pitch, **more))
    assert caught.value.key.startswith(key)


def searched(function: Any) -> None:
    """Search the angle of a pitch and its rate for jumps."""
    signal = None
    for f in (function, Derivative(function, 1, 0.32, (0.0,))):
        more = {"known": False, "continuous": True, "primitive": signal}
        signal = TimeSignal("structure.root.pitch", f, np.empty(0), **more)
        find_knots(signal, np.linspace(0, 2, 101))


@pytest.mark.parametrize(("function", "at"), [(lambda t: abs(t - 0.777), 0.777), (lambda t: 1.0 * (t > 0.5), 0.5)])
def test_a_pitch_or_its_rate_that_jumps_is_refused(function: Any, at: float) -> None:
    with pytest.raises(InputError, match="jumps at t = ") as caught:
        searched(function)
    assert float(str(caught.value).split("t = ")[1].split(" s")[0]) == pytest.approx(at, abs=1e-3)
