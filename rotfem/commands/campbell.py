"""`rotfem campbell`: modes over speed, named once, with critical speeds and the onset of instability."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.accuracy.answer import Setting
from rotfem.accuracy.errors import Errors, warnings_of
from rotfem.accuracy.modes import modal_errors
from rotfem.analysis.branches import SPARE, SpeedPoint, Sweep, synchronous
from rotfem.analysis.modal import ModalAnalysis, Spinning, self_checks
from rotfem.analysis.reduced_basis import over_range
from rotfem.commands.advice import beyond, frozen_inputs
from rotfem.commands.interrupts import together
from rotfem.commands.mode_tables import advice, doubtful, mode_rows
from rotfem.commands.modes import analysis_of, answered, hints_of
from rotfem.commands.problem import Problem
from rotfem.commands.processes import modal_summary
from rotfem.commands.recorder import check_rows
from rotfem.errors import ComputationError, InputError, SceneError, Stopped
from rotfem.listeners import Hint, Progress
from rotfem.mechanics.effects import Work
from rotfem.numerics.eigenproblem import Eigenpairs
from rotfem.results.campbell import CampbellResult
from rotfem.results.files import json_text, writing
from rotfem.scene import Scene
from rotfem.scene.values import LARGEST
from rotfem.structures.mode_names import distinct, ordinal_ending
from rotfem.units import speed_text, split_unit
from rotfem.version import __version__

Array = npt.NDArray[Any]

#: What eigenpairs are made of.
PAIRS = ("values", "right", "left", "errors", "bounds")


def parse_speeds(given: Sequence[float] | str) -> list[float]:
    """Return speeds (rad/s), also of "first:last:number" or "s1,s2,…", with the unit of all of them at the end."""
    text = given if isinstance(given, str) else ",".join(repr(float(s)) for s in given)
    allowed = (
        "must be first:last:number (number at least 2) or a list s1,s2,… of at least two increasing speeds (rad/s), "
        "with a unit such as rpm at the end if they are in another one"
    )
    speeds: Array = np.empty(0)
    with suppress(ValueError), np.errstate(invalid="ignore"):
        numbers, unit = split_unit(text)
        if ":" in numbers:
            first, last, number = numbers.split(":")
            speeds = np.linspace(float(first) * unit, float(last) * unit, int(number))
        else:
            speeds = np.array([float(s) * unit for s in numbers.split(",")])
    if len(speeds) < 2 or not np.all(np.abs(speeds) <= LARGEST) or np.any(np.diff(speeds) <= 0):
        raise SceneError("command line", "--speeds", text, allowed)
    return [float(s) for s in speeds]


def campbell_of(
    scene: Scene,
    speeds: Sequence[float] | str,
    marks: Mapping[str, Any],
    only: bool,
    map: Mapping[str, Sequence[float]] | str | None,
    comm: MPI.Comm,
    folder: Path | None,
    progress: Progress | None,
    hint: Hint | None,
    terms: Mapping[str, Work] | None,
) -> CampbellResult:
    """Return the modes of a scene followed over speed (see `rotfem.campbell`); marks are keys of the scene."""
    given = {key: list(mark) if isinstance(mark, tuple) else mark for key, mark in marks.items() if mark is not None}
    scene = scene.showing("speed", speeds).replace(given)
    values = parse_speeds(speeds)

    def compute(variant: Scene, *_: Any) -> CampbellResult:
        started, problem = perf_counter(), Problem.of(variant, terms=terms).spinning()
        analysis = analysis_of(variant, problem, comm)
        kept = None if folder is None or analysis.comm.size > 1 else FinishedSpeeds(folder, variant)
        result = diagram(variant, analysis, values, started, progress, hint, only, kept)
        if map is not None:
            result.summary["map"] = critical_map(variant, *mapped(map), max(-values[0], values[-1]), comm)
        return result

    return answered(scene, compute, comm, terms, top=True)


def mapped(given: Mapping[str, Sequence[float]] | str) -> tuple[str, list[float]]:
    """Return the key and the values of a map of critical speeds."""
    if not isinstance(given, str):
        ((key, values),) = given.items()
        return key, [float(value) for value in values]
    key, _, text = given.partition("=")
    with suppress(ValueError), np.errstate(invalid="ignore", divide="ignore"):
        first, last, number = text.split(":")
        found = np.geomspace(float(first), float(last), int(number))
        if 0.0 < found[0] < found[-1] < np.inf:
            return key, [float(value) for value in found]
    why = "must be KEY=FIRST:LAST:NUMBER, as structure.supports.*.stiffness=1e6:1e9:20, with 0 < FIRST < LAST"
    raise SceneError("command line", "--map", given, why)


def critical_map(scene: Scene, key: str, values: Sequence[float], top: float, comm: MPI.Comm) -> dict[str, Any]:
    """Return the first undamped critical speeds of a shaft over the values of a scene key: `key` and `rows`."""
    rows = []
    for value in values:
        variant = scene.replace({key: value})
        problem = Problem.of(variant).spinning()
        kept = tuple(name for name in problem.effective_effects() if name not in ("damping", "support_dampers"))
        analysis = analysis_of(variant, problem.replace(effects=kept), comm)
        found = synchronous(analysis, top, scene.modes.count)
        if found is None:
            why = "is of round shafts that bearings of constant stiffness hold, with up to 2000 unknowns"
            raise InputError("map", key, why)
        named = ({"kind": way, "label": f"{n}{ordinal_ending(n)} {way} whirl", "speed": s} for s, way, n in found)
        rows += [{"value": value, **row} for row in named]
    return {"key": key, "rows": rows}


def diagram(
    scene: Scene,
    analysis: ModalAnalysis,
    values: Sequence[float],
    started: float,
    progress: Progress | None,
    hint: Hint | None,
    only: bool,
    kept: FinishedSpeeds | None,
) -> CampbellResult:
    """Return the branches over speed, with what the diagram says."""
    fastest, marks, count = max(map(abs, values)), scene.modes, scene.modes.count
    hints = hints_of(analysis, scene, hint, fastest)
    sweep = Sweep(analysis, count, only, over_range(analysis, values, count + SPARE))
    if sweep.model is None and kept is not None:
        sweep.known = kept.load(analysis)
    stopped: ComputationError | KeyboardInterrupt | None = None
    try:
        sweep.run(values, progress or (lambda share: None))
        orders, crossings, onsets = meetings(sweep, marks.orders)
    except (ComputationError, KeyboardInterrupt) as stop:
        if isinstance(stop, KeyboardInterrupt) and not together(analysis.everyone, stop):
            raise
        if kept is not None:
            kept.save(sweep.points)
        if len(sweep.points) < 2:
            raise
        stopped, sweep.only = stop, True
        orders, crossings, onsets = meetings(sweep, marks.orders)
    labels, last = branch_labels(sweep), sweep.points[-1]
    errors = branch_errors(scene, analysis, sweep) if scene.output.error and stopped is None else None
    mesh = None if errors is None else errors.each
    rows = [row for point in sweep.points for row in point_rows(point, labels, mesh)]
    check_rows(rows)
    for crossing in crossings:
        if "label" in crossing:  # of no branch, it is known by its name
            crossing["branch"] = 1 + labels.index(crossing["label"]) if crossing["label"] in labels else 0
        else:
            crossing["label"] = labels[crossing["branch"] - 1]
    goes_on = "" if kept is None else "; the same command goes on from there"
    done = f"{sum(p.requested for p in sweep.points)} of {len(values)} speeds are finished, up to "
    warnings = [
        *advice(analysis, fastest),
        *frozen_inputs(analysis.problem),
        *beyond(analysis.problem, *([row[name] for row in rows] for name in ("speed", "frequency"))),
        *remarks(sweep, labels, onsets),
        *(f"at {speed_text(last.speed)}, {text}" for text in doubtful([r for r in rows if r["speed"] == last.speed])),
        *([] if stopped is None else [f"{done}{speed_text(last.speed)}{goes_on}"]),
        *([] if errors is None else warnings_of(errors, Setting.of(scene, moving=False), scene)),
    ]
    basis = None if sweep.model is None else {"columns": sweep.model.lift[0].shape[1], "checks": sweep.model.checks}
    more = {
        "status": None if stopped is None else "failed" if isinstance(stopped, ComputationError) else "interrupted",
        "rated": marks.rated,
        "operating": None if marks.operating is None else list(marks.operating),
        "error": None if errors is None else errors.summary(),
        "reduced_basis": basis,
    }
    summary = {
        **modal_summary("campbell", analysis, scene, started),
        "branches": [
            {
                "branch": b + 1,
                "label": label,
                "confidence": min(float(point.confidence[b]) for point in sweep.points),
                "frequency_first": _finite(sweep.points[0].value(b).imag),
                "frequency_last": _finite(last.value(b).imag),
            }
            for b, label in enumerate(labels)
        ],
        "per_rev": max(orders, default=0),
        "orders": list(orders),
        "critical_speeds": crossings,
        "instabilities": onsets,
        "ambiguous": sweep.ambiguous,
        "speeds": len(values),
        "speeds_inserted": sweep.inserted,
        "speeds_solved": sweep.solves,
        "checks": self_checks(last.spinning),
        "lowest_frequency": min((row["frequency"] for row in rows if row["frequency"] > 0), default=0.0),
        "warnings": warnings,
        "advice": hints,
        **{name: value for name, value in more.items() if value is not None},
    }
    result = CampbellResult(summary, rows)
    if isinstance(stopped, ComputationError):
        stopped.result = result
        raise stopped
    if stopped is not None:
        raise Stopped(result) from stopped
    if kept is not None:
        kept.remove()
    return result


def meetings(
    sweep: Sweep, orders: Sequence[int] | None
) -> tuple[Sequence[int], list[dict[str, Any]], list[dict[str, Any]]]:
    """Return the orders k of the lines kΩ, critical speeds and ranges of instability."""
    sweep.count = min(sweep.count, len(sweep.points[0].order))
    if orders is None and sweep.analysis.fixed:
        orders = (1, 2)
    elif orders is None:
        fastest = max(abs(point.speed) for point in sweep.points)
        highest = np.nanmax([point.value(b).imag for point in sweep.points for b in range(sweep.count)])
        orders = range(1, 1 + int(np.clip(np.ceil(highest / max(fastest, 1e-300)), 1, 4)))
    ranges = sweep.onsets()
    return orders, sweep.critical_speeds(orders, ranges), ranges


class FinishedSpeeds:
    """The modes at speeds of a diagram that was interrupted, in a file of its result folder.

    Args:
        folder: the result folder.
        scene: what they are of; modes of another scene, or of another version of rotfem, are not taken.
    """

    def __init__(self, folder: Path, scene: Scene):
        self._path = folder / "speeds.npz"
        self._key = hashlib.sha256(json_text([__version__, scene.to_dict()]).encode()).hexdigest()

    def load(self, analysis: ModalAnalysis) -> dict[float, Spinning]:
        """Return speed ↦ modes there; none where there is no file of this scene."""
        if not self._path.exists():
            return {}
        with np.load(self._path) as file:
            arrays = dict(file)
        out = dict[float, Spinning]()
        for i, speed in enumerate(arrays["speeds"].tolist() if str(arrays["key"]) == self._key else []):
            q, *pairs = (arrays[f"{name}_{i}"] for name in ("q", *PAIRS))
            out[speed] = analysis.restored(speed, q, Eigenpairs(*pairs), bool(arrays["rigid"][i]))
        return out

    def save(self, points: Sequence[SpeedPoint]) -> None:
        """Keep the modes of some points, but for those whose rotations are counted from a deformed shape."""
        done = [point.spinning for point in points if point.spinning.reference is None]
        if MPI.COMM_WORLD.rank > 0 or not done:
            return
        arrays: dict[str, Any] = {"key": self._key, "speeds": [s.speed for s in done], "rigid": [s.rigid for s in done]}
        for i, s in enumerate(done):
            arrays |= {f"q_{i}": s.q, **{f"{name}_{i}": getattr(s.pairs, name) for name in PAIRS}}
        new = self._path.with_name(".rotfem-speeds.npz")
        with writing(self._path):
            np.savez(new, **arrays)
            new.replace(self._path)

    def remove(self) -> None:
        """Remove the file of a diagram that is finished."""
        if MPI.COMM_WORLD.rank == 0:
            self._path.unlink(missing_ok=True)


def remarks(sweep: Sweep, labels: list[str], onsets: list[dict[str, Any]]) -> list[str]:
    """Return warnings of branches that were lost or are unsure, and of instabilities."""
    last, out = sweep.points[-1].order, list[str]()
    lost = [label for b, label in enumerate(labels) if last[b] < 0]
    out += [f"{name} left the computed modes before the last speed; a larger modes.count keeps it" for name in lost]
    out += [
        f"ambiguous: {labels[int(a['branch']) - 1]} at {speed_text(a['speed'])}, correlation {a['confidence']:.2f}"
        for a in sweep.ambiguous
    ]
    out += [
        f"{onset['kind']} from {speed_text(onset['speed'], 8)} "
        + ("on" if onset["until"] is None else f"to {speed_text(onset['until'], 8)}")
        for onset in onsets
    ]
    if sweep.only and sweep.model is None:
        out.append("critical speeds and onsets of instability are interpolated between the speeds that were solved")
    return out


def branch_labels(sweep: Sweep) -> list[str]:
    """Return the names of the branches: of their modes at the first speed, of a rotor where most of them precess."""

    def precessing(point: SpeedPoint) -> tuple[int, int]:
        there = [b for b in range(sweep.count) if point.order[b] >= 0]
        return len(there), sum(sweep.direction(point, b) != "" for b in there)

    point = max(sweep.points, key=precessing)  # the first of several
    names = point.spinning.names
    return distinct([names[point.order[b]] for b in range(sweep.count)])


def _finite(value: float) -> float | None:
    """Return a number; None for one that is none, as of a branch that is lost."""
    return float(value) if np.isfinite(value) else None


def branch_errors(scene: Scene, analysis: ModalAnalysis, sweep: Sweep) -> Errors:
    """Return the errors of the branches, the larger ones of those at both ends; `each` is that by the mesh."""
    found, each, compiled = list[Errors](), list[list[float]](), dict[str, ModalAnalysis]()
    for point in (sweep.points[0], sweep.points[-1]):
        order = [int(i) for i in point.order[: sweep.count]]
        # What the mesh does to modes far above would be taken for errors of these.
        found.append(modal_errors(scene, analysis, point.spinning.first(1 + max(order)), compiled=compiled))
        there = found[-1].each
        each.append([np.nan if i < 0 or (e := there[i]) is None else e for i in order])
    worst = max(found, key=lambda errors: np.inf if errors.total is None else errors.total)
    return replace(worst, each=list(map(_finite, np.fmax(*np.array(each)))))


def point_rows(point: SpeedPoint, labels: list[str], mesh: Sequence[float | None] | None) -> list[dict[str, Any]]:
    """Return one row a branch at one speed; `mode` is its present name, `label` the name of the branch."""
    columns, rows = mode_rows(point.spinning.first(1 + max(point.order[: len(labels)]))), []
    own = ["frequency", "frequency_hz", "damping", "growth", "residual", "error_bound"]
    of_rotors = ["turning", "whirl", "frequency_fixed", "frequency_fixed_2", "log_decrement"]
    for b, label in enumerate(labels):
        if point.order[b] < 0:
            continue
        row = columns[point.order[b]]
        rows.append(
            {
                "speed": point.speed,
                "branch": b + 1,
                "label": label,
                "mode": row["label"],
                **{name: row[name] for name in own},
                **({} if mesh is None else {"mesh_error": mesh[b]}),
                **{k: v for k, v in row.items() if k.startswith("share_") or k in of_rotors},
                "confidence": float(point.confidence[b]),
                "refined": int(not point.requested),
            }
        )
    return rows
