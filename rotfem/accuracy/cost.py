"""What accuracy costs: the ladder of each theory and each scheme, measured against the last rung of the richest theory.

The reference is known to the error of that rung (`rotfem.accuracy.ladder.reduced`). A row that is nearer to the
reference than the reference is known has that as its error, and is no better than others of which the same is true.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rotfem.accuracy.answer import Answer, Answers, Setting, distance
from rotfem.accuracy.errors import percent
from rotfem.accuracy.ladder import MOST_FAILURES, Clock, OverBudget, ladder, reduced
from rotfem.accuracy.tuned import write_variant
from rotfem.errors import ComputationError, InputError
from rotfem.results.columns import ShortTable, per_cent
from rotfem.results.files import json_text
from rotfem.results.result import Row, Rows
from rotfem.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Part of the accuracy that the reference is to be known to.
AIM = 0.25

#: Seconds below which a time is measured again, until its median is known to this part, or so often.
SHORT, KNOWN, MOST = 0.05, 0.1, 15

#: Seconds below which loading a form from disk counts, so that the first run with one is not timed.
LOADING = 1.0

#: A ladder ends where a rung is so many times as dear as the cheapest setting that is good enough.
DEARER = 4.0

#: Rows of a table that is printed in full.
LONGEST_TABLE = 40

#: What an output's error is relative to.
ERRORS = {
    "tip": "error of the tip's motion, relative to its largest displacement (–)",
    "frequencies": "largest relative error of a frequency (–)",
    "campbell": "largest relative error of a frequency at any speed (–)",
}


@dataclass
class Measured:
    """A setting, computed.

    Attributes:
        answer: with the median of the times; None where it failed.
        repeats: times that were measured.
        reason: why it failed.
    """

    answer: Answer | None
    repeats: int = 0
    reason: str = ""


class Study:
    """The ladders of a scene.

    Args:
        fresh: returns answers of the scene of which none is computed.
        accuracy: relative.
        clock: of all answers.
        agree: value ↦ that of the first of several processes.
        progress: called with the share of the ladders that are climbed.

    Attributes:
        measured: setting ↦ what was measured of it.
        reference: answer that errors are measured against; None before there is one.
        known: error of that, relative.
        refused: settings that the budget left out, with why.
    """

    def __init__(
        self,
        fresh: Callable[[], Answers],
        accuracy: float,
        clock: Clock,
        agree: Callable[[float], float] = float,
        progress: Callable[[float], None] = lambda share: None,
    ):
        self.fresh, self.accuracy, self.clock, self._agree, self._progress = fresh, accuracy, clock, agree, progress
        self.scene, self.moving = (answers := fresh()).scene, answers.moving
        self.measured: dict[Setting, Measured] = {}
        self.reference: Answer | None = None
        self.known = math.inf
        self.refused: list[dict[str, Any]] = []
        self._loaded: set[tuple[Any, ...]] = set()

    def climb(self, theories: Sequence[str], schemes: Sequence[str]) -> None:
        """Measure the ladder of each theory, the richest first, by each scheme, and the scene's own setting.

        Args:
            theories: from the poorest to the richest.
            schemes: of the steps, the one of the reference first.
        """
        ways = [(theory, scheme) for theory in reversed(theories) for scheme in (schemes if self.moving else ("",))]
        own = Setting.of(self.scene, self.moving)
        for i, (theory, scheme) in enumerate(ways):
            self._ladder(theory, scheme or "esdirk4")
            if i == 0 and own.theory in theories and (not self.moving or own.scheme in schemes):
                self._attempt(own, None)
            self._progress((i + 1) / len(ways))

    def _ladder(self, theory: str, scheme: str) -> None:
        """Measure the rungs of one ladder; the first one that has answers gives the reference."""
        is_first = self.reference is None
        before: Answer | None = None
        error, stuck, failures = math.inf, 0, 0
        for setting in ladder(self.scene, theory, scheme, self.moving):
            predicted = None if before is None else 2.0 * before.seconds
            if predicted is not None and predicted > DEARER * self._enough():
                return
            found = self._attempt(setting, predicted)
            if found is None:
                return
            if found.answer is None:
                failures += 1
                if before is not None or (failures == MOST_FAILURES and not is_first):
                    return
                continue
            answer = found.answer
            if is_first:
                if before is not None:
                    self.known = reduced(distance(answer, before).size, self.known, 6.0)
                self.reference, before = answer, answer
                if self.known <= AIM * self.accuracy:
                    return
                continue
            last, error = error, self.error_of(answer)[0]
            stuck = stuck + 1 if error > 0.5 * last else 0
            before = answer
            if error <= max(AIM * self.accuracy, self.known) or stuck == 2:  # no rung has less than its theory's error
                return

    def _enough(self) -> float:
        """Return the time (s) of the cheapest setting that is good enough; infinite without one."""
        if self.reference is None or not math.isfinite(self.known):
            return math.inf
        good = [m.answer.seconds for m in self.measured.values() if m.answer and self._bound(m.answer) <= self.accuracy]
        return min(good, default=math.inf)

    def _bound(self, answer: Answer) -> float:
        error, at_most = self.error_of(answer)
        return error if at_most else error + self.known

    def error_of(self, answer: Answer) -> tuple[float, bool]:
        """Return the error of an answer, and whether it is a bound: that of the reference."""
        assert self.reference is not None
        error = distance(self.reference, answer).size
        return (self.known, True) if error <= self.known < math.inf else (error, False)

    def _attempt(self, setting: Setting, predicted: float | None) -> Measured | None:
        """Return what was measured of a setting; None where the budget refuses it."""
        if setting in self.measured:
            return self.measured[setting]
        try:
            self.clock.begin(setting.words(), predicted)
            self.measured[setting] = self._timed(setting)
        except OverBudget as failure:
            self.refused.append({"setting": setting.summary(), "why": failure.what, "time": predicted})
            return None
        except (ComputationError, InputError) as failure:
            why = failure.what if isinstance(failure, ComputationError) else failure.allowed
            self.measured[setting] = Measured(None, 0, why)
        return self.measured[setting]

    def _timed(self, setting: Setting) -> Measured:
        """Return the answer of a setting with the median of its times (see `SHORT`)."""
        answer, forms = self.fresh()(setting), (setting.theory, setting.degree, setting.scheme, setting.effects)
        times = [] if forms not in self._loaded and self._agree(answer.seconds) < LOADING else [answer.seconds]
        self._loaded.add(forms)
        while not times or (np.median(times) < SHORT and len(times) < MOST and not _is_known(times)):
            times.append(self._agree(self.fresh()(setting).seconds))
        return Measured(replace(answer, seconds=float(np.median(times))), len(times))

    def rows(self) -> list[Row]:
        """Return a row for each setting that was computed."""
        rows = []
        for setting, found in self.measured.items():
            answer, error, at_most = found.answer, None, False
            if answer is not None and self.reference is not None:
                error, at_most = self.error_of(answer)
            rows.append(
                {
                    "theory": setting.theory,
                    "elements": list(e) if isinstance(e := setting.elements, tuple) else e,
                    **{name: getattr(setting, name) for name in ("degree", "scheme", "step", "tolerance")},
                    "status": "failed" if answer is None else "done",
                    "total_error": error,
                    "at_most": at_most,
                    "cost": None if answer is None else answer.seconds,
                    "repeats": found.repeats,
                    "steps": 0 if answer is None else answer.outcome.steps,
                    "pareto": False,
                    "words": setting.words(),
                    "reason": found.reason,
                }
            )
        for row in pareto(rows):
            row["pareto"] = True
        return rows

    def model_errors(self) -> dict[str, float]:
        """Return theory ↦ least error of its settings where its own part is all of it: two rungs have the same."""
        out: dict[str, float] = {}
        for setting, found in self.measured.items():
            if found.answer is not None and self.reference is not None:
                out[setting.theory] = min(out.get(setting.theory, math.inf), self.error_of(found.answer)[0])
        return out


def _is_known(times: Sequence[float]) -> bool:
    """Return whether the median of some times is known to a part of it: 1.25 s/√n for normal errors."""
    return len(times) > 2 and 1.25 * float(np.std(times, ddof=1)) / len(times) ** 0.5 <= KNOWN * float(np.median(times))


def judged(row: Row) -> float:
    """Return the error that a setting is judged by; infinite where it is not known."""
    known = row["status"] == "done" and row["total_error"] is not None and math.isfinite(row["total_error"])
    return float(row["total_error"]) if known else math.inf


def pareto(rows: Iterable[Row]) -> list[Row]:
    """Return the rows for which no other one costs as little and is as exact, and is better in one; cheapest first."""
    front: list[Row] = []
    for row in sorted((r for r in rows if judged(r) < math.inf), key=lambda r: (r["cost"], judged(r))):
        if not front or judged(row) < judged(front[-1]):
            front.append(row)
    return front


def bound(row: Row, known: float) -> float:
    """Return the most that the error of a setting is, with a reference that is known to an error."""
    return judged(row) if row["at_most"] else judged(row) + known


def recommend(rows: Iterable[Row], accuracy: float, known: float = 0.0) -> Row | None:
    """Return the cheapest row whose error, with that of the reference, is within an accuracy; None without one."""
    return next((row for row in pareto(rows) if bound(row, known) <= accuracy), None)


def recommendations(rows: list[Row], accuracy: float, known: float) -> dict[str, Any]:
    """Return what a summary says of the settings to take.

    `recommended` is the row for the accuracy, `closest` the row with the least bound where there is none, with that,
    and `recommendations` are the rows for powers of ten, too.
    """
    wanted = sorted({1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, accuracy}, reverse=True)
    best = {a: recommend(rows, a, known) for a in wanted}
    nearest = min(pareto(rows), key=lambda row: bound(row, known), default=None) if math.isfinite(known) else None
    closest = None if nearest is None or best[accuracy] else {"within": bound(nearest, known), "row": nearest}
    listed = [{"accuracy": a, "setting": r and r["words"], "row": r} for a, r in best.items()]
    return {"recommended": best[accuracy], "closest": closest, "recommendations": listed}


@dataclass(repr=False)
class CostResult(Rows):
    """Outcome of `rotfem cost`.

    Attributes:
        summary: scene, output, reference and how well it is known (`uncertainty`), model errors, recommendation.
        rows: one dictionary a setting: `theory`, `elements`, `degree`, `scheme`, `step` (s), `tolerance`, `status`,
            `total_error` (distance to the reference, relative; with `at_most` a bound), `cost` (CPU time with set-up,
            median of `repeats`, s), `steps`, `pareto`, `words`, `reason`.
        scene: the scene studied.
    """

    scene: Scene = field(repr=False)
    dimension = "setting"
    figure = "accuracy.cost:cost_figure"

    @property
    def front(self) -> list[Row]:
        """The rows that no other one beats in both cost and error, cheapest first."""
        return sorted((row for row in self.rows if row["pareto"]), key=lambda row: float(row["cost"]))

    def recommend(self, accuracy: float) -> Row | None:
        """Return the row of least `cost` of those within a relative accuracy; None without one."""
        known = self.summary["uncertainty"]
        return None if known is None else recommend(self.rows, accuracy, known)

    def missed(self, accuracy: float | None = None) -> ComputationError:
        """Return the error of an accuracy that no setting is known to meet, that of the study if None."""
        wanted, near = self.summary["accuracy"] if accuracy is None else accuracy, self.summary["closest"]
        reached = "" if near is None else f": the nearest is known to be within {near['within']:.1e}"
        advice = "a larger --accuracy, or a larger --budget"
        return ComputationError(f"no setting is known to be within {wanted:g}{reached}", advice=advice)

    def write_tuned(self, path: str | Path, accuracy: float | None = None) -> Path:
        """Write the scene with the recommended setting: what was set in it, and the changes; return the path.

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
            f"# {self.scene.name}, tuned to a relative accuracy of {wanted:g} of {self.summary['output']}:\n"
            f"# {row['words']}.\n# Measured: error {said(row)}, {_cost(row)} with set-up.\n\n"
        )
        return write_variant(self.scene, changes_of(self.scene, row), Path(path), remark)

    def report(self) -> list[str]:
        """Return the lines `cost` prints: the table (its Pareto front, if long), model errors, the recommendation."""
        summary, known = self.summary, self.summary["uncertainty"]
        failed = sum(row["status"] == "failed" for row in self.rows)
        lines = [
            f"{summary['name']}: error of {summary['output']}, {len(self.rows)} settings ({failed} failed) in "
            f"{summary['timings']['total']:.1f} s",
            *(line for table in self.tables() for line in table.lines()),
            "* no other setting is both cheaper and more accurate"
            + ("" if len(self.rows) <= LONGEST_TABLE else "; all settings are in cost.csv"),
        ]
        if known is not None:
            lines.append(f"reference: {summary['reference']}, known to {percent(known)}")
        if refused := summary["budget"]["refused"]:
            lines.append(f"{len(refused)} ladders ended for want of time: {refused[0]['why']}")
        wanted = f"{summary['accuracy']:g}"
        if (row := summary["recommended"]) is not None:
            return [*lines, f"for a relative accuracy of {wanted}: {row['words']}; error {said(row)}, {_cost(row)}"]
        lines.append(f"no setting is known to be within {wanted} (relative)")
        if (near := summary["closest"]) is not None:
            lines.append(f"within {percent(near['within'])}: {near['row']['words']}, {_cost(near['row'])}")
        return lines

    def tables(self) -> list[ShortTable]:
        """Return one row a setting, cheapest first; of many settings those of the Pareto front."""
        rows = self.rows if len(self.rows) <= LONGEST_TABLE else self.front
        head = ("theory", "elements", "degree", "scheme", "step (s)", "CPU (s)", "error (%)", "")
        ordered = sorted(rows, key=lambda r: (r["status"] != "done", r["cost"] or 0.0))
        return [ShortTable(head, [_cells(row) for row in ordered])]

    def flat_rows(self) -> list[Row]:
        """Return the rows with numbers of elements as text where they are two."""
        return [{k: "x".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in self.rows]

    def texts(self) -> dict[str, str]:
        """Return cost.csv and cost.json."""
        keys = ("output", "reference", "uncertainty", "model_errors", "recommended", "recommendations")
        return {**super().texts(), "cost.json": json_text({**{k: self.summary[k] for k in keys}, "rows": self.rows})}


def changes_of(scene: Scene, row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scene's keys ↦ values of the setting of a row; rows of a history stay as far apart."""
    names = ("theory", "elements", "degree", "scheme", "step", "tolerance")
    out, time = Setting.read({name: row[name] for name in names if row[name] is not None}).changes(), scene.time
    out |= dict.fromkeys(("accuracy", "accuracy_budget"))
    if time is not None and row["scheme"] is not None:
        out |= {f"time.{name}": None for name in time.parameters if row["scheme"] != time.scheme}
        spacing = time.output_step or (time.step and time.step * time.output_every)
        out |= {"time.output_every": None, "time.min_step": None, "time.output_step": spacing}
    return out


def said(row: Row) -> str:
    """Return the error of a row as text, a bound with "≤"."""
    return ("≤ " if row["at_most"] else "") + percent(row["total_error"])


def _cost(row: Row) -> str:
    return f"{row['cost']:.3g} s of CPU time"


def _cells(row: Row) -> tuple[str, ...]:
    error, elements = row["status"], row["elements"]
    if error == "done":
        error = "unknown" if row["total_error"] is None else "≤ " * row["at_most"] + per_cent(row["total_error"])
    mesh = "–" if elements is None else "×".join(map(str, elements if isinstance(elements, list) else [elements]))
    steps = f"{row['step']:.3g}" if row["step"] is not None else "–"
    steps = f"tol {row['tolerance']:.2g}" if row["tolerance"] is not None else steps
    cost = "–" if row["cost"] is None else f"{row['cost']:.3g}"
    return (row["theory"], mesh, str(row["degree"]), row["scheme"] or "–", steps, cost, error, "*" * row["pareto"])


def cost_figure(result: CostResult) -> Figure:
    """Return error over CPU time: a line for the ladder of each theory and scheme, the reference's own error grey."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    figure, summary = Figure(figsize=(10, 6), layout="constrained"), result.summary
    axis, known = figure.add_subplot(), summary["uncertainty"]
    theories = list(dict.fromkeys(row["theory"] for row in result.rows))
    schemes = list(dict.fromkeys(str(row["scheme"] or "") for row in result.rows))
    for theory in theories:
        for scheme, marker in zip(schemes, "osD^Pv*X<>", strict=False):
            own = [r for r in result.rows if r["theory"] == theory and str(r["scheme"] or "") == scheme]
            done = sorted((r for r in own if judged(r) < math.inf), key=lambda r: float(r["cost"]))
            if done:
                style: dict[str, Any] = {"marker": marker, "color": f"C{theories.index(theory)}", "ms": 5, "lw": 0.8}
                label = ", ".join(filter(None, (theory, scheme)))
                axis.plot([r["cost"] for r in done], [max(judged(r), 1e-16) for r in done], label=label, **style)
    if (chosen := summary["recommended"]) is not None:
        circle: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": "black", "mew": 1.2, "ls": "none", "marker": "o"}
        label = f"recommended for {summary['accuracy']:g}:\n" + chosen["words"].replace(", ", "\n")
        axis.plot(chosen["cost"], max(judged(chosen), 1e-16), label=label, **circle)
    if known:
        axis.axhspan(0.0, known, color="0.85", zorder=-1, label=f"reference known to {known:.0e}")
    axis.axhline(summary["accuracy"], color="0.4", lw=0.8, ls="--", label=f"wanted: {summary['accuracy']:g}")
    axis.set(xscale="log", yscale="log", xlabel="CPU time of one run with its set-up, median (s)")
    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    axis.set_ylabel(ERRORS[summary["output"]])
    axis.set_title(f"{summary['name']}: what accuracy costs")
    axis.grid(True, which="both", lw=0.3, alpha=0.5)
    axis.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure
