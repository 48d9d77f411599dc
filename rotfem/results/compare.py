"""Results side by side: how far others are from a reference, in curves, modes, branches and critical speeds.

Modes are matched by the modal assurance criterion, MAC = |a^H b|²/((a^H a)(b^H b)), 1 for equal shapes (Allemang &
Brown, "A correlation coefficient for modal vector analysis", Proc. 1st Int. Modal Analysis Conf., 1982, pp. 110–116).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import NearestNDInterpolator
from scipy.optimize import linear_sum_assignment

from rotfem.errors import InputError
from rotfem.results.columns import ShortTable, described, label, largest, number, per_cent
from rotfem.results.distance import Series, relative
from rotfem.results.files import read_csv
from rotfem.results.result import Result, Row, Rows
from rotfem.results.result_set import read_summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Values = npt.NDArray[Any]

#: Commands whose results can be compared ↦ the file that is read.
COMPARABLE = {"run": "history.csv", "modes": "modes.json", "campbell": "campbell.json", "response": "response.csv"}


@dataclass(frozen=True)
class Curve:
    """A quantity `y` over `x`: a column over time, a complex amplitude over frequency, a branch over speed."""

    name: str
    unit: str
    x: Values
    y: Values

    @property
    def vector(self) -> tuple[str, str]:
        """Name of the vector that the quantity is a component of, and unit: what has one scale. A branch is its own."""
        return self.name if self.unit == "rad/s" else self.name.rstrip("123"), self.unit

    def beside(self, other: Curve) -> tuple[Values, Values, Values]:
        """Return common places, and the values of this curve and of another one there (see `Series.beside`)."""
        pair = (Series(one.x, one.y[:, None]) for one in (self, other))
        here, there = next(pair).beside(next(pair))
        if not len(here.times):
            said = f"{self.x[0]:g} … {self.x[-1]:g} and {other.x[0]:g} … {other.x[-1]:g}"
            raise InputError(self.name, said, "must overlap")
        return here.times, here.values[:, 0], there.values[:, 0]


class Compared:
    """What is compared of a result: its `curves` by their names, or its modes with their `shapes` at `nodes`.

    Args:
        result: it, or the folder where it is.

    Raises:
        InputError: it is not complete, cannot be read, or is none that can be compared.
    """

    def __init__(self, result: Result | str | Path):
        if isinstance(result, Result):
            with TemporaryDirectory() as folder:
                result.write(folder)
                self._read(Path(folder))
        else:
            self._read(Path(result))
        self.title = str(result.summary["name"] if isinstance(result, Result) else result)

    def _read(self, folder: Path) -> None:
        self.summary, self.curves, self.modes = read_summary(folder), dict[str, Curve](), list[Row]()
        self.command, status = (str(self.summary.get(key, "")) for key in ("command", "status"))
        if self.command not in COMPARABLE or status != "done":
            there = f"{self.command}, {status}" if self.command else "no results of rotfem"
            allowed = f"has {there}; must be a folder with finished results of {', '.join(COMPARABLE)}"
            raise InputError("compare", str(folder), allowed)
        try:
            if self.command in ("run", "response"):
                curves = _curves(read_csv(folder / COMPARABLE[self.command]))
            else:
                found = json.loads((folder / COMPARABLE[self.command]).read_text(encoding="utf-8"))
                self.modes, curves = found.get("modes", []), _branches(found.get("rows", []))
            self.curves = {curve.name: curve for curve in curves}
            if self.modes:
                self.nodes, self.shapes = _shapes(read_csv(folder / "mode_shapes.csv"), len(self.modes))
        except (OSError, ValueError, LookupError) as error:
            raise InputError("compare", str(folder), f"its results cannot be read: {error}") from None


@dataclass(repr=False)
class CompareResult(Rows):
    """Outcome of `rotfem compare`.

    Attributes:
        summary: what was compared, the largest difference (`worst`), warnings; JSON-able.
        rows: one dictionary a result and quantity: `result`, `quantity`, `unit`, `reference` and `value` (peaks of
            curves, frequencies, critical speeds), `difference` (the largest one, relative to the largest value of the
            reference, of a vector's components to that of all of them), `rms` (its root mean square) and `mac`.
        compared: what is drawn, the reference first.
    """

    compared: list[Compared]
    index = ("result", "quantity")
    figure = "results.compare:compare_figure"

    def tables(self) -> list[ShortTable]:
        """Return a table for each result but the reference; differences relative to the largest of the reference."""
        out, (second, of) = [], ("mac", "MAC (–)") if self.summary["compared"] == "modes" else ("rms", "rms (%)")
        for title in self.summary["results"][1:]:
            rows = []
            for row in (row for row in self.rows if row["result"] == title):
                scale = largest([row["reference"], row["value"]])
                values = [number(row[name], scale) for name in ("reference", "value")]
                last = f"{row['mac']:.3f}" if "mac" in row else per_cent(row.get(second))
                unit = row["unit"] and f" ({row['unit']})"
                rows.append((f"{row['quantity']}{unit}", *values, per_cent(row["difference"]), last))
            out.append(ShortTable((f"{title}", self.summary["name"], "value", "difference (%)", of), rows))
        return out


def compare(*results: Result | str | Path) -> CompareResult:
    """Return how far results are from the first one, at common times, frequencies or speeds (see `Series.beside`).

    Args:
        results: results of one command (`run`, `modes`, `campbell` or `response`), or their folders; two at least.

    Raises:
        InputError: there are fewer, they are of different commands, or one cannot be compared.
    """
    if len(results) < 2:
        raise InputError("compare", len(results), "must be two results at least")
    reference, *others = compared = [Compared(result) for result in results]
    rows: list[Row] = []
    warnings: list[str] = []
    for other in others:
        if other.command != reference.command:
            allowed = f"must be of {reference.command}, as {reference.title} is"
            raise InputError("compare", f"{other.title}: {other.command}", allowed)
        pairs = _pairs(reference.curves, other.curves, by_name=reference.command != "campbell")
        found, alone = [*_distances(pairs)], list[str]()
        if reference.command == "modes":
            found, alone = _modes(reference, other)
        if reference.command == "campbell":
            found += _critical(reference, other, {(a.name, b.name) for a, b in pairs})
        rows += [{"result": other.title, **row} for row in found]
        names = [{curve.name for curve in curves} for curves in zip(*pairs, strict=True)] or [set(), set()]
        alone += sorted({*reference.curves} - names[0] | {*other.curves} - names[1])
        if alone:
            warnings.append(f"{other.title} and {reference.title}: only one of them has {', '.join(alone)}")
    summary = {
        "command": "compare",
        "status": "done",
        "name": reference.title,
        "compared": reference.command,
        "results": [one.title for one in compared],
        "worst": max((row["difference"] for row in rows), default=0.0),
        "rows": rows,
        "warnings": warnings,
        "versions": reference.summary["versions"],
    }
    return CompareResult(summary, rows, compared)


def _pairs(a: Mapping[str, Curve], b: Mapping[str, Curve], by_name: bool) -> list[tuple[Curve, Curve]]:
    """Return pairs of one name and, unless only these are wanted, of the others those of the nearest values."""
    ones, others = list(a.values()), list(b.values())
    far = np.zeros((len(ones), len(others)))
    for i, one in enumerate(ones):
        for j, other in enumerate(others):
            if by_name or one.name == other.name:
                far[i, j] = one.name != other.name
            else:
                _, here, there = one.beside(other)
                far[i, j] = 1.0 + relative(float(np.mean(np.abs(there - here))), float(np.max(one.y)))
    pairs = [(ones[i], others[j]) for i, j in zip(*linear_sum_assignment(np.minimum(far, 9.0)), strict=True)]
    return [(one, other) for one, other in pairs if not by_name or one.name == other.name]


def _distances(pairs: list[tuple[Curve, Curve]]) -> Iterator[Row]:
    """Yield a row for each pair of curves."""
    scales: dict[tuple[str, str], float] = {}
    parts = [(a, *a.beside(b)) for a, b in pairs]
    for a, _, here, _ in parts:
        scales[a.vector] = max(scales.get(a.vector, 0.0), float(np.max(np.abs(here))))
    for a, x, here, there in parts:
        off = np.abs(there - here)
        rms = np.sqrt(np.trapezoid(off**2, x) / np.ptp(x)) if np.ptp(x) > 0.0 else off[-1]
        yield {
            "quantity": a.name,
            "unit": a.unit,
            "reference": _peak(here),
            "value": _peak(there),
            "difference": relative(float(np.max(off)), scales[a.vector]),
            "rms": relative(float(rms), scales[a.vector]),
        }


def _modes(a: Compared, b: Compared) -> tuple[list[Row], list[str]]:
    """Return a row for each pair of modes, and the names of those without a partner.

    Pairs are of like shapes, and among those of like frequencies. A rigid-body mode, which has no shape, is none of
    them with another mode.
    """
    ones, others, rows = a.modes, b.modes, list[Row]()
    alone = [[mode["label"] for mode in modes] for modes in (ones, others)]
    mac, far = np.zeros((len(ones), len(others))), np.zeros((len(ones), len(others)))
    for i, j in np.ndindex(far.shape):
        u, v = a.shapes[i], b.shapes[j]
        there = [name for name in u if name in v]
        if there:
            x = np.concatenate([u[name] for name in there])
            y = np.concatenate([_moved(b.nodes, v[name], a.nodes) for name in there])
            mac[i, j] = relative(float(np.abs(np.vdot(x, y)) ** 2), float(np.vdot(x, x).real * np.vdot(y, y).real))
        here = ones[i]["frequency"]
        far[i, j] = relative(abs(others[j]["frequency"] - here), here)
    apart = np.not_equal.outer([bool(u) for u in a.shapes], [bool(v) for v in b.shapes])
    for i, j in zip(*linear_sum_assignment(np.minimum(far, 1.0) - mac + 2 * apart), strict=True):
        if apart[i, j]:
            continue
        frequencies = {"reference": ones[i]["frequency"], "value": others[j]["frequency"]}
        differences = {"difference": float(far[i, j]), "mac": float(mac[i, j])}
        rows.append({"quantity": ones[i]["label"], "unit": "rad/s", **frequencies, **differences})
        alone[0].remove(ones[i]["label"])
        alone[1].remove(others[j]["label"])
    return rows, [*alone[0], *alone[1]]


def _critical(a: Compared, b: Compared, branches: set[tuple[str, str]]) -> Iterator[Row]:
    """Yield a row for each critical speed that both have: of one kind and order, on branches that are paired."""
    there = list(b.summary["critical_speeds"])
    for one in a.summary["critical_speeds"]:
        same = [o for o in there if all(one[k] == o[k] for k in ("kind", "order", "per_rev"))]
        like = [o for o in same if (one["label"], o["label"]) in branches]
        if like:
            other = min(like, key=lambda o: abs(o["speed"] - one["speed"]))
            there.remove(other)
            name = f"critical speed, {one['kind']} {one['order']}, {one['label']}"
            off = relative(abs(other["speed"] - one["speed"]), abs(one["speed"]))
            values = {"reference": one["speed"], "value": other["speed"], "difference": off}
            yield {"quantity": name, "unit": "rad/s", **values}


def _moved(nodes: Values, values: Values, to: Values) -> Values:
    """Return values at other nodes: along a beam by straight lines, of a plate those of the nearest node."""
    if np.array_equal(nodes, to):
        return values
    if nodes.shape[1] == to.shape[1] == 1:
        return np.asarray(np.interp(to[:, 0], nodes[:, 0], values))
    return np.asarray(NearestNDInterpolator(nodes, values)(to))


def _peak(y: Values) -> float:
    """Return the value of the largest amount; of amplitudes that itself."""
    largest = y[np.argmax(np.abs(y))]
    return float(np.abs(largest) if np.iscomplexobj(y) else largest)


def _curves(columns: dict[str, Values]) -> Iterator[Curve]:
    """Yield the columns of a history over time, or the complex amplitudes of a response over frequency."""
    x = columns.pop("t" if "t" in columns else "frequency")
    waves = {n: columns[n] * np.exp(1j * columns[f"{n}_phase"]) for n in columns if f"{n}_phase" in columns}
    for name, y in (waves or columns).items():
        yield Curve(name, described(name)[1], x, y)


def _branches(rows: list[Row]) -> Iterator[Curve]:
    for name in dict.fromkeys(row["label"] for row in rows):
        x, y = np.array(sorted((row["speed"], row["frequency"]) for row in rows if row["label"] == name)).T
        yield Curve(name, "rad/s", x, y)


def _shapes(columns: dict[str, Values], count: int) -> tuple[Values, list[dict[str, Values]]]:
    """Return nodes and, for each mode, its complex components; a rigid-body mode comes first and has none."""
    nodes = np.stack([columns[name] for name in ("x", "y") if name in columns] or [np.ones(1)], axis=-1)
    shapes: list[dict[str, Values]] = []
    for i in range(1, count + 1):
        names = [n.removesuffix(f"_imag_{i}") for n in columns if n.endswith(f"_imag_{i}")]
        shapes.append({n: columns[f"{n}_{i}"] + 1j * columns[f"{n}_imag_{i}"] for n in names})
    return nodes / np.max(np.abs(nodes)), [{}] * sum(not s for s in shapes) + [s for s in shapes if s]


def compare_figure(result: CompareResult) -> Figure:
    """Return the curves over each other, the reference solid and the others dashed; of modes their differences."""
    from matplotlib.figure import Figure

    from rotfem.results.plots import dress

    reference, command = result.compared[0], result.compared[0].command
    names = [n for n in reference.curves if n.startswith(("tip_", "psi_dot"))]
    figure = Figure(figsize=(9, 1.7 * len(names) + 4.5 * (len(names) < 2)), layout="constrained")
    axes = figure.subplots(max(len(names), 1), 1, sharex=True, squeeze=False)[:, 0]
    for axis, name in zip(axes, names or ["frequency"], strict=True):
        for k, one in enumerate(result.compared):
            for curve in (c for c in one.curves.values() if c.name == name or not names):
                values, mark = np.abs(curve.y) if command == "response" else curve.y, "." * (len(curve.x) == 1)
                axis.plot(curve.x, values, f"C{k}{mark}{'--' if k else '-'}", lw=1.3, label=one.title)
        dress(axis, y=label(name), size=None)
        axis.set_yscale("log" if command == "response" else "linear")
    axes[-1].set_xlabel(label({"campbell": "psi_dot", "response": "frequency"}.get(command, "t")))
    if command == "modes":
        for k, one in enumerate(result.compared[1:]):
            off = {row["quantity"]: 100 * row["difference"] for row in result.rows if row["result"] == one.title}
            axes[0].plot([*off.values()], [*off], "o", color=f"C{k + 1}", label=one.title)
        axes[0].set(xlabel="difference of the frequency (%)", ylabel="")
    handles = {line.get_label(): line for line in axes[0].get_lines()}
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=3, frameon=False)
    return figure
