"""Limits in which the answer is known: thin beams, circles, no spin, small motion, equivalent frames, one mode."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.linalg as sl
from scipy.integrate import quad
from scipy.optimize import brentq

from rotfem import Scene, run
from rotfem.analysis.equilibrium import steady_state
from rotfem.commands.problem import Problem
from rotfem.equations.system import System
from rotfem.errors import ComputationError
from rotfem.mechanics.motion import smooth_spin_up
from rotfem.numerics.newton import Newton
from rotfem.registry import theories

Array = npt.NDArray[np.float64]


def slender(r: float, **more: float) -> dict[str, Any]:
    """Return the section of the unit beam with radius of gyration r, as in the reference values."""
    stiffness = {"EA": r**-2, "GA": r**-2 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": r**2}
    return {"structure.section": stiffness | more}


def tip(scene: Scene) -> Array:
    """Return (u1, u2, alpha) of the tip of a steady state."""
    h = run(scene).history
    return np.array([h[f"tip_{c}"][-1] for c in ("u1", "u2", "alpha")])


def dense(A: Any) -> Array:
    return np.asarray(A.convert("dense").getDenseArray()).copy()


def first_mode(system: System, about: Array | None = None) -> tuple[float, Array]:
    """Return (frequency, mode as local dof array with unit tip) of M, K at a state at rest, without gyroscopy."""
    system.set_time(0.0)
    zero = np.zeros_like(system.q.x.array)
    system.set_state(zero if about is None else about, zero, zero)
    M, _, K = (dense(A) for A in system.mass_damping_stiffness())
    free = np.setdiff1d(np.arange(len(M)), system.clamped)
    # nu = 1/omega² of M x = nu K x: the lowest mode is the largest value, so round-off leaves it alone.
    n = len(free)
    nu, vectors = sl.eigh(M[np.ix_(free, free)], K[np.ix_(free, free)], subset_by_index=[n - 1, n - 1])
    mode = np.zeros(len(M))
    mode[free] = vectors[:, 0]
    return float(1 / np.sqrt(nu[0])), mode / system.structure.tip_values(mode)[1]


# --- thin beams ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_thin_limit_under_a_tip_load(unit_beam: Any, degree: int) -> None:
    """Exact Timoshenko beam: u2 = F(L³/3EI + L/GA_s), alpha = F L²/2EI; no locking from r/L = 1e-1 to 1e-5.

    P1 leaves F L³/12EI n² whatever r is (one-point integration of the curvature, exact); from P2 on the nodes are
    exact but for round-off, which grows as (n L/r)² times 1e-16 (the condition of the stiffness of n elements).
    """
    n, F = 10, 1e-4  # so small that the exact strains are linear to 1e-9
    for r in (1e-1, 1e-3, 1e-5):
        changes = slender(r) | {"model.theory": "reissner", "mesh": {"elements": n, "degree": degree}}
        _, u2, alpha = tip(unit_beam(changes, loads={"tip_force": [0.0, F]})) / F
        exact = 1 / 3 + 3.059 * r**2
        missing = 1 / (12 * n**2) if degree == 1 else 0.0
        roundoff = 1e-12 + 2e-16 * (n / r) ** 2
        assert u2 == pytest.approx(exact - missing, rel=2e-8 + roundoff)
        assert alpha == pytest.approx(0.5, rel=2e-8 + roundoff)


def test_full_integration_locks(unit_beam: Any) -> None:
    """The test above can fail: with full integration ten P1 elements at r/L = 1e-4 hardly move."""
    changes = slender(1e-4) | {"mesh": {"elements": 10, "degree": 1, "integration": "full"}, "model.theory": "linear"}
    assert tip(unit_beam(changes, loads={"tip_force": [0.0, 1.0]}))[1] < 1e-3 / 3


# --- large static deflection -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["dead", "follower"])
def test_dead_and_follower_loads(unit_beam: Any, kind: str) -> None:
    """Against the elastica, integrated from the tip by DOP853 to 1e-12: the follower bends the beam further."""
    elastica = {"dead": (-0.16064172, 0.49345748, 0.78174983), "follower": (-0.23263781, 0.57383906, 0.96823880)}
    changes = slender(1e-4) | {"model.theory": "reissner"}
    found = tip(unit_beam(changes, loads={"tip_force": {"value": [0.0, 2.0], "kind": kind}}))
    np.testing.assert_allclose(found, elastica[kind], rtol=0, atol=1e-6)


def test_theories_agree_to_their_orders(unit_beam: Any) -> None:
    """Static tip load F: u2 is odd in F, so that theories of first order differ from the exact one by F³, u1 by F²."""
    forces = np.array([0.1, 0.05])
    found = {
        name: np.array([tip(unit_beam({"model.theory": name}, loads={"tip_force": [0.0, F]})) for F in forces])
        for name in ("linear", "second_order", "von_karman", "reissner")
    }
    shortening = abs(found["linear"][0, 0] - found["reissner"][0, 0])
    for name in ("linear", "second_order", "von_karman"):
        difference = np.abs(found[name] - found["reissner"])
        orders = np.log2(difference[0] / difference[1])
        assert orders[1] == pytest.approx(3.0, abs=0.05)
        assert orders[2] == pytest.approx(3.0, abs=0.05)
        if name == "linear":
            assert orders[0] == pytest.approx(2.0, abs=0.05)
        elif name == "second_order":
            assert orders[0] > 2.9
        else:  # the elongation contains half the square of the shear strain, here 5 % of the slope
            assert difference[0, 0] < 0.03 * shortening


# --- tapers, tip masses -----------------------------------------------------------------------------------------------


def test_tapered_beam_under_tip_forces(unit_beam: Any) -> None:
    """Wedge with height 0.2 → 0.1 m: u1 = ∫F/EA, u2 = ∫F(L−x)²/EI + F/GA_s, by adaptive quadrature."""
    E, nu, rho, width = 1e4, 0.25, 1.0, 0.3
    section = {"E": E, "nu": nu, "rho": rho, "shape": "rectangle", "width": width, "height": [[0.0, 0.2], [1.0, 0.1]]}
    section["shear_correction"] = 5 / 6

    def height(x: float) -> float:
        return 0.2 - 0.1 * x

    G = E / (2 * (1 + nu))
    along = quad(lambda x: 1 / (E * width * height(x)), 0, 1)[0]
    across = quad(lambda x: (1 - x) ** 2 / (E * width * height(x) ** 3 / 12), 0, 1)[0]
    shear = quad(lambda x: 1 / (5 / 6 * G * width * height(x)), 0, 1)[0]
    changes = {"structure.section": section, "model.theory": "linear"}
    u1, u2, _ = tip(unit_beam(changes, loads={"tip_force": [1.0, 0.5]}))
    assert u1 == pytest.approx(along, rel=1e-7)
    assert u2 == pytest.approx(0.5 * (across + shear), rel=1e-6)


def test_taper_with_a_kink(unit_beam: Any) -> None:
    """EI stepped over 0.01 m in the middle: nodes are put at the knots, so the integral stays exact."""
    profile = [[0.0, 2.0], [0.5, 2.0], [0.51, 1.0], [1.0, 1.0]]
    x, values = np.array(profile).T
    exact = quad(lambda s: (1 - s) ** 2 / np.interp(s, x, values), 0, 1, points=list(x), epsabs=1e-13)[0]
    changes = slender(1e-3, EI=profile) | {"model.theory": "linear"}  # type: ignore[arg-type]
    u2 = tip(unit_beam(changes, loads={"tip_force": [0.0, 1.0]}))[1]
    assert u2 == pytest.approx(exact + 3.059e-6, rel=1e-6)


def test_spinning_tapered_rod(unit_beam: Any) -> None:
    """Stretch of a tapered rod at small speed: u1(L) = ∫ N/EA, N = Ω² ∫_x^L A_rho s ds; (kL)² is 1e-6."""
    omega = 1e-2
    changes = slender(0.1, EA=[[0.0, 100.0], [1.0, 50.0]], mass_per_length=[[0.0, 1.0], [1.0, 0.5]])  # type: ignore[arg-type]
    force = lambda x: quad(lambda s: (1 - 0.5 * s) * s, x, 1)[0]  # noqa: E731
    exact = omega**2 * quad(lambda x: force(x) / (100 - 50 * x), 0, 1)[0]
    changes |= {"model.theory": "reissner"}
    assert tip(unit_beam(changes, motion={"type": "constant", "speed": omega}))[0] == pytest.approx(exact, rel=2e-6)


def test_weight_of_beam_and_tip_mass(unit_beam: Any) -> None:
    """At rest under gravity g: u2 = −g (A_rho L⁴/8EI + A_rho L²/2GA_s + m(L³/3EI + L/GA_s)), exact."""
    g, m, GA = 0.01, 0.7, 400 / 3.059
    changes = {"structure.tip_mass": m, "model.theory": "linear"}
    u2 = tip(unit_beam(changes, loads={"gravity": [0.0, -g]}))[1]
    assert u2 == pytest.approx(-g * (1 / 8 + 1 / (2 * GA) + m * (1 / 3 + 1 / GA)), rel=1e-9)


# --- rotation --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theory", theories.names)
def test_spinning_rod(spin_up: Any, theory: str) -> None:
    """u1(L) = tan(kL)/k − L, k = Ω √(A_rho/EA), exact."""
    speed = 100.0
    k = speed * np.sqrt(1.2 / 2.8e7)
    u1, u2, _ = tip(spin_up({"model.theory": theory}, motion={"type": "constant", "speed": speed}))
    assert u1 == pytest.approx(np.tan(10 * k) / k - 10, rel=1e-9)
    assert abs(u2) < 1e-10


def test_a_rod_that_spins_faster_than_it_holds_together(spin_up: Any) -> None:
    """tan(kL)/k − L grows without bound as kL goes to π/2, here at 758.8 rad/s."""
    fast = spin_up({"model.theory": "reissner"}, motion={"type": "constant", "speed": 900.0})
    with pytest.raises(ComputationError, match=r"7[345][\d.]* rad/s\); it is stretched to [\d.]+ times its length"):
        run(fast)


@pytest.mark.parametrize("theory", ["consistent_linear", "von_karman_linear"])
def test_without_spin_the_linear_theories_are_one(unit_beam: Any, theory: str) -> None:
    """The prestress grows from nothing: at Ω → 0 the stiffness is that of `linear`, and leaves it as Ω²."""

    def stiffness(name: str, omega: float) -> Array:
        scene = unit_beam({"model.theory": name}, motion={"type": "constant", "speed": 1.0})
        system = Problem.of(scene).system()
        system.set_time(0.0, system.motion.at_speed(omega))
        return dense(system.mass_damping_stiffness()[2])

    np.testing.assert_array_equal(stiffness(theory, 0.0), stiffness("linear", 0.0))
    far, near = (stiffness(theory, w) - stiffness("linear", w) for w in (0.2, 0.1))
    np.testing.assert_allclose(far, 4 * near, rtol=0, atol=1e-10 * np.max(np.abs(stiffness("linear", 0.0))))
    assert np.max(np.abs(near)) > 0


@pytest.mark.parametrize(
    ("linear", "nonlinear"),
    [("consistent_linear", "reissner"), ("consistent_linear", "second_order"), ("von_karman_linear", "von_karman")],
)
def test_consistent_linearisation_of_a_stiff_rod(unit_beam: Any, linear: str, nonlinear: str) -> None:
    """First frequency at 3 rad/s: it differs from that about the true steady state by the stretch, ½Ω²L²A_rho/EA."""
    difference = {}
    for r in (0.01, 0.005):
        found = []
        for theory in (linear, nonlinear):
            scene = unit_beam(slender(r) | {"model.theory": theory}, motion={"type": "constant", "speed": 3.0})
            system = Problem.of(scene).system()
            q = steady_state(system, 3.0, Newton.of(scene.solver))
            found.append(first_mode(system, q)[0])
        difference[r] = abs(found[0] / found[1] - 1)
    assert difference[0.01] < 2 * 4.5 * 0.01**2
    assert difference[0.01] / difference[0.005] == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_rotary_inertia_may_vanish(spin_up: Any, theory: str) -> None:
    """Without rotary inertia the mass matrix is singular; the motion is the limit of that with very little of it."""
    time = {"end": 1.0, "step": 0.01}
    none, little = (
        run(spin_up({"model.theory": theory, "structure.section.rotary_inertia": value}, time=time)).history
        for value in (0.0, 1e-9)
    )
    assert np.max(np.abs(none["tip_u2"])) > 1e-2
    for column in ("tip_u1", "tip_u2", "tip_alpha"):
        np.testing.assert_allclose(none[column], little[column], rtol=0, atol=1e-8)


# --- damping ----------------------------------------------------------------------------------------------------------


# --- frames and forces that are the same ------------------------------------------------------------------------------

TIME = {"end": 1.5, "step": 0.0025, "output_every": 20, "spectral_radius": 0.9}
SPIN = {"type": "spin_up", "speed": 3.0, "duration": 1.0}


def tips(scene: Scene) -> Array:
    """Return the tip's (u1, u2, alpha) over time, shape (3, n)."""
    h = run(scene).history
    return np.array([h[f"tip_{c}"] for c in ("u1", "u2", "alpha")])


