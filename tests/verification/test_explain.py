"""Estimates against both models run, choices against their tolerance, and what leaves a model's range."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import ufl

import rotfem
from rotfem.analysis.reduced.stretch import COARSE
from rotfem.analysis.time_loop import March
from rotfem.commands.problem import Problem, case_of
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, SceneError
from rotfem.mechanics.effects import Effect
from rotfem.mechanics.theories import Theory
from rotfem.registry import register
from rotfem.scene import Scene
from rotfem.selection import reduced_effects
from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import HISTORY, MODES, STEADY, tip_change
from rotfem.selection.estimate import NOTICEABLE, Estimates
from rotfem.selection.model_choice import Choice, choose
from tests.beams import STRUCTURE

#: Part of the spin-up, with steps that are seen.
COARSE_STEPS = {"motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0}, "time": {"end": 6.0, "step": 0.04}}

SPIN_UP: dict[str, Any] = {
    "structure": STRUCTURE,
    "motion": {"type": "spin_up", "speed": 4.0, "duration": 4.0},
    "mesh": {"elements": 10},
    "modes": {"count": 3},
    "time": {"end": 5.0, "step": 0.01},
}

#: A thick beam with something of every effect that a prescribed motion has.
ALL: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 1.0,
        "hub_radius": 0.2,
        "tip_mass": 0.3,
        "tip_inertia": 0.01,
        "section": {"EA": 400.0, "GA": 130.0, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 0.0025},
        "damping": {"kelvin_voigt": 1e-3, "rayleigh": [0.02, 0.0]},
    },
    "motion": {"type": "spin_up", "speed": 1.5, "duration": 3.0, "base_acceleration": [0.1, 0.05]},
    "loads": {"gravity": [0.0, -0.05]},
    "mesh": {"elements": 4},
    "time": {"end": 4.0, "step": 0.01},
}


def scene(tables: dict[str, Any], changes: dict[str, Any] | None = None) -> Scene:
    return Scene.from_dict(copy.deepcopy(tables)).replace(changes or {})


def tip(result: Any) -> Any:
    return np.stack([v for k, v in result.history.items() if k.startswith("tip_u")], axis=1)


# --- switches -------------------------------------------------------------------------------------------------------


def state_of(system: Any, t: float) -> Any:
    """Write a state into a system; return its residual and a tangent times a vector."""
    rng = np.random.default_rng(3)
    q, v, a = (size * rng.standard_normal(system.q.x.array.size) * system.scale for size in (1e-2, 1e-1, 1.0))
    system.set_time(t)
    system.set_state(q, v, a)
    residual = system.residual().array.copy()
    matrix = system.matrix(1.0, 2.0, 3.0, 0.0)
    x, y = matrix.createVecs()
    x.array[:] = rng.standard_normal(x.array.size)
    x.array[system.clamped] = 0.0
    matrix.mult(x, y)
    return np.concatenate([residual, y.array])


@pytest.mark.parametrize("theory", ["linear", "consistent_linear", "reissner"])
def test_an_effect_switched_off_is_one_that_is_not_there(theory: str) -> None:
    """Residual and tangent at a random state are those of the model compiled without it, to rounding."""
    full = Problem.of(scene(ALL, {"model.theory": theory}))
    effects = full.effective_effects()
    system = compile_system(full)
    assert system.model.effects == effects
    assert set(effects) >= {"base", "gravity", "damping", "tip_mass", "rotary_inertia", "euler"}
    whole = state_of(system, 1.3)
    for name in effects:
        rest = tuple(e for e in effects if e != name)
        expected = state_of(compile_system(full.replace(effects=rest)), 1.3)
        system.leave_out({name})
        found = state_of(system, 1.3)
        size = np.abs(expected).max()
        assert np.abs(found - expected).max() < 1e-12 * size  # rounding of sums of up to 1e3 terms
        assert np.abs(found - whole).max() > 1e-9 * size  # the effect is felt in this state
    system.leave_out(())
    assert np.array_equal(state_of(system, 1.3), whole)


@pytest.mark.slow
@pytest.mark.parametrize("theory", ["consistent_linear", pytest.param("reissner", marks=pytest.mark.nightly)])
def test_bodies_beside_the_axis_are_switched_too(theory: str) -> None:
    """A spatial beam with a tip mass off its axis; each new form takes ten seconds and more to compile."""
    section = {"EA": 400.0, "GA2": 130.0, "GA3": 130.0, "GJ": 0.8, "EI2": 1.0, "EI3": 2.0, "mass_per_length": 1.0}
    inertia = {"rotary_inertia2": 2e-3, "rotary_inertia3": 4e-3}
    tables = {
        "structure": {
            **{"type": "spatial_beam", "length": 1.0, "hub_radius": 0.2, "section": section | inertia},
            **{"tip_mass": 0.3, "tip_inertia": 0.01, "tip_offset": [0.1, 0.05, -0.05]},
        },
        "motion": {"type": "spin_up", "speed": 1.5, "duration": 3.0},
        "model": {"theory": theory},
        "mesh": {"elements": 2},
        "time": {"end": 4.0, "step": 0.01},
    }
    full = Problem.of(scene(tables))
    system = compile_system(full)
    for name in ("tip_mass", "rotary_inertia"):
        rest = tuple(e for e in full.effective_effects() if e != name)
        expected = state_of(compile_system(full.replace(effects=rest)), 1.3)
        system.leave_out({name})
        size = np.abs(expected).max()
        assert np.abs(state_of(system, 1.3) - expected).max() < 1e-12 * size  # rounding


def test_switches_reach_the_hub() -> None:
    torque = {"type": "torque", "hub_inertia": 0.5, "pulses": [[0.0, 1.0, 0.2]]}
    full = Problem.of(scene(ALL, {"motion": torque}))
    effects, switched = full.effective_effects(), compile_system(full)
    assert "hub_coupling" in effects
    for name in ("coriolis", "centrifugal", "euler", "tip_mass", "gravity"):
        values = []
        switched.leave_out({name})
        for system in (compile_system(full.replace(effects=tuple(e for e in effects if e != name))), switched):
            system.angle.values[:] = (0.3, 2.0, 1.0)
            state_of(system.held, 0.5)
            values.append(system.row.residual(0.5))
        assert values[1] == pytest.approx(values[0], rel=1e-12)  # rounding
    switched.leave_out({"hub_coupling"})
    assert switched.hub is not None
    assert not switched.row.coupled


def test_a_theory_is_tried_out_on_the_system_of_its_prestressed_twin() -> None:
    """Residual and tangent of the linear theory, gravity and base acceleration stretching the beam, to rounding."""
    full = scene(ALL, {"loads": {"gravity": [-5.0, 0.0, 0.0]}})
    trial = Trial(case_of(full), (HISTORY,))
    linear, twin = (trial.candidate(theory) for theory in ("linear", "consistent_linear"))
    assert linear.system is twin.system
    alone = state_of(compile_system(Problem.of(full).replace(theory="linear", mesh=trial.case.problem.mesh)), 1.3)
    size = np.abs(alone).max()
    assert np.abs(state_of(linear.switched(), 1.3) - alone).max() < 1e-12 * size
    assert np.abs(state_of(twin.switched(), 1.3) - alone).max() > 1e-9 * size
    assert trial.candidate("reissner").system is not twin.system


@pytest.fixture
def add() -> Iterator[Callable[[Any], None]]:
    """Registers for the length of a test."""
    added: list[Any] = []

    def add_one(entry: Any) -> None:
        register(entry)
        added.append(entry)

    yield add_one
    for entry in added:
        entry.registry.remove(entry.name)


# --- estimates ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tables",
    [pytest.param(SPIN_UP, id="thin"), pytest.param(ALL | {"loads": {}}, id="thick", marks=pytest.mark.nightly)],
)
def test_estimates_are_within_a_factor_three(tables: dict[str, Any]) -> None:
    """Every change above 1e-8 (below it, rounding of the two solutions), and none above 1 % is called negligible.

    The error of a mesh is a third of the difference to half the cells: of cubic elements, which converge with order 6,
    up to 21 times the true one (docs/theory.md, section 18). It counts above 1e-6.
    """
    result = rotfem.explain(scene(tables), check=True)
    compared = 0
    for row in result.rows:
        assert set(row["truth"]) == {HISTORY, MODES}
        for name, truth in row["truth"].items():
            estimate = row["estimate"][name]
            told = 1e-6 if row["name"] == "mesh.elements" else 1e-8
            if max(truth, estimate) < told or min(truth, estimate) == np.inf:
                continue
            over = (4**3 - 1) / 3 if row["name"] == "mesh.elements" else 1.0
            assert truth / 3 < estimate < 3 * over * truth, (row["name"], name)
            compared += 1
        if max(row["truth"].values()) > NOTICEABLE:
            assert row["verdict"] != "negligible"
    assert compared >= 12
    assert {row["name"] for row in result.rows if row["verdict"] == "large"} >= {"euler"}


def test_change_by_a_theory_is_that_of_spectral_histories() -> None:
    """The tip at t = 7 s of the spin-up to 6 rad/s, from converged Legendre–Galerkin histories of both theories.

    |Δu|/|u| = 0.032756985; the coarse steps of the trial make up the tolerance.
    """
    spin_up = scene(SPIN_UP, {"motion.speed": 6.0, "motion.duration": 15.0, "time.end": 20.0})
    trial = Trial(case_of(spin_up), (HISTORY,))
    estimates = Estimates(trial, "reissner", spin_up.effective_effects())
    change = estimates.replaced("consistent_linear")
    times = np.linspace(0.0, 20.0, len(estimates.own.tip))
    exact, linear = (
        np.array([np.interp(7.0, times, u) for u in trial.outputs(theory).tip.T])
        for theory in ("reissner", "consistent_linear")
    )
    assert np.linalg.norm(linear - exact) / np.linalg.norm(exact) == pytest.approx(0.032756985, rel=1e-3)
    assert 0.0327 < change.estimate[HISTORY] < 0.0335  # largest, over the largest |u|: a little before 7 s
    diverging = estimates.replaced("linear")
    assert np.isinf(diverging.worst)
    assert diverging.verdict == "large"
    assert "diverges" in diverging.notes[HISTORY]


def test_changes_of_frequencies_are_those_of_a_spectral_method() -> None:
    """L/r = 30 at η = 4 (lag and axial), from Legendre–Galerkin frequencies about the exact and the unstretched state.

    Six elements of degree 3 have the fourth frequency to 1e-5, its change to better than 1e-3.
    """
    thick = {"EA": 900.0, "GA": 900.0 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1 / 900}
    tables = {
        "structure": {"type": "planar_beam", "length": 1.0, "section": thick},
        "motion": {"type": "constant", "speed": 4.0},
        "modes": {"count": 4},
    }
    rows = {row["name"]: row for row in rotfem.explain(tables).rows}
    exact = np.array([3.76847438954, 22.3489324515, 47.636876692, 55.2636353457])
    without = np.array([3.81966748471, 22.4044524801, 46.9538176323, 55.2978247828])
    unstretched = np.array([3.78734752635, 22.4372627458, 47.6372192198, 55.4788584972])
    for name, other in (("coriolis", without), ("consistent_linear", unstretched)):
        expected = float(np.max(np.abs(other / exact - 1)))
        assert rows[name]["estimate"][MODES] == pytest.approx(expected, rel=5e-3), name


def test_row_of_the_steps_is_their_true_error() -> None:
    """Steps of 0.04 s, against those of a quarter: what is left of the latter is a sixteenth."""
    scene = Scene.from_dict({"structure": STRUCTURE, **COARSE_STEPS})
    estimates = Estimates(Trial(case_of(scene)), "reissner", case_of(scene).problem.effective_effects())
    row, _ = estimates.discretisations()
    rough = rotfem.run(scene).history
    fine = rotfem.run(scene.replace({"time.step": 0.01, "time.output_every": 4})).history
    tips = [np.column_stack([h["tip_u1"], h["tip_u2"]]) for h in (fine, rough)]
    assert row.estimate[HISTORY] == pytest.approx(tip_change(*tips), rel=0.5)
    assert row.name == "time.step"


@pytest.mark.parametrize("time", [{"time": COARSE_STEPS["time"]}, {}], ids=["history", "steady"])
def test_row_of_the_mesh_is_what_a_run_says_of_it(time: dict[str, Any]) -> None:
    """The trial has six of the ten elements, but the error is that of a march or a steady state on all ten."""
    motion = COARSE_STEPS["motion"] if time else {"type": "constant", "speed": 3.0}
    tables = {"structure": STRUCTURE, "motion": motion, "loads": {"tip_force": [0.0, 10.0]}, **time}
    tables["initial"] = {"state": "undeformed"}
    scene = Scene.from_dict({**tables, "modes": {"count": 2}, "mesh": {"elements": 10, "degree": 2}})
    trial = Trial(case_of(scene))
    row = Estimates(trial, "reissner", trial.effects).discretisations()[-1]
    assert row.name == "mesh.elements"
    assert trial.case.problem.mesh.elements == 6
    assert row.estimate[trial.wanted[0]] == pytest.approx(rotfem.run(scene).summary["error"]["space"], rel=0.05)
    rough, fine = (
        np.array([row["frequency"] for row in rotfem.modes(s).rows])
        for s in (scene, scene.replace({"mesh.elements": 20}))
    )
    assert 0.5 < row.estimate[MODES] / np.max(np.abs(fine / rough - 1)) < 6.0  # order 4 is (16 - 1)/3 of order 2


def test_overdamped_modes_are_compared_by_their_slow_eigenvalues() -> None:
    """A hinge with a damper has a mode that does not vibrate. Its fast eigenvalue is the mesh's, 1e5 times as large.

    What the effects change is what they change on twice the elements, where other modes come between.
    """
    root = {"lag_stiffness": 400.0, "lag_damping": 15.0, "hinge_offset": 0.2}
    section = {"E": 6.9e10, "nu": 0.3, "rho": 2766.0, "area": 7.3e-5, "second_moment": 8.22e-9}
    hinged = {"type": "planar_beam", "length": 6.0, "section": section, "hub_radius": 0.3, "root": root}
    scene = Scene.from_dict(
        {"structure": hinged, "motion": {"type": "constant", "speed": 7.0}, "mesh": {"elements": 4}}
    )
    rows = [rotfem.explain(scene.replace({"mesh.elements": n})).rows for n in (4, 8)]
    for rough, fine in zip(*rows, strict=True):
        if rough["kind"] == "effect":
            assert rough["estimate"][MODES] == pytest.approx(fine["estimate"][MODES], rel=0.1, abs=2e-4), rough["name"]
    values = Trial(case_of(scene), (MODES,)).outputs("reissner").values
    assert np.abs(values).max() < 1e3
    assert np.sum(values.imag == 0.0) == 1


#: A hub that is turned up to 0.5 rad/s, in a second and a half; its beam bends by a twentieth of its length.
TURNED = {"type": "torque", "hub_inertia": 200.0, "pulses": [[0.0, 1.5, 200.0]]}


@pytest.mark.parametrize("motion", [COARSE_STEPS["motion"], TURNED], ids=["prescribed", "free hub"])
def test_effects_of_a_reduced_model_are_those_of_trials(motion: Any) -> None:
    scene = Scene.from_dict({"structure": STRUCTURE, **COARSE_STEPS, "motion": motion})
    trial = Trial(case_of(scene), (HISTORY,))
    estimates = Estimates(trial, "reissner", trial.effects)
    assert set(estimates.reduced) == set(trial.effects)
    for name, size in estimates.reduced.items():
        tried = tip_change(estimates.own.tip, trial.outputs("reissner", {name}).tip)
        assert 1 / 3 < size / tried < 3


def test_no_reduced_model_tells_effects_on_large_motions() -> None:
    bent = Scene.from_dict({"structure": STRUCTURE, **COARSE_STEPS, "loads": {"tip_force": [0.0, 200.0]}})
    assert Estimates(Trial(case_of(bent)), "reissner", Trial(case_of(bent)).effects).reduced == {}


def test_sizes_that_depend_on_the_steps_of_a_reduced_model_are_left_to_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = {COARSE: {"same": 0.02, "growing": 0.04, "none": 1e-12}, 2 * COARSE: {"same": 0.019, "growing": 1e-3}}
    sizes[2 * COARSE]["none"] = 1e-14
    monkeypatch.setattr(reduced_effects, "Manifold", lambda response: None)
    monkeypatch.setattr(reduced_effects, "effect_sizes", lambda r, e, manifold, longer=COARSE: sizes[longer])
    response: Any = SimpleNamespace(solution=SimpleNamespace(parts=2 * COARSE, hub=None))
    assert set(reduced_effects.agreed(response, ())) == {"same", "none"}
    response.solution.parts = 1  # no steps are longer
    assert reduced_effects.agreed(response, ()) == sizes[COARSE]


def test_a_spin_down_starts_from_the_steady_state_of_its_speed() -> None:
    """While the speed is still constant nothing moves; u₁(L) = tan(kL)/k − L with k = Ω √(A_ρ/EA), the linear rod."""
    motion = {"type": "table", "table": [[0.0, 6.0], [1.0, 6.0], [5.0, 1.0]]}
    tables = {"structure": STRUCTURE, "motion": motion, "initial": {"state": "steady"}}
    scene = Scene.from_dict({**tables, "model": {"theory": "consistent_linear"}, "time": {"end": 1.0, "step": 0.05}})
    history = rotfem.run(scene).history
    k = 6.0 * np.sqrt(1.2 / 2.8e7)
    np.testing.assert_allclose(history["tip_u1"], np.tan(10 * k) / k - 10, rtol=1e-6)
    assert np.abs(history["tip_u2"]).max() < 1e-12


@pytest.mark.parametrize(
    "initial", [{"velocity": [[0, 0, 0], [10.0, 0, 1.0]]}, {"state": "steady", "mode": 1, "amplitude": 0.1}]
)
def test_a_trial_starts_in_motion_where_its_scene_does(initial: dict[str, Any]) -> None:
    """All that moves does since the start: without the spin nothing else of it would be there to be compared."""
    tables = {"structure": STRUCTURE, "motion": {"type": "constant", "speed": 3.0}, "mesh": {"elements": 4}}
    own = Scene.from_dict({**tables, "initial": initial, "time": {"end": 1.5, "step": 0.01}})
    trial = Trial(case_of(own), (HISTORY,))
    estimates = Estimates(trial, "reissner", trial.effects)
    true = tip_change(*(tip(rotfem.run(own.replace(left))) for left in ({}, {"model.effects": ["coriolis"]})))
    assert estimates.reduced == {}
    assert estimates.effect("centrifugal").estimate[HISTORY] == pytest.approx(true, rel=0.2)


def test_modes_of_a_free_hub_are_at_the_speed_it_reaches() -> None:
    """A torque M for T seconds on I_R + ρ L³/3 about the axis."""
    motion = {"type": "torque", "hub_inertia": 100.0, "pulses": [[0.0, 2.0, 300.0], [2.0, 3.0, -600.0]]}
    scene = Scene.from_dict({"structure": STRUCTURE, "motion": motion, "time": {"end": 4.0, "step": 0.02}})
    rigid = 1.2 * 10.0**3 / 3 + 6e-4 * 10.0  # with that of the sections
    assert Trial(case_of(scene)).speeds[0] == pytest.approx(300.0 * 2.0 / (100.0 + rigid), rel=2e-3)


def test_a_trial_in_which_newton_strays_is_made_in_shorter_steps() -> None:
    """Without Coriolis forces Newton strays to other roots from 0.5 s on, in steps twice as long as the scene's.

    The truth, 7.9e-4, is of twice the elements in half the steps by ESDIRK; there had been 3.7.
    """
    section = STRUCTURE["section"] | {"EI": 3.0e3}
    structure = STRUCTURE | {"length": 4.0, "section": section, "damping": {"kelvin_voigt": 1e-3}}
    load = [[0, 0, 0], [0.5, 0, 0], [0.5001, 0, 60.0], [2.0, 0, 60.0]]
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 3.0}, "loads": {"tip_force": load}}
    scene = Scene.from_dict({**tables, "mesh": {"elements": 4}, "time": {"end": 2.0, "step": 0.004}})
    trial = Trial(case_of(scene), (HISTORY,))
    assert 7.9e-4 / 3 < Estimates(trial, "reissner", trial.effects).effect("coriolis").estimate[HISTORY] < 3 * 7.9e-4


def test_steps_of_trials_are_as_long_as_their_error_allows() -> None:
    """Of second order: they are off by 10 % where those of the scene, 0.01 s, are by that over (step/0.01 s)²."""

    def steps(error: float) -> tuple[int, float]:
        trial = Trial(case_of(scene(SPIN_UP)), (HISTORY,))
        trial.fit(error)
        assert trial.samples is not None
        return int(trial.samples.parts.sum()), trial.samples.step

    number, step = steps(0.0)
    assert steps(0.1 * (0.01 / step) ** 2) == (number, step)
    assert steps(0.1 * (0.01 / step / 1.5) ** 2)[1] == pytest.approx(1.5 * step, rel=2 / number)
    assert steps(1e-9)[1] == pytest.approx(2 * step, rel=2 / number)  # never longer
    assert steps(0.1 * (0.01 / step * 2) ** 2)[0] == 2 * number
    for slightly in (1 / 1.013, 1.013, 1.4):  # not twice as many, whatever their number is rounded to
        assert steps(0.1 * (0.01 / step * slightly) ** 2)[0] == pytest.approx(slightly * number, rel=2 / number)


def test_an_estimate_does_not_depend_on_what_was_tried_before() -> None:
    """Newton's method learns of a model when to stop, which must not be when another model has converged."""
    stretched = case_of(scene(SPIN_UP, {"motion": {"type": "constant", "speed": 2.0}, "time": None}))
    alone, after = Trial(stretched), Trial(stretched)
    after.outputs("von_karman")
    expected, found = (trial.outputs("reissner") for trial in (alone, after))
    assert np.array_equal(found.tip, expected.tip)
    assert np.array_equal(found.values, expected.values)


