"""Functions of time are looked at before a march: their jumps are found, and what a step would pass over is marked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem import SceneError, run
from rotfem.analysis.time_grid import TimeGrid, find_breakpoints
from rotfem.mechanics.time_signals import TimeSignal
from tests.beams import STRUCTURE

TIMES = np.linspace(0.0, 2.0, 201)


def looked(f: Any, name: str = "loads.tip_force") -> TimeSignal:
    signal = TimeSignal(name, f, np.empty(0), np.empty(0), known=False)
    find_breakpoints(signal, TIMES)
    return signal


@pytest.mark.parametrize("at", [0.5033, 1.0 / 3.0, 1.25])
def test_a_jump_is_found_to_round_off(at: float) -> None:
    """Halving sixty times leaves two neighbouring numbers, one on each side."""
    signal = looked(lambda t: 3.0 if t >= at else -1.0)
    assert len(signal.knots) == 1
    assert signal.knots[0] == pytest.approx(at, rel=4e-16)


def test_what_is_smooth_has_no_knots_and_what_is_slow_no_marks() -> None:
    assert len(looked(lambda t: np.sin(7 * t)).knots) == len(looked(lambda t: np.sin(7 * t)).marks) == 0
    bump = looked(lambda t: np.exp(-(((t - 0.505) / 1e-3) ** 2)))
    assert len(bump.knots) == 0
    assert np.all((bump.marks > 0.48) & (bump.marks < 0.53))
    assert len(bump.marks) >= 64


@pytest.mark.parametrize("step", [0.03, 0.02, 0.0137, 0.01, 0.007])
@pytest.mark.parametrize(("order", "averages"), [(2, True), (4, False)])
def test_what_is_smooth_in_up_to_three_steps_is_averaged_wherever_they_end(
    step: float, order: int, averages: bool
) -> None:
    """A parabola of 20 ms: every leg in it is averaged or none, so that hats add up to all of it, 2/3 · 20 ms."""
    signal = TimeSignal(
        "motion.rate",
        lambda t: max(0.0, 1.0 - ((t - 0.51) / 0.01) ** 2),
        np.empty(0),
        np.array([0.0, 0.5, 0.52, 1.0]),
        probes=np.array([0.25, 0.51, 0.76]),
    )
    legs = list(TimeGrid([signal], np.append(np.arange(0.0, 1.0, step), 1.0), step, order))
    inside = [leg for leg in legs if leg.end > 0.5 + 1e-9 and leg.end - leg.length < 0.52 - 1e-9]
    assert {leg.averaged for leg in inside} == {averages}
    if averages:
        ends = [inside[0].end - inside[0].length, *(leg.end for leg in inside)]
        lengths = [0.0, *np.diff(ends), 0.0]
        impulse = sum(
            0.5 * (before + after) * signal.mean(t, before, after)
            for t, before, after in zip(ends, lengths, lengths[1:], strict=False)
        )
        assert impulse == pytest.approx(2 / 3 * 0.02, rel=1e-9)


def beam(**tables: Any) -> Any:
    still = {"motion": {"type": "constant", "speed": 0.0}}
    return run({"structure": STRUCTURE, "mesh": {"elements": 4}, "time": {"end": 1.0, "step": 0.01}, **still, **tables})


def test_a_blow_of_a_function_is_that_of_its_table() -> None:
    """2 ms between two steps; the table's flanks of 0.1 ns are all the two differ in."""
    rows = [[0, 0, 0], [0.5033, 0, 0], [0.5033000001, 0, 200.0], [0.5053, 0, 200.0], [0.5053000001, 0, 0], [9, 0, 0]]
    table = beam(loads={"tip_force": rows})
    function = beam(loads={"tip_force": lambda t: [0.0, 200.0 if 0.5033 < t < 0.5053 else 0.0]})
    u2 = table.history["tip_u2"]
    assert np.abs(u2).max() > 0.01
    np.testing.assert_allclose(function.history["tip_u2"], u2, rtol=0, atol=1e-3 * np.abs(u2).max())


def test_a_speed_that_jumps_is_refused() -> None:
    with pytest.raises(SceneError, match=r"motion\.speed: jumps at t = 0\.5033 s"):
        beam(motion={"type": "callable", "speed": lambda t: 1.0 if t > 0.5033 else 0.0})
