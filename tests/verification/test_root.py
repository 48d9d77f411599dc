"""Hinges, springs and dampers at the root, and pitch: closed forms, frequency equations, an independent Ritz code."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import rotfem

L, RHO = 10.0, 1.2
STILL, SPIN = {"type": "constant", "speed": 0.0}, {"type": "constant", "speed": 5.0}
#: So stiff that the blade is rigid: its first frequency of bending is 90 Ω.
STIFF = {"EA": 1e10, "GA": 1e10, "EI": 1e7, "mass_per_length": RHO}
SOFT = {"EA": 1e8, "GA": 1e8, "EI": 1.4e4, "mass_per_length": RHO}
PLANAR = {"type": "planar_beam", "length": L}
SPATIAL_SECTION = {"EA": 1e10, "GA2": 1e10, "GA3": 1e10, "GJ": 1e7, "EI2": 1e7, "EI3": 1e7, "mass_per_length": RHO}
SPATIAL = {"type": "spatial_beam", "length": L, "section": SPATIAL_SECTION}


def frequencies(structure: Any, motion: Any, theory: str, count: int = 2, **mesh: Any) -> Any:
    """Return the first frequencies, rad/s."""
    tables = {"structure": structure, "motion": motion, "model": {"theory": theory}, "modes": {"count": count}}
    return rotfem.modes({**tables, "mesh": {"elements": 4, **mesh}}).frequencies


@pytest.mark.parametrize(("theory", "where"), [("consistent_linear", "hub_radius"), ("reissner", "hinge_offset")])
def test_lag_hinge(theory: str, where: str) -> None:
    """ω/Ω = √(3e/2(R − e)) of the rigid blade, R = e + L; the bending of this one is 1e-6 of it."""
    e, root = 1.0, {"lag_stiffness": 0.0}
    blade = {**PLANAR, "section": STIFF, "hub_radius": e, "root": root}
    if where == "hinge_offset":
        blade = {**PLANAR, "section": STIFF, "root": {**root, "hinge_offset": e}}
    found = frequencies(blade, SPIN, theory)[0] / SPIN["speed"]
    assert found == pytest.approx(np.sqrt(3 * e / (2 * L)), rel=1e-5)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_flap_and_lag_hinges(theory: str) -> None:
    """Flap √(1 + 3e/2(R − e)) and lag √(3e/2(R − e)), and with springs both grow by k/I, I = ρA L³/3."""
    e, k = 0.6, 500.0
    more = 3 * e / (2 * L)
    free = {**SPATIAL, "hub_radius": e, "root": {"flap_stiffness": 0.0, "lag_stiffness": 0.0}}
    found = frequencies(free, SPIN, theory) / SPIN["speed"]
    np.testing.assert_allclose(found, [np.sqrt(more), np.sqrt(1 + more)], rtol=1e-5)
    held = {**free, "root": {"flap_stiffness": k, "lag_stiffness": 2 * k}}
    inertia = RHO * L**3 / 3 * SPIN["speed"] ** 2
    exact = sorted([np.sqrt(1 + more + k / inertia), np.sqrt(more + 2 * k / inertia)])
    # the blade bends beside the springs, which are softer by some k L / EI = 5e-4 then
    np.testing.assert_allclose(frequencies(held, SPIN, theory) / SPIN["speed"], exact, rtol=1e-4)


def test_spring_and_elastic_blade() -> None:
    """The frequency equation of a Timoshenko beam whose root turns against k: M(0) = k ψ(0)."""
    exact = [2.228602055, 18.34353346, 55.95609704]  # by transfer matrices
    blade = {**PLANAR, "section": SOFT, "root": {"lag_stiffness": 3000.0}}
    np.testing.assert_allclose(frequencies(blade, STILL, "linear", 3, elements=16), exact, rtol=2e-6)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_damped_spring_in_time_and_the_moment_of_the_hub(theory: str) -> None:
    """I φ̈ + c φ̇ + k φ = F L after a step of the force, to the order of the step; the hub exerts −(k φ + c φ̇)."""
    k, c, F, inertia = 300.0, 40.0, 0.1, RHO * L**3 / 3
    omega, ratio = np.sqrt(k / inertia), c / (2 * np.sqrt(k * inertia))
    damped, t = omega * np.sqrt(1 - ratio**2), 4.0
    decay, slope = np.exp(-ratio * omega * t), ratio / np.sqrt(1 - ratio**2)
    angle = F * L / k * (1 - decay * (np.cos(damped * t) + slope * np.sin(damped * t)))
    rate = F * L / k * decay * (slope * ratio * omega + damped) * np.sin(damped * t)
    blade = {**PLANAR, "section": STIFF, "root": {"lag_stiffness": k, "lag_damping": c}}
    tables = {"structure": blade, "motion": STILL, "loads": {"tip_force": [0, F]}, "model": {"theory": theory}}
    tables |= {"initial": {"state": "undeformed"}, "mesh": {"elements": 1}, "time": {"end": t, "step": 0.01}}
    history = rotfem.run(tables).history
    assert history["tip_alpha"][-1] == pytest.approx(angle, rel=5e-4)
    assert history["root_m3"][-1] == pytest.approx(-k * angle - c * rate, rel=5e-4)


@pytest.mark.parametrize(("k", "c"), [(1e-6, 1e-6), (1000.0, 100.0)])  # of the same forms
def test_a_blade_thrown_right_over_its_flap_hinge(k: float, c: float) -> None:
    """I (β̈ + Ω² sin β cos β) + c β̇ + k β = 0 beyond a whole turn, of a rigid blade; the hub exerts k β + c β̇."""
    speed, rate, inertia = SPIN["speed"], 20.0, RHO * L**3 / 3
    stiffer = {key: value if key == "mass_per_length" else 100 * value for key, value in SPATIAL_SECTION.items()}
    blade = {**SPATIAL, "section": stiffer, "root": {"flap_stiffness": k, "flap_damping": c}}
    thrown = {"velocity": [[0, 0, 0, 0], [L, 0, 0, rate * L]]}
    time = {"end": 0.5, "step": 2e-3, "scheme": "esdirk4"}
    tables = {"structure": blade, "motion": SPIN, "initial": thrown, "mesh": {"elements": 2}, "time": time}
    found = rotfem.run({**tables, "output": {"error": False}})

    def rates(_: float, y: Any) -> list[float]:
        return [y[1], -(speed**2) * np.sin(y[0]) * np.cos(y[0]) - (c * y[1] + k * y[0]) / inertia]

    exact = solve_ivp(rates, (0, 0.5), [0.0, rate], t_eval=found.t, rtol=1e-10, atol=1e-10).y
    assert exact[0].max() > 2.4 * np.pi
    np.testing.assert_allclose(found.tip["u3"], L * np.sin(exact[0]), rtol=0, atol=2e-3 * L)
    moment = k * exact[0] + c * exact[1]
    np.testing.assert_allclose(found.column("root_m2"), moment, rtol=0, atol=2e-2 * max(moment.max(), 1.0))


def test_a_linear_theory_on_a_hinge_that_a_load_turns_stops_where_it_ends() -> None:
    blade = {**PLANAR, "section": STIFF, "root": {"lag_stiffness": 0.0}}
    tables = {"structure": blade, "motion": STILL, "loads": {"tip_force": [0, 0.1]}, "model": {"theory": "linear"}}
    tables |= {"initial": {"state": "undeformed"}, "mesh": {"elements": 1}, "time": {"end": 100.0, "step": 1.0}}
    with pytest.raises(rotfem.ComputationError, match="no spring holds the root's hinge") as caught:
        rotfem.run(tables)
    assert caught.value.time == pytest.approx(np.sqrt(2 * RHO * L**2 / (3 * 0.1)), abs=1.0)  # ½ (F L/I) t² = 1 rad
    assert "consistent_linear" not in str(caught.value.advice)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_momentum_of_a_free_hub_with_a_hinged_blade(theory: str) -> None:
    """Spring and damper act between hub and blade: the momentum is the impulse of the torque, to that of the steps."""
    blade = {**PLANAR, "section": STIFF, "hub_radius": 0.5, "root": {"lag_stiffness": 300.0, "lag_damping": 40.0}}
    motion = {"type": "torque", "hub_inertia": 100.0, "pulses": [[0.0, 0.5, 50.0]]}
    tables = {"structure": blade, "motion": motion, "model": {"theory": theory}, "mesh": {"elements": 1}}
    history = rotfem.run({**tables, "time": {"end": 1.0, "step": 0.01}}).history
    assert history["impulse"][-1] == pytest.approx(25.0, rel=1e-12)
    assert history["angular_momentum"][-1] == pytest.approx(25.0, rel=1e-5)


def test_pitch_couples_flap_and_lag() -> None:
    """Against Rayleigh–Ritz, nine polynomials each way; shear and the Coriolis force of axial motion leave 2e-4.

    Principal axes are turned by 0.5: ½∫ EI₂ (w″c − v″s)² + EI₃ (v″c + w″s)², tension ½ρΩ²(L² − x²), and −½ρΩ² v².
    """
    section = {**SPATIAL_SECTION, "EA": 1e9, "EI2": 1.0e4, "EI3": 6.0e4, "GJ": 1e5}
    blade = {**SPATIAL, "section": section, "root": {"pitch": 0.5}}
    found = frequencies(blade, {"type": "constant", "speed": 4.0}, "consistent_linear", 4, elements=8)
    np.testing.assert_allclose(found, [4.937953006, 8.339667062, 22.4627381, 50.18919846], rtol=3e-4)


def test_a_pitched_blade_is_the_blade_that_sees_the_axis_turned() -> None:
    """A turn of the world about the axis of the blade: the same frequencies, swept and twisted too."""
    pitch = 0.4
    section = {**SPATIAL_SECTION, "EA": 1e8, "EI2": 1e4, "EI3": 6e4, "GJ": 1e4, "mass_center": [0.05, 0.0]}
    blade = {**SPATIAL, "section": section, "sweep": [[0, 0], [5, 0], [10, 0.3]], "pretwist": [[0, 0.1], [10, 0.3]]}
    blade = {**blade, "hub_radius": 0.5}
    pitched = frequencies({**blade, "root": {"pitch": pitch}}, SPIN, "consistent_linear", 4)
    axis = [0.0, np.sin(pitch), np.cos(pitch)]
    turned = frequencies(blade, {**SPIN, "axis": axis}, "consistent_linear", 4)
    np.testing.assert_allclose(pitched, turned, rtol=1e-7)  # round-off: GA is 1e7 of EI/L²


@pytest.mark.parametrize(
    ("structure", "words"),
    [
        ({**PLANAR, "section": SOFT, "root": {"flap_stiffness": 1.0}}, "unknown key"),
        ({**PLANAR, "section": SOFT, "root": {"lag_damping": 1.0}}, "needs lag_stiffness"),
        ({**PLANAR, "section": SOFT, "root": {"lag_stiffness": -1.0}}, "at least 0"),
        ({**SPATIAL, "precone": 0.1, "root": {"lag_stiffness": 1.0}}, "pitch_stiffness"),
    ],
)
def test_roots_that_are_refused(structure: Any, words: str) -> None:
    with pytest.raises(rotfem.SceneError, match=r"structure.root") as caught:
        rotfem.Scene.from_dict({"structure": structure, "motion": STILL})
    assert words in str(caught.value)


def test_hinge_in_the_inertial_frame() -> None:
    """The turn is from the hub, α − ψ: as in the rotating frame to the order of the stages, of a hub that speeds up."""
    root = {"lag_stiffness": 300.0, "lag_damping": 40.0}
    tables = {
        "structure": {**PLANAR, "section": {**SOFT, "EA": 1e7, "GA": 1e7}, "hub_radius": 1.0, "root": root},
        "motion": {"type": "spin_up", "speed": 3.0, "duration": 1.0, "axis": [0, 0, -1]},
        "mesh": {"elements": 4},
        "time": {"end": 0.75, "step": 0.00125, "scheme": "esdirk4"},
        "loads": {"gravity": [0.0, -9.81, 0.0], "tip_force": [0.0, 2.0, 0.0]},
        "output": {"error": False},
    }
    turning, fixed = (rotfem.run({**tables, "model": {"frame": f}}).history for f in ("rotating", "inertial"))
    for name in ("tip_u1", "tip_u2", "tip_alpha", "kinetic", "strain", "jacobi", "root_m3"):
        scale = max(np.abs(turning[name]).max(), 1e-3)
        np.testing.assert_allclose(fixed[name], turning[name], atol=1e-5 * scale, err_msg=name)
