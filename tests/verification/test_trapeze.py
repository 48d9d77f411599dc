"""Torsion under tension: the fibers beside the axis of twist, against the equation of a twisting bar and a plate."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy.polynomial import legendre
from scipy.linalg import eigh

from rotfem import Problem, Scene, explain, modes, run
from rotfem.analysis.modal import ModalAnalysis
from rotfem.equations.compiled import compile_system
from rotfem.registry import effects

Array = npt.NDArray[np.float64]

LENGTH, WIDTH, HEIGHT, HUB = 1.0, 0.04, 0.001, 0.2
MATERIAL = {"E": 7e10, "nu": 0.0, "rho": 2700.0}

STRIP: dict[str, Any] = {
    "structure": {
        "type": "spatial_beam",
        "length": LENGTH,
        "hub_radius": HUB,
        "section": {**MATERIAL, "shape": "rectangle", "width": WIDTH, "height": HEIGHT},
    },
    "motion": {"type": "constant", "speed": 200.0},
    "model": {"theory": "consistent_linear"},
    "mesh": {"elements": 8, "degree": 3},
    "modes": {"count": 9},
}

#: Without the Coriolis force, which couples torsion with lag where the axis lies in the section: the bar alone.
UNCOUPLED = ["centrifugal", "rotary_inertia", "trapeze"]

#: A kernel of the exact theories compiles for ten seconds and more, the first time.
RICHER = [
    pytest.param(theory, marks=pytest.mark.nightly)
    for theory in ("von_karman_linear", "second_order", "von_karman", "reissner")
]


def scene(changes: dict[str, Any], tables: dict[str, Any] | None = None) -> Scene:
    return Scene.from_dict(copy.deepcopy(tables or STRIP)).replace(changes)


def torsion(s: Scene) -> float:
    return float(next(row["frequency"] for row in modes(s).rows if row["label"] == "1st torsion"))


def frequencies(s: Scene) -> Array:
    return np.array([row["frequency"] for row in modes(s).rows])


def shapes(count: int) -> tuple[Array, Array, Array, Array]:
    """Return places x, weights of quadrature, and x times Legendre polynomials with their slopes there, (count, n)."""
    s, w = legendre.leggauss(60)
    x = (s + 1) / 2 * LENGTH
    P = legendre.legvander(s, count - 1).T
    dP = np.array([legendre.legval(s, legendre.legder(c)) * np.ones_like(s) * 2 / LENGTH for c in np.eye(count)])
    return x, w / 2 * LENGTH, x * P, P + x * dP


def section_of_the_strip() -> tuple[float, float, float, float]:
    """Return A, I_2, I_3 and GJ, by Saint-Venant's series."""
    odd = np.arange(1, 60, 2)
    series = np.sum(np.tanh(odd * np.pi * WIDTH / HEIGHT / 2) / odd**5)
    GJ = MATERIAL["E"] / 2 * WIDTH * HEIGHT**3 / 3 * (1 - 192 / np.pi**5 * HEIGHT / WIDTH * series)
    return WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12, HEIGHT * WIDTH**3 / 12, GJ


def twisting_bar(speed: float, axis: int, trapeze: bool = True) -> float:
    """Return the first torsional frequency (rad/s) of the strip, by Ritz.

    ((GJ + N I_p/A) θ')' + ω² ρI_p θ ∓ Ω² ρ(I_3 − I_2) θ = 0 with the tension N of the centrifugal force; the propeller
    moment holds the strip in the plane of rotation, so it stiffens for an axis across the strip, 3, and softens for 2.
    """
    (A, I2, I3, GJ), rho = section_of_the_strip(), MATERIAL["rho"]
    x, w, theta, dtheta = shapes(12)
    N = rho * A * speed**2 * ((HUB + LENGTH) ** 2 - (HUB + x) ** 2) / 2
    propeller = rho * (I3 - I2) * speed**2 * (1 if axis == 3 else -1)
    K = (dtheta * w * (GJ + trapeze * N * (I2 + I3) / A)) @ dtheta.T + propeller * (theta * w) @ theta.T
    return float(np.sqrt(eigh(K, rho * (I2 + I3) * (theta * w) @ theta.T, eigvals_only=True)[0]))