def test_change_by_damping_is_the_damping_ratio() -> None:
    """A beam at rest with η: λ = ω(−ζ ± i√(1 − ζ²)), ζ = ηω/2, ω₁ = 3.79773 rad/s less 1.2e-4 by shear."""
    eta = 2e-3
    still = scene(SPIN_UP, {"motion": {"type": "constant", "speed": 0.0}, "time": None, "modes.count": 1})
    damped = still.replace({"structure.damping": {"kelvin_voigt": eta}})
    estimates = Estimates(Trial(case_of(damped), (MODES,)), "reissner", damped.effective_effects())
    change = estimates.effect("damping").estimate[MODES]
    assert change == pytest.approx(eta * 3.79773 / 2, rel=3e-4)


def test_what_a_user_registers_has_its_row_too(add: Callable[[Any], None]) -> None:
    """A drag c per length and velocity makes the damping ratio c/(2 m ω₁) of a beam at rest, ω₁ as above.

    A linear theory with the strains of another one changes what that one changes.
    """
    drag = 0.01

    def work(m: Any, delta: Any) -> Any:
        return sum(drag * ufl.inner(b.rate(m.k), delta.of(b)) * b.measure for b in m.positions())

    add(Effect("drag", work, reasons=("there is air", "there is no air"), constants=()))
    add(Theory("unstiffened", 0.5, Theory.registry["linear"].strains, linear=True))
    still = scene(SPIN_UP, {"motion": {"type": "constant", "speed": 0.0}, "time": None, "modes.count": 1})
    result = rotfem.explain(still, check=True)
    row = result.effects["drag"]
    assert row["estimate"][MODES] == pytest.approx(drag / (2 * 1.2 * 3.79773), rel=3e-4)
    assert row["estimate"][MODES] == pytest.approx(row["truth"][MODES], rel=1e-3)
    assert row["why"].startswith("there is air; ")
    theories = result.theories
    assert list(theories)[:2] == ["linear", "unstiffened"]
    assert theories["unstiffened"]["estimate"] == theories["linear"]["estimate"]
    airless = rotfem.explain(still.replace({"model.effects": []}))
    assert not airless.effects["drag"]["included"]
    assert "not in model.effects" in airless.effects["drag"]["why"]


