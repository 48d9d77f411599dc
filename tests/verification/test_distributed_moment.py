"""Moments per length of a beam: closed forms, balances, and every way to give one against the others."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import rotfem
from rotfem import SceneError

L, EI, GA, EA, RHO = 10.0, 1.4e4, 1.0e7, 2.8e7, 1.2
PLANAR = {
    "type": "planar_beam",
    "length": L,
    "section": {"EA": EA, "GA": GA, "EI": EI, "mass_per_length": RHO, "rotary_inertia": 6e-4},
}
GJ, EI2 = 8.0e3, 9.0e3
SPATIAL = {
    "type": "spatial_beam",
    "length": L,
    "section": {
        **{"EA": EA, "GA2": GA, "GA3": 2 * GA, "GJ": GJ, "EI2": EI2, "EI3": EI, "mass_per_length": RHO},
        **{"rotary_inertia2": 3e-4, "rotary_inertia3": 6e-4},
    },
}
STILL, SPIN = {"type": "constant", "speed": 0.0}, {"type": "constant", "speed": 3.0}
TIME = {"end": 0.4, "step": 0.01}


def scene(moment: Any, theory: str = "linear", structure: Any = PLANAR, **more: Any) -> dict[str, Any]:
    """Return a scene of a beam under a moment per length."""
    tables = {"structure": structure, "motion": STILL, "mesh": {"elements": 4}, "model": {"theory": theory}}
    return {**tables, "output": {"error": False}, "loads": {"distributed_moment": moment}, **more}


def test_uniform_moment() -> None:
    """M(x) = m (L − x): α(L) = mL²/2EI, u₂(L) = mL³/3EI without shear, and the root holds −mL; exact in P3."""
    m, places = 30.0, [0.0, 3.0, 7.5]
    done = rotfem.run(scene(m, output={"stations": places}))
    assert done.tip["alpha"][0] == pytest.approx(m * L**2 / (2 * EI), rel=1e-9)
    assert done.tip["u2"][0] == pytest.approx(m * L**3 / (3 * EI), rel=1e-9)
    assert done.summary["root"]["root_m3"] == pytest.approx(-m * L, rel=1e-9)
    assert done.summary["root"]["root_f2"] == pytest.approx(0.0, abs=1e-8 * m)
    np.testing.assert_allclose(done.stations["M"][0], m * (L - np.array(places)), rtol=1e-8)
    np.testing.assert_allclose(done.stations["Q"][0], 0.0, atol=1e-7 * m)


@pytest.mark.parametrize("kind", ["dead", "follower"])
def test_large_rotation(kind: str) -> None:
    """Reissner's beam without force: α = m (Lx − x²/2)/EI up to 2 rad, r' = (cos α, sin α); dead and follower agree."""
    m, tip = 4.0 * EI / L**2, []
    for part in (np.cos, np.sin):
        tip.append(quad(lambda x, part=part: part(m * (L * x - x * x / 2) / EI), 0.0, L)[0])
    done = rotfem.run(scene({"value": m, "kind": kind}, "reissner", mesh={"elements": 16}))
    # 16 elements of degree 3: error of the mesh 1e-6
    assert done.tip["u1"][0] == pytest.approx(tip[0] - L, rel=3e-6)
    assert done.tip["u2"][0] == pytest.approx(tip[1], rel=3e-6)
    assert done.summary["root"]["root_m3"] == pytest.approx(-m * L, rel=3e-6)


def test_three_components() -> None:
    """Torsion θ₁(L) = m₁L²/2GJ, flap u₃(L) = −m₂L³/3EI₂, lag u₂(L) = m₃L³/3EI₃; linear in the moment."""
    m = np.array([3.0, 2.0, 1.0]) * 1e-6
    done = rotfem.run(scene(list(m), "linear", SPATIAL))
    wanted = {"theta1": m[0] * L**2 / (2 * GJ), "u3": -m[1] * L**3 / (3 * EI2), "u2": m[2] * L**3 / (3 * EI)}
    for name, value in wanted.items():
        assert done.tip[name][0] == pytest.approx(value, rel=1e-8), name
    for i in range(3):
        assert done.summary["root"][f"root_m{i + 1}"] == pytest.approx(-m[i] * L, rel=1e-8)


@pytest.mark.parametrize("theory", ["linear", "consistent_linear", "reissner"])
def test_equivalent_force(theory: str) -> None:
    """∫ m u' dx = m u(L): in a beam that does not shear a uniform moment is the tip force m, in motion too.

    Of the shear stiffness 3e9 the force takes m L/GA = 1e-7 m of 0.7 m; slopes of 0.1 leave 1e-2 in theories of second
    order and above, whose force is the other way of the moment's axial part, so the load is small there.
    """
    stiff = {**PLANAR, "section": {**PLANAR["section"], "GA": 3e9, "rotary_inertia": 0.0}}
    m = 3e-3
    rows = [[0.0, 0.0], [0.1, m], [0.4, 0.0]]
    first = rotfem.run(scene({"over_time": rows}, theory, stiff, motion=SPIN, time=TIME)).history
    force = {"tip_force": {"over_time": [[t, 0.0, f] for t, f in rows]}}
    second = rotfem.run({**scene(m, theory, stiff, motion=SPIN, time=TIME), "loads": force}).history
    for name in ("tip_u2", "tip_alpha"):
        assert np.max(np.abs(first[name] - second[name])) < 1e-3 * np.max(np.abs(second[name]))


def ramp(x: Any, t: Any) -> Any:
    """Return a moment (N) that is linear over the span and over time."""
    return 30.0 * (1.0 - x / L) * t / TIME["end"]


WAYS: dict[str, Any] = {
    "table": {"over_span_and_time": [[x, t, ramp(x, t)] for x in (0.0, L) for t in (0.0, TIME["end"])]},
    "function": lambda x, t: ramp(x, t),
}


def test_one_moment_in_every_way() -> None:
    """Tables over span and time, a function, and the same as three components of a spatial beam: one history."""
    theory, time, moved = "consistent_linear", {"end": 0.2, "step": 0.02}, {"motion": SPIN}
    wanted = rotfem.run(scene(WAYS["table"], theory, time=time, **moved)).history
    found = {"function": rotfem.run(scene(WAYS["function"], theory, time=time, **moved)).history}
    rows = [[x, t, 0.0, 0.0, m] for x, t, m in WAYS["table"]["over_span_and_time"]]
    for kind in ("dead", "follower"):
        given = {"over_span_and_time": rows, "kind": kind}
        found[kind] = rotfem.run(scene(given, theory, SPATIAL, time=time, **moved)).history
    size = np.max(np.abs(wanted["tip_u2"]))
    assert size > 1e-3
    for name, history in found.items():
        assert np.max(np.abs(history["tip_u2"] - wanted["tip_u2"])) < 1e-7 * size, name
        assert np.max(np.abs(history["root_m3"] - wanted["root_m3"])) < 1e-7 * np.max(np.abs(wanted["root_m3"])), name


def test_a_free_hub_is_turned_by_it() -> None:
    """Angular momentum: ψ = mLt²/2(I + ρL³/3) of a beam that is as good as rigid, here 1e6 times as stiff."""
    m, inertia = 0.5, 20.0
    section = {**PLANAR["section"], "EI": 1e10, "EA": 1e13, "GA": 1e13, "rotary_inertia": 0.0}
    motion = {"type": "torque", "hub_inertia": inertia}
    rigid = scene(m, "reissner", {**PLANAR, "section": section}, motion=motion, time={"end": 1.0, "step": 0.05})
    angle = rotfem.run(rigid).history["psi"]
    assert angle[-1] == pytest.approx(m * L / (inertia + RHO * L**3 / 3) / 2, rel=1e-6)


@pytest.mark.parametrize(
    ("structure", "moment", "words"),
    [
        (PLANAR, [0.0, 0.0, 1.0], "one component"),
        (SPATIAL, {"over_span": [[0.0, 1.0], [L, 2.0]]}, "three components"),
        (PLANAR, {"over_span": [[0.0, 1.0, 2.0], [L, 2.0, 1.0]]}, "row 1 has 3 entries"),
        ({"type": "plate", "length": 1, "width": 1, "thickness": 0.01, "E": 1e9, "nu": 0.3, "rho": 1e3}, 1.0, "plate"),
    ],
)
def test_refused(structure: Any, moment: Any, words: str) -> None:
    tables = scene(moment, structure=structure)
    del tables["mesh"]
    with pytest.raises(SceneError, match=words) as caught:
        rotfem.Scene.from_dict(tables)
    assert caught.value.key.startswith("loads.distributed_moment")
