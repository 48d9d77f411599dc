"""The spatial beam: spinning blades, torsion, large static deflection, the planar beam as a special case, tangents."""

from __future__ import annotations

import copy
import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import Scene, modes, run
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.sensitivity import sensitivities
from rotfem.commands.problem import Problem
from rotfem.equations.system import System
from rotfem.registry import effects
from tests.beams import STRUCTURE

Array = npt.NDArray[np.float64]

AT_REST = {"type": "constant", "speed": 0.0}
U, THETA = ("tip_u1", "tip_u2", "tip_u3"), ("tip_theta1", "tip_theta2", "tip_theta3")

#: Wright et al., J. Appl. Mech. 49 (1982) 197; Bir 2009: m = 100, EI = 1e8, L = 31.623, the square root of 1000
#: rounded. With 31.623 itself all frequencies are 1.4e-5 lower, which would show in the last printed digit.
BLADE: dict[str, Any] = {
    "structure": {
        "type": "spatial_beam",
        "length": float(np.sqrt(1000.0)),
        "section": {
            "EA": 1e14,
            "GA2": 1e14,
            "GA3": 1e14,
            "GJ": 1e5,
            "EI2": 1e8,
            "EI3": 1e9,
            "mass_per_length": 100.0,
            "rotary_inertia2": 1e-4,
            "rotary_inertia3": 1e-1,
        },
    },
    "motion": {"type": "constant", "speed": 3.0},
    "mesh": {"elements": 16, "degree": 3},
}

#: A moderately thick beam that couples all motions, about a skew axis.
TWISTED: dict[str, Any] = {
    "structure": {
        "type": "spatial_beam",
        "length": 1.0,
        "hub_offset": [0.2, 0.05, -0.1],
        "precone": 0.2,
        "pretwist": [[0.0, 0.5], [0.4, 0.1], [1.0, -0.3]],
        "section": {
            "EA": 400.0,
            "GA2": 130.0,
            "GA3": 110.0,
            "GJ": 1.0,
            "EI2": 1.0,
            "EI3": 2.0,
            "mass_per_length": 1.0,
            "rotary_inertia2": 0.0025,
            "rotary_inertia3": 0.005,
            "shear_center": [-0.02, 0.01],
            "tension_center": [0.01, -0.03],
        },
    },
    "motion": {"type": "constant", "speed": 2.0, "axis": [0.2, -0.3, 1.0], "base_acceleration": [0.4, 0.2, -0.3]},
    "loads": {"tip_force": [0.1, 0.2, -0.15], "distributed": [0.1, -0.2, 0.3]},
    "mesh": {"elements": 3, "degree": 2},
}

#: All effects but the stretch of fibers by twist, which other rods do not have (see test_trapeze.py).
RIGID_SECTIONS = {"effects": [effect.name for effect in effects if effect.name != "trapeze"]}

#: What makes of it a beam with everything: mass beside the axis, and a tip body. It takes long to compile.
REST = {
    "structure.section.mass_center": [0.03, 0.02],
    "structure.tip_mass": 0.2,
    "structure.tip_offset": [0.05, -0.02, 0.03],
    "structure.tip_inertia": [[0.02, 0.001, 0.0], [0.001, 0.03, 0.002], [0.0, 0.002, 0.04]],
}


def scene(tables: dict[str, Any], changes: dict[str, Any] | None = None, **tops: Any) -> Scene:
    return Scene.from_dict(copy.deepcopy(tables) | tops).replace(changes or {})


def final(s: Scene, names: tuple[str, ...] = U) -> Array:
    """Return tip components of a steady state."""
    h = run(s).history
    return np.array([h[name][-1] for name in names])


def frequencies(s: Scene, count: int = 12) -> list[tuple[str, float]]:
    """Return (label, frequency in rad/s) of the modes at the scene's speed."""
    return [(row["label"], row["frequency"]) for row in modes(s.replace({"modes.count": count})).rows]


