"""Columns of results: what they are, their units, what is made of them, numbers as text, and short tables.

Speeds and frequencies are printed and drawn in the units that a scene asks for. Files have SI units, and those of modes
these units too.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import zip_longest
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from rotfem.registry import outputs
from rotfem.results.files import csv_text
from rotfem.units import quantity

if TYPE_CHECKING:
    import pandas
    import xarray

Array = npt.NDArray[np.float64]

#: Part of the largest number of its unit below which one is shown as 0.
ZERO = 1e-9


def zeros(columns: Mapping[str, Array]) -> list[str]:
    """Return the columns of which every number is shown as 0, `ZERO` of the largest of its unit and below."""
    sizes = {name: float(np.max(np.abs(values), initial=0.0)) for name, values in columns.items()}
    scales = by_unit(sizes)
    return [name for name, size in sizes.items() if size <= ZERO * scales[name]]


_SUB = {"1": "₁", "2": "₂", "3": "₃"}

#: Column ↦ what it is, and its unit; "1" of pure numbers.
COLUMNS = {
    "t": ("time t", "s"),
    "x": ("position X", "m"),
    "y": ("position Y", "m"),
    "psi": ("angle ψ", "rad"),
    "psi_dot": ("speed Ω", "rad/s"),
    **{f"u{i}": (f"u{sub}", "m") for i, sub in _SUB.items()},
    "alpha": ("rotation α", "rad"),
    **{f"alpha{i}": (f"rotation α{_SUB[i]}", "rad") for i in "12"},
    **{f"theta{i}": (f"rotation θ{sub}", "rad") for i, sub in _SUB.items()},
    "N": ("axial force N", "N"),
    "Q": ("shear force Q", "N"),
    "M": ("bending moment M", "N·m"),
    "T": ("torsional moment T", "N·m"),
    **{f"Q{i}": (f"shear force Q{_SUB[i]}", "N") for i in "23"},
    **{f"M{i}": (f"bending moment M{_SUB[i]}", "N·m") for i in "23"},
    **{f"gamma{i}": (f"strain Γ{sub}", "1") for i, sub in _SUB.items()},
    "kappa": ("curvature κ", "1/m"),
    **{f"kappa{i}": (f"curvature κ{sub}", "1/m") for i, sub in _SUB.items()},
    **{f"n{ij}": (f"membrane force n{_SUB[ij[0]]}{_SUB[ij[1]]}", "N/m") for ij in ("11", "22", "12")},
    **{f"m{ij}": (f"moment m{_SUB[ij[0]]}{_SUB[ij[1]]}", "N") for ij in ("11", "22", "12")},
    **{f"q{i}": (f"shear force q{_SUB[i]}", "N/m") for i in "12"},
    "twist": ("elastic twist about the bent axis", "rad"),
    "von_mises": ("equivalent stress", "Pa"),
    "von_mises_max": ("largest equivalent stress", "Pa"),
    "kinetic": ("kinetic energy", "J"),
    "strain": ("strain energy", "J"),
    "jacobi": ("Jacobi integral", "J"),
    **{f"root_f{i}": (f"force of the hub on the root, f{sub}", "N") for i, sub in _SUB.items()},
    **{f"root_m{i}": (f"moment of the hub about the root, m{sub}", "N·m") for i, sub in _SUB.items()},
    "torque": ("torque on the hub", "N·m"),
    "hub_kinetic": ("kinetic energy of the hub", "J"),
    "angular_momentum": ("angular momentum", "N·m·s"),
    "impulse": ("impulse of the torque", "N·m·s"),
    "work": ("work of the torque", "J"),
    "pitch": ("pitch of the blade", "rad"),
    "speed": ("speed Ω", "rad/s"),
    "major": ("larger semi-axis of the orbit", "m"),
    "minor": ("smaller semi-axis of the orbit, negative of backward precession", "m"),
    "angle": ("angle of the larger semi-axis from direction 2", "rad"),
    "probe": ("amplitude that a probe reads", "m"),
    **{f"f{i}": (f"force of the shaft on a support, f{_SUB[i]}", "N") for i in "23"},
    **{f"m{i}": (f"moment of the shaft on a support, m{_SUB[i]}", "N·m") for i in "23"},
    "stiffness": ("stiffness of the supports", "N/m"),
    "tilt_stiffness": ("stiffness of the supports against tilt", "N·m"),
    "frequency": ("frequency", "rad/s"),
    "frequency_hz": ("frequency", "Hz"),
    "damping": ("damping ratio", "1"),
    "log_decrement": ("log decrement", "1"),
    "growth": ("growth", "1/s"),
    "residual": ("backward error", "1"),
    "mesh_error": ("relative error that the mesh may cause", "1"),
    "error_bound": ("relative error that round-off may cause", "1"),
    "confidence": ("MAC with the previous speed", "1"),
    "turning": ("wave with the spin (1) or against it (−1)", "1"),
    "frequency_fixed": ("frequency, fixed frame", "rad/s"),
    "frequency_fixed_2": ("frequency of the smaller wave, fixed frame", "rad/s"),
    "estimate": ("estimated relative change", "1"),
    "worst": ("largest estimated relative change", "1"),
    "step": ("time step", "s"),
    "total_error": ("error, that of the theory included, relative", "1"),
    "cost": ("CPU time of one run with its set-up, median", "s"),
}


def described(column: str) -> tuple[str, str]:
    """Return what a column is and its unit; its name and "" of one that nothing is known of.

    A registered output functional has the unit it was registered with.
    """
    name, at, place = column.partition("@")
    if at:  # a place along a beam, as M@2.5 is of 2.5 m
        what, unit = described(name)
        return f"{what} at {place} m", unit
    if column in COLUMNS:
        return COLUMNS[column]
    if column.startswith("tip_") and column[4:].rstrip("123") in ("u", "alpha", "theta"):
        what, unit = described(column.removeprefix("tip_"))
        return f"tip {what}", unit
    if found := re.fullmatch(r"support_(\d+)_([fm])([23])", column):
        number, which, i = found.groups()
        what, unit = ("force", "N") if which == "f" else ("moment", "N·m")
        return f"{what} on support {number}, {which}{_SUB[i]}", unit
    if column.endswith("_phase"):
        return f"phase of {described(column.removesuffix('_phase'))[0]}", "rad"
    if column.startswith("shape_"):
        what, unit = described(column.removeprefix("shape_"))
        return f"shape, {what}{' × length' if unit == 'rad' else ''}", "1"
    if column.startswith("share_"):
        return f"share of the kinetic energy, {column.removeprefix('share_')}", "1"
    if column in outputs:
        return column, outputs[column].unit
    return column, ""


def label(column: str, shown: str = "", frame: str = "") -> str:
    """Return the axis label of a column, with its unit, or with the one that it is shown in, and with its frame."""
    return f"{described(column)[0]}{f', {frame} frame' * bool(frame)} {shown_unit(column, shown)}".rstrip()


def label_of(name: str) -> str:
    """Return a number of a summary, as frequency_last_1, in words with the unit of the column that it begins with."""
    words = name.split("_")
    known = ("_".join(words[:n]) for n in range(len(words), 0, -1))
    unit = next(filter(None, map(shown_unit, known)), "")
    what = described(name)[0]
    return f"{what if what != name else ' '.join(words).replace('.', ', ')} {unit}".rstrip()


def shown_unit(column: str, shown: str = "") -> str:
    """Return the unit of a column, or the one that it is shown in, as "(m)"; "" of one without."""
    unit = shown or described(column)[1]
    return f"({'–' if unit == '1' else unit})" if unit else ""


# --- columns of a result ----------------------------------------------------------------------------------------------

#: Name of a labelled array ↦ its dimensions and values.
Variables = dict[str, tuple[tuple[str, ...], npt.NDArray[Any]]]


@dataclass(frozen=True)
class Columns:
    """Named columns of equal length, of which files, tables of pandas and labelled arrays are made.

    Attributes:
        values: name ↦ value of every row; None where a row has none.
        index: names of the columns that label the rows. Rows with two labels or more are places of a grid.
        dimension: name of the rows where nothing labels them.
    """

    values: Mapping[str, Sequence[Any] | npt.NDArray[Any]]
    index: tuple[str, ...] = ()
    dimension: str = "row"

    @classmethod
    def of_rows(cls, rows: Sequence[Mapping[str, Any]], index: tuple[str, ...] = (), dimension: str = "row") -> Self:
        """Return the columns of rows, each with name ↦ value."""
        names = dict.fromkeys(name for row in rows for name in row)
        return cls({name: [row.get(name) for row in rows] for name in names}, index, dimension)

    def array(self, name: str) -> npt.NDArray[Any]:
        """Return a column: truth values, text, or numbers; "" or NaN stand for what is absent."""
        values = self.values[name]
        if isinstance(values, np.ndarray):
            return values
        if any(isinstance(value, str | list) for value in values):
            return np.array(["" if value is None else str(value) for value in values])
        return np.array([np.nan if value is None else value for value in values])

    @property
    def numbers(self) -> list[str]:
        """Names of the columns that hold numbers."""
        return [name for name in self.values if self.array(name).dtype.kind in "bif"]

    def grid(self, name: str) -> tuple[tuple[str, ...], npt.NDArray[Any]]:
        """Return the dimensions and the values of a column: over `index` where it labels the rows, else over these.

        "" or NaN stand for places of a grid without a row.
        """
        values = self.array(name)
        if len(self.index) < 2:
            return self.index or (self.dimension,), values
        labels = [self.array(label).tolist() for label in self.index]
        orders = [{label: i for i, label in enumerate(dict.fromkeys(column))} for column in labels]
        shape = tuple(map(len, orders))
        whole = np.prod(shape) == len(values) or values.dtype.kind in "US"
        out = np.zeros(shape, values.dtype) if whole else np.full(shape, np.nan)
        out[tuple([order[label] for label in column] for order, column in zip(orders, labels, strict=True))] = values
        return self.index, out

    def variables(self) -> Variables:
        """Return all columns over their dimensions, the labels of these first."""
        labels: Variables = {name: ((name,), self.array(name)) for name in self.index}
        if len(self.index) > 1:
            labels = {n: (of, np.array(list(dict.fromkeys(values.tolist())))) for n, (of, values) in labels.items()}
        return labels | {name: self.grid(name) for name in self.values if name not in self.index}

    def csv(self) -> str:
        """Return the columns as CSV with a header; numbers keep all their digits, what is absent stays empty."""
        return csv_text(self.values)

    def to_pandas(self) -> pandas.DataFrame:
        """Return the columns as a table labelled by `index`; what is absent is NaN."""
        import pandas

        table = pandas.DataFrame(dict(self.values))
        return table.set_index(list(self.index)) if self.index and not table.empty else table


def dataset(variables: Variables, attributes: Mapping[str, Any]) -> xarray.Dataset:
    """Return variables as labelled arrays, each with its `long_name` and `units` as far as they are known."""
    import xarray

    out = xarray.Dataset(variables, attrs=dict(attributes))
    out = out.set_coords([name for name in ("x", "y", "triangles", "label") if name in out])
    for name, array in out.variables.items():
        what, unit = described(str(name))
        if name in ("frequency", "frequency_hz") and "frame" in attributes:
            what += f", {attributes['frame']} frame"
        array.attrs |= {"long_name": what, "units": unit} if unit else {}
    return out


# --- the units that are shown -----------------------------------------------------------------------------------------

SI = "rad/s"


@dataclass(frozen=True)
class ShownUnits:
    """Units of speeds and frequencies, as `[output]` of a scene names them.

    Attributes:
        speed: of the hub.
        frequency: of modes.
    """

    speed: str = SI
    frequency: str = SI

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> Self:
        """Return the units that the scene of a summary asks for."""
        scene = summary.get("scene", {})
        output = scene.get("output", {}) if isinstance(scene, Mapping) else {}
        return cls(output.get("speed", SI), output.get("frequency", SI))

    def speeds(self, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return speeds (rad/s) of any shape in the unit of speeds."""
        return in_unit(values, self.speed)

    def frequencies(self, values: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return frequencies (rad/s) of any shape in the unit of frequencies."""
        return in_unit(values, self.frequency)

    def rows(self, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return rows of modes with columns more, such as `speed_rpm`, where another unit than SI is asked for."""
        named = {"speed": self.speed, "frequency": self.frequency}
        wanted = [(f"{n}_{unit.lower().replace('/', '_')}", n, unit) for n, unit in named.items() if unit != SI]
        return [
            dict(row) | {c: float(in_unit(row[n], unit)) for c, n, unit in wanted if n in row and c not in row}
            for row in rows
        ]


def in_unit(values: npt.ArrayLike, unit: str) -> npt.NDArray[np.float64]:
    """Return angular speeds or frequencies (rad/s) of any shape in another unit."""
    found = np.asarray(values, dtype=np.float64)
    return found if unit == SI else np.divide(found, quantity(f"1 {unit}", SI), dtype=np.float64)


# --- short tables -----------------------------------------------------------------------------------------------------

#: Characters that a table is made for in a line.
WIDTH = 80

#: Rows that a notebook shows of a table.
SHORT = 12


@dataclass(frozen=True)
class ShortTable:
    """A short table.

    Attributes:
        head: heading of each column, with its unit.
        rows: texts in the order of the headings; fewer where the last ones are empty.
    """

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]

    def lines(self, width: int = WIDTH) -> list[str]:
        """Return the table as lines, numbers to the right; where they are too long the last column is folded."""
        columns = list(zip_longest(self.head, *self.rows, fillvalue=""))
        sizes = [max(map(len, column)) for column in columns]
        left = [not any(map(_is_number, column[1:])) for column in columns]
        room = width - sum(sizes[:-1]) - 2 * (len(sizes) - 1)
        out = []
        for row in (*([self.head] if any(self.head) else []), *self.rows):
            cells = [*row, *[""] * (len(sizes) - len(row))]
            folded = wrap(cells[-1], max(room, 16)) or [""]
            *most, size = sizes
            one = zip([*cells[:-1], folded[0]], [*most, size if size <= room else 0], left, strict=True)
            out.append("  ".join(text.ljust(n) if to_left else text.rjust(n) for text, n, to_left in one).rstrip())
            out += [" " * (sum(most) + 2 * len(most)) + text for text in folded[1:]]
        return out

    def html(self, most: int = SHORT) -> str:
        """Return the table as HTML, its first rows where there are many."""
        more = len(self.rows) - most
        rows = [*self.rows[:most], *([(f"… and {more} more",)] if more > 0 else [])]
        cells = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows)
        head = "".join(f"<th>{escape(text)}</th>" for text in self.head)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{cells}</tbody></table>"


