"""Results side by side: how far others are from a reference, in curves, modes, branches and critical speeds.

Modes are matched by the modal assurance criterion, MAC = |a^H b|²/((a^H a)(b^H b)), 1 for equal shapes (Allemang &
Brown, "A correlation coefficient for modal vector analysis", Proc. 1st Int. Modal Analysis Conf., 1982, pp. 110–116).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import NearestNDInterpolator
from scipy.optimize import linear_sum_assignment

from rotfem.errors import InputError
from rotfem.results.columns import ShortTable, described, label, largest, number, per_cent
from rotfem.results.distance import Series, alikeness, relative
from rotfem.results.files import read_csv
from rotfem.results.result import Result, Row, Rows
from rotfem.results.result_set import read_summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Values = npt.NDArray[Any]

#: Commands whose results can be compared ↦ the file that is read.
COMPARABLE = {"run": "history.csv", "modes": "modes.json", "campbell": "campbell.json", "response": "response.csv"}


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
        self.summary, self.modes = read_summary(folder), list[Row]()
        self.command, status = (str(self.summary.get(key, "")) for key in ("command", "status"))
        if self.command not in COMPARABLE or status != "done":
            there = f"{self.command}, {status}" if self.command else "no results of rotfem"
            allowed = f"has {there}; must be a folder with finished results of {', '.join(COMPARABLE)}"
            raise InputError("compare", str(folder), allowed)
        file = folder / COMPARABLE[self.command]
        try:
            if self.command in ("run", "response"):
                self.curves = dict(_columns(read_csv(file)))
                return
            found = json.loads(file.read_text(encoding="utf-8"))
            self.curves = dict(_branches(found.get("rows", [])))
            if self.command == "modes":
                self.modes = found["modes"]
                self.nodes, self.shapes = _shapes(read_csv(folder / "mode_shapes.csv"), len(self.modes))
        except (OSError, ValueError, LookupError) as error:
            raise InputError("compare", str(folder), f"its results cannot be read: {error}") from None

    def of(self, name: str) -> tuple[str, str]:
        """Return the vector that a curve is a component of, and its unit: what has one scale; a branch is its own."""
        return (name, "rad/s") if self.command == "campbell" else (name.rstrip("123"), described(name)[1])


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
        pairs = _pairs(reference, other)
        found, alone = [*_distances(reference, other, pairs)], list[str]()
        if reference.command == "modes":
            found, alone = _modes(reference, other)
        if reference.command == "campbell":
            found += _critical(reference, other, pairs)
        rows += [{"result": other.title, **row} for row in found]
        alone += sorted({*reference.curves} - {one for one, _ in pairs} | {*other.curves} - {two for _, two in pairs})
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


def _beside(name: str, one: Series, other: Series) -> tuple[Series, Series]:
    """Return two curves at common places."""
    here, there = one.beside(other)
    if not len(here.times):
        ends = (f"{curve.times[0]:g} … {curve.times[-1]:g}" for curve in (one, other))
        raise InputError(name, " and ".join(ends), "must overlap")
    return here, there


def _pairs(a: Compared, b: Compared) -> list[tuple[str, str]]:
    """Return the names of curves that belong together: equal ones, and of the other branches the nearest ones."""
    pairs = [(name, name) for name in a.curves if name in b.curves]
    if a.command != "campbell":
        return pairs
    ones, others = ([name for name in one.curves if (name, name) not in pairs] for one in (a, b))
    far = np.zeros((len(ones), len(others)))
    for (i, one), (j, other) in product(enumerate(ones), enumerate(others)):
        here, there = _beside(one, a.curves[one], b.curves[other])
        far[i, j] = np.mean(np.abs(there.values - here.values))
    return [*pairs, *((ones[i], others[j]) for i, j in zip(*linear_sum_assignment(far), strict=True))]


def _distances(a: Compared, b: Compared, pairs: list[tuple[str, str]]) -> Iterator[Row]:
    """Yield a row for each pair of curves."""
    parts = {name: _beside(name, a.curves[name], b.curves[other]) for name, other in pairs}
    scales: dict[tuple[str, str], float] = {}
    for name, (here, _) in parts.items():
        scales[a.of(name)] = max(scales.get(a.of(name), 0.0), here.scale)
    for name, (here, there) in parts.items():
        x, off = here.times, np.abs(there.values - here.values)[:, 0]
        rms = np.sqrt(np.trapezoid(off**2, x) / np.ptp(x)) if np.ptp(x) > 0.0 else off[-1]
        yield {
            "quantity": name,
            "unit": a.of(name)[1],
            "reference": _peak(here.values),
            "value": _peak(there.values),
            "difference": relative(float(np.max(off)), scales[a.of(name)]),
            "rms": relative(float(rms), scales[a.of(name)]),
        }


def _modes(a: Compared, b: Compared) -> tuple[list[Row], list[str]]:
    """Return a row for each pair of modes, and the names of those without a partner.

    Pairs are of like shapes, and among those of like frequencies. A rigid-body mode, which has no shape, is none of
    them with another mode.
    """
    here, there = (np.array([mode["frequency"] for mode in one.modes]) for one in (a, b))
    far = np.abs(there - here[:, None]) / np.where(here > 0.0, here, np.inf)[:, None]
    mac, names = np.zeros(far.shape), [name for name in a.shapes if name in b.shapes]
    if names:
        moved = [_moved(b.nodes, b.shapes[name], a.nodes) for name in names]
        mac = alikeness(np.hstack([a.shapes[name] for name in names]), np.hstack(moved)) ** 2
    rigid = [~np.any(np.hstack(list(one.shapes.values())), axis=1) for one in (a, b)]
    apart = np.not_equal.outer(*rigid)
    rows, alone = list[Row](), [[mode["label"] for mode in one.modes] for one in (a, b)]
    for i, j in zip(*linear_sum_assignment(np.minimum(far, 1.0) - mac + 2 * apart), strict=True):
        if not apart[i, j]:
            label = a.modes[i]["label"]
            frequencies = {"reference": float(here[i]), "value": float(there[j])}
            differences = {"difference": float(far[i, j]), "mac": float(mac[i, j])}
            rows.append({"quantity": label, "unit": "rad/s", **frequencies, **differences})
            alone[0].remove(label)
            alone[1].remove(b.modes[j]["label"])
    return rows, [*alone[0], *alone[1]]


def _critical(a: Compared, b: Compared, branches: list[tuple[str, str]]) -> Iterator[Row]:
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
    """Return (modes, nodes) at other nodes: along a beam by straight lines, of a plate those of the nearest node."""
    if np.array_equal(nodes, to):
        return values
    if nodes.shape[1] == to.shape[1] == 1:
        return np.array([np.interp(to[:, 0], nodes[:, 0], mode) for mode in values])
    return np.asarray(NearestNDInterpolator(nodes, values.T)(to)).T


def _peak(y: Values) -> float:
    """Return the value of the largest amount; of amplitudes that itself."""
    largest = y.flat[np.argmax(np.abs(y))]
    return float(np.abs(largest) if np.iscomplexobj(y) else largest)


def _columns(columns: dict[str, Values]) -> Iterator[tuple[str, Series]]:
    """Yield the columns of a history over time, or the complex amplitudes of a response over frequency."""
    x = columns.pop("t" if "t" in columns else "frequency")
    waves = {n: columns[n] * np.exp(1j * columns[f"{n}_phase"]) for n in columns if f"{n}_phase" in columns}
    for name, y in (waves or columns).items():
        yield name, Series(x, y[:, None])


def _branches(rows: list[Row]) -> Iterator[tuple[str, Series]]:
    for name in dict.fromkeys(row["label"] for row in rows):
        x, y = np.array(sorted((row["speed"], row["frequency"]) for row in rows if row["label"] == name)).T
        yield name, Series(x, y[:, None])


def _shapes(columns: dict[str, Values], count: int) -> tuple[Values, dict[str, Values]]:
    """Return nodes and component ↦ complex shapes (modes, nodes); a rigid-body mode comes first, with zeros."""
    nodes = np.stack([columns[name] for name in ("x", "y") if name in columns], axis=-1)
    shapes: dict[str, Values] = {}
    for i, name in product(range(count), dict.fromkeys(n.partition("_imag_")[0] for n in columns if "_imag_" in n)):
        mode = shapes.setdefault(name, np.zeros((count, len(nodes)), dtype=complex))[i]
        if f"{name}_{i + 1}" in columns:
            mode[:] = columns[f"{name}_{i + 1}"] + 1j * columns[f"{name}_imag_{i + 1}"]
    order = np.argsort(np.any(np.hstack(list(shapes.values())), axis=1), kind="stable")
    return nodes / np.max(np.abs(nodes)), {name: values[order] for name, values in shapes.items()}


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
            for curve in (c for n, c in one.curves.items() if n == name or not names):
                values = np.abs(curve.values) if command == "response" else curve.values
                mark = "." * (len(curve.times) == 1)
                axis.plot(curve.times, values, f"C{k}{mark}{'--' if k else '-'}", lw=1.3, label=one.title)
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
