"""Where a trial takes shorter steps: at what its scene prescribes, and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rotfem.commands.problem import Problem
from rotfem.scene import Scene
from rotfem.selection.resolution import MOST_PARTS, given, parts

BEAM: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 10.0,
        "section": {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2},
    },
    "motion": {"type": "constant", "speed": 1.0},
    "time": {"end": 10.0, "step": 0.001},
}
#: Ends of 200 intervals of 50 ms; an angular frequency of 4 rad/s.
TIMES, PERIOD = np.linspace(0.0, 10.0, 201), 0.25


def counts(changes: dict[str, Any], most: int = 10_000, own: int | None = None) -> Any:
    scene = Scene.from_dict(BEAM).replace(changes)
    return parts(given(Problem.of(scene)), TIMES, PERIOD, most, own)


def blow(t: float, width: float, force: float = 1.0) -> list[list[float]]:
    return [[0, 0, 0], [t, 0, 0], [t + width / 2, 0, force], [t + width, 0, 0], [10, 0, 0]]


def test_constant_and_smooth_data_ask_for_nothing() -> None:
    assert counts({"loads": {"tip_force": [0.0, 1.0], "gravity": [0.0, -1.0]}}).max() == 1
    assert counts({"motion": {"type": "spin_up", "speed": 3.0, "duration": 8.0}}).max() == 1
    assert counts({"loads": {"tip_force": lambda t: [0.0, np.sin(4 * t)]}}).max() == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"loads": {"tip_force": blow(7.012, 0.004)}},
        {"loads": {"distributed": blow(7.012, 0.004)}},
        {"loads": {"tip_moment": [[0, 0], [7.012, 0], [7.014, 3.0], [7.016, 0]]}},
        {"loads": {"tip_force": lambda t: [0.0, max(0.0, 1 - abs(t - 7.014) / 0.002)]}},
        {"motion.base_acceleration": blow(7.012, 0.004)},
        {"motion.base_acceleration": blow(7.01203, 1e-4)},
        {"motion": {"type": "torque", "hub_inertia": 1.0, "table": [[0, 0], [7.012, 0], [7.014, 3.0], [7.016, 0]]}},
        {"motion": {"type": "table", "table": [[0, 1], [7.012, 1], [7.014, 3], [7.016, 1]], "interpolation": "linear"}},
        {"motion": {"type": "table", "table": [[0, 1], [7.012, 1], [7.014, 300], [7.016, 1]]}},
        {"motion": {"type": "callable", "speed": lambda t: float(np.exp(-(((t - 7.02) / 0.002) ** 2)))}},
    ],
)
def test_what_falls_between_two_samples_is_met(changes: dict[str, Any]) -> None:
    found = counts(changes)
    assert found[140] >= 16  # from 7.00 to 7.05 s, hardly elsewhere
    assert found.sum() - found[140] <= 200 + 64


def test_narrow_blows_and_many_of_them_have_a_bound() -> None:
    assert counts({"loads": {"tip_force": blow(7.012, 1e-5)}})[140] == MOST_PARTS
    # A scene of 1000 steps sees no more than steps of 5 ms do; half of that is short enough for a trial.
    assert counts({"loads": {"tip_force": blow(7.012, 1e-4)}}, 1000, 1000)[140] == 10
    noise = np.random.default_rng(1).standard_normal(4001)
    rows = [[t, 0.0, f] for t, f in zip(np.linspace(0.0, 10.0, 4001).tolist(), noise.tolist(), strict=True)]
    assert 1000 < counts({"loads": {"tip_force": rows}}, 2000).sum() <= 2000
    assert counts({"loads": {"tip_force": rows}}, 300).max() == 1


def test_a_slight_load_beside_a_great_one_does_not_count() -> None:
    """1e-4 of an impulse that acts for 1/ω₁ is not felt; a tenth is."""
    force = [[0, 0, 100], [7.012, 0, 100], [7.014, 0, 101], [7.016, 0, 100]]
    assert counts({"loads": {"tip_force": force}}).max() == 1
    assert counts({"loads": {"tip_force": [[t, x, 101 if y == 100 else 1351] for t, x, y in force]}})[140] > 1
