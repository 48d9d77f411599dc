"""What a work–precision study returns: rows, Pareto front, recommendation, summary, files. No dolfinx in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import Reference, distance, size
from rotfem.commands.cost.settings import Setting
from rotfem.commands.cost.tuned import write_tuned
from rotfem.errors import ComputationError
from rotfem.mechanics.theories import ladder, richest
from rotfem.results import Result
from rotfem.results.files import json_text, rows_text
from rotfem.results.frames import Variable, column_of_rows, dataset, frame_of_rows
from rotfem.scene import Scene
from rotfem.version import versions

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

Row = dict[str, Any]

#: Theory ↦ its converged output.
References = dict[str, Reference]

#: What misses the best that was reached by this factor is as good where it is cheaper.
NEAR = 1.05

#: Accuracies a setting is recommended for besides the wanted one.
DECADES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)

#: Rows of a table that is printed in full.
LONGEST_TABLE = 40


class Done(Protocol):
    """What a summary asks of a study that was done (see `rotfem.commands.cost.study.Study`)."""

    scene: Scene
    output: str
    each: bool
    laboratory: Any
    references: References
    failures: dict[str, str]
    outlook: dict[str, Any] | None


def model_errors(references: References, each: bool) -> dict[str, float]:
    """Return theory ↦ relative difference of its reference from the richest one's; empty where there is none."""
    best = truth_of(references)
    if best is None:
        return {}
    truth = references[best].samples
    return {theory: distance(r.samples, truth, each) for theory, r in references.items()}


def truth_of(references: References) -> str | None:
    """Return the richest theory that has a reference, by which all are judged; None where none has."""
    return next((theory for theory in reversed(ladder()) if theory in references), None)


def rows_of(
    measured: Mapping[Setting, tuple[str, Measurement]],
    references: References,
    each: bool,
    theories: Sequence[str] | None = None,
) -> list[Row]:
    """Return one row a setting, which says what it was computed for: grid, reference or proposal.

    Of theories that were not asked for nothing is on the front or recommended, if theories were asked for.

    `error` is the distance to the reference of the same theory, `total_error` that to the richest theory's: what the
    model leaves out is in it. Both are relative to the richest theory's largest value (eigenvalues: each to its own).
    What a failed setting does not have is None.
    """
    floors = model_errors(references, each)
    best = truth_of(references)
    truth = None if best is None else references[best]
    scale = None if truth is None or each else size(truth.samples)
    rows = []
    for setting, (purpose, m) in measured.items():
        own = references.get(setting.theory)
        row: Row = {
            **setting.key(),
            "purpose": purpose,
            "candidate": theories is None or setting.theory in theories,
            "status": m.status,
            "error": None if own is None or m.samples is None else distance(m.samples, own.samples, each, scale),
            "model_error": floors.get(setting.theory),
            "total_error": None if truth is None or m.samples is None else distance(m.samples, truth.samples, each),
            "uncertainty": own.uncertainty if own else None,
            "cost": m.cost,
            "time": m.median("wall"),
            "cpu_time": m.median("cpu"),
            "time_min": min(m.wall, default=math.nan),
            "time_max": max(m.wall, default=math.nan),
            "setup": m.median("setup"),
            "setup_cpu": m.median("setup_cpu"),
            "memory": m.memory or None,
            "dofs": m.dofs or None,
            "steps": m.steps,
            "iterations": m.iterations,
            "repeats": len(m.wall),
            "pareto": False,
            "reason": m.reason,
        }
        rows.append(row)
    for row in pareto(rows):
        row["pareto"] = True
    return rows


def judged(row: Row) -> float | None:
    """Return the error a setting is judged by: with that of its model, where there is a reference to know it from."""
    if row["status"] != "done":
        return None
    value = row["error"] if row["total_error"] is None else row["total_error"]
    return value if value is not None and math.isfinite(value) else None


