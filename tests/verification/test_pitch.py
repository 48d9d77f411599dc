"""Pitch over time: rigid bodies, power of the actuator, an independent Ritz code, and a pitch that stays as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, eigh
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

import rotfem

pytestmark = pytest.mark.usefixtures("unestimated")

L, HUB, MASS = 2.0, 0.5, 3.0
#: Rotary inertias per length about axes 2 and 3, and the centre of mass beside the axis.
INERTIA, CENTER = (0.02, 0.3), (0.05, -0.02)
RIGID = {
    **dict.fromkeys(("EA", "GA2", "GA3", "GJ", "EI2", "EI3"), 1e9),
    **{"mass_per_length": MASS, "rotary_inertia2": INERTIA[0], "rotary_inertia3": INERTIA[1], "mass_center": CENTER},
}
SOFT = {"EA": 1e9, "GA2": 1e9, "GA3": 1e9, "GJ": 1e6, "EI2": 1.4e4, "EI3": 5e4, "mass_per_length": 1.2}
AXES = np.eye(3)
ROOT = ("root_f1", "root_f2", "root_f3", "root_m1", "root_m2", "root_m3")


def run(structure: dict[str, Any], pitch: Any, theory: str, **tables: Any) -> Any:
    """Return the history of a spatial beam with this pitch, spun at 4 rad/s unless it is said otherwise."""
    tables = {"motion": {"type": "constant", "speed": 4.0}, "mesh": {"elements": 2}, **tables}
    root = {**structure.get("root", {}), "pitch": pitch}
    scene = {"structure": {"type": "spatial_beam", **structure, "root": root}, "model": {"theory": theory}, **tables}
    return rotfem.run(scene)


def turned(axis: Any, angle: float) -> Any:
    """Return the matrix of a turn, by scipy."""
    return Rotation.from_rotvec(angle * np.asarray(axis)).as_matrix()


def derivatives(f: Any, t: float, h: float = 2e-4) -> tuple[Any, Any]:
    """Return ḟ and f̈ by differences of fourth order."""
    a, b, c, d, e = (f(t + k * h) for k in (-2, -1, 0, 1, 2))
    return (a - 8 * b + 8 * d - e) / (12 * h), (-a + 16 * b - 30 * c + 16 * d - e) / (12 * h * h)


class RigidBlade:
    """Points of a blade that turns with hub and pitch: mass on a line and directors, in an inertial frame."""

    def __init__(self, precone: float, pitch: Any, psi: Any):
        self.pitch, self.psi, self.root = pitch, psi, HUB * AXES[0]
        self.axis = np.array([np.cos(precone), 0.0, np.sin(precone)])
        third = np.cross(self.axis, AXES[1])
        x, w = np.polynomial.legendre.leggauss(4)
        self.x, self.weights = L * (x + 1) / 2, L * w / 2
        center = CENTER[0] * AXES[1] + CENTER[1] * third
        self.arms = np.array([*(x * self.axis + center for x in self.x), AXES[1], third])
        self.masses = np.array([*(MASS * self.weights), L * INERTIA[1], L * INERTIA[0]])
        self.at_place = np.array([1.0] * len(x) + [0.0, 0.0])  # a director has no place

    def places(self, t: float) -> Any:
        """Return where they are, (n, 3)."""
        arms = self.arms @ turned(self.axis, self.pitch(t)).T + np.outer(self.at_place, self.root)
        return arms @ turned(AXES[2], self.psi(t)).T

    def kinetic(self, t: float) -> float:
        """Return the kinetic energy, J."""
        rate, _ = derivatives(self.places, t)
        return float(0.5 * self.masses @ np.sum(rate**2, axis=1))

    def reaction(self, t: float, gravity: Any, line_load: Any) -> Any:
        """Return force and moment of the hub about the root, axes of the hub; the line load is given in these."""
        _, acceleration = derivatives(self.places, t)
        of_hub = turned(AXES[2], self.psi(t))
        force = self.masses[:, None] * (acceleration - np.outer(self.at_place, gravity)) @ of_hub
        arms = self.places(t) @ of_hub - np.outer(self.at_place, self.root)
        f, m = force[self.at_place > 0].sum(axis=0), np.cross(arms, force).sum(axis=0)
        m -= sum(np.cross(w * x * self.axis, line_load) for x, w in zip(self.x, self.weights, strict=True))
        return np.concatenate([f - L * np.array(line_load), m])


@pytest.mark.parametrize(("theory", "precone"), [("consistent_linear", 0.0), ("reissner", 0.15)])
def test_rigid_blade(theory: str, precone: float) -> None:
    """Reaction and kinetic energy of a rigid blade, pitched by ±23° about 11° on a hub that speeds up, with all loads.

    With a precone the axis of the pitch does not meet that of the hub's center, with which the frame's origin moves.
    Elastic waves of the start, at 1e4 rad/s and more, are damped out by the scheme within some steps.
    """
    gravity, line_load = [1.0, 2.0, -9.81], [1.0, 2.0, 3.0]
    pitch = {"value": 0.2, "harmonic": {"amplitude": 0.4, "frequency": 2.0, "phase": -np.pi / 2}}
    found = run(
        {"length": L, "hub_radius": HUB, "precone": precone, "section": RIGID, "damping": {"kelvin_voigt": 1e-2}},
        pitch,
        theory,
        motion={"type": "table", "table": [[0, 4.0], [2, 5.0]]},
        loads={"gravity": gravity, "distributed": {"value": line_load}},
        time={"end": 1.0, "step": 0.01, "scheme": "generalised_alpha", "spectral_radius": 0.0},
    )
    blade = RigidBlade(precone, lambda t: 0.2 + 0.4 * np.sin(2 * t), lambda t: 4 * t + t * t / 4)
    for i in (40, 60, 80):
        t = float(found.history["t"][i])
        exact = blade.reaction(t, gravity, line_load)
        np.testing.assert_allclose([found.history[name][i] for name in ROOT], exact, atol=1e-4, rtol=1e-5)
        assert found.history["kinetic"][i] == pytest.approx(blade.kinetic(t), rel=1e-6)
        assert found.history["pitch"][i] == pytest.approx(blade.pitch(t), rel=1e-12)


STAYS = {"table": [[0, 0.3], [2, 0.3]], "harmonic": [{"amplitude": 0.0, "per_rev": 1}]}


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
    about_hub = moment + np.cross(HUB * AXES[0], force)
    power = spin * about_hub[:, 2] - amplitude * omega * np.sin(omega * t) * (moment @ e)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(t))])
    energy = found["kinetic"] + found["strain"]
    assert np.ptp(found["tip_u3"]) > 0.01 * L
    np.testing.assert_allclose(energy - energy[0], work, atol=5e-3 * np.ptp(energy))


def test_cyclic_pitch_of_an_elastic_blade() -> None:
    """Flap and lag of a blade with collective and once-per-rev pitch under gravity, against a Ritz code.

    In the frame that is pitched by θ a point (R + X, v, w) has the angular velocity (θ̇, Ω sin θ, Ω cos θ); v and w are
    polynomials, with the stiffness of bending and of N⁰ by the spin.
    """
    R, length, spin, g, mean, cyclic = 1.0, 10.0, 4.0, 9.81, 0.1, 0.25
    m, EI = SOFT["mass_per_length"], (SOFT["EI3"], SOFT["EI2"])
    found = run(
        {"length": length, "hub_radius": R, "section": SOFT},
        {"value": mean, "harmonic": {"amplitude": cyclic, "per_rev": 1.0, "phase": 0.3}},
        "consistent_linear",
        mesh={"elements": 4},
        time={"end": 3.0, "step": 0.0025},
        loads={"gravity": [0.0, 0.0, -g]},
        initial={"state": "undeformed"},
    ).history
    x, weights = np.polynomial.legendre.leggauss(24)
    x, weights = length * (x + 1) / 2, length * weights / 2
    basis = [np.polynomial.Polynomial([*[0.0] * k, 1.0], [0, length], [0, 1]) for k in range(2, 10)]
    N0 = m * spin**2 * (R * (length - x) + (length**2 - x**2) / 2)

    def integral(order: int, factor: Any) -> Any:
        values = np.array([p.deriv(order)(x) if order else p(x) for p in basis])
        return (values * weights * factor) @ values.T

    M, G, B = integral(0, m), integral(1, N0), integral(2, 1.0)
    load, pull = (np.array([np.sum(weights * m * f * p(x)) for p in basis]) for f in (1.0, R + x))
    shapes = [eigh(EI_i * B + G, M)[1][:, :4] for EI_i in EI]  # the slowest motions of either direction
    V = block_diag(*shapes)
    n = len(basis)

    def rates(t: float, y: Any) -> Any:
        q, dq = ((V @ part).reshape(2, n) for part in y.reshape(2, -1))
        angle = spin * t + 0.3
        theta, rate, second = mean + cyclic * np.cos(angle), -cyclic * spin * np.sin(angle), -cyclic * spin**2
        s, c = np.sin(theta), np.cos(theta)
        w, dw = (
            np.array([rate, spin * s, spin * c]),
            np.array([second * np.cos(angle), spin * c * rate, -spin * s * rate]),
        )
        spun = np.outer(w, w) - (w @ w) * np.eye(3) + np.cross(dw, np.eye(3)).T
        forces = []
        for i, EI_i in enumerate(EI):
            f = -(EI_i * B + G) @ q[i] - M @ (spun[i + 1, 1:] @ q) - spun[i + 1, 0] * pull - g * load * (s, c)[i]
            forces.append(f - 2 * rate * M @ (-dq[1], dq[0])[i])
        return np.concatenate([y[V.shape[1] :], V.T @ np.concatenate(forces)])

    t = found["t"]
    y = solve_ivp(rates, (0.0, t[-1]), np.zeros(2 * V.shape[1]), t_eval=t, rtol=1e-7, atol=1e-9, method="LSODA").y
    v, w = ((V @ y[: V.shape[1]]).reshape(2, n, -1)).sum(axis=1)  # every function of the basis is 1 at the tip
    s, c = np.sin(found["pitch"]), np.cos(found["pitch"])
    seen = c * v - s * w, s * v + c * w
    for name, values in zip(("tip_u2", "tip_u3"), seen, strict=True):
        np.testing.assert_allclose(found[name], values, atol=5e-3 * np.abs(values).max())


HINGES = {"flap_stiffness": 30.0, "lag_stiffness": 80.0, "flap_damping": 4.0, "lag_damping": 6.0}


def hinged_rigid_blade(times: Any, pitch: Any, gravity: float, spin: float) -> Any:
    """Return flap and lag (2, n) of a rigid blade with `HINGES`, rotation vectors in the hub's axes, from rest."""
    x, w = np.polynomial.legendre.leggauss(3)
    arms = np.array([*np.outer(L * (x + 1) / 2, AXES[0]), AXES[1], AXES[2]])
    masses = np.array([*(MASS * L * w / 2), L * INERTIA[1], L * INERTIA[0]])
    at_place = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
    stiffness, damping = (
        np.array([HINGES[f"{n}_{kind}"] for n in ("flap", "lag")]) for kind in ("stiffness", "damping")
    )

    def places(q: Any, t: float) -> Any:
        turn = Rotation.from_rotvec([0.0, *q]).as_matrix() @ turned(AXES[0], pitch(t))
        return (arms @ turn.T + HUB * np.outer(at_place, AXES[0])) @ turned(AXES[2], spin * t).T

    def rates(t: float, y: Any) -> Any:
        q, v, h = y[:2], y[2:], 1e-5
        J = np.stack([(places(q + h * e, t) - places(q - h * e, t)) / (2 * h) for e in np.eye(2)], axis=-1)
        _, rest = derivatives(lambda s: places(q + (s - t) * v, s), t)
        M = np.einsum("nia,n,nib->ab", J, masses, J)
        work = np.einsum("nia,n,ni->a", J, masses, -rest - gravity * np.outer(at_place, AXES[2]))
        return np.concatenate([v, np.linalg.solve(M, work - stiffness * q - damping * v)])

    def balanced(q: Any) -> Any:
        """Return the moments at rest, unpitched."""

        def around(q: Any) -> Any:
            return arms @ Rotation.from_rotvec([0.0, *q]).as_matrix().T

        at = around(q) + HUB * np.outer(at_place, AXES[0])
        J = [(around(q + 1e-5 * e) - around(q - 1e-5 * e)) / 2e-5 for e in np.eye(2)]
        force = at * spin**2 * [1.0, 1.0, 0.0] - gravity * np.outer(at_place, AXES[2])
        return [np.einsum("ni,n,ni", part, masses, force) for part in J] - stiffness * q

    start = np.concatenate([fsolve(balanced, np.zeros(2), xtol=1e-12), np.zeros(2)])
    return solve_ivp(rates, (0.0, times[-1]), start, t_eval=times, rtol=1e-7, atol=1e-10).y[:2]


