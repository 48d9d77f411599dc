"""The scheme that keeps the balance of energy: to round-off in every nonlinear theory, with work by what gives some.

The Jacobi integral at constant speed is a constant of the motion, and the scheme is made to keep it exactly, so the
bounds here are round-off and Newton's tolerance, whatever the step. What other schemes lose or gain in the same steps
shows that the motions are hard enough to tell.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import run
from rotfem.mechanics.theories import theories
from rotfem.results.run import RunResult
from rotfem.scene import Scene
from tests.beams import STRUCTURE

Array = npt.NDArray[np.float64]

NONLINEAR = [theory.name for theory in theories() if not theory.linear]
SPIN = {"type": "constant", "speed": 3.0}


def released(theory: str, steps: int, step: float = 0.02, **changes: Any) -> Scene:
    """Return the spinning beam let go from a tip displacement of 0.2 L, by the scheme."""
    tables: dict[str, Any] = {
        "structure": STRUCTURE,
        "motion": SPIN,
        "model": {"theory": theory},
        "mesh": {"elements": 3, "degree": 3},
        "initial": {"tip_displacement": 2.0},
        "time": {"end": steps * step, "step": step, "scheme": "energy_conserving"},
    }
    return Scene.from_dict(tables).replace(changes)


def drift(result: RunResult) -> float:
    """Return the range of the Jacobi integral, relative to the largest strain energy."""
    history = result.history
    return float(np.ptp(history["jacobi"]) / np.max(history["strain"]))


def halved(result: RunResult) -> bool:
    """Return whether any step was."""
    return any("halved" in warning for warning in result.summary["warnings"])


@pytest.mark.parametrize("theory", NONLINEAR)
def test_energy_stays_for_a_thousand_steps(theory: str) -> None:
    """Steps of 0.02 s do not resolve what vibrates; what Newton's last increment leaves the next step makes up for."""
    result = run(released(theory, 1000))
    assert drift(result) < 1e-7
    energy = result.history["jacobi"]
    assert abs(np.median(energy[-100:]) - energy[0]) < 1e-11 * np.max(result.history["strain"])
    assert not halved(result)


def test_other_schemes_gain_energy_there() -> None:
    """The trapezoidal rule, which conserves the energy of linear motions, does not that of this one."""
    other = {"time.scheme": "newmark", "time.step": 0.01}
    assert drift(run(released("reissner", 250, **other))) > 1e-5


@pytest.mark.parametrize("theory", ["second_order", "reissner"])
def test_work_of_a_follower_is_all_that_is_given(theory: str) -> None:
    """A force that turns with the section has no potential; H changes by its work.

    The scheme's work is that of the middle of every step; the trapezoidal rule over the rows differs by h².
    """
    follower = {"value": [0.0, 20.0], "kind": "follower"}
    scene = Scene.from_dict(
        {
            **{k: v for k, v in released(theory, 200, 0.01).to_dict().items() if k not in ("initial", "name")},
            "loads": {"tip_force": follower},
            "initial": {"state": "undeformed"},
        }
    )
    history = run(scene).history
    u1, u2, alpha = (history[f"tip_{name}"] for name in ("u1", "u2", "alpha"))
    force = 20.0 * np.array([-np.sin(alpha), np.cos(alpha)])
    middle = (force[:, 1:] + force[:, :-1]) / 2
    work = np.cumsum(middle[0] * np.diff(u1) + middle[1] * np.diff(u2))
    change = history["jacobi"][1:] - history["jacobi"][0]
    assert np.ptp(change) > 1.0
    assert change == pytest.approx(work, abs=2e-3 * np.ptp(work))


@pytest.mark.parametrize("theory", ["second_order", "reissner"])
def test_damping_only_takes(theory: str) -> None:
    """Every single step loses energy, by the viscous work in its middle."""
    result = run(released(theory, 300, **{"structure.damping.kelvin_voigt": 1e-3}))
    energy = result.history["jacobi"]
    assert np.max(np.diff(energy)) < 1e-10 * np.max(result.history["strain"])
    assert energy[-1] < energy[0] - 0.1 * result.history["strain"][0]


def test_linear_theories_have_their_own_energy() -> None:
    """There the scheme is the midpoint rule, which keeps quadratic integrals."""
    result = run(released("consistent_linear", 500, **{"initial.tip_displacement": 0.5}))
    assert drift(result) < 1e-8


def test_angular_momentum_on_a_free_hub() -> None:
    """Impulse is momentum, and work is energy, to second order in the step."""
    torque = {"type": "torque", "hub_inertia": 100.0, "pulses": [[0.0, 0.5, 200.0]]}
    lost = []
    for step in (0.02, 0.01):
        tables = {k: v for k, v in released("reissner", 1, 0.01).to_dict().items() if k not in ("initial", "name")}
        time = {"end": 2.0, "step": step, "scheme": "energy_conserving"}
        history = run(tables | {"motion": torque, "time": time}).history
        momentum = history["angular_momentum"] - history["impulse"]
        energy = history["kinetic"] + history["hub_kinetic"] + history["strain"] - history["work"]
        lost.append([np.ptp(momentum) / 100.0, np.ptp(energy) / np.max(history["hub_kinetic"])])
    assert np.max(lost[1]) < 1e-4
    assert np.log2(np.array(lost[0]) / lost[1]) == pytest.approx([2.0, 2.0], abs=0.3)