def pareto(rows: Sequence[Row]) -> list[Row]:
    """Return the rows for which no other one costs as little and is as exact, and is better in one; cheapest first."""
    best, front = math.inf, []
    candidates = (r for r in rows if r["candidate"] and judged(r) is not None)
    for row in sorted(candidates, key=lambda r: (r["cost"], judged(r))):
        error = judged(row)
        if error is not None and error < best:
            front.append(row)
            best = error
    return front


def recommend(rows: Sequence[Row], accuracy: float, uncertainty: float = 0.0) -> Row | None:
    """Return the cheapest row whose error, with the uncertainty of what it is measured against, is within accuracy."""
    for row in pareto(rows):
        error = judged(row)
        if error is not None and error + uncertainty <= accuracy:
            return row
    return None


def setting_of(row: Row) -> Setting:
    """Return the setting of a row."""
    names = ("theory", "elements", "degree", "scheme", "step", "tolerance", "every")
    values = {name: row[name] for name in names}
    if isinstance(values["elements"], list):
        values["elements"] = tuple(values["elements"])
    return Setting(**values)


def mesh_name(row: Row) -> str:
    """Return the mesh of a setting in short."""
    elements = row["elements"]
    mesh = "" if elements is None else "×".join(map(str, elements if isinstance(elements, list) else [elements])) + " "
    return f"{mesh}P{row['degree']}"


def describe(row: Row) -> str:
    """Return a setting in words."""
    text = f"{row['theory']}, {mesh_name(row)}"
    if row["step"] is not None:
        text += f", {row['scheme']} with step {row['step']:g} s"
    elif row["tolerance"] is not None:
        text += f", {row['scheme']} with tolerance {row['tolerance']:g}"
    return text


def study_summary(study: Done, rows: list[Row], accuracy: float, quick: bool) -> dict[str, Any]:
    """Return the summary of a study.

    Args:
        study: what was done.
        rows: of its settings.
        accuracy: asked for.
        quick: whether the grid was the small one.
    """
    references, laboratory = study.references, study.laboratory
    truth = truth_of(references)
    uncertainty = 0.0 if truth is None else references[truth].uncertainty
    best = {a: recommend(rows, a, uncertainty) for a in sorted({*DECADES, accuracy}, reverse=True)}
    nearest = closest(rows, accuracy, uncertainty) if best[accuracy] is None else None
    used, compiling = laboratory.budget.summary(), laboratory.bench.compiling
    return {
        "command": "cost",
        "status": "done",
        "name": study.scene.name,
        "output": study.output,
        "quick": quick,
        "accuracy": accuracy,
        "truth": truth,
        "uncertainty": uncertainty,
        "references": {
            t: {"order": r.order, "uncertainty": r.uncertainty, "parts": r.parts} for t, r in references.items()
        },
        "reference_failures": study.failures,
        "reference_largest": largest(rows),
        "model_errors": model_errors(references, study.each),
        "recommended": best[accuracy],
        "promise": promise(best[accuracy], uncertainty),
        "closest": nearest,
        "missing": missing(rows, accuracy, uncertainty, used["refused"], study.outlook)
        if best[accuracy] is None
        else "",
        "outlook": study.outlook,
        "recommendations": [{"accuracy": a, "setting": r and describe(r), "row": r} for a, r in best.items()],
        "scaling": laboratory.prediction.scaling(),
        "settings": len(rows),
        "failed": sum(row["status"] == "failed" for row in rows),
        "measured": laboratory.new,
        "resumed": len(laboratory.taken),
        "budget": used,
        "timings": {"compile": compiling, "other": used["used"] - compiling, "total": used["used"]},
        "warnings": _warnings(study, rows, accuracy, uncertainty),
        "versions": versions(),
        "ranks": laboratory.comm.size,
        "scene": study.scene.digest(),
    }


def promise(row: Row | None, uncertainty: float) -> dict[str, float] | None:
    """Return what a recommended setting promises: its error as measured, and its bound; times (s), memory (bytes)."""
    if row is None:
        return None
    error = judged(row) or 0.0
    names = ("time", "cpu_time", "setup", "setup_cpu", "cost", "memory")
    return {"error": error, "bound": error + uncertainty, **{name: row[name] for name in names}}


