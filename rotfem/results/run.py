"""What a run returns: the history of a motion, or a steady state."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.files import csv_text, json_text
from rotfem.results.frames import Variable, dataset, frame, nodes_of
from rotfem.results.result import Result
from rotfem.results.stations import StationHistory

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]


class Table:
    """Columns of equal length that grow by rows.

    Args:
        columns: names, in the order they are written.
    """

    def __init__(self, columns: Iterable[str]):
        self.columns = tuple(columns)
        self._rows: list[tuple[float, ...]] = []

    def append(self, row: Iterable[float]) -> None:
        """Add one row in the order of the columns."""
        self._rows.append(tuple(float(value) for value in row))

    def __len__(self) -> int:
        return len(self._rows)

    def rows(self, first: int = 0) -> list[tuple[float, ...]]:
        """Return the rows from the one of that number on."""
        return self._rows[first:]

    def arrays(self) -> dict[str, Array]:
        """Return name ↦ array of all values so far."""
        values = np.array(self._rows, dtype=np.float64).reshape(len(self._rows), len(self.columns))
        return {name: values[:, i].copy() for i, name in enumerate(self.columns)}


@dataclass
class RunResult(Result):
    """Outcome of `rotfem run`.

    Attributes:
        summary: scene, versions, effects, timings, sizes, figures of merit; JSON-able.
        history: column ↦ values over time (`t` s, `psi` rad, `psi_dot` rad/s, `tip_u1` m, `tip_u2` m, `tip_alpha` rad,
            `kinetic`, `strain`, `jacobi` J, `root_f1` N, `root_m3` N·m, …), in the frame; one row of a steady state.
        shape: column ↦ values along the structure at the end (`x` m, of a plate `y` m too, `u1` m, …).
        triangles: of a plate, triangles between the nodes of `shape`, (m, 3).
        fields: writes the fields for ParaView into a folder, on all ranks together; None of a beam.
        stations: section forces, strains and unknowns at the stations of a beam; None where none are asked for.
        resultants: of a plate whose stress resultants are asked for, column ↦ values at its nodes at the end.
        further: what else writes files into a folder.
    """

    history: dict[str, Array] = field(default_factory=dict)
    shape: dict[str, Array] = field(default_factory=dict)
    triangles: Any = field(default=None, repr=False)
    fields: Callable[[Path], list[Path]] | None = field(default=None, repr=False)
    stations: StationHistory | None = field(default=None, repr=False)
    resultants: dict[str, Array] = field(default_factory=dict)
    further: list[Callable[[Path], object]] = field(default_factory=list, repr=False)

    @property
    def t(self) -> Array:
        """Times of the history, shape (n,), s."""
        return self.column("t")

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
        """Figures of merit: of every tip component smallest and largest value, their times, and the last value."""
        return dict(self.summary["figures"])

    def column(self, name: str) -> Array:
        """Return a column of the history, shape (n,).

        Raises:
            KeyError: there is none of that name.
        """
        if name not in self.history:
            raise KeyError(f"no column {name!r} in the history; there are {', '.join(self.history)}")
        return self.history[name]

    def files(self) -> dict[str, str]:
        """Return history.csv, shape.csv and stations.csv, as far as there is one, and summary.json."""
        tables = {"history.csv": self.history, "shape.csv": self.shape, "resultants.csv": self.resultants}
        texts = {name: csv_text(columns) for name, columns in tables.items() if columns}
        if self.stations is not None and self.stations.format == "csv":
            texts["stations.csv"] = self.stations.text()
        return {**texts, "summary.json": json_text(self.summary)}

    def large(self) -> list[Callable[[Path], object]]:
        """Return what writes stations.h5 and files for ParaView, where these are asked for."""
        stations = self.stations
        if stations is None or stations.format != "hdf5":
            return list(self.further)
        return [lambda folder: stations.write_hdf5(folder / "stations.h5"), *self.further]

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return history.png of a time history, shape.png of a steady state and of plates."""
        from rotfem.results import plots, plots_plate

        over_time = len(self.history.get("t", ())) > 1
        out: dict[str, Callable[[], Figure]] = {}
        if over_time:
            out["history.png"] = partial(plots.history_figure, self)
        if self.shape and self.triangles is not None:
            out["shape.png"] = partial(plots_plate.shape_figure, self)
        elif self.shape and not over_time:
            out["shape.png"] = partial(plots.shape_figure, self)
        if self.resultants:
            out["resultants.png"] = partial(plots_plate.resultants_figure, self)
        if self.stations is not None and len(self.stations.t):
            out["stations.png"] = partial(self.stations.figure, self.title)
        return out

    def to_pandas(self) -> pandas.DataFrame:
        """Return the history, one row a time, indexed by `t` (s).

        Raises:
            ImportError: pandas is not installed.
        """
        return frame(self.history, "t")

    def to_xarray(self) -> xarray.Dataset:
        """Return the history over `t` (s), and the shape at its end over `node` with the nodes' `x` (m).

        A plate has the nodes' `y` and the `triangles` between them too.

        Raises:
            ImportError: xarray is not installed.
        """
        over: dict[str, Variable] = {name: (("t",), values) for name, values in self.history.items() if name != "t"}
        nodes = nodes_of(self.shape, self.triangles)
        along: dict[str, Variable] = {
            name: (("node",), values) for name, values in self.shape.items() if name not in nodes
        }
        return dataset({**over, **along}, {"t": (("t",), self.t), **nodes}, self._attributes())
