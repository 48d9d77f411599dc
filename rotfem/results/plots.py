"""Figures of results: every function that draws takes a result and returns a figure, one function writes them."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rotfem.results.columns import described, is_at_station, label
from rotfem.results.files import write_whole
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    from rotfem.results.campbell import CampbellResult
    from rotfem.results.check import CheckResult
    from rotfem.results.explain import ExplainResult
    from rotfem.results.modes import ModesResult
    from rotfem.results.response import ResponseResult
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
    named_at_ends(axis, branches, "frequency", top)
    for i, b in enumerate(branches.values()):
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
    figure.subplots_adjust(left=0.09, right=0.84, top=0.94, bottom=0.08)  # the labels stand outside on the right
    return figure


def shown_branches(result: CampbellResult) -> dict[str, dict[str, Any]]:
    """Return label ↦ `speed`, frequencies in the units that are shown, and `unstable`, whether the mode grows there."""
    units = ShownUnits.of(result.summary)
    return {
        name: {
            "speed": units.speeds(b["speed"]),
            **{k: units.frequencies(b[k]) for k in ("frequency", "frequency_fixed") if k in b},
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


def named_at_ends(axis: Any, branches: Mapping[str, Mapping[str, Any]], column: str, top: float) -> None:
    """Draw branches over speed, their names at their ends on the right: dashed where they run against the spin."""
    heights = spread([float(b[column][-1]) for b in branches.values()], 0.022 * top)
    for i, (name, b) in enumerate(branches.items()):
        style, color = ("--" if name.endswith("backward") else "-"), f"C{i % 10}"
        axis.plot(b["speed"], b[column], lw=1.6, ls=style, color=color)
        axis.annotate(
            name,
            (float(b["speed"][-1]), heights[i]),
            (5, -3),
            textcoords="offset points",
            annotation_clip=False,
            fontsize=8,
            color=color,
        )


def fixed_frame_figure(result: CampbellResult) -> Figure:
    """Return the frequencies of a rotor in the fixed frame over speed, and its synchronous critical speeds."""
    figure = Figure(figsize=(9, 6.5))
    axis, units, branches = figure.add_subplot(), ShownUnits.of(result.summary), shown_branches(result)
    top = 1.05 * max(float(np.max(b["frequency_fixed"])) for b in branches.values())
    last = max(float(b["speed"][-1]) for b in branches.values())
    named_at_ends(axis, branches, "frequency_fixed", top)
    rise = float(units.frequencies(1.0) / units.speeds(1.0))
    end = min(last, top / rise)
    axis.plot([0, end], [0, rise * end], lw=0.7, ls=":", color="0.4")
    axis.annotate("Ω", (end, rise * end), (-2, 3), textcoords="offset points", fontsize=7, color="0.4", ha="right")
    for c in result.critical_speeds:
        if c.kind != "per_rev":
            stands = c.per_rev == c.order and result.summary.get("frame") != "fixed"  # a wave of a disk
            fixed = 0.0 if stands else c.speed
            axis.plot(units.speeds(c.speed), units.frequencies(fixed), "ko", ms=4, mfc="none", clip_on=False)
    axis.set_xlim(min(0.0, *(float(b["speed"][0]) for b in branches.values())), last)
    axis.set_ylim(0, top)
    axis.set_xlabel(label("psi_dot", units.speed))
    axis.set_ylabel(label("frequency_fixed", units.frequency))
    axis.set_title(f"{result.title}; backward dashed, synchronous critical speeds circled", size=10)
    axis.grid(True, lw=0.4, alpha=0.6)
    figure.subplots_adjust(left=0.09, right=0.84, top=0.94, bottom=0.08)
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

#: What is drawn of a section is as wide as the rectangle of its radius of gyration.
HALF_WIDTH = np.sqrt(3.0)


def check_figure(result: CheckResult) -> Figure:
    """Return the structure as seen along axes 3, 2 and 1 with its centre of mass, and properties along a beam."""
    columns = result.columns
    there = [(tuple(n for n in names if n in columns), title, log) for names, title, log in PANELS]
    panels = [panel for panel in there if any(np.any(columns[n]) for n in panel[0])]
    figure = Figure(figsize=(10, 4.2 + 1.25 * len(panels)))
    grid = figure.add_gridspec(2 + len(panels), 4, height_ratios=[1.7, 1.7, *[1.0] * len(panels)])
    views = ((grid[0, :3], 0, 1), (grid[1, :3], 0, 2), (grid[:2, 3], 1, 2))
    for spot, i, j in views:
        axis = figure.add_subplot(spot)
        _view(axis, result, i, j)
    first = None
    for row, (names, title, logarithmic) in enumerate(panels, start=2):
        axis = figure.add_subplot(grid[row, :], sharex=first)
        first = first or axis
        for name in names:
            values = np.degrees(columns[name]) if name == "pretwist" else columns[name]
            axis.plot(columns["x"], values, lw=1.3, label=name)
        if logarithmic and all(np.all(columns[name] > 0.0) for name in names):
            axis.set_yscale("log")
        axis.set_ylabel(title, fontsize=8)
        axis.grid(True, lw=0.4, alpha=0.6)
        if len(names) > 1:
            axis.legend(fontsize=7, ncols=4)
        axis.tick_params(labelsize=7)
    if first is not None:
        axis.set_xlabel("position X along the axis (m)")
    s = result.summary
    figure.suptitle(f"{s['name']}: {s['mass']:.6g} kg, {s['length']:.6g} m", fontsize=10)
    figure.subplots_adjust(left=0.09, right=0.97, top=0.95, bottom=0.06, hspace=0.45, wspace=0.35)
    return figure


def _view(axis: Any, result: CheckResult, i: int, j: int) -> None:
    """Draw the structure over axes i and j (from 0) of the frame."""
    c = result.columns
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
        axis.plot(r[:, i], r[:, j], "k", lw=1.2)
    elif result.triangles is not None:
        x, y = list(result.nodes.values())[:2]
        root = result.summary["root"]
        places = np.stack([x + root[0], y + root[1], np.zeros(len(x)) + root[2]], axis=-1)
        if (i, j) == (0, 1):
            axis.triplot(places[:, 0], places[:, 1], result.triangles, lw=0.3, color="0.5")
        else:
            axis.plot(places[:, i], places[:, j], "k", lw=1.2)
    else:
        x = result.nodes["x"] + result.summary["root"][0]
        axis.plot(*(x if n == 0 else np.zeros(len(x)) for n in (i, j)), "k", lw=1.2)
    center = result.summary["center_of_mass"]
    axis.plot(center[i], center[j], "o", ms=6, mfc="none", color="C3")
    axis.set_xlabel(f"{i + 1} (m)", fontsize=8)
    axis.set_ylabel(f"{j + 1} (m)", fontsize=8)
    axis.tick_params(labelsize=7)
    axis.grid(True, lw=0.4, alpha=0.6)


#: Relative changes below it are not drawn.
ROUND_OFF = 1e-9


def explain_figure(result: ExplainResult) -> Figure:
    """Return a bar for every effect and theory: relative change of each output; a mark is the true change."""
    rows, outputs = result.rows, result.summary["outputs"]
    figure = Figure(figsize=(8, 0.45 * len(rows) + 1.4))
    axis = figure.add_subplot()
    shown = [v for row in rows for v in row["estimate"].values() if v and ROUND_OFF < v < np.inf]
    left, right = 10 ** np.floor(np.log10(min([*shown, 1e-2]))) / 3, 3 * max([*shown, 1.0])
    height = 0.8 / max(len(outputs), 1)
    for j, output in enumerate(outputs):
        for i, row in enumerate(rows):
            known, at = row["estimate"].get(output, 0.0), i + (j - (len(outputs) - 1) / 2) * height
            value = left if known is None else known
            axis.barh(
                at,
                float(np.clip(value, left, right)) - left,
                height,
                left=left,
                color=f"C{j}",
                label=output if i == 0 else None,
            )
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
    tall = figure.get_figheight()
    figure.subplots_adjust(left=0.27, right=0.97, top=1 - 0.65 / tall, bottom=0.55 / tall)
    figure.legend(fontsize=8, loc="upper right", ncols=4, bbox_to_anchor=(0.98, 1 - 0.28 / tall), frameon=False)
    return figure


#: Part of the largest output of its unit below which one is round-off.
SHOWN = 1e-9


def response_figure(result: ResponseResult) -> Figure:
    """Return amplitudes, direct and by modes (dashed), and phases over frequency, of tip and root.

    What does not answer is left out.
    """
    units, size = ShownUnits.of(result.summary), np.max(np.abs(result.direct), axis=0)
    kinds = [described(name)[1] for name in result.outputs]
    largest: dict[str, float] = {}
    for kind, value in zip(kinds, size, strict=True):
        largest[kind] = max(largest.get(kind, 0.0), float(value))
    own = [not is_at_station(name) for name in result.outputs]
    drawn = [i for i, kind in enumerate(kinds) if own[i] and size[i] > SHOWN * largest[kind]]
    figure = Figure(figsize=(9, 2.2 * max(len(drawn), 1) + 2.4))
    panels = figure.subplots(len(drawn) + 1, 1, sharex=True, squeeze=False)[:, 0]
    x = units.frequencies(result.frequencies)
    for axis, i in zip(panels, drawn, strict=False):
        name = result.outputs[i]
        axis.semilogy(x, np.abs(result.direct[:, i]), lw=1.4, color=f"C{i}")
        axis.semilogy(x, np.abs(result.modal[:, i]), lw=1.0, ls="--", color="0.3")
        axis.set_ylabel(label(name))
        panels[-1].plot(x, np.degrees(np.angle(result.direct[:, i])), lw=1.2, color=f"C{i}", label=name)
    panels[-1].set_ylabel("phase (°)")
    panels[-1].set_yticks(np.arange(-180, 181, 90))
    panels[-1].set_xlabel(f"frequency of the load ({units.frequency}); amplitudes by modes dashed")
    if drawn:
        panels[-1].legend(fontsize=8, ncols=len(drawn))
    for axis in panels:
        axis.grid(True, lw=0.4, alpha=0.6)
    panels[0].set_title(f"{result.title}, at {units.speeds(result.summary['speed']):g} {units.speed}")
    figure.align_ylabels()
    height = figure.get_figheight()
    figure.subplots_adjust(left=0.12, right=0.97, top=1 - 0.4 / height, bottom=0.55 / height, hspace=0.12)
    return figure