def test_an_effect_left_out_by_a_list_is_estimated_too() -> None:
    asked = scene(SPIN_UP, {"model.effects": ["centrifugal", "euler"], "model.theory": "consistent_linear"})
    rows = {row["name"]: row for row in rotfem.explain(asked).rows}
    assert not rows["coriolis"]["included"]
    assert rows["euler"]["included"]
    assert "not in model.effects" in rows["coriolis"]["why"]
    assert rows["coriolis"]["estimate"][HISTORY] > 0.0


def test_groups_of_the_spin_up() -> None:
    """ω₁ as above; r = √(EI/EA) = 0.02236 m; the largest rate of the spin-up is 2 · speed/duration."""
    heavy = scene(SPIN_UP, {"structure.tip_mass": 3.0, "structure.hub_radius": 2.0})
    numbers = rotfem.explain(scene(SPIN_UP)).summary["groups"]
    assert numbers["speed_ratio"] == pytest.approx(4.0 / 3.79773, rel=3e-4)
    assert numbers["slenderness"] == pytest.approx(10.0 / np.sqrt(1.4e4 / 2.8e7), rel=1e-12)
    assert numbers["spin_rate_change"] == pytest.approx(2.0 / 3.79773**2, rel=1e-3)
    assert "tip_mass_ratio" not in numbers
    more = rotfem.explain(heavy).summary["groups"]
    assert more["tip_mass_ratio"] == pytest.approx(0.25, rel=1e-12)
    assert more["hub_ratio"] == 0.2


