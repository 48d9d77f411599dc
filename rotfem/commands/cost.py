"""`rotfem cost`: what accuracy costs in time, down the ladder of each theory and each time-stepping scheme.

The reference is the last rung of the richest theory, known to the error of that (`rotfem.accuracy.ladder.reduced`). A
row that is nearer to the reference than this has it as its error, and is no better than others of which the same is
true.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from rotfem import registry
from rotfem.accuracy.answer import Answer, Answers, Setting, distance
from rotfem.accuracy.ladder import MOST_FAILURES, Clock, OverBudget, ladder, reduced
from rotfem.analysis.equilibrium import check_steady
from rotfem.commands.answers import in_own_setting
from rotfem.commands.explain import Output
from rotfem.commands.interrupts import together
from rotfem.commands.modes import analysis_of
from rotfem.commands.printed import LONGEST_TABLE, measured
from rotfem.commands.problem import Problem, motion_of
from rotfem.commands.processes import summary
from rotfem.commands.run import Simulation, rows_of
from rotfem.commands.run_store import RunStore
from rotfem.errors import ComputationError, InputError, SceneError, Stopped, input_of
from rotfem.listeners import Progress
from rotfem.mechanics.theories import theories as all_theories
from rotfem.results.columns import ShortTable, per_cent
from rotfem.results.distance import Spectrum
from rotfem.results.result import Row, Rows
from rotfem.scene import Scene
from rotfem.units import seconds_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Part of the accuracy that the reference is to be known to; ratio of the errors of two rungs (`accuracy.ladder`).
AIM, RATIO = 0.25, 6.0

#: Seconds below which a time is measured again, until its median is known to this part, or so often.
SHORT, KNOWN, MOST = 0.05, 0.1, 15

#: Seconds below which loading a form from disk counts, so that the first run with one is not timed.
LOADING = 1.0

#: A ladder ends where a rung is so many times as dear as the cheapest setting that is good enough.
DEARER = 4.0

#: Speeds of a Campbell diagram that is studied.
SPEEDS = 9

#: What an output's error is relative to.
ERRORS = {
    "tip": "error of the tip's motion in the rotating frame,\nrelative to its largest displacement (–)",
    "frequencies": "largest relative error of a frequency (–)",
    "campbell": "largest relative error of a frequency at any speed (–)",
}


def studied(
    scene: Scene,
    quick: bool,
    accuracy: float,
    output: str | None,
    budget: float | str | None,
    theories: Sequence[str] | None,
    schemes: Sequence[str] | None,
    comm: MPI.Comm,
    progress: Progress | None,
) -> CostResult:
    """Return errors and times down the ladders of a scene (see `rotfem.cost`)."""
    scene = in_own_setting(scene)
    output = checked(scene, accuracy, output)
    seconds = (120.0 if quick else 1200.0) if budget is None else seconds_of(budget, scene.file)
    named, tried, ways = chosen(scene, quick, theories, schemes)
    clock = Clock(seconds, lambda x: float(comm.bcast(x)), key="the budget")

    def compute(variant: Scene, times: Any) -> Any:
        if output != "tip":
            return eigenvalues(variant, output, comm)
        return Simulation(variant, Problem.of(variant), RunStore(comm), clock, times).compute()

    def fresh() -> Answers:
        out = Answers(scene, compute, moving=output == "tip")
        out.times = rows_of(scene) if output == "tip" else None
        return out

    study = Study(fresh, accuracy, clock, comm, progress or (lambda share: None))

    def result(status: str) -> CostResult:
        rows, known, reference = study.rows(), study.known, study.reference
        able = [row for row in rows if row["theory"] in named]
        found: dict[str, Any] = {
            **summary("cost", scene, comm),
            "status": status,
            "output": output,
            "quick": quick,
            "accuracy": accuracy,
            "reference": None if reference is None else reference.setting.words(),
            "uncertainty": known if math.isfinite(known) else None,
            "model_errors": least(rows),
            "recommended": recommend(able, accuracy, known),
            "closest": nearest(able, accuracy, known),
            "settings": len(rows),
            "failed": sum(row["status"] == "failed" for row in rows),
            "budget": {"seconds": seconds, "used": clock.used(), "refused": study.refused},
            "timings": {"total": clock.used()},
            "warnings": [] if math.isfinite(known) else ["all errors are unknown, as that of the reference is"],
        }
        return CostResult(found, rows, scene)

    with input_of(scene.file):
        try:
            study.climb(tried, ways)
        except KeyboardInterrupt as stop:
            if study.reference is None or not together(comm, stop):
                raise
            raise Stopped(result("interrupted")) from stop
    if study.reference is None:
        reasons = [m.reason for m in study.measured.values() if m.reason] or [r["why"] for r in study.refused]
        raise ComputationError(f"no setting could be computed ({reasons[-1] if reasons else 'nothing was tried'})")
    if not study.reference.output.scale:
        raise SceneError(scene.file, "cost --of", output, 'nothing moves; try "frequencies"')
    return result("done")


def eigenvalues(variant: Scene, output: str, comm: MPI.Comm) -> Output:
    """Return the eigenvalues of a scene by size, at its final speed or at those of a Campbell diagram."""
    problem, top = Problem.of(variant), None if variant.time is None else variant.time.end
    speeds = [problem.motion.final_speed(top or 0.0)]
    if output == "campbell":
        speeds = [motion_of(variant).top_speed(top) * i / (SPEEDS - 1) for i in range(SPEEDS)]
        problem = problem.spinning()
    analysis, count = analysis_of(variant, problem, comm), variant.modes.count
    return Output(Spectrum(np.concatenate([analysis.at(s, count).pairs.values[:count] for s in speeds])))


# --- what is tried ----------------------------------------------------------------------------------------------------


def checked(scene: Scene, accuracy: float, output: str | None) -> str:
    """Return the output that is compared."""
    top = motion_of(scene).top_speed(None if scene.time is None else scene.time.end)
    if not 0 < accuracy < math.inf:
        raise SceneError(scene.file, "cost --accuracy", accuracy, "must be a number greater than 0")
    if output is None:  # what the scene computes
        steady = scene.motion.is_steady and not scene.modes.model_fields_set
        at_rest = not (motion_of(scene).is_spinning or scene.loads.model_fields_set)
        output = "frequencies" if scene.time is None and (at_rest or not steady) else "tip"
    if output not in ERRORS:
        raise SceneError(scene.file, "cost --of", output, f"allowed: {', '.join(ERRORS)}")
    if output == "tip":
        scene.check_run()
        if scene.time is None:
            check_steady(Problem.of(scene))
    if output == "campbell" and not top > 0.0:
        raise SceneError(scene.file, "cost --of", "campbell", "the scene has no speed to go up to")
    return output


def chosen(
    scene: Scene, quick: bool, theories: Sequence[str] | None, schemes: Sequence[str] | None
) -> tuple[list[str], list[str], list[str]]:
    """Return the theories to recommend, those to try, poorest first, and the schemes, that of the reference first."""
    own, time = scene.model.theory, scene.time
    there = [t for t in all_theories() if t.holds_for(scene.structure.type)]
    if scene.model.frame == "inertial":
        there = [t for t in there if t.name == own]
    if schemes and time is None:
        raise SceneError(scene.file, "time", None, "missing; schemes have a meaning only with [time]")
    unset = {} if time is None else {f"time.{name}": None for name in time.parameters}
    for option, key, name in [
        *(("theories", "model.theory", name) for name in theories or ()),
        *(("schemes", "time.scheme", name) for name in schemes or ()),
    ]:
        try:
            Problem.of(scene.replace({"model.prestress": None, **(unset if option == "schemes" else {}), key: name}))
        except SceneError as error:
            raise SceneError(scene.file, f"cost --{option}", name, error.allowed) from None
    named = list(theories or [t.name for t in there if not quick or t.quick or t.name == own])
    ways = schemes or ([time.scheme] if quick and time is not None else registry.schemes.names)
    wanted = [t.name for t in there if t.name in named or t is there[-1]]
    return named, wanted, list(dict.fromkeys(("esdirk4", *ways)))


# --- what is measured -------------------------------------------------------------------------------------------------


@dataclass
class Measured:
    """The answer with a setting and the median of its times, how many there are, and why there is no answer."""

    answer: Answer | None
    repeats: int = 0
    reason: str = ""


class Study:
    """The ladders of a scene.

    Args:
        fresh: returns answers of the scene of which none is computed.
        accuracy: relative.
        clock: of all answers.
        comm: of all processes; the first one's times are those of all.
        progress: called with the share of the ladders that are climbed.

    Attributes:
        measured: setting ↦ what was measured of it.
        reference: answer that errors are measured against; None before there is one.
        known: error of that, relative; infinite if it is unknown.
        refused: settings that the budget left out, with why.
    """

    def __init__(self, fresh: Callable[[], Answers], accuracy: float, clock: Clock, comm: MPI.Comm, progress: Progress):
        self.fresh, self.accuracy, self.clock, self.comm, self.progress = fresh, accuracy, clock, comm, progress
        self.scene, self.moving = (answers := fresh()).scene, answers.moving
        self.measured, self.refused = dict[Setting, Measured](), list[dict[str, Any]]()
        self.reference: Answer | None = None
        self.known = math.inf
        self._loaded: set[tuple[Any, ...]] = set()

    def climb(self, theories: Sequence[str], schemes: Sequence[str]) -> None:
        """Measure the ladder of each theory, the richest first, by each scheme, and the scene's own setting.

        Args:
            theories: from the poorest to the richest.
            schemes: of the steps, the one of the reference first.
        """
        ways = [(theory, scheme) for theory in reversed(theories) for scheme in schemes[: None if self.moving else 1]]
        own = Setting.of(self.scene, self.moving)
        for i, (theory, scheme) in enumerate(ways):
            (self._refer if self.reference is None else self._follow)(self._rungs(theory, scheme))
            if i == 0 and own.theory in theories and own.scheme in (None, *schemes):
                self._attempt(own, None)
            self.progress((i + 1) / len(ways))

    def _refer(self, rungs: Iterator[Answer]) -> None:
        """Go down a ladder until its last rung, the reference, is known to a part of the accuracy."""
        for answer in rungs:
            if self.reference is not None:
                self.known = reduced(distance(answer, self.reference).size, self.known, RATIO)
            self.reference = answer
            if self.known <= AIM * self.accuracy:
                return

    def _follow(self, rungs: Iterator[Answer]) -> None:
        """Go down a ladder until a rung is good enough, or two have about the error of the one before: the theory's."""
        error, stuck = math.inf, 0
        for answer in rungs:
            last, (error, _) = error, self.error_of(answer)
            stuck = stuck + 1 if error > 0.5 * last else 0
            if error <= max(AIM * self.accuracy, self.known) or stuck == 2:
                return

    def _rungs(self, theory: str, scheme: str) -> Iterator[Answer]:
        """Yield the answers down a ladder, until one is too dear or fails."""
        before: Answer | None = None
        failures, first = 0, self.reference is None
        for setting in ladder(self.scene, theory, scheme, self.moving):
            predicted = None if before is None else 2.0 * before.seconds
            if predicted is not None and predicted > DEARER * self._enough():
                return
            found = self._attempt(setting, predicted)
            if found is None:
                return
            if found.answer is not None:
                before = found.answer
                yield before
                continue
            failures += 1
            if before is not None or (failures == MOST_FAILURES and not first):
                return

    def _enough(self) -> float:
        """Return the time (s) of the cheapest setting that is good enough; infinite without one."""
        row = recommend(self.rows(), self.accuracy, self.known)
        return math.inf if row is None else float(row["cost"])

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
        answer, forms = self.fresh()(setting), (setting.theory, setting.degree, setting.scheme)
        first = float(self.comm.bcast(answer.seconds))
        times = [] if forms not in self._loaded and first < LOADING else [first]
        self._loaded.add(forms)
        while not times or (np.median(times) < SHORT and len(times) < MOST and not _is_known(times)):
            times.append(float(self.comm.bcast(self.fresh()(setting).seconds)))
        return Measured(replace(answer, seconds=float(np.median(times))), len(times))

    def rows(self) -> list[Row]:
        """Return a row for each setting that was computed; errors are unknown where that of the reference is."""
        rows = []
        for setting, found in self.measured.items():
            answer, error, at_most = found.answer, None, False
            if answer is not None and math.isfinite(self.known):
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


