"""Figures of results: every function that draws takes a result and returns a figure.

What is 0 everywhere (see `zeros`) has no panel; a line below the title names it.
"""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from matplotlib.tri import Triangulation

from rotfem.results.columns import ZERO, ShownUnits, described, label, shown_unit, zeros

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rotfem.results.modes import ModesResult, ResponseResult
    from rotfem.results.result import Result
    from rotfem.results.run import RunResult

Array = npt.NDArray[np.float64]

#: Part of the largest displacement below which a line cannot be distinguished from 0.
VISIBLE = 1e-3


# --- panels -----------------------------------------------------------------------------------------------------------

#: Inches around panels: left of one, right of one, below the lowest, from the top of one to that of the next.
LEFT, RIGHT, BELOW, ROW = 0.85, 0.2, 0.5, 1.75

#: How the title of a panel stands above its left end.
CAPTION: Any = {"fontsize": 8, "loc": "left", "pad": 3, "y": 1.0}


def dress(panel: Axes, x: str = "", y: str = "", size: float | None = 8) -> None:
    """Give a panel its grid and the labels of its axes, in letters of a size in points (Matplotlib's own if None)."""
    panel.grid(visible=True, lw=0.4, alpha=0.6)
    panel.set_xlabel(x, fontsize=size)
    panel.set_ylabel(y, fontsize=size)
    if size is not None:
        panel.tick_params(which="both", labelsize=size)


def heading(result: Result) -> str:
    """Return the title of a figure of components: what was computed, and the frame whose axes they are along."""
    return f"{result.title}, {result.frame} frame"