def family(pairs: list[tuple[str, float]], name: str) -> Array:
    return np.array([f for label, f in pairs if label.split(" ", 1)[1] == name])


def dense(A: Any) -> Array:
    return np.asarray(A.convert("dense").getDenseArray()).copy()


# --- spinning blades ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
@pytest.mark.parametrize(
    ("tip_mass", "table"),
    [
        # Wright et al. 1982, tables 1 and 3, as compared in Bir, AIAA 2009-1035
        (0.0, {0.0: (3.516, 22.035, 61.697), 3.0: (4.797, 23.320, 62.985), 12.0: (13.170, 37.603, 79.615)}),
        (3162.3, {0.0: (1.557, 16.25), 3.0: (3.582, 20.35), 12.0: (12.48, 50.86)}),
    ],
    ids=["bare", "tip mass"],
)
def test_blade_table(theory: str, tip_mass: float, table: dict[float, tuple[float, ...]]) -> None:
    """Flap frequencies in units of (EI/mL⁴)^½ = 1 rad/s to the printed digits."""
    blade = scene(BLADE, {"model.theory": theory, "structure.tip_mass": tip_mass})
    analysis = ModalAnalysis(Problem.of(blade).spinning())
    for speed, printed in table.items():
        spinning = analysis.at(speed, 12)
        names = map(str, spinning.names)
        found = dict(zip(names, spinning.pairs.values.imag, strict=True))
        for n, value in enumerate(printed, start=1):
            digits = 3 if tip_mass == 0.0 or (n == 1 and value < 10) else 2
            name = ("1st", "2nd", "3rd")[n - 1] + " flapwise"
            assert abs(found[name] - value) < 0.6 * 10**-digits


def test_names_and_torsion_of_the_blade() -> None:
    """ω² = ω_T² + Ω² (J_3 − J_2)/(J_2 + J_3): here J_2 is a thousandth of J_3."""
    pairs = frequencies(scene(BLADE))
    assert [label for label, _ in pairs[:6]] == [
        "1st flapwise",
        "1st edgewise",
        "2nd flapwise",
        "1st torsion",
        "3rd flapwise",
        "2nd edgewise",
    ]
    J2, J3 = 1e-4, 1e-1
    torsion = (np.pi / 2) ** 2 * 1e5 / (1000.0 * (J2 + J3)) + 9.0 * (J3 - J2) / (J2 + J3)
    # Tension on the polar radius r, by Rayleigh's quotient: ∫ N r² φ'² / ∫ J φ², φ = sin πx/2L, N = ½mΩ²(L² − x²).
    torsion += 1.1e9 / 1e14 * 0.5 * 100.0 * 9.0 * (np.pi**2 / 6 + 0.5) / (J2 + J3)
    assert family(pairs, "torsion")[0] ** 2 == pytest.approx(torsion, rel=1e-6)


def reference_rows(path: Path, direction: str, geo: str) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["dir"] == direction and row["geo"] == geo]
    return [r for r in rows if r["delta"] == "0" and r["rotary_softening"] == ("1" if direction == "flap" else "0")]


@pytest.mark.parametrize(
    ("direction", "geo", "theory"),
    [
        ("flap", "svq", "consistent_linear"),
        ("flap", "exact", "reissner"),
        ("lag", "svq", "consistent_linear"),
    ],
)
def test_timoshenko_table(reference: Callable[[str], Path], direction: str, geo: str, theory: str) -> None:
    """timoshenko_rotating.csv (spectral): the beam turned so that it bends in the one or the other plane."""
    rows = reference_rows(reference("timoshenko_rotating.csv"), direction, geo)
    rows = [r for r in rows if r["coriolis"] == ("0" if direction == "flap" else "1")]
    assert rows
    r = 1 / float(rows[0]["1/r"])
    rows = [row for row in rows if float(row["1/r"]) == 1 / r]
    stiffness = {"EA": r**-2, "GA2": r**-2 / 3.059, "GA3": r**-2 / 3.059, "mass_per_length": 1.0}
    # The other plane is twice as stiff; torsion, which 2ΩJ couples to the slope of flap, is far away.
    section = stiffness | {"GJ": 1e6, "EI2": 1.0, "EI3": 2.0, "rotary_inertia2": r**2, "rotary_inertia3": 1e-5}
    if direction == "lag":
        section |= {"EI2": 2.0, "EI3": 1.0, "rotary_inertia2": 1e-5, "rotary_inertia3": r**2}
    tables = {"structure": {"type": "spatial_beam", "length": 1.0, "section": section}, "motion": AT_REST}
    blade = scene(tables, {"model.theory": theory, "mesh.elements": 24})
    analysis = ModalAnalysis(Problem.of(blade).spinning())
    for row in rows:
        spinning = analysis.at(float(row["eta"]), 14)
        found = spinning.pairs.values.imag
        for column in ("w1", "w2", "w3", "w4"):
            if row[column]:
                expected = float(row[column])
                assert np.min(np.abs(found / expected - 1)) < 1e-6, (row, column)


