"""What follows an answer that misses an accuracy, and what is left where there is no next one; nothing is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from rotfem.commands.accuracy import Missed, to_accuracy
from rotfem.errors import ComputationError, Stopped
from rotfem.listeners import Compiling
from rotfem.refinement.distance import distance
from rotfem.refinement.refine import HIGHEST, MOST_ANSWERS, SAFETY, Clock, OverBudget, Refinement, Setting, refine
from rotfem.scene import Scene
from tests.beams import STRUCTURE

SCENE = Scene.from_dict(
    {
        **{"accuracy": 1e-3, "structure": STRUCTURE, "time": {"end": 1.0}},
        "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
    }
)
LINEAR, FULL = ({"theory": name} for name in ("consistent_linear", "reissner"))
SETTING = Setting((FULL,), 6, 3, "esdirk4", 1e-2)


class Answer(SimpleNamespace):
    """Something with a summary."""

    def with_summary(self, **entries: Any) -> Answer:
        return Answer(summary={**self.summary, **entries})


def result(total: float | None, **parts: float | None) -> Any:
    """Return something with the summary of a result that has such an error."""
    error = {"time": total, "space": 0.0, "model": 0.0, **parts, "total": total}
    return Answer(summary={"status": "done", "error": error, "timings": {"total": 1.0}})


def attempts(*outcomes: Any) -> tuple[list[Setting], Callable[[Setting], Any]]:
    """Return settings that are asked for, which grow, and what gives these outcomes one after the other."""
    asked: list[Setting] = []

    def attempt(setting: Setting) -> Any:
        asked.append(setting)
        outcome = outcomes[len(asked) - 1]
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    return asked, attempt


def clock(budget: float | None = None) -> Clock:
    return Clock(budget, MPI.COMM_SELF)


def test_distance_is_a_distance() -> None:
    """Zero of equal ones, relative to the first, infinite from nothing to something; the triangle inequality."""
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(3, 20, 2))
    assert distance(a, a) == 0.0
    assert distance(a, 3 * a) == pytest.approx(2.0)
    assert distance(0 * a, a) == np.inf
    scale = np.linalg.norm(a, axis=1).max()
    assert distance(a, c) <= distance(a, b) + distance(b, c) * np.linalg.norm(b, axis=1).max() / scale


@pytest.mark.parametrize(("order", "constant"), [(1.0, 3.0), (1.0, 300.0)])
def test_promise(order: float, constant: float) -> None:
    """Of answers whose error is c·tolerance + C·n^{-4} the last one is within the accuracy.

    However much the error by the mesh is under-estimated, up to SAFETY; that by the steps is not.
    """

    def compute(setting: Setting) -> Any:
        assert setting.tolerance is not None
        assert isinstance(setting.elements, int)
        time, space = constant * setting.tolerance**order, 50.0 * setting.elements**-4.0
        return time + space, {"time": time, "space": space / SAFETY, "total": time + space / SAFETY}

    found = refine(SETTING, compute, 1e-4, clock())
    assert found.best is not None
    assert found.best.result <= 1e-4
    assert len(found.tried) <= 4


def test_the_largest_contribution_is_refined_by_its_order() -> None:
    """Steps by their tolerance, elements of degree k by the power 1/(k + 1), a model by the next richer one."""
    steps = SETTING.finer({"time": 0.1, "space": 0.0, "total": 0.1}, 1e-3)
    assert steps is not None
    assert steps.tolerance == pytest.approx(1e-2 * 0.5e-3 * 0.5 / 0.1)
    assert steps.elements == 6
    mesh = SETTING.finer({"time": 0.0, "space": 2e-3, "total": 2e-3}, 1e-3)
    assert mesh is not None
    assert mesh.elements == int(np.ceil(6 * 16 ** (1 / 4)))
    assert mesh.tolerance == 1e-2
    poor = Setting((LINEAR, FULL), 6, 3, "esdirk4", 1e-2)
    assert poor.finer({"model": 0.5, "total": 0.5}, 1e-3) == SETTING
    assert SETTING.finer({"model": 0.5, "total": 0.5}, 1e-3) is None
    far = SETTING.finer({"time": 1e9, "space": 1e9, "total": 2e9}, 1e-3)
    assert far is not None
    assert (far.elements, far.tolerance) == (8 * SETTING.elements, SETTING.tolerance / 8**4)
    lost = SETTING.finer({"time": 2.5, "space": 1.4, "total": 3.9}, 1e-3)  # no digit: the asymptotic range comes first
    assert lost is not None
    assert lost.tolerance == pytest.approx(1e-2 * 0.5 * 0.05 / 2.5)
    assert lost.elements == int(np.ceil(6 * (1.4 / 0.025) ** (1 / 4)))
    file, coarse = Setting((FULL,), None, 2, "esdirk4", 1e-2), {"time": 0.0, "space": 0.1, "total": 0.1}
    assert file.finer(coarse, 1e-3) == replace(file, degree=3)
    assert replace(file, degree=HIGHEST).finer(coarse, 1e-3) is None


def test_the_first_that_meets_it_is_returned() -> None:
    good = result(4e-4)
    asked, attempt = attempts(result(1.6e-2), good)
    done = to_accuracy(SCENE, SETTING, attempt, clock())
    assert done.summary["error"] is good.summary["error"]
    assert asked[1].tolerance is not None
    assert asked[1].tolerance < 1e-2
    told = done.summary["accuracy"]
    assert told["met"]
    assert [tried["error"] for tried in told["attempts"]] == [1.6e-2, 4e-4]


def test_an_answer_that_meets_it_is_returned_though_another_has_a_smaller_error() -> None:
    """The error by a theory is an estimate and counts twice; that by the steps is a bound."""
    setting = replace(SETTING, models=(LINEAR, FULL))
    asked, attempt = attempts(result(6e-4, time=0.0, model=6e-4), result(8e-4, time=8e-4))
    assert to_accuracy(SCENE, setting, attempt, clock()).summary["accuracy"]["estimated"] == 8e-4
    assert len(asked) == 2


def test_a_failure_in_finer_steps_leaves_what_was_reached() -> None:
    """The same model had answered, so what fails in shorter steps is no motion that ends; the failure is said."""
    reached = result(2e-3)
    with pytest.raises(Missed, match=r"0\.002 was reached, .* a further attempt failed: no convergence") as caught:
        to_accuracy(SCENE, SETTING, attempts(reached, ComputationError("no convergence", advice="x"))[1], clock())
    kept = caught.value.result.summary
    assert kept["error"] is reached.summary["error"]
    assert kept["status"] == "failed"
    assert kept["failure"]["advice"] == caught.value.advice == "x"


def test_a_failure_of_a_richer_model_stands() -> None:
    """A poorer one may not feel what ends the motion."""
    linear = Setting((LINEAR, FULL), 6, 3, "esdirk4", 1e-2)
    asked, attempt = attempts(result(0.5, time=0.0, model=0.5), ComputationError("it buckles"))
    with pytest.raises(ComputationError, match="it buckles") as caught:
        to_accuracy(SCENE, linear, attempt, clock())
    assert not isinstance(caught.value, Missed)
    assert asked[1].models == (FULL,)


def test_what_interrupts_an_answer_has_the_best_result_before() -> None:
    """Whatever of the next answer is there: it is not whole. Before the first one there is nothing."""
    reached = result(2e-3)
    with pytest.raises(Stopped) as caught:
        to_accuracy(SCENE, SETTING, attempts(reached, Stopped(result(None)))[1], clock())
    kept = caught.value.result.summary
    assert kept["error"] is reached.summary["error"]
    assert kept["status"] == "interrupted"
    assert not kept["accuracy"]["met"]
    first = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        to_accuracy(SCENE, SETTING, attempts(first)[1], clock())
    assert not hasattr(first, "result")


def test_what_is_too_dear_is_said_with_what_to_try(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first answer takes 10 s; the second would take more than what is left of 12 s, and is not begun."""
    now = [0.0]
    monkeypatch.setattr("rotfem.refinement.refine.cpu_time", lambda: now[0])
    reached, budget = result(2e-3), clock(12.0)

    def attempt(setting: Setting) -> Any:
        now[0] += 10.0
        return reached

    with pytest.raises(Missed, match="accuracy_budget are left") as caught:
        to_accuracy(SCENE, SETTING, attempt, budget)
    assert "accuracy_budget" in caught.value.advice
    assert caught.value.result.summary["accuracy"]["budget"]["wanted"] > 10.0
    with pytest.raises(OverBudget):  # nothing was reached
        to_accuracy(SCENE, SETTING, attempts(OverBudget("nothing is left"))[1], clock(60.0))