def twisting_and_lagging_bar(speed: float) -> Array:
    """Return the two lowest frequencies (rad/s) of torsion and lag of the strip that spins about 2, by Ritz.

    Turns of the section about 1 and 3, φ and ϑ, are coupled by its Coriolis moments ±2Ωρ I_3: T has ρI_3 Ω(φ̇ϑ − φϑ̇).
    Lag is Timoshenko's beam under N; its slope feels the spin of the fibers across, −Ω² ρI_3 ϑ².
    """
    (A, I2, I3, GJ), rho, E = section_of_the_strip(), MATERIAL["rho"], MATERIAL["E"]
    x, w, f, df = shapes(16)
    N, GA = rho * A * speed**2 * ((HUB + LENGTH) ** 2 - (HUB + x) ** 2) / 2, 10 / 12 * E / 2 * A
    spin = rho * speed**2 * (f * w) @ f.T
    slope = (f * w * (GA - N)) @ f.T + E * I3 * (df * w) @ df.T - I3 * spin
    shear = -(df * w * (GA - N)) @ f.T
    twist = (df * w * (GJ + N * (I2 + I3) / A)) @ df.T - (I3 - I2) * spin
    zero, mass, turn = np.zeros_like(spin), (f * w) @ f.T, 2 * rho * I3 * speed * (f * w) @ f.T
    K = np.block([[GA * (df * w) @ df.T, shear, zero], [shear.T, slope, zero], [zero, zero, twist]])
    M = rho * np.kron(np.diag([A, I3, I2 + I3]), mass)
    C = np.block([[zero, zero, zero], [zero, zero, turn], [zero, -turn, zero]])
    first = np.block([[np.zeros_like(K), np.eye(len(K))], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    found = np.linalg.eigvals(first).imag
    return np.sort(found[found > 1.0])[:2]


def about(axis: int, speed: float) -> dict[str, Any]:
    return {"motion.axis": [0.0, 0.0, 1.0] if axis == 3 else [0.0, 1.0, 0.0], "motion.speed": speed}


# --- spinning strips ------------------------------------------------------------------------------------------------


def test_the_equation_of_the_bar() -> None:
    """Known to the digits of an independent computation: 344.4 without tension's part, 417.2 with it; 306.9 about 2."""
    assert twisting_bar(200.0, 3, trapeze=False) == pytest.approx(344.4, abs=0.05)
    assert twisting_bar(200.0, 3) == pytest.approx(417.2, abs=0.05)
    assert twisting_bar(200.0, 2) == pytest.approx(306.9, abs=0.05)


@pytest.mark.parametrize("axis", [2, 3])
def test_linear_beam_is_the_bar(axis: int) -> None:
    """The prestress of the undeformed strip is the N of the equation: 1e-7 is the error of the mesh."""
    for speed in (0.0, 80.0, 200.0):
        found = torsion(scene(about(axis, speed) | {"model.effects": UNCOUPLED}))
        assert found == pytest.approx(twisting_bar(speed, axis), rel=1e-7)
    found = torsion(scene(about(axis, 200.0)))
    expected = twisting_bar(200.0, 3) if axis == 3 else twisting_and_lagging_bar(200.0)[0]
    assert found == pytest.approx(expected, rel=1e-7)


def test_lag_pushes_torsion_down() -> None:
    """Where the axis of the spin lies in the strip lag is near, at 321 rad/s: 0.5 % of what torsion is alone."""
    together = twisting_and_lagging_bar(200.0)
    rows = {row["label"]: row["frequency"] for row in modes(scene(about(2, 200.0))).rows}
    np.testing.assert_allclose([rows["1st torsion"], rows["1st edgewise"]], together, rtol=1e-7)
    assert together[0] == pytest.approx(0.9948 * twisting_bar(200.0, 2), rel=1e-4)


def test_without_the_effect() -> None:
    bare = [effect.name for effect in effects if effect.name != "trapeze"]
    assert torsion(scene({"model.effects": bare})) == pytest.approx(twisting_bar(200.0, 3, trapeze=False), rel=1e-7)


@pytest.mark.parametrize("theory", RICHER)
def test_every_theory(theory: str) -> None:
    """About the stretched state, of a stretch of 5e-4: its length and radii change frequencies by some of that."""
    for axis in (2, 3):
        found = torsion(scene(about(axis, 200.0) | {"model.theory": theory, "model.effects": UNCOUPLED}))
        assert found == pytest.approx(twisting_bar(200.0, axis), rel=1e-3)


def test_against_the_plate() -> None:
    """What the spin adds to ω² is the same; the clamp hinders warping in the plate, which is 1 % of ω at rest."""
    plate = {"type": "plate", "length": LENGTH, "width": WIDTH, "thickness": HEIGHT, "hub_radius": HUB, **MATERIAL}
    tables = STRIP | {"structure": plate, "mesh": {"elements": [24, 2]}}
    for axis in (2, 3):
        bare = {"model.effects": UNCOUPLED}
        still, spinning = (torsion(scene(about(axis, speed) | bare, tables)) for speed in (0.0, 200.0))
        beam = twisting_bar(200.0, axis) ** 2 - twisting_bar(0.0, axis) ** 2
        assert spinning**2 - still**2 == pytest.approx(beam, rel=0.02)


def test_explain_says_how_much_it_is() -> None:
    """Of the four lowest modes torsion changes most: 1 − 344.4/417.2."""
    rows = {row["name"]: row for row in explain(scene({})).rows}
    expected = 1 - twisting_bar(200.0, 3, trapeze=False) / twisting_bar(200.0, 3)
    assert rows["trapeze"]["estimate"]["modes"] == pytest.approx(expected, rel=1e-2)


# --- sections -------------------------------------------------------------------------------------------------------


def test_sections_given_in_other_ways() -> None:
    """By shape, by matrices, with the polar radius given: the same strip; fibers along the axis alone: no effect."""
    s = scene({})
    matrices = dict(s.structure.section.at(0.0))
    radius = np.sqrt((WIDTH**2 + HEIGHT**2) / 12)
    expected = torsion(s)
    for section in (matrices, matrices | {"polar_radius": radius}):
        assert torsion(s.replace({"structure.section": section})) == pytest.approx(expected, rel=1e-9)
    without = s.replace({"structure.section.polar_radius": 0.0})
    assert torsion(without) == pytest.approx(twisting_bar(200.0, 3, trapeze=False), rel=1e-7)


def test_centers_apart() -> None:
    """Centers or full 6×6 matrices of the same section: tension acts on its distance from the axis of twist too."""
    changes = {"structure.section.shear_center": [0.01, 0.002], "structure.section.tension_center": [-0.005, 0.001]}
    s = scene(changes | {"motion.axis": [0.0, 1.0, 0.0]})
    expected = frequencies(s)
    by_matrices = s.replace({"structure.section": dict(s.structure.section.at(0.0))})
    np.testing.assert_allclose(frequencies(by_matrices), expected, rtol=1e-8)
    radius = np.hypot(np.sqrt((WIDTH**2 + HEIGHT**2) / 12), np.hypot(0.015, 0.001))
    np.testing.assert_allclose(frequencies(s.replace({"structure.section.polar_radius": radius})), expected, rtol=1e-9)
    about_one = s.replace({"structure.section.polar_radius": np.sqrt((WIDTH**2 + HEIGHT**2) / 12)})
    assert np.max(np.abs(frequencies(about_one) / expected - 1)) > 1e-3


# --- pretwist -------------------------------------------------------------------------------------------------------

PULLED: dict[str, Any] = {
    "structure": STRIP["structure"] | {"pretwist": [[0.0, 0.0], [LENGTH, 0.5]]},
    "motion": {"type": "constant", "speed": 0.0},
    "model": {"theory": "consistent_linear"},
    "loads": {"tip_force": [1000.0, 0.0, 0.0]},
    "mesh": {"elements": 4, "degree": 3},
}


def untwisted(s: Scene) -> float:
    """Return the twist of the tip about the axis in the equilibrium under a pull, rad."""
    return float(run(s).history["tip_theta1"][-1])


@pytest.mark.parametrize("theory", ["consistent_linear", pytest.param("reissner", marks=pytest.mark.nightly)])
def test_pull_untwists_a_strip(theory: str) -> None:
    """GJ K + N (k⁰ (r² − J/A) + r² K) = 0 for a uniform beam, in every theory: both sides of Γ₁ = N/EA hold."""
    s = scene({"model.theory": theory}, PULLED)
    at = s.structure.section.central(0.0)
    squared, warping = (at["EI2"] + at["EI3"]) / at["EA"], 2 * at["GJ"] / at["EA"]
    K = -1000.0 * 0.5 * (squared - warping) / (at["GJ"] + 1000.0 * squared)
    assert untwisted(s) == pytest.approx(K * LENGTH, rel=1e-8)
    assert abs(K + 0.1123) < 1e-4


def test_pretwist_of_a_round_bar_means_nothing() -> None:
    """J is all of I_p there: what a pull does to a thin strip it does not do to a bar that only has turned axes."""
    round_bar = {**MATERIAL, "nu": 0.3, "shape": "circle", "radius": 0.01}
    found = untwisted(scene({"structure.section": round_bar}, PULLED))
    assert abs(found) < 1e-12


def test_modes_of_a_pretwisted_strip() -> None:
    """They are those of the system with all effects in pieces of their own, from which any can be left out."""
    problem = Problem.of(scene({"motion.speed": 20.0}, PULLED))
    whole, apart = (
        ModalAnalysis(problem, system=compile_system(problem, moving=moving)).at(20.0, 5).pairs.values
        for moving in (False, True)
    )
    np.testing.assert_allclose(whole[:5], apart[:5], rtol=1e-9)
