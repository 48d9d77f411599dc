"""An accuracy that a scene asks for: the setting to begin with, its keys, and how it was met."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any, TypeVar

from rotfem.commands.interrupts import together
from rotfem.errors import ComputationError, InputError, Stopped
from rotfem.mechanics.theories import Theory, theories
from rotfem.refinement.estimate import WORDS
from rotfem.refinement.refine import COARSE, SAFETY, Clock, Refinement, Setting, contribution, is_within, refine
from rotfem.results.result import Result
from rotfem.scene import Scene

R = TypeVar("R", bound=Result)

#: What `accuracy_of` calls the moment at the root.
ROOT_MOMENT = "root_moment"

#: First tolerance of the steps, of the accuracy: what is reported, the difference to doubled steps, is 3 to 15 times
#: the error (orders 2 to 4), and that is led to about half of the tolerance.
FIRST = 0.25

#: Rows of a history that does not say it.
ROWS = 1000


class Missed(ComputationError):
    """No setting was found that meets the accuracy."""


def first_setting(scene: Scene, modes: int = 0) -> Setting:
    """Return the setting that a scene is first computed with: on beams 30 nodes, or four for every mode.

    Args:
        scene: with an accuracy.
        modes: number of modes that are wanted; 0 of a run.
    """
    mesh, nodes, time = scene.mesh, max(30, 4 * modes), None if modes else scene.time  # four nodes for every mode
    elements: Any = None
    if scene.structure.mesh_file is None:
        if isinstance(mesh.elements, tuple):
            elements = mesh.elements if time is None else coarsened(mesh.elements, mesh.degree)
        else:
            elements = -(-nodes // mesh.degree)
    first = Setting(({"theory": scene.model.theory},), elements, degree_of(scene))
    if time is None:
        return first
    assert scene.accuracy is not None
    least = 0.0 if scene.accuracy_budget is None else COARSE
    return replace(first, scheme="esdirk4", tolerance=max(FIRST * scene.accuracy, least))


def degree_of(scene: Scene) -> int:
    """Return the degree of a scene's elements; 3 if it names none for a mesh file: none of its cells locks then."""
    given = scene.structure.mesh_file is None or "degree" in scene.mesh.model_fields_set
    return scene.mesh.degree if given else 3


def coarsened(elements: tuple[int, int], degree: int) -> tuple[int, int]:
    """Return cells of a plate like those of a scene: 24 nodes along the longer edge, and three across if there are."""
    growth = min(1.0, 24 / degree / max(elements))
    x, y = (max(math.ceil(n * growth), min(n, 3)) for n in elements)
    return x, y


def linear_of(scene: Scene) -> Theory | None:
    """Return the linear theory in the family of a scene's own, the one with stress stiffness; None without one."""
    named = {theory.name: theory for theory in theories() if theory.holds_for(scene.structure.type)}
    own = named[scene.model.theory]
    return own if own.linear else next((named[n] for n in own.poorer if n in named and named[n].prestress), None)


def refuse(scene: Scene, wanted: tuple[str, ...], command: str) -> None:
    """Refuse an accuracy of something else than what a command computes, by its verb.

    Raises:
        InputError: the scene asks for another.
    """
    if scene.accuracy_of not in (None, *wanted):
        able = " or ".join(f'"{name}"' for name in wanted)
        reason = f'is not what "{command}" computes; it must be {able}, or not given'
        raise InputError("accuracy_of", scene.accuracy_of, reason)


def changes_of(scene: Scene, setting: Setting) -> dict[str, Any]:
    """Return the keys ↦ values that make a scene one with this setting; None removes what it says."""
    out: dict[str, Any] = setting.changes()
    time = scene.time
    if setting.moving and time is not None:
        out |= {f"time.{name}": None for name in time.parameters if setting.scheme != time.scheme}
        out |= {"time.output_every": None, "time.output_step": time.output_step or time.end / ROWS}
        if time.output_step is None and time.step is not None:
            out["time.output_step"] = time.step * time.output_every
    return out