def largest(rows: list[Row]) -> dict[str, float]:
    """Return the most unknowns, time and CPU time (s, with set-up), memory (bytes) of what references are made of."""
    made = [row for row in rows if row["purpose"] == "reference" and row["status"] == "done"]
    return {
        "dofs": max((row["dofs"] or 0 for row in made), default=0),
        "time": max((row["setup"] + row["time"] for row in made), default=0.0),
        "cost": max((row["cost"] for row in made), default=0.0),
        "memory": max((row["memory"] or 0.0 for row in made), default=0.0),
    }


def closest(rows: list[Row], accuracy: float, uncertainty: float) -> dict[str, Any] | None:
    """Return `within`, the least accuracy above the one asked for that is known to be met, and the `row` that does.

    None where nothing could be judged.
    """
    errors = _errors(rows)
    if not errors or not math.isfinite(uncertainty):
        return None
    within = float(f"{NEAR * max(min(errors) + uncertainty, accuracy):.1e}")
    return {"within": within, "row": recommend(rows, within, uncertainty)}


def missing(
    rows: list[Row],
    accuracy: float,
    uncertainty: float,
    refused: list[dict[str, Any]],
    ahead: dict[str, Any] | None = None,
) -> str:
    """Return what was reached, and what it takes to recommend a setting where there is none (see `outlook`)."""
    errors = _errors(rows)
    known = errors and math.isfinite(uncertainty)
    said = f"the best error is {min(errors):.1e}, known to {uncertainty:.0e}" if known else "nothing could be judged"
    wanted = [entry for entry in refused if entry["time"] is not None]
    if ahead is not None:
        said += (
            f"; the budget left out {len(refused)} settings; {describe(ahead['setting'])} should be within "
            f"{accuracy:g} in about {ahead['cost']:.2g} s of CPU time, which a --budget of about "
            f"{ahead['budget']:.0f}s should suffice to find"
        )
    elif wanted:
        together = sum(entry["time"] for entry in wanted)
        said += f"; the budget left out {len(refused)} settings, which would take about {together:.2g} s"
    elif refused:
        said += f"; {describe(refused[0]['setting'])} {refused[0]['why']}"
    return said


def _errors(rows: list[Row]) -> list[float]:
    """Return the errors of all settings that may be recommended, as far as they are known."""
    return [error for error in (judged(row) for row in rows if row["candidate"]) if error is not None]


def _warnings(study: Done, rows: list[Row], accuracy: float, uncertainty: float) -> list[str]:
    out = []
    if richest().name not in study.references:
        reason = study.failures.get(richest().name, "")
        out.append(f"no reference of {richest().name} ({reason}): errors do not include that of the model")
    least = min(_errors(rows), default=math.inf)
    if math.isfinite(uncertainty) and uncertainty > max(accuracy / 2, least / 2):
        out.append(f"the reference is known to {uncertainty:.1e}: errors near that are not resolved")
    return out


