"""Figures of results: every function that draws takes a result and returns a figure, one function writes them."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rotfem.results.columns import described, label
from rotfem.results.files import write_whole
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    from rotfem.results.campbell import CampbellResult
    from rotfem.results.modes import ModesResult
    from rotfem.results.result import Result
    from rotfem.results.run import RunResult


def plot(result: Result, folder: Path) -> list[Path]:
    """Write all figures of a result into a folder; return their paths.

    Raises:
        OutputError: one cannot be written.
    """
    return [save(draw(), folder / name) for name, draw in result.drawings().items()]


def history_figure(result: RunResult) -> Figure:
    """Return the tip's components, and the speed over time."""
    h = result.history
    columns = [*(c for c in h if c.startswith("tip_")), "psi_dot"]
    units = ShownUnits.of(result.summary)
    return stacked(h | {"psi_dot": units.speeds(h["psi_dot"])}, "t", columns, result.title, {"psi_dot": units.speed})


def shape_figure(result: RunResult) -> Figure:
    """Return the components of a steady state along the structure."""
    s = result.shape
    return stacked(s, "x", [c for c in s if c != "x"], result.title + ", steady state")


def shapes_figure(result: ModesResult) -> Figure:
    """Return the shapes of all modes along the structure, scaled as in `ModesResult`; imaginary parts dashed."""
    shapes = result.shapes
    rows = result.rows[len(result.rows) - len(shapes) :]  # a rigid-body mode comes first and has no shape
    units = ShownUnits.of(result.summary)
    figure = Figure(figsize=(9, 1.7 * len(shapes) + 0.8))
    for i, ((title, columns), row) in enumerate(zip(shapes.items(), rows, strict=True), start=1):
        axis = figure.add_subplot(len(shapes), 1, i)
        names = [name for name in columns if name != "x" and not name.endswith("_imag")]
        for c, name in enumerate(names):
            axis.plot(columns["x"], columns[name], lw=1.3, color=f"C{c}", label=described(f"shape_{name}")[0][7:])
            if np.max(np.abs(columns[f"{name}_imag"])) > 1e-3:
                axis.plot(columns["x"], columns[f"{name}_imag"], lw=1.0, ls="--", color=f"C{c}")
        axis.set_title(f"{title}, {units.frequencies(row['frequency']):.4g} {units.frequency}", fontsize=9, pad=3)
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
    units, branches = ShownUnits.of(result.summary), shown_branches(result)
    top = 1.05 * max(float(np.max(b["frequency"])) for b in branches.values())
    last = max(float(b["speed"][-1]) for b in branches.values())
    heights = spread([float(b["frequency"][-1]) for b in branches.values()], 0.022 * top)
    for i, (name, b) in enumerate(branches.items()):
        axis.plot(b["speed"], b["frequency"], lw=1.6, color=f"C{i % 10}")
        axis.annotate(
            name,
            (float(b["speed"][-1]), heights[i]),
            (5, -3),
            textcoords="offset points",
            annotation_clip=False,
            fontsize=8,
            color=f"C{i % 10}",
        )
        unstable = b["unstable"]
        axis.plot(b["speed"][unstable], b["frequency"][unstable], "x", ms=5, color=f"C{i % 10}")
    rise = float(units.frequencies(1.0) / units.speeds(1.0))  # of the line 1Ω
    for k in range(1, result.summary["per_rev"] + 1):
        end = min(last, top / (k * rise))
        axis.plot([0, end], [0, k * rise * end], lw=0.7, ls=":", color="0.4")
        axis.annotate(
            f"{k}Ω", (end, k * rise * end), (-2, 3), textcoords="offset points", fontsize=7, color="0.4", ha="right"
        )
    crossings = result.summary["critical_speeds"]
    met = [units.speeds([c["speed"] for c in crossings]), units.frequencies([c["frequency"] for c in crossings])]
    axis.plot(*met, "ko", ms=3.5, mfc="none")
    for onset in result.summary["instabilities"]:
        begin = float(units.speeds(onset["speed"]))
        axis.axvline(begin, color="C3", lw=0.8, ls="-.")
        axis.annotate(onset["kind"], (begin, top), (3, -10), textcoords="offset points", fontsize=7, color="C3")
    axis.set_xlim(min(0.0, *(float(b["speed"][0]) for b in branches.values())), last)
    axis.set_ylim(0, top)
    axis.set_xlabel(label("psi_dot", units.speed))
    axis.set_ylabel(label("frequency", units.frequency))
    axis.set_title(result.title)
    axis.grid(True, lw=0.4, alpha=0.6)
    figure.subplots_adjust(left=0.09, right=0.86, top=0.94, bottom=0.08)  # the labels stand outside on the right
    return figure