def test_gravity_that_turns_leaves_the_modes() -> None:
    """There is no steady state, and without [time] no history: modes are about the equilibrium with gravity frozen."""
    changes = {"time": None, "motion": {"type": "constant", "speed": 1.0}, "loads": {"gravity": [0.0, -1.0]}}
    found = rotfem.explain(scene(ALL, changes)).summary
    assert found["outputs"] == ["modes"]
    assert any("gravity turns in the rotating frame: taken as at t = 0" in line for line in found["warnings"])


# --- choice ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("tolerance", "theory"), [(1e-1, "consistent_linear"), (1e-3, "reissner")])
def test_a_chosen_model_is_within_its_tolerance(tolerance: float, theory: str) -> None:
    gentle = {"motion.speed": 1.0}
    full = rotfem.run(scene(SPIN_UP, gentle))
    result = rotfem.run(scene(SPIN_UP, gentle | {"model.tolerance": tolerance}))
    choice = result.summary["choice"]
    assert choice["theory"] == result.summary["theory"] == theory
    assert tip_change(tip(full), tip(result)) <= choice["estimated_error"] <= tolerance
    left_out = set(scene(SPIN_UP).effective_effects()) - set(choice["effects"])
    assert left_out == {row["name"] for row in choice["dropped"] if row["kind"] == "effect"}
    assert "rotary_inertia" in left_out
    assert "euler" not in left_out
    assert result.summary["integrals"]["F"] < full.summary["integrals"]["F"]
    assert result.summary["scene"]["model"]["tolerance"] == tolerance


