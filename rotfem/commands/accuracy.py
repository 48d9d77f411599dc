"""A wanted accuracy: settings are chosen, what they give says its error, and better ones follow until it is met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any, Generic, TypeVar

from rotfem.analysis.error_estimate import WORDS
from rotfem.commands.ahead import ADAPTIVE, Ahead
from rotfem.commands.pace import TOO_LITTLE, Pace, TooDear
from rotfem.errors import ComputationError, SceneError
from rotfem.mechanics.theories import theories
from rotfem.results.result import Result
from rotfem.results.run import RunResult
from rotfem.scene import Scene
from rotfem.selection.accuracy import AIM, SHARES, Settings, part, shares

R = TypeVar("R", bound=Result)

#: Settings that are tried at most, and what is left of an error that finer settings have not made smaller.
MOST_ATTEMPTS, STALLED = 6, 0.9

#: Error that a reduced model may add to that of its theory, as a part of the accuracy.
PROJECTED = 0.05

#: Loosest accuracy that is tried where a budget allows no better one.
LOOSEST = 0.1

#: Rows of a history that does not say it.
ROWS = 1000

#: Nodes along a structure to start from, and for every mode that is wanted.
NODES, NODES_A_MODE = 30, 4


class Missed(ComputationError):
    """No settings were found that meet the accuracy."""


def settings_of(scene: Scene, modes: int = 0) -> Settings:
    """Return the settings that a scene is first computed with.

    Args:
        scene: with an accuracy.
        modes: number of modes that are wanted; 0 of a run.
    """
    mesh, nodes, time = scene.mesh, max(NODES, NODES_A_MODE * modes), None if modes else scene.time
    elements: Any = None
    if scene.structure.mesh_file is None:
        elements = mesh.elements if isinstance(mesh.elements, tuple) else -(-nodes // mesh.degree)
    return Settings(
        models=models_of(scene, moving=time is not None),
        elements=elements,
        degree=mesh.degree,
        scheme=None if time is None else ADAPTIVE,
        tolerance=None if time is None else AIM * SHARES["time"] * (scene.accuracy or 0.0),
    )


def models_of(scene: Scene, moving: bool) -> tuple[dict[str, Any], ...]:
    """Return the keys of [model] of the models that a scene may be computed with, from the cheapest on.

    The theory that a scene names is the richest of them. A history of small motions is cheapest by a reduced linear
    model; steady states and modes cost little by any theory.
    """
    kind, own = scene.structure.type, scene.model.theory
    full = {"theory": own, "reduced": False, "foreshortening": False}
    if not moving:
        return (full,)
    named = {theory.name: theory for theory in theories() if theory.holds_for(kind)}
    linear = own if named[own].linear else next((n for n in named[own].poorer if named[n].prestress), None)
    assert scene.accuracy is not None
    gives_back = linear is not None and bool(named[linear].prestress)
    quick = {"theory": linear, "reduced": PROJECTED * scene.accuracy, "foreshortening": gives_back}
    return (quick, full) if linear else (full,)


def pursue(
    scene: Scene, settings: Settings, attempt: Callable[[Settings], R], pace: Pace, ahead: Ahead | None = None
) -> R:
    """Return the first result whose estimated error meets the accuracy of a scene.

    Args:
        scene: with an accuracy.
        settings: to begin with.
        attempt: settings ↦ their result, with an `error` in its summary.
        pace: of the attempts, with the communicator of the processes that compute them.
        ahead: what the attempts have shown of a motion; None without one.

    Raises:
        Missed: it was not met; its attribute `result` holds the best that was reached.
        ComputationError: the richest model failed.
    """
    started, tried, comm = perf_counter(), list[dict[str, Any]](), pace.comm
    best: Best[R] | None = None
    while True:
        began = perf_counter()
        try:
            pace.begins(settings, len(tried) + 1)
            done = attempt(settings)
            pace.ends()
        except TooDear as failure:
            tried.append({**settings.summary(), "failed": failure.what, "seconds": perf_counter() - began})
            cheaper = None if len(tried) == MOST_ATTEMPTS else pace.cheaper(partial(looser, scene, settings, ahead))
            if cheaper is None and best is None:
                raise
            if cheaper is None:
                break
            settings = cheaper
            continue
        except ComputationError as failure:
            richer = settings.richer()
            if richer is None or len(tried) == MOST_ATTEMPTS:
                raise
            tried.append({**settings.summary(), "failed": failure.what, "seconds": perf_counter() - began})
            settings = richer if ahead is None else comm.bcast(ahead.prepared(richer, {}))
            continue
        error = done.summary["error"]
        if ahead is not None and isinstance(done, RunResult):
            ahead.judge(done, settings)
        tried.append({**settings.summary(), "error": error["total"], "seconds": perf_counter() - began})
        best = Best(done, settings, perf_counter() - began).or_before(best)
        is_over = is_met(scene, error) or len(tried) == MOST_ATTEMPTS or stalled(tried)
        following = comm.bcast(None if is_over else next_of(scene, settings, done, ahead))
        if following is None:
            break
        settings = following
    assert best is not None
    return concluded(scene, best, tried, started, (pace, ahead))


@dataclass(frozen=True)
class Best(Generic[R]):
    """The best result so far.

    Attributes:
        done: the result.
        settings: that it was computed with.
        seconds: that it took.
    """

    done: R
    settings: Settings
    seconds: float

    def or_before(self, before: Best[R] | None) -> Best[R]:
        """Return the better one of this and one before it, which must be better to stay."""
        return self if before is None or rank(self.done) <= rank(before.done) else before


def rank(done: Result) -> tuple[bool, float]:
    """Return by what results are better: those whose error is known come first, by their error."""
    error = done.summary["error"]
    return (not known(error), float("inf") if error["total"] is None else error["total"])


def next_of(scene: Scene, settings: Settings, done: Result, ahead: Ahead | None) -> Settings | None:
    """Return the settings to follow those of a result that has missed; None where none would meet the accuracy."""
    error = done.summary["error"]
    assert scene.accuracy is not None
    following = settings.better(error, scene.accuracy)
    if following is None or ahead is None:
        return following
    if following.models == settings.models:
        return ahead.meshed(following, error)
    return ahead.prepared(following, error)


def looser(scene: Scene, settings: Settings, ahead: Ahead | None, factor: float) -> Settings | None:
    """Return settings of a history for an accuracy that is so many times looser; None where there are none."""
    assert scene.accuracy is not None
    if not settings.moving or settings.models[0].get("reduced") or factor * scene.accuracy > LOOSEST:
        return None
    planned = settings if ahead is None else ahead.looser(settings, factor)
    return planned if planned != settings else settings.looser(factor)


def stalled(tried: list[dict[str, Any]]) -> bool:
    """Return whether finer settings of the same model have not made the error smaller."""
    if len(tried) < 2 or "error" not in tried[-2]:
        return False
    before, now = tried[-2:]
    is_same = all(now[key] == before[key] for key in ("theory", "reduced"))
    return is_same and None not in (now["error"], before["error"]) and now["error"] >= STALLED * before["error"]


def refuse(scene: Scene, wanted: tuple[str, ...], command: str) -> None:
    """Refuse an accuracy of something that a command does not compute.

    Args:
        scene: with an accuracy.
        wanted: what the command computes.
        command: its verb.

    Raises:
        SceneError: the scene asks for another.
    """
    if scene.accuracy_of not in (None, *wanted):
        able = " or ".join(f'"{name}"' for name in wanted)
        reason = f'is not what "{command}" computes; it must be {able}, or not given'
        raise SceneError(scene.file, "accuracy_of", scene.accuracy_of, reason)


def known(error: dict[str, Any]) -> bool:
    """Return whether all parts of an error were found."""
    return all(error.get(name, 0.0) is not None for name in SHARES)


def changes_of(scene: Scene, settings: Settings) -> dict[str, Any]:
    """Return the keys ↦ values that make a scene one with these settings; None removes what it says."""
    out: dict[str, Any] = settings.changes()
    time = scene.time
    if "increment_tolerance" in scene.solver.model_fields_set:  # what the user has set stays
        out.pop("solver.increment_tolerance", None)
    if settings.moving and time is not None:
        out |= {f"time.{name}": None for name in time.parameters}
        out |= {"time.output_every": None, "time.output_step": time.output_step or time.end / ROWS}
        if time.output_step is None and time.step is not None:
            out["time.output_step"] = time.step * time.output_every
    return out


def is_met(scene: Scene, error: dict[str, Any]) -> bool:
    """Return whether an error is known and within the accuracy of a scene."""
    assert scene.accuracy is not None
    return known(error) and bool(error["total"] <= scene.accuracy)


def concluded(
    scene: Scene, best: Best[R], tried: list[dict[str, Any]], started: float, course: tuple[Pace, Ahead | None]
) -> R:
    """Return the best result with what its summary says of how it was found.

    Args:
        scene: with an accuracy.
        best: the result.
        tried: what the attempts were and gave.
        started: `perf_counter()` before the first of them.
        course: pace of the attempts, and what they have shown of a motion or None.

    Raises:
        Missed: it does not meet the accuracy.
    """
    done, error, (pace, ahead) = best.done, best.done.summary["error"], course
    done.summary["scene"] = scene.digest()
    done.summary["accuracy"] = told(scene, best.settings, error, tried)
    if pace.budget is not None:
        done.summary["accuracy"]["budget"] = pace.summary()
    if ahead is not None:
        done.summary["accuracy"]["effects"] = ahead.effects(error)
    timings = done.summary["timings"]
    timings["choice"] = perf_counter() - started - best.seconds
    timings["total"] += timings["choice"]
    if not is_met(scene, error):
        raise missed(scene, done, pace)
    return done


def told(scene: Scene, settings: Settings, error: dict[str, Any], tried: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what a summary says of how an accuracy was pursued."""
    accuracy = scene.accuracy
    assert accuracy is not None
    return {
        "asked": accuracy,
        "of": scene.accuracy_of or ("tip" if "time" in error else "frequencies"),
        "met": is_met(scene, error),
        "estimated": error["total"],
        "allowed": shares(error, accuracy),
        "chosen": settings.summary(),
        "attempts": tried,
    }


def missed(scene: Scene, done: Result, pace: Pace) -> Missed:
    """Return the error that says what was reached instead of an accuracy, and what would have taken too long."""
    error, chosen = done.summary["error"], done.summary["accuracy"]["chosen"]
    worst = max(WORDS, key=lambda name: part(error, name))
    advice = {
        "time": "a looser accuracy, or fixed steps without one",
        "space": "a looser accuracy" + (", or a finer mesh file" if scene.structure.mesh_file is not None else ""),
        "model": f"a looser accuracy, or a richer model.theory than {chosen['theory']}",
        "round_off": "a looser accuracy, or a section of less different stiffnesses",
    }[worst]
    shown = "an unknown error" if error["total"] is None else f"{error['total']:.2g}"
    failure = Missed(
        f"an accuracy of {scene.accuracy:g} was not met: {shown} was reached, most of it ({WORDS[worst]}) "
        f"{part(error, worst):.2g}{pace.why()}",
        advice=advice if pace.dear is None else TOO_LITTLE,
    )
    done.summary["status"] = "failed"
    done.summary["failure"] = {"what": failure.what, "time": None, "advice": advice}
    vars(failure)["result"] = done
    return failure
