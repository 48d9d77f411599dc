"""The Campbell diagram: frequencies over speed with lines kΩ and critical speeds, and damping ratios below them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from rotfem.results.columns import ZERO, ShownUnits, label
from rotfem.results.plots import BELOW, LEFT, dress

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rotfem.results.campbell import CampbellResult

Array = npt.NDArray[np.float64]

#: Inches: width of the diagram, of the legend beside it, and heights of the panels and of a line of the legend.
WIDTH, BESIDE, HEIGHTS, LINE = 10.0, 3.2, (4.8, 1.6), 0.185


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
        """Colour and dashes: waves against the spin are dashed."""
        return {"color": f"C{(self.number - 1) % 10}", "ls": "--" if "backward" in self.name else "-"}


def campbell_figure(result: CampbellResult, *, fixed: bool = False) -> Figure:
    """Return frequencies over speed, lines kΩ with their crossings, what is unstable, and damping where there is any.

    It reaches up to the lowest mode that no line meets; higher ones that would squash it are named in the legend. With
    `fixed` modes of a rotor are drawn as the fixed frame sees them, with the line Ω and synchronous critical speeds.
    """
    units, branches = ShownUnits.of(result.summary), drawn_branches(result, fixed)
    rise = float(units.frequencies(1.0) / units.speeds(1.0))  # of the line 1Ω
    orders = [1] if fixed else result.summary["orders"]
    first = min(0.0, *(float(b.speed[0]) for b in branches))
    last = max(0.0, *(float(b.speed[-1]) for b in branches))
    shown = branches if fixed or not orders else of_interest(branches, max(orders) * rise)
    top = 1.06 * max(float(np.max(b.frequency)) for b in shown)
    damped = any(np.nanmax(np.abs(b.damping), initial=0.0) > 0.0 for b in shown)
    figure = Figure()
    panels = figure.subplots(1 + damped, 1, sharex=True, squeeze=False)[:, 0]
    axis = panels[0]
    frequency = label("frequency", units.frequency, "fixed" if fixed else result.frame)
    captions = [frequency, label("log_decrement") if "log_decrement" in result.rows[0] else "damping ratio (%)"]
    for panel, caption in zip(panels, captions, strict=False):
        dress(panel, label("psi_dot", units.speed) if panel is panels[-1] else "", caption, size=None)
    for b in sorted(shown, key=lambda b: -float(b.frequency[-1])):  # as the legend names them
        axis.plot(b.speed, b.frequency, lw=1.6, label=b.name, **b.style)
        axis.plot(b.speed[b.unstable], b.frequency[b.unstable], "x", ms=5, color="C3", zorder=3)
        for i in np.flatnonzero(b.doubtful):
            axis.plot(b.speed[i - 1 : i + 1], b.frequency[i - 1 : i + 1], lw=7, color="0.6", alpha=0.5, zorder=1)
        if damped:
            there = np.isfinite(b.damping)
            panels[1].plot(b.speed[there], b.damping[there], lw=1.4, **b.style)
    for b in (b for b in branches if b not in shown):
        axis.plot([], [], " ", label=f"above: {b.name}, {b.frequency[-1]:.3g} {units.frequency}")
    for panel in panels:
        marks(panel, result, units, last)
    for k in orders:
        reach = top / (k * rise)
        x = np.array([np.clip(first, -reach, 0.0), 0.0, np.clip(last, 0.0, reach)])
        axis.plot(x, k * rise * np.abs(x), lw=0.8, ls=":", color="0.4", zorder=1)
        at = {"textcoords": "offset points", "fontsize": 8, "color": "0.4", "annotation_clip": False}
        axis.annotate(f"{k}Ω" if k > 1 else "Ω", (x[2], k * rise * x[2]), xytext=(2, 2), **at)
    crossings(axis, result, units, fixed)
    axis.set_xlim(first, last)
    axis.set_ylim(0.0, top)
    if damped:
        panels[1].axhline(0.0, lw=0.8, color="0.4", zorder=1)
    name_styles(axis, shown)
    entries = axis.get_legend_handles_labels()
    below, height = BELOW, max(BELOW + sum(HEIGHTS[: 1 + damped]) + 0.6, LINE * len(entries[0]) + 0.8)
    figure.set_size_inches(WIDTH, height)
    for panel, own in zip(panels[::-1], HEIGHTS[: 1 + damped][::-1], strict=True):
        panel.set_position((LEFT / WIDTH, below / height, 1.0 - (LEFT + BESIDE) / WIDTH, own / height))
        below += own + 0.2
    figure.suptitle(result.title, fontsize=11, y=1.0 - 0.08 / height, va="top")
    if entries[0]:
        place = (1.0 - (BESIDE - 0.2) / WIDTH, 1.0 - 0.45 / height)
        figure.legend(*entries, loc="upper left", bbox_to_anchor=place, fontsize=8, frameon=False)
    return figure


def fixed_figure(result: CampbellResult) -> Figure:
    """Return the diagram of a rotor as the fixed frame sees it."""
    return campbell_figure(result, fixed=True)


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


def crossings(axis: Axes, result: CampbellResult, units: ShownUnits, fixed: bool) -> None:
    """Draw critical speeds, synchronous ones filled."""
    for synchronous, name in ((True, "synchronous critical speed"), (False, "crossing with kΩ")):
        there = [c for c in result.critical_speeds if (c.kind != "per_rev") == synchronous]
        if there and (synchronous or not fixed):
            height = [seen_fixed(c) if fixed else c.frequency for c in there]
            speeds, heights = units.speeds([c.speed for c in there]), units.frequencies(height)
            style: dict[str, Any] = {"ms": 5} if synchronous else {"ms": 4, "mfc": "white"}
            axis.plot(speeds, heights, "ko", label=name, clip_on=False, zorder=4, **style)


def name_styles(axis: Axes, branches: list[Branch]) -> None:
    """Name crosses and broad lines in the legend, as far as there are some."""
    kinds: tuple[tuple[bool, str, dict[str, Any]], ...] = (
        (any(np.any(b.unstable) for b in branches), "grows", {"color": "C3", "ls": "", "marker": "x"}),
        (any(np.any(b.doubtful) for b in branches), "ambiguous", {"color": "0.6", "lw": 7, "alpha": 0.5}),
    )
    for there, name, style in kinds:
        if there:
            axis.plot([], [], label=name, **style)
