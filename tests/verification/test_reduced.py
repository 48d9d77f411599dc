"""Reduced linear models: the full march's history, exact propagators, batched collocation, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import SceneError, explain, modes, run
from rotfem.analysis.reduced.collocation import collocate
from rotfem.analysis.reduced.propagator import Propagator, cubics, functions
from rotfem.scene import Scene
from rotfem.structures.planar_beam import PlanarBeam
from tests.beams import STRUCTURE

Array = npt.NDArray[np.float64]
MakeScene = Callable[..., Scene]

#: A force at the tip with kinks, across the beam: one along it would change the stiffness of a prestressed theory.
GUST = {
    "kind": "dead",
    "table": [[0.0, 0.0, 0.0], [0.4, 0.0, 8.0], [0.7, 0.0, -5.0], [1.5, 0.0, 1.0], [4.0, 0.0, 0.0]],
}


def plainly(begin: Array, end: Array, shares: Array) -> Array:
    return begin[:, None] + (end - begin)[:, None] * shares


def test_collocation_is_of_fifth_order() -> None:
    """q = (sin t, cos 2t) solves the equations whose force is made of it; the error falls by 32 with half the step."""
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

    errors, between = [], []
    for n in (300, 600):  # more than one batch
        q, v, _ = exact(np.zeros(1))
        steps = collocate(operators, plainly, np.linspace(0.0, 30.0, n + 1), q[0], v[0])
        t = np.linspace(0.0, 30.0, 1001)
        errors.append(np.abs(steps.q[-1] - exact(np.array([30.0]))[0][0]).max())
        between.append(np.abs(steps.at(t)[0] - exact(t)[0]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(5.0, abs=0.3)
    assert between[1] < 1e-7  # between the steps too


def test_answers_to_forces_that_follow_from_a_solution_are_those_to_the_same_forces_given() -> None:
    """q̈ + q̇/5 + 4q = cos t, and the answers to q² and to q̇ q̈, by the same steps: to round-off, in two batches."""
    from rotfem.analysis.reduced.collocation import NODES, answered

    def operators(t: Array) -> tuple[Array, Array, Array, Array]:
        one = np.ones((len(t), 1, 1))
        return one, 0.2 * one, 4 * one, -np.cos(t)[:, None]

    ends, rest, start = np.linspace(0.0, 30.0, 301), np.zeros(1), np.array([0.3])
    steps, answers = answered(operators, plainly, ends, start, rest, lambda t, q, v, a: [-(q**2), -v * a])
    alone = collocate(operators, plainly, ends, start, rest)
    np.testing.assert_array_equal(steps.q, alone.q)
    q, v, a = alone.nodes()
    assert q.shape[1] == len(NODES)
    for answer, forces in zip(answers, (-(q**2), -v * a), strict=True):
        given = collocate(operators, plainly, ends, rest, rest, forces)
        np.testing.assert_allclose(answer.q, given.q, atol=1e-13)


def test_propagator_is_exact_for_a_ramp_on_a_damped_oscillator() -> None:
    """M q̈ + C q̇ + K q = F t from rest, over intervals much longer than a period."""
    m, c, k, F = 2.0, 0.3, 50.0, 7.0
    grid = np.array([0.0, 3.0, 3.5, 10.0, 40.0])
    within, coefficients, off = cubics(lambda t: -F * t[:, None], plainly, grid)
    assert off < 1e-12
    assert np.array_equal(within, grid)
    q, _ = Propagator(*(np.array([[x]]) for x in (m, c, k))).solve(grid, coefficients, np.zeros(1), np.zeros(1))
    decay, omega = c / (2 * m), np.sqrt(k / m - (c / (2 * m)) ** 2)
    lag = F * c / k**2
    a, b = lag, (decay * lag - F / k) / omega
    exact = F * grid / k - lag + np.exp(-decay * grid) * (a * np.cos(omega * grid) + b * np.sin(omega * grid))
    np.testing.assert_allclose(q[:, 0], exact, rtol=1e-11, atol=1e-13)


def test_phi_functions_agree_where_their_two_formulas_meet() -> None:
    """φ₃ by its series just inside |z| = 1 and by recursion outside; it is smooth, so the difference is its slope's."""
    z = np.exp(1j * np.linspace(0.0, 3.0, 7))
    inside, outside = (functions(np.asarray(z * r), 3)[3] for r in (1 - 1e-9, 1 + 1e-9))
    np.testing.assert_allclose(inside, outside, atol=1e-9)
    assert functions(np.zeros(1, dtype=complex), 3)[3][0] == pytest.approx(1 / 6, rel=1e-14)


