"""What a run returns: the history of a motion, or a steady state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rotfem.results.columns import Columns, ShortTable, ShownUnits, Variables, by_unit, dataset, label, largest, number
from rotfem.results.files import write_netcdf
from rotfem.results.result import Array, OfTable, Result
from rotfem.short import short_fields

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True)
class StationHistory:
    """What a beam has at its stations, over time.

    Attributes:
        t: times, (n,), s.
        x: positions of the stations, (m,), m.
        values: quantity ↦ its values, (n, m), in axes of the turned section; unknowns in those of the frame.
        format: of its file, "csv" or "netcdf".
    """

    t: Array
    x: Array
    values: dict[str, Array]
    format: str = "csv"
    __repr__ = short_fields

    def __getitem__(self, name: str) -> Array:
        """Return a quantity at all times and stations, (n, m)."""
        if name not in self.values:
            raise KeyError(f"no quantity {name!r} at the stations; there are {', '.join(self.values)}")
        return self.values[name]

    @property
    def columns(self) -> Columns:
        """Columns t, x and all quantities, a row for each time and station: as CSV, pandas or labelled arrays."""
        n, m = len(self.t), len(self.x)
        rows = {"t": np.repeat(self.t, m), "x": np.tile(self.x, n)}
        return Columns(rows | {name: values.ravel() for name, values in self.values.items()}, ("t", "x"))

    def to_pandas(self) -> pandas.DataFrame:
        """Return the quantities as a table indexed by `t` (s) and `x` (m)."""
        return self.columns.to_pandas()

    def to_xarray(self) -> xarray.Dataset:
        """Return the quantities over `t` (s) and `x` (m)."""
        return dataset(self.columns.variables(), {})


@dataclass(repr=False)
class RunResult(Result):
    """Outcome of `rotfem run`.

    Attributes:
        summary: scene, versions, effects, timings, sizes, figures of merit; JSON-able.
        history: column ↦ values over time (`t` s, `psi` rad, `psi_dot` rad/s, `tip_u1` m, `tip_u2` m, `tip_alpha` rad,
            `kinetic`, `strain`, `jacobi` J, `root_f1` N, `root_m3` N·m, `support_0_f2` N, …), in the frame; one row of
            a steady state.
        shape: column ↦ values along the structure at the end (`x` m, of a plate `y` m too, `u1` m, …).
        triangles: of a plate, triangles between the nodes of `shape`, (m, 3).
        fields: writes the fields for ParaView into a folder, on all ranks together; None of a beam.
        stations: section forces, strains and unknowns at the stations of a beam; None where none are asked for.
        resultants: of a plate whose stress resultants are asked for, column ↦ values at its nodes at the end.
    """

    history: dict[str, Array] = field(default_factory=dict)
    shape: dict[str, Array] = field(default_factory=dict)
    triangles: Any = field(default=None, repr=False)
    fields: Callable[[Path], list[Path]] | None = field(default=None, repr=False)
    stations: StationHistory | None = field(default=None, repr=False)
    resultants: dict[str, Array] = field(default_factory=dict)

    t = OfTable("t", "Times of the history, shape (n,), s.")

    @property
    def tip(self) -> dict[str, Array]:
        """Component ↦ motion of the tip over `t`, shape (n,), frame components: `u1`, … in m, rotations in rad."""
        return {name.removeprefix("tip_"): values for name, values in self.history.items() if name.startswith("tip_")}

    @property
    def steady(self) -> bool:
        """Whether this is a steady state, a history of one row, and not a motion over time."""
        return bool(self.summary["kind"] == "steady")

    @property
    def figures(self) -> dict[str, float]:
        """Figures of merit: smallest and largest value of every component of tip and root, their times, the last value.

        A free hub has them of `psi`, `psi_dot` and `torque`, too, and where its torque ends before the history, at
        `torque_end` (s), the residual vibration of the tip, `tip_u2_residual`: half of its range from then on (m).
        """
        return dict(self.summary["figures"])

    @property
    def table(self) -> Columns:
        """The history over `t`."""
        return Columns(self.history, ("t",))

    def data(self) -> dict[str, Columns]:
        """Return the history, the shape at its end and the stress resultants, as far as there are any."""
        of_nodes = {"shape": self.shape, "resultants": self.resultants}
        nodes = {name: Columns(columns, dimension="node") for name, columns in of_nodes.items() if columns}
        return {"history": self.table, **nodes}

    def texts(self) -> dict[str, str]:
        """Return a CSV file of each table, and stations.csv where that is asked for."""
        stations = self.stations if self.stations is not None and self.stations.format == "csv" else None
        return super().texts() | ({} if stations is None else {"stations.csv": stations.columns.csv()})

    def large(self) -> list[Callable[[Path], object]]:
        """Return what writes stations.nc, where that is asked for."""
        stations = self.stations
        if stations is None or stations.format != "netcdf":
            return []
        return [lambda folder: write_netcdf(folder / "stations.nc", stations.to_xarray())]

    def drawn(self) -> dict[str, str]:
        """Return history.png and loads.png of a time history, shape.png of a steady state and of plates."""
        over_time = len(self.history.get("t", ())) > 1
        there = {
            "history": over_time,
            "loads": over_time and any(name.startswith("root_") for name in self.history),
            "shape": bool(self.shape) and (self.triangles is not None or not over_time),
            "resultants": bool(self.resultants),
            "stations": self.stations is not None and len(self.stations.t) > 0,
        }
        return {f"{name}.png": f"results.plots:{name}_figure" for name, drawn in there.items() if drawn}

    def tables(self) -> list[ShortTable]:
        """Return extremes and last values of the tip's displacement and of a free hub, of a steady state all values."""
        found, units = self.figures, ShownUnits.of(self.summary)
        ends = {k.removesuffix("_final"): v for k, v in found.items() if k.endswith("_final")}
        if self.steady:
            scales = by_unit(ends)
            values = [(label(name), number(ends[name], scales[name])) for name in ends]
            return [ShortTable((f"{self.frame} frame", "value"), values)]
        shown = [name for name in ends if name.startswith(("tip_u", *HUB)) and f"{name}_min" in found]
        scales = by_unit({name: largest(found[f"{name}_{end}"] for end in ("min", "max")) for name in shown})
        head, rows = [f"{self.frame} frame", "smallest", "at t (s)", "largest", "at t (s)", "at the end"], []
        for name in shown:
            unit, factor = (units.speed, float(units.speeds(1.0))) if name == "psi_dot" else ("", 1.0)
            low, high, last = (number(factor * found[f"{name}_{end}"], scales[name]) for end in ("min", "max", "final"))
            when = [number(found[f"{name}_{end}_time"], float(self.t[-1])) for end in ("min", "max")]
            residual = [f"{found[key]:.6g}" for key in [f"{name}_residual"] if key in found]
            rows.append((label(name, unit), low, when[0], high, when[1], last, *residual))
        if "torque_end" in found:
            head.append(f"± after {found['torque_end']:.6g} s")
        return [ShortTable(tuple(head), rows)] if rows else []

    def arrays(self) -> Variables:
        """Return the history over `t` (s), and shape and resultants over `node`, of a plate with its `triangles`."""
        out = {name: values for columns in self.data().values() for name, values in columns.variables().items()}
        return out if self.triangles is None else out | {"triangles": (("triangle", "corner"), self.triangles)}