def cost_report(summary: dict[str, Any], rows: list[dict[str, Any]], folder: Path) -> list[str]:
    """Return the lines `cost` prints: the table (of a large study its Pareto front), floors, what is recommended."""
    lines = [
        f"{summary['name']}: error of {summary['output']}, {summary['settings']} settings ({summary['failed']} failed, "
        f"{summary['resumed']} results from before) in {summary['timings']['total']:.1f} s",
        f"{'theory':<18}{'elements':>9}{'P':>3}{'scheme':>19}{'step (s)':>11}{'dofs':>7}"
        f"{'CPU (s)':>9}{'time (s)':>10}{'error':>9}{'total':>9}",
    ]
    shown = rows if len(rows) <= LONGEST_TABLE else [row for row in rows if row["pareto"]]
    for row in sorted(shown, key=lambda r: (r["status"] == "failed", r["cost"])):
        n, step = row["elements"], row["step"]
        mesh = "–" if n is None else "×".join(map(str, n if isinstance(n, list) else [n]))
        way = "–" if row["scheme"] is None else f"{step:.5g}" if step is not None else f"tol {row['tolerance']:.3g}"
        lines.append(
            f"{row['theory']:<18}{mesh:>9}{row['degree']:>3}{row['scheme'] or '–':>19}{way:>11}{row['dofs'] or '–':>7}"
            f"{row['cost']:>9.3f}{row['setup'] + row['time']:>10.3f}"
            + (f"{_short(row['error'])}{_short(row['total_error'])}" if judged(row) is not None else f"{'failed':>18}")
            + (" *" if row["pareto"] else "")
        )
    if len(shown) < len(rows):
        lines.append("only the Pareto front is shown; all settings are in cost.csv")
    for theory, floor in summary["model_errors"].items():
        uncertain = summary["references"][theory]["uncertainty"]
        lines.append(f"{theory}: error of the model {floor:.1e}, reference known to {uncertain:.0e}")
    largest = summary["reference_largest"]
    if largest["dofs"]:
        lines.append(
            f"largest reference: {largest['dofs']} unknowns; longest {largest['cost']:.2g} s of CPU time; most memory "
            f"{largest['memory'] / 1e6:.0f} MB"
        )
    if summary["budget"]["refused"]:
        lines.append(f"{len(summary['budget']['refused'])} settings were left out for want of time or memory")
    for theory, reason in summary["reference_failures"].items():
        lines.append(f"{theory}: failed, {reason}")
    row = summary["recommended"]
    if row is None:
        lines.append(f"no setting is known to be within {summary['accuracy']:g}: {summary['missing']}")
        near = summary["closest"]
        if near is not None:
            lines.append(f"within {near['within']:g}: {describe(near['row'])}, {near['row']['cost']:.3g} s of CPU time")
    else:
        lines.append(
            f"for {summary['accuracy']:g}: {describe(row)}: error {judged(row):.1e}, known to "
            f"{summary['uncertainty']:.0e}, {row['cost']:.3g} s of CPU time"
        )
    return [*lines, f"results in {folder}"]


def _short(value: float | None) -> str:
    return f"{'–':>9}" if value is None else f"{value:>9.1e}"


@dataclass(frozen=True)
class CostPoint:
    """What one setting costs, and what it gives.

    Attributes:
        setting: theory, mesh, degree, scheme and step.
        time: of one run without its set-up, median, s.
        cost: CPU time of one run with its set-up, s: what settings are ranked by.
        error: relative, that of the theory included where it is known.
        pareto: whether no other setting is as fast and as exact, and better in one.
    """

    setting: Setting
    time: float
    cost: float
    error: float
    pareto: bool

    @classmethod
    def of(cls, row: Row) -> CostPoint | None:
        """Return the point of a row; None if its setting failed or there is nothing to judge it by."""
        error = judged(row)
        return (
            None
            if error is None
            else cls(setting_of(row), float(row["time"]), float(row["cost"]), error, bool(row["pareto"]))
        )

    def __str__(self) -> str:
        return f"{describe(self.setting.key())}: error {self.error:.1e}, {self.cost:.3g} s of CPU time"


