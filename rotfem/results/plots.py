"""Figures of results: every function that draws takes a result and returns a figure, one function writes them.

A number below `ZERO` of the largest of its unit is shown as 0, in all figures. What is 0 everywhere has no panel; a
line below the title names it.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rotfem.results.columns import ZERO, described, is_at_station, label, shown_unit, zeros
from rotfem.results.files import write_whole
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rotfem.results.modes import ModesResult
    from rotfem.results.response import ResponseResult
    from rotfem.results.result import Result
    from rotfem.results.run import RunResult, StationHistory

Array = npt.NDArray[np.float64]

#: How all grids are drawn.
GRID: dict[str, Any] = {"visible": True, "lw": 0.4, "alpha": 0.6}

#: Periods above which a history is drawn as the range and the mean of stretches of it, and the number of these.
PERIODS, STRETCHES = 500, 250

#: Height of a peak that counts as a period, part of the range of a history.
PEAK = 1e-2

#: Part of the largest displacement below which a line cannot be distinguished from 0.
VISIBLE = 1e-3

#: Part of the frequencies, those of deep antiresonances, at which an amplitude may lie below what is drawn.
RARE = 0.05


def plot(result: Result, folder: Path) -> list[Path]:
    """Write all figures of a result into a folder; return their paths."""
    return [save(draw(), folder / name) for name, draw in result.drawings().items()]


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


# --- panels -----------------------------------------------------------------------------------------------------------


def grid_of(number: int, size: tuple[float, float], title: str, note: str = "") -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels in one column or more, the first column filled first, with a common abscissa.

    Args:
        number: of panels.
        size: width and height of a panel, inch.
        title: of the figure.
        note: line below the title.
    """
    columns = 1 if number <= 3 else 2 if number <= 12 else 3
    rows = -(-max(number, 1) // columns)
    width = max(size[0] * columns, 7.0)
    figure = Figure(figsize=(width, size[1] * rows + 1.0), layout="constrained")
    figure.suptitle(title + (f"\n{note}" if note else ""), fontsize=10)
    panels = [figure.add_subplot(rows, columns, (i % rows) * columns + i // rows + 1) for i in range(number)]
    for i, panel in enumerate(panels):
        panel.grid(**GRID)
        panel.tick_params(labelsize=8, labelbottom=i % rows == rows - 1 or i == number - 1)
        panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        panel.yaxis.get_offset_text().set_fontsize(7)
    return figure, panels


def lowest(panels: Sequence[Axes]) -> list[Axes]:
    """Return the panels that have the labels of the abscissa."""
    return [panel for panel in panels if panel.xaxis.get_tick_params()["labelbottom"]]


def stacked(
    data: Mapping[str, Array],
    x: str,
    columns: Sequence[str],
    title: str,
    units: Mapping[str, str] | None = None,
    sizes: Mapping[str, Array] | None = None,
) -> Figure:
    """Return one panel a column over the common abscissa x, with marks where it is a position.

    Args:
        data: column ↦ values.
        x: column of the abscissa.
        columns: those that are drawn, but for those that are 0.
        title: of the figure.
        units: column ↦ unit of its values, where it is not the usual one.
        sizes: column ↦ values by which it is 0 or not, where these are others; also drawn, as a range (low, high).
    """
    sizes = sizes or {}
    zero = zeros({name: sizes.get(name, data[name]) for name in columns})
    shown = [name for name in columns if name not in zero]
    figure, panels = grid_of(len(shown), (5.0, 1.75), title, said_zero(zero))
    for panel, name in zip(panels, shown, strict=True):
        caption = described(name)[0]
        if x == "t":
            caption += history_line(panel, data[x], data[name])
        else:
            panel.plot(data[x], data[name], lw=1.2, marker=".", ms=4)
        if name in sizes:
            panel.fill_between(data[x], *sizes[name], alpha=0.2, lw=0.0)
        panel.set_title(caption, fontsize=8, loc="left", pad=3)
        panel.set_ylabel(shown_unit(name, (units or {}).get(name, "")), fontsize=8)
        panel.set_xlim(data[x][0], data[x][-1])
    for panel in lowest(panels):
        panel.set_xlabel(label(x), fontsize=8)
    figure.align_ylabels()
    return figure


def said_zero(names: Sequence[str]) -> str:
    """Return the line that says what has no panel."""
    if not names:
        return ""
    listed = ", ".join(described(name)[0] for name in names[:6]) + (" …" if len(names) > 6 else "")
    return f"0 (below {ZERO:.0e} of the largest of the unit): {listed}".replace("e-0", "e-")


def history_line(axis: Axes, t: Array, y: Array) -> str:
    """Draw a history, one of more than `PERIODS` periods as range and mean of stretches; return what to say of it."""
    from scipy.signal import find_peaks  # half of what `import` of this file would take

    periods = len(find_peaks(y, prominence=PEAK * float(np.ptp(y)))[0]) if np.ptp(y) > 0.0 else 0
    if periods <= PERIODS:
        axis.plot(t, y, lw=1.0)
        return ""
    parts = np.array_split(np.arange(len(t)), STRETCHES)
    middle = np.array([t[part].mean() for part in parts])
    low, high, mean = (np.array([f(y[part]) for part in parts]) for f in (np.min, np.max, np.mean))
    axis.fill_between(middle, low, high, alpha=0.35, lw=0.0)
    axis.plot(middle, mean, lw=1.2)
    return f", range and mean of {periods} periods"


# --- runs -------------------------------------------------------------------------------------------------------------


def history_figure(result: RunResult) -> Figure:
    """Return the motion of the tip, and of the hub unless it turns at one speed: speed, angle and torque."""
    units, history = ShownUnits.of(result.summary), result.history
    tip = [name for name in history if name.startswith("tip_")]
    hub = [name for name in ("psi_dot", "psi", "pitch", "torque") if name in history]
    speed = history["psi_dot"]
    title = result.title
    if np.ptp(speed) <= ZERO * np.max(np.abs(speed)):
        hub = [name for name in hub if not name.startswith("psi")]
        title += f", {units.speeds(speed[0]):.6g} {units.speed}"
    return stacked(history | {"psi_dot": units.speeds(speed)}, "t", [*tip, *hub], title, {"psi_dot": units.speed})


def loads_figure(result: RunResult) -> Figure:
    """Return forces and moments of the hub on the root over time."""
    names = [name for name in result.history if name.startswith("root_")]
    return stacked(result.history, "t", names, f"{result.title}, loads of the hub on the root")


def shape_figure(result: RunResult) -> Figure:
    """Return the components of a steady state along the structure."""
    s = result.shape
    return stacked(s, "x", [c for c in s if c != "x"], result.title + ", steady state")


def stations_figure(stations: StationHistory, title: str) -> Figure:
    """Return every quantity along a beam at the last time, and of a motion the range it has had."""
    last = {"x": stations.x, **{name: values[-1] for name, values in stations.values.items()}}
    if len(stations.t) < 2:
        return stacked(last, "x", list(stations.values), title)
    ranges = {name: np.stack([v.min(axis=0), v.max(axis=0)]) for name, v in stations.values.items()}
    title += f", t = {stations.t[-1]:.6g} s, and the range over time"
    return stacked(last, "x", list(stations.values), title, sizes=ranges)


# --- small motions ----------------------------------------------------------------------------------------------------


def shapes_figure(result: ModesResult) -> Figure:
    """Return displacements and twist of all modes of a beam, scaled as in `ModesResult`; imaginary parts dashed.

    Rotations of bending are the slopes of what is drawn, and left out.
    """
    shapes = result.shapes
    rows = result.rows[len(result.rows) - len(shapes) :]  # a rigid-body mode comes first and has no shape
    units = ShownUnits.of(result.summary)
    names = [n for n in next(iter(shapes.values())) if (n.startswith("u") or n == "theta1") and not n.endswith("_imag")]
    note = "largest displacement 1, imaginary parts dashed"
    figure, panels = grid_of(len(shapes), (5.0, 1.75), f"{result.title}, {note}")
    drawn = {}
    for panel, columns, row in zip(panels, shapes.values(), rows, strict=True):
        for c, name in enumerate(names):
            size = np.max(np.hypot(columns[name], columns[f"{name}_imag"]))
            if size > VISIBLE:
                what = described(f"shape_{name}")[0].removeprefix("shape, ").replace("rotation", "twist")
                drawn[name] = panel.plot(columns["x"], columns[name], lw=1.4, color=f"C{c}", label=what)[0]
            if np.max(np.abs(columns[f"{name}_imag"])) > VISIBLE:
                panel.plot(columns["x"], columns[f"{name}_imag"], lw=1.0, ls="--", color=f"C{c}")
        panel.set_title(
            f"{row['mode']}  {row['name']}, {units.frequencies(row['frequency']):.4g} {units.frequency}",
            fontsize=8,
            loc="left",
            pad=3,
        )
        panel.set_xlim(columns["x"][0], columns["x"][-1])
        panel.set_ylabel("shape (–)", fontsize=8)
    for panel in lowest(panels):
        panel.set_xlabel(label("x"), fontsize=8)
    handles = [drawn[name] for name in names if name in drawn]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(names), fontsize=8, frameon=False)
    return figure


def response_figure(result: ResponseResult) -> Figure:
    """Return amplitudes, direct and by modes (dashed), and phases over frequency, of tip, root and hub.

    A row has what is of one kind. Deep antiresonances are cut off.
    """
    units = ShownUnits.of(result.summary)
    own = {name: i for i, name in enumerate(result.outputs) if not is_at_station(name)}
    zero = zeros({name: np.abs(result.direct[:, i]) for name, i in own.items()})
    shown = [name for name in own if name not in zero]
    kinds = {name: (name.partition("_")[0], described(name)[1]) for name in shown}
    rows = list(dict.fromkeys(kinds.values()))
    figure = Figure(figsize=(10.0, 2.1 * max(len(rows), 1) + 1.2), layout="constrained")
    at = f"{units.speeds(result.summary['speed']):.6g} {units.speed}"
    notes = ["amplitudes by modes dashed", *filter(None, [said_zero(zero)])]
    figure.suptitle(f"{result.title}, at {at}\n" + "; ".join(notes), fontsize=10)
    if not rows:
        return figure
    panels = figure.subplots(len(rows), 2, sharex=True, squeeze=False)
    x = units.frequencies(result.frequencies)
    for (left, right), kind in zip(panels, rows, strict=True):
        names = [name for name in shown if kinds[name] == kind]
        sizes = np.abs(result.direct[:, [own[name] for name in names]])
        for c, name in enumerate(names):
            direct, modal = result.direct[:, own[name]], np.abs(result.modal[:, own[name]])
            left.semilogy(x, np.abs(direct), lw=1.3, color=f"C{c}")
            left.semilogy(x, modal, lw=0.9, ls="--", color="0.3")
            phase = np.degrees(np.angle(direct))
            jumps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 180.0)
            broken = np.insert(x, jumps, np.nan), np.insert(phase, jumps, np.nan)
            right.plot(*broken, lw=1.2, color=f"C{c}", label=name_in_legend(name))
        seen = max(0.3 * float(np.min(np.quantile(sizes, RARE, axis=0))), ZERO * float(np.max(sizes)))
        left.set_ylim(seen, 3.0 * float(np.max(sizes)))
        left.set_ylabel(f"amplitude {shown_unit(names[0])}", fontsize=8)
        right.set_ylabel("phase (°)", fontsize=8)
        right.set_yticks(np.arange(-180, 181, 90))
        right.set_ylim(-190, 190)
        right.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=8, frameon=False)
    for panel in panels.ravel():
        panel.grid(**GRID)
        panel.tick_params(labelsize=8)
        panel.set_xlim(x[0], x[-1])
    for panel in panels[-1]:
        panel.set_xlabel(f"frequency of the load ({units.frequency})", fontsize=8)
    return figure


def name_in_legend(name: str) -> str:
    """Return what an output is in few words: "tip u₁", "root f₁", "angle ψ"."""
    place, _, _ = name.partition("_")
    return f"{place} {described(name)[0].split()[-1]}" if "_" in name else described(name)[0]
