"""The indicator of a theory's own error against the error itself, and silence where the error is small."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import rotfem

LENGTH, EI = 10.0, 1.4e4
UNIT = EI / LENGTH**2  # N
APPROXIMATE = ("linear", "consistent_linear", "von_karman_linear", "second_order", "von_karman")


def beam(theory: str, loads: dict[str, Any], **tables: Any) -> dict[str, Any]:
    section = {"EA": 2.8e7, "GA": 1.0e7, "EI": EI, "mass_per_length": 1.2, "rotary_inertia": 6e-4}
    return {
        "structure": {"type": "planar_beam", "length": LENGTH, "section": section},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": theory},
        "mesh": {"elements": 12},
        "loads": loads,
        **tables,
    }


def tip(result: Any) -> Any:
    return np.array([result.history[f"tip_{name}"][-1] for name in ("u1", "u2")])


@cache
def exact_tip(scene: Any, *arguments: Any) -> Any:
    """Return the displacement of the tip in the exact theory, computed once for all others."""
    return tip(rotfem.run(scene("reissner", *arguments)))


def errors(scene: Any, theory: str, *arguments: Any) -> tuple[float, float, list[str]]:
    """Return the true error of the tip's displacement, relative to the exact one, its estimate, and the warnings."""
    found, exact = rotfem.run(scene(theory, *arguments)), exact_tip(scene, *arguments)
    true = float(np.linalg.norm(tip(found) - exact) / np.linalg.norm(exact))
    said = [line for line in found.summary["warnings"] if "model.theory" in line]
    return true, found.summary["theory_error"]["estimate"], said


def force(theory: str, axial: float, side: float) -> dict[str, Any]:
    return beam(theory, {"tip_force": [axial * UNIT, side * UNIT]})


def moment(theory: str, degrees: float) -> dict[str, Any]:
    return beam(theory, {"tip_moment": EI * np.radians(degrees) / LENGTH})


def spinning(theory: str, speed: float, side: float) -> dict[str, Any]:
    motion = {"type": "constant", "speed": speed}
    return beam(theory, {"tip_force": [0.0, side * UNIT]}, motion=motion)


CASES = [
    *((force, (0.0, side)) for side in (0.05, 0.2, 1.0, 5.0, 1e3)),
    *((force, (axial, side)) for axial, side in ((-1.0, 0.1), (-2.2, 0.02), (3.7, 0.01))),
    *((moment, (degrees,)) for degrees in (5.0, 45.0, 90.0, 180.0)),
    *((spinning, arguments) for arguments in ((0.5, 0.05), (3.0, 0.05), (6.0, 3.0))),
]


@pytest.mark.parametrize("theory", APPROXIMATE)
@pytest.mark.parametrize(("scene", "arguments"), CASES)
def test_never_below_a_third_of_the_error(scene: Any, arguments: tuple[float, ...], theory: str) -> None:
    try:
        true, estimate, said = errors(scene, theory, *arguments)
    except rotfem.ComputationError:
        assert theory in ("second_order", "von_karman")  # no equilibrium far out of their range, and said to be none
        return
    if true > 0.05:
        assert estimate > true / 3
    if true > 0.15:  # three times what is to be noticed
        assert len(said) == 1
    if true < 0.005:
        assert not said


def test_column_above_its_buckling_load_in_a_theory_that_does_not_see_it() -> None:
    for load, noticed in ((-500.0, True), (-300.0, False)):
        summary = rotfem.run(beam("linear", {"tip_force": [load, 0.0]})).summary
        assert summary["stability"]["stable"]  # by its own stiffness
        assert any("buckling load" in line for line in summary["warnings"]) is noticed


def test_buckled_column_in_a_theory_without_terms_of_third_order() -> None:
    true, estimate, said = errors(force, "second_order", -400.0 / UNIT, 0.01 / UNIT)
    assert true == pytest.approx(0.7, abs=0.05)
    assert estimate > true / 3
    assert said


