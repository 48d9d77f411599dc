"""The free hub (Yigit, Scott & Ulsoy 1988): frequencies, pulses, and what a torque gives it in work and momentum."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.commands.problem import Problem
from rotfem.scene import Scene

#: Their beam: EI = 5.50 N·m², L = 0.5 m, hub radius 0.05 m; J = ρA((a+L)³ − a³)/3 about the axis.
J = 0.0858 * (0.55**3 - 0.05**3) / 3


def hub_scene(changes: dict[str, Any] | None = None) -> Scene:
    """Return the hub beam with I_R = J/2 and their torque pulses; coarse enough for tests."""
    tables = {
        "structure": {
            "type": "planar_beam",
            "length": 0.5,
            "hub_radius": 0.05,
            "section": {
                "EA": 2.1276923e6,
                "GA": 6.8195266e5,
                "EI": 5.50,
                "mass_per_length": 0.0858,
                "rotary_inertia": 2.2178959e-7,
            },
        },
        "motion": {"type": "torque", "hub_inertia": J / 2, "pulses": [[0.0, 0.05, 1.0], [0.1, 0.15, -1.0]]},
        "mesh": {"elements": 5, "degree": 3},
        "time": {"end": 0.16, "step": 2e-4},
        "modes": {"count": 3},
    }
    return Scene.from_dict(tables).replace(changes or {})


@pytest.mark.parametrize(("ratio", "exact"), [(0.5, 29.4007651303), (10.0, 18.7440283615)], ids=lambda v: f"{v:g}")
def test_coupled_frequency_in_the_thin_limit(ratio: float, exact: float) -> None:
    # Exact Euler–Bernoulli values (characteristic equation); shear and rotary inertia taken away: 1e-6 relative.
    thin = {"structure.section.GA": 1e9, "structure.section.rotary_inertia": 0.0, "structure.section.EA": 1e9}
    scene = hub_scene({**thin, "motion.hub_inertia": ratio * J, "mesh.elements": 12})
    rows = rotfem.modes(scene).rows
    assert rows[0]["label"] == "rigid body"
    assert rows[0]["frequency"] == 0.0
    assert rows[1]["label"] == "1st in-plane"
    assert rows[1]["frequency_hz"] == pytest.approx(exact, rel=1e-6)


def test_figures_of_a_free_hub() -> None:
    """The table has angle, speed and torque, whose jumps are no overshoot, and the vibration that is left after it."""
    result = rotfem.run(hub_scene({"time": {"end": 0.3, "step": 1e-3}, "output.error": False}))
    figures, t, u2 = result.figures, result.t, result.tip["u2"]
    after = t >= figures["torque_end"]
    assert figures["tip_u2_residual"] == pytest.approx(np.ptp(u2[after]) / 2)
    assert not np.any(result.history["torque"][after])
    assert figures["torque_min"] == np.min(result.history["torque"])
    assert figures["psi_final"] == result.history["psi"][-1]
    (table,) = result.tables()
    assert {"angle ψ (rad)", "speed Ω (rad/s)", "torque on the hub (N·m)"} <= {row[0] for row in table.rows}


def test_heavy_hub_is_a_clamp() -> None:
    clamped = rotfem.modes(hub_scene({"motion": {"type": "constant", "speed": 20.0}})).rows[0]["frequency"]
    free = rotfem.modes(hub_scene({"motion.hub_inertia": 1e6 * J, "motion.speed": 20.0})).rows[1]["frequency"]
    assert free == pytest.approx(clamped, rel=1e-5)  # the difference is of the order J/I_R


@pytest.mark.parametrize("theory", ["reissner", "von_karman", "second_order", "linear"])
def test_work_and_impulse(theory: str) -> None:
    # Theorems for a Lagrangian theory: work of the torque = energy gained; impulse = angular momentum. Tolerances:
    # 1e-6 is asked of the step 1e-4; the step here is twice that, and both errors are of its second order.
    changes = {"model.theory": theory}
    if theory == "linear":  # its geometric stiffness is missing, so it needs a slow pulse to stay small
        changes |= {"motion.pulses": [[0.0, 0.05, 0.05]]}
    h = rotfem.run(hub_scene(changes)).history
    energy = h["kinetic"] + h["strain"] + h["hub_kinetic"]
    assert np.max(np.abs(energy - h["work"])) <= 4e-6 * np.max(energy)
    assert np.max(np.abs(h["angular_momentum"] - h["impulse"])) <= 1e-6 * np.max(np.abs(h["impulse"]))


def test_brake_takes_what_it_must() -> None:
    # I_tot ω' = −c ω for a rigid wheel: with a very stiff beam ω = ω0 exp(−c t/I); what still bends makes 2e-4.
    stiff = {"structure.section.EI": 5.5e4, "structure.section.GA": 1e8, "motion.pulses": None}
    c, speed, end = 0.05, 10.0, 0.1
    scene = hub_scene({**stiff, "motion.hub_damping": c, "motion.speed": speed, "time.end": end})
    h = rotfem.run(scene).history
    inertia = 0.5 * J + J + 2.2178959e-7 * 0.5
    assert h["psi_dot"][-1] == pytest.approx(speed * np.exp(-c * end / inertia), rel=5e-4)
    energy = h["kinetic"] + h["strain"] + h["hub_kinetic"]
    assert (energy - energy[0])[-1] == pytest.approx(h["work"][-1], rel=1e-5)


def test_uncoupled_hub_turns_as_if_rigid() -> None:
    h = rotfem.run(hub_scene({"motion.coupled": False})).history
    t = h["t"]
    # One N·m on I_R + J (and the rotary inertia of the sections): linear speed, to round-off of the sums.
    rate = 1.0 / (1.5 * J + 2.2178959e-7 * 0.5)
    during = t <= 0.05
    np.testing.assert_allclose(h["psi_dot"][during], rate * t[during], rtol=1e-9, atol=1e-12)
    assert abs(h["psi_dot"][-1]) < 1e-9


@pytest.mark.parametrize(
    ("coupled", "name", "tolerance"),
    [(True, "coupled", 7e-3), (False, "uncoupled", 3e-3)],
)
def test_histories(coupled: bool, name: str, tolerance: float, reference: Callable[[str], Path]) -> None:
    # Euler–Bernoulli modes with the centrifugal stiffness of the instantaneous speed; shear, stretch and the step of
    # 1e-4 s make up the tolerance (of the largest deflection).
    table = np.loadtxt(reference(f"hub_beam_pulse_{name}_beta0.5.csv"), delimiter=",")
    scene = hub_scene({"model.theory": "consistent_linear", "motion.coupled": coupled, "time.step": 1e-4})
    h = rotfem.run(scene).history
    table = table[table[:, 0] <= h["t"][-1]]
    deflection = np.interp(table[:, 0], h["t"], h["tip_u2"])
    assert np.max(np.abs(deflection - table[:, 1])) <= tolerance * np.max(np.abs(table[:, 1]))


def test_exact_history() -> None:
    # Legendre–Ritz with 13 functions, step 1.25e-4 s: w(0.05) = −14.1945 mm, ψ' = 7.2071 rad/s; −14.3691 mm at its
    # least. Agreement 1e-3 relative, about the difference between 10 and 13 functions at other times.
    h = rotfem.run(hub_scene({"time.step": 1e-4})).history
    i = int(np.argmin(np.abs(h["t"] - 0.05)))
    assert h["tip_u2"][i] == pytest.approx(-14.1945e-3, rel=1e-3)
    assert h["psi_dot"][i] == pytest.approx(7.2071, rel=1e-3)
    assert np.min(h["tip_u2"]) == pytest.approx(-14.3691e-3, rel=1e-3)


@pytest.mark.parametrize(("theory", "coupled"), [("consistent_linear", False), ("reissner", True)])
def test_border_is_the_derivative_of_both_equations(theory: str, coupled: bool) -> None:
    """M, C, K with the angle as last unknown against central differences of F and of the hub's equation."""
    changes = {"model.theory": theory, "motion.coupled": coupled, "motion.hub_damping": 1e-3, "mesh.elements": 3}
    changes |= {
        "structure.tip_mass": 0.01,
        "structure.damping.kelvin_voigt": 1e-4,
        "structure.damping.rayleigh": [0.2, 0.0],
    }
    system = Problem.of(hub_scene(changes)).system()
    system.set_time(0.03)
    random, free = np.random.default_rng(3), np.ones(len(system.zeros()) + 1, dtype=bool)
    free[system.clamped] = False
    size = np.append(system.scale, 1.0) * free
    state = [random.normal(size=free.size) * size * s for s in (1e-3, 1.0, 100.0)]
    direction = random.normal(size=free.size) * size

    def equations(which: int, step: float) -> np.ndarray:
        system.set_state(*(x + step * direction * (i == which) for i, x in enumerate(state)))
        return np.append(-system.residual().array, system.row.residual(0.03))

    for which, (name, step) in enumerate((("K", 1e-6), ("C", 1e-2), ("M", 1.0))):
        difference = (equations(which, step) - equations(which, -step)) / (2 * step)
        system.set_state(*state)
        matrices = dict(zip("MCK", system.with_hub(system.mass_damping_stiffness()), strict=True))
        bordered = matrices[name].convert("dense").getDenseArray()
        off = np.abs(bordered @ direction - difference)[free]
        assert np.max(off[:-1]) < 1e-6 * np.max(np.abs(difference[:-1]))
        assert off[-1] < 1e-6 * abs(difference[-1]) + 1e-12
        assert np.any(bordered[-1, :-1] != 0.0) == coupled