def test_theory_given_is_the_richest() -> None:
    asked = scene(SPIN_UP, {"model.theory": "consistent_linear", "model.tolerance": 1e-9})
    choice = choose(case_of(asked), (HISTORY,))
    assert choice.theory == choice.richest == "consistent_linear"
    assert choice.full
    assert np.isinf(choice.limit)


def test_modes_and_campbell_choose_by_frequency() -> None:
    """A tolerance of 1e-3 leaves out Coriolis forces (1e-4 of a thin beam's frequencies)."""
    asked = scene(SPIN_UP, {"model.tolerance": 1e-3})
    full, chosen = rotfem.modes(scene(SPIN_UP)), rotfem.modes(asked)
    assert "coriolis" not in chosen.summary["effects"]
    assert chosen.summary["warnings"] == []
    for a, b in zip(full.rows, chosen.rows, strict=True):
        assert b["frequency"] == pytest.approx(a["frequency"], rel=1e-3)
    speeds = [0.0, 2.0, 4.0]
    diagram, reference = rotfem.campbell(asked, speeds), rotfem.campbell(scene(SPIN_UP), speeds)
    assert diagram.summary["choice"]["theory"] == "consistent_linear"
    for label, branch in reference.branches().items():
        found = diagram.branches()[label]["frequency"]
        assert found[-1] == pytest.approx(branch["frequency"][-1], rel=1e-3)


