"""Outcome of `rotfem unbalance`: whirl of a shaft over its speed, in the fixed frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.columns import ShortTable, ShownUnits, Variables
from rotfem.results.result import Rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]


@dataclass(repr=False)
class UnbalanceResult(Rows):
    """Outcome of `rotfem unbalance`.

    Attributes:
        summary: scene, unbalances, places, peaks, warnings, timings; JSON-able.
        rows: one dictionary a speed and place: `speed` (rad/s), `x` (m); amplitudes `u2`, `u3` (m) and phases
            `u2_phase`, `u3_phase` (rad, ahead of direction 2 of the shaft) in the fixed frame; semi-axes `major` and
            `minor` (m, negative of backward precession) of the orbit and `angle` (rad) of the larger one; at supports
            the amplitudes `f2`, `f3` (N) and phases `f2_phase`, `f3_phase` of the force of the shaft on them, of its
            moment `m2`, `m3` (N·m) on those with tilting coefficients; at a probe its reading `probe` (m) and
            `probe_phase` (rad).
        shapes: complex displacements (m), (speeds, 2, nodes), of the nodes `x` (m) of the shaft.
        x: nodes, m, increasing.
    """

    shapes: npt.NDArray[np.complex128]
    x: Array
    index = ("speed", "x")
    figure = "results.unbalance:bode_figure"

    @property
    def speeds(self) -> Array:
        """Speeds, (speeds,), rad/s, increasing."""
        return np.asarray(np.unique([row["speed"] for row in self.rows]))

    @property
    def at_peaks(self) -> list[int]:
        """Numbers of the speeds that are nearest to peaks, four at most; that of the last one where there is none."""
        nearest = [int(np.argmin(np.abs(self.speeds - peak["speed"]))) for peak in self.summary["peaks"]]
        return list(dict.fromkeys(nearest))[:4] or [len(self.speeds) - 1]

    def at(self, x: float) -> dict[str, Array]:
        """Return the columns over the speeds of one of the places, by name; `x` is the place nearest to it (m)."""
        nearest = min(self.summary["places"], key=lambda place: abs(place - x))
        rows = [row for row in self.rows if row["x"] == nearest]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    def drawn(self) -> dict[str, str]:
        """Return the diagram of amplitude and phase over speed, polar plots, orbits, and deflected shapes."""
        names = ("bode", "polar", "orbits", "shapes")
        return {f"unbalance_{name}.png": f"results.unbalance:{name}_figure" for name in names}

    def tables(self) -> list[ShortTable]:
        """Return one row a peak: place, speed, amplitude, amplification factor, separation margin."""
        units, peaks = ShownUnits.of(self.summary), self.summary["peaks"]
        rows = [
            (
                f"{peak['x']:.6g}",
                f"{units.speeds(peak['speed']):.8g}",
                f"{peak['major']:.4g}",
                "–" if peak["amplification"] is None else f"{peak['amplification']:.4g}",
                "–" if peak["margin"] is None else f"{100 * peak['margin']:.3g}",
            )
            for peak in peaks
        ]
        head = (
            "x (m)",
            f"peak at ({units.speed})",
            "largest semi-axis, fixed frame (m)",
            "amplification",
            "margin (%)",
        )
        return [ShortTable(head, rows)]

    def arrays(self) -> Variables:
        """Return the columns over `speed` and `x`, and the displacements of the nodes over `speed` and `node`."""
        shapes = {f"shape_u{i}": (("speed", "node"), self.shapes[:, i - 2]) for i in (2, 3)}
        return {**super().arrays(), "node_x": (("node",), self.x), **shapes}


def _places(result: UnbalanceResult) -> list[float]:
    """Return the places that figures show: probes if there are any, else the four with the largest orbits."""
    probes = [probe["x"] for probe in result.summary["probes"]]
    largest = {x: max(row["major"] for row in result.rows if row["x"] == x) for x in result.summary["places"]}
    return list(dict.fromkeys(probes)) or sorted(sorted(largest, key=lambda x: -largest[x])[:4])


def _title(result: UnbalanceResult) -> str:
    return f"{result.title}, unbalance response in the fixed frame"


def bode_figure(result: UnbalanceResult) -> Figure:
    """Return the semi-axes of orbits and the phases along direction 2 over the speed."""
    from rotfem.results.plots import panels_over

    units = ShownUnits.of(result.summary)
    figure, (above, below) = panels_over(f"speed Ω ({units.speed})", 2, _title(result), beside=1.1)
    for c, x in enumerate(_places(result)):
        of = result.at(x)
        speed = units.speeds(of["speed"])
        above.semilogy(speed, of["major"], color=f"C{c}", label=f"x = {x:.4g} m")
        below.plot(speed, np.degrees(np.unwrap(of["u2_phase"])), color=f"C{c}")
    for peak in result.summary["peaks"]:
        above.axvline(float(units.speeds(peak["speed"])), color="0.8", lw=0.8, zorder=0)
    if operating := result.summary.get("operating"):
        for panel in (above, below):
            panel.axvspan(*units.speeds(operating), color="C2", alpha=0.12, lw=0)
    above.set_ylabel("larger semi-axis (m)")
    above.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=8, frameon=False)
    below.set_ylabel("phase of u₂ (°)")
    return figure


def polar_figure(result: UnbalanceResult) -> Figure:
    """Return the amplitudes along direction 2 in the complex plane, over the speed."""
    from matplotlib.figure import Figure

    units, places = ShownUnits.of(result.summary), _places(result)
    figure = Figure(figsize=(max(3.4 * len(places), 5.0), 3.8), layout="constrained")
    figure.suptitle(f"{_title(result)}; u₂ (m) over speed", fontsize=10)
    for c, x in enumerate(places):
        axis: Any = figure.add_subplot(1, len(places), c + 1, projection="polar")
        of = result.at(x)
        axis.plot(of["u2_phase"], of["u2"], color=f"C{c}", marker=".", ms=3, lw=1)
        axis.set_title(f"x = {x:.4g} m", fontsize=9)
        axis.tick_params(labelsize=7)
        for i in (int(np.argmax(of["u2"])), len(of["u2"]) - 1):
            text = f"{units.speeds(of['speed'][i]):.4g} {units.speed}"
            axis.annotate(text, (of["u2_phase"][i], of["u2"][i]), fontsize=7)
    return figure


def orbits_figure(result: UnbalanceResult) -> Figure:
    """Return the orbits of the places at the speeds of the peaks, seen along the shaft, in the fixed frame."""
    from matplotlib.figure import Figure

    units, places = ShownUnits.of(result.summary), _places(result)
    numbers = result.at_peaks
    figure = Figure(figsize=(max(3.2 * len(numbers), 5.0), 3.6), layout="constrained")
    figure.suptitle(f"{_title(result)}: orbits", fontsize=10)
    turn = np.exp(1j * np.linspace(0.0, 1.9 * np.pi, 200))  # the gap shows the sense
    for column, near in enumerate(numbers):
        axis = figure.add_subplot(1, len(numbers), column + 1, aspect="equal")
        for c, x in enumerate(places):
            of = {name: values[near] for name, values in result.at(x).items()}
            y, z = (of[u] * np.exp(1j * of[f"{u}_phase"]) * turn for u in ("u2", "u3"))
            axis.plot(y.real, z.real, color=f"C{c}", lw=1.2, label=f"x = {x:.4g} m")
            axis.plot(y.real[:1], z.real[:1], "o", color=f"C{c}", ms=3)
        axis.set_title(f"{units.speeds(result.speeds[near]):.5g} {units.speed}", fontsize=9)
        axis.set(xlabel="u₂ (m)", ylabel="u₃ (m)" if column == 0 else "")
        axis.tick_params(labelsize=7)
        axis.ticklabel_format(style="sci", scilimits=(-2, 2))
    figure.axes[-1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=7, frameon=False)
    return figure


def shapes_figure(result: UnbalanceResult) -> Figure:
    """Return the larger semi-axes along the shaft at the speeds of the peaks."""
    from rotfem.results.plots import panels_over

    units = ShownUnits.of(result.summary)
    figure, (axis,) = panels_over("x along the shaft (m)", 1, f"{_title(result)}: deflected shape", beside=1.1)
    for speed in result.at_peaks:
        y, z = result.shapes[speed]
        major = np.abs(y + 1j * z) / 2 + np.abs(y.conj() + 1j * z.conj()) / 2
        axis.plot(result.x, major, label=f"{units.speeds(result.speeds[speed]):.5g} {units.speed}")
    axis.set_ylabel("larger semi-axis (m)")
    axis.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=8, frameon=False)
    return figure