@pytest.mark.parametrize(("theory", "J2", "J3"), [("consistent_linear", 0.0, 1e-3), ("reissner", 1e-3, 2e-4)])
def test_torsion_of_a_rotating_bar(theory: str, J2: float, J3: float) -> None:
    """ω_n² = ((2n−1)π/2L)² GJ/(J_2+J_3) + Ω² (J_3−J_2)/(J_2+J_3), exact.

    T = ½∫ J_3 |ṫ_2 + w×t_2|² + J_2 |ṫ_3 + w×t_3|² with t_2 = (0, cos φ, sin φ), t_3 = (0, −sin φ, cos φ), w = Ω a_3
    is ½∫ (J_2+J_3) φ̇² + Ω² (J_3 cos²φ + J_2 sin²φ): the propeller moment −½Ω²(J_3−J_2) sin 2φ. With directors of
    first order t_2 = (0, 1, φ) only the share of J_2 would be there. Bending is made so stiff that its gyroscopic
    coupling with torsion, 2ΩJ_2, is not seen, and EA so large that tension has no polar radius to work on.
    """
    omega, GJ = 3.0, 0.02
    section = {"EA": 1e15, "GA2": 1e8, "GA3": 1e8, "GJ": GJ, "EI2": 1e5, "EI3": 1e5, "mass_per_length": 1.0}
    section |= {"rotary_inertia2": J2, "rotary_inertia3": J3}
    tables = {
        "structure": {"type": "spatial_beam", "length": 1.0, "section": section},
        "motion": {"type": "constant", "speed": omega},
        "mesh": {"elements": 8, "degree": 4},
    }
    found = family(frequencies(scene(tables, {"model.theory": theory}), 4), "torsion")[:3]
    n = np.arange(1, len(found) + 1)
    exact = ((n - 0.5) * np.pi) ** 2 * GJ / (J2 + J3) + omega**2 * (J3 - J2) / (J2 + J3)
    assert len(found) == 3
    np.testing.assert_allclose(found**2, exact, rtol=1e-6)


def test_spinning_cable() -> None:
    """EI → 0: flap ω_k = Ω √(k(2k−1)), Legendre polynomials; a layer of width (EI/mL⁴Ω²)^¼ at the clamp is left.

    The error goes with √EI, so two values extrapolate to the limit.
    """
    found = []
    for EI in (1e-6, 2.5e-7):
        section = {"EA": 1e6, "GA2": 1e6, "GA3": 1e6, "GJ": 1.0, "EI2": EI, "EI3": 100.0, "mass_per_length": 1.0}
        tables = {
            "structure": {"type": "spatial_beam", "length": 1.0, "section": section | {"rotary_inertia3": 1e-6}},
            "motion": {"type": "constant", "speed": 1.0},
            "mesh": {"elements": 60, "degree": 3},
            "model": {"theory": "consistent_linear"},
        }
        found.append(family(frequencies(scene(tables), 5), "flapwise")[:3])
    k = np.arange(1, 4)
    limit = np.sqrt(k * (2 * k - 1.0))
    np.testing.assert_allclose(found[1], limit, rtol=5e-3)
    np.testing.assert_allclose(2 * found[1] - found[0], limit, rtol=2e-4)


