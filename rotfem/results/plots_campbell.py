"""The Campbell diagram: frequencies over speed with lines kΩ and critical speeds, and damping ratios below them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from scipy.optimize import isotonic_regression

from rotfem.results.columns import ZERO, ShownUnits, label
from rotfem.results.plots import LEFT, dress

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rotfem.results.campbell import CampbellResult

Array = npt.NDArray[np.float64]

#: Height of a name at the end of a line, inch.
NAME_HEIGHT = 0.16

#: Name at the end of a line, where it ends, and its colour.
End = tuple[str, float, float, str]

#: Width of the diagram, inch.
WIDTH = 9.0


@dataclass(frozen=True)
class Branch:
    """A branch as it is drawn, in the units that are shown.

    Attributes:
        name: of its mode.
        number: from 1 on, decides the colour.
        speed, frequency, damping: over the speeds solved; damping ratios in per cent, of shafts logarithmic decrements.
        doubtful: whether the step to a speed from the one before is ambiguous.
        unstable: whether the mode grows there.
    """

    name: str
    number: int
    speed: Array
    frequency: Array
    damping: Array
    doubtful: npt.NDArray[np.bool_]
    unstable: npt.NDArray[np.bool_]

    @property
    def style(self) -> dict[str, Any]:
        """Colour and dashes (see `style_of`)."""
        return style_of(self.name, f"C{(self.number - 1) % 10}")


def style_of(name: str, color: str = "C2") -> dict[str, Any]:
    """Return colour and dashes of a line: those of forward and backward whirl; waves against the spin are dashed."""
    whirls = {"forward whirl": "C0", "backward whirl": "C1"}
    return {"color": whirls.get(name.partition(" ")[2], color), "ls": "--" if "backward" in name else "-"}


def campbell_figure(
    result: CampbellResult, *, fixed: bool = False, ax: Axes | None = None, orders: Sequence[int] | None = None
) -> Figure:
    """Return frequencies over speed, lines kΩ with their crossings, what is unstable, and damping where there is any.

    It reaches up to the lowest mode that no line meets; higher ones that would squash it are named above it. With
    `fixed` modes of a rotor are drawn as the fixed frame sees them, with the line Ω and synchronous critical speeds;
    those of a shaft with both frequencies |ω ± Ω|. `ax` gets the frequencies alone.
    """
    units, branches = ShownUnits.of(result.summary), drawn_branches(result, fixed)
    rise = float(units.frequencies(1.0) / units.speeds(1.0))  # of the line 1Ω
    orders = [1] if fixed else result.summary["orders"] if orders is None else orders
    first = min(0.0, *(float(b.speed[0]) for b in branches))
    last = max(0.0, *(float(b.speed[-1]) for b in branches))
    shown = branches if fixed or not orders else of_interest(branches, max(orders) * rise)
    top = 1.06 * max(float(np.max(b.frequency)) for b in shown)
    damped = any(np.nanmax(np.abs(b.damping), initial=0.0) > 0.0 for b in shown)
    heights: list[float] = [max(4.8, (len(shown) + len(orders) + 1) * NAME_HEIGHT), 1.6][: 1 + damped]
    above = [b for b in branches if b not in shown]
    names = [f"↑ {b.name}, {b.frequency[-1]:.3g} {units.frequency}" for b in above[:4]]
    names += [f"↑ {len(above) - 4} more"] if len(above) > 4 else []
    figure: Any = Figure(figsize=(WIDTH, sum(heights))) if ax is None else ax.get_figure(root=True)
    if ax is None:
        panels = list(figure.subplots(len(heights), 1, sharex=True, squeeze=False)[:, 0])
    else:
        damped, panels, heights = False, [ax], [ax.get_window_extent().height / figure.dpi]
    axis = panels[0]
    frequency = label("frequency", units.frequency, "fixed" if fixed else result.frame)
    captions = [frequency, label("log_decrement") if "log_decrement" in result.rows[0] else "damping ratio (%)"]
    for panel, caption in zip(panels, captions, strict=False):
        dress(panel, label("psi_dot", units.speed) if panel is panels[-1] else "", caption, size=None)
        marks(panel, result, units, last)
    for b in shown:
        axis.plot(b.speed, b.frequency, lw=1.6, gid=b.name, **b.style)
        axis.plot(b.speed[b.unstable], b.frequency[b.unstable], "x", ms=5, color="C3", zorder=3)
        for i in np.flatnonzero(b.doubtful):
            axis.plot(b.speed[i - 1 : i + 1], b.frequency[i - 1 : i + 1], lw=7, color="0.6", alpha=0.5, zorder=1)
        if damped:
            there = np.isfinite(b.damping)
            panels[1].plot(b.speed[there], b.damping[there], lw=1.4, gid=b.name, **b.style)
    of_shaft = any("whirl" in b.name for b in shown)  # whose orders are 1X, 2X, …
    rays = [(f"{k}X" if of_shaft else f"{k}Ω" if k > 1 else "Ω", k * rise) for k in orders]
    for name, slope in rays:
        reach = top / slope
        x = np.array([np.clip(first, -reach, 0.0), 0.0, np.clip(last, 0.0, reach)])
        axis.plot(x, slope * np.abs(x), lw=0.8, ls=":", color="0.4", zorder=1, gid=name)
    for name, columns in result.branches().items() if fixed else ():
        if "frequency_fixed_2" in columns:
            other = units.frequencies(columns["frequency_fixed_2"])
            said, other = "_" if name != branches[0].name else "smaller wave", np.where(other <= top, other, np.nan)
            axis.plot(units.speeds(columns["speed"]), other, lw=0.7, label=said, **style_of(name))
    crossings(axis, result, units, fixed, orders)
    axis.set_xlim(first, last)
    axis.set_ylim(0.0, top)
    name_lines(axis, shown, rays, heights[0])
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "color": "0.4", "va": "bottom"}
    axis.annotate("\n".join(reversed(names)), (1.0, 1.0), xytext=(14, 4), xycoords="axes fraction", **style)
    if damped:
        panels[1].axhline(0.0, lw=0.8, color="0.4", zorder=1)
        ends = [
            (b.name, b.speed[i], b.damping[i], b.style["color"])
            for b in shown
            for i in np.flatnonzero(~np.isnan(b.damping))[-1:]
        ]
        write_names(panels[1], ends, NAME_HEIGHT / heights[1])
    name_styles(axis, shown)
    entries = axis.get_legend_handles_labels()
    if ax is not None:
        if entries[0]:
            ax.legend(fontsize=8, frameon=False)
        return cast(Figure, figure)
    letters = max(len(b.name) for b in shown), max(map(len, names), default=0)
    right = 0.35 + max(0.068 * letters[0], 0.06 * letters[1])
    over = 0.4 + max(0.12 * len(names), 0.2 * any(slope * last > top for _, slope in rays))
    below = 0.65 + 0.2 * -(-len(entries[0]) // 3)
    height = over + sum(heights) + 0.2 * damped + below
    figure.set_figheight(height)
    for panel, own, under in zip(panels, heights, [below + sum(heights[1:]) + 0.2 * damped, below], strict=False):
        panel.set_position((LEFT / WIDTH, under / height, 1.0 - (LEFT + right) / WIDTH, own / height))
    figure.suptitle(result.title, fontsize=11, y=1.0 - 0.08 / height, va="top")
    if entries[0]:
        figure.legend(*entries, loc="lower center", ncols=3, fontsize=8, frameon=False)
    return cast(Figure, figure)


def fixed_figure(result: CampbellResult) -> Figure:
    """Return the diagram of a rotor as the fixed frame sees it."""
    return campbell_figure(result, fixed=True)


def map_figure(result: CampbellResult) -> Figure:
    """Return the undamped critical speeds over a key, as the stiffness of bearings, on logarithmic axes."""
    units, over = ShownUnits.of(result.summary), result.summary["map"]
    figure = Figure(figsize=(WIDTH, 5.4))
    axis, ends = figure.add_axes((LEFT / WIDTH, 0.11, 1.0 - (LEFT + 1.7) / WIDTH, 0.8)), list[End]()
    for name in dict.fromkeys(row["label"] for row in over["rows"]):
        rows, style = [row for row in over["rows"] if row["label"] == name], style_of(name)
        at, speed = [row["value"] for row in rows], units.speeds([row["speed"] for row in rows])
        axis.loglog(at, speed, lw=1.6, **style)
        ends.append((name, at[-1], float(speed[-1]), str(style["color"])))
    dress(axis, label(over["key"].rpartition(".")[2]), f"undamped critical speed ({units.speed})", size=None)
    axis.grid(visible=True, which="minor", lw=0.2, alpha=0.6)
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.set_xlim(min(row["value"] for row in over["rows"]), max(row["value"] for row in over["rows"]))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_ylim(axis.get_ylim())
    write_names(axis, ends, NAME_HEIGHT / (0.8 * 5.4))
    figure.suptitle(f"{result.title}, critical speeds", fontsize=11)
    return figure


def drawn_branches(result: CampbellResult, fixed: bool) -> list[Branch]:
    """Return the branches in the units shown; each passes through its critical speeds, where it may touch 0."""
    units, out = ShownUnits.of(result.summary), []
    ambiguous = {(int(a["branch"]), float(a["speed"])) for a in result.summary["ambiguous"]}
    for named, columns in zip(result.summary["branches"], result.branches().values(), strict=True):
        number, speed = named["branch"], columns["speed"]
        frequency = columns["frequency_fixed" if fixed else "frequency"]
        damping = columns.get("log_decrement", 100.0 * columns["damping"])
        small = np.abs(columns["damping"]) <= np.maximum(ZERO, columns.get("error_bound", 0.0))
        unstable = columns["growth"] > 1e-6 * (np.abs(columns["frequency"]) + np.abs(columns["growth"]))
        further = [
            (c.speed, seen_fixed(c) if fixed else c.frequency)
            for c in result.critical_speeds
            if c.branch == number and not (fixed and c.kind == "per_rev") and c.speed not in speed
        ]
        at = np.searchsorted(speed, [s for s, _ in further])
        out.append(
            Branch(
                named["label"],
                number,
                units.speeds(np.insert(speed, at, [s for s, _ in further])),
                units.frequencies(np.insert(frequency, at, [f for _, f in further])),
                np.insert(np.where(small, 0.0, damping), at, np.nan),
                np.insert(np.array([(number, float(s)) in ambiguous for s in speed]), at, False),
                np.insert(unstable, at, False),
            )
        )
    return out


def seen_fixed(critical: Any) -> float:
    """Return the frequency in the fixed frame at a synchronous critical speed, rad/s: a wave of a disk stands still."""
    return 0.0 if critical.per_rev == critical.order else float(critical.speed)


def of_interest(branches: list[Branch], steepest: float) -> list[Branch]:
    """Return the branches that the steepest line kΩ meets or passes, the next above, and what lies among them.

    All are returned where the diagram is at most twice as high with them.
    """
    met = [np.any((b.frequency <= steepest * np.abs(b.speed)) | b.unstable) for b in branches]
    others = [float(np.min(b.frequency)) for b, there in zip(branches, met, strict=True) if not there]
    bottom = min(others, default=np.inf)
    top = max((float(np.max(b.frequency)) for b, there in zip(branches, met, strict=True) if there), default=0.0)
    shown: list[Branch] = []
    while True:  # a branch that begins in the diagram is drawn as far as it goes
        found = [b for b in branches if np.min(b.frequency) <= max(top, bottom)]
        top = max(float(np.max(b.frequency)) for b in found)
        if len(found) == len(shown):
            return branches if max(float(np.max(b.frequency)) for b in branches) <= 2.0 * top else found
        shown = found


def marks(axis: Axes, result: CampbellResult, units: ShownUnits, last: float) -> None:
    """Draw rated speed, operating range and ranges of instability as far as they are given."""
    summary = result.summary
    if "operating" in summary:
        low, high = units.speeds(summary["operating"])
        said = f"operating range, {low:.5g} to {high:.5g} {units.speed}"
        axis.axvspan(low, high, color="0.9", lw=0.0, zorder=0, label=said)
    if "rated" in summary:
        rated = float(units.speeds(summary["rated"]))
        dashes = (0, (6, 2, 1, 2))
        axis.axvline(rated, zorder=1, color="k", lw=1.0, ls=dashes, label=f"rated speed, {rated:.5g} {units.speed}")
    for kind, color in (("dynamic instability", "C3"), ("static instability", "C1")):
        said = kind
        for onset in (onset for onset in summary["instabilities"] if onset["kind"] == kind):
            first, until = float(units.speeds(onset["speed"])), onset["until"]
            end = last if until is None else float(units.speeds(until))
            said = f"{kind} from {first:.5g} {units.speed}" if said == kind else "_"
            axis.axvspan(first, end, color=color, alpha=0.12, lw=0.0, zorder=0, label=said)


def crossings(axis: Axes, result: CampbellResult, units: ShownUnits, fixed: bool, orders: Sequence[int]) -> None:
    """Draw critical speeds, synchronous ones filled, and those on the lines kΩ."""
    for synchronous, name in ((False, "crossing with kΩ"), (True, "synchronous critical speed")):
        there = [c for c in result.critical_speeds if (c.kind != "per_rev") == synchronous]
        there = [c for c in there if synchronous or c.per_rev in orders]
        if there and (synchronous or not fixed):
            height = [seen_fixed(c) if fixed else c.frequency for c in there]
            speeds, heights = units.speeds([c.speed for c in there]), units.frequencies(height)
            style: dict[str, Any] = {"ms": 5} if synchronous else {"ms": 4, "mfc": "white"}
            axis.plot(speeds, heights, "ko", label=name, clip_on=False, zorder=4, **style)


def name_styles(axis: Axes, branches: list[Branch]) -> None:
    """Name dashes, crosses and broad lines in the legend, as far as there are some."""
    kinds: tuple[tuple[bool, str, dict[str, Any]], ...] = (
        (any(b.style["ls"] == "--" for b in branches), "backward", {"color": "0.3", "ls": "--"}),
        (any(np.any(b.unstable) for b in branches), "grows", {"color": "C3", "ls": "", "marker": "x"}),
        (any(np.any(b.doubtful) for b in branches), "ambiguous", {"color": "0.6", "lw": 7, "alpha": 0.5}),
    )
    for there, name, style in kinds:
        if there:
            axis.plot([], [], label=name, **style)


def name_lines(axis: Axes, branches: list[Branch], rays: list[tuple[str, float]], height: float) -> None:
    """Write the names of the branches at their ends, and of the lines kΩ (rays, with slopes) where they leave the axis.

    The axis is of a height in inch.
    """
    last, top = axis.get_xlim()[1], axis.get_ylim()[1]
    text: dict[str, Any] = {"annotation_clip": False, "fontsize": 8}
    ends = [(b.name, float(b.speed[-1]), float(b.frequency[-1]), str(b.style["color"])) for b in branches]
    ends += [(name, last, slope * last, "0.4") for name, slope in rays if slope * last <= top]
    write_names(axis, ends, NAME_HEIGHT / height)
    leaving = [(name, top / slope) for name, slope in rays if slope * last > top]
    at = spread([x for _, x in leaving], 0.42 / (WIDTH - 3.0) * last, (0.0, last))  # a name is 0.42 inch wide
    for (name, _), place in zip(leaving, at, strict=True):
        axis.annotate(name, (place, top), (0, 3), textcoords="offset points", color="0.4", ha="center", **text)


def write_names(axis: Axes, ends: list[End], gap: float) -> None:
    """Write names at the right of a panel whose limits are set, near ends of lines; gaps are in parts of its height."""
    heights = [float(axis.transAxes.inverted().transform(axis.transData.transform((x, y)))[1]) for _, x, y, _ in ends]
    for (name, x, y, color), place in zip(ends, spread(heights, gap, (0.0, 1.0)), strict=True):
        line = {"arrowstyle": "-", "lw": 0.6, "color": color, "shrinkA": 1, "shrinkB": 0, "relpos": (0.0, 0.5)}
        at: dict[str, Any] = {"xytext": (1.02, place), "textcoords": "axes fraction", "va": "center", "fontsize": 8}
        axis.annotate(name, (x, y), color=color, arrowprops=line, annotation_clip=False, **at)


def spread(values: list[float], gap: float, limits: tuple[float, float]) -> list[float]:
    """Return the values closest to those given that are `gap` apart and within limits, so that labels can be read.

    By least squares: with y_i = z_i + i gap in the order of the values, z is their isotonic regression.
    """
    if not values:
        return []
    order = np.argsort(values, kind="stable")
    steps = min(gap, (limits[1] - limits[0]) / max(len(values) - 1, 1)) * np.arange(len(values))
    z = isotonic_regression(np.asarray(values)[order] - steps).x
    out = np.empty(len(values))
    out[order] = np.clip(z, limits[0], limits[1] - steps[-1]) + steps
    return [float(y) for y in out]
