"""The summary of a work–precision study. No dolfinx in it."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

from rotfem.commands.cost.front import Row, describe, judged, model_errors, recommend, truth_of
from rotfem.commands.cost.outlook import outlook
from rotfem.mechanics.theories import richest
from rotfem.version import versions

if TYPE_CHECKING:
    from rotfem.commands.cost.exploration import Study

#: Uncertainties below this are not worth a warning.
ROUND_OFF = 1e-9

#: What misses the best that was reached by this factor is as good where it is cheaper.
NEAR = 1.05

#: Accuracies a setting is recommended for besides the wanted one.
DECADES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


def study_summary(study: Study, rows: list[Row], accuracy: float, quick: bool) -> dict[str, Any]:
    """Return the summary of a study.

    Args:
        study: what was done.
        rows: of its settings.
        accuracy: asked for.
        quick: whether the grid was the small one.
    """
    references, laboratory = study.references, study.laboratory
    truth = truth_of(references)
    uncertainty = 0.0 if truth is None else references[truth].uncertainty
    best = {a: recommend(rows, a, uncertainty) for a in sorted({*DECADES, accuracy}, reverse=True)}
    nearest = closest(rows, accuracy, uncertainty) if best[accuracy] is None else None
    ahead = outlook(study, rows, accuracy) if best[accuracy] is None else None
    used, compiling = study.budget.summary(), laboratory.bench.compiling
    return {
        "command": "cost",
        "status": "done",
        "name": study.scene.name,
        "output": study.output,
        "quick": quick,
        "accuracy": accuracy,
        "truth": truth,
        "uncertainty": uncertainty,
        "references": {
            t: {"order": r.order, "uncertainty": r.uncertainty, "parts": r.parts} for t, r in references.items()
        },
        "reference_failures": study.failures,
        "reference_largest": largest(rows),
        "model_errors": model_errors(references, study.each),
        "recommended": best[accuracy],
        "promise": promise(best[accuracy], uncertainty),
        "closest": nearest,
        "missing": missing(rows, accuracy, uncertainty, used["refused"], ahead) if best[accuracy] is None else "",
        "outlook": ahead,
        "recommendations": [{"accuracy": a, "setting": r and describe(r), "row": r} for a, r in best.items()],
        "scaling": laboratory.prediction.scaling(),
        "settings": len(rows),
        "failed": sum(row["status"] == "failed" for row in rows),
        "measured": laboratory.new,
        "resumed": len(laboratory.taken),
        "budget": used,
        "timings": {"compile": compiling, "other": used["used"] - compiling, "total": used["used"]},
        "warnings": _warnings(study, rows, accuracy, uncertainty),
        "versions": versions(),
        "ranks": laboratory.comm.size,
        "scene": study.scene.digest(),
    }


def promise(row: Row | None, uncertainty: float) -> dict[str, float] | None:
    """Return what a recommended setting promises: its error as measured, and its bound; times (s), memory (bytes)."""
    if row is None:
        return None
    error = judged(row) or 0.0
    names = ("time", "cpu_time", "setup", "setup_cpu", "cost", "memory")
    return {"error": error, "bound": error + uncertainty, **{name: row[name] for name in names}}


def largest(rows: list[Row]) -> dict[str, float]:
    """Return the most unknowns, time and CPU time (s, with set-up), memory (bytes) of what references are made of."""
    made = [row for row in rows if row["purpose"] == "reference" and row["status"] == "done"]
    return {
        "dofs": max((row["dofs"] or 0 for row in made), default=0),
        "time": max((row["setup"] + row["time"] for row in made), default=0.0),
        "cost": max((row["cost"] for row in made), default=0.0),
        "memory": max((row["memory"] or 0.0 for row in made), default=0.0),
    }


def closest(rows: list[Row], accuracy: float, uncertainty: float) -> dict[str, Any] | None:
    """Return `within`, the least accuracy above the one asked for that is known to be met, and the `row` that does.

    None where nothing could be judged.
    """
    errors = _errors(rows)
    if not errors or not isfinite(uncertainty):
        return None
    within = float(f"{NEAR * max(min(errors) + uncertainty, accuracy):.1e}")
    return {"within": within, "row": recommend(rows, within, uncertainty)}


def missing(
    rows: list[Row],
    accuracy: float,
    uncertainty: float,
    refused: list[dict[str, Any]],
    ahead: dict[str, Any] | None = None,
) -> str:
    """Return what was reached, and what it takes to recommend a setting where there is none (see `outlook`)."""
    errors = _errors(rows)
    known = errors and isfinite(uncertainty)
    said = f"the best error is {min(errors):.1e}, known to {uncertainty:.0e}" if known else "nothing could be judged"
    wanted = [entry for entry in refused if entry["time"] is not None]
    if ahead is not None:
        said += (
            f"; the budget left out {len(refused)} settings; {describe(ahead['setting'])} should be within "
            f"{accuracy:g} in about {ahead['cost']:.2g} s of CPU time, which a --budget of about "
            f"{ahead['budget']:.0f}s should suffice to find"
        )
    elif wanted:
        together = sum(entry["time"] for entry in wanted)
        said += f"; the budget left out {len(refused)} settings, which would take about {together:.2g} s"
    elif refused:
        said += f"; {describe(refused[0]['setting'])} {refused[0]['why']}"
    return said


def _errors(rows: list[Row]) -> list[float]:
    """Return the errors of all settings that may be recommended, as far as they are known."""
    return [error for error in (judged(row) for row in rows if row["candidate"]) if error is not None]


def _warnings(study: Study, rows: list[Row], accuracy: float, uncertainty: float) -> list[str]:
    out = []
    if richest().name not in study.references:
        reason = study.failures.get(richest().name, "")
        out.append(f"no reference of {richest().name} ({reason}): errors do not include that of the model")
    for theory, r in study.references.items():
        mine = [row["error"] for row in rows if row["theory"] == theory and row["error"]]
        if mine and r.uncertainty > max(ROUND_OFF, 0.5 * min(mine)) and r.uncertainty > accuracy / 2:
            out.append(
                f"the reference of {theory} is uncertain by {r.uncertainty:.1e}, the best setting off by "
                f"{min(mine):.1e}: errors near that are not resolved"
            )
    return out