@pytest.mark.parametrize("theory", APPROXIMATE[1:])
def test_spin_up_is_in_the_range_of_all_theories_but_the_linear_one(theory: str) -> None:
    motion = {"type": "spin_up", "speed": 6.0, "duration": 15.0}
    summary = rotfem.run(beam(theory, {}, motion=motion, time={"end": 16.0, "step": 0.05})).summary
    assert 0.0 < summary["theory_error"]["estimate"] < 0.05
    assert not any("model.theory" in line for line in summary["warnings"])


@pytest.mark.parametrize("moving", [False, True])
def test_small_components_have_an_error_of_their_own(moving: bool) -> None:
    """A stretch of 1e-2 m, and a deflection of 1e-4 m that `linear` has 2.5 times too large, without stiffening."""
    time = {"time": {"end": 0.1, "step": 0.05}, "initial": {"state": "steady"}} if moving else {}

    def computed(theory: str) -> Any:
        return rotfem.run(beam(theory, {"tip_force": [370.0 * UNIT, 3e-3 * UNIT]}, structure=stiff, **time))

    stiff = {**beam("linear", {})["structure"]}
    stiff["section"] = {**stiff["section"], "EA": 5.2e7, "EI": 100 * EI}
    exact, found = computed("reissner"), computed("linear")
    true = np.abs(tip(found) - tip(exact)) / np.abs(tip(found))
    assert true[1] > 0.3
    errors = found.summary["theory_error"]["components"]
    assert errors["tip_u2"] == pytest.approx(true[1], rel=0.1)
    assert "small components of the tip are in error" in "".join(found.summary["warnings"])
    stiffened = computed("consistent_linear").summary
    assert "tip_u2" not in stiffened["theory_error"].get("components", {})


def test_history_that_leaves_the_range() -> None:
    # A tip released from 0.4 L swings with rotations of 0.6 rad.
    initial, time = {"tip_displacement": 4.0}, {"end": 0.2, "step": 0.02}
    for theory, noticed in (("consistent_linear", True), ("reissner", False)):
        summary = rotfem.run(beam(theory, {}, initial=initial, time=time)).summary
        assert any("model.theory" in line for line in summary["warnings"]) is noticed


@pytest.mark.parametrize(
    ("hinged", "loads"),
    [
        (True, {"tip_force": {"table": [[0, 0, 0], [0.1, 0, 1.0], [0.2, 0, 0]]}}),
        (False, {"tip_force": [0.0, UNIT], "at": [{"x": 5.0, "force": {"table": [[0, 0, 0], [0.1, 0, 50.0]]}}]}),
    ],
    ids=["hinge", "bent at the start"],
)
def test_error_since_a_start_in_balance(hinged: bool, loads: dict[str, Any]) -> None:
    """Masses bound what a hinge does that nothing holds at rest, and the error of the first equilibrium stays."""
    tables: dict[str, Any] = {"mesh": {"elements": 4}, "time": {"end": 1.0, "step": 0.02}}
    exact, found = (beam(theory, loads, **tables) for theory in ("reissner", "consistent_linear"))
    if hinged:
        for scene in (exact, found):
            scene["structure"]["root"] = {"lag_stiffness": 0.0}
    done, there = rotfem.run(found), rotfem.run({**exact, "output": {"error": False}})
    path = [np.column_stack([r.history["tip_u1"], r.history["tip_u2"]]) for r in (done, there)]
    true = np.linalg.norm(path[0] - path[1], axis=1).max() / np.linalg.norm(path[1], axis=1).max()
    assert true / 3 < done.summary["theory_error"]["estimate"] < 3 * true


def phase_error(time: float) -> float:
    """Return the largest distance of two unit oscillations, of a first lag frequency with and without stiffening."""
    omega = 3.516015 * np.sqrt(EI / 1.2 / LENGTH**4)
    ratios = np.sqrt(1.0 + np.array([-1.0, 1.1933 - 1.0]) / 9)  # ω₁² + (0.1933 or −1) Ω², Ω = ω₁/3: Southwell
    t = np.linspace(0.0, time, 20000)
    return float(np.max(np.abs(np.subtract(*np.cos(np.outer(ratios * omega, t))))))