def to_accuracy(scene: Scene, first: Setting, compute: Callable[[Setting], R], clock: Clock) -> R:
    """Return the first result whose error is within the accuracy of a scene.

    Args:
        scene: with an accuracy.
        first: setting to begin with.
        compute: setting ↦ its result, with an `error` in its summary.
        clock: of all of them.

    Raises:
        Missed: none was found; its attribute `result` holds the best that was reached.
        ComputationError: nothing was reached.
        Stopped: its attribute `result` holds the best that was reached.
        KeyboardInterrupt: nothing was, or the ranks do not agree.
    """
    started, found, accuracy = perf_counter(), Refinement[R](), scene.accuracy
    assert accuracy is not None

    def answer(setting: Setting) -> tuple[R, dict[str, Any]]:
        done = compute(setting)
        return done, done.summary["error"]

    def best(**entries: Any) -> R:
        """Return the best result, with how it was found in its summary."""
        assert found.best is not None
        result, error = found.best.result, found.best.error
        how = {
            "asked": accuracy,
            "of": scene.accuracy_of or ("tip" if "time" in error else "frequencies"),
            "met": is_within(error, accuracy),
            "estimated": error["total"],
            "chosen": found.best.setting.summary(),
            "attempts": found.tried,
        }
        if clock.budget is not None:
            how["budget"] = clock.summary()
        timings = with_choice(result.summary["timings"], started)
        return result.with_summary(scene=scene.digest(), accuracy=how, timings=timings, **entries)

    try:
        refine(first, answer, accuracy, clock, found)
    except KeyboardInterrupt as stop:
        if found.best is not None and together(clock.comm, stop):
            raise Stopped(best(status="interrupted")) from stop
        raise
    done = best()
    if not done.summary["accuracy"]["met"]:
        raise missed(scene, done, found.failure)
    return done


def with_choice(timings: Mapping[str, float], started: float) -> dict[str, float]:
    """Return the timings of a result (s) with `choice`, what was used besides since a start, in their total."""
    choice = max(0.0, perf_counter() - started - timings["total"])
    return {**timings, "choice": choice, "total": timings["total"] + choice}


def missed(scene: Scene, done: Result, failure: ComputationError | None) -> Missed:
    """Return the error that says what the best result reached instead of an accuracy, and what failed after it."""
    error = done.summary["error"]
    worst = max(WORDS, key=lambda name: contribution(error, name))
    advice = {
        "time": "a looser accuracy, or fixed steps without one",
        "space": "a looser accuracy" + (", or a finer mesh file" if scene.structure.mesh_file is not None else ""),
        "model": f"a looser accuracy, or a richer model.theory than {scene.model.theory}",
        "round_off": "a looser accuracy, or a section of less different stiffnesses",
    }[worst]
    unknown = [WORDS[name] for name in WORDS if error.get(name, 0.0) is None]
    if unknown or error["total"] is None:
        reached = f"the error of what was reached is not known ({', '.join(unknown)})"
    else:
        share = contribution(error, worst)
        reached = f"an error of {error['total']:.2g} was reached, most of it ({WORDS[worst]}) {share:.2g}, where an "
        reached += f"estimate of {(scene.accuracy or 0.0) / (1.0 if worst == 'time' else SAFETY):.2g} is wanted"
    why = "" if failure is None else f", and a further attempt failed: {failure.what}"
    what = f"an accuracy of {scene.accuracy:g} was not met: {reached}{why}"
    return failed(done, what, (failure.advice if failure is not None else None) or advice)


def failed(done: Result, what: str, advice: str) -> Missed:
    """Return the error of a result that is not what was asked for."""
    out = Missed(what, advice=advice)
    failure = {"what": out.what, "time": None, "advice": out.advice}
    out.result = done.with_summary(status="failed", failure=failure)
    return out
