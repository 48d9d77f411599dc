"""Figures of results; imports only results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rotfem.results import plots_explain

from rotfem.results import plots_plate
from rotfem.errors import OutputError
from rotfem.results.results import CampbellResult, ExplainResult, ModesResult, RunResult

#: Label and unit of every column that is plotted.
LABELS = {
    "t": "time t (s)",
    "x": "position X (m)",
    "psi_dot": "speed Ω (rad/s)",
    "u1": "u₁ (m)",
    "u2": "u₂ (m)",
    "u3": "u₃ (m)",
    "alpha": "rotation α (rad)",
    **{f"theta{i}": f"rotation θ{sub} (rad)" for i, sub in zip((1, 2, 3), "₁₂₃", strict=True)},
    **{f"alpha{i}": f"rotation α{sub} (rad)" for i, sub in zip((1, 2), "₁₂", strict=True)},
    "kinetic": "kinetic energy (J)",
    "strain": "strain energy (J)",
    "jacobi": "Jacobi integral (J)",
}


def label(column: str) -> str:
    """Return the axis label of a column, with its unit."""
    name = column.removeprefix("tip_")
    return ("tip " if column.startswith("tip_") else "") + LABELS.get(name, name)


def plot(result: RunResult | ModesResult | CampbellResult | ExplainResult, folder: Path) -> list[Path]:
    """Write the figures of a result into a folder; return their paths."""
    if isinstance(result, ExplainResult):
        return [save(plots_explain.explain_figure(result), folder / "explain.png")]
    if isinstance(result, RunResult):
        return plot_run(result, folder)
    if isinstance(result, ModesResult):
        if result.triangles is not None:
            return [save(plots_plate.modes_figure(result), folder / "modes.png")]
        return [save(shapes_figure(result), folder / "modes.png")]
    paths = [save(campbell_figure(result), folder / "campbell.png")]
    if result.travelling_waves():
        paths.append(save(travelling_waves_figure(result), folder / "travelling_waves.png"))
    return paths


def plot_run(result: RunResult, folder: Path) -> list[Path]:
    """Write history.png of a time history, shape.png of a steady state; return their paths."""
    title = f"{result.summary['name']}: {result.summary['theory']}"
    if result.summary["status"] != "done":
        title += f" ({result.summary['status']})"
    paths = []
    if len(result.history.get("t", ())) > 1:
        paths.append(save(history_figure(result, title), folder / "history.png"))
    if result.shape and result.triangles is not None:
        paths.append(save(plots_plate.shape_figure(result, title + ", final shape"), folder / "shape.png"))
    elif result.shape and len(result.history.get("t", ())) <= 1:
        paths.append(save(shape_figure(result, title), folder / "shape.png"))
    return paths


def history_figure(result: RunResult, title: str) -> Figure:
    """Return the tip's components, and the speed over time."""
    h = result.history
    columns = [*(c for c in h if c.startswith("tip_")), "psi_dot"]
    return stacked(h, "t", columns, title)


def shape_figure(result: RunResult, title: str) -> Figure:
    """Return the components of the final shape along the structure."""
    s = result.shape
    return stacked(s, "x", [c for c in s if c != "x"], title + ", steady state", marker=".")


def shapes_figure(result: ModesResult) -> Figure:
    """Return the shapes of all modes along the structure, largest component 1; imaginary parts dashed."""
    shapes = result.shapes
    rows = result.rows[len(result.rows) - len(shapes) :]  # a rigid-body mode comes first and has no shape
    figure = Figure(figsize=(9, 1.7 * len(shapes) + 0.8))
    for i, ((title, columns), row) in enumerate(zip(shapes.items(), rows, strict=True), start=1):
        axis = figure.add_subplot(len(shapes), 1, i)
        names = [name for name in columns if name != "x" and not name.endswith("_imag")]
        for c, name in enumerate(names):
            axis.plot(columns["x"], columns[name], lw=1.3, color=f"C{c}", label=label(name).split(" (")[0])
            if np.max(np.abs(columns[f"{name}_imag"])) > 1e-3:
                axis.plot(columns["x"], columns[f"{name}_imag"], lw=1.0, ls="--", color=f"C{c}")
        axis.set_title(f"{title}, {row['frequency']:.4g} rad/s", fontsize=9, pad=3)
        axis.set_ylabel("shape (–)", fontsize=8)
        axis.grid(True, lw=0.4, alpha=0.6)
        if i < len(shapes):
            axis.set_xticklabels([])
        if i == 1:
            axis.legend(fontsize=8, ncols=len(names), loc="upper left")
    axis.set_xlabel(label("x") + "; imaginary parts dashed")
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.1, right=0.97, top=1 - 0.35 / height, bottom=0.55 / height, hspace=0.35)
    return figure


