"""Errors of runs by their companions: of the order that theory says, and within a factor of the error there is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rotfem
from rotfem.commands.error_report import rounded_down
from rotfem.refinement.estimate import ASYMPTOTIC, error_of

BEAM = {
    "type": "planar_beam",
    "length": 10.0,
    "section": {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4},
}
SPIN_UP = {"type": "spin_up", "speed": 6.0, "duration": 15.0}
STILL = {"type": "constant", "speed": 0.0}
PULSE = {"tip_force": [[0.0, 0.0, 0.0], [0.1, 0.0, 40.0], [0.2, 0.0, 0.0]]}


def scene(step: float | None, **more: Any) -> dict[str, Any]:
    """Return tables of a history of the beam, or of its steady state."""
    time = {} if step is None else {"time": {"end": 4.0, "step": step, **more.pop("time", {})}}
    return {"structure": BEAM, "motion": STILL, "mesh": {"elements": 4}, **time, **more}


def tip(run: Any) -> Any:
    """Return the displacements of the tip over a run, (n, 2), m."""
    return np.column_stack([run.tip[name] for name in ("u1", "u2")])


def off(run: Any, other: Any) -> float:
    """Return the largest difference of two histories of the tip, relative to the largest displacement."""
    return float(np.linalg.norm(run - other, axis=1).max() / np.linalg.norm(run, axis=1).max())


def true_error(tables: dict[str, Any], parts: int = 8) -> tuple[float, dict[str, Any]]:
    """Return the difference of a run to that in so many times the steps, as of second order, and its summary."""
    run = rotfem.run(tables)
    time = {**tables["time"], "step": tables["time"]["step"] / parts}
    fine = rotfem.run({**tables, "time": time, "output": {"error": False}})
    return off(tip(run), tip(fine)[::parts]) / (1.0 - parts**-2), run.summary


def test_richardson() -> None:
    """Of u_h = u + c h^p the error of u_h is reported exactly; of meshes far apart, the difference itself."""
    for p in (1, 2, 4):
        for h in (1e-2, 1e-3):
            assert error_of((2 * h) ** p - h**p, p) == pytest.approx(h**p)
    assert error_of(1.5**2 - 1.0, 2, 1.5) > ASYMPTOTIC
    assert error_of(0.01 * (1.5**2 - 1.0), 2, 1.5) == pytest.approx(0.01)
    assert error_of(2 * ASYMPTOTIC, 2) == 2 * ASYMPTOTIC


@pytest.mark.parametrize(("scheme", "steps"), [("newmark", (40, 80)), ("esdirk4", (16, 32))])
def test_effectivity_tends_to_one(scheme: str, steps: tuple[int, int]) -> None:
    """A linear beam in its first mode moves as A cos ωt: estimate over error tends to 1, and falls by 2^p.

    ω is that of the same mesh. Within 5 % with so many steps a period, over five periods. Of an order p above 2 the
    difference itself is reported, which tends to 2^p − 1 of the error.
    """
    model, start = {"theory": "consistent_linear"}, {"mode": 1, "amplitude": 0.1}
    omega = rotfem.modes(scene(None, model=model)).rows[0]["frequency"]
    period, found = 2 * np.pi / omega, []
    for number in steps:
        time = {"end": 5 * period, "step": period / number, "scheme": scheme}
        run = rotfem.run(scene(0.1, model=model, initial=start, time=time))
        exact = 0.1 * np.cos(omega * run.t)
        true = np.abs(run.tip["u2"] - exact).max() / np.abs(run.tip["u2"]).max()
        found.append((run.summary["error"]["time"], true))
    (_, _), (estimate, true) = found
    order = {"newmark": 2, "esdirk4": 4}[scheme]
    assert estimate == pytest.approx({2: 1, 4: 15}[order] * true, rel=0.05)
    assert np.log2(found[0][1] / true) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize(("mode", "periods", "share"), [(1, 3, 1.0), (3, 15, 1e-2)])
def test_asymptotic_is_a_small_phase_error(mode: int, periods: int, share: float) -> None:
    """Whether a difference is divided by 2^p − 1 depends on the phase, not on its size: A cos ωt about a static shape.

    Of one mode alone, with ωh = 2π/30 over 3 periods, 0.07 rad: the difference of 18 % is three times the error. Of a
    hundredth of the whole, with ωh = 1 over 15 periods, 8 rad: 2A is error and difference.
    """
    model, amplitude = {"theory": "consistent_linear"}, 0.1 * share
    omega = rotfem.modes(scene(None, model=model, modes={"count": mode})).rows[mode - 1]["frequency"]
    step = (2 * np.pi / 30 if share == 1.0 else 1.0) / omega
    more = {} if share == 1.0 else {"loads": {"tip_force": [0.0, 3 * 1.4e4 * 0.1 / 10.0**3]}}
    start, time = {"mode": mode, "amplitude": amplitude}, {"end": 2 * np.pi * periods / omega, "scheme": "newmark"}
    run = rotfem.run(scene(step, model=model, initial=start, time=time, **more))
    static = run.tip["u2"][0] - amplitude if more else 0.0
    true = np.abs(run.tip["u2"] - static - amplitude * np.cos(omega * run.t)).max() / np.abs(run.tip["u2"]).max()
    assert 0.8 < run.summary["error"]["time"] / true < 1.2


@pytest.mark.parametrize(
    ("name", "tables"),
    [
        ("spin-up", scene(0.05, motion=SPIN_UP, time={"end": 20.0})),
        ("pulse", scene(0.02, loads=PULSE)),
        ("linear pulse", scene(0.02, loads=PULSE, model={"theory": "consistent_linear"})),
        ("pulse, energy-conserving", scene(0.02, loads=PULSE, time={"scheme": "energy_conserving"})),
        ("inertial frame", scene(0.01, motion=SPIN_UP, model={"frame": "inertial"}, time={"end": 3.0})),
    ],
)
def test_steps_are_judged(name: str, tables: dict[str, Any]) -> None:
    """Not under the true error by more than 2; beyond the asymptotic range up to 4 times, as d = 3 e is said there."""
    true, summary = true_error(tables, 4)
    assert 0.5 * true < summary["error"]["time"] < 4.0 * true


def test_estimate_has_the_order_of_the_scheme() -> None:
    """Half the step, a quarter of the estimate, where the motion is resolved (within a tenth)."""
    found = [rotfem.run(scene(h, motion=SPIN_UP, time={"end": 20.0})).summary["error"]["time"] for h in (0.02, 0.01)]
    assert np.log2(found[0] / found[1]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"model": {"theory": "consistent_linear"}},
        {"motion": {"type": "torque", "hub_inertia": 60.0, "pulses": [[0.0, 0.3, 100.0]]}, "loads": {}},
    ],
)
def test_estimate_changes_nothing_and_can_be_left_out(more: dict[str, Any]) -> None:
    """The history with and without it is the same to the last bit: a companion shares nothing that lasts."""
    tables = scene(0.02, **{"loads": PULSE, "motion": {"type": "constant", "speed": 3.0}, **more})
    known, unknown = rotfem.run(tables), rotfem.run({**tables, "output": {"error": False}})
    assert "error" in known.summary
    assert "error" not in unknown.summary
    for name, column in known.history.items():
        np.testing.assert_array_equal(column, unknown.history[name])


def test_what_cannot_be_doubled_is_unknown() -> None:
    """Where every step ends at a jump, no companion takes two as one: null, and said why."""
    pulses = [[0.1 * i, 0.1 * (i + 1), 20.0 * (-1) ** i] for i in range(10)]
    run = rotfem.run(scene(0.1, motion={"type": "torque", "hub_inertia": 60.0, "pulses": pulses}, time={"end": 1.0}))
    assert run.summary["error"]["time"] is None
    assert run.summary["error"]["total"] is None
    assert any("error by the time steps could not be estimated" in line for line in run.warnings)


def test_what_moves_in_single_steps_is_unknown() -> None:
    """Half of the time is calm and taken in doubled steps, but all that moves is not: a record of each step."""
    record = [[0.0, 0.0, 0.0]] + [[0.1 * i, 0.0, 20.0 * np.sin(i)] for i in range(22, 41)]
    assert rotfem.run(scene(0.1, loads={"tip_force": record})).summary["error"]["time"] is None
    assert rotfem.run(scene(0.1, loads={"tip_force": record}, time={"end": 10.0})).summary["error"]["time"] > 0.0


def test_steps_of_different_length_are_not_doubled() -> None:
    """A last step that is a hundredth of the one before: both together are hardly longer than that one."""
    start = {"mode": 1, "amplitude": 0.01}
    short, even = (
        rotfem.run(scene(0.4, initial=start, time={"end": end})).summary["error"]["time"] for end in (0.404, 0.8)
    )
    assert short is None
    assert even > ASYMPTOTIC


def test_a_tip_that_only_turns() -> None:
    """Torsion displaces no axis: errors, tolerance and accuracy are those of the rotation, against far more steps."""
    section = {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 8e3, "EI2": 1.4e4, "EI3": 1.4e4, "mass_per_length": 1.2}
    section |= {"rotary_inertia2": 3e-2, "rotary_inertia3": 3e-2}
    tables = {
        "structure": {"type": "spatial_beam", "length": 10.0, "section": section},
        "motion": STILL,
        "model": {"theory": "consistent_linear"},
        "loads": {"tip_moment": [[0.0, 0.0, 0.0, 0.0], [0.1, 80.0, 0.0, 0.0], [0.2, 0.0, 0.0, 0.0]]},
        "mesh": {"elements": 4},
    }

    def turn(time: dict[str, Any], **more: Any) -> tuple[Any, dict[str, Any]]:
        run = rotfem.run({**tables, "time": {"end": 0.2, "output_step": 0.01, **time}, **more})
        return run.tip["theta1"], run.summary.get("error")

    fine, _ = turn({"step": 2.5e-4, "scheme": "esdirk4"}, output={"error": False})
    scale = np.abs(fine).max()
    for time in ({"step": 0.004}, {"tolerance": 1e-3, "scheme": "esdirk4"}):
        found, error = turn(time)
        true = np.abs(found - fine).max() / scale
        assert 0.5 * true < error["time"] < 20.0 * true
        assert true < time.get("tolerance", 1.0)
    found, error = turn({}, accuracy=1e-2)
    assert error["scale"] == pytest.approx(scale * np.sqrt(1.4e4 / 2.8e7), rel=1e-2)
    assert np.abs(found - fine).max() < 1e-2 * scale


@pytest.mark.parametrize(("x", "text"), [(0.0199, "0.01"), (0.02, "0.02"), (3e-4, "0.0003"), (9.99e-7, "9e-07")])
def test_advice_is_rounded_down(x: float, text: str) -> None:
    assert rounded_down(x) == text


def test_unresolved_motion_is_said() -> None:
    """A pulse that is as short as the steps: more than 1 % off, and said so with a step that would do."""
    run = rotfem.run(scene(0.05, loads=PULSE))
    assert run.summary["error"]["time"] > 0.01
    assert any("time.step" in line and "in error by" in line for line in run.warnings)


def test_steady_state_has_no_error_of_steps() -> None:
    """Of a steady state only mesh and model are in doubt, and a tip force on beam elements of degree 3 is not."""
    error = rotfem.run(scene(None, loads={"tip_force": [0.0, 5.0]})).summary["error"]
    assert error["time"] == 0.0
    assert error["space"] < 1e-5
    assert error["total"] == pytest.approx(error["space"] + error["model"])


@pytest.mark.parametrize(
    ("load", "mesh"),
    [
        ({"tip_moment": 4000.0}, {"elements": 2, "degree": 2}),
        ({"tip_force": [0.0, 600.0]}, {"elements": 1, "degree": 3}),
        ({"tip_force": [0.0, 20.0]}, {"elements": 8, "degree": 1}),
    ],
)
def test_mesh_of_a_beam_is_judged(load: dict[str, Any], mesh: dict[str, int]) -> None:
    """Not under the true error by more than 2, and over it by at most the order that is not counted on, 2^{2k} − 1."""
    run, exact = (rotfem.run(scene(None, loads=load, mesh=m)) for m in (mesh, {"elements": 24, "degree": 4}))
    true = off(tip(run)[-1:], tip(exact)[-1:])
    assert 0.5 * true < run.summary["error"]["space"] < 4 ** mesh["degree"] * true


def test_a_companion_stays_clamped() -> None:
    """On another mesh, too, where its guess is interpolated: simplified Newton iterations do not correct what is held.

    Round-off at the clamp grew from step to step, and the error by the mesh was 290 times too large (within 2^{2k}).
    """
    hub = {"type": "torque", "hub_inertia": 8.0, "table": [[0, 0], [0.2, 25], [0.5, 25], [0.7, -15], [1.0, 0]]}
    section = {"EA": 3.0e6, "GA": 9e5, "EI": 900.0, "mass_per_length": 0.55, "rotary_inertia": 1.2e-4}
    tables = {
        "structure": {"type": "planar_beam", "length": 3.5, "hub_radius": 0.25, "section": section},
        "motion": hub,
        "mesh": {"elements": 4},
        "time": {"end": 1.4, "step": 0.01, "scheme": "radau5"},
    }
    run = rotfem.run(tables)
    exact = rotfem.run({**tables, "mesh": {"elements": 12}, "output": {"error": False}})
    true = off(tip(run), tip(exact))
    assert 0.5 * true < run.summary["error"]["space"] < 4**3 * true


def test_modes_say_theirs() -> None:
    """The largest estimates of the rows, and their sum."""
    modes = rotfem.modes(scene(None))
    error = modes.summary["error"]
    assert error["space"] == max(row["mesh_error"] for row in modes.rows)
    assert error["total"] == error["space"] + error["model"] + error["round_off"]
