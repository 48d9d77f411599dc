"""Reduced linear models: exact integration in modal coordinates, the full march's history, foreshortening, refusals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import ComputationError, SceneError, explain, run
from rotfem.analysis.reduced import response, solution
from rotfem.analysis.reduced.solution import Solution, cut, functions
from rotfem.commands.problem import Problem
from rotfem.scene import Scene
from tests.beams import STRUCTURE

pytestmark = pytest.mark.usefixtures("unestimated")

Array = npt.NDArray[np.float64]
MakeScene = Callable[..., Scene]

#: A force at the tip with kinks, across the beam: one along it would change the stiffness of a prestressed theory.
GUST = {
    "kind": "dead",
    "table": [[0.0, 0.0, 0.0], [0.4, 0.0, 8.0], [0.7, 0.0, -5.0], [1.5, 0.0, 1.0], [4.0, 0.0, 0.0]],
}


class Oscillators:
    """M a + C(t) v + K(t) q + f(t) = 0 with prescribed matrices.

    Args:
        operators: times (n,) ↦ M, C, K (n, m, m) and f (n, m).
        constant: whether the matrices are.
    """

    def __init__(self, operators: Callable[[Array], tuple[Array, Array, Array, Array]], constant: bool):
        self.operators, self.constant = operators, constant

    def within(self, begin: Array, end: Array, shares: Array) -> Array:
        return np.asarray(begin[:, None] + (end - begin)[:, None] * shares)

    def reference(self, t: float, y: Array, v: Array) -> tuple[Array, Array, Array]:
        M, C, K, _ = self.operators(np.array([t]))
        return M[0], C[0], K[0]

    def at(self, t: Array) -> Callable[[Array, Array, Array], Array]:
        *matrices, f = self.operators(t)

        def residual(q: Array, v: Array, a: Array) -> Array:
            return np.asarray(f + sum(np.einsum("nij,nj->ni", A, x) for A, x in zip(matrices, (a, v, q), strict=True)))

        return residual


def test_solution_is_of_fourth_order_with_matrices_that_change() -> None:
    """q = (sin t, cos 2t) solves the equations whose force is made of it; a cubic in each step leaves h⁴ at least."""
    rng = np.random.default_rng(3)
    A, B = rng.standard_normal((2, 2, 2))

    def exact(t: Array) -> tuple[Array, Array, Array]:
        q = np.stack([np.sin(t), np.cos(2 * t)], axis=1)
        v = np.stack([np.cos(t), -2 * np.sin(2 * t)], axis=1)
        return q, v, np.stack([-np.sin(t), -4 * np.cos(2 * t)], axis=1)

    def operators(t: Array) -> tuple[Array, Array, Array, Array]:
        M = np.tile(np.array([[2.0, 0.5], [0.5, 1.0]]), (len(t), 1, 1))
        C, K = np.eye(2) + 0.2 * np.sin(t)[:, None, None] * A, 3 * np.eye(2) + 0.2 * np.cos(t)[:, None, None] * B
        q, v, a = exact(t)
        f = -np.einsum("nij,nj->ni", M, a) - np.einsum("nij,nj->ni", C, v) - np.einsum("nij,nj->ni", K, q)
        return M, C, K, f

    t, errors = np.linspace(0.0, 30.0, 1001), []
    start = [x[0] for x in exact(np.zeros(1))[:2]]
    for n in (40, 80):
        found = Solution(Oscillators(operators, constant=False), np.linspace(0.0, 30.0, n + 1), *start).at(t)
        errors.append([np.abs(x - y).max() for x, y in zip(found, exact(t), strict=True)])
    orders = np.log2(np.array(errors[0]) / errors[1])
    assert np.all(orders[:2] > 3.8)
    assert errors[1][0] < 1e-5
    assert errors[1][2] < 1e-2  # accelerations too


def test_a_single_step_that_is_not_found_is_a_failure() -> None:
    """Masses three times that of the middle at the ends of the only step: Picard's iteration doubles its error."""

    def operators(t: Array) -> tuple[Array, Array, Array, Array]:
        one = np.ones((len(t), 1, 1))
        return np.where(t == 0.5, 1.0, 3.0)[:, None, None] * one, 0 * one, one, np.ones((len(t), 1))

    with pytest.raises(ComputationError, match="was not found"):
        Solution(Oscillators(operators, constant=False), np.array([0.0, 1.0]), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize("damping", [0.3, 20.0, 40.0], ids=["light", "critical", "heavy"])
def test_solution_is_exact_for_a_ramp_on_an_oscillator(damping: float) -> None:
    """M q̈ + C q̇ + K q = F t from rest, over steps much longer than a period; modes are dependent at C² = 4 K M."""
    m, c, k, F = 2.0, damping, 50.0, 7.0
    ends = np.array([0.0, 3.0, 3.5, 10.0, 40.0])

    def operators(t: Array) -> tuple[Array, Array, Array, Array]:
        one = np.ones((len(t), 1, 1))
        return m * one, c * one, k * one, -F * t[:, None]

    t, rest = np.linspace(0.0, 40.0, 101), np.zeros(1)
    q, v, a = (x[:, 0] for x in Solution(Oscillators(operators, constant=True), ends, rest, rest).at(t))
    roots = np.roots([m, c, k]).astype(complex)
    if damping == 20.0:
        roots = roots + np.array([1e-6, -1e-6])
    lag = F * c / k**2
    parts = np.linalg.solve([[1.0, 1.0], roots], [lag, -F / k])
    exact = F * t / k - lag + (np.exp(np.outer(t, roots)) @ parts).real
    np.testing.assert_allclose(q, exact, atol=1e-9 if damping == 20.0 else 1e-11)
    np.testing.assert_allclose(m * a + c * v + k * q, F * t, atol=1e-8)


def test_phi_functions_agree_where_their_two_formulas_meet() -> None:
    """φ₃ by its series just inside |z| = 1 and by recursion outside; it is smooth, so the difference is its slope's."""
    z = np.exp(1j * np.linspace(0.0, 3.0, 7))
    inside, outside = (functions(np.asarray(z * r), 3)[3] for r in (1 - 1e-9, 1 + 1e-9))
    np.testing.assert_allclose(inside, outside, atol=1e-9)
    assert functions(np.zeros(1, dtype=complex), 3)[3][0] == pytest.approx(1 / 6, rel=1e-14)


def test_free_vibration_at_constant_speed_keeps_its_jacobi_integral(spin_up: MakeScene) -> None:
    """T2 + V − T0 of an undamped beam at constant speed, by steps as long as they come: to round-off."""
    scene = spin_up(
        {"model.theory": "consistent_linear", "model.reduced": 1e-4, "initial": {"tip_displacement": 0.2}},
        time={"end": 40.0, "step": 0.1},
        motion={"type": "constant", "speed": 3.0},
        mesh={"elements": 6},
    )
    jacobi = run(scene).history["jacobi"]
    assert np.ptp(jacobi) < 1e-9 * np.abs(run(scene).history["strain"]).max()


def test_a_basis_of_all_unknowns_is_the_full_system(spin_up: MakeScene) -> None:
    """It grows by what the residual shows to lack until nothing lacks, and then solves the full equations."""
    scene = spin_up({"model.theory": "consistent_linear"}, mesh={"elements": 1}, loads={"tip_force": GUST})
    system, times = Problem.of(scene).system(), np.linspace(0.0, 4.0, 41)
    growth = response.BasisEnrichment(system, times, None)
    sizes, lacking = [], []
    while True:
        equations = growth.equations()
        solution = Solution(equations, cut(growth.excitation.knots, 1e-3), *equations.start(None))
        states = equations.coordinates(solution, times)
        factors = growth.excitation.factors(response.after(times), equations.turn(times))
        residual = growth.model.residuals(factors, *states)
        sizes.append(growth.model.size)
        lacking.append(np.linalg.norm(residual, axis=0).max() / np.linalg.norm(growth.model.loads, axis=1).max())
        if growth.model.grow(growth.lacking(equations, solution, states), 2) == 0:
            break
    assert sizes[-1] == 9  # three nodes that move, three unknowns each
    assert sizes == sorted(sizes)
    assert lacking[-1] < 1e-9 < 1e-3 < lacking[0]


def test_a_small_motion_beside_one_of_much_energy() -> None:
    """A torsion of 0.9 rad has 1e6 times the energy of a lateral pulse, and motions add up.

    The accuracy is that of a section's points, which torsion moves by 250 times as much. A quarter of the lateral
    motion would be 0.1 of it; without shapes that move the axis at the tip all of that motion is lost.
    """
    section = {"EA": 2e7, "GA2": 6e6, "GA3": 6e6, "GJ": 800.0, "EI2": 1e4, "EI3": 4e4, "mass_per_length": 1.5}
    section |= {"rotary_inertia2": 7.5e-4, "rotary_inertia3": 3e-3}
    pulse = {"at": [{"x": 5.0, "force": {"table": [[0, 0, 0, 0], [0.01, 0, 0, 0.2], [0.02, 0, 0, 0]]}}]}
    tables: dict[str, Any] = {
        "structure": {"type": "spatial_beam", "length": 10.0, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "mesh": {"elements": 8},
        "initial": {"state": "undeformed"},
        "time": {"end": 1.0, "step": 0.01},
    }
    both, alone = (
        run(Scene.from_dict(tables | {"loads": loads, "model": {"theory": "consistent_linear", "reduced": accuracy}}))
        for loads, accuracy in ((pulse | {"tip_moment": [40.0, 0.0, 0.0]}, 1e-2), (pulse, 1e-4))
    )
    assert difference(both.history, alone.history, "tip_u3") < 0.25
    assert "reduced" in both.summary


def test_a_hinge_that_nothing_holds(spin_up: MakeScene) -> None:
    """On the axis a swing has a double eigenvalue of zero, with spin or without: the tip is where esdirk4 leads it."""
    hinge, time = (
        {"structure.root": {"lag_stiffness": 0.0}, "model.theory": "consistent_linear"},
        {"end": 1.0, "step": 0.05},
    )
    for speed in (0.0, 3.0):
        motion = {"type": "constant", "speed": speed}
        scene = spin_up(hinge, motion=motion, mesh={"elements": 2}, loads={"tip_force": GUST}, time=time)
        reduced = run(scene.replace({"model.reduced": 1e-5}))
        full = run(scene.replace({"time.step": 2e-3, "time.scheme": "esdirk4", "time.output_every": 25}))
        assert difference(reduced.history, full.history, "tip_u2") < 3e-5


def extrapolated(scene: Scene) -> dict[str, Array]:
    """Return the history of the full march, extrapolated from its step and half of it (second order)."""
    plain = {"model.reduced": None, "output.error": False}
    coarse = run(scene.replace(plain)).history
    step, every = scene.time.step, scene.time.output_every  # type: ignore[union-attr]
    halved = plain | {"time.step": step / 2, "time.output_every": 2 * every}
    fine = run(scene.replace(halved)).history
    return {name: fine[name] + (fine[name] - coarse[name]) / 3 for name in fine}


def difference(a: dict[str, Array], b: dict[str, Array], name: str) -> float:
    return float(np.abs(a[name] - b[name]).max() / np.abs(b[name]).max())


@pytest.mark.estimated
@pytest.mark.parametrize("theory", ["linear", "consistent_linear"])
def test_reduced_spin_up_is_that_of_the_full_march(spin_up: MakeScene, theory: str) -> None:
    """To 1e-6 where both are refined; of tip_u1, which is 1e-4 of tip_u2 here, to what 1e-6 of that leaves."""
    time = {"end": 6.0, "step": 0.004, "output_every": 10}
    speed = {"type": "spin_up", "speed": 2.0, "duration": 5.0}
    scene = spin_up({"model.theory": theory, "model.reduced": 1e-8}, time=time, motion=speed, mesh={"elements": 6})
    reduced, full = run(scene), extrapolated(scene)
    assert reduced.summary["warnings"] == run(scene.replace({"model.reduced": None})).summary["warnings"]
    assert list(reduced.history) == list(full)
    assert np.array_equal(reduced.t, full["t"])
    for name in ("psi", "psi_dot", "tip_u2", "tip_alpha", "kinetic", "strain", "jacobi"):
        assert difference(reduced.history, full, name) < 1e-6, name
    assert difference(reduced.history, full, "tip_u1") < 1e-3
    assert reduced.shape["u2"].shape == (19,)


def test_reduced_history_at_constant_speed_is_exact(spin_up: MakeScene) -> None:
    """Under a load with kinks; the full march is damped enough for its modes to be resolved by the steps."""
    scene = spin_up(
        {"model.theory": "consistent_linear", "model.reduced": 1e-7, "structure.damping.kelvin_voigt": 2e-2},
        time={"end": 4.0, "step": 0.002, "output_every": 20},
        motion={"type": "constant", "speed": 3.0},
        loads={"tip_force": GUST},
        mesh={"elements": 6},
    )
    reduced, full = run(scene), extrapolated(scene)
    for name in ("tip_u2", "tip_alpha", "strain"):
        assert difference(reduced.history, full, name) < 2e-5, name


def test_a_reduced_model_needs_a_linear_theory(spin_up: MakeScene) -> None:
    with pytest.raises(
        SceneError, match=r'model.reduced = true: needs a linear model.theory, not "reissner": "linear"'
    ):
        spin_up({"model.reduced": True})
    for wrong in (2, "yes", 0):
        with pytest.raises(SceneError, match="must be true, false, or an accuracy between 0 and 1"):
            spin_up({"model.theory": "linear", "model.reduced": wrong})


@pytest.mark.parametrize("limit", [("MOST_COLUMNS", 1), ("ITERATIONS", 1)])
def test_a_model_that_does_not_serve_is_said(
    spin_up: MakeScene, monkeypatch: pytest.MonkeyPatch, limit: tuple[str, int]
) -> None:
    """A basis that may not grow is seen to be too small, or no motion is found: the full system is used and said."""
    monkeypatch.setattr(response if limit[0] == "MOST_COLUMNS" else solution, *limit)
    changes: dict[str, Any] = {"model.theory": "consistent_linear", "model.reduced": True}
    scene = spin_up(changes, time={"end": 1.0, "step": 0.02}, mesh={"elements": 4}, loads={"tip_force": GUST})
    result = run(scene)
    assert "reduced" not in result.summary
    assert any("the full system was used" in warning for warning in result.summary["warnings"])
    assert np.array_equal(result.history["tip_u2"], run(scene.replace({"model.reduced": None})).history["tip_u2"])


def distance(result: Any, exact: Any) -> float:
    """Return the largest distance of the tips, relative to the largest displacement."""
    names = [name for name in ("tip_u1", "tip_u2", "tip_u3") if name in exact.history]
    found, truth = (np.stack([x.history[name] for name in names]) for x in (result, exact))
    return float(np.linalg.norm(found - truth, axis=0).max() / np.linalg.norm(truth, axis=0).max())


@pytest.mark.estimated
def test_foreshortening_brings_the_spin_up_near_reissner(spin_up: MakeScene) -> None:
    """From 3.3e-2 to 1.1e-3 of the largest displacement; the difference is the error of the linear motion."""
    time = {"end": 20.0, "step": 0.01, "output_every": 10}
    changes: dict[str, Any] = {"model.theory": "consistent_linear", "model.reduced": True, "model.foreshortening": True}
    exact = run(spin_up({"output.error": False}, time=time | {"scheme": "radau5"}))
    scene = spin_up(changes, time=time)
    given, linear = run(scene), run(scene.replace({"model.foreshortening": None}))
    assert distance(linear, exact) == pytest.approx(3.3e-2, rel=0.02)
    assert distance(given, exact) < 1.5e-3
    assert given.summary["theory_error"]["estimate"] == pytest.approx(distance(linear, exact), rel=0.1)
    assert given.shape["u1"][-1] == pytest.approx(given.history["tip_u1"][-1], rel=1e-12)  # summed in another order
    with pytest.raises(SceneError, match="model.foreshortening = true: needs reduced = true"):
        scene.replace({"model.reduced": None})


@pytest.mark.estimated
def test_foreshortening_is_of_second_order() -> None:
    """At a quarter of the load the relative error falls by 4 linearly, and by 16 with the foreshortening.

    The estimate, the difference of both, is the linear error at both loads.
    """
    tube = {"shape": "tube", "outer_radius": 0.012, "inner_radius": 0.010, "E": 7e9, "nu": 0.33, "rho": 1600.0}
    off: dict[bool, list[float]] = {False: [], True: []}
    estimated: list[float] = []
    for load in (16.0, 4.0):
        rows = [[0, 0, 0, 0], [0.1, 0, load, 0], [0.2, 0, -load / 2, load], [0.4, 0, 0, -load]]
        scene: dict[str, Any] = {
            "structure": {"type": "spatial_beam", "length": 0.8, "section": tube},
            "mesh": {"elements": 4},
            "motion": {"type": "constant", "speed": 0.0},
            "loads": {"tip_force": {"table": rows}},
            "time": {"end": 0.4, "step": 1e-3, "output_every": 2, "scheme": "radau5"},
            "output": {"error": False},
        }
        exact = run(scene)
        for bent, errors in off.items():
            model = {"theory": "consistent_linear", "reduced": 1e-6, "foreshortening": bent}
            given = run(scene | {"model": model, "output": {"error": bent}})
            errors.append(distance(given, exact))
        estimated.append(given.summary["theory_error"]["estimate"])
    assert estimated == pytest.approx(off[False], rel=0.15)
    assert off[False][0] / off[False][1] == pytest.approx(4.0, rel=0.15)
    assert off[True][0] / off[True][1] == pytest.approx(16.0, rel=0.1)


def test_what_stretch_does_is_in_the_second_order() -> None:
    """A line of small EA that spins up, and is struck: the stretch lowers its frequencies; linearly it is 6e-2 away."""
    ramp = [[float(t), float(4.0 * (t / 5) ** 2 * (3 - 2 * t / 5))] for t in np.linspace(0.0, 5.0, 26)]
    section = {"EA": 2.8e5, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}
    force = [[0, 0, 0], [6.0, 0, 0], [6.4, 0, 3.0], [6.7, 0, -2.0], [7.5, 0, 1.0], [8.0, 0, 0]]
    scene: dict[str, Any] = {
        "structure": {"type": "planar_beam", "length": 10.0, "section": section},
        "mesh": {"elements": 6},
        "motion": {"type": "table", "table": [*ramp, [15.0, 4.0]]},
        "loads": {"tip_force": {"kind": "dead", "table": force}},
        "time": {"end": 15.0, "step": 0.02},
        "output": {"error": False},
    }
    exact = run(scene | {"time": scene["time"] | {"scheme": "radau5"}})
    model = {"theory": "consistent_linear", "reduced": 1e-4, "foreshortening": True}
    given, linear = (run(scene | {"model": model | {"foreshortening": bent}}) for bent in (True, False))
    assert distance(given, exact) < 0.4 * distance(linear, exact)
    assert given.summary["theory_error"]["estimate"] > 0.9 * distance(linear, exact)


def test_nothing_moves_where_nothing_drives(spin_up: MakeScene) -> None:
    """A beam at rest has a reduced model of no vectors."""
    still = spin_up(
        {"model.theory": "linear", "model.reduced": True},
        motion={"type": "constant", "speed": 0.0},
        time={"end": 1.0, "step": 0.1},
    )
    result = run(still)
    assert result.summary["reduced"]["vectors"] == 0
    assert np.array_equal(result.history["tip_u2"], np.zeros(11))


@pytest.mark.estimated
@pytest.mark.parametrize(
    "motion",
    [
        {"type": "spin_up", "speed": 0.0, "duration": 1.0},
        {"type": "torque", "hub_inertia": 5.0, "pulses": [[0.0, 0.1, 0.0]]},
    ],
    ids=["prescribed", "free hub"],
)
def test_what_nothing_moves_stays_where_it_is(spin_up: MakeScene, motion: dict[str, Any]) -> None:
    """A basis without columns, of a prescribed motion and of a free hub."""
    scene = spin_up({"accuracy": 1e-3}, motion=motion, time={"end": 0.5, "step": 0.05})
    result = run(scene)
    assert result.summary["accuracy"]["met"]
    assert not np.any(result.history["tip_u2"])
    given = {"theory": "consistent_linear", "reduced": True, "foreshortening": True}
    other = run(scene.replace({"accuracy": None, "model": given}))
    assert not np.any(other.history["tip_u1"])
    assert other.summary["reduced"]["vectors"] == 0
    assert all(row["estimate"].get("history", 0.0) == 0.0 for row in explain(scene.replace({"accuracy": None})).rows)


def test_where_nothing_acts_nothing_moves() -> None:
    scene = {
        "structure": STRUCTURE,
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "linear", "reduced": True},
        "mesh": {"elements": 2},
        "time": {"end": 0.1, "step": 0.05},
    }
    assert not np.any(run(scene).history["tip_u2"])
