"""What analyses of small motions return: modes, and the response to harmonic loads.

ElastoDyn takes the displacement of a mode as Σ c_k ξ^k, k = 2 … 6, ξ = x/L, with Σ c_k = 1, so 1 at the tip (Jonkman &
Buhl, FAST User's Guide, NREL/EL-500-38230, 2005, "blade input file").
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.results.columns import (
    Columns,
    ShortTable,
    ShownUnits,
    Variables,
    by_unit,
    in_unit,
    label,
    number,
    numbers,
    per_cent,
)
from rotfem.results.files import json_text
from rotfem.results.result import Array, OfTable, Rows
from rotfem.results.surfaces import Surface

#: Powers of ξ in a polynomial of bending, which has no slope at the root, and in one of twist.
POWERS, TWIST_POWERS = range(2, 7), range(1, 7)

#: Largest error of a polynomial, in parts of the tip's value, with which it is still the mode.
WORST_FIT = 0.1

#: Direction ↦ (displacement, rotation that is its slope and the sign of it) of a spatial and of a planar beam.
DIRECTIONS: dict[str, tuple[tuple[str, str, float], ...]] = {
    "flap": (("u3", "theta2", -1.0),),
    "lag": (("u2", "theta3", 1.0), ("u2", "alpha", 1.0)),
}

#: What ElastoDyn calls the modes it takes: (direction, number among them) ↦ name.
ELASTODYN = {("flap", 1): "BldFl1Sh", ("flap", 2): "BldFl2Sh", ("lag", 1): "BldEdgSh"}


def fit(span: Array, shape: Array, exponents: Sequence[int] = POWERS) -> tuple[Array, Array]:
    """Return c_k of the polynomial that is 1 at ξ = 1 and closest to a shape, and what it is off, (n,)."""
    powers = span[:, None] ** np.array(exponents)
    # With the first as 1 less the others the sum is 1 whatever the others are.
    others, *_ = np.linalg.lstsq(powers[:, 1:] - powers[:, :1], shape - powers[:, 0], rcond=None)
    coefficients = np.append(1.0 - others.sum(), others)
    return coefficients, powers @ coefficients - shape


def elastodyn_lines(rows: Sequence[dict[str, Any]]) -> str:
    """Return the mode shape lines of an ElastoDyn blade file, of those of the modes it takes that are there."""
    found, lines = {(row["direction"], row["number"]): row for row in rows}, list[str]()
    for key, name in ELASTODYN.items():
        if row := found.get(key):
            of = f"{'Flap' if key[0] == 'flap' else 'Edge'} mode {key[1]}"
            lines += [f"{row[f'c{k}']:18.10f}   {name}({k}) - {of}, coeff of x^{k}" for k in POWERS]
    return "\n".join(lines) + "\n"


def _real(columns: dict[str, Array]) -> dict[str, Array]:
    """Return the columns of a mode at the phase at which its largest displacement is real, and 1 there.

    Of one that is scaled by its rotations (see `ModesResult.shapes`) it is the largest rotation.
    """
    names = [name for name in columns if name != "x" and not name.endswith("_imag")]
    values = {name: columns[name] + 1j * columns[f"{name}_imag"] for name in names}
    moves = np.concatenate([values[name] for name in names if name.startswith("u")])
    moves = moves if np.max(np.abs(moves)) > 0.5 else np.concatenate(list(values.values()))
    unit = moves[np.argmax(np.abs(moves))]
    return {"x": columns["x"]} | {name: np.real(value / unit) for name, value in values.items()}


@dataclass(repr=False)
class ModesResult(Rows):
    """Outcome of `rotfem modes`.

    Attributes:
        summary: scene, speed, modes, self-checks, warnings, timings; JSON-able.
        rows: one dictionary a mode: `mode`, `label`, `frequency` (rad/s), `frequency_hz`, `damping` (ratio), `growth`
            (1/s), `stability`, `share_…` (of the kinetic energy), of shafts and disks `log_decrement`, `whirl`,
            `frequency_fixed`, … (see `rotfem.CampbellResult`), `residual` (backward error),
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
        surface: that the modes move, as in files for ParaView and animations.
        fields: writes the modes for ParaView into a folder, on all ranks together.
        analysis, spinning: the compiled scene and its eigenpairs, for further work in Python.
    """

    shapes: dict[str, dict[str, Array]] = field(default_factory=dict)
    sensitivities: list[dict[str, Any]] = field(default_factory=list)
    blade_tables: bool = False
    triangles: Any = field(default=None, repr=False)
    surface: Surface | None = field(default=None, repr=False)
    fields: Callable[[Path], list[Path]] | None = field(default=None, repr=False)
    analysis: Any = field(default=None, repr=False)
    spinning: Any = field(default=None, repr=False)
    index = ("mode",)
    frequencies = OfTable("frequency", "Frequencies in the `frame`, (modes,), rad/s; 0 of a rigid body.")
    frequencies_hz = OfTable("frequency_hz", "Frequencies in the `frame`, (modes,), Hz.")
    damping = OfTable("damping", "Damping ratios −Re λ/|λ|, (modes,).")
    growth = OfTable("growth", "Growth Re λ of every mode, (modes,), 1/s; negative where it dies away.")

    @property
    def speed(self) -> float:
        """Speed the modes are those of, rad/s."""
        return float(self.summary["speed"])

    @property
    def labels(self) -> list[str]:
        """Name of every mode."""
        return [row["label"] for row in self.rows]

    @property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues λ = growth + i frequency, shape (modes,), rad/s."""
        return self.growth + 1j * self.frequencies

    @property
    def stable(self) -> bool:
        """Whether no mode grows."""
        return all(row["stability"] in ("stable", "neutral") for row in self.rows)

    def with_shapes(self) -> list[tuple[dict[str, Any], dict[str, Array], str]]:
        """Return row, shape, and frequency in the unit shown of every mode but that of a rigid body, the first one."""
        units, rows = ShownUnits.of(self.summary), self.rows[len(self.rows) - len(self.shapes) :]
        said = [f"{units.frequencies(row['frequency']):.5g} {units.frequency}" for row in rows]
        return list(zip(rows, self.shapes.values(), said, strict=True))

    def data(self) -> dict[str, Columns]:
        """Return the modes, their shapes, and the tables that are wanted.

        Raises:
            InputError: tables over the span are wanted of a plate.
        """
        shapes = dict[str, Array]()
        for i, columns in enumerate(self.shapes.values(), start=1):
            shapes |= {name if name in ("x", "y") else f"{name}_{i}": values for name, values in columns.items()}
        out = {**super().data(), "mode_shapes": Columns(shapes, dimension="node")}
        if self.sensitivities:
            out["sensitivities"] = Columns.of_rows(self.sensitivities)
        if self.blade_tables:
            out["mode_table"] = Columns.of_rows(self.mode_table())
            out["mode_polynomials"] = Columns.of_rows(self.mode_polynomials())
        return out

    def texts(self) -> dict[str, str]:
        """Return a CSV file of each table, modes.json, and elastodyn_modes.dat where it is wanted.

        Raises:
            InputError: tables over the span are wanted of a plate.
        """
        fitted = {"elastodyn_modes.dat": elastodyn_lines(self.mode_polynomials())} if self.blade_tables else {}
        modes = json_text({"speed": self.summary["speed"], "frame": self.frame, "modes": self.rows})
        return {**super().texts(), **fitted, "modes.json": modes}

    def _over_span(self) -> Iterator[tuple[dict[str, Any], dict[str, Array]]]:
        """Yield number, label and frequency of every mode with a shape, and its real columns over the span."""
        if self.triangles is not None:
            raise InputError("structure.type", "plate", "tables over the span are those of beams")
        for row, shape, _ in self.with_shapes():
            columns, length = _real(shape), shape["x"][-1]  # by which rotations of a shape are multiplied
            out = {"span": columns["x"] / length}
            for direction, kinds in DIRECTIONS.items():
                for u, theta, sign in kinds:
                    if u in columns and theta in columns:
                        out[f"{direction}_displacement"] = columns[u]
                        out[f"{direction}_slope"] = sign * columns[theta] / length
            out |= {"twist": columns["theta1"] / length} if "theta1" in columns else {}
            yield {name: row[name] for name in ("mode", "label", "frequency_hz")}, out

    def mode_table(self) -> list[dict[str, Any]]:
        """Return one row a mode and node: displacement and slope in flap and lag, and twist, over the span.

        Columns are `mode`, `label`, `frequency_hz`, `span` (x/L), `flap_displacement`, `flap_slope`,
        `lag_displacement`, `lag_slope`, `twist`, as far as the beam has them; the phase is that at which the largest
        displacement is real, and the largest of all displacements is 1 (m; slopes 1/m, twist rad/m).

        Raises:
            InputError: the structure is no beam.
        """
        return [
            mode | dict(zip(columns, row, strict=True))
            for mode, columns in self._over_span()
            for row in zip(*(values.tolist() for values in columns.values()), strict=True)
        ]

    def mode_polynomials(self) -> list[dict[str, Any]]:
        """Return one row a mode of bending or torsion: the polynomial of its leading motion, and how well it fits.

        Columns are `mode`, `label`, `direction` ("flap", "lag" or "twist"), `number` among those of the direction,
        `frequency_hz`, `c1` (0 of bending) … `c6`, and `fit_error` and `fit_rms`, the largest and the root mean square
        of what the polynomial is off at the nodes, in parts of the tip's value. Modes that no polynomial comes nearer
        than WORST_FIT have none, as those with a node at the tip, nor has stretch.

        Raises:
            InputError: the structure is no beam.
        """
        out, counts = list[dict[str, Any]](), Counter[str]()
        for mode, columns in self._over_span():
            shapes = {name: columns[f"{name}_displacement"] for name in DIRECTIONS if f"{name}_displacement" in columns}
            direction = max(shapes, key=lambda name: float(np.max(np.abs(shapes[name]))))
            twists = "torsion" in mode["label"].partition("–")[0]
            if not twists and np.max(np.abs(shapes[direction])) < 0.5:
                continue  # stretch
            direction, shape = ("twist", columns["twist"]) if twists else (direction, shapes[direction])
            counts[direction] += 1
            if not abs(shape[-1]) > 1e-3 * np.max(np.abs(shape)):
                continue
            powers = TWIST_POWERS if twists else POWERS
            coefficients, off = fit(columns["span"], shape / shape[-1], powers)
            errors = {"fit_error": float(np.max(np.abs(off))), "fit_rms": float(np.sqrt(np.mean(off**2)))}
            if errors["fit_error"] <= WORST_FIT:
                first = {"mode": mode["mode"], "label": mode["label"], "direction": direction}
                terms = {"c1": 0.0} | {f"c{k}": float(c) for k, c in zip(powers, coefficients, strict=True)}
                out.append(first | {"number": counts[direction]} | mode | terms | errors)
        return out

    def drawn(self) -> dict[str, str]:
        """Return modes.png, the shapes of all modes, of a shaft in three dimensions with their orbits."""
        beam = "plots_shaft:whirl_figure" if self.frame == "fixed" else "plots:shapes_figure"
        draw = beam if self.triangles is None else "plots:plate_modes_figure"
        return {"modes.png": f"results.{draw}"} if self.shapes else {}

    def tables(self) -> list[ShortTable]:
        """Return one row a mode: name, frequency, damping ratio and estimated error of the frequency.

        Shafts have a logarithmic decrement; those in the rotating frame both frequencies |ω ± Ω| in the fixed one.
        """
        unit = ShownUnits.of(self.summary).frequency
        first = unit if unit != "Hz" else "rad/s"  # there is a column of Hz in any case
        rows = self.rows
        errors = [None if (e := row.get("mesh_error")) is None else e + row["error_bound"] for row in rows]
        errors = [e if row["stability"] != "unresolved" else None for e, row in zip(errors, rows, strict=True)]

        def shown(name: str) -> list[str]:
            return numbers([float(in_unit(row[name], first)) for row in rows], 8)

        columns = {
            "mode": [str(row["mode"]) for row in rows],
            "name": [row["label"] for row in rows],
            f"{self.frame} frame ({first})": shown("frequency"),
            "(Hz)": numbers([row["frequency_hz"] for row in rows], 8),
        }
        if any("frequency_fixed_2" in row for row in rows):
            both = zip(shown("frequency_fixed"), shown("frequency_fixed_2"), strict=True)
            columns[f"|ω ± Ω|, fixed frame ({first})"] = [", ".join(pair) for pair in both]
        if any("log_decrement" in row for row in rows):
            columns["log decrement (–)"] = [number(row["log_decrement"], 1.0, 4) for row in rows]
        else:
            columns["damping (%)"] = [per_cent(row["damping"]) for row in rows]
        columns["error (%)"] = list(map(per_cent, errors))
        return [ShortTable(tuple(columns), list(zip(*columns.values(), strict=True)))]

    def arrays(self) -> Variables:
        """Return the columns of modes.csv over `mode`, the speed (rad/s), and the shapes over `mode` and `node`.

        Shapes `shape_u1`, … are complex, scaled as `shapes`, NaN for the rigid-body mode, which has none. Nodes have
        `x` (m), of a plate `y` and `triangles` too.
        """
        out = super().arrays() | {"speed": ((), np.array(self.speed))}
        first, rigid = next(iter(self.shapes.values()), {}), len(self.rows) - len(self.shapes)
        out |= {name: (("node",), first[name]) for name in ("x", "y") if name in first}
        for name in (name for name in first if f"{name}_imag" in first):
            values = np.full((len(self.rows), len(first[name])), np.nan, dtype=np.complex128)
            values[rigid:] = [columns[name] + 1j * columns[f"{name}_imag"] for columns in self.shapes.values()]
            out[f"shape_{name}"] = ("mode", "node"), values
        return out if self.triangles is None else out | {"triangles": (("triangle", "corner"), self.triangles)}


