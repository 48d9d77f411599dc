"""Figures of plates: fields over the mid-surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from matplotlib.tri import Triangulation

from rotfem.results.columns import ZERO, described, label
from rotfem.results.plots import not_zero

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rotfem.results.modes import ModesResult
    from rotfem.results.run import RunResult

Array = npt.NDArray[Any]


def maps(number: int, mesh: Triangulation, title: str) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes, for maps over a mesh."""
    aspect = float(np.ptp(mesh.y) / np.ptp(mesh.x))
    columns = min(number, 3 if aspect > 0.4 else 1)
    rows = -(-max(number, 1) // max(columns, 1))
    width = 10.0 / max(columns, 1)
    height = float(np.clip((0.72 if columns > 1 else 0.8) * width * aspect, 0.8, 6.0)) + 0.9  # titles, labels and bars
    figure = Figure(figsize=(10.0, rows * height + 0.6), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = [figure.add_subplot(rows, columns, i + 1) for i in range(number)]
    for i, axis in enumerate(axes):
        axis.set_aspect("equal")
        axis.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axis.tick_params(labelsize=7, labelleft=i % columns == 0, labelbottom=i + columns >= number)
        axis.set_xlabel("x (m)" if i + columns >= number else "", fontsize=8)
        axis.set_ylabel("y (m)" if i % columns == 0 else "", fontsize=8)
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
    powers = ScalarFormatter(useMathText=True)
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


def shape_figure(result: RunResult) -> Figure:
    """Return maps of the displacements of the final shape."""
    return fields_figure(result.shape, result.triangles, ["u1", "u2", "u3"], result.title + ", final shape")


def resultants_figure(result: RunResult) -> Figure:
    """Return maps of the stress resultants at the end."""
    names = [name for name in result.resultants if name not in ("x", "y")]
    return fields_figure(result.resultants, result.triangles, names, result.title + ", final stress resultants")


def modes_figure(result: ModesResult) -> Figure:
    """Return a map of the leading displacement of every mode, the largest translation 1."""
    shapes = result.shapes
    first = next(iter(shapes.values()))
    mesh = Triangulation(first["x"], first["y"], result.triangles)
    figure, axes = maps(len(shapes), mesh, f"{result.title}, largest displacement 1")
    sizes = np.array([[np.hypot(c[n], c.get(f"{n}_imag", 0.0)) for n in ("u1", "u2", "u3")] for c in shapes.values()])
    clamped = np.all(sizes == 0.0, axis=(0, 1))
    for axis, (row, columns, frequency), size in zip(axes, result.with_shapes(), sizes, strict=True):
        name = f"u{1 + int(np.argmax(np.max(size, axis=1)))}"
        drawn = draw(axis, mesh, columns[name], clamped)
        drawn.set(cmap="RdBu_r", norm=Normalize(-1.0, 1.0))
        axis.set_title(f"{row['mode']}  {row['name']}, {described(name)[0]}\n{frequency}", fontsize=9)
    add_bar(figure, drawn, axes, "displacement (–)")
    return figure