def shown_branches(result: CampbellResult) -> dict[str, dict[str, Any]]:
    """Return label ↦ `speed`, `frequency` in the units that are shown, and `unstable`, whether the mode grows there."""
    units = ShownUnits.of(result.summary)
    return {
        name: {
            "speed": units.speeds(b["speed"]),
            "frequency": units.frequencies(b["frequency"]),
            "unstable": b["growth"] > 1e-6 * (np.abs(b["frequency"]) + np.abs(b["growth"])),
        }
        for name, b in result.branches().items()
    }


def spread(values: list[float], gap: float) -> list[float]:
    """Return the values with the upper ones raised until all are at least `gap` apart, so that labels can be read."""
    out, last = list(values), -np.inf
    for i in np.argsort(values, kind="stable"):
        last = out[i] = max(values[i], last + gap)
    return out


def travelling_waves_figure(result: CampbellResult) -> Figure:
    """Return the forward and backward waves of a disk over speed, as seen from the fixed frame."""
    figure = Figure(figsize=(9, 6.5))
    axis = figure.add_subplot()
    units = ShownUnits.of(result.summary)
    for i, (name, waves) in enumerate(result.travelling_waves().items()):
        speed, forward, backward = (
            units.speeds(waves["speed"]),
            *(units.frequencies(waves[which]) for which in ("forward", "backward")),
        )
        axis.plot(speed, forward, lw=1.4, color=f"C{i % 10}", label=name)
        axis.plot(speed, backward, lw=1.4, ls="--", color=f"C{i % 10}")
    axis.axhline(0.0, color="0.4", lw=0.7)
    axis.set_xlabel(label("psi_dot", units.speed))
    axis.set_ylabel(f"frequency in the fixed frame ({units.frequency})")
    axis.set_title(
        f"{result.title}; forward waves solid, backward dashed (standing still at a critical speed)", size=10
    )
    axis.legend(fontsize=8)
    axis.grid(True, lw=0.4, alpha=0.6)
    figure.subplots_adjust(left=0.09, right=0.97, top=0.94, bottom=0.08)
    return figure


def stacked(
    data: dict[str, Any], x: str, columns: list[str], title: str, units: Mapping[str, str] | None = None
) -> Figure:
    """Return one panel a column over the common abscissa x, with marks where it is a position.

    Args:
        data: column ↦ values.
        x: column of the abscissa.
        columns: those that are drawn.
        title: of the figure.
        units: column ↦ unit of its values, where it is not the usual one.
    """
    units = units or {}
    marker = "." if x == "x" else ""
    figure = Figure(figsize=(8, 1.8 * len(columns) + 0.6))
    for i, column in enumerate(columns, start=1):
        axis = figure.add_subplot(len(columns), 1, i)
        axis.plot(data[x], data[column], lw=1.2, marker=marker, ms=4)
        axis.set_ylabel(label(column, units.get(column, "")))
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
    """Write a figure whole or not at all, in the format of the file's ending, PNG if it has none; return the path.

    Raises:
        ValueError: Matplotlib does not write that format.
        OutputError: it cannot be written.
    """
    content = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(content, dpi=100, format=path.suffix[1:] or "png")
    return write_whole(path, content.getvalue())
