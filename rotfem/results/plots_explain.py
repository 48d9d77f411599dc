"""The bar chart of what effects and theories change; imports only results."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from rotfem.results.explain import ExplainResult

#: Relative changes below it are not drawn.
ROUND_OFF = 1e-9


def explain_figure(result: ExplainResult) -> Figure:
    """Return a bar for every effect and theory: relative change of each output, truth as a mark beside the estimate."""
    rows, outputs = result.rows, result.summary["outputs"]
    figure = Figure(figsize=(8, 0.45 * len(rows) + 1.4))
    axis = figure.add_subplot()
    shown = [v for row in rows for v in row["estimate"].values() if ROUND_OFF < v < np.inf]
    left, right = 10 ** np.floor(np.log10(min([*shown, 1e-2]))) / 3, 3 * max([*shown, 1.0])
    height = 0.8 / max(len(outputs), 1)
    for j, output in enumerate(outputs):
        for i, row in enumerate(rows):
            value, at = row["estimate"].get(output, 0.0), i + (j - (len(outputs) - 1) / 2) * height
            axis.barh(
                at,
                float(np.clip(value, left, right)) - left,
                height,
                left=left,
                color=f"C{j}",
                label=output if i == 0 else None,
            )
            if not np.isfinite(value):
                axis.annotate("fails", (right, at), (-3, -3), textcoords="offset points", fontsize=8, ha="right")
            if output in row.get("truth", {}) and np.isfinite(row["truth"][output]):
                truth = max(row["truth"][output], left)
                axis.plot(truth, at, "k|", ms=9, mew=2, label="both models run" if i == j == 0 else None)
    axis.axvline(1e-2, color="0.4", lw=0.8, ls="--")
    axis.set_xscale("log")
    axis.set_xlim(left, right)
    names = [f"{'without' if row['included'] else 'with'} {row['name']}" for row in rows]
    names = [n if row["kind"] == "effect" else row["name"] for n, row in zip(names, rows, strict=True)]
    axis.set_yticks(range(len(rows)), names)
    axis.invert_yaxis()
    axis.set_xlabel("relative change of the output (–)")
    figure.suptitle(f"{result.summary['name']}: what each effect and other theories change", fontsize=10)
    axis.grid(True, axis="x", lw=0.4, alpha=0.6)
    tall = figure.get_figheight()
    figure.subplots_adjust(left=0.27, right=0.97, top=1 - 0.65 / tall, bottom=0.55 / tall)
    figure.legend(fontsize=8, loc="upper right", ncols=4, bbox_to_anchor=(0.98, 1 - 0.28 / tall), frameon=False)
    return figure