def extrapolated(scene: Scene) -> dict[str, Array]:
    """Return the history of the full march, extrapolated from its step and half of it (second order)."""
    coarse = run(scene.replace({"model.reduced": None})).history
    step, every = scene.time.step, scene.time.output_every  # type: ignore[union-attr]
    halved = {"model.reduced": None, "time.step": step / 2, "time.output_every": 2 * every}
    fine = run(scene.replace(halved)).history
    return {name: fine[name] + (fine[name] - coarse[name]) / 3 for name in fine}


def difference(a: dict[str, Array], b: dict[str, Array], name: str) -> float:
    return float(np.abs(a[name] - b[name]).max() / np.abs(b[name]).max())


@pytest.mark.parametrize("theory", ["linear", "consistent_linear"])
def test_reduced_spin_up_is_that_of_the_full_march(spin_up: MakeScene, theory: str) -> None:
    """To 1e-6 where both are refined; of tip_u1, which is 1e-4 of tip_u2 here, to what 1e-6 of that leaves."""
    time = {"end": 6.0, "step": 0.004, "output_every": 10}
    speed = {"type": "spin_up", "speed": 2.0, "duration": 5.0}
    scene = spin_up({"model.theory": theory, "model.reduced": 1e-8}, time=time, motion=speed, mesh={"elements": 6})
    reduced, full = run(scene), extrapolated(scene)
    assert reduced.summary["reduced"]["method"] == "collocation"
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
    assert reduced.summary["reduced"]["method"] == "exact exponential"
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


def one_vector(growth: Any) -> None:
    """Begin with the static answer to one load."""
    growth.model.grow(growth.model.solve(growth._solvers[0], growth._loads()[0])[:, None])