def test_rotating_and_inertial_frame(unit_beam: Any) -> None:
    """The same physics in both frames; each force changes the answer by more than a hundred times the tolerance."""
    changes = {"structure.hub_radius": 0.3, "structure.tip_mass": 0.1, "initial.state": "undeformed"}
    follower = {"value": [0.1, 0.2], "kind": "follower"}
    base = {"motion": SPIN | {"base_acceleration": [0.2, 0.4]}, "time": TIME}
    all_of: dict[str, Any] = {"gravity": [0.3, -0.5], "tip_force": [0.1, 0.2], "distributed": follower}
    rotating, inertial = (
        tips(unit_beam(changes | {"model.frame": f}, **base, loads=all_of)) for f in ("rotating", "inertial")
    )
    np.testing.assert_allclose(inertial, rotating, rtol=0, atol=5e-4)
    for name in all_of:
        less = all_of | {name: [1e-12, 0.0] if name != "distributed" else follower | {"value": [1e-12, 0.0]}}
        assert np.max(np.abs(rotating - tips(unit_beam(changes, **base, loads=less)))) > 5e-2, name
    still = {**base, "motion": SPIN | {"base_acceleration": [1e-12, 0.0]}}
    assert np.max(np.abs(rotating - tips(unit_beam(changes, **still, loads=all_of)))) > 5e-2


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_base_acceleration_is_minus_gravity(unit_beam: Any, theory: str) -> None:
    """Einstein's lift, turning: a_o = −Q(psi)ᵀ g gives the same forces as gravity g, to round-off."""
    g, angle = np.array([0.3, -0.5]), smooth_spin_up(1.0, 1.0)[2]

    def lift(t: float) -> Array:
        c, s = np.cos(angle(t)), np.sin(angle(t))
        return -np.array([c * g[0] + s * g[1], -s * g[0] + c * g[1], 0.0])

    changes = {"model.theory": theory, "structure.tip_mass": 0.1}
    motion = SPIN | {"speed": 1.0}
    weight = tips(unit_beam(changes, motion=motion, loads={"gravity": list(g)}, time=TIME))
    lifted = tips(unit_beam(changes, motion=motion | {"base_acceleration": lift}, time=TIME))
    assert np.max(np.abs(weight)) > 0.05
    np.testing.assert_allclose(lifted, weight, rtol=0, atol=1e-9)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_mirror_image(unit_beam: Any, theory: str) -> None:
    """Turning the other way gives the mirror image: u1 the same, u2 and alpha of opposite sign."""
    time = TIME | {"end": 0.8}
    one = tips(unit_beam({"model.theory": theory}, motion=SPIN, time=time))
    by_speed = tips(unit_beam({"model.theory": theory}, motion=SPIN | {"speed": -3.0}, time=time))
    by_axis = tips(unit_beam({"model.theory": theory}, motion=SPIN | {"axis": [0, 0, -1]}, time=time))
    mirrored = one * np.array([[1.0], [-1.0], [-1.0]])
    assert np.max(np.abs(one[1])) > 0.05
    np.testing.assert_allclose(by_speed, mirrored, rtol=0, atol=1e-9)
    np.testing.assert_allclose(by_axis, mirrored, rtol=0, atol=1e-9)


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
def test_steady_state_stays(unit_beam: Any, theory: str) -> None:
    """A history that starts from the steady state does not leave it, in either frame."""
    tables = {"motion": {"type": "constant", "speed": 3.0}, "loads": {"tip_force": [0.0, 0.3]}}
    at_rest = tip(unit_beam({"model.theory": theory}, **tables))
    time = {"end": 0.5, "step": 0.005, "spectral_radius": 1.0}
    moving = tips(unit_beam({"model.theory": theory}, **tables, time=time, initial={"state": "steady"}))
    np.testing.assert_allclose(moving, np.repeat(at_rest[:, None], moving.shape[1], axis=1), rtol=0, atol=1e-9)


def test_initial_tip_displacement(unit_beam: Any) -> None:
    """The initial shape is that of a static tip force: F from the exact u2(F), which is then released from rest."""
    for theory in ("linear", "reissner"):
        time = {"end": 0.01, "step": 0.01}
        h = run(unit_beam({"model.theory": theory}, initial={"tip_displacement": 0.2}, time=time)).history
        start = [h[f"tip_{c}"][0] for c in ("u1", "u2", "alpha")]
        assert start[1] == pytest.approx(0.2, abs=1e-10)
        load = brentq(
            lambda F, theory=theory: tip(unit_beam({"model.theory": theory}, loads={"tip_force": [0.0, F]}))[1] - 0.2,
            0.5,
            0.7,
        )
        held = tip(unit_beam({"model.theory": theory}, loads={"tip_force": [0.0, load]}))
        np.testing.assert_allclose(start, held, rtol=0, atol=1e-8)
        assert h["kinetic"][0] == 0.0
