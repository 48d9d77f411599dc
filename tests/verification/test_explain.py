"""What explain says against closed forms, spectral solutions and runs."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import ufl

import rotfem
from rotfem.commands.explain import HISTORY, MODES, NOTICEABLE, RESOLVED
from rotfem.commands.printed import report
from rotfem.commands.problem import Problem
from rotfem.equations.compiled import compile_system
from rotfem.mechanics.effects import Effect
from rotfem.mechanics.theories import Theory
from rotfem.registry import register
from rotfem.scene import Scene
from tests.beams import STRUCTURE

pytestmark = pytest.mark.estimated

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


def distance(one: Any, other: Any) -> float:
    return float(np.linalg.norm(one - other, axis=1).max() / np.linalg.norm(one, axis=1).max())


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


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
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


def rows_of(tables: Any) -> dict[str, dict[str, Any]]:
    return {row["name"]: row for row in rotfem.explain(tables).rows}


def test_without_speed_coriolis_and_centrifugal_forces_change_nothing() -> None:
    """A hub that does not turn before the end of the history: the terms are there, and zero."""
    motion = {"type": "table", "table": [[0.0, 0.0], [1.5, 0.0], [2.0, 1.0]]}
    loads = {"tip_force": [[0.0, 0.0, 0.0], [0.5, 0.0, 5.0]]}
    rows = rows_of({"structure": STRUCTURE, "motion": motion, "loads": loads, "time": {"end": 1.0, "step": 0.02}})
    for name in ("coriolis", "centrifugal", "euler"):
        assert rows[name]["estimate"][HISTORY] < RESOLVED  # where increments of Newton's method end
        assert rows[name]["estimate"][MODES] == 0.0
        assert rows[name]["verdict"] == "negligible"
    assert rows["rotary_inertia"]["worst"] > 0.0


def test_centrifugal_row_of_a_hinged_rigid_blade() -> None:
    """ω² = k/I + 3/2 (e/L) Ω² of a rigid uniform blade on a lag spring k at e from the axis, I = ρ L³/3."""
    section = {"EA": 1e8, "GA": 1e8, "EI": 1e8, "mass_per_length": 3.0, "rotary_inertia": 0.0}
    structure = {"type": "planar_beam", "length": 2.0, "hub_radius": 0.5, "section": section}
    structure["root"] = {"lag_stiffness": 80.0}
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 4.0}, "modes": {"count": 1}}
    at_rest, spinning = 80.0 / (3.0 * 2.0**3 / 3), 80.0 / (3.0 * 2.0**3 / 3) + 1.5 * (0.5 / 2.0) * 4.0**2
    rows = rows_of(tables)
    assert rows["centrifugal"]["estimate"][MODES] == pytest.approx(1 - np.sqrt(at_rest / spinning), rel=1e-4)
    assert rows["linear"]["verdict"] == "large"  # −Ω² softens it, and no stress stiffens it


def test_rows_of_a_blade_whose_hinge_nothing_holds() -> None:
    """Its zero eigenvalue is round-off, which is not compared with itself.

    Without stress stiffness it is ±Ω.
    """
    structure = {**STRUCTURE, "hub_radius": 0.0, "root": {"lag_stiffness": 0.0}}
    tables = {"structure": structure, "mesh": {"elements": 4}, "modes": {"count": 3}}
    for speed, changed in ((0.0, set[str]()), (2.0, {"centrifugal", "linear"})):
        found = rotfem.explain(tables | {"motion": {"type": "constant", "speed": speed}})
        rows = {row["name"]: row["estimate"][MODES] for row in found.rows}
        assert {name for name, change in rows.items() if change > 0.03} == changed


FORCE = {"tip_force": {"over_time": [[0, 0, 0], [0.5, 0, 30.0], [2.0, 0, 0]], "kind": "follower"}}


@pytest.mark.parametrize(
    "changes",
    [
        {"motion": {"type": "spin_up", "speed": 4.0, "duration": 4.0}, "time.end": 5.0},
        {"initial": {"state": "steady", "mode": 1, "amplitude": 0.1}},
        {"initial": {"tip_displacement": 0.5}},
        {"loads": FORCE},
        {"loads": {"gravity": [0.0, -9.81]}},
    ],
    ids=["spin-up", "mode", "released", "follower", "gravity that turns"],
)
def test_rows_are_the_distances_of_two_runs(changes: dict[str, Any]) -> None:
    """Of histories, of starts and loads, and of modes; none above 1 % is called negligible."""
    still = {"motion": {"type": "constant", "speed": 2.0}, "mesh.elements": 4, "time.end": 2.0, "output.error": False}
    own = scene(SPIN_UP, {**still, **changes})
    result = rotfem.explain(own)
    for row in (row for row in result.rows if row["worst"] < np.inf):
        kept = [name for name in result.summary["effects"] if name != row["name"]]
        other = own.replace({"model.effects": kept} if row["kind"] == "effect" else {"model.theory": row["name"]})
        true = {HISTORY: distance(tip(rotfem.run(own)), tip(rotfem.run(other)))}
        if "loads" not in changes:
            one, two = (rotfem.modes(asked).frequencies for asked in (own, other))
            true[MODES] = float(np.max(np.abs(two / one - 1.0)))
        for name, truth in true.items():
            assert truth / 3 - 1e-6 <= row["estimate"][name] <= 3 * truth + 1e-6, (row["name"], name)
        if max(true.values()) > NOTICEABLE:
            assert row["verdict"] != "negligible"


def test_change_by_a_theory_is_that_of_spectral_histories() -> None:
    """The tip at t = 7 s of the spin-up to 6 rad/s, from converged Legendre–Galerkin histories of both theories.

    |Δu|/|u| = 0.032756985 there, and the largest over the largest |u| is met a little before. The linear theory has no
    stiffness left.
    """
    rows = rows_of(scene(SPIN_UP, {"motion.speed": 6.0, "motion.duration": 15.0, "time.end": 20.0}))
    assert 0.0327 < rows["consistent_linear"]["estimate"][HISTORY] < 0.0335
    diverging = rows["linear"]
    assert np.isinf(diverging["worst"])
    assert diverging["verdict"] == "large"
    assert "diverges" in diverging["notes"][HISTORY]


def test_changes_of_frequencies_are_those_of_a_spectral_method() -> None:
    """L/r = 30 at η = 4 (lag and axial), from Legendre–Galerkin frequencies about the exact and the unstretched state.

    Ten elements of degree 3, so five, have the fourth frequency to 1e-4, and its change to better.
    """
    thick = {"EA": 900.0, "GA": 900.0 / 3.059, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1 / 900}
    tables = {
        "structure": {"type": "planar_beam", "length": 1.0, "section": thick},
        "motion": {"type": "constant", "speed": 4.0},
        "modes": {"count": 4},
    }
    rows = rows_of(tables)
    exact = np.array([3.76847438954, 22.3489324515, 47.636876692, 55.2636353457])
    without = np.array([3.81966748471, 22.4044524801, 46.9538176323, 55.2978247828])
    unstretched = np.array([3.78734752635, 22.4372627458, 47.6372192198, 55.4788584972])
    for name, other in (("coriolis", without), ("consistent_linear", unstretched)):
        expected = float(np.max(np.abs(other / exact - 1)))
        assert rows[name]["estimate"][MODES] == pytest.approx(expected, rel=5e-3), name


def test_overdamped_modes_are_compared_by_their_slow_eigenvalues() -> None:
    """A hinge with a damper has a mode that does not vibrate. Its fast eigenvalue is the mesh's, 1e5 times as large.

    What the effects change is what they change on more elements, where other modes come between.
    """
    root = {"lag_stiffness": 400.0, "lag_damping": 15.0, "hinge_offset": 0.2}
    section = {"E": 6.9e10, "nu": 0.3, "rho": 2766.0, "area": 7.3e-5, "second_moment": 8.22e-9}
    hinged = {"type": "planar_beam", "length": 6.0, "section": section, "hub_radius": 0.3, "root": root}
    scene = Scene.from_dict(
        {"structure": hinged, "motion": {"type": "constant", "speed": 7.0}, "mesh": {"elements": 8}}
    )
    rows = [rotfem.explain(scene.replace({"mesh.elements": n})).rows for n in (6, 8)]
    for rough, fine in zip(*rows, strict=True):
        if rough["kind"] == "effect":
            assert rough["estimate"][MODES] == pytest.approx(fine["estimate"][MODES], rel=0.1, abs=2e-4), rough["name"]


def test_modes_of_a_free_hub_are_at_the_speed_it_reaches() -> None:
    """A torque M for T seconds on I_R + ρ L³/3 about the axis."""
    motion = {"type": "torque", "hub_inertia": 100.0, "pulses": [[0.0, 2.0, 300.0], [2.0, 3.0, -600.0]]}
    tables = {"structure": STRUCTURE, "mesh": {"elements": 2}, "modes": {"count": 2}}
    scene = Scene.from_dict({**tables, "motion": motion, "time": {"end": 4.0, "step": 0.04}})
    rigid = 1.2 * 10.0**3 / 3 + 6e-4 * 10.0  # with that of the sections
    assert rotfem.explain(scene).summary["speeds"] == pytest.approx([300.0 * 2.0 / (100.0 + rigid)], rel=2e-3)


def test_newton_does_not_stray_in_long_steps() -> None:
    """Without Coriolis forces Newton strays to other roots from 0.5 s on, in steps twice as long as the scene's.

    The truth, 7.9e-4, is of twice the elements in half the steps by ESDIRK; there had been 3.7.
    """
    section = STRUCTURE["section"] | {"EI": 3.0e3}
    structure = STRUCTURE | {"length": 4.0, "section": section, "damping": {"kelvin_voigt": 1e-3}}
    load = [[0, 0, 0], [0.5, 0, 0], [0.5001, 0, 60.0], [2.0, 0, 60.0]]
    tables = {"structure": structure, "motion": {"type": "constant", "speed": 3.0}, "loads": {"tip_force": load}}
    rows = rows_of({**tables, "mesh": {"elements": 4}, "time": {"end": 2.0, "step": 0.004}})
    assert 7.9e-4 / 3 < rows["coriolis"]["estimate"][HISTORY] < 3 * 7.9e-4


def test_change_by_damping_is_the_damping_ratio() -> None:
    """A beam at rest with η: λ = ω(−ζ ± i√(1 − ζ²)), ζ = ηω/2, ω₁ = 3.79773 rad/s less 1.2e-4 by shear."""
    eta = 2e-3
    still = scene(SPIN_UP, {"motion": {"type": "constant", "speed": 0.0}, "time": None, "modes.count": 1})
    rows = rows_of(still.replace({"structure.damping": {"kelvin_voigt": eta}}))
    assert rows["damping"]["estimate"][MODES] == pytest.approx(eta * 3.79773 / 2, rel=3e-4)


def test_change_by_damping_that_long_steps_hide() -> None:
    """Steps damp and delay the undamped vibration of a beam in gusts more than the damped one."""
    section = {"EA": 2.2e8, "GA": 7.0e7, "EI": 2.0e4, "mass_per_length": 8.0, "rotary_inertia": 9e-4}
    beam = {"type": "planar_beam", "length": 4.2, "hub_radius": 0.3, "section": section}
    gusts = [[0, 0, 0], [4, 0, 20.0], [9, 0, -10.0], [12, 0, 25.0]]
    asked = Scene.from_dict(
        {
            "structure": {**beam, "damping": {"rayleigh": [0.5, 5e-5]}},
            "motion": {"type": "constant", "speed": 4.0},
            "model": {"theory": "consistent_linear"},
            "loads": {"distributed": {"over_time": gusts}},
            "initial": {"state": "undeformed"},
            "mesh": {"elements": 2},
            "time": {"end": 12.0, "step": 0.03},
        }
    )
    finer = asked.replace({"time.scheme": "esdirk4", "output.error": False})
    undamped = finer.replace({"structure.damping": None})
    true = distance(tip(rotfem.run(finer)), tip(rotfem.run(undamped)))
    found = rows_of(asked)["damping"]["estimate"][HISTORY]
    assert 1 / 3 < found / true < 3


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
    result = rotfem.explain(still)
    row = result.effects["drag"]
    assert row["estimate"][MODES] == pytest.approx(drag / (2 * 1.2 * 3.79773), rel=3e-4)
    assert row["why"].startswith("there is air; ")
    theories = result.theories
    assert list(theories)[:2] == ["linear", "unstiffened"]
    assert theories["unstiffened"]["estimate"] == theories["linear"]["estimate"]
    airless = rotfem.explain(still.replace({"model.effects": []}))
    assert not airless.effects["drag"]["included"]
    assert "not in model.effects" in airless.effects["drag"]["why"]


def test_gravity_that_turns_leaves_the_modes() -> None:
    """There is no steady state, and without [time] no history: modes are about the equilibrium with gravity frozen."""
    changes = {"time": None, "motion": {"type": "constant", "speed": 1.0}, "loads": {"gravity": [0.0, -1.0]}}
    found = rotfem.explain(scene(ALL, changes)).summary
    assert found["outputs"] == ["modes"]
    assert any("gravity turns in the rotating frame: taken as at t = 0" in line for line in found["warnings"])


def test_an_own_model_that_fails_is_reported() -> None:
    result = rotfem.explain(scene(SPIN_UP, {"model.theory": "linear", "motion.speed": 9.0}))
    coriolis = next(line for line in report(result) if line.startswith("without coriolis"))
    assert coriolis.split()[2] == "inf"
    assert all(set(row["estimate"]) == {HISTORY, MODES} for row in result.rows)
    assert "estimate_modes" in result.texts()["explain.csv"]
    result.drawings()["explain.png"]()


def test_a_history_in_a_plane_is_explained_with_the_modes_of_all_unknowns() -> None:
    """A plate that spins up moves in its plane alone; its modes bend out of it."""
    plate = {"type": "plate", "length": 2.0, "width": 0.6, "thickness": 0.01, "E": 7e9, "nu": 0.3, "rho": 2700.0}
    scene = {"structure": plate, "motion": {"type": "spin_up", "speed": 3.0, "duration": 0.24}, "modes": {"count": 2}}
    scene |= {"model": {"theory": "consistent_linear"}, "mesh": {"elements": [2, 1]}}
    found = rotfem.explain({**scene, "time": {"end": 0.12, "step": 0.04}})
    stiffened = next(row for row in found.rows if row["name"] == "linear")
    first = [
        rotfem.modes({**scene, "motion": {"type": "constant", "speed": 3.0}, "model": {"theory": name}}).frequencies[0]
        for name in ("linear", "consistent_linear")
    ]
    assert stiffened["estimate"][MODES] == pytest.approx(1 - first[0] / first[1], rel=0.05)


def test_the_model_that_a_scene_needs_gives_the_answer_of_the_whole_one() -> None:
    """What is left out changes the tip by no more than a quarter of the accuracy, as two full runs have it."""
    asked = scene(SPIN_UP)
    result = rotfem.explain(asked)
    found = result.summary["needed"]
    assert set(found["dropped"]) == {"coriolis", "rotary_inertia"}
    assert {"centrifugal", "euler"} <= set(found["effects"])
    own, needed = (tip(rotfem.run(asked.replace(changes))) for changes in ({}, result.needed))
    assert 0.0 < distance(own, needed) <= 0.25 * found["accuracy"]
    assert found["change"] <= 0.25 * found["accuracy"]
    exact = rotfem.explain(asked.replace({"accuracy": 1e-8})).summary["needed"]
    assert exact["dropped"] == []
    assert exact["theory"] == "reissner"


def test_an_accuracy_leaves_out_what_it_does_not_need() -> None:
    """The answer without these effects is within the accuracy of a fine answer with all of them."""
    asked = scene(SPIN_UP, {"time": {"end": 5.0, "output_step": 0.05}, "accuracy": 1e-2, "model.effects": "needed"})
    fine = {"accuracy": None, "model.effects": "auto", "time.tolerance": 1e-5, "mesh.elements": 8, "mesh.degree": 4}
    result, true = rotfem.run(asked), rotfem.run(asked.replace({**fine, "output.error": False}))
    assert set(result.summary["effects"]) == {"centrifugal", "euler"}
    assert set(result.summary["needed"]["dropped"]) == {"coriolis", "rotary_inertia"}
    error = result.summary["error"]
    assert 0.0 < error["effects"] <= 0.25e-2
    assert distance(tip(true), tip(result)) <= error["total"] <= 1e-2
    assert any("left out for the accuracy: " in line for line in report(result))
    with pytest.raises(rotfem.SceneError, match="needs accuracy"):
        rotfem.run(scene(SPIN_UP, {"model.effects": "needed"}))