def test_frame_that_turns_about_the_beam() -> None:
    """A round beam at rest, seen from a frame that turns about its axis: ω becomes ω ± Ω, exact."""
    section = {"EA": 1e4, "GA2": 400.0, "GA3": 400.0, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0}
    tables = {
        "structure": {"type": "spatial_beam", "length": 1.0, "section": section | {"rotary_inertia2": 1e-3}},
        "model": {"theory": "reissner", "effects": ["coriolis", "centrifugal"]},
        "mesh": {"elements": 6, "degree": 3},
    }
    omega = 1.3
    still = frequencies(scene(tables, motion=AT_REST), 4)
    turning = frequencies(scene(tables, motion={"type": "constant", "speed": omega, "axis": [1, 0, 0]}), 4)
    expected = np.sort([f for _, base in still[:4:2] for f in (base - omega, base + omega)])
    np.testing.assert_allclose(np.sort([f for _, f in turning]), expected, rtol=1e-8)


# --- statics --------------------------------------------------------------------------------------------------------


def test_composite_cantilever() -> None:
    """Wang et al., Wind Energy 20 (2017) 1439: straight box beam, full 6×6 stiffness (in, lb), 150 lb across the tip.

    Digits of a converged spectral beam element (kynema documentation, "Static bending of a straight composite beam").
    """
    C = np.diag([1368.17e3, 88.56e3, 38.78e3, 16.96e3, 59.12e3, 141.47e3])
    for i, j, value in ((3, 4, 17.61e3), (3, 5, -0.351e3), (4, 5, -0.370e3)):
        C[i, j] = C[j, i] = value
    section = {"stiffness": C, "mass": np.diag([8.538e-2] * 3 + [1.4433e-2, 0.40972e-2, 1.0336e-2])}
    tables = {
        "structure": {"type": "spatial_beam", "length": 10.0, "section": section},
        "motion": AT_REST,
        "loads": {"tip_force": [0.0, 0.0, 150.0]},
    }
    expected = [-9.02726627566e-2, -6.47488486259e-2, 1.22973648292]
    np.testing.assert_allclose(final(scene(tables, model=RIGID_SECTIONS)), expected, rtol=0, atol=1e-10)


def test_twisted_cantilever() -> None:
    """Wang et al. 2017: 90° pretwist, 4 MN across the tip (m, N).

    Digits of a converged spectral beam element (kynema documentation, "Static bending of a twisted beam"); solid
    elements (ANSYS) give −1.134192, −1.714467, −3.58423.
    """
    C = np.diag([2.5e10, 8.2604167e9, 8.2604167e9, 1.41872656e8, 5.20833e8, 1.30208333e8])
    tables = {
        "structure": {
            "type": "spatial_beam",
            "length": 10.0,
            "pretwist": [[0.0, 0.0], [10.0, np.pi / 2]],
            "section": {"stiffness": C, "mass": np.eye(6)},
        },
        "motion": AT_REST,
        "loads": {"tip_force": [0.0, 0.0, -4.0e6]},
        "mesh": {"elements": 20, "degree": 3},
    }
    found = final(scene(tables, model=RIGID_SECTIONS))
    np.testing.assert_allclose(found, [-1.14152599954, -1.71805334646, -3.59321324027], rtol=0, atol=1e-7)
    np.testing.assert_allclose(found, [-1.134192, -1.714467, -3.58423], rtol=7e-3)


#: Aluminium strip of the Princeton beam experiment, Dowell & Traybar 1975; data as in Bauchau et al., Multibody Syst.
#: Dyn. 37 (2016) 29.
PRINCETON = {"E": 71.7e9, "nu": 0.31, "rho": 2700.0, "shape": "rectangle", "width": 12.377e-3, "height": 3.2024e-3}