def test_the_basis_is_checked(spin_up: MakeScene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A basis that may not grow is seen to be too small, and the full system is used and said."""
    from rotfem.analysis.reduced import response

    monkeypatch.setattr(response, "MOST", 1)
    changes: dict[str, Any] = {"model.theory": "consistent_linear", "model.reduced": True}
    scene = spin_up(changes, time={"end": 1.0, "step": 0.02}, mesh={"elements": 4}, loads={"tip_force": GUST})
    monkeypatch.setattr(
        response.Growth,
        "_begin",
        lambda self: self.model.grow(self.model.solve(self._solvers[0], self._loads()[:1].T)),
    )
    result = run(scene)
    assert "reduced" not in result.summary
    assert any("the full system was used" in warning for warning in result.summary["warnings"])
    assert np.array_equal(result.history["tip_u2"], run(scene.replace({"model.reduced": None})).history["tip_u2"])


def test_foreshortening_brings_the_spin_up_near_reissner(spin_up: MakeScene) -> None:
    """From 3.3e-2 to 2.2e-5 of the largest displacement, and the estimate of what is left is not less than that.

    In the second order alone it is 1.1e-3.
    """
    time = {"end": 20.0, "step": 0.01, "output_every": 10}
    changes: dict[str, Any] = {"model.theory": "consistent_linear", "model.reduced": True, "model.foreshortening": True}
    exact, scene = run(spin_up(time=time | {"scheme": "radau5"})), spin_up(changes, time=time)
    given, linear = run(scene), run(scene.replace({"model.foreshortening": None}))

    def off(result: Any) -> float:
        u = [np.stack([x.history["tip_u1"], x.history["tip_u2"]]) for x in (result, exact)]
        return float(np.linalg.norm(u[0] - u[1], axis=0).max() / np.linalg.norm(u[1], axis=0).max())

    assert off(linear) == pytest.approx(3.3e-2, rel=0.02)
    assert off(given) < 4e-5
    assert off(given) < given.summary["theory_error"]["estimate"] < 10 * off(given)
    assert given.shape["u1"][-1] == pytest.approx(given.history["tip_u1"][-1], rel=1e-12)  # summed in another order
    with pytest.raises(SceneError, match="model.foreshortening = true: needs reduced = true"):
        scene.replace({"model.reduced": None})


def test_a_blow_at_speed_is_followed_to_the_third_order(spin_up: MakeScene) -> None:
    """A tip that moves by 14 % of the length, at 4 rad/s: what is left is 5e-4, of fifth order, and told as 4e-3.

    In the second order alone it is 6e-3; without what the centrifugal force does in displacements of fourth order 2e-2.
    """
    table = [[0.0, 0.0, 0.0], [0.5, 0.0, 30.0], [1.0, 0.0, -30.0], [1.5, 0.0, 0.0], [4.0, 0.0, 0.0]]
    loads, time = {"tip_force": {"kind": "dead", "table": table}}, {"end": 4.0, "step": 0.01}
    changes: dict[str, Any] = {"motion": {"type": "constant", "speed": 4.0}, "loads": loads, "mesh.elements": 8}
    model = {"model.theory": "consistent_linear", "model.reduced": 1e-4, "model.foreshortening": True}
    exact = run(spin_up(changes, time={**time, "step": 0.0025, "output_every": 4, "scheme": "esdirk4"}))
    given = run(spin_up(changes | model, time=time))
    u = [np.stack([x.history["tip_u1"], x.history["tip_u2"]]) for x in (given, exact)]
    off = float(np.linalg.norm(u[0] - u[1], axis=0).max() / np.linalg.norm(u[1], axis=0).max())
    assert off < 1.5e-3
    assert off / 2 < given.summary["theory_error"]["estimate"] < 15 * off


def test_effects_are_as_large_as_the_full_models_say(spin_up: MakeScene) -> None:
    """Each left out of reissner, against the reduced model of the linear theory."""
    from rotfem.analysis.reduced.effect_sizes import effect_sizes
    from rotfem.analysis.reduced.response import reduced_response
    from rotfem.commands.problem import Problem

    scene = spin_up({"mesh.elements": 6})
    problem = Problem.of(scene)
    times = np.linspace(0.0, 20.0, 501)
    linear = problem.replace(theory="consistent_linear")
    sizes = effect_sizes(reduced_response(linear.system(), times))

    def tips(effects: tuple[str, ...]) -> Array:
        moments = problem.replace(effects=effects).march(end=20.0, step=0.02)
        return np.array([[moment.tip["u1"], moment.tip["u2"]] for moment in moments])

    names = problem.effective_effects()
    assert set(sizes) == set(names) == {"coriolis", "centrifugal", "euler", "rotary_inertia"}
    whole = tips(names)
    for name, size in sizes.items():
        change = tips(tuple(n for n in names if n != name)) - whole
        truth = float(np.linalg.norm(change, axis=1).max() / np.linalg.norm(whole, axis=1).max())
        assert size == pytest.approx(truth, rel=0.15), name


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


def test_stretch_makes_frequencies_lower_by_what_it_is_said_to() -> None:
    """ω² of bending falls by 2ē where speed adds little to it, ē the mean of N/EA; its law has a tenth more."""
    section = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}
    structure = {"type": "planar_beam", "length": 10.0, "section": section}
    scene = {"structure": structure, "motion": {"type": "constant", "speed": 1.0}, "mesh": {"elements": 6}}
    squares = [
        np.abs(modes(Scene.from_dict(scene | {"model": {"theory": theory}, "modes": {"count": 3}})).eigenvalues) ** 2
        for theory in ("consistent_linear", "reissner")
    ]
    stretch = 1.2 * 1.0**2 * 10.0**2 / 3 / 2.8e7
    off = (squares[0] - squares[1])[:3] / squares[0][:3] / stretch
    law, _ = PlanarBeam.stretched
    assert np.all((0.85 * law < off) & (off < law))


@pytest.mark.parametrize(
    "motion",
    [
        {"type": "spin_up", "speed": 0.0, "duration": 1.0},
        {"type": "torque", "hub_inertia": 5.0, "pulses": [[0.0, 0.1, 0.0]]},
    ],
    ids=["prescribed", "free hub"],
)
def test_what_nothing_moves_stays_where_it_is(spin_up: MakeScene, motion: dict[str, Any]) -> None:
    """A basis without columns; of a free hub, which that says nothing of, the full system has the history."""
    scene = spin_up({"accuracy": 1e-3}, motion=motion, time={"end": 0.5, "step": 0.05})
    result = run(scene)
    assert result.summary["accuracy"]["met"]
    assert not np.any(result.history["tip_u2"])
    given = {"theory": "consistent_linear", "reduced": True, "foreshortening": True}
    other = run(scene.replace({"accuracy": None, "model": given}))
    assert not np.any(other.history["tip_u1"])
    assert ("reduced" in other.summary) == (motion["type"] == "spin_up")
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
