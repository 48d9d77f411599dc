"""Modes of the planar beam: reference frequencies, theorems on spectrum and left vectors, instabilities, self-checks.

The reference values are of spectral codes that share nothing with the finite elements (see tests/reference).
"""

from __future__ import annotations

import csv
import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import brentq, minimize_scalar, newton

from rotfem import ComputationError, InputError, Scene, SceneError, campbell, modes
from rotfem.analysis.modal import ModalAnalysis
from rotfem.analysis.stability import critical_speed
from rotfem.analysis.state_space import state_space, write_matrices
from rotfem.commands.problem import Problem
from rotfem.numerics import eigenproblem as pencil
from rotfem.numerics.linear import negative_eigenvalues, transposed
from rotfem.results.modes import ModesResult

pytestmark = pytest.mark.usefixtures("unestimated")

Array = npt.NDArray[Any]

#: Name of the linearisation in the reference values, and here.
GEO = {"svq": "consistent_linear", "vk": "von_karman_linear", "exact": "reissner", "exactvk": "von_karman"}

#: 16 elements of degree 3, as by default: 145 unknowns without the clamp's.
MESH = {"elements": 16, "degree": 3}


def section(r: float, **more: float) -> dict[str, float]:
    """Return the section of the unit beam with radius of gyration r, as in the reference values."""
    return {"EA": r**-2, "GA": r**-2 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": r**2} | more


def frequencies(result: ModesResult) -> Array:
    return np.array([row["frequency"] for row in result.rows])


def table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# --- A to D: frequencies ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delta", ["0", "1"])
@pytest.mark.parametrize("theory", ["consistent_linear", "von_karman_linear", "reissner"])
def test_euler_bernoulli_limit(unit_beam: Any, reference: Callable[[str], Path], theory: str, delta: str) -> None:
    """r/L = 1e-4: the first three lag frequencies of the beam without shear, extension and rotary inertia."""
    changes = {"structure.section": section(1e-4), "structure.hub_radius": float(delta), "model.theory": theory}
    analysis = ModalAnalysis(Problem.of(unit_beam(changes, mesh=MESH)).spinning())
    spinning, worst = None, 0.0
    for row in (r for r in table(reference("euler_bernoulli_rotating.csv")) if r["delta"] == delta):
        spinning = analysis.at(float(row["eta"]), 3, spinning)
        expected = np.array([float(row[f"lag{i}"]) for i in range(1, 4)])
        worst = max(worst, float(np.max(np.abs(spinning.pairs.values.imag[:3] / expected - 1))))
        assert [*map(str, spinning.names[:3])] == ["1st edgewise", "2nd edgewise", "3rd edgewise"]
    print(f"A {theory} delta={delta}: {worst:.1e}")
    assert worst < 1e-5


@pytest.mark.parametrize("coriolis", [True, False])
@pytest.mark.parametrize("geo", list(GEO))
def test_timoshenko_beam(unit_beam: Any, reference: Callable[[str], Path], geo: str, coriolis: bool) -> None:
    """r/L = 1/30, eta = 0 … 12: lag and axial modes, four of them."""
    effects = ["coriolis"] * coriolis + ["centrifugal", "rotary_inertia"]
    changes = {"structure.section": section(1 / 30), "model.theory": GEO[geo], "model.effects": effects}
    analysis = ModalAnalysis(Problem.of(unit_beam(changes, mesh=MESH)).spinning())
    rows = table(reference("timoshenko_rotating.csv"))
    rows = [r for r in rows if r["dir"] == "lag" and r["geo"] == geo and r["coriolis"] == str(int(coriolis))]
    assert len(rows) == 4
    worst = 0.0
    for row in rows:
        spinning = analysis.at(float(row["eta"]), 4)
        expected = np.array([float(row[f"w{i}"]) for i in range(1, 5)])
        worst = max(worst, float(np.max(np.abs(spinning.pairs.values.imag[:4] / expected - 1))))
    print(f"B {GEO[geo]} coriolis={coriolis}: {worst:.1e}")
    assert worst < 1e-6


@pytest.mark.parametrize("theory", ["consistent_linear", "von_karman_linear", "second_order", "von_karman", "reissner"])
def test_thick_beam(unit_beam: Any, reference: Callable[[str], Path], theory: str) -> None:
    """r/L = 1/10; at eta = 8 the steady strain at the clamp is 0.4, with a hub 1.3."""
    worst = 0.0
    for row in (r for r in table(reference("timoshenko_thick.csv")) if r["theory"] == theory):
        radius, speed = float(row["delta"]), float(row["eta"])
        changes = {"structure.section": section(0.1), "structure.hub_radius": radius, "motion.speed": speed}
        found = frequencies(modes(unit_beam(changes | {"model.theory": theory}, mesh=MESH, modes={"count": 4})))
        worst = max(worst, float(np.max(np.abs(found / [float(row[f"w{i}"]) for i in range(1, 5)] - 1))))
    print(f"B 1/r=10 {theory}: {worst:.1e}")
    assert 0.0 < worst < 1e-6


ICCIA_ROWS = {
    "Timoshenko zero-order, gyro": ("linear", True),
    "Timoshenko one-order vk (KRB), gyro": ("von_karman_linear", True),
    "Timoshenko one-order svq, gyro": ("consistent_linear", True),
    "Timoshenko exact Reissner linearisation, gyro": ("reissner", True),
    "Timoshenko exact Reissner linearisation, no gyro": ("reissner", False),
}


@pytest.mark.parametrize("name", list(ICCIA_ROWS))
def test_iccia_beam(hub_beam: Any, reference: Callable[[str], Path], name: str) -> None:
    """Its frequencies at R = 0, 1 and Ω = 0, 2, 4."""
    theory, coriolis = ICCIA_ROWS[name]
    effects, worst = ["coriolis"] * coriolis + ["centrifugal", "rotary_inertia"], 0.0
    for row in (r for r in table(reference("iccia_frequencies.csv")) if r["model"] == name):
        changes = {"structure.hub_radius": float(row["R"]), "model.theory": theory, "model.effects": effects}
        motion = {"type": "constant", "speed": float(row["Omega"])}
        found = modes(hub_beam(changes, mesh={"elements": 24, "degree": 3}, motion=motion)).eigenvalues
        cells = [row["w1 rad/s"], row["w2"], row["w3"], row["w4"]]
        expected = np.array([float(c[len("div(growth ") : -1]) if "div" in c else 1j * float(c) for c in cells])
        worst = max(worst, float(np.max([np.abs(found - e).min() / abs(e) for e in expected])))
    print(f"C {name}: {worst:.1e}")
    assert worst < 1e-6


def test_critical_speed_of_the_linear_theory(unit_beam: Any, hub_beam: Any, spin_up: Any) -> None:
    """Its stiffness is singular where the speed meets the first frequency at rest without rotary inertia.

    3.5160152685 is the first frequency of the Euler–Bernoulli cantilever, x² with 1 + cos x cosh x = 0; the shear of
    r/L = 1e-4 takes 7e-8 of it.
    """
    slender = {"structure.section": section(1e-4), "model.theory": "linear"}
    cases = [(unit_beam(slender, mesh={"elements": 6, "degree": 4}), 3.5160152685002)]
    for make in (unit_beam, hub_beam, spin_up):
        scene: Scene = make({"model.theory": "linear", "motion": {"type": "constant", "speed": 0.0}})
        cases.append((scene, modes(scene.replace({"model.effects": []})).rows[0]["frequency"]))
    for scene, expected in cases:
        static = critical_speed(ModalAnalysis(Problem.of(scene).spinning()).system)
        result = campbell(scene, [0.5 * expected, 0.9 * expected, 1.1 * expected], orders=1)
        (onset,) = result.summary["instabilities"]
        print(f"D expected {expected:.9f}, singular at {static:.9f}, unstable from {onset['speed']:.9f}")
        assert static == pytest.approx(expected, rel=1e-6)
        assert onset["kind"] == "static instability"
        assert onset["speed"] == pytest.approx(expected, rel=1e-6)
        assert any(text.startswith("static instability from") for text in result.summary["warnings"])


def test_critical_speed_far_above_what_stiffens(spin_up: Any) -> None:
    """A beam in tension loses it where N⁰ = ½ m Ω² L² meets GA_s, far above 4 rad/s, where spin doubles bending."""
    section = {"structure.section.EA": 1e11, "structure.section.GA": 3e10}
    scene = spin_up({**section, "model.theory": "consistent_linear", "mesh.elements": 60})
    found = critical_speed(ModalAnalysis(Problem.of(scene).spinning()).system)
    assert found == pytest.approx(np.sqrt(2 * 3e10 / 1.2) / 10.0, rel=1e-4)


def test_what_a_hinge_leaves_free_has_no_critical_speed(hub_beam: Any) -> None:
    """Of the turn about it round-off makes the stiffness at rest; spin holds it, and bending alone becomes soft."""
    hinged = {"structure.hub_radius": 0.5, "structure.root": {"lag_stiffness": 0.0}}
    scene = hub_beam({**hinged, "model.theory": "consistent_linear", "mesh.elements": 4})
    system = ModalAnalysis(Problem.of(scene).spinning()).system
    found = critical_speed(system)
    assert found is not None
    for speed, negative in ((1e-3 * found, 0), (0.99 * found, 0), (1.01 * found, 1)):
        K_1, K_2 = system.stiffness_pieces()
        K_1.axpy(speed**2, K_2)
        assert negative_eigenvalues(K_1) == negative


def test_growth_beyond_the_critical_speed(hub_beam: Any) -> None:
    beyond = modes(hub_beam({"model.theory": "linear", "motion": {"type": "constant", "speed": 4.0}}))
    assert beyond.rows[0]["stability"] == "static instability"
    assert beyond.rows[0]["growth"] == pytest.approx(2.743576669, rel=1e-6)  # iccia_frequencies.csv
    assert any("static instability: 1st edgewise grows" in text for text in beyond.summary["warnings"])


# --- theorems --------------------------------------------------------------------------------------------------------


def test_kelvin_voigt_damping_ratio(unit_beam: Any) -> None:
    """At rest C = η K, so every mode has |λ| = ω and ζ = η ω/2, exact."""
    eta = 2e-3
    free = modes(unit_beam({"model.theory": "reissner"}))
    damped = modes(unit_beam({"model.theory": "reissner", "structure.damping": {"kelvin_voigt": eta}}))
    omega = frequencies(free)
    np.testing.assert_allclose([row["damping"] for row in damped.rows], eta * omega / 2, rtol=1e-8)
    np.testing.assert_allclose([-row["growth"] for row in damped.rows], eta * omega**2 / 2, rtol=1e-8)
    np.testing.assert_allclose(frequencies(damped), omega * np.sqrt(1 - (eta * omega / 2) ** 2), rtol=1e-8)
    assert all(row["stability"] == "stable" for row in damped.rows)
    assert all(abs(row["damping"]) < 1e-10 for row in free.rows)


def beck(P: float, square: complex) -> complex:
    """Return the characteristic function of Beck's column (EI = A_rho = L = 1) at omega² = square.

    Clamped at 0, follower compression P at 1; Beck, Z. angew. Math. Phys. 3 (1952) 225.
    """
    root = np.sqrt(P**2 / 4 + square + 0j)
    a, b = np.sqrt(root - P / 2), np.sqrt(root + P / 2)
    w = np.sqrt(square + 0j)
    return complex(P**2 + 2 * square + 2 * square * np.cosh(a) * np.cos(b) + P * w * np.sinh(a) * np.sin(b))


def test_follower_force_flutters(unit_beam: Any) -> None:
    """Beck's column, non-conservative: two modes coalesce at P = 20.0509 EI/L² and one of them grows beyond."""

    def least(P: float) -> float:
        return float(minimize_scalar(lambda s: beck(P, s).real, bounds=(60.0, 200.0), method="bounded").fun)

    P_c = float(brentq(least, 15.0, 22.0))  # the characteristic function has a double root in omega
    assert P_c == pytest.approx(20.05, abs=5e-3)  # Beck 1952; Bolotin 1963 in four digits

    def column(theory: str, P: float) -> ModesResult:
        load = {"tip_force": {"value": [-P, 0.0], "kind": "follower"}}
        changes = {"structure.section": section(1e-3), "model.theory": theory}
        return modes(unit_beam(changes, loads=load, mesh={"elements": 8, "degree": 3}))

    for theory in ("consistent_linear", "reissner"):
        below, above = column(theory, 0.9995 * P_c), column(theory, 1.0005 * P_c)
        assert all(row["stability"] == "stable" for row in below.rows)
        assert [row["stability"] for row in above.rows].count("dynamic instability") == 1
        assert any(text.startswith("dynamic instability") for text in above.summary["warnings"])
        assert above.summary["checks"]["asymmetry_K"] > 1e-8
        # Frequency and growth of the flutter from the complex root of the characteristic function.
        result = column(theory, 24.0)
        square = complex(newton(lambda s: beck(24.0, s), 120 + 40j, tol=1e-13))
        omega = np.sqrt(square)
        (row,) = [row for row in result.rows if row["stability"] == "dynamic instability"]
        print(f"flutter {theory}: {row['frequency']:.6f} {row['growth']:.6f}, exact {omega}, P_c {P_c:.6f}")
        assert row["frequency"] == pytest.approx(omega.real, rel=1e-4)
        assert row["growth"] == pytest.approx(abs(omega.imag), rel=1e-3)


def test_dead_compression_buckles(unit_beam: Any) -> None:
    """A dead force is conservative: static instability from Euler's pi²/4 EI/L² on."""

    def column(P: float) -> ModesResult:
        return modes(unit_beam({"structure.section": section(1e-3)}, loads={"tip_force": [-P, 0.0]}))

    euler = np.pi**2 / 4
    assert column(0.9999 * euler).rows[0]["stability"] == "stable"
    assert column(1.0001 * euler).rows[0]["stability"] == "static instability"


NONCONSERVATIVE = {
    "structure.hub_radius": 0.5,
    "structure.damping": {"kelvin_voigt": 1e-3},
    "loads": {"tip_force": {"value": [-1.0, 0.3], "kind": "follower"}},
    "motion.speed": 4.0,
}


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
@pytest.mark.parametrize("conservative", [True, False])
def test_left_vectors(unit_beam: Any, theory: str, conservative: bool) -> None:
    """y^H (λ² M + λ C + K) = 0, and y_i^H [(λ_i + λ_j) M + C] x_j = 0 for i ≠ j."""
    changes = {"motion.speed": 4.0} if conservative else NONCONSERVATIVE
    result = modes(unit_beam(changes | {"model.theory": theory}))
    p, pairs = result.spinning.pencil, result.spinning.pairs
    assert p.conservative is conservative
    transposes = [transposed(A) for A in (p.M, p.C, p.K)]
    for j, lam in enumerate(pairs.values):
        for operators, x, z in (((p.M, p.C, p.K), pairs.right, lam), (transposes, pairs.left, lam.conjugate())):
            terms = [c * p.apply(A, x[:, [j]]) for c, A in zip((z**2, z, 1.0), operators, strict=True)]
            assert np.linalg.norm(sum(terms)) < 1e-9 * np.linalg.norm(terms[0])
    gram = p.gram(pairs.left, pairs.values, pairs.right, pairs.values)
    size = np.sqrt(np.outer(np.abs(np.diag(gram)), np.abs(np.diag(gram))))
    np.testing.assert_allclose(np.abs(gram) / size, np.eye(len(size)), atol=1e-7)


def test_rows_and_names(unit_beam: Any) -> None:
    """A beam at rest: edgewise with 0, 1, 2, … nodes, 1st axial at (pi/2) √(EA/A_rho) with all its energy in u1."""
    result = modes(unit_beam({"structure.section": section(1 / 30)}, modes={"count": 5}))
    assert result.labels == ["1st edgewise", "2nd edgewise", "1st axial", "3rd edgewise", "4th edgewise"]
    axial = result.rows[2]
    assert axial["frequency"] == pytest.approx(np.pi / 2 * 30, rel=1e-8)
    assert axial["frequency_hz"] == pytest.approx(7.5, rel=1e-8)
    assert axial["share_axial"] == pytest.approx(1.0, abs=1e-12)
    for row, (title, shape) in zip(result.rows, result.shapes.items(), strict=True):
        assert row["label"] in title
        assert row["share_axial"] + row["share_lag"] == pytest.approx(1.0, abs=1e-12)
        assert row["residual"] < 1e-12
        assert np.max(np.hypot(shape["u1"], shape["u2"])) == pytest.approx(1.0)
        assert max(np.max(np.abs(shape[f"{c}_imag"])) for c in ("u1", "u2", "alpha")) < 1e-9
        assert shape["x"][0] == 0.0
        assert abs(shape["u2"][0]) < 1e-12
    sine = result.shapes["mode 3: 1st axial"]
    np.testing.assert_allclose(sine["u1"], np.sin(np.pi / 2 * sine["x"]), atol=1e-6)


def test_mixed_mode_says_so(unit_beam: Any) -> None:
    """Where 2nd edgewise and 1st axial veer, both share the energy, and the name holds both families."""
    scene = unit_beam({"structure.section": section(1 / 20), "structure.hub_radius": 1.0, "motion.speed": 9.0})
    mixed = [row for row in modes(scene).rows if "–" in row["label"]]
    assert len(mixed) >= 2
    for row in mixed:
        assert set(row["label"].split(" ")[1].split("–")) == {"edgewise", "axial"}
        assert max(row["share_axial"], row["share_lag"]) < 0.8


def test_about_the_undeformed_state(unit_beam: Any) -> None:
    """Without the steady stretch there is no stiffening: the exact theory about X = 0 is the linear one."""
    changes = {"structure.section": section(1 / 30), "motion.speed": 3.0, "model.theory": "reissner"}
    undeformed = modes(unit_beam(changes, modes={"about": "undeformed"}))
    linear = modes(unit_beam(changes | {"model.theory": "linear"}))
    steady = modes(unit_beam(changes))
    np.testing.assert_allclose(frequencies(undeformed), frequencies(linear), rtol=1e-9)
    assert undeformed.rows[0]["frequency"] < 0.6 * steady.rows[0]["frequency"]
    assert undeformed.summary["about"] == "undeformed"
    assert steady.summary["about"] == "steady"


def test_speed_of_the_modes(hub_beam: Any) -> None:
    """A spin-up means its final speed, with or without [time]; the inertial frame is a way to compute, not a scene."""
    first = [
        modes(hub_beam({"motion.speed": 2.0, "model.theory": "reissner"} | changes)).rows[0]["frequency"]
        for changes in ({}, {"model.frame": "inertial"}, {"motion": {"type": "constant", "speed": 2.0}})
    ]
    np.testing.assert_allclose(first, 3.03628366179, rtol=1e-6)  # iccia_frequencies.csv


def test_free_hub(unit_beam: Any, tmp_path: Path) -> None:
    """Its rigid-body mode is the first row and has no shape; what is not there for a free hub is refused."""
    torque = {"type": "torque", "hub_inertia": 1.0, "pulses": [[0.0, 0.1, 1.0]]}
    result = modes(unit_beam(motion=torque, modes={"count": 3}))
    assert [row["mode"] for row in result.rows] == [1, 2, 3]
    assert [row["label"] for row in result.rows] == ["rigid body", "1st in-plane", "2nd in-plane"]
    assert list(result.shapes) == ["mode 2: 1st in-plane", "mode 3: 2nd in-plane"]
    assert result.draw(tmp_path)[0].is_file()
    alone = modes(unit_beam(motion=torque, modes={"count": 1}))
    assert list(alone.rows[0]) == list(result.rows[0])
    assert alone.frequencies.tolist() == [0.0]
    with pytest.raises(SceneError, match="free hub"):
        modes(unit_beam(motion=torque), sensitivities=True)
    for refused in (
        lambda: write_matrices(result.analysis, result.spinning, tmp_path),
        lambda: state_space(result.analysis, result.spinning, 2),
    ):
        with pytest.raises(InputError, match="free hub"):
            refused()


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_modes_do_not_depend_on_the_units(size: float) -> None:
    """The same beam from half a millimetre to 5 km: ω scales with 1/L. Reference: the frequencies at 5 m."""
    section = {"E": 1.6e11, "nu": 0.25, "rho": 2330.0, "shape": "rectangle", "width": 0.1 * size, "height": 0.04 * size}
    tables = {
        "structure": {"type": "planar_beam", "length": 5.0 * size, "hub_radius": size, "section": section},
        "motion": {"type": "constant", "speed": 5.0 / size},
        "mesh": {"elements": 8},
    }
    rows = modes(Scene.from_dict(tables)).rows
    assert max(row["residual"] for row in rows) < 1e-9
    frequencies = [row["frequency"] * size for row in rows[:3]]
    np.testing.assert_allclose(frequencies, [13.9176567928, 85.3687580580, 237.1074722131], rtol=1e-6)


def test_pencil_outlives_its_result(unit_beam: Any) -> None:
    """PETSc matrices need the communicator of the mesh they were made on, so they keep it."""
    pencils = [modes(unit_beam({"motion.speed": speed})).spinning.pencil for speed in (0.0, 3.0)]
    gc.collect()
    at_rest, spinning = (p.solve(2).values[0].imag for p in pencils)
    assert at_rest < spinning


# --- self-checks -----------------------------------------------------------------------------------------------------


def test_self_checks(unit_beam: Any) -> None:
    for theory in ("linear", "von_karman_linear", "second_order", "reissner"):
        checks = modes(unit_beam({"motion.speed": 3.0, "model.theory": theory})).summary["checks"]
        assert set(checks) == {"asymmetry_M", "asymmetry_C", "asymmetry_K"}
        assert all(checks[f"asymmetry_{name}"] < 1e-14 for name in "MCK")
    damped = modes(unit_beam(NONCONSERVATIVE)).summary["checks"]
    assert damped["asymmetry_C"] > 1e-6
    assert damped["asymmetry_K"] > 1e-6


def test_backward_error_above_the_tolerance_is_an_error(unit_beam: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pencil, "BACKWARD_TOLERANCE", 1e-20)
    with pytest.raises(ComputationError, match="backward error"):
        modes(unit_beam())


def test_missing_coriolis_force_is_warned_of(unit_beam: Any) -> None:
    effects, speed = {"model.effects": ["centrifugal", "rotary_inertia"]}, {"motion.speed": 3.0}
    for changes, warned in ((effects | speed, True), (effects, False), (speed, False)):
        assert any("coriolis" in text for text in modes(unit_beam(changes)).warnings) is warned
