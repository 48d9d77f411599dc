"""The figure of time and memory over the number of unknowns; imports only results."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from rotfem.commands.cost.result import CostResult


def scaling_figure(result: CostResult) -> Figure:
    """Return time and memory over the number of unknowns: measured, and what is predicted for larger systems."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    marching = any(row["scheme"] is not None for row in result.rows)
    _growth(left, result, "time", 1.0)
    _growth(right, result, "memory", 1e6)
    left.set_ylabel("CPU time of a step (s)" if marching else "CPU time with set-up (s)")
    right.set_ylabel("memory at the height (MB)")
    right.legend(fontsize="small")
    return figure


def _growth(axis: Any, result: CostResult, name: str, unit: float) -> None:
    """Draw a column of the table of sizes over the unknowns."""
    rows = result.summary["scaling"]
    for i, theory in enumerate(dict.fromkeys(row["theory"] for row in rows)):
        mine = [row for row in rows if row["theory"] == theory]
        known = [row for row in mine if not row["predicted"]]
        ahead = [known[-1], *(row for row in mine if row["predicted"])]
        for part, style in ((ahead, "o--"), (known, "o-")):
            x, y = [row["dofs"] for row in part], [row[name] / unit for row in part]
            axis.plot(x, y, style, color=f"C{i}", mfc="none" if part is ahead else None, ms=4)
        axis.plot([], [], "o-", color=f"C{i}", ms=4, label=theory)
    axis.plot([], [], "o--", color="0.3", mfc="none", ms=4, label="predicted")
    axis.set(xscale="log", yscale="log", xlabel="unknowns")
    axis.grid(True, which="both", lw=0.3, alpha=0.5)
