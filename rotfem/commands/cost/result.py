"""What a study of cost returns: rows, Pareto front, recommendation, files, figure, tuned scene. No dolfinx in it."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from rotfem.commands.accuracy import changes_of
from rotfem.errors import ComputationError, SceneError
from rotfem.refinement.estimate import percent
from rotfem.refinement.refine import Setting
from rotfem.results.columns import ShortTable, per_cent
from rotfem.results.files import json_text, write_text
from rotfem.results.result import Array, Row, Rows
from rotfem.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Rows of a table that is printed in full.
LONGEST_TABLE = 40

#: What an output's error is relative to.
ERRORS = {
    "tip": "error of the tip's motion, relative to its largest displacement (–)",
    "frequencies": "largest relative error of a frequency (–)",
    "campbell": "largest relative error of a frequency at any speed (–)",
}


@dataclass
class Reference:
    """The finest output of one theory.

    Attributes:
        values: rows of the output.
        parts: differences from coarser ones, `time` and `space`, relative; of a theory computed in the setting of the
            richest one also `theory`, their difference times the sum of these.
        setting: that it was computed in.
    """

    values: Array
    parts: dict[str, float]
    setting: Setting

    @property
    def uncertainty(self) -> float:
        """Its own error at most, relative, in the norm that errors are measured in."""
        return sum(self.parts.values())


def judged(row: Row) -> float:
    """Return the error a setting is judged by: with that of its model; infinite where it is not known."""
    known = row["status"] == "done" and row["total_error"] is not None and math.isfinite(row["total_error"])
    return float(row["total_error"]) if known else math.inf


def pareto(rows: Sequence[Row]) -> list[Row]:
    """Return the rows for which no other one costs as little and is as exact, and is better in one; cheapest first."""
    front: list[Row] = []
    candidates = (r for r in rows if r["candidate"] and judged(r) < math.inf)
    for row in sorted(candidates, key=lambda r: (r["cost"], judged(r))):
        if not front or judged(row) < judged(front[-1]):
            front.append(row)
    return front


def recommend(rows: Sequence[Row], accuracy: float, uncertainty: float = 0.0) -> Row | None:
    """Return the cheapest row whose error, with the uncertainty of what it is measured against, is within accuracy."""
    return next((row for row in pareto(rows) if bound(row, uncertainty) <= accuracy), None)


def bound(row: Row, uncertainty: float) -> float:
    """Return the most that the error of a setting is; that of the reference itself is its uncertainty."""
    error = judged(row)
    return error if error == uncertainty else error + uncertainty


def mesh_name(row: Row) -> str:
    """Return the mesh of a setting in short."""
    elements = row["elements"]
    return "–" if elements is None else "×".join(map(str, elements if isinstance(elements, list) else [elements]))


def step_name(row: Row) -> str:
    """Return the steps of a setting in short."""
    if row["scheme"] is None:
        return "–"
    return f"{row['step']:.3g}" if row["step"] is not None else f"tol {row['tolerance']:.2g}"


def recommendations(
    rows: list[Row], accuracy: float, uncertainty: float, refused: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Return what a summary says of the settings to take.

    `recommended` is the row for the accuracy, `promise` its error as measured, the bound of it, times (s) and memory
    (bytes). Where there is none, `closest` is the least accuracy that is known to be met, with its row, and `missing`
    says what was reached and what the budget left out. `recommendations` are those for powers of ten, too.
    """
    wanted = sorted({1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, accuracy}, reverse=True)
    best = {a: recommend(rows, a, uncertainty) for a in wanted}
    row, promise, closest, missing = best[accuracy], None, None, ""
    if row is not None:
        names = ("time", "cpu_time", "setup", "setup_cpu", "cost", "memory")
        promise = {"error": judged(row), "bound": bound(row, uncertainty), **{name: row[name] for name in names}}
    else:
        within = min((bound(row, uncertainty) for row in pareto(rows)), default=math.inf) or math.ulp(0.0)
        if within < math.inf:
            closest = {"within": within, "row": recommend(rows, within, uncertainty)}
        least = min((judged(row) for row in rows if row["candidate"]), default=math.inf)
        known = max(least, uncertainty) < math.inf
        missing = f"the best error is {least:.1e}, known to {uncertainty:.0e}" if known else "nothing could be judged"
        if refused:
            together = sum(entry["time"] or 0.0 for entry in refused)
            missing += f"; {len(refused)} settings were left out, of about {together:.2g} s: {refused[0]['why']}"
    listed = [{"accuracy": a, "setting": r and Setting.of(r).words(), "row": r} for a, r in best.items()]
    found = {"recommended": row, "promise": promise, "closest": closest, "missing": missing}
    return {**found, "recommendations": listed}


# --- the result ------------------------------------------------------------------------------------------------------