def test_princeton_beam() -> None:
    """13.345 N across the tip at 45° to the strip's flat side: bending about both axes and torsion.

    Reference: own integration of the rod r' = R (e₁ + Γ), R' = R K̂, m' = −r'×F by DOP853 and shooting, to 1e-8.
    """
    force = 13.345 * np.sqrt(0.5) * np.array([0.0, 1.0, 1.0])
    tables = {
        "structure": {"type": "spatial_beam", "length": 0.508, "section": PRINCETON},
        "motion": AT_REST,
        "loads": {"tip_force": force},
        "mesh": {"elements": 10, "degree": 3},
    }
    tip = final(scene(tables), U + THETA)
    expected = [-0.03036117, 0.01534213, 0.15658771, -0.05447717, -0.47495008, 0.03585476]
    np.testing.assert_allclose(tip, expected, rtol=0, atol=5e-7)


def test_everything_against_an_own_rod() -> None:
    """Pretwist, precone, shear and tension centre, force and moment of fixed direction, 0.95 rad; rod as above."""
    loads = {"tip_force": [0.6, -1.6, 2.2], "tip_moment": [1.0, 0.8, -1.2]}
    tip = final(scene(TWISTED, {"mesh": {"elements": 20, "degree": 3}}, motion=AT_REST, loads=loads), U + THETA)
    expected = [-0.20027033925, -0.48024975370, 0.09825443553, 0.21875371847, 0.15171350779, -0.90928157545]
    np.testing.assert_allclose(tip, expected, rtol=0, atol=2e-8)


MOMENT_BEAM = {
    "structure": {
        "type": "spatial_beam",
        "length": 1.0,
        "section": {"EA": 1e4, "GA2": 4e3, "GA3": 4e3, "GJ": 1.0, "EI2": 1.0, "EI3": 1.0, "mass_per_length": 1.0},
    },
    "motion": AT_REST,
    "mesh": {"elements": 10, "degree": 3},
}


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_no_locking(degree: int) -> None:
    """Slender from r/L = 1e-2 to 1e-4: u = F (L³/3EI + L/GA) in both planes, and torsion M L/GJ; exact from P2 on."""
    n, F = 10, 1e-9  # a dead moment turns with respect to the section: a load stiffness of the size of F
    for r in (1e-2, 1e-3, 1e-4):
        section = {"EA": r**-2, "GA2": r**-2 / 3, "GA3": r**-2 / 2, "GJ": 0.8, "EI2": 1.0, "EI3": 4.0}
        tables = {
            "structure": {"type": "spatial_beam", "length": 1.0, "section": section | {"mass_per_length": 1.0}},
            "motion": AT_REST,
            "loads": {"tip_force": [0, F, F], "tip_moment": [F, 0, 0]},
            "mesh": {"elements": n, "degree": degree},
            "model": {"theory": "linear"},
        }
        _, lag, flap, torsion = final(scene(tables), (*U, "tip_theta1"))
        missing = 1 / (12 * n**2) if degree == 1 else 0.0
        tolerance = 1e-8 + 2e-16 * (n / r) ** 2
        assert lag / F == pytest.approx((1 / 3 - missing) / 4 + 3 * r**2, rel=tolerance)
        assert flap / F == pytest.approx(1 / 3 - missing + 2 * r**2, rel=tolerance)
        assert torsion / F == pytest.approx(1 / 0.8, rel=1e-9)


# --- the planar beam as a special case ------------------------------------------------------------------------------


def as_spatial(tables: dict[str, Any]) -> dict[str, Any]:
    """Return a planar scene as a spatial one; what the plane does not know is given other values."""
    out, s = copy.deepcopy(tables), tables["structure"]["section"]
    out["structure"]["type"] = "spatial_beam"
    out["structure"]["section"] = {
        "EA": s["EA"],
        "GA2": s["GA"],
        "GA3": 2 * s["GA"],
        "GJ": 0.7 * s["EI"],
        "EI2": 3 * s["EI"],
        "EI3": s["EI"],
        "mass_per_length": s["mass_per_length"],
        "rotary_inertia2": 0.5 * s["rotary_inertia"],
        "rotary_inertia3": s["rotary_inertia"],
    }
    if "tip_moment" in out.get("loads", {}):
        out["loads"]["tip_moment"] = [0.0, 0.0, out["loads"]["tip_moment"]]
    return out


