"""Effects: what is off leaves no term behind, "auto" is what the scene needs, and dropping one has its consequence."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import Scene, registry, run
from rotfem.commands.problem import Problem
from rotfem.equations.model import Model

Array = npt.NDArray[np.float64]

#: A planar beam with data for every effect of a prescribed motion; trapeze and supports are of spatial ones.
ALL: dict[str, Any] = {
    "structure.damping.kelvin_voigt": 0.01,
    "structure.tip_mass": 0.2,
    "structure.root": {"lag_stiffness": 50.0, "lag_damping": 0.1},
    "motion": {"type": "spin_up", "speed": 3.0, "duration": 1.0, "base_acceleration": [0.2, 0.1]},
    "loads.gravity": [0.0, -0.3],
}
NOT_PLANAR = ("hub_coupling", "trapeze", "supports", "support_dampers", "couplings", "coupling_dampers")
PRESENT = tuple(name for name in registry.effects.names if name not in NOT_PLANAR)
TIME = {"end": 0.02, "step": 0.01}


@pytest.mark.parametrize("theory", ["consistent_linear", "reissner"])
@pytest.mark.parametrize("name", PRESENT)
def test_an_effect_that_is_off_leaves_nothing_behind(unit_beam: Any, theory: str, name: str) -> None:
    """Model without the effect: its term, its body and its frame constant are gone, and no other."""
    problem = Problem.of(unit_beam(ALL | {"model.theory": theory, "mesh.degree": 1}))
    assert problem.effective_effects() == PRESENT
    full, less = Model(problem), Model(without(problem, name))
    assert less.effects == tuple(e for e in PRESENT if e != name)
    if name in ("rotary_inertia", "tip_mass"):
        assert len(less.mechanics.bodies) == len(full.mechanics.bodies) - 1
        assert set(less.terms) == set(full.terms)
    else:
        assert set(full.terms) - set(less.terms) == {name}
        assert len(less.mechanics.bodies) == len(full.mechanics.bodies)
    used = {"euler": {"dw"}, "base": {"a_o"}, "gravity": {"gravity"}}.get(name, set())
    assert set(full.frame.constants) - set(less.frame.constants) == used
    assert "w" not in Model(without(problem, "coriolis", "centrifugal")).frame.constants


def without(problem: Problem, *names: str) -> Problem:
    """Return the problem with all effects but these."""
    return problem.replace(effects=tuple(e for e in PRESENT if e not in names))


@pytest.mark.parametrize(
    ("changes", "effects"),
    [
        ({}, {"rotary_inertia"}),
        ({"motion": {"type": "constant", "speed": 1.0}}, {"coriolis", "centrifugal", "rotary_inertia"}),
        (
            {"motion": {"type": "spin_up", "speed": 1.0, "duration": 1.0}},
            {"coriolis", "centrifugal", "euler", "rotary_inertia"},
        ),
        ({"structure.section.rotary_inertia": 0.0}, set()),
        ({"structure.tip_mass": 0.1}, {"rotary_inertia", "tip_mass"}),
        ({"loads.gravity": [0.0, -1.0]}, {"rotary_inertia", "gravity"}),
        ({"structure.damping.rayleigh": [0.1, 0.0]}, {"rotary_inertia", "damping"}),
        ({"motion.base_acceleration": [0.0, 1.0]}, {"rotary_inertia", "base"}),
    ],
)
def test_auto_is_what_the_scene_makes_non_zero(unit_beam: Any, changes: dict[str, Any], effects: set[str]) -> None:
    model = Model(Problem.of(unit_beam({**changes, "mesh": {"elements": 2, "degree": 1}})))
    assert set(model.effects) == effects
    assert set(model.terms) == {"internal", "inertia"} | (effects - {"rotary_inertia", "tip_mass"})
    assert len(model.mechanics.bodies) == 1 + len(effects & {"rotary_inertia", "tip_mass"})


def test_auto_drops_nothing_that_matters(unit_beam: Any) -> None:
    """All effects asked for by name give the same history as "auto", to the last digit."""
    for changes in ({}, {"motion": {"type": "spin_up", "speed": 2.0, "duration": 1.0}}):
        auto, everything = (
            run(unit_beam({**changes, "model.effects": e}, time={"end": 0.1, "step": 0.01})).history
            for e in ("auto", list(PRESENT))
        )
        for name in auto:
            np.testing.assert_array_equal(auto[name], everything[name])


# --- consequences ----------------------------------------------------------------------------------------------------


def tip(scene: Scene) -> dict[str, Array]:
    return run(scene).history


def test_without_euler_force_a_spin_up_does_not_bend(unit_beam: Any) -> None:
    """Only Ω̇ bends a beam that starts straight: without it u2 stays zero to round-off."""
    tables = {"motion": {"type": "spin_up", "speed": 1.0, "duration": 1.0}, "time": {"end": 0.5, "step": 0.01}}
    with_it = tip(unit_beam({}, **tables))
    without = tip(unit_beam({"model.effects": ["centrifugal", "rotary_inertia"]}, **tables))
    assert np.max(np.abs(with_it["tip_u2"])) > 1e-2
    assert np.max(np.abs(without["tip_u2"])) < 1e-12
    assert np.max(np.abs(without["tip_u1"])) > 1e-7  # the centrifugal force still stretches it


def test_without_centrifugal_force_there_is_no_stretch(unit_beam: Any) -> None:
    """Steady spin: u1 = tan(kL)/k − L with k = Ω√(A_rho/EA) = 0.1, exact; nothing without the centrifugal force."""
    spin = {"type": "constant", "speed": 2.0}
    k = 2.0 / 20.0
    assert tip(unit_beam(motion=spin))["tip_u1"][-1] == pytest.approx(np.tan(k) / k - 1, rel=1e-8)
    assert tip(unit_beam({"model.effects": ["coriolis"]}, motion=spin))["tip_u1"][-1] == 0.0


def test_without_coriolis_force_axial_and_lateral_motion_are_apart(unit_beam: Any) -> None:
    """Released at constant speed the axial motion bends the beam through the Coriolis force only."""
    tables = {"motion": {"type": "constant", "speed": 2.0}, "time": {"end": 0.3, "step": 0.005}}
    tables["initial"] = {"state": "undeformed"}
    with_it = tip(unit_beam({}, **tables))
    without = tip(unit_beam({"model.effects": ["centrifugal", "rotary_inertia"]}, **tables))
    assert np.max(np.abs(with_it["tip_u2"])) > 1e-5
    assert np.max(np.abs(without["tip_u2"])) < 1e-12
    assert np.max(np.abs(without["tip_u1"])) > 1e-3


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("gravity", {"loads.gravity": [0.0, -0.3]}),
        ("base", {"motion.base_acceleration": [0.0, 0.3]}),
    ],
)
def test_without_its_force_a_beam_at_rest_stays_straight(unit_beam: Any, name: str, changes: dict[str, Any]) -> None:
    assert tip(unit_beam(changes))["tip_u2"][-1] < -1e-2
    assert tip(unit_beam({**changes, "model.effects": ["rotary_inertia"]}))["tip_u2"][-1] == 0.0
