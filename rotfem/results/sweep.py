"""What a sweep returns: a table with one row for each point, and a figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.columns import ZERO, ShortTable, label_of, numbers
from rotfem.results.files import write_netcdf
from rotfem.results.result import Rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def quantities(summary: Mapping[str, Any]) -> dict[str, float]:
    """Return the numbers that stand for the result of a summary in a table of many."""
    command = summary.get("command")
    if command == "run":
        return dict(summary["figures"])
    if command == "modes":
        return {f"{name}_{row['mode']}": row[name] for name in ("frequency", "damping") for row in summary["modes"]}
    if command == "campbell":
        found = {f"frequency_last_{i}": b["frequency_last"] for i, b in enumerate(summary["branches"], start=1)}
        for c in summary["critical_speeds"]:
            found.setdefault(f"speed_{c['kind']}_{c['order']}_{c['branch']}", c["speed"])
        return found
    if command == "unbalance":
        peaks = enumerate(summary["peaks"], start=1)
        return {f"{name}_peak_{i}": peak[name] for i, peak in peaks for name in ("speed", "major", "amplification")}
    if command == "response":
        peaks = summary["peaks"]
        sizes = {f"{name}_peak": peak["amplitude"] for name, peak in peaks.items()}
        return sizes | {f"frequency_{name}": peak["frequency"] for name, peak in peaks.items()}
    return {name: value for name, value in summary.items() if isinstance(value, float)}


@dataclass(repr=False)
class SweepResult(Rows):
    """Outcome of `rotfem sweep`.

    Attributes:
        summary: scene, verb, swept keys with their values, numbers of points; JSON-able.
        rows: one dictionary a point: the value of every swept key, what was computed there (see `quantities`),
            `status`, `reason` where it failed, `seconds` it took, `folder` with its results.
    """

    @property
    def index(self) -> tuple[str, ...]:  # type: ignore[override]
        """Swept keys."""
        return tuple(self.keys)

    @property
    def keys(self) -> dict[str, list[Any]]:
        """Swept keys ↦ their values."""
        return dict(self.summary["keys"])

    @property
    def names(self) -> list[str]:
        """Names of what was computed."""
        return [name for name in self.table.values if name not in (*self.keys, "status", "reason", "folder")]

    def array(self, name: str) -> npt.NDArray[Any]:
        """Return a quantity over the swept keys, one axis a key; NaN where there is none."""
        return np.asarray(self.table.grid(name)[1], dtype=np.float64)

    def large(self) -> list[Callable[[Path], object]]:
        """Return what writes sweep.nc."""
        return [lambda folder: write_netcdf(folder / "sweep.nc", self.to_xarray())]

    def drawn(self) -> dict[str, str]:
        """Return sweep.png; nothing where no quantity varies."""
        return {"sweep.png": "results.sweep:sweep_figure"} if self.varying() else {}

    def varying(self) -> list[str]:
        """Return the names of what changes from point to point by more than round-off, without times."""
        out = []
        for name in (n for n in self.names if n != "seconds" and not n.endswith("_time")):
            y = self.array(name)
            y = y[np.isfinite(y)]
            size = max(np.max(np.abs(y), initial=0.0), 1.0 if name.startswith("damping") else 0.0)
            if len(y) and np.ptp(y) > ZERO * size:
                out.append(name)
        return out

    def tables(self) -> list[ShortTable]:
        """Return one row a point: its place on the grid and the first two quantities that vary."""
        names = self.varying()[:2]
        columns = [[str(row[key]) for row in self.rows] for key in self.keys]
        columns += [numbers([row.get(name) for row in self.rows]) for name in names]
        columns.append([row["status"] for row in self.rows])
        return [ShortTable((*self.keys, *map(label_of, names), "status"), list(zip(*columns, strict=True)))]


def sweep_figure(result: SweepResult) -> Figure:
    """Return the first six quantities that vary over the first swept key, a line for each value of the others."""
    from matplotlib.figure import Figure

    from rotfem.results.plots import dress

    names, (first, *others) = result.varying()[:6], list(result.keys)
    figure = Figure(figsize=(9, 1.9 * len(names) + 0.8), layout="constrained")
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    lines = list(result.keys.values())[1:]
    for axis, name in zip(axes, names, strict=True):
        y = result.array(name).reshape(len(result.keys[first]), -1)
        for j, place in enumerate(np.ndindex(*map(len, lines))):
            said = ", ".join(f"{k} = {v[i]}" for k, v, i in zip(others, lines, place, strict=True))
            colour = f"C{j}" if y.shape[1] <= 10 else None
            axis.plot(result.keys[first], y[:, j], ".-", lw=1.2, color=colour, label=said)
        dress(axis, first if axis is axes[-1] else "", label_of(name), size=None)
    if others:
        handles, said = axes[0].get_legend_handles_labels()
        across = max(1, 120 // (6 + max(map(len, said))))  # the figure is 120 letters wide
        figure.legend(handles[:12], said[:12], loc="outside upper center", ncols=across, frameon=False, fontsize=8)
    return figure
