"""What is prescribed over time is met: orders after kinks, impulses, events shorter than a step, dense tables."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from rotfem import run
from tests.beams import STRUCTURE

Array = npt.NDArray[np.float64]

#: Knots that no step of the tests ends at.
KNOTS = (0.0, 0.3517, 0.6321, 0.97)
RAMPS = [[t, 0.0, f] for t, f in zip(KNOTS, (0.0, 0.5, -0.5, 0.0), strict=True)]
SPEEDS = {"type": "table", "table": [[t, w] for t, w in zip(KNOTS, (0.2, 0.2, 1.0, 0.5), strict=True)]}
SPEEDS |= {"interpolation": "linear"}
SPIN = {"type": "constant", "speed": 1.0}
HUB = {"type": "torque", "hub_inertia": 1.0}
DATA: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "speeds": (SPEEDS, {}),
    "speeds, inertial frame": (SPEEDS, {"model": {"frame": "inertial"}}),
    "load": (SPIN, {"loads": {"distributed": {"over_time": RAMPS}}}),
    "base acceleration": (SPIN | {"base_acceleration": RAMPS}, {}),
    "torque": (HUB | {"table": [[t, f] for t, _, f in RAMPS]}, {}),
    "pulses": (HUB | {"pulses": [[0.1234, 0.3517, 0.5], [0.6, 0.9, -0.3]]}, {}),
}
SCHEMES: dict[str, dict[str, Any]] = {
    "rho 0.8": {"spectral_radius": 0.8},
    "rho 0": {"spectral_radius": 0.0},
    "newmark": {"scheme": "newmark"},
}


#: All data by one scheme, and one of the clamp and one of the hub by another.
KINKS = [(data, "rho 0.8") for data in DATA] + [("speeds", "newmark"), ("torque", "rho 0")]


@pytest.mark.parametrize(("data", "scheme"), KINKS)
def test_second_order_after_kinks(unit_beam: Any, data: str, scheme: str) -> None:
    """A quarter of the step, a sixteenth of the change, more or less, as the knots lie elsewhere in their steps.

    Damping proportional to stiffness leaves only modes that steps resolve.
    """
    motion, more = DATA[data]
    histories = []
    for k in (0, 2, 4):
        time = {"end": 1.2, "step": 0.01 / 2**k, "output_every": 2**k, **SCHEMES[scheme]}
        scene = unit_beam({"structure.damping": {"kelvin_voigt": 0.02}}, motion=motion, **more, time=time)
        h = run(scene.replace({"mesh.elements": 2})).history
        histories.append(np.array([h["tip_u2"], h["tip_alpha"]]))
    first, second = (np.abs(b - a).max(axis=1) for a, b in pairwise(histories))
    np.testing.assert_allclose(np.log2(first / second) / 2, 2.0, rtol=0, atol=0.25)


def krb(motion: dict[str, Any], step: float, end: float, **more: Any) -> Any:
    """Return the run of Kane's beam on four elements."""
    tables = {"structure": STRUCTURE, "motion": motion, "mesh": {"elements": 4}, "time": {"end": end, "step": step}}
    return run(tables | more)


def speeds(*rows: tuple[float, float]) -> dict[str, Any]:
    return {"type": "table", "table": [list(row) for row in rows], "interpolation": "linear"}


def test_shifted_knot_shifts_the_answer_as_little() -> None:
    """A knot at a step's end moved by 1 ns and less, to either side: the answer moves by u̇ times that, and no more."""

    def u(shift: float) -> Array:
        history = krb(speeds((0.0, 0.2), (1.0 + shift, 0.2), (1.5, 0.0)), 0.01, 2.0).history
        return np.asarray(history["tip_u2"])

    still = u(0.0)
    for shift in (1e-9, -1e-9, 1e-12):
        assert np.abs(u(shift) - still).max() < 10 * abs(shift) * np.abs(still).max()


