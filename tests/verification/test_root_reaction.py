"""Force and moment of the hub on the structure: closed forms, and the balance of momentum and of its moment."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem
from tests.balances import AXES, Rigid, balance
from tests.beams import STRUCTURE

RADIUS = 0.5
BEAM = {**STRUCTURE, "hub_radius": RADIUS, "tip_mass": 0.3}
SCENE: dict[str, Any] = {
    "structure": BEAM,
    "motion": {"type": "spin_up", "speed": 3.0, "duration": 1.5},
    "mesh": {"elements": 4, "degree": 3},
    "output": {"error": False},
}
#: What acts on the beam from outside, beside its own inertia.
ACTING = {"tip_force": {"value": [1.0, 3.0], "kind": "follower"}, "gravity": [0.0, -9.81, 0.0]}
BALANCES = {
    "root_f1": balance(Rigid(shift=AXES[0])),
    "root_f2": balance(Rigid(shift=AXES[1])),
    "root_m3": balance(Rigid(turn=AXES[2], root=RADIUS)),
}


#: Schemes, and how far what they end in is off: Newton's last increment, 1e-9 times EA; two of them times 1/h.
DIGITS = {"generalised_alpha": 1e-10, "newmark": 1e-10, "energy_conserving": 1e-10, "esdirk4": 1e-5}
#: Damping that stresses carry, and that the hub takes up.
LAST = ("generalised_alpha",)
DAMPING: dict[str, Any] = {"none": {}, "rayleigh": {"rayleigh": [0.8, 2e-3]}, "modal": {"modal": [0.02, 0.03, 0.05]}}


@pytest.mark.parametrize(
    ("scheme", "damping"),
    [*((scheme, "none") for scheme in DIGITS), *((name, kind) for name in LAST for kind in ("rayleigh", "modal"))],
)
def test_balance_of_momentum_and_its_moment(scheme: str, damping: str) -> None:
    # F(q, v, a) = 0 in a rigid motion of the whole beam, which strains of the exact theory do not feel; no damping
    # acts on its momentum from outside.
    time, digits = {"end": 1.6, "step": 0.02, "scheme": scheme}, DIGITS[scheme]
    scene = {**SCENE, "structure": {**BEAM, "damping": DAMPING[damping]}, "loads": ACTING, "time": time}
    scene["initial"] = {"state": "undeformed"}
    result = rotfem.run(scene, outputs={f"b_{n}": b for n, b in BALANCES.items()})
    for name in BALANCES:
        root, whole = result.history[name], result.history[f"b_{name}"]
        assert np.max(np.abs(root - whole)) < digits * np.max(np.abs(root)), name


@pytest.mark.parametrize("theory", ["linear", "consistent_linear", "second_order", "reissner"])
def test_statics(theory: str) -> None:
    # The forces balance at the displaced tip; in the theory `linear` at the undeformed one. Of loads without
    # acceleration gravity has the weight 1.2 · 10 + 0.3 kg in it; round-off of EA/EI · L² = 2e5 is left.
    loads = {"tip_force": [0.0, 3.0], "distributed": [0.0, -0.2], "tip_moment": [4.0]}
    scene = {**SCENE, "motion": {"type": "constant", "speed": 0.0}, "loads": loads, "model": {"theory": theory}}
    result = rotfem.run(scene)
    root = result.summary["root"]
    assert root["place"] == [RADIUS, 0.0, 0.0]
    assert root["root_f2"] == pytest.approx(-(3.0 - 0.2 * 10.0), rel=1e-8)
    x, u = result.shape["x"], result.shape["u1"] if theory == "reissner" else 0.0 * result.shape["u1"]
    arm = float(np.trapezoid(x + u, x))  # of the distributed load; u1 is 1e-4 of x and known at 13 nodes
    moment = -(3.0 * (10.0 + u[-1]) - 0.2 * arm + 4.0)
    assert root["root_m3"] == pytest.approx(moment, rel=1e-6 if theory in ("linear", "reissner") else 1e-3)
    assert result.history["root_m3"][0] == root["root_m3"]


def test_spinning_rod() -> None:
    # EA u'' + ρA Ω² (R + X + u) = 0 in the linear theory, u(0) = 0, EA u'(L) = m Ω² (R + L + u(L)): w = R + X + u is
    # R cos kX + B sin kX, and N(0) = EA (w'(0) − 1) = −root_f1. Nodal forces are exact to the sixth order of the mesh.
    omega, EA, line, mass, length = 40.0, 2.8e7, 1.2, 0.3, 10.0
    k, c = omega * np.sqrt(line / EA), mass * omega**2 / EA
    cos, sin = np.cos(k * length), np.sin(k * length)
    B = (1 + RADIUS * (k * sin + c * cos)) / (k * cos - c * sin)
    scene = {**SCENE, "motion": {"type": "constant", "speed": omega}, "model": {"theory": "consistent_linear"}}
    root = rotfem.run(scene).summary["root"]
    assert root["root_f1"] == pytest.approx(-EA * (B * k - 1), rel=1e-9)
    assert root["root_f2"] == pytest.approx(0.0, abs=1e-9 * abs(root["root_f1"]))


@pytest.mark.parametrize("theory", ["linear", "consistent_linear", "second_order", "reissner"])
def test_the_equation_of_a_free_hub(theory: str) -> None:
    # I ψ'' + c ψ' + (moment about the axis) = M(t) at every step, to Newton's last increment; over a torque pulse.
    hub = {"type": "torque", "hub_inertia": 100.0, "hub_damping": 0.3, "pulses": [[0.0, 0.2, 150.0]]}
    time = {"end": 0.4, "step": 0.01}
    problem = rotfem.Problem.of({**SCENE, "motion": hub, "model": {"theory": theory}, "time": time})
    for moment in problem.march(end=0.4, step=0.01):
        root, state = moment.root(), moment.state
        about_axis = root["m3"] + RADIUS * root["f2"]
        torque = moment.hub()["torque"] if moment.t < 0.195 or moment.t > 0.205 else None
        if torque is not None:  # at its jump the state is that before, the torque that after it
            assert 100.0 * state.a[-1] + 0.3 * state.v[-1] + about_axis == pytest.approx(torque, abs=1e-6 * 150.0)
        assert moment.t < 0.2 or abs(about_axis) > 0.0


def test_spatial_beam_and_plate_at_rest() -> None:
    # Statics at the undeformed structure in the linear theory: f = −F, m = −(x − x_root)×F, whatever lies between.
    beam = {
        "type": "spatial_beam",
        "length": 2.0,
        "hub_offset": [0.3, 0.1, -0.2],
        "precone": 0.2,
        "section": {"shape": "rectangle", "width": 0.05, "height": 0.02, "E": 7e10, "nu": 0.3, "rho": 2700.0},
    }
    plate = {"type": "plate", "length": 1.0, "width": 0.4, "thickness": 0.01, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    F = np.array([2.0, -3.0, 5.0])
    arms = {"spatial_beam": 2.0 * np.array([np.cos(0.2), 0.0, np.sin(0.2)]), "plate": np.array([1.0, 0.0, 0.0])}
    for structure in (beam, plate):
        still = {"motion": {"type": "constant", "speed": 0.0}, "model": {"theory": "linear"}}
        still["loads"] = {"tip_force": list(F)}
        mesh = {"elements": 2 if structure is beam else [2, 2]}
        root = rotfem.run({"structure": structure, "mesh": mesh, **still}).summary["root"]
        moment = -np.cross(arms[structure["type"]], F)
        assert [root[f"root_f{i}"] for i in (1, 2, 3)] == pytest.approx(list(-F), rel=1e-7)
        assert [root[f"root_m{i}"] for i in (1, 2, 3)] == pytest.approx(list(moment), rel=1e-7, abs=1e-9)