@pytest.mark.parametrize(
    ("theory", "gravity", "tolerance"),
    [
        ("consistent_linear", 0.03, 2e-3),
        pytest.param("second_order", 0.3, 1e-2, marks=pytest.mark.nightly),
        pytest.param("reissner", 9.81, 4e-3, marks=pytest.mark.nightly),
    ],
)
def test_hinges_that_do_not_pitch(theory: str, gravity: float, tolerance: float) -> None:
    """Flap and lag of a rigid blade on springs and dampers whose axes are the hub's, pitched by 6° and more.

    The rotary inertia about the pitching axes drives both; linear theories hold to the square of the angles.
    """
    amplitude = 0.6 if theory == "reissner" else 0.05
    pitch = {"value": amplitude, "harmonic": {"amplitude": -amplitude, "frequency": 3.0}}
    section = {**RIGID, "mass_center": [0.0, 0.0]}
    found = run(
        {"length": L, "hub_radius": HUB, "section": section, "root": HINGES},
        pitch,
        theory,
        loads={"gravity": [0.0, 0.0, -gravity]},
        time={"end": 2.0, "step": 0.005, "scheme": "generalised_alpha", "spectral_radius": 0.5},
        mesh={"elements": 1},
        initial={"state": "steady"},
    ).history
    exact = hinged_rigid_blade(found["t"], lambda t: amplitude * (1 - np.cos(3 * t)), gravity, 4.0)
    for name, values in zip(("tip_theta2", "tip_theta3"), exact, strict=True):
        np.testing.assert_allclose(found[name], values, rtol=0.0, atol=tolerance * np.abs(exact).max(), err_msg=name)


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
