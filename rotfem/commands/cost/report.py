"""What `rotfem cost` prints. No dolfinx in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rotfem.commands.cost.front import describe, judged

#: Rows of a table that is printed in full.
LONGEST_TABLE = 40


def cost_report(summary: dict[str, Any], rows: list[dict[str, Any]], folder: Path) -> list[str]:
    """Return the lines `cost` prints: the table (of a large study its Pareto front), floors, what is recommended."""
    lines = [
        f"{summary['name']}: error of {summary['output']}, {summary['settings']} settings ({summary['failed']} failed, "
        f"{summary['resumed']} results from before) in {summary['timings']['total']:.1f} s",
        f"{'theory':<18}{'elements':>9}{'P':>3}{'scheme':>19}{'step (s)':>11}{'dofs':>7}"
        f"{'CPU (s)':>9}{'time (s)':>10}{'error':>9}{'total':>9}",
    ]
    shown = rows if len(rows) <= LONGEST_TABLE else [row for row in rows if row["pareto"]]
    for row in sorted(shown, key=lambda r: (r["status"] == "failed", r["cost"])):
        n, step = row["elements"], row["step"]
        mesh = "–" if n is None else "×".join(map(str, n if isinstance(n, list) else [n]))
        way = "–" if row["scheme"] is None else f"{step:.5g}" if step is not None else f"tol {row['tolerance']:.3g}"
        lines.append(
            f"{row['theory']:<18}{mesh:>9}{row['degree']:>3}{row['scheme'] or '–':>19}{way:>11}{row['dofs'] or '–':>7}"
            f"{row['cost']:>9.3f}{row['setup'] + row['time']:>10.3f}"
            + (f"{_short(row['error'])}{_short(row['total_error'])}" if judged(row) is not None else f"{'failed':>18}")
            + (" *" if row["pareto"] else "")
        )
    if len(shown) < len(rows):
        lines.append("only the Pareto front is shown; all settings are in cost.csv")
    for theory, floor in summary["model_errors"].items():
        uncertain = summary["references"][theory]["uncertainty"]
        lines.append(f"{theory}: error of the model {floor:.1e}, reference known to {uncertain:.0e}")
    largest = summary["reference_largest"]
    if largest["dofs"]:
        lines.append(
            f"largest reference: {largest['dofs']} unknowns; longest {largest['cost']:.2g} s of CPU time; most memory "
            f"{largest['memory'] / 1e6:.0f} MB"
        )
    if summary["budget"]["refused"]:
        lines.append(f"{len(summary['budget']['refused'])} settings were left out for want of time or memory")
    for theory, reason in summary["reference_failures"].items():
        lines.append(f"{theory}: failed, {reason}")
    row = summary["recommended"]
    if row is None:
        lines.append(f"no setting is known to be within {summary['accuracy']:g}: {summary['missing']}")
        near = summary["closest"]
        if near is not None:
            lines.append(f"within {near['within']:g}: {describe(near['row'])}, {near['row']['cost']:.3g} s of CPU time")
    else:
        lines.append(
            f"for {summary['accuracy']:g}: {describe(row)}: error {judged(row):.1e}, known to "
            f"{summary['uncertainty']:.0e}, {row['cost']:.3g} s of CPU time"
        )
    return [*lines, f"results in {folder}"]


def _short(value: float | None) -> str:
    return f"{'–':>9}" if value is None else f"{value:>9.1e}"