@dataclass(repr=False)
class CostResult(Rows):
    """Outcome of `rotfem cost`.

    Attributes:
        summary: scene, output, references with uncertainties, model errors, recommendation; JSON-able.
        rows: one dictionary a setting: `theory`, `elements`, `degree`, `scheme`, `step` (s), `tolerance`, `status`,
            `error`, `model_error`, `total_error`, `uncertainty` (relative), `time`, `time_min`, `time_max`, `cpu_time`,
            `setup` (s; medians of `repeats`), `cost` (CPU time with set-up, s), `dofs`, `steps`, `iterations`,
            `pareto`, `reason`. `error` is that to the reference of the same theory, `time` is without set-up.
        scene: the scene studied.
        references: theory ↦ its finest output.
    """

    scene: Scene = field(repr=False)
    references: dict[str, Reference] = field(default_factory=dict, repr=False)
    dimension = "setting"
    figure = "commands.cost.result:cost_figure"

    @property
    def front(self) -> list[Row]:
        """The rows that no other one beats in both cost and error, cheapest first."""
        return sorted((row for row in self.rows if row["pareto"]), key=lambda row: float(row["cost"]))

    def recommend(self, accuracy: float) -> Row | None:
        """Return the row of least `cost` (CPU time with set-up, s) of those within a relative accuracy; None without.

        What counts is `total_error` with the uncertainty of the reference.
        """
        known = self.summary["uncertainty"]
        return None if known is None else recommend(self.rows, accuracy, known)

    def missed(self, accuracy: float | None = None) -> ComputationError:
        """Return the error of an accuracy that no setting is known to meet, that of the study if None."""
        wanted, reached = self.summary["accuracy"] if accuracy is None else accuracy, self.summary["missing"]
        what = f"no setting tried is within {wanted:g}" + (f": {reached}" if reached else "")
        return ComputationError(what, advice="a larger --accuracy, a larger --budget, or smaller --steps")

    def write_tuned(self, path: str | Path, accuracy: float | None = None) -> Path:
        """Write the scene with the recommended setting: what was set in it, the changes, nothing else; return its path.

        Paths in the scene are written relative to the new file's folder.

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
            raise self.missed(wanted)
        remark = (
            f"# {self.scene.name}, tuned to a relative accuracy of {wanted:g} of {self.summary['output']}: "
            f"{Setting.of(row).words()}.\n# Measured: error {judged(row):.1e}, known to "
            f"{self.summary['uncertainty']:.0e}; {_cost(row)} with set-up.\n\n"
        )
        return write_tuned(self.scene, Setting.of(row), Path(path), remark)

    def report(self) -> list[str]:
        """Return the lines `cost` prints: the table (its Pareto front, if long), model errors, the recommendation."""
        summary, wanted = self.summary, f"{self.summary['accuracy']:g}"
        lines = [
            f"{summary['name']}: error of {summary['output']}, {summary['settings']} settings ({summary['failed']} "
            f"failed, {summary['resumed']} results from before) in {summary['timings']['total']:.1f} s",
            *(line for table in self.tables() for line in table.lines()),
            "* no other setting is both cheaper and more accurate"
            + ("" if len(self.rows) <= LONGEST_TABLE else "; all settings are in cost.csv"),
        ]
        for theory, error in summary["model_errors"].items():
            known = summary["references"][theory]["uncertainty"]
            lines.append(f"{theory} theory: error {percent(error)}, known to {percent(known)}")
        lines += [f"{theory} theory: failed, {reason}" for theory, reason in summary["reference_failures"].items()]
        if refused := summary["budget"]["refused"]:
            lines.append(f"{len(refused)} settings were left out for want of time or memory")
        if (row := summary["recommended"]) is not None:
            errors = f"error {percent(judged(row))}, known to {percent(summary['uncertainty'])}"
            return [*lines, f"for a relative accuracy of {wanted}: {Setting.of(row).words()}; {errors}, {_cost(row)}"]
        lines.append(f"no setting is known to be within {wanted} (relative): {summary['missing']}")
        if (near := summary["closest"]) is not None:
            row = near["row"]
            lines.append(f"within {percent(near['within'])}: {Setting.of(row).words()}, {_cost(row)}")
        return lines

    def tables(self) -> list[ShortTable]:
        """Return one row a setting, cheapest first; of many settings those of the Pareto front."""
        rows = self.rows if len(self.rows) <= LONGEST_TABLE else self.front
        head = ("theory", "elements", "degree", "scheme", "step (s)", "CPU (s)", "error (%)", "")
        ordered = sorted(rows, key=lambda r: (r["status"] != "done", r["cost"]))
        return [ShortTable(head, [_cells(row) for row in ordered])]

    def flat_rows(self) -> list[Row]:
        """Return the rows with numbers of elements as text where they are two."""
        return [{k: "x".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in self.rows]

    def texts(self) -> dict[str, str]:
        """Return cost.csv and cost.json."""
        keys = ("output", "references", "model_errors", "recommended", "recommendations")
        found = {**{k: self.summary[k] for k in keys}, "rows": self.rows}
        return {**super().texts(), "cost.json": json_text(found)}


def _cost(row: Row) -> str:
    return f"{row['cost']:.3g} s of CPU time"


def _cells(row: Row) -> tuple[str, ...]:
    error = per_cent(row["total_error"]) if row["status"] == "done" else row["status"]
    mesh = (mesh_name(row), str(row["degree"]), row["scheme"] or "–", step_name(row))
    return (row["theory"], *mesh, f"{row['cost']:.3f}", error, "*" if row["pareto"] else "")


def write_tuned(scene: Scene, setting: Setting, path: Path, remark: str) -> Path:
    """Write a scene with a setting after a remark of comment lines; return the path.

    Raises:
        SceneError: the combination is not valid, or the scene holds a Python function, which no file can.
        OutputError: the file cannot be written.
    """
    there, start, goal = scene.replace(changes_of(scene, setting)), Path(scene.directory), path.parent.resolve()
    files = set(map(os.path.realpath, there.inputs))

    def moved(value: Any) -> Any:
        """Return tables with the paths of files that the scene reads made relative to the folder of the new one."""
        if isinstance(value, Mapping):
            return {key: moved(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [moved(entry) for entry in value]
        is_file = isinstance(value, str | Path) and "\0" not in str(value) and os.path.realpath(start / value) in files
        return os.path.relpath(start.resolve() / value, goal) if is_file and not Path(value).is_absolute() else value

    try:
        text = tomli_w.dumps(moved(there.tables))
    except TypeError:
        raise SceneError(scene.file, allowed="holds a Python function, so that it cannot be written as TOML") from None
    return write_text(path, remark + text)


# --- the figure ------------------------------------------------------------------------------------------------------


def cost_figure(result: CostResult) -> Figure:
    """Return error over time: points by theory and scheme, Pareto front, errors of the models, uncertainty.

    A full point holds the error of the model; the faint ring is the error of its discretisation alone.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    figure, summary = Figure(figsize=(10.5, 6), layout="constrained"), result.summary
    axis, known = figure.add_subplot(), summary["uncertainty"]
    kinds = list(dict.fromkeys(str(row["scheme"] or f"degree {row['degree']}") for row in result.rows))
    for i, theory in enumerate(dict.fromkeys(row["theory"] for row in result.rows)):
        colour, own = f"C{i}", [row for row in result.rows if row["theory"] == theory]
        for kind, marker in zip(kinds, "osD^Pv*X<>", strict=False):
            done = [r for r in own if kind in (r["scheme"], f"degree {r['degree']}") and judged(r) < math.inf]
            style: dict[str, Any] = {"marker": marker, "color": colour, "ls": "none"}
            costs = [r["cost"] for r in done]
            axis.plot(costs, [r["error"] or math.nan for r in done], mfc="none", ms=5, alpha=0.35, **style)
            axis.plot(costs, [judged(r) or math.nan for r in done], ms=6, label=f"{theory}, {kind}", **style)
        if error := summary["model_errors"].get(theory):
            axis.axhline(error, color=colour, ls="--", lw=1.0, label=f"error of {theory}")
        if failed := [r["cost"] for r in own if r["status"] == "failed" and r["cost"] > 0.0]:
            top, label = axis.get_xaxis_transform(), f"{theory}, failed at that time"
            axis.plot(failed, [0.98] * len(failed), "x", color=colour, transform=top, clip_on=False, label=label)
    axis.set(xscale="log", yscale="log", xlabel="CPU time of one run with its set-up, median (s)")
    front = result.front
    errors = [max(judged(r), 1e-16) for r in front]
    axis.plot([r["cost"] for r in front], errors, "k-", lw=1.2, drawstyle="steps-post", zorder=0, label="Pareto front")
    for row, error in zip(front, errors, strict=True):
        name = f"{mesh_name(row)} P{row['degree']}" + ("" if row["scheme"] is None else f", {step_name(row)}")
        axis.annotate(name, (row["cost"], error), (5, 5), textcoords="offset points", size="x-small")
    if (chosen := summary["recommended"]) is not None:
        circle: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": "black", "mew": 1.2, "ls": "none", "marker": "o"}
        label = f"recommended for {summary['accuracy']:g}"
        axis.plot(chosen["cost"], max(judged(chosen), 1e-16), label=label, **circle)
    if known:
        axis.axhspan(0.0, known, color="0.85", zorder=-1, label=f"uncertainty {known:.0e}")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    axis.set_ylabel(ERRORS[summary["output"]])
    axis.set_title(f"{summary['name']}: what accuracy costs")
    axis.grid(True, which="both", lw=0.3, alpha=0.5)
    axis.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure
