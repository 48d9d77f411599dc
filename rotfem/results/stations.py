"""Section forces, strains and unknowns over time at stations along a beam: table, files, figure."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
import numpy.typing as npt

from rotfem.errors import OutputError
from rotfem.results.columns import described
from rotfem.results.files import csv_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StationHistory:
    """What a beam has at its stations, over time.

    Attributes:
        t: times, (n,), s.
        x: positions of the stations, (m,), m.
        values: quantity ↦ its values, (n, m), in axes of the turned section; unknowns in those of the frame.
        format: of its file, "csv" or "hdf5".
    """

    t: Array
    x: Array
    values: dict[str, Array]
    format: str = "csv"

    def __getitem__(self, name: str) -> Array:
        """Return a quantity at all times and stations, (n, m).

        Raises:
            KeyError: there is none of that name.
        """
        if name not in self.values:
            raise KeyError(f"no quantity {name!r} at the stations; there are {', '.join(self.values)}")
        return self.values[name]

    def columns(self) -> dict[str, Array]:
        """Return t, x and all quantities as columns, a row for each time and station."""
        n, m = len(self.t), len(self.x)
        out = {"t": np.repeat(self.t, m), "x": np.tile(self.x, n)}
        return out | {name: values.ravel() for name, values in self.values.items()}

    def text(self) -> str:
        """Return the columns as CSV."""
        return csv_text(self.columns())

    def write_hdf5(self, path: Path) -> Path:
        """Write t, x and the quantities as HDF5 datasets with their units; return the path.

        Raises:
            OutputError: it cannot be written.
        """
        try:
            with h5py.File(path, "w") as file:
                for name, values in {"t": self.t, "x": self.x, **self.values}.items():
                    data = file.create_dataset(name, data=values, compression="gzip" if values.ndim > 1 else None)
                    data.attrs["long_name"], data.attrs["units"] = described(name)
        except OSError as error:
            raise OutputError(path, str(error).splitlines()[0]) from None
        return path

    def figure(self, title: str) -> Figure:
        """Return every quantity along the beam at the last time, and of a motion the range it has had."""
        from rotfem.results.plots import stacked

        last = {"x": self.x, **{name: values[-1] for name, values in self.values.items()}}
        figure = stacked(last, "x", list(self.values), title)
        if len(self.t) > 1:
            for axis, values in zip(figure.axes, self.values.values(), strict=True):
                axis.fill_between(self.x, values.min(axis=0), values.max(axis=0), alpha=0.2, lw=0.0)
            figure.axes[0].set_title(f"{title}, t = {self.t[-1]:.6g} s, and the range over time", fontsize=9)
        return figure