def campbell_figure(result: CampbellResult) -> Figure:
    """Return frequency over speed with labelled branches, per-rev lines, their crossings and instabilities."""
    figure = Figure(figsize=(9, 6.5))
    axis = figure.add_subplot()
    branches = result.branches()
    top = 1.05 * max(float(np.max(b["frequency"])) for b in branches.values())
    last = max(float(b["speed"][-1]) for b in branches.values())
    for i, (name, b) in enumerate(branches.items()):
        axis.plot(b["speed"], b["frequency"], lw=1.6, color=f"C{i % 10}")
        axis.annotate(name, (b["speed"][-1], b["frequency"][-1]), (5, -3), textcoords="offset points", fontsize=8)
        unstable = b["growth"] > 1e-6 * (np.abs(b["frequency"]) + np.abs(b["growth"]))
        axis.plot(b["speed"][unstable], b["frequency"][unstable], "x", ms=5, color=f"C{i % 10}")
    for k in range(1, result.summary["per_rev"] + 1):
        end = min(last, top / k)
        axis.plot([0, end], [0, k * end], lw=0.7, ls=":", color="0.4")
        axis.annotate(f"{k}Ω", (end, k * end), (-2, 3), textcoords="offset points", fontsize=7, color="0.4", ha="right")
    crossings = result.summary["critical_speeds"]
    axis.plot([c["speed"] for c in crossings], [c["frequency"] for c in crossings], "ko", ms=3.5, mfc="none")
    for onset in result.summary["instabilities"]:
        axis.axvline(onset["speed"], color="C3", lw=0.8, ls="-.")
        axis.annotate(
            onset["kind"], (onset["speed"], top), (3, -10), textcoords="offset points", fontsize=7, color="C3"
        )
    axis.set_xlim(min(0.0, *(float(b["speed"][0]) for b in branches.values())), last * 1.12)
    axis.set_ylim(0, top)
    axis.set_xlabel(label("psi_dot"))
    axis.set_ylabel("frequency in the rotating frame (rad/s)")
    axis.set_title(f"{result.summary['name']}: {result.summary['theory']}")
    axis.grid(True, lw=0.4, alpha=0.6)
    return figure


def travelling_waves_figure(result: CampbellResult) -> Figure:
    """Return the forward and backward waves of a disk over speed, as seen from the fixed frame."""
    figure = Figure(figsize=(9, 6.5))
    axis = figure.add_subplot()
    for i, (name, waves) in enumerate(result.travelling_waves().items()):
        axis.plot(waves["speed"], waves["forward"], lw=1.4, color=f"C{i % 10}", label=name)
        axis.plot(waves["speed"], waves["backward"], lw=1.4, ls="--", color=f"C{i % 10}")
    axis.axhline(0.0, color="0.4", lw=0.7)
    axis.set_xlabel(label("psi_dot"))
    axis.set_ylabel("frequency in the fixed frame (rad/s)")
    axis.set_title(
        f"{result.summary['name']}: forward waves solid, backward dashed (standing still at a critical speed)"
    )
    axis.legend(fontsize=8)
    axis.grid(True, lw=0.4, alpha=0.6)
    return figure


def stacked(data: dict[str, Any], x: str, columns: list[str], title: str, marker: str = "") -> Figure:
    """Return one panel a column over the common abscissa x."""
    figure = Figure(figsize=(8, 1.8 * len(columns) + 0.6))
    for i, column in enumerate(columns, start=1):
        axis = figure.add_subplot(len(columns), 1, i)
        axis.plot(data[x], data[column], lw=1.2, marker=marker, ms=4)
        axis.set_ylabel(label(column))
        axis.grid(True, lw=0.4, alpha=0.6)
        if i == 1:
            axis.set_title(title)
        if i < len(columns):
            axis.set_xticklabels([])
    axis.set_xlabel(label(x))
    figure.align_ylabels()
    figure.subplots_adjust(
        left=0.14, right=0.97, top=1 - 0.4 / figure.get_figheight(), bottom=0.55 / figure.get_figheight()
    )
    return figure


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG.

    Raises:
        OutputError: it cannot be written.
    """
    try:
        FigureCanvasAgg(figure)
        figure.savefig(path, dpi=100)
    except OSError as error:
        raise OutputError(path, error.strerror or str(error)) from None
    return path
