"""From measurements to a table of errors and times, its Pareto front and the setting to recommend. No dolfinx in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import Reference, distance, size
from rotfem.commands.cost.settings import Setting
from rotfem.mechanics.theories import ladder

Row = dict[str, Any]


def model_errors(references: Mapping[str, Reference], each: bool) -> dict[str, float]:
    """Return theory ↦ relative difference of its reference from the richest one's; empty where there is none."""
    best = truth_of(references)
    if best is None:
        return {}
    truth = references[best].samples
    return {theory: distance(r.samples, truth, each) for theory, r in references.items()}


def truth_of(references: Mapping[str, Reference]) -> str | None:
    """Return the richest theory that has a reference, by which all are judged; None where none has."""
    return next((theory for theory in reversed(ladder()) if theory in references), None)


def rows_of(
    measured: Mapping[Setting, tuple[str, Measurement]],
    references: Mapping[str, Reference],
    each: bool,
    theories: Sequence[str] | None = None,
) -> list[Row]:
    """Return one row a setting, which says what it was computed for: grid, reference or proposal.

    Of theories that were not asked for nothing is on the front or recommended, if theories were asked for.

    `error` is the distance to the reference of the same theory, `total_error` that to the richest theory's: what the
    model leaves out is in it. Both are relative to the richest theory's largest value (eigenvalues: each to its own).
    What a failed setting does not have is None.
    """
    floors = model_errors(references, each)
    best = truth_of(references)
    truth = None if best is None else references[best]
    scale = None if truth is None or each else size(truth.samples)
    rows = []
    for setting, (purpose, m) in measured.items():
        own = references.get(setting.theory)
        row: Row = {
            **setting.key(),
            "purpose": purpose,
            "candidate": theories is None or setting.theory in theories,
            "status": m.status,
            "error": None if own is None or m.samples is None else distance(m.samples, own.samples, each, scale),
            "model_error": floors.get(setting.theory),
            "total_error": None if truth is None or m.samples is None else distance(m.samples, truth.samples, each),
            "uncertainty": own.uncertainty if own else None,
            "cost": m.cost,
            "time": m.median("wall"),
            "cpu_time": m.median("cpu"),
            "time_min": min(m.wall, default=math.nan),
            "time_max": max(m.wall, default=math.nan),
            "setup": m.median("setup"),
            "setup_cpu": m.median("setup_cpu"),
            "memory": m.memory or None,
            "dofs": m.dofs or None,
            "steps": m.steps,
            "iterations": m.iterations,
            "repeats": len(m.wall),
            "pareto": False,
            "reason": m.reason,
        }
        rows.append(row)
    for row in pareto(rows):
        row["pareto"] = True
    return rows


def judged(row: Row) -> float | None:
    """Return the error a setting is judged by: with that of its model, where there is a reference to know it from."""
    if row["status"] != "done":
        return None
    value = row["error"] if row["total_error"] is None else row["total_error"]
    return value if value is not None and math.isfinite(value) else None


def pareto(rows: Sequence[Row]) -> list[Row]:
    """Return the rows for which no other one costs as little and is as exact, and is better in one; cheapest first."""
    best, front = math.inf, []
    candidates = (r for r in rows if r["candidate"] and judged(r) is not None)
    for row in sorted(candidates, key=lambda r: (r["cost"], judged(r))):
        error = judged(row)
        if error is not None and error < best:
            front.append(row)
            best = error
    return front


def recommend(rows: Sequence[Row], accuracy: float, uncertainty: float = 0.0) -> Row | None:
    """Return the cheapest row whose error, with the uncertainty of what it is measured against, is within accuracy."""
    for row in pareto(rows):
        error = judged(row)
        if error is not None and error + uncertainty <= accuracy:
            return row
    return None


def setting_of(row: Row) -> Setting:
    """Return the setting of a row."""
    names = ("theory", "elements", "degree", "scheme", "step", "tolerance", "every")
    values = {name: row[name] for name in names}
    if isinstance(values["elements"], list):
        values["elements"] = tuple(values["elements"])
    return Setting(**values)


def mesh_name(row: Row) -> str:
    """Return the mesh of a setting in short."""
    elements = row["elements"]
    mesh = "" if elements is None else "×".join(map(str, elements if isinstance(elements, list) else [elements])) + " "
    return f"{mesh}P{row['degree']}"


def describe(row: Row) -> str:
    """Return a setting in words."""
    text = f"{row['theory']}, {mesh_name(row)}"
    if row["step"] is not None:
        text += f", {row['scheme']} with step {row['step']:g} s"
    elif row["tolerance"] is not None:
        text += f", {row['scheme']} with tolerance {row['tolerance']:g}"
    return text
