"""What a computation returns: plain arrays, and how they are written and read. No dolfinx in it."""

from __future__ import annotations

import csv
import io
import json
import os
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import OutputError
from rotfem.results.files import csv_text, rows_text, json_text, write_text

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

    def arrays(self) -> dict[str, Array]:
        """Return name ↦ array of all values so far."""
        values = np.array(self._rows, dtype=np.float64).reshape(len(self._rows), len(self.columns))
        return {name: values[:, i].copy() for i, name in enumerate(self.columns)}


@dataclass
class RunResult:
    """Outcome of `rotfem run`.

    Attributes:
        summary: scene, versions, effects, timings, sizes, figures of merit; JSON-able.
        history: column ↦ values over time (`t` s, `psi` rad, `psi_dot` rad/s, `tip_u1` m, `tip_u2` m, `tip_alpha` rad,
            `kinetic`, `strain`, `jacobi` J, …), frame components; one row for a steady state.
        shape: column ↦ values along the structure at the end (`x` m, of a plate `y` m too, `u1` m, …).
        triangles: of a plate, triangles between the nodes of `shape`, (m, 3).
        fields: writes the fields for ParaView into a folder, on all ranks together; None of a beam.
    """

    summary: dict[str, Any]
    history: dict[str, Array] = field(default_factory=dict)
    shape: dict[str, Array] = field(default_factory=dict)
    triangles: Any = field(default=None, repr=False)
    fields: Callable[[Path], list[Path]] | None = field(default=None, repr=False)

    def write(self, folder: str | Path) -> list[Path]:
        """Write summary.json, history.csv and shape.csv, each whole or not at all; return their paths.

        Raises:
            OutputError: the folder cannot be written.
        """
        folder = Path(folder)
        written = []
        for name, columns in (("history.csv", self.history), ("shape.csv", self.shape)):
            if columns:
                written.append(write_text(folder / name, csv_text(columns)))
        written.append(write_text(folder / "summary.json", json_text(self.summary)))
        return written


@dataclass
class ModesResult:
    """Outcome of `rotfem modes`.

    Attributes:
        summary: scene, speed, modes, self-checks, warnings, timings; JSON-able.
        rows: one dictionary a mode: `mode`, `label`, `frequency` (rad/s), `frequency_hz`, `damping` (ratio), `growth`
            (1/s), `stability`, `share_…` (of the kinetic energy), `residual` (backward error).
        shapes: title ↦ columns along the structure: `x` (m), of a plate `y`, each component and its imaginary part,
            largest entry 1.
        sensitivities: one dictionary a mode and parameter: `mode`, `parameter`, `value`, `dfrequency` (rad/s per unit),
            `dgrowth` (1/s per unit), `relative` (p/ω dω/dp); empty if not asked for.
        triangles, fields: as of a run.
        analysis, spinning: the compiled scene and its eigenpairs, for further work in Python.
    """

    summary: dict[str, Any]
    rows: list[dict[str, Any]]
    shapes: dict[str, dict[str, Array]] = field(default_factory=dict)
    sensitivities: list[dict[str, Any]] = field(default_factory=list)
    triangles: Any = field(default=None, repr=False)
    fields: Callable[[Path], list[Path]] | None = field(default=None, repr=False)
    analysis: Any = field(default=None, repr=False)
    spinning: Any = field(default=None, repr=False)

    def write(self, folder: str | Path) -> list[Path]:
        """Write modes.json, modes.csv, mode_shapes.csv and summary.json, each whole or not at all; return their paths.

        Raises:
            OutputError: the folder cannot be written.
        """
        folder = Path(folder)
        shapes: dict[str, Array] = {}
        for i, columns in enumerate(self.shapes.values(), start=1):
            shapes |= {name if name in ("x", "y") else f"{name}_{i}": values for name, values in columns.items()}
        written = []
        if self.sensitivities:
            written.append(write_text(folder / "sensitivities.csv", rows_text(self.sensitivities)))
        return [
            *written,
            write_text(folder / "modes.csv", rows_text(self.rows)),
            write_text(folder / "mode_shapes.csv", csv_text(shapes)),
            write_text(folder / "modes.json", json_text({"speed": self.summary["speed"], "modes": self.rows})),
            write_text(folder / "summary.json", json_text(self.summary)),
        ]