@pytest.mark.parametrize("start", [1.0033, 1.0, 1.01 - 1e-9])
def test_stop_within_a_step(start: float) -> None:
    """0.2 rad/s stopped in 1 ms, 1 µs, 1 ns: the same blow, so the same swing of the tip.

    Reference: steps of 0.1 ms for the stop in 1 ms, u₂ = 0.6086 at most; that of 10 ms leaves 0.5 % to the third mode.
    """
    tops = []
    for duration in (1e-3, 1e-6, 1e-9):
        history = krb(speeds((0.0, 0.2), (start, 0.2), (start + duration, 0.0)), 0.01, 2.2).history
        tops.append(np.abs(history["tip_u2"]).max())
    np.testing.assert_allclose(tops, 0.6086, rtol=5e-3)
    np.testing.assert_allclose(tops[1:], tops[0], rtol=2e-3)


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_blow_on_the_tip_whatever_the_damping(rho: float) -> None:
    """0.2 N·s on the tip within 0.4 ms, steps of 2 ms: ρ∞ decides on waves that steps do not resolve, not on the swing.

    Reference: 2.07 cm with ρ∞ = 1, of which waves along the beam are 2 %.
    """
    rows = [[0.0, 0.0, 0.0], [0.5031, 0.0, 0.0], [0.5033, 0.0, 1000.0], [0.5035, 0.0, 0.0]]
    scene = {"structure": STRUCTURE, "motion": {"type": "constant", "speed": 0.0}, "loads": {"tip_force": rows}}
    scene |= {"model": {"theory": "consistent_linear"}, "time": {"end": 2.0, "step": 0.002, "spectral_radius": rho}}
    assert np.abs(run(scene).history["tip_u2"]).max() == pytest.approx(0.0207, rel=0.03)


@pytest.mark.parametrize("step", [0.1, 0.05, 0.02])
def test_every_pulse_gives_its_impulse(step: float) -> None:
    """Rounded products of step and number, pulses between two steps, over one, far shorter: I Δψ̇ = Σ M Δt exactly."""
    ends = [(i * step, (i + 3) * step) for i in range(1, 40, 4)]
    ends += [(2.3, 2.6), (2.623, 2.627), (2.7, 2.704), (2.796, 2.8), (2.9, 2.9 + 1e-6), (3.0204, 3.0904)]
    inertia = 10.0 + 1.2 * 10.0**3 / 3 + 6e-4 * 10.0
    pulses = [[start, end, 50.0 / (end - start)] for start, end in ends]
    motion = HUB | {"hub_inertia": 10.0, "coupled": False, "pulses": pulses}  # turns as if the beam were rigid
    history = krb(motion, step, 40 * step + 4.0).history
    assert history["psi_dot"][-1] * inertia == pytest.approx(50.0 * len(ends), rel=1e-6)
    assert history["impulse"][-1] == pytest.approx(50.0 * len(ends), rel=1e-10)


@pytest.mark.parametrize("rho", [0.0, 1.0])
def test_short_ramps_give_their_impulse(rho: float) -> None:
    """Up and down within a step, or over several: H = ∫ M dt for every ρ∞.

    The momentum follows the impulse but for what the bending of a stiff beam takes up, EI = 1.4e6 N·m²: 3e-5.
    """
    section = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e6, "mass_per_length": 1.2}
    beam = {"type": "planar_beam", "length": 1.0, "section": section}
    for ratio in (0.003, 0.01, 0.1, 0.2, 0.4, 0.7, 1.3, 2.5):
        start, rise = 0.1037, 0.01 * ratio
        rows = [[0.0, 0.0], [start, 0.0], [start + rise, 0.5 / rise], [start + 2 * rise, 0.0], [1.0, 0.0]]
        scene = {
            "structure": beam,
            "motion": HUB | {"table": rows},
            "model": {"theory": "consistent_linear"},
            "mesh": {"elements": 1},
            "time": {"end": 0.3, "step": 0.01, "spectral_radius": rho},
        }
        assert run(scene).history["angular_momentum"][-1] == pytest.approx(0.5, rel=3e-5), ratio


def test_dense_noise_is_averaged() -> None:
    """A speed table with noise, 100 rows in a step, costs no further steps and is as good as landing on each."""
    rng = np.random.default_rng(1)
    t = np.linspace(0.0, 0.4, 2001)
    rows = np.column_stack([t, t + 1e-3 * rng.standard_normal(len(t))])
    answers = []
    for step in (0.02, t[1]):
        result = krb(speeds(*rows), step, 0.4)
        answers.append(np.interp(np.arange(0.0, 0.4, 0.02), result.history["t"], result.history["tip_u2"]))
        assert result.summary["factorisations"] < 4 * result.summary["steps"]
    assert np.abs(answers[0] - answers[1]).max() < 5e-3 * np.abs(answers[1]).max()


def test_a_table_of_what_steps_resolve_is_as_cheap_as_its_function() -> None:
    """401 rows of 20 sin 3t, 390 steps: the same factorisations and the same history."""
    t = np.linspace(0.0, 4.0, 401)
    rows = [[float(s), 0.0, float(20.0 * np.sin(3.0 * s))] for s in t]
    given = (rows, lambda s: [0.0, float(np.interp(s, t, [row[2] for row in rows]))])
    table, function = (krb(SPIN, 4.0 / 390, 4.0, loads={"tip_force": load}) for load in given)
    assert table.summary["factorisations"] == function.summary["factorisations"]
    np.testing.assert_allclose(table.history["tip_u2"], function.history["tip_u2"], rtol=0, atol=1e-9)