PLANAR: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 10.0,
        "hub_radius": 0.3,
        "tip_mass": 0.2,
        "tip_inertia": 0.01,
        "section": STRUCTURE["section"],
    },
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 4.0, "base_acceleration": [0.3, 0.2]},
    "loads": {"gravity": [1.0, -2.0], "tip_force": {"value": [0.2, 2.0], "kind": "follower"}, "tip_moment": 5.0},
    "mesh": {"elements": 4, "degree": 3},
    "time": {"end": 2.5, "step": 0.02},
}


@pytest.mark.parametrize(
    ("theory", "prestress"),
    [
        ("reissner", None),
        ("consistent_linear", "all"),
    ],
)
def test_planar_history_as_spatial(theory: str, prestress: str | None) -> None:
    """The same forces and tangents in exact arithmetic: histories differ by round-off. 1e-8 is asked for."""
    tables = PLANAR | {"model": {"theory": theory} | ({"prestress": prestress} if prestress else {})}
    planar, spatial = (run(scene(t)).history for t in (tables, as_spatial(tables)))
    assert np.max(np.abs(planar["tip_u2"])) > 1.0
    pairs = {"tip_u1": "tip_u1", "tip_u2": "tip_u2", "tip_alpha": "tip_theta3", "strain": "strain"}
    for a, b in pairs.items():
        np.testing.assert_allclose(spatial[b], planar[a], rtol=0, atol=1e-8 * np.max(np.abs(planar[a])))
    for name in ("tip_u3", "tip_theta1", "tip_theta2"):
        assert np.max(np.abs(spatial[name])) < 1e-12


# --- descriptions that must not matter ------------------------------------------------------------------------------


def test_precone_is_a_tilted_axis() -> None:
    """Coning by β is the same as tilting the spin axis, hub, loads and base motion by −β: all vectors turn, no more."""
    beta, motion = 0.3, {"type": "spin_up", "speed": 2.0, "duration": 1.0}
    c, b = np.cos(beta), np.sin(beta)
    P = np.array([[c, 0, -b], [0, 1, 0], [b, 0, c]])
    vectors = {
        "structure.hub_offset": np.array([0.2, 0.05, -0.1]),
        "motion.axis": np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0]),
        "motion.base_acceleration": np.array([0.4, 0.2, -0.3]),
        "loads.gravity": np.array([0.2, 0.3, -0.5]),
        "loads.tip_force": np.array([0.1, 0.2, -0.15]),
        "loads.tip_moment": np.array([0.02, 0.01, 0.03]),
    }
    time = {"end": 0.5, "step": 0.01}
    base = scene(TWISTED, {"model.theory": "consistent_linear"}, motion=motion, loads={}, time=time)
    plain = run(base.replace({"structure.precone": 0.0} | vectors)).history
    coned = run(base.replace({"structure.precone": beta} | {key: P @ v for key, v in vectors.items()})).history
    for names in (U, THETA):
        one, other = (np.array([h[name] for name in names]) for h in (plain, coned))
        assert np.max(np.abs(one)) > 1e-2
        np.testing.assert_allclose(other, P @ one, rtol=0, atol=1e-8 * np.max(np.abs(one)))
    np.testing.assert_allclose(coned["kinetic"], plain["kinetic"], rtol=1e-8)


# --- conservation, symmetry, tangents -------------------------------------------------------------------------------


