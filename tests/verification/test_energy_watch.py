"""Energy from nowhere is said, and is the cause of what it leads to; fluctuations and what is given are not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rotfem import ComputationError, run
from rotfem.commands.monitor import energy_warning, growth, growth_on_hub, with_cause
from tests.beams import STRUCTURE

T = np.linspace(0.0, 100.0, 1001)
SHAPE = {"kinetic": 1e3 + np.cos(T), "strain": 1.0 - np.cos(T)}


@pytest.mark.parametrize(
    ("jacobi", "grown"),
    [
        (-1e3 + 0.1 * np.sin(T), 0.0),  # a scheme's fluctuation
        (-1e3 - 0.01 * T, 0.0),  # damping
        (-1e3 + 0.01 * T, 0.45),  # from 0.1 at the end of the first tenth to 1.0, of an exchange of 2
        (np.where(T > 99.5, np.inf, -1e3 + 0.01 * T), 0.45),
        (np.full_like(T, np.nan), 0.0),
    ],
)
def test_growth_is_of_what_is_exchanged(jacobi: Any, grown: float) -> None:
    assert growth({**SHAPE, "jacobi": jacobi}) == pytest.approx(grown, abs=5e-3)


def test_what_rows_between_steps_are_stretched_by_is_no_growth() -> None:
    """A polynomial over steps of 0.5 s stretches more the farther from their ends and the larger the turns get."""
    stretched = {**SHAPE, "jacobi": -1e3 + 0.02 * T * np.sin(2 * np.pi * T) ** 2}
    assert growth(stretched) > 0.5
    assert growth(stretched, between=True) < 0.02
    assert growth({**SHAPE, "jacobi": stretched["jacobi"] + 0.01 * T}, between=True) == pytest.approx(0.3, abs=0.15)


def test_what_does_not_move_does_not_grow() -> None:
    """Round-off of a steady state is no exchange."""
    noise = 1e-10 * np.random.default_rng(1).standard_normal((3, 1001))
    assert growth(dict(zip(("jacobi", "kinetic", "strain"), 1e3 + noise, strict=True))) == 0.0


def released(**time: Any) -> dict[str, Any]:
    """Return the beam let go from 0.2 L at 3 rad/s."""
    return {
        "structure": STRUCTURE,
        "motion": {"type": "constant", "speed": 3.0},
        "mesh": {"elements": 3, "degree": 3},
        "initial": {"tip_displacement": 2.0},
        "time": {"end": 11.0, "step": 0.02, **time},
    }


def test_growth_is_said_and_named_as_a_cause() -> None:
    """Where nothing gives energy only; errors of other kinds stay what they are."""
    history = {**SHAPE, "jacobi": -1e3 + 0.01 * T}
    closed, driven = (SimpleNamespace(hub=None, model=SimpleNamespace(closed=closed)) for closed in (True, False))
    assert "the energy has grown by 45 %" in energy_warning(closed, history)
    assert energy_warning(driven, history) == ""
    error = ComputationError("too far", time=1.0, advice="less")
    assert with_cause(error, driven, history) is error
    caused = with_cause(error, closed, history)
    assert "too far; before that the energy has grown by 45 %" in caused.what
    assert 'time.scheme = "energy_conserving"' in caused.advice


def test_steps_that_feed_vibrations_are_made_in_parts() -> None:
    """Without numerical damping steps of 0.02 s gain as much as is exchanged in 11 s, if all of them are whole."""
    result = run(released(scheme="generalised_alpha", spectral_radius=1.0))
    energy, strain = result.history["jacobi"], result.history["strain"]
    assert np.max(energy) - energy[0] < 0.2 * np.max(strain)
    assert any("halved" in warning for warning in result.summary["warnings"])


@pytest.mark.parametrize("time", [{"scheme": "energy_conserving"}, {"scheme": "generalised_alpha"}])
def test_others_are_not(time: dict[str, Any]) -> None:
    assert not any("energy" in warning for warning in run(released(**time)).summary["warnings"])


def test_nothing_is_said_where_energy_is_given() -> None:
    """A follower force makes the beam spin faster and faster."""
    tables = {k: v for k, v in released(end=2.0).items() if k != "initial"}
    tables |= {"loads": {"tip_force": {"value": [0.0, 20.0], "kind": "follower"}}, "initial": {"state": "undeformed"}}
    result = run(tables)
    assert growth(result.history) > 0.02
    assert not any("energy" in warning for warning in result.summary["warnings"])


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


def test_momentum_from_nowhere_is_said() -> None:
    """The explicit first stage of esdirk4 starts with accelerations after the jump that its steps do not resolve."""
    result = run(THROWN | {"time": {"end": 0.1, "step": 0.005, "scheme": "esdirk4"}})
    assert abs(result.history["angular_momentum"][-1] - result.history["impulse"][-1]) > 1.0
    assert any("from the impulse" in warning for warning in result.summary["warnings"])


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


def on_hub(inertia: float, step: float, **more: Any) -> Any:
    """Return the run of the beam on a free hub under a pulse of its torque."""
    motion = {"type": "torque", "hub_inertia": inertia, "pulses": [[0.0, 0.3, 20.0]]}
    time = {"end": 4.0, "step": step, **more.pop("time", {})}
    return run({"structure": STRUCTURE, "motion": motion, "mesh": {"elements": 4}, "time": time, **more})


def test_energy_on_a_free_hub() -> None:
    """Beyond the work of the torque it has none; a hub without inertia whose motion steps do not resolve gains some."""
    scheme = {"scheme": "energy_conserving"}
    light = on_hub(1e-4, 0.02, time=scheme)
    assert growth_on_hub(light.history) > 0.1
    assert any("energy of hub and structure has grown" in warning for warning in light.summary["warnings"])
    heavy = on_hub(100.0, 0.02, time=scheme)
    assert growth_on_hub(heavy.history) < 1e-4
    pushed = on_hub(100.0, 0.02, loads={"tip_force": {"value": [0.0, 5.0], "kind": "follower"}})
    assert growth_on_hub(pushed.history) > 0.02
    for fine in (heavy, pushed):
        assert not any("energy" in warning for warning in fine.summary["warnings"])
