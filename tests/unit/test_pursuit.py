"""What follows an attempt at an accuracy, and what is left where there is no next one; nothing is computed."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from rotfem.commands.accuracy import Missed
from rotfem.commands.pace import Pace, TooDear
from rotfem.commands.pursuit import MOST_ATTEMPTS, pursue
from rotfem.commands.root_accuracy import BY_ELEMENTS, judged
from rotfem.errors import ComputationError
from rotfem.scene import Scene
from rotfem.selection.accuracy import Settings
from tests.beams import STRUCTURE

SCENE = Scene.from_dict(
    {
        **{"accuracy": 1e-3, "structure": STRUCTURE, "time": {"end": 1.0}},
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
    }
)
LINEAR, FULL = ({"theory": name, "reduced": False} for name in ("consistent_linear", "reissner"))
SETTINGS = Settings((FULL,), 6, 3, "esdirk4", step=0.1)


def result(total: float | None, **parts: float | None) -> Any:
    """Return something with the summary of a result that is off by so much."""
    error = {"time": total, "space": 0.0, "model": 0.0, **parts, "total": total}
    summary = {"status": "done", "error": error, "timings": {"total": 1.0}}
    return SimpleNamespace(summary=summary, t=np.zeros(1), history={"root_m3": np.ones(1)})


def attempts(*outcomes: Any) -> tuple[list[Settings], Callable[[Settings], Any]]:
    """Return settings that are asked for, which grow, and what gives these outcomes one after the other."""
    asked: list[Settings] = []

    def attempt(settings: Settings) -> Any:
        asked.append(settings)
        outcome = outcomes[len(asked) - 1]
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    return asked, attempt


def pace(budget: float | None = None) -> Pace:
    return Pace(budget, MPI.COMM_SELF, end=1.0)


def test_the_first_that_meets_it_is_returned() -> None:
    good = result(5e-4)
    asked, attempt = attempts(result(1.6e-2), good)
    assert pursue(SCENE, SETTINGS, attempt, pace()) is good
    assert asked[1].step is not None
    assert asked[1].step < 0.1
    told = good.summary["accuracy"]
    assert told["met"]
    assert [tried["error"] for tried in told["attempts"]] == [1.6e-2, 5e-4]


def test_a_failure_in_finer_steps_leaves_what_was_reached() -> None:
    """The same model had answered, so what fails in shorter steps is no motion that ends; the failure is said."""
    reached = result(2e-3)
    with pytest.raises(Missed, match=r"0\.002 was reached, .* a further attempt failed: no convergence") as caught:
        pursue(SCENE, SETTINGS, attempts(reached, ComputationError("no convergence", advice="x"))[1], pace())
    assert vars(caught.value)["result"] is reached
    assert reached.summary["status"] == "failed"
    assert reached.summary["failure"]["advice"] == caught.value.advice == "x"


def test_a_failure_of_a_richer_model_stands() -> None:
    """A poorer one may not feel what ends the motion."""
    linear = Settings((LINEAR, FULL), 6, 3, "esdirk4", step=0.1)
    asked, attempt = attempts(result(0.5, time=0.0, model=0.5), ComputationError("it buckles"))
    with pytest.raises(ComputationError, match="it buckles") as caught:
        pursue(SCENE, linear, attempt, pace())
    assert not isinstance(caught.value, Missed)
    assert asked[1].models == (FULL,)


def test_what_interrupts_an_attempt_has_the_best_result_before() -> None:
    """Whatever of the next attempt is there: it is not whole. Before the first one there is nothing."""
    reached, stop = result(2e-3), KeyboardInterrupt()
    vars(stop)["result"] = result(None)
    with pytest.raises(KeyboardInterrupt):
        pursue(SCENE, SETTINGS, attempts(reached, stop)[1], pace())
    assert vars(stop)["result"] is reached
    assert reached.summary["status"] == "interrupted"
    assert not reached.summary["accuracy"]["met"]
    first = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        pursue(SCENE, SETTINGS, attempts(first)[1], pace())
    assert not hasattr(first, "result")


def test_what_is_too_dear_is_said_with_what_to_try() -> None:
    reached, budget = result(2e-3), pace(60.0)

    def attempt(settings: Settings) -> Any:
        if reached.summary.get("tried"):
            raise budget._dear(100.0)
        reached.summary["tried"] = True
        return reached

    with pytest.raises(Missed, match="of 60 s allowed too little is left for more") as caught:
        pursue(SCENE, SETTINGS, attempt, budget)
    assert "accuracy_budget" in caught.value.advice
    assert reached.summary["failure"]["advice"] == caught.value.advice
    with pytest.raises(TooDear):  # nothing was reached
        pursue(SCENE, SETTINGS, attempts(TooDear("nothing is left"))[1], pace(60.0))


def test_attempts_end() -> None:
    """Each three quarters of the one before: never met, and not stalled."""
    asked, attempt = attempts(*(result(0.75**i) for i in range(2 * MOST_ATTEMPTS)))
    with pytest.raises(Missed):
        pursue(SCENE, SETTINGS, attempt, pace())
    assert len(asked) == MOST_ATTEMPTS


def test_an_unknown_error_is_said_to_be_unknown() -> None:
    with pytest.raises(Missed, match=r"the error of what was reached is not known \(steps\)"):
        pursue(SCENE, SETTINGS, attempts(*[result(None)] * MOST_ATTEMPTS)[1], pace())


def test_moments_that_cannot_be_compared_leave_what_was_computed() -> None:
    """A comparison that would take too long leaves an error unknown; one that fails counts as wrong by all of it."""
    done, aside = result(1e-4), attempts(TooDear("too little is left"), ComputationError("it fails"))[1]
    found = judged(SETTINGS, lambda settings: done, aside, MPI.COMM_SELF)
    assert found is done
    assert (done.summary["error"]["time"], done.summary["error"]["total"]) == (None, None)
    assert done.summary["error"]["space"] == 1.0 / BY_ELEMENTS
    stop = KeyboardInterrupt()
    vars(stop)["result"] = result(None)
    with pytest.raises(KeyboardInterrupt):
        judged(SETTINGS, lambda settings: done, attempts(stop)[1], MPI.COMM_SELF)
    assert vars(stop)["result"] is done
    assert done.summary["status"] == "interrupted"
