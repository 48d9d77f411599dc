"""From measurements to a table of errors and times, its Pareto front and the setting to recommend. No dolfinx in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import Reference, distance, size
from rotfem.commands.cost.settings import Setting
from rotfem.mechanics.theories import richest

Row = dict[str, Any]


def model_errors(references: Mapping[str, Reference], each: bool) -> dict[str, float]:
    """Return theory ↦ relative difference of its reference from the richest theory's; empty where that has none."""
    if richest().name not in references:
        return {}
    truth = references[richest().name].samples
    return {theory: distance(r.samples, truth, each) for theory, r in references.items()}


def rows_of(
    measured: Sequence[tuple[Setting, Measurement]], references: Mapping[str, Reference], each: bool
) -> list[Row]:
    """Return one row a setting.

    `error` is the distance to the reference of the same theory, `total_error` that to the richest theory's: what the
    model leaves out is in it. Both are relative to the richest theory's largest value (eigenvalues: each to its own).
    What a failed setting does not have is None.
    """
    floors = model_errors(references, each)
    truth = references.get(richest().name)
    scale = None if truth is None or each else size(truth.samples)
    rows = []
    for setting, m in measured:
        own = references.get(setting.theory)
        row: Row = {
            **setting.key(),
            "status": m.status,
            "error": None if own is None or m.samples is None else distance(m.samples, own.samples, each, scale),
            "model_error": floors.get(setting.theory),
            "total_error": None if truth is None or m.samples is None else distance(m.samples, truth.samples, each),
            "uncertainty": own.uncertainty if own else None,
            "time": m.median("wall"),
            "cpu_time": m.median("cpu"),
            "time_min": min(m.wall, default=math.nan),
            "time_max": max(m.wall, default=math.nan),
            "setup": m.median("setup"),
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
    """Return the rows for which no other one is as fast and as exact, and better in one; fastest first."""
    best, front = math.inf, []
    for row in sorted((r for r in rows if judged(r) is not None), key=lambda r: (r["time"], judged(r))):
        error = judged(row)
        if error is not None and error < best:
            front.append(row)
            best = error
    return front


def recommend(rows: Sequence[Row], accuracy: float, uncertainty: float = 0.0) -> Row | None:
    """Return the fastest row whose error, with the uncertainty of what it is measured against, is within accuracy."""
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


def describe(row: Row) -> str:
    """Return a setting in words."""
    elements = row["elements"]
    mesh = "" if elements is None else "×".join(map(str, elements if isinstance(elements, list) else [elements])) + " "
    text = f"{row['theory']}, {mesh}P{row['degree']}"
    if row["step"] is not None:
        text += f", {row['scheme']} with step {row['step']:g} s"
    elif row["tolerance"] is not None:
        text += f", {row['scheme']} with tolerance {row['tolerance']:g}"
    return text
