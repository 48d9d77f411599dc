"""What the analysis of modes returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rotfem.results.blade_tables import elastodyn_lines, mode_polynomials, mode_table
from rotfem.results.files import csv_text, json_text, rows_text
from rotfem.results.frames import Variable, column_of_rows, dataset, frame_of_rows, nodes_of
from rotfem.results.result import Result
from rotfem.results.units import ShownUnits

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]


@dataclass
class ModesResult(Result):
    """Outcome of `rotfem modes`.

    Attributes:
        summary: scene, speed, modes, self-checks, warnings, timings; JSON-able.
        rows: one dictionary a mode: `mode`, `label`, `frequency` (rad/s), `frequency_hz`, `damping` (ratio), `growth`
            (1/s), `stability`, `share_…` (of the kinetic energy), `residual` (backward error),
            `error_bound` (how far round-off can have moved the eigenvalue, relative to its size),
            `mesh_error` (how far the mesh is estimated to have put the frequency off, relative; with `output.error`).
        shapes: title ↦ columns along the structure: `x` (m), of a plate `y`, each component and its imaginary part,
            dimensionless: translations over the largest one of the mode, a vector at the phase where it is largest,
            rotations (rad) times `summary["shapes"]["length"]` (m, of the structure) over it. A mode whose kinetic
            energy is mostly that of rotations has a largest rotation, times the length, of 1.
        sensitivities: one dictionary a mode and parameter: `mode`, `parameter`, `value`, `dfrequency` (rad/s per unit),
            `dgrowth` (1/s per unit), `relative` (p/ω dω/dp); empty if not asked for.
        blade_tables: whether files of the modes for programs of wind turbines are wanted (see `blade_tables`).
        triangles: of a plate, triangles between the nodes of `shapes`, (m, 3).
        fields: writes the modes for ParaView into a folder, on all ranks together; None of a beam.
        analysis, spinning: the compiled scene and its eigenpairs, for further work in Python.
    """

    rows: list[dict[str, Any]]
    shapes: dict[str, dict[str, Array]] = field(default_factory=dict)
    sensitivities: list[dict[str, Any]] = field(default_factory=list)
    blade_tables: bool = False
    triangles: Any = field(default=None, repr=False)
    fields: Callable[[Path], list[Path]] | None = field(default=None, repr=False)
    analysis: Any = field(default=None, repr=False)
    spinning: Any = field(default=None, repr=False)

    @property
    def speed(self) -> float:
        """Speed the modes are those of, rad/s."""
        return float(self.summary["speed"])

    @property
    def labels(self) -> list[str]:
        """Name of every mode."""
        return [row["label"] for row in self.rows]

    @property
    def frequencies(self) -> Array:
        """Frequencies in the rotating frame, shape (modes,), rad/s; the rigid-body mode of a free hub has 0."""
        return self.column("frequency")

    @property
    def frequencies_hz(self) -> Array:
        """Frequencies in the rotating frame, shape (modes,), Hz."""
        return self.column("frequency_hz")

    @property
    def damping(self) -> Array:
        """Damping ratios −Re λ/|λ|, shape (modes,)."""
        return self.column("damping")

    @property
    def growth(self) -> Array:
        """Growth Re λ of every mode, shape (modes,), 1/s; negative where it dies away."""
        return self.column("growth")

    @property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues λ = growth + i frequency, shape (modes,), rad/s."""
        return self.growth + 1j * self.frequencies

    @property
    def stable(self) -> bool:
        """Whether no mode grows."""
        return all(row["stability"] in ("stable", "neutral") for row in self.rows)

    def column(self, name: str) -> Array:
        """Return a number of every mode, shape (modes,): `frequency`, `residual`, `share_lag` and so on.

        Raises:
            KeyError: there is none of that name.
        """
        there = [key for key, value in (self.rows[0] if self.rows else {}).items() if not isinstance(value, str)]
        if name not in there:
            raise KeyError(f"no number {name!r} of the modes; there are {', '.join(there)}")
        return np.array([row[name] for row in self.rows], dtype=np.float64)

    def files(self) -> dict[str, str]:
        """Return modes.csv, mode_shapes.csv, modes.json, summary.json, and what else is wanted.

        Raises:
            InputError: tables over the span are wanted of a plate.
        """
        shapes: dict[str, Array] = {}
        for i, columns in enumerate(self.shapes.values(), start=1):
            shapes |= {name if name in ("x", "y") else f"{name}_{i}": values for name, values in columns.items()}
        return {
            **({"sensitivities.csv": rows_text(self.sensitivities)} if self.sensitivities else {}),
            **(self._blade_files() if self.blade_tables else {}),
            "modes.csv": rows_text(ShownUnits.of(self.summary).rows(self.rows)),
            "mode_shapes.csv": csv_text(shapes),
            "modes.json": json_text({"speed": self.summary["speed"], "modes": self.rows}),
            "summary.json": json_text(self.summary),
        }

    def _blade_files(self) -> dict[str, str]:
        fitted = self.mode_polynomials()
        return {
            "mode_table.csv": rows_text(self.mode_table()),
            "mode_polynomials.csv": rows_text(fitted),
            "elastodyn_modes.dat": elastodyn_lines(fitted),
        }

    def mode_table(self) -> list[dict[str, Any]]:
        """Return the modes of a beam over its span (see `rotfem.results.blade_tables.mode_table`).

        Raises:
            InputError: the structure is no beam.
        """
        return mode_table(self)

    def mode_polynomials(self) -> list[dict[str, Any]]:
        """Return polynomials of the bending modes (see `rotfem.results.blade_tables.mode_polynomials`).

        Raises:
            InputError: the structure is no beam.
        """
        return mode_polynomials(self)

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return modes.png, the shapes of all modes."""
        from rotfem.results import plots, plots_plate

        if not self.shapes:
            return {}
        draw = plots.shapes_figure if self.triangles is None else plots_plate.modes_figure
        return {"modes.png": partial(draw, self)}

    def to_pandas(self) -> pandas.DataFrame:
        """Return one row a mode, indexed by `mode`: label, frequency (rad/s), damping, shares, …, as in modes.csv.

        Raises:
            ImportError: pandas is not installed.
        """
        return frame_of_rows(self.rows, "mode")

    def to_xarray(self) -> xarray.Dataset:
        """Return the columns of modes.csv over `mode`, and the shapes over `mode` and `node`.

        Shapes `shape_u1`, … are complex, scaled as `shapes`, NaN for the rigid-body mode, which has none.
        Coordinates are the modes' labels, the speed (rad/s), the nodes' `x` (m), of a plate `y` and `triangles` too.

        Raises:
            ImportError: xarray is not installed.
        """
        names = [name for name in (self.rows[0] if self.rows else ()) if name not in ("mode", "label")]
        over: dict[str, Variable] = {name: (("mode",), column_of_rows(self.rows, name)) for name in names}
        coordinates: dict[str, Variable] = {
            "mode": (("mode",), np.array([row["mode"] for row in self.rows], dtype=np.int64)),
            "label": (("mode",), np.array(self.labels, dtype=str)),
            "speed": ((), np.array(self.speed)),
        }
        first = next(iter(self.shapes.values()), {})
        coordinates |= nodes_of(first, self.triangles)
        return dataset({**over, **self._shape_variables(first)}, coordinates, self._attributes())

    def _shape_variables(self, first: dict[str, Array]) -> dict[str, Variable]:
        """Return `shape_…` ↦ complex shapes over modes and nodes; the rigid-body mode comes first and has none."""
        out: dict[str, Variable] = {}
        for name in (name for name in first if f"{name}_imag" in first):
            values = np.full((len(self.rows), len(first[name])), np.nan, dtype=np.complex128)
            for i, columns in enumerate(self.shapes.values(), start=len(self.rows) - len(self.shapes)):
                values[i] = columns[name] + 1j * columns[f"{name}_imag"]
            out[f"shape_{name}"] = (("mode", "node"), values)
        return out
