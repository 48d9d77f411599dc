"""The work–precision figure; imports only results."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from rotfem.commands.cost.front import judged
from rotfem.commands.cost.result import CostResult

#: A marker a degree.
MARKERS = {1: "v", 2: "s", 3: "o", 4: "D", 5: "P", 6: "*"}

#: What an output's error is relative to.
ERRORS = {
    "tip": "error of the tip's motion, relative to its largest displacement (–)",
    "frequencies": "largest relative error of a frequency (–)",
}


def cost_figure(result: CostResult) -> Figure:
    """Return error over time: points by theory and degree, Pareto front, floors of the models, uncertainty.

    A full point holds the error of the model; the faint ring is the error of its discretisation alone.
    """
    figure = Figure(figsize=(9, 6), layout="constrained")
    axis = figure.add_subplot()
    summary = result.summary
    theories = list(dict.fromkeys(row["theory"] for row in result.rows))
    colours = {theory: f"C{i}" for i, theory in enumerate(theories)}
    done = [row for row in result.rows if judged(row)]
    for row in done:
        style: dict[str, Any] = {"marker": MARKERS[row["degree"]], "color": colours[row["theory"]], "ls": "none"}
        if row["total_error"] is not None and row["error"]:
            axis.plot(row["time"], row["error"], mfc="none", ms=5, alpha=0.35, **style)
        axis.plot(row["time"], judged(row) or 0.0, ms=6, **style)
    front = sorted((row["time"], judged(row)) for row in done if row["pareto"])
    axis.plot(*zip(*front, strict=True), "k-", lw=1.2, drawstyle="steps-post", zorder=0)
    axis.set(xscale="log", yscale="log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    for theory, floor in summary["model_errors"].items():
        if floor > 0 and theory in colours:
            axis.axhline(floor, color=colours[theory], ls="--", lw=1.0)
    failed = [row for row in result.rows if row["status"] == "failed" and row["time"] == row["time"]]
    for row in failed:
        top = axis.get_xaxis_transform()
        axis.plot(row["time"], 0.98, "x", color=colours[row["theory"]], transform=top, ms=6, clip_on=False)
    _uncertainty(axis, summary, [judged(row) or 0.0 for row in done])
    chosen = summary["recommended"]
    if chosen is not None and judged(chosen):
        axis.plot(chosen["time"], judged(chosen) or 0.0, "o", ms=14, mfc="none", mec="black", mew=1.2)
    axis.set_xlabel("time of one run without set-up, median (s)")
    axis.set_ylabel(ERRORS[summary["output"]])
    axis.set_title(f"{summary['name']}: what accuracy costs")
    axis.grid(True, which="both", lw=0.3, alpha=0.5)
    axis.legend(handles=_legend(result, colours, bool(failed)), fontsize="small", ncols=2, loc="best")
    return figure


def _uncertainty(axis: Any, summary: dict[str, Any], errors: list[float]) -> None:
    """Shade the errors that the reference cannot resolve, down to the edge of the picture."""
    level = summary["uncertainty"]
    low = min(error for error in [*errors, 1.0] if error > 0) / 3
    if level:
        axis.set_ylim(bottom=min(low, level / 3), top=3 * axis.get_ylim()[1])
        axis.axhspan(axis.get_ylim()[0], level, color="0.85", zorder=-1)


def _legend(result: CostResult, colours: dict[str, str], failed: bool) -> list[Line2D]:
    """Return what the colours, markers and lines stand for."""
    rows, summary = result.rows, result.summary
    handles = []
    for theory, colour in colours.items():
        lost = all(row["status"] == "failed" for row in rows if row["theory"] == theory)
        handles.append(Line2D([], [], color=colour, lw=4, label=theory + (" (failed)" if lost else "")))
    for degree in sorted({row["degree"] for row in rows}):
        handles.append(Line2D([], [], color="0.3", marker=MARKERS[degree], ls="none", label=f"degree {degree}"))
    handles.append(Line2D([], [], color="black", lw=1.2, label="Pareto front"))
    if any(summary["model_errors"].values()):
        handles.append(Line2D([], [], color="0.3", lw=1.0, ls="--", label="error of the model"))
    if failed:
        handles.append(Line2D([], [], color="0.3", marker="x", ls="none", label="failed, at the time it took"))
    if summary["recommended"] is not None:
        text = f"recommended for {summary['accuracy']:g}"
        handles.append(Line2D([], [], color="black", marker="o", mfc="none", ms=11, ls="none", label=text))
    handles.append(Line2D([], [], color="0.85", lw=6, label=f"uncertainty {summary['uncertainty'] or 0:.0e}"))
    return handles