def panels_over(
    x: str, number: int, title: str, *, columns: int = 0, below: float = 0.0, beside: float = 0.0
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels over an abscissa, the first column filled first.

    Places are fixed, as what Matplotlib finds by itself takes it longer than all the rest.
    """
    columns = columns or (1 if number <= 3 else 2 if number <= 12 else 3)
    rows = -(-max(number, 1) // columns)
    cell, height = max(5.0, 7.0 / columns), ROW * rows + BELOW + below
    width = cell * columns + beside
    lines = [part for line in title.split("\n") for part in wrap(line, int(12 * width))]
    total = height + 0.05 + 0.18 * len(lines)
    figure, part = Figure(figsize=(width, total)), height / total
    figure.suptitle("\n".join(lines), fontsize=10, y=1.0 - 0.06 / total, va="top")
    across, panels = cell - LEFT - RIGHT, []
    for i in range(number):
        left, bottom = cell * (i // rows) + LEFT, height - ROW * (i % rows + 1)
        box = left / width, bottom / height * part, across / width, (ROW - 0.3) / height * part
        panels.append(panel := figure.add_axes(box))
        lowest = i % rows == rows - 1 or i == number - 1
        dress(panel, x if lowest else "")
        panel.tick_params(labelbottom=lowest)
        panel.ticklabel_format(axis="y", scilimits=(-3, 4))
        panel.yaxis.set_offset_position("right")
        panel.yaxis.get_offset_text().set_fontsize(7)
        panel.xaxis.set_label_coords(0.5, -0.3 / (ROW - 0.3))
        panel.yaxis.set_label_coords(-0.65 / across, 0.5)
    return figure, panels


def not_zero(columns: Mapping[str, Array], title: str) -> tuple[list[str], str]:
    """Return the columns that have a panel, and the title with a further line that names the others."""
    zero = zeros(columns)
    if zero:
        listed = ", ".join(described(name)[0] for name in zero[:6]) + (" …" if len(zero) > 6 else "")
        title += f"\n0 (below {ZERO:.0e} of the largest of the unit): {listed}".replace("e-0", "e-")
    return [name for name in columns if name not in zero], title


def stacked(x: str, at: Array, columns: Mapping[str, Array], title: str, below: float = 0.0, **units: str) -> Figure:
    """Return one panel a column, or columns (n, m), over the abscissa x, with marks where it is a position.

    Below them is room for a legend, inch; `units` are those of columns that have not the usual ones.
    """
    shown, title = not_zero(columns, title)
    figure, panels = panels_over(label(x), len(shown), title, below=below)
    for panel, name in zip(panels, shown, strict=True):
        panel.plot(at, columns[name], lw=1.0 if x == "t" else 1.2, marker="" if x == "t" else ".", ms=4)
        panel.set_title(described(name)[0], **CAPTION)
        panel.set_ylabel(shown_unit(name, units.get(name, "")))
        panel.set_xlim(at[0], at[-1])
    return figure


# --- runs -------------------------------------------------------------------------------------------------------------


def history_figure(result: RunResult) -> Figure:
    """Return the motion of the tip, and of the hub unless it turns at one speed: speed, angle and torque."""
    units, history = ShownUnits.of(result.summary), result.history
    tip = [name for name in history if name.startswith("tip_")]
    hub = [name for name in ("psi_dot", "psi", "pitch", "torque") if name in history]
    speed = history["psi_dot"]
    title = heading(result)
    if np.ptp(speed) <= ZERO * np.max(np.abs(speed)):
        hub = [name for name in hub if not name.startswith("psi")]
        title += f", {units.speeds(speed[0]):.6g} {units.speed}"
    columns = {name: units.speeds(speed) if name == "psi_dot" else history[name] for name in (*tip, *hub)}
    return stacked("t", history["t"], columns, title, psi_dot=units.speed)


def loads_figure(result: RunResult) -> Figure:
    """Return forces and moments of the hub on the root over time."""
    loads = {name: values for name, values in result.history.items() if name.startswith(("root_", "support_"))}
    return stacked("t", result.history["t"], loads, f"{heading(result)}, loads on the root and on supports")


def shape_figure(result: RunResult) -> Figure:
    """Return the components of a steady state along a beam; of a plate maps of the final displacements."""
    if result.triangles is not None:
        return fields_figure(result.shape, result.triangles, ["u1", "u2", "u3"], heading(result) + ", final shape")
    components = {name: values for name, values in result.shape.items() if name != "x"}
    return stacked("x", result.shape["x"], components, heading(result) + ", steady state")


def stations_figure(result: RunResult) -> Figure:
    """Return section forces and unknowns of a beam over time, a line for each station; of a steady state along it."""
    stations, title = result.stations, heading(result)
    assert stations is not None
    values = {name: v for name, v in stations.values.items() if not name.startswith(("gamma", "kappa"))}
    if len(stations.t) < 2:
        return stacked("x", stations.x, {name: v[-1] for name, v in values.items()}, title)
    figure = stacked("t", stations.t, values, title, below=0.3)
    lines, said = figure.axes[0].lines if figure.axes else [], [f"X = {x:g} m" for x in stations.x]
    figure.legend(lines[:8], said[:8], loc="lower center", ncols=8, fontsize=8, frameon=False)
    return figure


# --- small motions ----------------------------------------------------------------------------------------------------


def shapes_figure(result: ModesResult) -> Figure:
    """Return displacements and twist of all modes of a beam, scaled as in `ModesResult`; imaginary parts dashed.

    Rotations of bending are the slopes of what is drawn, and left out.
    """
    first = next(iter(result.shapes.values()))
    names = [n for n in first if (n.startswith("u") or n == "theta1") and not n.endswith("_imag")]
    title = f"{heading(result)}, largest displacement 1, imaginary parts dashed"
    figure, panels = panels_over(label("x"), len(result.shapes), title, below=0.3)
    drawn = {}
    for panel, (row, columns, frequency) in zip(panels, result.with_shapes(), strict=True):
        x = columns["x"]
        for c, name in enumerate(names):
            real, imaginary = columns[name], columns[f"{name}_imag"]
            if np.max(np.hypot(real, imaginary)) > VISIBLE:
                what = described(f"shape_{name}")[0].removeprefix("shape, ").replace("rotation", "twist")
                drawn[name] = panel.plot(x, real, lw=1.4, color=f"C{c}", label=what)[0]
            if np.max(np.abs(imaginary)) > VISIBLE:
                panel.plot(x, imaginary, lw=1.0, ls="--", color=f"C{c}")
        panel.set_title(f"{row['mode']}  {row['label']}, {frequency}", **CAPTION)
        panel.set_xlim(x[0], x[-1])
        panel.set_ylabel("shape (–)")
    handles = [drawn[name] for name in names if name in drawn]
    figure.legend(handles=handles, loc="lower center", ncols=len(names), fontsize=8, frameon=False)
    return figure


def response_figure(result: ResponseResult) -> Figure:
    """Return amplitudes and phases over frequency, of tip, root and hub.

    A row has what is of one kind. Deep antiresonances, at most 5 % of the frequencies, are cut off.
    """
    units = ShownUnits.of(result.summary)
    own = {name: i for i, name in enumerate(result.outputs) if "@" not in name}  # no stations
    title = f"{heading(result)}, at {units.speeds(result.summary['speed']):.6g} {units.speed}"
    shown, title = not_zero({name: np.abs(result.direct[:, i]) for name, i in own.items()}, title)
    rows: dict[tuple[str, str], list[str]] = {}
    for name in shown:
        rows.setdefault((name.partition("_")[0], described(name)[1]), []).append(name)
    across = f"frequency of the load, {result.frame} frame ({units.frequency})"
    figure, panels = panels_over(across, 2 * len(rows), title, columns=2, beside=1.1)
    x = units.frequencies(result.frequencies)
    mark = "." if len(x) == 1 else ""
    for left, right, names in zip(panels, panels[len(rows) :], rows.values(), strict=False):
        left.set_ylabel(f"amplitude {shown_unit(names[0])}")
        right.set_ylabel("phase (°)")
        for c, name in enumerate(names):
            direct = result.direct[:, own[name]]
            left.semilogy(x, np.abs(direct), marker=mark, lw=1.3, color=f"C{c}")
            phase = np.degrees(np.angle(direct))
            jumps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 180.0)
            broken = np.insert(x, jumps, np.nan), np.insert(phase, jumps, np.nan)
            what = described(name)[0]  # in few words: "tip u₁", "root f₁", "angle ψ"
            what = f"{name.partition('_')[0]} {what.split()[-1]}" if "_" in name else what
            right.plot(*broken, marker=mark, lw=1.2, color=f"C{c}", label=what)
        sizes = np.abs(result.direct[:, [own[name] for name in names]])
        seen = max(0.3 * float(np.min(np.quantile(sizes, 0.05, axis=0))), ZERO * float(np.max(sizes)))
        left.set_ylim(seen, 3.0 * float(np.max(sizes)))
        left.yaxis.set_major_formatter("{x:.0e}")
        right.set(ylim=(-190, 190), yticks=np.arange(-180, 181, 90))
        right.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=8, frameon=False)
        for panel in (left, right):
            panel.set_xlim(*(x[[0, -1]] if len(x) > 1 else 0.5 * x[0] * np.array([1, 3])))
    return figure


# --- plates -----------------------------------------------------------------------------------------------------------


def maps(number: int, mesh: Triangulation, title: str) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, for maps over a mesh."""
    aspect = float(np.ptp(mesh.y) / np.ptp(mesh.x))
    columns = min(number, 3 if aspect > 0.4 else 1)
    rows = -(-max(number, 1) // max(columns, 1))
    width = 10.0 / max(columns, 1)
    height = float(np.clip((0.72 if columns > 1 else 0.8) * width * aspect, 0.8, 6.0)) + 0.9  # titles, labels and bars
    figure = Figure(figsize=(10.0, rows * height + 0.6), layout="constrained")
    figure.suptitle(title, fontsize=10, wrap=True)
    axes = [figure.add_subplot(rows, columns, i + 1) for i in range(number)]
    for i, axis in enumerate(axes):
        left, lowest = i % columns == 0, i + columns >= number
        axis.set(aspect="equal", xlabel="x (m)" * lowest, ylabel="y (m)" * left)
        axis.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axis.tick_params(labelsize=7, labelleft=left, labelbottom=lowest)
    return figure, axes


def draw(axis: Axes, mesh: Triangulation, values: Array, still: Array | None = None) -> Any:
    """Draw values at the nodes; return what a colour bar is of.

    Values of both signs have white at 0 and a line there, but at `still` nodes; those of one sign one hue from 0.
    """
    peak = max(float(np.max(np.abs(values))), 1e-300)
    low, high = (float(end) if abs(end) > ZERO * peak else 0.0 for end in (np.min(values), np.max(values)))
    if low < 0.0 < high:
        colours, low, high = "RdBu_r", -peak, peak
        free = Triangulation(mesh.x, mesh.y, mesh.triangles)
        free.set_mask(None if still is None else np.any(still[mesh.triangles], axis=1))
        axis.tricontour(free, values, levels=[0.0], colors="0.2", linewidths=0.8)
    else:
        colours, low, high = ("Reds", 0.0, peak) if high > 0.0 else ("Blues_r", -peak, 0.0)
    drawn = axis.tripcolor(mesh, values, shading="gouraud", cmap=colours, norm=Normalize(low, high), zorder=0)
    axis.set(xlim=(mesh.x.min(), mesh.x.max()), ylim=(mesh.y.min(), mesh.y.max()))
    return drawn


def add_bar(figure: Figure, drawn: Any, axes: Any, caption: str) -> None:
    """Add a colour bar to the right of one axis or of several."""
    powers = ScalarFormatter()
    powers.set_powerlimits((-3, 4))
    aspect = 40 if isinstance(axes, list) else 20
    bar = figure.colorbar(drawn, ax=axes, shrink=0.9, aspect=aspect, fraction=0.05, format=powers)
    bar.set_label(caption, fontsize=8)
    bar.ax.tick_params(labelsize=7)
    bar.ax.yaxis.get_offset_text().set_fontsize(7)


def fields_figure(columns: Mapping[str, Array], triangles: Array, names: list[str], title: str) -> Figure:
    """Return one map a named field, but for those that are 0; columns are at the nodes, `x` and `y` (m) too."""
    shown, title = not_zero({name: columns[name] for name in names}, title)
    mesh = Triangulation(columns["x"], columns["y"], triangles)
    figure, axes = maps(len(shown), mesh, title)
    for axis, name in zip(axes, shown, strict=True):
        axis.set_title(described(name)[0], fontsize=9)
        add_bar(figure, draw(axis, mesh, columns[name]), axis, label(name))
    return figure


def resultants_figure(result: RunResult) -> Figure:
    """Return maps of the stress resultants at the end."""
    names = [name for name in result.resultants if name not in ("x", "y")]
    return fields_figure(result.resultants, result.triangles, names, heading(result) + ", final stress resultants")


def plate_modes_figure(result: ModesResult) -> Figure:
    """Return a map of the leading displacement of every mode, the largest translation 1."""
    shapes = result.shapes
    first = next(iter(shapes.values()))
    mesh = Triangulation(first["x"], first["y"], result.triangles)
    figure, axes = maps(len(shapes), mesh, f"{heading(result)}, largest displacement 1")
    sizes = np.array([[np.hypot(c[n], c.get(f"{n}_imag", 0.0)) for n in ("u1", "u2", "u3")] for c in shapes.values()])
    clamped = np.all(sizes == 0.0, axis=(0, 1))
    for axis, (row, columns, frequency), size in zip(axes, result.with_shapes(), sizes, strict=True):
        name = f"u{1 + int(np.argmax(np.max(size, axis=1)))}"
        drawn = draw(axis, mesh, columns[name], clamped)
        drawn.set(cmap="RdBu_r", norm=Normalize(-1.0, 1.0))
        axis.set_title(f"{row['mode']}  {row['label']}, {described(name)[0]}\n{frequency}", fontsize=9)
    add_bar(figure, drawn, axes, "displacement (–)")
    return figure
