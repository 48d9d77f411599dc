"""Figures of results; imports only results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rotfem.errors import OutputError
from rotfem.results import RunResult

#: Label and unit of every column that is plotted.
LABELS = {
    "t": "time t (s)",
    "x": "position X (m)",
    "psi_dot": "speed Ω (rad/s)",
    "u1": "u₁ (m)",
    "u2": "u₂ (m)",
    "u3": "u₃ (m)",
    "alpha": "rotation α (rad)",
    "kinetic": "kinetic energy (J)",
    "strain": "strain energy (J)",
    "jacobi": "Jacobi integral (J)",
}


def label(column: str) -> str:
    """Return the axis label of a column, with its unit."""
    name = column.removeprefix("tip_")
    return ("tip " if column.startswith("tip_") else "") + LABELS.get(name, name)


def plot_run(result: RunResult, folder: Path) -> list[Path]:
    """Write history.png of a time history, shape.png of a steady state; return their paths."""
    title = f"{result.summary['name']}: {result.summary['theory']}"
    if result.summary["status"] != "done":
        title += f" ({result.summary['status']})"
    paths = []
    if len(result.history.get("t", ())) > 1:
        paths.append(save(history_figure(result, title), folder / "history.png"))
    elif result.shape:
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