@pytest.mark.parametrize("time", [3.0, 10.0])
def test_an_error_that_grows_as_a_phase(time: float) -> None:
    """At a third of its first frequency a released blade swings out of phase in a theory without stress stiffness."""
    motion = {"type": "constant", "speed": 3.516015 * np.sqrt(EI / 1.2 / LENGTH**4) / 3}
    tables = {"initial": {"tip_displacement": 0.05}, "time": {"end": time, "step": 0.01}, "mesh": {"elements": 4}}
    summary = rotfem.run(beam("linear", {}, motion=motion, **tables)).summary
    assert summary["error"]["model"] == pytest.approx(phase_error(time), rel=0.1)
    assert summary["theory_error"]["estimate"] == summary["error"]["model"]
    assert any("model.theory" in line for line in summary["warnings"])


def test_an_error_of_third_order_grows_as_a_phase() -> None:
    """The frequency of `second_order` depends on the amplitude otherwise than the exact one."""
    motion = {"type": "constant", "speed": 1.266}
    tables = {"initial": {"tip_displacement": 0.5}, "time": {"end": 20.0, "step": 0.02}, "mesh": {"elements": 4}}
    found, exact = (rotfem.run(beam(name, {}, motion=motion, **tables)) for name in ("second_order", "reissner"))
    columns = [np.column_stack([r.history["tip_u1"], r.history["tip_u2"]]) for r in (found, exact)]
    true = np.linalg.norm(columns[0] - columns[1], axis=1).max() / np.linalg.norm(columns[0], axis=1).max()
    assert true > 0.05
    assert found.summary["error"]["model"] == pytest.approx(true, rel=0.3)


@pytest.mark.parametrize("theory", ["consistent_linear", "von_karman_linear"])
def test_stress_stiffness_of_the_undeformed_structure_drifts_as_a_phase(theory: str) -> None:
    """A blade that its spin stretches by 1 % swings left alone: by the distance of both frequencies times the time."""
    tables = {"motion": {"type": "constant", "speed": 12.0}, "mesh": {"elements": 4}}
    tables |= {"initial": {"mode": 1, "amplitude": 0.05}, "time": {"end": 10.0, "step": 0.01}}
    blades = {name: beam(name, {}, **tables) for name in (theory, "reissner")}
    for blade in blades.values():
        blade["structure"]["section"] = {**blade["structure"]["section"], "EA": 7e5}
    found, exact = (rotfem.run(blade) for blade in blades.values())
    true = np.max(np.abs(found.history["tip_u2"] - exact.history["tip_u2"]))
    one, other = (rotfem.modes(blade).frequencies[0] for blade in blades.values())
    assert true == pytest.approx(0.05 * 2 * np.sin(5.0 * abs(one - other)), rel=0.2)
    error = found.summary["error"]
    assert error["model"] * error["scale"] == pytest.approx(true, rel=0.3)


def test_frequencies_without_stiffening() -> None:
    motion = {"type": "constant", "speed": 3.0}
    rows = {
        theory: rotfem.modes(beam(theory, {}, motion=motion, modes={"count": 3})) for theory in ("linear", "reissner")
    }
    found, exact = (rows[theory].frequencies for theory in ("linear", "reissner"))
    true = float(np.max(np.abs(found - exact) / exact))
    assert rows["linear"].summary["theory_error"]["estimate"] > true / 3
    assert any("model.theory" in line for line in rows["linear"].summary["warnings"])
    assert not any("model.theory" in line for line in rows["reissner"].summary["warnings"])
    still = rotfem.modes(beam("linear", {}, modes={"count": 3})).summary
    assert still["theory_error"]["estimate"] < 1e-8  # of two solutions of one eigenproblem


@pytest.mark.slow
def test_linear_flap_of_a_spinning_plate() -> None:
    plate = {"type": "plate", "length": 1.0, "width": 0.3, "thickness": 0.002, "E": 7e10, "nu": 0.3, "rho": 2700.0}
    tables = {"motion": {"type": "constant", "speed": 100.0, "axis": [0.0, 1.0, 0.0]}, "mesh": {"elements": [6, 2]}}
    scene = {"structure": plate, **tables, "modes": {"count": 1}}
    found, exact = (rotfem.modes({**scene, "model": {"theory": name}}) for name in ("linear", "consistent_linear"))
    assert any("out of its range" in line for line in found.summary["warnings"])
    assert not any("model.theory" in line for line in exact.summary["warnings"])