@dataclass(repr=False)
class ResponseResult(Rows):
    """Outcome of `rotfem response`.

    Attributes:
        summary: scene, speed, outputs, modes, peaks, warnings, timings; JSON-able.
        rows: one dictionary a frequency: `frequency` (rad/s), `frequency_hz`, `per_rev` (frequency over speed, of what
            spins); of every output, as `tip_u2`, `root_m3` or, at a station, `M@2.5`, the amplitude `tip_u2` (in its
            unit) and `tip_u2_phase` (rad, how far it is ahead of a load of phase 0); `peak` (1 at frequencies that were
            added to see a peak).
        direct: complex amplitudes of the outputs, shape (frequencies, outputs).
    """

    direct: npt.NDArray[np.complex128]
    index = ("frequency",)
    frequencies = OfTable("frequency", "Frequencies, (frequencies,), rad/s, increasing.")
    figure = "results.plots:response_figure"

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs: of the tip `tip_u1`, …, of the root `root_f1`, …, of stations `M@2.5`, …."""
        return list(self.summary["outputs"])

    def amplitude(self, output: str) -> Array:
        """Return the amplitude of an output over the frequencies, in its unit."""
        return np.asarray(np.abs(self.direct[:, self.outputs.index(output)]), dtype=np.float64)

    def phase(self, output: str) -> Array:
        """Return the phase of an output over the frequencies, rad, from −π to π."""
        return np.asarray(np.angle(self.direct[:, self.outputs.index(output)]), dtype=np.float64)

    def tables(self) -> list[ShortTable]:
        """Return where every output is largest."""
        units, peaks = ShownUnits.of(self.summary), self.summary["peaks"]
        scales = by_unit({name: peak["amplitude"] for name, peak in peaks.items()})
        rows = [
            (label(name), number(peak["amplitude"], scales[name]), f"{units.frequencies(peak['frequency']):.8g}")
            for name, peak in peaks.items()
        ]
        return [ShortTable((f"output, {self.frame} frame", "largest amplitude", f"at ({units.frequency})"), rows)]