#: Columns of a history that say how a free hub turns.
HUB = ("psi", "psi_dot", "torque")


def figures(history: dict[str, Array]) -> dict[str, float]:
    """Return the figures of merit (see `RunResult.figures`), with those of supports and the Jacobi drift.

    Extremes inside the history are those of the parabola through three neighbouring samples.
    """
    out: dict[str, float] = {}
    t, free = history["t"], "torque" in history
    if len(t) == 0:
        return out
    pushed = np.flatnonzero(history["torque"] if free else np.zeros(0))
    if len(pushed) and (after := pushed[-1] + 1) < len(t) - 1:
        out["torque_end"] = t[after]
        for name in (n for n in history if n.startswith("tip_u")):
            out[f"{name}_residual"] = np.ptp(history[name][after:]) / 2
    for name in [n for n in history if n.startswith(("tip_", "root_", "support_")) or (free and n in HUB)]:
        out[f"{name}_final"] = history[name][-1]
        if len(t) > 1:
            out[f"{name}_min_time"], out[f"{name}_min"] = extreme(t, history[name], -1)
            out[f"{name}_max_time"], out[f"{name}_max"] = extreme(t, history[name], 1)
    if len(t) > 1:
        scale = max(float(np.max(np.abs(history["kinetic"]))), float(np.max(np.abs(history["strain"]))), 1e-300)
        out["jacobi_change"] = (history["jacobi"][-1] - history["jacobi"][0]) / scale
    return {key: float(value) for key, value in out.items()}


def extreme(t: Array, y: Array, sign: int) -> tuple[float, float]:
    """Return (time, value) of the largest sign·y, by a parabola through the largest sample and its neighbours."""
    i = int(np.argmax(sign * y))
    if i in (0, len(y) - 1) or y[i] in (y[i - 1], y[i + 1]):  # at an end, or where a torque jumps
        return float(t[i]), float(y[i])
    c = np.polyfit(t[i - 1 : i + 2] - t[i], y[i - 1 : i + 2], 2)
    if c[0] * sign >= 0:
        return float(t[i]), float(y[i])
    s = -c[1] / (2 * c[0])
    return float(t[i] + s), float(np.polyval(c, s))
