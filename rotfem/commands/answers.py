"""What a verb adds to a result: its error, or an accuracy that it is led to."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, TypeVar

from mpi4py import MPI

from rotfem.accuracy.answer import Answer, Answers
from rotfem.accuracy.errors import ORDER_2, WORDS, Errors, estimate, warnings_of
from rotfem.accuracy.ladder import Clock, Walk, walk
from rotfem.commands.interrupts import together
from rotfem.errors import ComputationError, InputError, Stopped
from rotfem.listeners import Hint
from rotfem.results.result import Result
from rotfem.scene import Scene

R = TypeVar("R", bound=Result)

#: What `accuracy_of` calls the moment at the root.
ROOT_MOMENT = "root_moment"


def check_of(scene: Scene, wanted: tuple[str, ...], command: str) -> None:
    """Refuse an accuracy of something else than what a command computes, by its verb."""
    if scene.accuracy_of not in (None, *wanted):
        able = " or ".join(f'"{name}"' for name in wanted)
        reason = f'is not what "{command}" computes; it must be {able}, or not given'
        raise InputError("accuracy_of", scene.accuracy_of, reason)


def in_own_setting(scene: Scene) -> Scene:
    """Return a scene without its accuracy, with all effects where that would choose them, and with steps."""
    changes: dict[str, Any] = dict.fromkeys(("accuracy", "accuracy_of", "accuracy_budget"))
    if scene.time is not None:  # an accuracy may have given its steps
        tolerance = scene.time.tolerance or (1e-3 if scene.time.step is None else None)
        changes |= {"time.tolerance": tolerance, "time.step": scene.time.step}
    if scene.model.effects == "needed":
        changes["model.effects"] = "auto"
    return scene.replace(changes)


def clock_of(scene: Scene, comm: MPI.Comm, announce: Hint | None = None) -> Clock:
    """Return the clock of a scene's answers; rank 0 decides for all."""
    return Clock(scene.accuracy_budget, lambda x: float(comm.bcast(x)), announce)


def with_error(result: R, answers: Answers, own: Answer, comm: MPI.Comm, parts: bool = False) -> R:
    """Return a result with `error`, `settings` and the warnings of it in its summary; Ctrl-C leaves it without."""
    started, found = perf_counter(), dict[str, Any]()
    try:
        errors = estimate(answers, own, parts)
        found, said = (
            {"error": errors.summary(), "settings": errors.rows},
            warnings_of(errors, own.setting, answers.scene),
        )
    except KeyboardInterrupt as stop:
        if not together(comm, stop):
            raise
        said = ["its error was not estimated: interrupted"]
    timings = {**result.summary["timings"], "error": perf_counter() - started}
    return result.with_summary(**found, warnings=[*result.summary["warnings"], *said], timings=timings)


def to_accuracy(answers: Answers, of: str, clock: Clock, comm: MPI.Comm, finish: Callable[[Any, Errors], R]) -> R:
    """Return the first result down the ladder whose error is within the accuracy of a scene."""
    scene, found, started = answers.scene, Walk(), perf_counter()
    assert scene.accuracy is not None

    def best(**entries: Any) -> R:
        assert found.best is not None
        answer, errors = found.best
        result = finish(answer.outcome.result(), errors)
        how: dict[str, Any] = {
            "asked": scene.accuracy,
            "of": of,
            "met": found.met,
            "estimated": errors.total,
            "chosen": answer.setting.summary(),
            "attempts": [row for row in found.rows if not row.get("extrapolated")],
        }
        if clock.budget is not None:
            how["budget"] = clock.summary()
        total = perf_counter() - started
        timings = {**result.summary["timings"], "choice": max(0.0, total - result.summary["timings"]["total"])}
        more = {"error": errors.summary(), "settings": found.rows, "timings": {**timings, "total": total}}
        return result.with_summary(scene=scene.digest(), accuracy=how, **more, **entries)

    try:
        walk(answers, scene.accuracy, clock, found)
    except KeyboardInterrupt as stop:
        if found.best is not None and together(comm, stop):
            raise Stopped(best(status="interrupted")) from stop
        raise
    if found.met:
        return best()
    assert found.best is not None
    missed = _missed(scene, found.best[1], found.failure)
    failure = {"what": missed.what, "time": None, "advice": missed.advice}
    missed.result = best(status="failed", failure=failure)
    raise missed


def _missed(scene: Scene, errors: Errors, failure: ComputationError | None) -> ComputationError:
    """Return the error that says what the best answer reached instead of an accuracy, and what failed after it."""
    known = {name: part for name, part in errors.parts.items() if part is not None}
    unknown = [WORDS[name] for name in errors.parts if name not in known]
    worst = max(known, key=lambda name: known[name], default="discretisation")
    advice = {
        "model": f"a looser accuracy, or a richer model.theory than {scene.model.theory}",
        "geometry": f"a looser accuracy, or a mesh whose {ORDER_2}",
        "round_off": "a looser accuracy, or a section of less different stiffnesses",
    }.get(worst, "a looser accuracy" + (", or a finer mesh file" if scene.structure.mesh_file is not None else ""))
    if unknown:
        reached = f"the error of what was reached is not known ({', '.join([*unknown, *errors.unknown])})"
    else:
        reached = f"an error of {errors.total:.2g} was reached, most of it ({WORDS[worst]}) {known[worst]:.2g}"
    why = "" if failure is None else f", and a further attempt failed: {failure.what}"
    what = f"an accuracy of {scene.accuracy:g} was not met: {reached}{why}"
    return ComputationError(what, advice=(failure.advice if failure is not None else None) or advice)
