"""How long attempts at an accuracy take: what is predicted, told and refused, by a clock that is turned by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from mpi4py import MPI

from rotfem.commands import pace as module
from rotfem.commands.attempts import lasting, words
from rotfem.commands.pace import LONG, Pace, TooDear
from rotfem.errors import SceneError
from rotfem.scene import Scene
from rotfem.selection.accuracy import Settings
from tests.beams import STRUCTURE

SETTINGS = Settings(({"theory": "reissner"},), 6, 3, "esdirk4", step=0.01)
END = 10.0


class Clock:
    """CPU time that goes on only when it is told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(module, "cpu_time", found)
    return found


def marched(pace: Pace, clock: Clock, settings: Settings, each: float, setup: float = 2.0) -> None:
    """Go through an attempt whose set-up and steps take so long."""
    assert settings.step is not None
    clock.now += setup
    number = round(END / settings.step)
    for i in range(number + 1):
        pace(i, i / number)
        clock.now += each
    pace.ends()


def test_what_one_attempt_took_predicts_the_next(clock: Clock) -> None:
    """Twice the steps take twice the time of steps; set-up stays. More nodes take more time in proportion."""
    pace = Pace(None, MPI.COMM_SELF, end=END)
    assert pace.predicted(SETTINGS) is None
    pace.begins(SETTINGS, 1)
    marched(pace, clock, SETTINGS, each=0.01)
    assert pace.predicted(replace(SETTINGS, step=0.005)) == pytest.approx(2 + 20, rel=0.01)
    assert pace.predicted(replace(SETTINGS, elements=12)) == pytest.approx(2 + 10 * 37 / 19, rel=0.01)
    assert pace.predicted(replace(SETTINGS, models=({"theory": "second_order"},))) is None


def test_first_steps_tell_how_long_all_will_take(clock: Clock) -> None:
    told: list[str] = []
    pace = Pace(None, MPI.COMM_SELF, told.append, END)
    pace.begins(SETTINGS, 2)
    marched(pace, clock, SETTINGS, each=0.05)
    assert told == ["attempt 2: reissner, 1000 steps of 0.01 s by esdirk4, 6 elements: about 52 s"]
    pace.begins(replace(SETTINGS, step=0.1), 3)
    marched(pace, clock, replace(SETTINGS, step=0.1), each=0.9 * (LONG - 2.0) / 100)
    assert len(told) == 2  # it was predicted to be long, by the one before
    pace.begins(replace(SETTINGS, step=0.1), 4)
    assert len(told) == 2  # and is not any more


def test_an_attempt_that_is_too_dear_ends_soon(clock: Clock) -> None:
    """Fixed steps are known after a second; what is left serves steps as long as it calls for, once."""
    pace = Pace(20.0, MPI.COMM_SELF, end=END)
    pace.begins(SETTINGS, 1)
    with pytest.raises(TooDear, match="would take about 52 s, 20 s of accuracy_budget are left"):
        marched(pace, clock, SETTINGS, each=0.05)
    assert clock.now < 5.0
    assert pace.wanted == pytest.approx(52, rel=0.05)

    def looser(factor: float) -> Settings:
        return replace(SETTINGS, step=0.01 * factor**0.25)

    cheaper = pace.cheaper(looser)
    assert cheaper is not None
    assert cheaper.step is not None
    assert 2 + END / cheaper.step * 0.05 < 20.0 - clock.now
    assert pace.cheaper(looser) is None
    assert "52 s" in pace.why()


def test_a_budget_shorter_than_what_predicts_is_kept_too(clock: Clock) -> None:
    """Steps of 1 ms are looked at after 1, 3, 7 … of them: at 511 ms the 0.4 s are over."""
    pace = Pace(0.4, MPI.COMM_SELF, end=END)
    pace.begins(SETTINGS, 1)
    with pytest.raises(TooDear, match="0.4 s of accuracy_budget are left"):
        marched(pace, clock, SETTINGS, each=0.001, setup=0.0)
    assert clock.now == pytest.approx(0.511)


def test_nothing_starts_where_nothing_is_left(clock: Clock) -> None:
    """The first attempt does all the same."""
    pace = Pace(1.0, MPI.COMM_SELF, end=END)
    clock.now = 3.0
    pace.begins(SETTINGS, 1)
    with pytest.raises(TooDear):
        pace.begins(SETTINGS, 2)


def test_steps_that_adapt_themselves_are_predicted_by_their_tolerance(clock: Clock) -> None:
    """A sixteenth of the tolerance takes twice the steps by a scheme of fourth order."""
    adaptive = replace(SETTINGS, step=None, tolerance=1e-3)
    pace = Pace(None, MPI.COMM_SELF, end=END)
    pace.begins(adaptive, 1)
    for i in range(101):
        pace(i, i / 100)
        clock.now += 0.1
    pace.ends()
    assert pace.predicted(replace(adaptive, tolerance=1e-3 / 16)) == pytest.approx(20, rel=0.03)


def test_budgets_are_times_and_need_an_accuracy() -> None:
    tables: dict[str, Any] = {
        **{"accuracy": 1e-3, "accuracy_budget": "2 min", "structure": STRUCTURE, "time": {"end": 1.0}},
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
    }
    scene = Scene.from_dict(tables)
    assert scene.accuracy_budget == 120.0
    for value in (0, "2 m", True):
        with pytest.raises(SceneError, match="accuracy_budget"):
            scene.replace({"accuracy_budget": value})
    with pytest.raises(SceneError, match="needs accuracy"):
        scene.replace({"accuracy": None, "time.step": 0.1})


def test_times_and_settings_are_said_in_words() -> None:
    assert [lasting(s) for s in (0.5, 40.0, 119.6, 600.0, 9000.0)] == ["0.5 s", "40 s", "120 s", "10 min", "2.5 h"]
    plate = Settings(({"theory": "consistent_linear", "reduced": 1e-4},), (4, 2), 2, "esdirk4", tolerance=1e-3)
    assert words(plate, END) == "reduced consistent_linear, 4×2 elements"
