"""What it would have taken to recommend a setting where the time was too short for it. No dolfinx in it."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

from rotfem.commands.cost.front import Row, model_errors, recommend, setting_of, truth_of
from rotfem.commands.cost.proposals import Knowledge

if TYPE_CHECKING:
    from rotfem.commands.cost.exploration import Study


def outlook(study: Study, rows: list[Row], accuracy: float) -> dict[str, Any] | None:
    """Return the `setting` that should be good enough, its CPU time `cost` (s), and the `budget` (s) to know it.

    It is one that was computed where that is within the accuracy, but for what is uncertain of the reference. None
    where time was not what is missing, or nothing can be said, as errors do not fall with an order yet.

    Args:
        study: what was done.
        rows: of its settings.
        accuracy: asked for.
    """
    truth, used = truth_of(study.references), study.budget.summary()
    if truth is None or all(entry["time"] is None for entry in used["refused"]):
        return None
    found = recommend(rows, accuracy)
    if found is not None:
        setting, cost = setting_of(found), found["cost"]
    elif not study.refinement.settled(truth, study.enough(accuracy)):
        return None
    else:
        errors = {t: e for t, e in model_errors(study.references, study.each).items() if t in study.allowed}
        known = Knowledge(study.plan, rows, study.refinement.meshes, errors, 0.0, study.laboratory.prediction)
        proposal = known.best(accuracy, study.fixed)
        if proposal is None or not isfinite(proposal.cost):
            return None
        setting, cost = proposal.setting, proposal.cost
    wanted = used["used"] + study.refinement.to_take(truth, study.enough(accuracy)) + study.repeat * cost
    return {"setting": setting.key(), "cost": cost, "budget": float(f"{wanted:.1e}")} if isfinite(wanted) else None