def _is_known(times: Sequence[float]) -> bool:
    """Return whether the median of some times is known to a part of it: 1.25 s/√n for normal errors."""
    return len(times) > 2 and 1.25 * float(np.std(times, ddof=1)) / len(times) ** 0.5 <= KNOWN * float(np.median(times))


# --- what follows from it ---------------------------------------------------------------------------------------------


def known_rows(rows: Iterable[Row]) -> list[Row]:
    """Return the rows whose error is known, cheapest first."""
    known = [row for row in rows if row["total_error"] is not None and math.isfinite(row["total_error"])]
    return sorted(known, key=lambda row: (row["cost"], row["total_error"]))


def pareto(rows: Iterable[Row]) -> list[Row]:
    """Return the rows for which no other one costs as little and is as exact, and is better in one; cheapest first."""
    front: list[Row] = []
    for row in known_rows(rows):
        if not front or row["total_error"] < front[-1]["total_error"]:
            front.append(row)
    return front


def least(rows: Iterable[Row]) -> dict[str, float]:
    """Return theory ↦ least error of its settings: where two rungs have the same, that of the theory."""
    out: dict[str, float] = {}
    for row in known_rows(rows):
        out[row["theory"]] = min(out.get(row["theory"], math.inf), row["total_error"])
    return out