def test_a_blow_of_any_width_has_its_impulse_in_adaptive_steps() -> None:
    """Triangles of one impulse, from a third of the shortest leg that is stepped to a hundred times as long.

    A cell of the time grid is 1e-4 s, that leg 1e-7 s; the tolerance is 1e-3.
    """
    peaks = []
    for width in (3e-8, 1e-7, 2e-7, 9e-7, 1e-5):
        rows = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1 + width / 2, 0.0, 1e-3 / width], [0.1 + width, 0.0, 0.0]]
        scene = {"structure": STRUCTURE, "motion": SPIN, "mesh": {"elements": 4}}
        scene |= {"loads": {"tip_force": rows}, "model": {"theory": "consistent_linear"}}
        result = run({**scene, "time": {"end": 0.2, "tolerance": 1e-3}})
        peaks.append(np.max(np.abs(result.history["tip_u2"])))
    np.testing.assert_allclose(peaks, peaks[-1], rtol=5e-3)


#: A light beam with its first mode at 3.516 rad/s.
SLENDER = {"EA": 1e6, "GA": 3e5, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1e-6}


def slender(**tables: Any) -> Any:
    damping = {"kelvin_voigt": 1e-3}
    return run({"structure": {"type": "planar_beam", "length": 1.0, "section": SLENDER, "damping": damping}, **tables})


@pytest.mark.parametrize("scheme", ["generalised_alpha", "energy_conserving"])
def test_noise_does_not_add_up(scheme: str) -> None:
    """Speed with white noise of 0.002 rad/s, a hundred rows a step: as far as steps of fourth order follow it.

    Lines that do not meet made nine times as much of it.
    """
    t = np.arange(20001) * 1e-4
    w = 0.3 + 0.002 * np.random.default_rng(3).standard_normal(t.size)
    motion = {"type": "table", "table": np.c_[t, w].tolist(), "interpolation": "linear"}
    found = []
    for given in ({"step": 0.01, "scheme": scheme}, {"step": 0.005, "scheme": "esdirk4"}):
        tables = {"motion": motion, "initial": {"state": "undeformed"}, "output": {"error": False}}
        found.append(slender(**tables, time={"end": 2.0, "output_step": 0.01, **given}).tip["u2"])
    assert np.abs(found[0] - found[1]).max() < 0.25 * np.abs(found[1]).max()


def test_a_speed_that_jumps_between_two_rows_of_one_time() -> None:
    """0.1 to 0.2 rad/s at t = 1 s: the largest |u2| of a modal solution is 0.0329 m."""
    for late in (1.0, 1.0 + 1e-13):
        table = [[0.0, 0.1], [1.0, 0.1], [late, 0.2], [3.0, 0.2]]
        motion = {"type": "table", "table": table, "interpolation": "linear"}
        u2 = slender(motion=motion, time={"end": 3.0, "step": 0.01}).tip["u2"]
        assert np.abs(u2).max() == pytest.approx(0.0329, rel=1e-2)


@pytest.mark.parametrize(("time", "accuracy"), [({"step": 0.01}, 0.08), ({"tolerance": 1e-3}, 5e-3)])
def test_a_pulse_within_a_step_of_a_function(time: dict[str, Any], accuracy: float) -> None:
    """1e-3 N s within 1e-4 s, seen between the ends of steps and said, is as good as rows of a table."""
    d = 1e-4
    t = np.linspace(0.5, 0.5 + d, 21)
    F = 1e-3 * np.pi / 2 / d * np.sin(np.pi * (t - 0.5) / d)
    rows = [[0.0, 0.0, 0.0], *np.c_[t, 0 * t, F].tolist(), [9.0, 0.0, 0.0]]
    tables = {"motion": {"type": "constant", "speed": 0.0}, "time": {"end": 2.0, **time}}
    tables["output"] = {"error": False}
    found = [slender(**tables, loads={"tip_force": f}) for f in (rows, lambda s: [0.0, float(np.interp(s, t, F))])]
    size = np.abs(found[0].tip["u2"]).max()
    assert np.abs(found[1].tip["u2"]).max() == pytest.approx(size, rel=accuracy)
    assert size > 1e-3
    assert "loads.tip_force changes within steps" in found[1].warnings[0]
