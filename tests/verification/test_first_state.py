"""Histories that start in a mode, or with velocities: they are that mode, and a pendulum."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.analysis.equilibrium import check_steady

L = 10.0
SECTION = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2}
SPIN = {"type": "constant", "speed": 3.0}


def scene(initial: Any, **more: Any) -> dict[str, Any]:
    """Return tables of a beam that starts so."""
    return {
        "structure": {"type": "planar_beam", "length": L, "section": SECTION},
        "motion": SPIN,
        "mesh": {"elements": 4},
        "model": {"theory": "consistent_linear"},
        "initial": initial,
        "time": {"end": 0.5, "step": 1e-3},
        "output": {"error": False},
        **more,
    }


@pytest.mark.parametrize("phase", [0.0, np.pi / 2])
def test_a_mode_goes_on_as_itself(phase: float) -> None:
    """u₂ = u₂(steady) + a cos(ωt + φ) at the tip: modes of M, C, K are motions of them; steps: (ωh)²/12 ωt, 1e-4."""
    tables = scene({"mode": 2, "amplitude": 0.01, "phase": phase, "state": "steady"})
    found = rotfem.run(tables).history
    omega = rotfem.modes({**tables, "initial": {}}).frequencies[1]
    np.testing.assert_allclose(found["tip_u2"], 0.01 * np.cos(omega * found["t"] + phase), rtol=0, atol=2e-5)


@pytest.mark.parametrize("speed", [0.0, 2.0])
def test_a_mode_of_a_nonlinear_beam_has_its_foreshortening(speed: float) -> None:
    """Its energy is ρALω²a²/8 at rest, all of it strain or all kinetic, to O((a/L)²); the linear shape has 350 times.

    A clamped beam's first mode has ∫φ² = φ(L)²L/4. Spinning, energies in both phases agree, and neither rings along.
    """
    section = {"EA": 1e6, "GA": 326904.0, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1e-6}
    tables = scene(
        {"mode": 1, "amplitude": 0.05},
        structure={"type": "planar_beam", "length": 1.0, "section": section},
        motion={"type": "constant", "speed": speed},
        model={"theory": "reissner"},
        time={"end": 2.0, "step": 0.01},
    )
    still = rotfem.run({**tables, "initial": {}, "time": {"end": 0.01, "step": 0.01}}).history
    energies = []
    for phase in (0.0, np.pi / 2):
        h = rotfem.run({**tables, "initial": {**tables["initial"], "phase": phase}}).history
        energies.append(h["jacobi"][0] - still["jacobi"][0])
        assert np.ptp(h["jacobi"]) < 1e-4 * energies[-1]
        assert np.max(h["strain"]) - still["strain"][0] < 1.01 * energies[0]
        # u1 = −½ ∫u₂'² of the mode, 1.1625 (a/L)²/2 of L: an axial vibration would come on top
        assert np.min(h["tip_u1"] - still["tip_u1"][0]) == pytest.approx(-0.58 * 0.05**2, rel=0.02)
    assert energies[1] == pytest.approx(energies[0], rel=5e-3)
    if speed == 0.0:
        assert energies[0] == pytest.approx(3.516015**2 * 0.05**2 / 8, rel=5e-3)


def balanced(motion: Any, **more: Any) -> rotfem.RunResult:
    """Return a short history that starts as the default is, or as it is told."""
    return rotfem.run(scene(**{"initial": {}, "model": {"theory": "reissner"}, "motion": motion, **more}))


def test_a_free_hub_starts_in_balance() -> None:
    """A rigid rotation of the stretched beam solves the equations of hub and beam: nothing changes, to round-off."""
    found = balanced({"type": "torque", "hub_inertia": 50.0, "speed": 3.0}).history
    np.testing.assert_allclose(found["psi_dot"], 3.0, rtol=1e-10)
    assert found["tip_u1"][0] == pytest.approx(1.2 * 9.0 * L**3 / 3 / 2.8e7, rel=1e-3)  # of a rod that hardly stretches
    np.testing.assert_allclose(found["tip_u1"], found["tip_u1"][0], rtol=1e-8)


def test_loads_over_time_and_gravity_are_frozen_at_the_start() -> None:
    """The first state is the equilibrium of a scene that has the values of t = 0 for ever; a turning frame, too."""
    table = {"tip_force": [[0.0, 0.0, 3.0], [1.0, 0.0, 0.0]]}
    still = rotfem.run(scene({}, loads={"tip_force": [0.0, 3.0]}, model={"theory": "reissner"}) | {"time": None})
    assert balanced(SPIN, loads=table).tip["u2"][0] == pytest.approx(still.tip["u2"][-1], rel=1e-9)
    weight = {"distributed": [0.0, -1.2 * 9.81]}
    hung = rotfem.run(scene({}, loads=weight, model={"theory": "reissner"}) | {"time": None})
    gravity = balanced(SPIN, loads={"gravity": [0.0, -9.81]})
    assert gravity.tip["u2"][0] == pytest.approx(hung.tip["u2"][-1], rel=1e-9)
    assert np.ptp(gravity.tip["u2"]) > 0.1  # it turns from then on


def test_modes_are_about_what_a_history_starts_with() -> None:
    """Gravity across the axis and loads over time are dead loads of t = 0: the same modes at the same equilibrium."""
    tables = scene({}, model={"theory": "reissner"})
    over_time = {"gravity": [0.0, -9.81], "distributed": {"over_time": [[0.0, 0.0, 20.0], [1.0, 0.0, 0.0]]}}
    turning, frozen = tables | {"loads": over_time}, tables | {"loads": {"distributed": [0.0, 20.0 - 1.2 * 9.81]}}
    found = rotfem.modes(turning)
    np.testing.assert_allclose(found.frequencies, rotfem.modes(frozen).frequencies, rtol=1e-8)
    said = " ".join(found.summary["warnings"])
    assert "loads.distributed changes with time: taken as at t = 0" in said
    assert "loads.gravity turns in the rotating frame: taken as at t = 0" in said
    diagram = rotfem.campbell(turning, [0.0, 3.0])
    np.testing.assert_allclose(diagram.frequencies[-1], found.frequencies, rtol=1e-8)


def test_gravity_along_a_tilted_axis_does_not_turn() -> None:
    """Its direction is that of the axis to round-off, or to the digits that it is typed with."""
    section = {"EA": 1e6, "GA2": 1e5, "GA3": 1e5, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0}
    blade = {"type": "spatial_beam", "length": 1.0, "section": section}

    def check(axis: Any, gravity: Any) -> None:
        tables = scene({}, structure=blade, motion=SPIN | {"axis": list(axis)}, loads={"gravity": list(gravity)})
        check_steady(rotfem.Problem.of(tables))

    for axis in np.random.default_rng(1).normal(size=(20, 3)):
        check(axis, 9.81 * axis)
    check([1, 0, 3], [3.102194, 0, 9.306583])
    with pytest.raises(rotfem.InputError, match="across the spin axis"):
        check([1, 0, 3], [3.1022, 0, 9.3065])


def test_what_starts_without_forces_starts_undeformed() -> None:
    spin_up = balanced({"type": "spin_up", "speed": 6.0, "duration": 15.0})
    assert all(values[0] == 0.0 for values in spin_up.tip.values())
    assert "stability" not in spin_up.summary  # no equilibrium was computed


def test_a_hinged_blade_that_is_pushed() -> None:
    """φ = (w/ω) sin ωt of the rigid blade, ω² = 3k/ρAL³, with velocities w x; it bends by k L/EI = 3e-4 beside."""
    stiff, k, w = {"EA": 1e10, "GA": 1e10, "EI": 1e7, "mass_per_length": 1.2}, 300.0, 0.01
    structure = {"type": "planar_beam", "length": L, "section": stiff, "root": {"lag_stiffness": k}}
    rest = {"type": "constant", "speed": 0.0}
    tables = scene({"velocity": [[0, 0, 0], [L, 0, w * L]]}, structure=structure, motion=rest, mesh={"elements": 1})
    found = rotfem.run({**tables, "time": {"end": 4.0, "step": 0.01}}).history
    omega = np.sqrt(3 * k / (1.2 * L**3))
    np.testing.assert_allclose(
        found["tip_alpha"], w / omega * np.sin(omega * found["t"]), rtol=0, atol=3e-4 * w / omega
    )


@pytest.mark.parametrize(
    ("initial", "more", "words"),
    [
        ({"mode": 1}, {}, "given together"),
        ({"phase": 1.0}, {}, "needs a mode"),
        ({"mode": 1, "amplitude": 0.1, "tip_displacement": 0.1}, {}, "cannot be combined"),
        ({"velocity": [[0, 0, 1], [L, 0, 1]]}, {}, "zero at x = 0"),
        ({"velocity": [[0, 0, 0], [5, 0, 1]]}, {}, "to the length"),
        ({"mode": 1, "amplitude": 0.1}, {"motion": {"type": "torque", "hub_inertia": 1.0}}, "prescribed"),
    ],
)
def test_refused(initial: Any, more: Any, words: str) -> None:
    with pytest.raises(rotfem.SceneError, match="initial") as caught:
        rotfem.Scene.from_dict(scene(initial, **more))
    assert words in str(caught.value)


def test_a_mode_that_there_is_not() -> None:
    tables = scene({"mode": 99, "amplitude": 0.1}, mesh={"elements": 1})
    with pytest.raises(rotfem.InputError, match="initial.mode = 99: must be at most"):
        rotfem.run(tables)


def test_a_growth_that_a_history_does_not_see_is_a_warning() -> None:
    """Beyond lateral buckling: exp(0.96 t) is a factor of 1.01 in 0.01 s, and refused over 5 s."""
    section = {"EA": 1e6, "GA2": 1e6, "GA3": 1e6, "GJ": 0.5, "EI2": 1.0, "EI3": 1e4, "mass_per_length": 1.0}
    section |= {"rotary_inertia2": 1e-4, "rotary_inertia3": 1e-4}
    tables = {
        "structure": {"type": "spatial_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [0.0, 2.9, 0.0]},
        "time": {"end": 0.01, "step": 0.01},
    }
    assert "by a factor of 1.01 in the 0.01 s" in " ".join(rotfem.run(tables).warnings)
    with pytest.raises(rotfem.ComputationError, match="would start from an unstable equilibrium"):
        rotfem.run({**tables, "time": {"end": 5.0, "step": 0.01}})