def bound(row: Row, known: float) -> float:
    """Return the most that the error of a setting is, with a reference that is known to an error."""
    return float(row["total_error"]) if row["at_most"] else float(row["total_error"]) + known


def recommend(rows: Iterable[Row], accuracy: float, known: float = 0.0) -> Row | None:
    """Return the cheapest row whose error, with that of the reference, is within an accuracy; None without one."""
    return next((row for row in pareto(rows) if bound(row, known) <= accuracy), None)


def nearest(rows: list[Row], accuracy: float, known: float) -> dict[str, Any] | None:
    """Return the row with the least bound, and that, where no row is within an accuracy."""
    row = min(pareto(rows), key=lambda row: bound(row, known), default=None)
    return None if row is None or bound(row, known) <= accuracy else {"within": bound(row, known), "row": row}


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
    figure = "commands.cost:cost_figure"

    @property
    def front(self) -> list[Row]:
        """The rows that no other one beats in both cost and error, cheapest first."""
        return pareto(self.rows)

    def recommend(self, accuracy: float) -> Row | None:
        """Return the row of least `cost` of those within a relative accuracy; None without one."""
        return recommend(self.rows, accuracy, self.summary["uncertainty"] or 0.0)

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
            f"# {row['words']}.\n# Measured: {measured(row)} with set-up.\n\n"
        )
        return self.scene.replace(changes_of(self.scene, row)).write(path, remark)

    def tables(self) -> list[ShortTable]:
        """Return one row a setting, cheapest first; of many settings those of the Pareto front."""
        rows = self.rows if len(self.rows) <= LONGEST_TABLE else self.front
        head = ("theory", "elements", "degree", "scheme", "step (s)", "CPU (s)", "error (%)", "")
        ordered = sorted(rows, key=lambda r: (r["status"] != "done", r["cost"] or 0.0))
        return [ShortTable(head, [_cells(row) for row in ordered])]

    def flat_rows(self) -> list[Row]:
        """Return the rows with numbers of elements as text where they are two."""
        return [{k: "x".join(map(str, v)) if isinstance(v, list) else v for k, v in row.items()} for row in self.rows]