#: Every effect, load and kind of damping; at t = 0 weight is the only load, and it keeps its direction.
EVERYTHING = {
    "motion": {
        "type": "spin_up",
        "speed": 2.0,
        "duration": 2.0,
        "axis": [0.2, -0.3, 1],
        "base_acceleration": [1, 2, 3],
    },
    "loads": {
        "gravity": [2.0, -3.0, 1.0],
        "tip_force": {"over_time": [[0.0, 0, 0, 0], [0.5, -0.4, 0.5, 0.3]], "kind": "follower"},
        "tip_moment": {"over_time": [[0.0, 0, 0, 0], [0.5, 0.3, -0.2, 0.4]]},
        "distributed": {"over_time": [[0.0, 0, 0, 0], [0.5, 0.2, 0.3, -0.1]], "kind": "follower"},
    },
}


DAMPED = {"structure.damping": {"kelvin_voigt": 0.01, "rayleigh": [0.3, 0.02]}}

#: Kind of beam ↦ theory and what it has beside every effect and load.
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "consistent_linear": ("consistent_linear", DAMPED | REST),
    "reissner": ("reissner", {"structure.damping": {"rayleigh": [0.3, 0.0]}}),
}


@pytest.fixture(scope="module")
def everything() -> Callable[[str], System]:
    """Return kind ↦ the beam with everything, with all effects on; compiled once, which takes most of the time."""
    systems: dict[str, System] = {}

    def of(kind: str) -> System:
        if kind not in systems:
            theory, more = KINDS[kind]
            systems[kind] = Problem.of(scene(TWISTED, {"model.theory": theory} | more, **EVERYTHING)).system()
        systems[kind].leave_out(())
        return systems[kind]

    return of


def balanced(system: System, speed: float) -> Array:
    """Return the equilibrium at a speed and the loads of t = 0, by Newton's method, for which nothing is compiled."""
    q = system.zeros()
    system.set_time(0.0, system.motion.at_speed(speed))
    for _ in range(50):
        system.set_state(q)
        change = np.linalg.solve(dense(system.matrix(1.0, 0.0, 0.0, 1.0)), system.residual().array)
        q += change * min(1.0, 0.1 / np.max(np.abs(change)))  # not beyond what is small for strains
        if np.max(np.abs(change)) < 1e-12:
            system.set_state(q)
            return q
    raise AssertionError("no equilibrium")


@pytest.mark.parametrize("kind", KINDS)
def test_symmetries_about_a_deformed_steady_state(everything: Callable[[str], System], kind: str) -> None:
    """Without damping and with dead loads alone, those of t = 0; about a skew axis."""
    system = everything(kind)
    system.leave_out(("damping", "euler"))
    q = balanced(system, 2.0)
    assert np.max(np.abs(q)) > 0.05
    free = np.setdiff1d(np.arange(system.scale.size), system.clamped)
    M, C, K = (dense(A)[np.ix_(free, free)] for A in system.mass_damping_stiffness())
    for A, sign in ((M, 1), (C, -1), (K, 1)):
        assert np.max(np.abs(A - sign * A.T)) < 1e-13 * np.max(np.abs(A))
    assert np.max(np.abs(C)) > 1e-3
    assert np.linalg.eigvalsh(M).min() > 0


@pytest.mark.parametrize("kind", KINDS)
def test_tangents_are_the_derivatives_of_the_residual(everything: Callable[[str], System], kind: str) -> None:
    """Central differences with steps of 1e-5; every effect, load and kind of damping on."""
    system = everything(kind)
    system.set_time(0.7)
    state = [smooth_state(system, size, seed) for seed, size in enumerate((0.3, 0.3, 1.0))]
    free = np.setdiff1d(np.arange(system.scale.size), system.clamped)
    direction, eps = smooth_state(system, 1.0, 9), 1e-5

    def force(which: int, step: float) -> Array:
        system.set_state(*(x + step * direction * (i == which) for i, x in enumerate(state)))
        return -np.array(system.residual().array)

    for which, shift in enumerate(((1, 0, 0), (0, 1, 0), (0, 0, 1))):
        difference = (force(which, eps) - force(which, -eps)) / (2 * eps)
        system.set_state(*state)
        product = (dense(system.matrix(*shift, 1.0)) @ direction)[free]
        assert np.max(np.abs(product - difference[free])) < 1e-6 * np.max(np.abs(product))