@dataclass
class CostResult(Result):
    """Outcome of `rotfem cost`.

    Attributes:
        summary: scene, output, references with orders and uncertainties, model errors, recommendation; JSON-able.
        rows: one dictionary a setting: `theory`, `elements`, `degree`, `scheme`, `step` (s), `tolerance`, `status`,
            `error`, `model_error`, `total_error`, `uncertainty` (relative), `time`, `time_min`, `time_max`, `cpu_time`,
            `setup` (s; medians of `repeats`), `dofs`, `steps`, `iterations`, `pareto`, `reason`.
        scene: the scene studied.
        references: theory ↦ its converged output.
    """

    rows: list[Row]
    scene: Scene = field(repr=False)
    references: dict[str, Reference] = field(default_factory=dict, repr=False)

    @property
    def points(self) -> list[CostPoint]:
        """Time and error of every setting that could be computed and judged, in the order they were tried."""
        return [point for point in map(CostPoint.of, self.rows) if point is not None]

    @property
    def front(self) -> list[CostPoint]:
        """The points that no other one beats in both time and error, cheapest first."""
        return sorted((point for point in self.points if point.pareto), key=lambda point: point.cost)

    @property
    def recommended(self) -> CostPoint | None:
        """The cheapest setting within the accuracy that was asked for, uncertainty included; None if there is none."""
        row = self.summary["recommended"]
        return None if row is None else CostPoint.of(row)

    def recommend(self, accuracy: float) -> Row | None:
        """Return the cheapest row within a relative accuracy, uncertainty included; None if there is none."""
        return recommend(self.rows, accuracy, self.summary["uncertainty"] or 0.0)

    def write_tuned(self, path: str | Path, accuracy: float | None = None) -> Path:
        """Write the scene with the recommended setting; return its path.

        Args:
            path: TOML file to write.
            accuracy: relative; that of the study if None.

        Raises:
            ComputationError: no setting is that accurate.
            SceneError: the scene holds a Python function.
            OutputError: the file cannot be written.
        """
        wanted = self.summary["accuracy"] if accuracy is None else accuracy
        row = self.recommend(wanted)
        if row is None:
            ahead = self.summary.get("outlook") if wanted == self.summary["accuracy"] else None
            more = "smaller --steps" if ahead is None else f"a --budget of about {ahead['budget']:.0f}s"
            raise ComputationError(f"no setting tried is within {wanted:g}", advice=f"a larger --accuracy, or {more}")
        error = row["error"] if row["total_error"] is None else row["total_error"]
        remark = (
            f"{self.scene.name}, tuned to a relative accuracy of {wanted:g} of {self.summary['output']}: "
            f"{describe(row)}.\nMeasured: error {error:.1e}, known to {self.summary['uncertainty']:.0e}; "
            f"{row['cost']:.3g} s of CPU time with set-up."
        )
        return write_tuned(self.scene, setting_of(row), Path(path), remark)

    def report(self, folder: Path) -> list[str]:
        """Return the lines that the command prints."""
        return cost_report(self.summary, self.rows, folder)

    def _flat_rows(self) -> list[Row]:
        """Return the rows with numbers of elements as text where they are two."""
        return [{k: "x".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in self.rows]

    def files(self) -> dict[str, str]:
        """Return cost.csv, cost.json and summary.json."""
        keys = ("output", "references", "model_errors", "recommended", "recommendations")
        return {
            "cost.csv": rows_text(self._flat_rows()),
            "cost.json": json_text({**{k: self.summary[k] for k in keys}, "rows": self.rows}),
            "summary.json": json_text(self.summary),
        }

    def drawings(self) -> dict[str, Callable[[], Figure]]:
        """Return cost.png, and scaling.png where more than one size of a theory was computed."""
        from rotfem.commands.cost.plot import cost_figure, scaling_figure

        further = {"scaling.png": partial(scaling_figure, self)} if self.summary["scaling"] else {}
        return {"cost.png": partial(cost_figure, self), **further}

    def to_pandas(self) -> pandas.DataFrame:
        """Return one row a setting, as in cost.csv.

        Raises:
            ImportError: pandas is not installed.
        """
        return frame_of_rows(self._flat_rows())

    def to_xarray(self) -> xarray.Dataset:
        """Return the columns of cost.csv over `setting`, the number of the row from 0 on.

        Raises:
            ImportError: xarray is not installed.
        """
        rows = self._flat_rows()
        over: dict[str, Variable] = {name: (("setting",), column_of_rows(rows, name)) for name in rows[0]}
        coordinates: dict[str, Variable] = {"setting": (("setting",), np.arange(len(rows)))}
        return dataset(over, coordinates, self._attributes())