def changes_of(scene: Scene, row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the scene's keys ↦ values of the setting of a row; rows of a history stay as far apart."""
    names = ("theory", "elements", "degree", "scheme", "step", "tolerance")
    out = Setting.read({name: row[name] for name in names if row[name] is not None}).changes(scene)
    if (time := scene.time) is not None and row["scheme"] is not None:
        spacing = time.output_step or (time.step and time.step * time.output_every)
        out |= {"time.output_every": None, "time.min_step": None, "time.output_step": spacing}
    return out


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

    figure, summary, rows = Figure(figsize=(10, 6), layout="constrained"), result.summary, known_rows(result.rows)
    axis, known = figure.add_subplot(), summary["uncertainty"]
    theories, schemes = (list(dict.fromkeys(row[key] for row in result.rows)) for key in ("theory", "scheme"))
    asked = Setting.of(result.scene, summary["output"] == "tip").words()
    for theory, scheme in sorted({(row["theory"], row["scheme"]) for row in rows}, key=str):
        own = [row for row in result.rows if row in rows and (row["theory"], row["scheme"]) == (theory, scheme)]
        style: dict[str, Any] = {"marker": "osD^Pv*X<>"[schemes.index(scheme) % 10], "ms": 5, "lw": 0.8}
        style |= {"color": f"C{theories.index(theory)}", "label": ", ".join(filter(None, (theory, scheme)))}
        axis.plot(*_places([row for row in own if row["words"] != asked]), **style)
    axis.plot(*_places([row for row in rows if row["words"] == asked]), "kx", ms=8, mew=1.5, label="the scene's own")
    if (chosen := summary["recommended"]) is not None:
        circle: dict[str, Any] = {"ms": 14, "mfc": "none", "mec": "black", "mew": 1.2, "ls": "none", "marker": "o"}
        label = f"recommended for {summary['accuracy']:g}:\n" + chosen["words"].replace(", ", "\n")
        axis.plot(*_places([chosen]), label=label, **circle)
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


def _places(rows: list[Row]) -> tuple[list[float], list[float]]:
    return [row["cost"] for row in rows], [max(row["total_error"], 1e-16) for row in rows]
