"""The walk down the ladder, on made-up answers, and the settings of the ladder."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from rotfem.accuracy.answer import Answers, Setting
from rotfem.accuracy.ladder import TOLERANCES, Clock, OverBudget, ladder, ratio_of, reduced, walk
from rotfem.errors import ComputationError
from rotfem.results.distance import Series
from rotfem.scene import Scene
from tests.beams import STRUCTURE

SECTION = STRUCTURE["section"]
BEAM = {
    "structure": {"type": "planar_beam", "length": 10.0, "section": SECTION},
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
    "time": {"end": 4.0, "step": 0.01},
}
PLATE = {
    "structure": {
        **{"type": "plate", "length": 2.0, "width": 1.0, "thickness": 0.01},
        **{"E": 7e10, "nu": 0.3, "rho": 2700.0},
    },
    "motion": {"type": "constant", "speed": 1.0},
}


@dataclass
class Made:
    """An outcome of a value."""

    output: Series
    steps: int = 0
    stable: bool | None = None
    round_off: float | None = None
    chords: float = 0.0

    @property
    def lines(self) -> list[Any]:
        return []

    def result(self) -> Any:
        return self


def answers(error: Any) -> Answers:
    """Return answers 1 + error(tolerance) of the beam; None fails."""

    def compute(scene: Scene, times: Any) -> Made:
        assert scene.time is not None
        off = error(scene.time.tolerance)
        if off is None:
            raise ComputationError("too coarse")
        return Made(Series(np.zeros(1), np.array([[1.0 + off]])))

    return Answers(Scene.from_dict(BEAM), compute)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4, 1e-5])
def test_the_first_answer_that_is_within_the_accuracy_is_taken(accuracy: float) -> None:
    found = walk(answers(lambda tau: 0.3 * tau), accuracy, Clock(None))
    assert found.met
    assert found.best is not None
    answer, errors = found.best
    true = abs(answer.output.values[0, 0] - 1.0)
    assert true <= errors.total <= accuracy
    assert len(found.rows) <= 4
    assert found.rows[-1]["extrapolated"]


def test_what_stagnates_is_not_taken_for_exact() -> None:
    """Answers that jump by 0.02 at every rung, by turns, have an error of a quarter of that at least."""
    turn = itertools.cycle([0.02, 0.0])
    found = walk(answers(lambda tau: next(turn)), 5e-3, Clock(None))
    assert not found.met
    assert all(row["error"] > 5e-3 for row in found.rows)


def test_rungs_that_fail_are_passed_over() -> None:
    found = walk(answers(lambda tau: None if tau > 3e-3 else 0.3 * tau), 1e-2, Clock(None))
    assert found.met
    assert "failed" in found.rows[0]
    with pytest.raises(ComputationError, match="too coarse"):
        walk(answers(lambda tau: None), 1e-2, Clock(None))


def test_an_answer_that_takes_more_than_is_left_is_refused() -> None:
    clock = Clock(100.0)
    used = iter([10.0, 99.9])
    clock.used = lambda: next(used)  # type: ignore[method-assign]
    with pytest.raises(OverBudget, match=r"about 95 s, 90 s of accuracy_budget are left"):
        clock.begin("b", 95.0)
    assert clock.summary()["wanted"] == 95.0


def test_a_distance_is_divided_by_what_the_order_says() -> None:
    assert reduced(1e-3, np.inf, 5.0) == pytest.approx(2e-3 / 4)
    assert reduced(1e-3, 1e-3, 5.0) == pytest.approx(2e-3 / 4 * 1.25)  # 1.25e-3 was reported as 1e-3
    assert reduced(0.5, np.inf, 5.0) == pytest.approx(1.0)
    assert reduced(np.inf, np.inf, 5.0) == np.inf
    assert reduced(0.0, 1.0, 5.0) == 0.0


def test_rungs_raise_the_degree_of_beams_and_cut_cells_of_plates() -> None:
    beams, cells = list(ladder(Scene.from_dict(BEAM))), list(ladder(Scene.from_dict(PLATE)))
    assert [(r.elements, r.degree) for r in beams[:4]] == [(2, 2), (2, 3), (2, 4), (3, 4)]
    assert all((r.scheme, r.step) == ("esdirk4", None) for r in beams)
    assert [(r.elements, r.degree) for r in cells[:3]] == [((4, 2), 2), ((6, 3), 2), ((8, 4), 2)]
    assert ratio_of(cells[0], cells[2], True) == pytest.approx(8.0)
    assert cells[2].work / cells[0].work == pytest.approx(4.0)
    triangles = [(r.elements, r.degree) for r in ladder(Scene.from_dict({**PLATE, "mesh": {"cell": "triangle"}}))]
    assert triangles[:2] == [((2, 1), 3), ((4, 2), 3)]
    a, b = itertools.islice(ladder(Scene.from_dict(BEAM), scheme="energy_conserving"), 2)
    assert a.step is not None
    assert b.step is not None
    assert a.step / b.step == pytest.approx((TOLERANCES[0] / TOLERANCES[1]) ** 0.5, rel=0.02)


def test_a_setting_survives_json() -> None:
    own = Setting("reissner", (8, 4), 2, "esdirk4", 1e-3, effects=("coriolis",))
    as_json = {key: list(x) if isinstance(x, tuple) else x for key, x in own.summary().items()}
    assert Setting.read(as_json) == own
    assert own.words() == "reissner, 8×4 elements of degree 2, esdirk4 to 0.001"
    scene = Scene.from_dict(PLATE | {"time": {"end": 1.0, "step": 0.1}})
    assert Setting.of(scene.replace(own.changes(scene))).elements == (8, 4)
