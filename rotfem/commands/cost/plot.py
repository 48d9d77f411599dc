"""The figure of a study of cost: error over time."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from rotfem.commands.cost.result import CostResult, judged, mesh_name, step_name

#: A marker a scheme, or, where there are none, a degree.
MARKERS = "osD^Pv*X<>"

#: What an output's error is relative to.
ERRORS = {
    "tip": "error of the tip's motion, relative to its largest displacement (–)",
    "frequencies": "largest relative error of a frequency (–)",
    "campbell": "largest relative error of a frequency at any speed (–)",
}


def cost_figure(result: CostResult) -> Figure:
    """Return error over time: points by theory and scheme, Pareto front, floors of the models, uncertainty.

    A full point holds the error of the model; the faint ring is the error of its discretisation alone.
    """
    figure = Figure(figsize=(10.5, 6), layout="constrained")
    axis = figure.add_subplot()
    summary = result.summary
    theories = list(dict.fromkeys(row["theory"] for row in result.rows))
    colours = {theory: f"C{i}" for i, theory in enumerate(theories)}
    done = [row for row in result.rows if judged(row)]
    markers = dict(zip(dict.fromkeys(_kind(row) for row in result.rows), MARKERS, strict=False))
    for row in done:
        style: dict[str, Any] = {"marker": markers[_kind(row)], "color": colours[row["theory"]], "ls": "none"}
        if row["total_error"] is not None and row["error"]:
            axis.plot(row["cost"], row["error"], mfc="none", ms=5, alpha=0.35, **style)
        axis.plot(row["cost"], judged(row) or 0.0, ms=6, **style)
    front = sorted((row["cost"], judged(row)) for row in done if row["pareto"])
    axis.plot(*zip(*front, strict=True), "k-", lw=1.2, drawstyle="steps-post", zorder=0)
    axis.set(xscale="log", yscale="log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    for theory, floor in summary["model_errors"].items():
        if floor > 0 and theory in colours:
            axis.axhline(floor, color=colours[theory], ls="--", lw=1.0)
    failed = [row for row in result.rows if row["status"] == "failed" and row["cost"] == row["cost"]]
    for row in failed:
        top = axis.get_xaxis_transform()
        axis.plot(row["cost"], 0.98, "x", color=colours[row["theory"]], transform=top, ms=6, clip_on=False)
    _uncertainty(axis, summary, [judged(row) or 0.0 for row in done])
    chosen = summary["recommended"]
    if chosen is not None and judged(chosen):
        axis.plot(chosen["cost"], judged(chosen) or 0.0, "o", ms=14, mfc="none", mec="black", mew=1.2)
    for row in done:
        if row["pareto"]:
            axis.annotate(
                short_name(row), (row["cost"], judged(row) or 0.0), (5, 5), textcoords="offset points", size="x-small"
            )
    axis.set_xlabel("CPU time of one run with its set-up, median (s)")
    axis.set_ylabel(ERRORS[summary["output"]])
    axis.set_title(f"{summary['name']}: what accuracy costs")
    axis.grid(True, which="both", lw=0.3, alpha=0.5)
    handles = _legend(result, colours, markers, bool(failed))
    axis.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure


def _kind(row: dict[str, Any]) -> str:
    """Return what the marker of a setting stands for: its scheme, or its degree."""
    return str(row["scheme"] or f"degree {row['degree']}")


def short_name(row: dict[str, Any]) -> str:
    """Return mesh, degree, scheme, and step (s) or tolerance."""
    steps = "" if row["scheme"] is None else f", {row['scheme']} {step_name(row)}"
    return f"{mesh_name(row)} P{row['degree']}{steps}"


def _uncertainty(axis: Any, summary: dict[str, Any], errors: list[float]) -> None:
    """Shade the errors that the reference cannot resolve, down to the edge of the picture."""
    level = summary["uncertainty"]
    low = min(error for error in [*errors, 1.0] if error > 0) / 3
    if level:
        axis.set_ylim(bottom=min(low, level / 3), top=3 * axis.get_ylim()[1])
        axis.axhspan(axis.get_ylim()[0], level, color="0.85", zorder=-1)


def _legend(result: CostResult, colours: dict[str, str], markers: dict[str, str], failed: bool) -> list[Line2D]:
    """Return what the colours, markers and lines stand for."""
    rows, summary = result.rows, result.summary
    handles = []
    for theory, colour in colours.items():
        lost = all(row["status"] == "failed" for row in rows if row["theory"] == theory)
        handles.append(Line2D([], [], color=colour, lw=4, label=theory + (" (failed)" if lost else "")))
    handles += [Line2D([], [], color="0.3", marker=m, ls="none", label=kind) for kind, m in markers.items()]
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