def test_what_is_compiled_is_not_compiled_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first answer takes 10 s, 9.9 s of them compilation: the second is not expected to take as long."""
    now = [0.0]
    monkeypatch.setattr("rotfem.refinement.refine.cpu_time", lambda: now[0])
    monkeypatch.setattr(Compiling, "seconds", 0.0)
    answers = iter([result(2e-3), result(1e-5)])

    def attempt(setting: Setting) -> Any:
        now[0] += 10.0 - Compiling.seconds
        Compiling.seconds = 9.9
        return next(answers)

    assert to_accuracy(SCENE, SETTING, attempt, clock(12.0)).summary["accuracy"]["met"]


def test_an_answer_that_is_too_dear_ends_while_it_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """A third of what is left has shown that the rest would take three times that."""
    now = [0.0]
    monkeypatch.setattr("rotfem.refinement.refine.cpu_time", lambda: now[0])
    budget = clock(30.0)
    budget.begin("x", 1, None)

    def march() -> None:
        for steps in range(100):
            now[0] += 1.0
            budget(steps, steps / 100)

    with pytest.raises(OverBudget):
        march()
    assert now[0] < 20.0


def test_a_finer_setting_that_changes_nothing_is_the_last() -> None:
    """Steps below what Newton's increments allow are all the same: the failure names them, and no third is computed."""
    asked, attempt = attempts(result(2e-3), result(2e-3))
    with pytest.raises(Missed, match="a finer setting gave the same answer") as caught:
        to_accuracy(SCENE, SETTING, attempt, clock())
    assert len(asked) == 2
    assert "solver.increment_tolerance" in caught.value.advice


def test_answers_end() -> None:
    """Each three quarters of the one before: never met."""
    asked, attempt = attempts(*(result(0.75**i) for i in range(2 * MOST_ANSWERS)))
    with pytest.raises(Missed):
        to_accuracy(SCENE, SETTING, attempt, clock())
    assert len(asked) == MOST_ANSWERS


def test_an_unknown_error_is_said_to_be_unknown() -> None:
    with pytest.raises(Missed, match=r"the error of what was reached is not known \(steps\)"):
        to_accuracy(SCENE, SETTING, attempts(*[result(None)] * MOST_ANSWERS)[1], clock())


def test_the_best_is_the_one_that_is_known() -> None:
    found: Refinement[str] = refine(
        SETTING, attempts(("a", result(None).summary["error"]), ("b", result(1e-5).summary["error"]))[1], 1e-3, clock()
    )
    assert found.best is not None
    assert found.best.result == "b"
