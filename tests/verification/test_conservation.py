"""What the equations of motion conserve, the symmetries of their tangents, and the tangents themselves.

At constant speed, without damping and followers, the Jacobi integral T2 − T0 + W (less the work of dead loads) is
conserved, the mass is symmetric, the gyroscopic matrix skew and the stiffness symmetric, about any state.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import Scene, run
from rotfem.analysis.equilibrium import steady_state
from rotfem.commands.problem import Problem
from rotfem.equations.system import System
from rotfem.mechanics.theories import theories
from rotfem.numerics.newton import Newton

Array = npt.NDArray[np.float64]

LINEAR = [theory.name for theory in theories() if theory.linear]
NONLINEAR = [theory.name for theory in theories() if not theory.linear]
SPIN = {"type": "constant", "speed": 3.0}
#: Everything that acts at t = 0 acts at once, so that there is a motion.
STRUCK = {"initial": {"state": "undeformed"}}
#: Everything that derives from a potential in the frame.
POTENTIAL = STRUCK | {
    "motion": SPIN | {"base_acceleration": [1.0, 0.5]},
    "loads": {"tip_force": [-0.4, 0.5], "distributed": [0.2, 0.3], "tip_moment": 0.2},
}
#: Everything there is: gravity, followers, damping, a tip mass, and a speed that changes.
EVERYTHING = {
    "motion": {"type": "spin_up", "speed": 3.0, "duration": 2.0, "base_acceleration": [[0, 0.0, 0.0], [1, 2.0, 1.0]]},
    "loads": {
        "gravity": [2.0, -3.0],
        "tip_force": {"value": [-0.4, 0.5], "kind": "follower"},
        "distributed": {"value": [0.2, 0.3], "kind": "follower"},
    },
}
TIP = {"structure.tip_mass": 0.2, "structure.tip_inertia": 0.01}
DISSIPATION = {
    "structure.damping.kelvin_voigt": 0.01,
    "structure.damping.rayleigh": [0.3, 0.02],
}
MESH = {"elements": 3, "degree": 2}


def dense(A: Any) -> Array:
    """Return a PETSc matrix as an array."""
    return np.asarray(A.convert("dense").getDenseArray()).copy()


def matrices(system: System) -> tuple[Array, Array, Array]:
    """Return (M, C, K) of the free unknowns at the state and time set."""
    free = np.setdiff1d(np.arange(system.scale.size), system.clamped)
    return tuple(dense(A)[np.ix_(free, free)] for A in system.mass_damping_stiffness())  # type: ignore[return-value]


def asymmetry(A: Array, sign: int = 1) -> float:
    """Return the largest entry of A − sign·Aᵀ relative to the largest of A."""
    return float(np.max(np.abs(A - sign * A.T)) / np.max(np.abs(A)))


def smooth_state(system: System, size: float, seed: int) -> Array:
    """Return a field of the given size that is zero at the clamp: a sum of three sines with random amplitudes."""
    X = system.V.tabulate_dof_coordinates()[:, 0] / system.structure.length
    c = np.random.default_rng(seed).normal(size=(3, 3))
    return size * np.column_stack([sum(a * np.sin((j + 0.5) * X) for j, a in enumerate(row)) for row in c]).ravel()


# --- the Jacobi integral -------------------------------------------------------------------------------------------


def jacobi_drift(scene: Scene) -> float:
    """Return the largest change of the Jacobi integral over a run, relative to the largest strain energy."""
    h = run(scene).history
    return float(np.max(np.abs(h["jacobi"] - h["jacobi"][0])) / np.max(h["strain"]))


@pytest.mark.parametrize("theory", LINEAR)
def test_jacobi_integral_of_linear_theories(unit_beam: Any, theory: str) -> None:
    """The trapezoidal rule conserves quadratic integrals: no drift but round-off at any step, here a coarse one."""
    changes = {"model.theory": theory, "mesh": MESH, **TIP}
    # 3 rad/s is past the critical speed of first-order strains without prestress.
    changes["motion.speed"] = 1.0 if theory == "linear" else 3.0
    time = {"end": 100.0, "step": 0.02, "spectral_radius": 1.0, "output_every": 5}
    # Seen: 2e-13 after 5000 steps; a loss of 1e-14 a step would make 5e-11.
    assert jacobi_drift(unit_beam(POTENTIAL | {"time": time}).replace(changes)) < 5e-12


@pytest.mark.parametrize("theory", NONLINEAR)
def test_jacobi_integral_of_nonlinear_theories(unit_beam: Any, theory: str) -> None:
    """The drift over a fixed time falls at least as h²: it belongs to the scheme, not to the equations."""
    changes = {"model.theory": theory, "mesh": MESH, **TIP}
    drifts = [
        jacobi_drift(unit_beam(changes, **POTENTIAL, time={"end": 2.0, "step": h, "spectral_radius": 1.0}))
        for h in (0.01, 0.005)
    ]
    assert drifts[1] < 1e-3
    assert drifts[1] < drifts[0] / 3


@pytest.mark.parametrize("theory", NONLINEAR)
def test_the_error_of_the_jacobi_integral_does_not_add_up(unit_beam: Any, theory: str) -> None:
    """The trapezoidal rule is symmetric: over 2000 steps the error swings, and has no trend.

    Seen: the last quarter has 1.3 times the error of the first; one that grew with time would have 4 times.
    """
    time = {"end": 20.0, "step": 0.01, "spectral_radius": 1.0, "output_every": 5}
    h = run(unit_beam({"model.theory": theory, "mesh": MESH, **TIP}, **POTENTIAL, time=time)).history
    first, *_, last = np.array_split(np.abs(h["jacobi"] - h["jacobi"][0]) / np.max(h["strain"]), 4)
    assert last.max() < 2.0 * first.max() < 2e-3


@pytest.mark.parametrize("theory", NONLINEAR)
def test_jacobi_integral_does_not_grow(spin_up: Any, theory: str) -> None:
    """Released undeformed at 6 rad/s, which leaves an axial vibration: rho_inf = 1 keeps it, less takes it out."""
    tables = STRUCK | {"motion": {"type": "constant", "speed": 6.0}}
    for rho_inf, lost in ((1.0, 1e-9), (0.8, 1e-4)):
        time = {"end": 1.0, "step": 0.002, "spectral_radius": rho_inf, "output_every": 5}
        h = run(spin_up({"model.theory": theory}, **tables, time=time)).history
        change = (h["jacobi"] - h["jacobi"][0]) / h["kinetic"][0]
        assert change.max() < 1e-9  # seen: 1e-11
        assert change.min() > -lost  # seen: 1e-11 and 5.4e-5, the energy of the axial vibration


@pytest.mark.parametrize("change", ["damping", "euler"])
def test_jacobi_integral_is_not_conserved_otherwise(unit_beam: Any, change: str) -> None:
    """The test above can fail: damping takes energy out, a changing speed does work."""
    changes = {"structure.damping.kelvin_voigt": 0.01} if change == "damping" else {}
    motion = SPIN if change == "damping" else {"type": "spin_up", "speed": 3.0, "duration": 2.0}
    time = {"end": 2.0, "step": 0.005, "spectral_radius": 1.0}
    assert jacobi_drift(unit_beam(changes, **STRUCK, motion=motion, mesh=MESH, time=time)) > 1e-2


def test_jacobi_integral_is_the_same_in_both_frames(unit_beam: Any) -> None:
    time = {"end": 1.0, "step": 0.001, "spectral_radius": 0.9, "output_every": 50}
    rotating, other = (
        run(unit_beam({"structure.hub_radius": 0.5, "model.frame": f}, **STRUCK, motion=SPIN, mesh=MESH, time=time))
        for f in ("rotating", "inertial")
    )
    rotating, other = rotating.history, other.history
    scale = np.max(rotating["strain"])
    for name in ("kinetic", "strain", "jacobi"):
        # both to second order in the step
        np.testing.assert_allclose(other[name], rotating[name], rtol=0, atol=2e-3 * scale)


# --- symmetry --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theory", [*LINEAR, *NONLINEAR])
def test_symmetries_about_a_deformed_steady_state(unit_beam: Any, theory: str) -> None:
    scene = unit_beam({"model.theory": theory, "mesh": MESH, **TIP}, **POTENTIAL)
    system = Problem.of(scene).system()
    q = steady_state(system, 3.0, Newton.of(scene.solver))
    assert np.max(np.abs(q)) > 0.05
    M, C, K = matrices(system)
    assert asymmetry(M) < 1e-14
    assert asymmetry(C, -1) < 1e-14
    assert asymmetry(K) < 1e-14
    assert np.max(np.abs(C)) > 1e-3
    assert np.linalg.eigvalsh(M).min() > 0
    # The clamped unknowns: 1 in K, 0 in M and C, nothing beside.
    for A, diagonal in zip(system.mass_damping_stiffness(), (0.0, 0.0, 1.0), strict=True):
        full, n = dense(A), np.arange(system.scale.size)
        np.testing.assert_array_equal(full[system.clamped], diagonal * (n == system.clamped[:, None]))
        np.testing.assert_array_equal(full[:, system.clamped].T, diagonal * (n == system.clamped[:, None]))


def test_what_breaks_the_symmetries(unit_beam: Any) -> None:
    """Damping makes C symmetric instead; Euler force and followers make K non-symmetric."""
    theory = "reissner"
    damped = unit_beam(
        {"model.theory": theory, "mesh": MESH, "structure.damping.kelvin_voigt": 0.01},
    )
    _, C, K = matrices(prepared(damped, 0.0))
    assert asymmetry(C) < 1e-14
    np.testing.assert_allclose(C, 0.01 * K, rtol=0, atol=1e-12 * np.max(K))  # Kelvin–Voigt, at the undeformed state
    changing = unit_beam({"model.theory": theory, "mesh": MESH}, motion=EVERYTHING["motion"])
    _, C, K = matrices(prepared(changing, 1.0))
    assert asymmetry(C, -1) < 1e-14
    assert asymmetry(K) > 1e-4
    follower = unit_beam({"model.theory": theory, "mesh": MESH}, loads=EVERYTHING["loads"])
    assert asymmetry(matrices(prepared(follower, 0.0))[2]) > 1e-5


def prepared(scene: Scene, t: float) -> System:
    """Return the compiled system of a scene at rest at time t."""
    system: System = Problem.of(scene).system()
    system.set_time(t)
    return system


# --- tangents --------------------------------------------------------------------------------------------------------

CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "potential": (POTENTIAL, TIP),
    "everything": (EVERYTHING, TIP | DISSIPATION),
}
PAIRS = [(t, "potential") for t in (*LINEAR, *NONLINEAR)] + [
    (t, "everything") for t in ("consistent_linear", *NONLINEAR)
]


@pytest.mark.parametrize(("theory", "case"), PAIRS)
def test_tangents_are_the_derivatives_of_the_residual(unit_beam: Any, theory: str, case: str) -> None:
    """Central differences with steps of 1e-5 leave 1e-10 of truncation and 1e-9 of round-off; 1e-6 is asked for."""
    tables, changes = CASES[case]
    scene = unit_beam(changes | {"model.theory": theory, "mesh": MESH}, **tables)
    errors = tangent_errors(Problem.of(scene).system(), 0.7)
    assert max(errors.values()) < 1e-6


def test_tangents_in_the_inertial_frame(unit_beam: Any) -> None:
    changes = {"structure.damping.kelvin_voigt": 0.01, "model.frame": "inertial", "mesh": MESH, **TIP}
    scene = unit_beam(changes, motion=EVERYTHING["motion"])
    errors = tangent_errors(Problem.of(scene).system(), 0.7)
    assert max(errors.values()) < 1e-6


def tangent_errors(system: System, t: float) -> dict[str, float]:
    """Return name ↦ largest error of M, C, K times a smooth direction, relative to the largest entry of the product."""
    system.set_time(t)
    state = [smooth_state(system, size, seed) for seed, size in enumerate((0.1, 0.3, 1.0))]
    free = np.setdiff1d(np.arange(system.scale.size), system.clamped)
    direction, eps, errors = smooth_state(system, 1.0, 9), 1e-5, {}

    def force(which: int, step: float) -> Array:
        moved = [x + step * direction * (i == which) for i, x in enumerate(state)]
        system.set_state(*moved)
        return -np.array(system.residual().array)

    for which, (name, shift) in enumerate({"K": (1, 0, 0), "C": (0, 1, 0), "M": (0, 0, 1)}.items()):
        difference = (force(which, eps) - force(which, -eps)) / (2 * eps)
        system.set_state(*state)
        A = dense(system.matrix(*shift, 1.0))
        product = (A @ direction)[free]
        if np.max(np.abs(product)) > 1e-12:
            errors[name] = float(np.max(np.abs(product - difference[free])) / np.max(np.abs(product)))
        else:
            assert np.max(np.abs(difference[free])) < 1e-9
    assert {"K", "M"} <= set(errors)
    return errors


@pytest.mark.parametrize("theory", [*LINEAR, *NONLINEAR])
def test_tangents_follow_the_speed(unit_beam: Any, theory: str) -> None:
    """C is proportional to Omega, K − K(0) to Omega² at the undeformed state; stale constants would show here."""
    system = prepared(unit_beam({"model.theory": theory, "mesh": MESH}, motion=SPIN), 0.0)
    found = {}
    for omega in (1.0, 2.0, 0.0):
        system.set_time(0.0, system.motion.at_speed(omega))
        found[omega] = matrices(system)
    (M1, C1, K1), (M2, C2, K2), (_, C0, K0) = (found[w] for w in (1.0, 2.0, 0.0))
    np.testing.assert_array_equal(M1, M2)
    assert np.max(np.abs(C1)) > 1e-3
    assert np.max(np.abs(K1 - K0)) > 1e-3
    np.testing.assert_allclose(C2, 2 * C1, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(C0, 0, atol=1e-14)
    np.testing.assert_allclose(K2 - K0, 4 * (K1 - K0), rtol=0, atol=1e-12 * np.max(np.abs(K0)))