def number(value: float | None, scale: float = 1.0, digits: int = 6) -> str:
    """Return a number as text; 0 if it is below `ZERO` of a scale, and – where there is none."""
    if value is None:
        return "–"
    return "0" if abs(value) <= ZERO * scale else f"{value:.{digits}g}"


def numbers(values: Sequence[float | None], digits: int = 6) -> list[str]:
    """Return the numbers of one column as text, relative to the largest of them."""
    scale = largest(values)
    return [number(value, scale, digits) for value in values]


def largest(values: Iterable[float | None]) -> float:
    """Return the largest size of numbers."""
    return max((abs(value) for value in values if value is not None), default=0.0)


def per_cent(ratio: float | None) -> str:
    """Return a ratio as a number of per cent with two digits, of large ones three."""
    return number(None if ratio is None else 100 * ratio, 100.0, 2 if ratio is None or abs(ratio) < 0.1 else 3)


def by_unit(values: dict[str, float]) -> dict[str, float]:
    """Return for every column the largest size among those that have its unit."""
    units = {name: described(name)[1] or name for name in values}
    return {name: largest(values[other] for other in values if units[other] == units[name]) for name in values}


def _is_number(text: str) -> bool:
    try:
        float(text.lstrip("<"))
    except ValueError:
        return False
    return True
