"""What a work–precision study proposes and predicts, and what its budget refuses, from measurements made up for it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from rotfem.commands.cost.budget import Budget, seconds_of
from rotfem.commands.cost.front import Row
from rotfem.commands.cost.prediction import Prediction
from rotfem.commands.cost.proposals import Knowledge, where
from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import Samples
from rotfem.commands.cost.refinement import Plan
from rotfem.commands.cost.settings import Setting
from rotfem.commands.cost.summary import closest, missing
from rotfem.errors import SceneError

END = 10.0
ORDERS = {"generalised_alpha": 2, "esdirk4": 4}


def error_of(setting: Setting) -> float:
    """Return the error of a setting: h² or (2h)⁴ in time, n⁻⁶ in space."""
    assert setting.step is not None
    assert isinstance(setting.elements, int)
    factor = {"generalised_alpha": 1.0, "esdirk4": 2.0}[setting.scheme or ""]
    return (factor * setting.step) ** ORDERS[setting.scheme or ""] + setting.elements**-6.0


def measured(setting: Setting) -> Measurement:
    """Return a measurement that takes 1 ms a stage and 0.1 s of set-up."""
    assert setting.step is not None
    assert isinstance(setting.elements, int)
    steps, stages = round(END / setting.step), {"generalised_alpha": 1, "esdirk4": 5}[setting.scheme or ""]
    spent = [1e-3 * steps * stages]
    nothing = Samples(np.zeros((1, 1)), np.empty(0))
    return Measurement("done", "", nothing, spent, spent, [0.1], [0.1], 1e6, 9 * setting.elements, steps)


def row_of(setting: Setting) -> Row:
    m = measured(setting)
    return {**setting.key(), "status": "done", "candidate": True, "error": error_of(setting), "cost": m.cost}


def knowledge(settings: list[Setting], **more: Any) -> Knowledge:
    """Return what is known after some settings: their errors, times, and the errors of three meshes."""
    prediction = Prediction(1, END)
    for setting in settings:
        prediction.learn(setting, measured(setting))
    own = settings[0]
    meshes = [(Setting(own.theory, n, 3, own.scheme, own.step), n**-6.0) for n in (2, 4, 8)]
    plan = Plan(own, each=False, first_step=0.1, interval=0.1)
    known: dict[str, Any] = {"meshes": {"reissner": meshes}, "model_errors": {"reissner": 0.0}, "uncertainty": 1e-7}
    return Knowledge(plan, [row_of(s) for s in settings], **(known | more), prediction=prediction)


STEPS = [Setting("reissner", 8, 3, scheme, h) for scheme in ORDERS for h in (0.1, 0.05)]
STEPS += [Setting("reissner", 4, 3, "generalised_alpha", 0.1)]


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-5])
def test_what_is_proposed_keeps_its_promise_and_nothing_known_is_as_cheap(accuracy: float) -> None:
    known = knowledge(STEPS)
    proposal = known.best(accuracy)
    assert proposal is not None
    setting = proposal.setting
    assert setting.step is not None
    assert error_of(setting) <= proposal.error * 1.001 <= accuracy
    assert proposal.cost == pytest.approx(measured(setting).cost, rel=0.05)
    assert round(0.1 / setting.step, 6) % 1 == 0 or round(setting.step / 0.1, 6) % 1 == 0  # samples coincide
    good = [measured(s).cost for s in STEPS if error_of(s) <= accuracy]
    assert all(proposal.cost <= cost * 1.001 for cost in good)


def test_the_scheme_of_high_order_wins_where_much_is_asked_for() -> None:
    fine = knowledge(STEPS).best(1e-5)
    assert fine is not None
    assert fine.setting.scheme == "esdirk4"


def test_no_theory_is_proposed_that_is_not_exact_enough() -> None:
    known = knowledge(STEPS, model_errors={"reissner": 0.0, "linear": 0.9e-4})
    proposal = known.best(1e-4)
    assert proposal is not None
    assert proposal.setting.theory == "reissner"
    assert knowledge(STEPS, uncertainty=1e-4).best(1e-4) is None


def test_nothing_is_proposed_where_what_is_uncertain_has_no_bound() -> None:
    """After one level of a reference, for want of time, no error is known."""
    assert knowledge(STEPS, uncertainty=np.inf).best(np.inf) is None
    assert closest([row_of(s) | {"total_error": 1e-3} for s in STEPS], 1e-4, np.inf) is None


def test_the_closest_is_one_that_may_be_recommended() -> None:
    """A level of a reference by a theory that is not asked for is more exact, and none of the answers."""
    rows = [row_of(s) | {"total_error": 1e-3} for s in STEPS]
    rows.append(row_of(STEPS[0]) | {"total_error": 1e-9, "candidate": False})
    found = closest(rows, 1e-4, 1e-8)
    assert found is not None
    assert found["within"] == pytest.approx(1e-3, rel=0.11)
    assert found["row"]["candidate"]
    assert "the best error is 1.0e-03" in missing(rows, 1e-4, 1e-8, [])
    ahead = {"setting": STEPS[0].key(), "cost": 4.2, "budget": 120.0}
    said = missing(rows, 1e-4, 1e-8, [], ahead)
    assert "should be within 0.0001 in about 4.2 s of CPU time, which a --budget of about 120s" in said


def test_listed_meshes_and_steps_are_not_departed_from() -> None:
    proposal = knowledge(STEPS).best(1e-4, {"elements"})
    assert proposal is not None
    assert proposal.setting.elements in (4, 8)
    assert knowledge(STEPS).best(1e-4, {"elements", "steps"}) is None


def test_where_an_error_is_met() -> None:
    points = [(0.1, 1e-4), (0.2, 4e-4), (0.4, 1.6e-3)]
    assert where(points, 4e-4, 2) == pytest.approx(0.2)
    assert where(points, 1e-4 / 9, 2) == pytest.approx(0.1 / 3)
    assert where(points, 8e-4, 2) == pytest.approx(0.2 * np.sqrt(2))
    assert where(points, 6.4e-3, 2) == pytest.approx(0.8)
    assert where(points, 1e3, 2) == pytest.approx(1.2)  # not farther than that from what was measured


def test_time_and_memory_are_continued_over_unknowns() -> None:
    """Of time c N^1.5 a step and memory m0 + c N^1.15 (a plate), and of a scheme with as many stages as it has."""
    prediction = Prediction(2, END)
    for n in (8, 16, 32):
        nodes = (2 * n + 1) ** 2
        spent = [1e-6 * nodes**1.5 * 100]
        m = Measurement("done", "", None, spent, spent, [0.0], [0.0], 2e7 + 5e3 * nodes**1.15, nodes, 100)
        prediction.learn(Setting("reissner", (n, n), 2, "newmark", 0.1), m)
    far, nodes = prediction.of(Setting("reissner", (64, 64), 2, "newmark", 0.05)), 129**2
    assert far["cpu"] == pytest.approx(1e-6 * nodes**1.5 * 200, rel=0.02)
    assert far["memory"] == pytest.approx(2e7 + 5e3 * nodes**1.15, rel=0.05)
    high = prediction.of(Setting("reissner", (32, 32), 2, "esdirk4", 0.1))
    assert high["cpu"] == pytest.approx(5 * 1e-6 * 65**3 * 100, rel=1e-6)
    ahead = [row for row in prediction.scaling() if row["predicted"]]
    assert [row["dofs"] for row in ahead] == [4 * 65**2, 16 * 65**2]
    assert ahead[1]["time"] == pytest.approx(1e-6 * (16 * 65**2) ** 1.5, rel=0.01)


def test_what_every_size_takes_is_told_apart_from_what_grows() -> None:
    """Campbell diagrams of a tapered plate: 0.88 s and 1.89 s are measured of two sizes, 8.3 s of the next one."""
    prediction = Prediction(2, 0.0)
    for n, dofs, spent in ((5, 385, 0.875), (10, 1365, 1.888)):
        setting = Setting("consistent_linear", (n, n), 2)
        prediction.learn(setting, Measurement("done", "", None, [1.0], [spent], [0.0], [0.0], 3e7, dofs, 0))
    assert prediction.time("consistent_linear", 1365) == pytest.approx(1.888)
    assert prediction.time("consistent_linear", 5125) == pytest.approx(8.28, rel=0.05)
    assert 0.5 < prediction.time("consistent_linear", 30) < 0.875


def test_budget_refuses_what_takes_too_long_or_too_much_memory() -> None:
    budget = Budget(60.0, MPI.COMM_WORLD)
    one, two, three = (Setting("reissner", n, 3) for n in (1, 2, 3))
    assert budget.allows(one, {"cpu": 20.0, "memory": 1e6}, 0.5)
    assert not budget.allows(two, {"cpu": 40.0, "memory": 1e6}, 0.5)
    assert not budget.allows(three, {"cpu": 1.0, "memory": 1e18}, 0.5)
    assert budget.allows(one, {"cpu": None, "memory": None}, 0.5)
    reasons = [entry["why"] for entry in budget.summary()["refused"]]
    assert reasons[0].startswith("would take about 40 s")
    assert "GB" in reasons[1]
    assert not Budget(1e-9, MPI.COMM_WORLD).allows(one, {"cpu": None, "memory": None}, 0.5)


def test_times_are_read_with_their_units() -> None:
    assert [seconds_of(text) for text in ("60", "60s", " 2min", "1h", 5)] == [60.0, 60.0, 120.0, 3600.0, 5.0]
    for wrong in ("", "s", "-1", "1 day", "1e99h", "1.2.3s"):
        with pytest.raises(SceneError, match="cost --budget"):
            seconds_of(wrong)