def smooth_state(system: System, size: float, seed: int) -> Array:
    """Return a field of the given size that is zero at the clamp: a sum of three sines with random amplitudes."""
    X = system.V.tabulate_dof_coordinates()[:, 0] / system.structure.length
    c = np.random.default_rng(seed).normal(size=(6, 3))
    return size * np.column_stack([sum(a * np.sin((j + 0.5) * X) for j, a in enumerate(row)) for row in c]).ravel()


def test_large_rotations_have_exact_tangents() -> None:
    """From the series to the closed forms, |θ| up to 5 rad, and through θ = 0: forces against differences of energy."""
    system = Problem.of(scene(MOMENT_BEAM)).system()
    system.set_time(0.0)
    direction, zero = smooth_state(system, 1.0, 9), np.zeros(system.scale.size)
    free = np.setdiff1d(np.arange(system.scale.size), system.clamped)
    for size in (0.0, 0.1, 1.0, 3.0):
        q = smooth_state(system, size, 3)

        def energy(step: float, q: Array = q) -> float:
            system.set_state(q + step * direction, zero, zero)
            return system.energies()["strain"]

        slope = (8 * (energy(1e-4) - energy(-1e-4)) - (energy(2e-4) - energy(-2e-4))) / 12e-4
        system.set_state(q, zero, zero)
        work = float(-system.residual().array[free] @ direction[free])
        assert work == pytest.approx(slope, rel=1e-7, abs=1e-7)


@pytest.mark.slow
def test_sensitivities() -> None:
    """dω/dp of the first two modes against central differences, for one parameter of every kind."""
    changes = {"structure.pretwist": 0.3, "structure.tip_mass": 0.2, "model.theory": "consistent_linear"}
    s = scene(TWISTED, changes | {"mesh.elements": 6}, loads={}, motion={"type": "constant", "speed": 2.0})
    analysis = ModalAnalysis(Problem.of(s))
    spinning = analysis.at(2.0, 2)
    rows = [r for r in sensitivities(analysis, spinning) if r["mode"] <= 2]
    keys = {"GJ": "structure.section.GJ", "rotary_inertia3": "structure.section.rotary_inertia3"}
    keys |= {"precone": "structure.precone", "pretwist": "structure.pretwist", "tip_mass": "structure.tip_mass"}
    for name, key in keys.items():
        value = next(r["value"] for r in rows if r["parameter"] == name)
        near = (s.replace({key: value * (1 + h)}) for h in (1e-4, -1e-4))
        plus, minus = (np.array([f for _, f in frequencies(n, 2)]) for n in near)
        found = [r["dfrequency"] for r in rows if r["parameter"] == name]
        np.testing.assert_allclose(found, (plus - minus) / (2e-4 * value), rtol=1e-4, atol=1e-6)


def test_shapes_are_scaled_by_translations_and_torsion_by_its_rotation() -> None:
    """Bending: max |u| = 1, its slope times L 1.38 (Euler–Bernoulli). Torsion: θ₁ L = sin(πx/2L), u = 0."""
    tables = {**BLADE, "motion": AT_REST, "model": {"theory": "consistent_linear"}, "modes": {"count": 6}}
    result = modes(tables)
    shapes = dict(zip(result.labels, result.shapes.values(), strict=True))
    length = result.summary["shapes"]["length"]
    assert length == BLADE["structure"]["length"]
    assert np.max(np.abs(shapes["1st flapwise"]["u3"])) == pytest.approx(1.0)
    assert np.max(np.abs(shapes["1st flapwise"]["theta2"])) == pytest.approx(1.3765, rel=1e-4)
    torsion = shapes["1st torsion"]
    np.testing.assert_allclose(np.abs(torsion["theta1"]), np.sin(np.pi / 2 * torsion["x"] / length), atol=1e-5)
    assert max(np.max(np.abs(torsion[name])) for name in ("u1", "u2", "u3")) < 1e-5
