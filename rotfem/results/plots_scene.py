"""Figures of what a scene is and what it calls for: the structure with its properties, the size of each effect."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from rotfem.results.columns import ZERO
from rotfem.results.plots import dress
from rotfem.results.surfaces import HALF_WIDTH

if TYPE_CHECKING:
    from rotfem.results.check import CheckResult
    from rotfem.results.explain import ExplainResult

#: Panels of properties: names in one panel, its label, whether on a logarithmic axis.
PANELS = (
    (("mass_per_length",), "mass (kg/m)", False),
    (("EA", "GA", "GA2", "GA3"), "EA, GA (N)", True),
    (("EI", "EI2", "EI3", "GJ"), "EI, GJ (N·m²)", True),
    (("rotary_inertia", "rotary_inertia2", "rotary_inertia3"), "inertia (kg·m)", False),
    (("pretwist",), "pretwist (°)", False),
    (("mass_center_y", "tension_center_y", "shear_center_y"), "centres, y (m)", False),
    (("mass_center_z", "tension_center_z", "shear_center_z"), "centres, z (m)", False),
)


def check_figure(result: CheckResult) -> Figure:
    """Return the structure as seen along axes 3, 2 and 1 with its centre of mass, and properties along a beam."""
    columns = result.columns
    there = [(tuple(n for n in names if n in columns), title, log) for names, title, log in PANELS]
    panels = [panel for panel in there if any(np.any(columns[n]) for n in panel[0])]
    figure = Figure(figsize=(10, 4.2 + 1.2 * len(panels)), layout="constrained")
    grid = figure.add_gridspec(2 + len(panels), 4, height_ratios=[1.7, 1.7, *[1.0] * len(panels)])
    views = ((grid[0, :3], 0, 1), (grid[1, :3], 0, 2), (grid[:2, 3], 1, 2))
    for spot, i, j in views:
        _view(figure.add_subplot(spot), result, i, j)
    for row, (names, title, logarithmic) in enumerate(panels, start=2):
        axis = figure.add_subplot(grid[row, :])
        for name, dashes in zip(names, ("-", "--", ":", "-."), strict=False):  # equal ones lie on each other
            values = np.degrees(columns[name]) if name == "pretwist" else columns[name]
            axis.plot(columns["x"], values, lw=1.3, ls=dashes, label=name)
        if logarithmic and all(np.all(columns[name] > 0.0) for name in names):
            axis.set_yscale("log")
        last = row == len(panels) + 1
        axis.set_xlim(columns["x"][0], columns["x"][-1])
        dress(axis, "position X along the axis (m)" if last else "", title)
        axis.tick_params(labelbottom=last)
        if len(names) > 1:
            axis.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
    s = result.summary
    figure.suptitle(f"{s['name']}: {s['mass']:.6g} kg, {s['length']:.6g} m", fontsize=10)
    return figure


def _view(axis: Any, result: CheckResult, i: int, j: int) -> None:
    """Draw the structure over axes i and j (from 0) of the frame."""
    c, triangles = result.columns, result.triangles
    if "axis_1" in c:
        r = np.stack([c[f"axis_{n}"] for n in (1, 2, 3)], axis=-1)
        for across, EI, colour in ((2, "EI3", "C0"), (3, "EI2", "C1")):
            half = HALF_WIDTH * np.sqrt(np.abs(c[EI] / c["EA"]))
            ends = half[:, None] * np.stack([c[f"t{across}_{n}"] for n in (1, 2, 3)], axis=-1)
            for end in (r + ends, r - ends):
                axis.plot(end[:, i], end[:, j], lw=0.8, color=colour)
            for place in np.linspace(0, len(r) - 1, 12).astype(int):
                line = np.stack([r[place] - ends[place], r[place] + ends[place]])
                axis.plot(line[:, i], line[:, j], lw=0.6, color=colour)
    else:
        x = result.nodes["x"]
        r = np.column_stack([x, result.nodes.get("y", 0.0 * x), 0.0 * x]) + result.summary["root"]
    if triangles is not None and (i, j) == (0, 1):
        axis.triplot(r[:, 0], r[:, 1], triangles, lw=0.3, color="0.5")
    else:
        axis.plot(r[:, i], r[:, j], "k", lw=1.2)
    center = result.summary["center_of_mass"]
    axis.plot(center[i], center[j], "o", ms=6, mfc="none", color="C3")
    dress(axis, f"{i + 1} (m)", f"{j + 1} (m)")


def explain_figure(result: ExplainResult) -> Figure:
    """Return a bar for every effect and theory: relative change of each output; a mark is the true change."""
    rows, outputs = result.rows, result.summary["outputs"]
    figure = Figure(figsize=(8, 0.45 * len(rows) + 1.4), layout="constrained")
    axis = figure.add_subplot()
    shown = [v for row in rows for v in row["estimate"].values() if v and ZERO < v < np.inf]
    left, right = 10 ** np.floor(np.log10(min([*shown, 1e-2]))) / 3, 3 * max([*shown, 1.0])
    height = 0.8 / max(len(outputs), 1)
    for j, output in enumerate(outputs):
        for i, row in enumerate(rows):
            known, at = row["estimate"].get(output, 0.0), i + (j - (len(outputs) - 1) / 2) * height
            value = left if known is None else known
            width = float(np.clip(value, left, right)) - left
            axis.barh(at, width, height, left=left, color=f"C{j}", label=output if i == 0 else None)
            if known is None:
                axis.annotate("unknown", (left, at), (3, -3), textcoords="offset points", fontsize=8)
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
    figure.legend(fontsize=8, loc="outside lower center", ncols=4, frameon=False)
    return figure
