"""Pitch over time: rigid bodies, power of the actuator, an independent Ritz code, and a pitch that stays as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem

L, HUB, MASS = 2.0, 0.5, 3.0
#: Rotary inertias per length about axes 2 and 3, and the centre of mass beside the axis.
INERTIA, CENTER = (0.02, 0.3), (0.05, -0.02)
RIGID = {
    **dict.fromkeys(("EA", "GA2", "GA3", "GJ", "EI2", "EI3"), 1e9),
    **{"mass_per_length": MASS, "rotary_inertia2": INERTIA[0], "rotary_inertia3": INERTIA[1], "mass_center": CENTER},
}
SOFT = {"EA": 1e9, "GA2": 1e9, "GA3": 1e9, "GJ": 1e6, "EI2": 1.4e4, "EI3": 5e4, "mass_per_length": 1.2}
ROOT = ("root_f1", "root_f2", "root_f3", "root_m1", "root_m2", "root_m3")


def run(structure: dict[str, Any], pitch: Any, theory: str, **tables: Any) -> Any:
    """Return the history of a spatial beam with this pitch, spun at 4 rad/s unless it is said otherwise."""
    tables = {"motion": {"type": "constant", "speed": 4.0}, "mesh": {"elements": 2}, **tables}
    root = {**structure.get("root", {}), "pitch": pitch}
    scene = {"structure": {"type": "spatial_beam", **structure, "root": root}, "model": {"theory": theory}, **tables}
    return rotfem.run(scene)


#: Precone ↦ time (s) ↦ force and moment of the hub about the root, axes of the hub, and the kinetic energy (J) of the
#: rigid blade of `test_rigid_blade`: masses at four Gauss points and directors, their places in the inertial frame
#: differentiated by differences of fourth order.
REACTIONS: dict[float, dict[float, list[float]]] = {
    0.0: {
        0.4: [-172.316318, 1.5876053, 52.4805794, 6.45000672, -52.8093994, 10.8619767, 141.053857],
        0.6: [-170.92135, 7.88142079, 52.3818513, 6.72558189, -53.7381596, 17.3922674, 147.390765],
        0.8: [-167.954572, 4.92157378, 52.3555852, 6.99089926, -54.475357, 14.9088304, 154.292073],
    },
    0.15: {
        0.4: [-170.980664, 1.32656928, 52.4848399, 6.24066786, -82.5032182, 10.4038944, 139.012127],
        0.6: [-169.433524, 7.72496346, 52.3872204, 5.49349478, -83.2603656, 16.9039158, 145.027879],
        0.8: [-166.371459, 4.89232225, 52.3612492, 6.07683146, -83.7073371, 14.5518131, 151.644958],
    },
}


@pytest.mark.parametrize(("theory", "precone"), [("consistent_linear", 0.0), ("reissner", 0.15)])
def test_rigid_blade(theory: str, precone: float) -> None:
    """Reaction and kinetic energy of a rigid blade, pitched by ±23° about 11° on a hub that speeds up, with all loads.

    With a precone the axis of the pitch does not meet that of the hub's center, with which the frame's origin moves.
    Elastic waves of the start, at 1e4 rad/s and more, are damped out by the scheme within some steps.
    """
    found = run(
        {"length": L, "hub_radius": HUB, "precone": precone, "section": RIGID, "damping": {"kelvin_voigt": 1e-2}},
        {"value": 0.2, "harmonic": {"amplitude": 0.4, "frequency": 2.0, "phase": -np.pi / 2}},
        theory,
        motion={"type": "table", "table": [[0, 4.0], [2, 5.0]]},
        loads={"gravity": [1.0, 2.0, -9.81], "distributed": {"value": [1.0, 2.0, 3.0]}},
        time={"end": 0.8, "step": 0.01, "scheme": "generalised_alpha", "spectral_radius": 0.0},
    ).history
    for t, exact in REACTIONS[precone].items():
        i = round(t / 0.01)
        np.testing.assert_allclose([found[name][i] for name in ROOT], exact[:6], atol=1e-4, rtol=1e-5)
        assert found["kinetic"][i] == pytest.approx(exact[6], rel=1e-6)
        assert found["pitch"][i] == pytest.approx(0.2 + 0.4 * np.sin(2 * t), rel=1e-12)


STAYS = {"over_time": [[0, 0.3], [2, 0.3]], "harmonic": [{"amplitude": 0.0, "per_rev": 1}]}


@pytest.mark.parametrize("pitch", [lambda t: 0.3, STAYS], ids=["function", "table"])
def test_pitch_that_stays(pitch: Any) -> None:
    """What does not change is the constant pitch: a function to round-off, the other ways to the last bit."""
    blade = {"length": 10.0, "hub_radius": 1.0, "section": SOFT}
    tables = {"time": {"end": 0.5, "step": 0.02}, "loads": {"gravity": [0, 0, -9.81], "tip_force": [0, 5.0, 0]}}
    tables["initial"] = {"state": "undeformed"}
    same, found = (run(blade, p, "linear", **tables) for p in (0.3, pitch))
    for name, values in same.history.items():
        tolerance = 1e-11 * np.abs(values).max() if callable(pitch) else 0.0
        np.testing.assert_allclose(found.history[name], values, rtol=0.0, atol=tolerance)


def test_slow_pitch_and_what_is_at_its_start() -> None:
    """Displacements and moments pass through those of steady states; modes and steady states have the pitch of t = 0.

    The pitch takes 50 times the longest period; what it leaves is damped.
    """
    blade = {"length": 10.0, "hub_radius": 1.0, "section": SOFT, "damping": {"kelvin_voigt": 0.02}}
    loads, rows = {"gravity": [0, 0, -9.81], "distributed": [0.0, 4.0, 0.0]}, [[0, 0.1], [60, 0.8]]
    steps = {"end": 60.0, "step": 0.1, "scheme": "generalised_alpha", "spectral_radius": 0.3}
    moved = run(blade, rows, "consistent_linear", loads=loads, time=steps, initial={"state": "steady"})
    for i, pitch in ((0, 0.1), (-1, 0.8)):
        still = run(blade, pitch, "consistent_linear", loads=loads)
        for name in ("tip_u2", "tip_u3", "tip_theta1", "tip_theta2", "tip_theta3", "root_m2", "root_m3", "root_f3"):
            assert moved.history[name][i] == pytest.approx(still.history[name][0], rel=3e-4 if i else 1e-8), name
    first = run(blade, rows, "consistent_linear", loads=loads)
    assert first.tip == pytest.approx(run(blade, 0.1, "consistent_linear", loads=loads).tip, rel=1e-10)
    assert any("structure.root.pitch changes with time" in said for said in first.summary["warnings"])


def test_power_of_the_actuator() -> None:
    """Kinetic and strain energy grow by the work of the hub: its moment about the axis times Ω, and m·e times θ̇.

    Loads and damping are there, and so weak that they do nothing, for the forms of `test_rigid_blade`.
    """
    precone, amplitude, omega, spin = 0.1, 0.3, 5.0, 4.0
    soft = {**RIGID, "EI2": 200.0, "EI3": 600.0, "GJ": 100.0, "EA": 1e6, "GA2": 1e5, "GA3": 1e5}
    found = run(
        {"length": L, "hub_radius": HUB, "precone": precone, "section": soft, "damping": {"kelvin_voigt": 1e-14}},
        {"harmonic": {"amplitude": amplitude, "frequency": omega}},
        "reissner",
        motion={"type": "table", "table": [[0, spin], [2, spin], [3, 5.0]]},
        loads={"gravity": [1e-9, 1e-9, -1e-9], "distributed": {"value": [1e-9, 1e-9, 1e-9]}},
        time={"end": 1.0, "step": 5e-3, "scheme": "generalised_alpha", "spectral_radius": 0.8},
        initial={"state": "undeformed"},
    ).history
    t, e = found["t"], np.array([np.cos(precone), 0.0, np.sin(precone)])
    force, moment = (np.column_stack([found[name] for name in names]) for names in (ROOT[:3], ROOT[3:]))
    about_hub = moment + np.cross([HUB, 0.0, 0.0], force)
    power = spin * about_hub[:, 2] - amplitude * omega * np.sin(omega * t) * (moment @ e)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    energy = found["kinetic"] + found["strain"]
    assert np.ptp(found["tip_u3"]) > 0.01 * L
    np.testing.assert_allclose(energy - energy[0], work, atol=5e-3 * np.ptp(energy))


def test_cyclic_pitch_of_an_elastic_blade() -> None:
    """Flap and lag of a blade with collective and once-per-rev pitch under gravity at 1, 2 and 3 s, to 5e-3.

    Reference: Ritz, eight polynomials with the stiffness of bending and N⁰, its four slowest motions each way, in the
    frame that is pitched by θ, of angular velocity (θ̇, Ω sin θ, Ω cos θ), by LSODA.
    """
    found = run(
        {"length": 10.0, "hub_radius": 1.0, "section": SOFT},
        {"value": 0.1, "harmonic": {"amplitude": 0.25, "per_rev": 1.0, "phase": 0.3}},
        "consistent_linear",
        mesh={"elements": 4},
        time={"end": 3.0, "step": 0.0025},
        loads={"gravity": [0.0, 0.0, -9.81]},
        initial={"state": "undeformed"},
    ).history
    exact = {"tip_u2": [-0.09110729, 0.00020438, 0.07812996], "tip_u3": [-0.02921681, -0.02521943, -0.06337395]}
    for name, largest in (("tip_u2", 0.18807663), ("tip_u3", 0.84542029)):
        np.testing.assert_allclose(found[name][[400, 800, 1200]], exact[name], atol=5e-3 * largest)


def test_hinges_that_do_not_pitch() -> None:
    """Flap and lag of a rigid blade on springs and dampers whose axes are the hub's, pitched by 6° and more.

    The rotary inertia about the pitching axes drives both; the linear theory holds to the square of the angles.
    Reference: Lagrange's equations of masses at three Gauss points and directors, by differences, at 0, 0.5 … 2 s.
    """
    section = {**RIGID, "mass_center": [0.0, 0.0]}
    hinges = {"flap_stiffness": 30.0, "lag_stiffness": 80.0, "flap_damping": 4.0, "lag_damping": 6.0}
    found = run(
        {"length": L, "hub_radius": HUB, "section": section, "root": hinges},
        {"value": 0.05, "harmonic": {"amplitude": -0.05, "frequency": 3.0}},
        "consistent_linear",
        loads={"gravity": [0.0, 0.0, -0.03]},
        time={"end": 2.0, "step": 0.005, "scheme": "generalised_alpha", "spectral_radius": 0.5},
        mesh={"elements": 1},
        initial={"state": "steady"},
    ).history
    flap = [0.000876509511, 0.00065167528, 0.000605615007, 0.00138367865, 0.000946770703]
    lag = [0.0, 5.36693256e-05, 0.000440241669, -0.000243844411, -0.000670467168]
    for name, exact in (("tip_theta2", flap), ("tip_theta3", lag)):
        np.testing.assert_allclose(found[name][::100], exact, rtol=0.0, atol=2e-3 * max(flap), err_msg=name)


@pytest.mark.parametrize("hertz", [500.0, 2000.0])
def test_a_quick_function_is_its_harmonic(hertz: float) -> None:
    """The accelerations of a ripple come from its values as from its formula; 1e-6 is of the digits of the angle."""
    omega, found = 2 * np.pi * hertz, []
    ripple = {"amplitude": 1e-3, "frequency": omega, "phase": -np.pi / 2}
    blade = {"length": 10.0, "section": SOFT | {"rotary_inertia2": 0.1, "rotary_inertia3": 0.1}}
    for pitch in ({"harmonic": ripple}, lambda t: 1e-3 * np.sin(omega * t)):
        done = run(blade, pitch, "linear", time={"end": 0.005, "step": 2e-5}, output={"error": False})
        found.append(done.history["tip_theta1"])
    assert np.max(np.abs(found[0])) > 1e-3
    assert np.max(np.abs(found[1] - found[0])) < 1e-6 * np.max(np.abs(found[0]))