@dataclass
class CampbellResult:
    """Outcome of `rotfem campbell`.

    Attributes:
        summary: scene, branches, critical speeds, instabilities, self-checks, warnings, timings; JSON-able.
        rows: one dictionary a speed and branch: `speed` (rad/s), `branch`, `label`, `mode` (its name at this speed),
            `frequency` (rad/s), `frequency_hz`, `damping`, `growth` (1/s), `residual`, `share_…`, `confidence` (squared
            correlation with the speed before), `refined` (1 where the speed was not asked for); of a disk `turning` (1
            for a wave that travels with the spin, −1 against it, 0 for a standing one).
    """

    summary: dict[str, Any]
    rows: list[dict[str, Any]]

    def branches(self) -> dict[str, dict[str, Array]]:
        """Return label ↦ columns `speed`, `frequency`, `growth`, … over all speeds solved."""
        out: dict[str, dict[str, Array]] = {}
        for label in dict.fromkeys(row["label"] for row in self.rows):
            mine = [row for row in self.rows if row["label"] == label]
            numbers = [k for k, v in mine[0].items() if isinstance(v, int | float)]
            out[label] = {k: np.array([row[k] for row in mine], dtype=np.float64) for k in numbers}
        return out

    def travelling_waves(self) -> dict[str, dict[str, Array]]:
        """Return label ↦ `speed`, `forward`, `backward` (rad/s) of a disk's modes with nodal diameters, fixed frame.

        Of a pair of modes with m nodal diameters one travels with the spin and one against it (column `turning`). Seen
        from the fixed frame they have ω₊ + mΩ and ω₋ − mΩ; the backward wave stands still where ω₋ = mΩ, a critical
        speed. Where only one of a pair was computed it stands for both.
        """
        out: dict[str, dict[str, Array]] = {}
        branches = self.branches()
        for label, a in branches.items():
            kind, _, number = label.partition(" ")
            diameters = int(number.split(".")[0]) if kind == "diameters" else 0
            if diameters == 0 or label[-1] in "bcdefgh":
                continue
            name = label.removesuffix("a")
            b = branches.get(f"{name}b", a)
            speed, here, there = np.intersect1d(a["speed"], b["speed"], return_indices=True)
            first, second = ({k: c[i] for k, c in x.items()} for x, i in ((a, here), (b, there)))
            ahead = first["turning"] >= second["turning"]
            wave = diameters * np.abs(speed)
            out[name] = {
                "speed": speed,
                "forward": np.where(ahead, first["frequency"], second["frequency"]) + wave,
                "backward": np.where(ahead, second["frequency"], first["frequency"]) - wave,
            }
        return out

    def write(self, folder: str | Path) -> list[Path]:
        """Write campbell.csv, campbell.json and summary.json, each whole or not at all; return their paths.

        Raises:
            OutputError: the folder cannot be written.
        """
        folder = Path(folder)
        keys = ("branches", "critical_speeds", "instabilities", "ambiguous", "per_rev")
        diagram = {**{k: self.summary[k] for k in keys}, "rows": self.rows}
        return [
            write_text(folder / "campbell.csv", rows_text(self.rows)),
            write_text(folder / "campbell.json", json_text(diagram)),
            write_text(folder / "summary.json", json_text(self.summary)),
        ]


@dataclass
class ExplainResult:
    """Outcome of `rotfem explain`.

    Attributes:
        summary: scene, dimensionless groups, changes, warnings, timings; JSON-able.
        rows: one dictionary an effect and a theory: `kind`, `name`, `included`, `why`, `estimate` (output ↦ relative
            change), `worst`, `verdict`; with a check `truth` (output ↦ relative change of the full models).
    """

    summary: dict[str, Any]
    rows: list[dict[str, Any]]

    def write(self, folder: str | Path) -> list[Path]:
        """Write explain.json and summary.json, each whole or not at all; return their paths.

        Raises:
            OutputError: the folder cannot be written.
        """
        folder = Path(folder)
        explained = {"groups": self.summary["groups"], "outputs": self.summary["outputs"], "rows": self.rows}
        return [
            write_text(folder / "explain.json", json_text(explained)),
            write_text(folder / "summary.json", json_text(self.summary)),
        ]


