def test_steady_state_is_chosen_by_its_tip() -> None:
    still = scene(
        ALL, {"motion": {"type": "constant", "speed": 1.5}, "loads": {"tip_force": [0.0, 0.05]}, "time": None}
    )
    trial = Trial(case_of(still))
    assert trial.wanted == (STEADY, MODES)
    result = rotfem.run(still.replace({"model.tolerance": 1e-2}))
    full = rotfem.run(still)
    assert tip_change(tip(full), tip(result)) < 1e-2
    assert "coriolis" not in result.summary["effects"]  # nothing moves in the frame


# --- what leaves its range ------------------------------------------------------------------------------------------

#: A blow of 4 ms; the samples of a trial are 12 ms apart.
BLOW = {
    "loads": {"tip_force": [[0, 0, 0], [3.001, 0, 0], [3.003, 0, 4000.0], [3.005, 0, 0], [9.0, 0, 0]]},
    "motion.speed": 0.1,
    "time": {"end": 4.0, "step": 0.001, "output_every": 10},
    "model.tolerance": 1e-2,
}


@pytest.fixture
def blind(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let trials step over what the scene prescribes, and land on none of its knots."""

    def blindfolded(system: Any, *more: Any) -> March:
        system.courses = ()
        return March(system, *more)

    monkeypatch.setattr("rotfem.selection.coarse_model.given", lambda *_: [])
    monkeypatch.setattr("rotfem.selection.candidate.March", blindfolded)


@pytest.mark.usefixtures("blind")
def test_a_run_that_leaves_its_range_starts_again_with_a_richer_model() -> None:
    result = rotfem.run(scene(SPIN_UP, BLOW))
    choice = result.summary["choice"]
    upgrade = choice["upgrades"][0]
    assert (upgrade["from"], upgrade["to"]) == ("linear", "reissner")
    assert 3.0 < upgrade["time"] < 3.1
    assert any(
        "left the range" in text and "started again with reissner" in text for text in result.summary["warnings"]
    )
    full = rotfem.run(scene(SPIN_UP, BLOW | {"model.tolerance": None}))
    assert np.array_equal(tip(result), tip(full))


@pytest.mark.usefixtures("blind")
def test_a_run_that_leaves_its_range_stops_or_warns() -> None:
    with pytest.raises(ComputationError, match="left the range of its model") as caught:
        rotfem.run(scene(SPIN_UP, BLOW | {"model.on_exceed": "stop"}))
    assert caught.value.result.history["t"][-1] < 3.1  # type: ignore[attr-defined]
    result = rotfem.run(scene(SPIN_UP, BLOW | {"model.on_exceed": "warn"}))
    assert result.summary["theory"] == "linear"
    assert result.history["t"][-1] == 4.0
    assert [text for text in result.summary["warnings"] if "left the range" in text]


#: The same blow on a beam at rest, and on one that spins in its equilibrium, stretched but not bent.
AT_REST = BLOW | {"motion": {"type": "constant", "speed": 0.0}}
STRETCHED = BLOW | {"motion": {"type": "constant", "speed": 2.0}, "initial": {"state": "steady"}}


@pytest.mark.usefixtures("blind")
@pytest.mark.parametrize("changes", [AT_REST, STRETCHED], ids=["at rest", "stretched"])
def test_a_model_chosen_for_no_motion_or_another_is_given_up(changes: dict[str, Any]) -> None:
    """A hundredth of the blow: an estimate of 0 or of round-off must not allow any bending that was not tried out."""
    weak = [[0, 0, 0], [3.001, 0, 0], [3.003, 0, 40.0], [3.005, 0, 0], [9.0, 0, 0]]
    asked = scene(SPIN_UP, changes | {"loads": {"tip_force": weak}})
    result = rotfem.run(asked)
    assert result.summary["choice"]["upgrades"][0]["from"] == "linear"
    assert tip_change(tip(rotfem.run(asked.replace({"model.tolerance": None}))), tip(result)) < 1e-2


@pytest.mark.parametrize("as_function", [False, True], ids=["table", "function"])
@pytest.mark.parametrize("changes", [BLOW, AT_REST, STRETCHED], ids=["spin-up", "at rest", "stretched"])
def test_a_trial_sees_a_blow_between_its_samples(changes: dict[str, Any], as_function: bool) -> None:
    """The largest deflection, of the trial against the run: its steps do not resolve all that the blow sets ringing."""
    asked = scene(SPIN_UP, changes | {"model.tolerance": None})
    rows = np.array(BLOW["loads"]["tip_force"])  # type: ignore[index]
    if as_function:
        force = lambda t: [np.interp(t, rows[:, 0], rows[:, i]) for i in (1, 2)]  # noqa: E731
        asked = asked.replace({"loads": {"tip_force": force}})
    trial = Trial(case_of(asked), (HISTORY,))
    samples = trial.samples
    assert samples is not None
    assert samples.step > 0.01
    assert samples.parts.max() >= 4
    assert samples.parts.sum() < 1.5 * len(samples.parts)  # shorter steps at the blow only
    full = np.abs(tip(rotfem.run(asked))[:, 1]).max()
    assert np.abs(trial.outputs("reissner").tip[:, 1]).max() == pytest.approx(full, rel=0.15)


@pytest.mark.parametrize("changes", [BLOW, AT_REST, STRETCHED], ids=["spin-up", "at rest", "stretched"])
def test_a_blow_does_not_cost_the_tolerance(changes: dict[str, Any]) -> None:
    result = rotfem.run(scene(SPIN_UP, changes))
    full = rotfem.run(scene(SPIN_UP, changes | {"model.tolerance": None}))
    assert tip_change(tip(full), tip(result)) < 1.2e-2  # trials do not resolve what the blow sets ringing
    assert "upgrades" not in result.summary["choice"]  # seen beforehand


def chosen(error: float, errors: dict[str, float], sizes: Any, everything: tuple[str, ...]) -> Choice:
    """Return a choice of the linear theory without effects, for a tolerance of 1e-3."""
    return Choice(
        theory="linear",
        effects=(),
        tolerance=1e-3,
        richest="reissner",
        everything=everything,
        estimated_error=error,
        errors=errors,
        sizes=sizes,
    )


def test_the_next_richer_model_is_the_first_that_holds() -> None:
    errors = {"linear": 1e-4, "consistent_linear": 1e-6, "reissner": 0.0}
    everything = ("coriolis", "centrifugal")
    choice = chosen(1.5e-3, errors, np.array([0.01, 0.1]), everything)
    assert choice.limits == pytest.approx(np.sqrt(2.0) * choice.sizes)  # 5e-4 (s/0.1)² = 1e-3
    near, far = (choice.richer(np.array([0.01, s]), 1.0, "why") for s in (0.5, 2.0))
    assert (near.theory, near.effects) == ("consistent_linear", everything)
    assert near.size == 0.5
    assert near.check(np.array([0.01, 0.6])) == ""
    assert far.theory == "reissner"
    assert far.full
    assert far.check(np.array([1e9, 1e9])) == ""


def test_no_choice_is_trusted_far_beyond_what_was_tried_out() -> None:
    """Estimates of 0 and of round-off, and components that did not move; 1e-3/3 of the motion cannot be felt."""
    errors = {"linear": 0.0, "consistent_linear": 1e-12, "reissner": 0.0}
    for estimate in (0.0, 1e-14):
        still = chosen(estimate, errors, np.zeros(3), ("coriolis",))
        assert still.check(np.full(3, 1e-15)) == ""
        assert still.check(np.array([0.0, 1e-9, 0.0])) != ""
        assert still.richer(np.array([0.0, 1e-9, 0.0]), None, "why").theory == "reissner"
        stretched = chosen(estimate, errors, np.array([1e-5, 0.0, 0.0]), ())
        assert stretched.limit == pytest.approx(3e-5)
        assert stretched.check(np.array([2e-5, 1e-9, 0.0])) == ""
        assert stretched.check(np.array([0, 1e-8, 0])) != ""
        assert stretched.richer(np.array([4e-5, 0.0, 0.0]), None, "why").theory == "consistent_linear"
        # 3 · 1e-9 (as good as unknown) times 1000² is above the tolerance.
        assert stretched.richer(np.array([1e-2, 0.0, 0.0]), None, "why").theory == "reissner"


# --- what a trial takes ---------------------------------------------------------------------------------------------


def test_a_trial_takes_no_more_steps_than_the_scene() -> None:
    """A release from 0.6 L: the samples that its modes ask for may be met with as many steps as it has, not more."""
    changes = {"motion": {"type": "constant", "speed": 1.0}, "initial": {"tip_displacement": 6.0}}
    asked = scene(SPIN_UP, changes | {"time": {"end": 8.0, "step": 0.01}})
    trial = Trial(case_of(asked), (HISTORY,))
    samples = trial.samples
    assert samples is not None
    assert samples.own == 800
    assert samples.levels[-1] == 2
    assert trial.outputs("reissner").failed == {}
    assert all(np.maximum(samples.parts, finer).sum() <= 800 for finer in samples.levels)
    assert trial.finer <= 2


def test_a_failing_eigenproblem_at_rest_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise ComputationError("an eigenpair has the backward error 1, above 0")

    monkeypatch.setattr("rotfem.selection.coarse_model.Pencil.solve", fail)
    result = rotfem.explain(scene(SPIN_UP))
    rows = {row["name"]: row for row in result.rows}
    assert np.isinf(rows["euler"]["estimate"][MODES])
    assert "backward error" in rows["euler"]["notes"][MODES]
    assert rows["euler"]["estimate"][HISTORY] == pytest.approx(1.0, abs=0.1)
    assert any("frequencies at rest cannot be computed" in text for text in result.summary["warnings"])
    assert "speed_ratio" not in result.summary["groups"]
    chosen = rotfem.run(scene(SPIN_UP, {"motion.speed": 1.0, "model.tolerance": 1e-1}))
    assert chosen.summary["theory"] == "consistent_linear"


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"model.effects": ["euler"]}, 'needs effects = "auto"'),
        ({"model.frame": "inertial"}, 'needs frame = "rotating"'),
        ({"model.on_exceed": "ignore"}, "model.on_exceed"),
    ],
)
def test_a_tolerance_that_cannot_be_kept_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        scene(SPIN_UP, {"model.tolerance": 1e-2} | changes)
