"""What a scene says of a wanted accuracy: the settings to begin with, their keys, and whether and how it is met."""

from __future__ import annotations

import math
from typing import Any

from rotfem.commands.ahead import ADAPTIVE
from rotfem.errors import ComputationError, SceneError
from rotfem.mechanics.theories import theories
from rotfem.refinement.estimate import WORDS
from rotfem.results.result import Result
from rotfem.scene import Scene
from rotfem.selection.accuracy import AIM, SHARES, Settings, part, shares

#: Error that a reduced model may add to that of its theory, as a part of the accuracy.
PROJECTED = 0.15

#: Rows of a history that does not say it.
ROWS = 1000

#: Nodes along a structure to start from, and for every mode that is wanted; along the longer edge of a plate, whose
#: cells along the other are no fewer than FEWEST if the scene has as many.
NODES, NODES_A_MODE, NODES_OF_PLATES, FEWEST = 30, 4, 24, 3


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
        if isinstance(mesh.elements, tuple):
            elements = mesh.elements if time is None else coarsened(mesh.elements, mesh.degree)
        else:
            elements = -(-nodes // mesh.degree)
    return Settings(
        models=models_of(scene, moving=time is not None),
        elements=elements,
        degree=mesh.degree,
        scheme=None if time is None else ADAPTIVE,
        tolerance=None if time is None else AIM * SHARES["time"] * (scene.accuracy or 0.0),
    )


def coarsened(elements: tuple[int, int], degree: int) -> tuple[int, int]:
    """Return cells of a plate as those of a scene, but no more than its motion needs to be known at first."""
    growth = min(1.0, NODES_OF_PLATES / degree / max(elements))
    x, y = (max(math.ceil(n * growth), min(n, FEWEST)) for n in elements)
    return x, y


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
    return (quick, full) if linear and allows(scene, quick) else (full,)


def allows(scene: Scene, model: dict[str, Any]) -> bool:
    """Return whether a scene takes these keys of [model]: no reduced one has a torque by a controller."""
    try:
        scene.replace({f"model.{key}": value for key, value in model.items()})
    except SceneError:
        return False
    return True


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


def told(scene: Scene, settings: Settings, error: dict[str, Any], tried: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what a summary says of how an accuracy was pursued."""
    accuracy = scene.accuracy
    assert accuracy is not None
    return {
        "asked": accuracy,
        "of": scene.accuracy_of or ("tip" if "time" in error else "frequencies"),
        "met": is_met(scene, error),
        "estimated": error["total"],
        "allowed": shares(error, accuracy, settings.plate),
        "chosen": settings.summary(),
        "attempts": tried,
    }


def missed(scene: Scene, done: Result, why: str = "", advice: str | None = None) -> Missed:
    """Return the error that says what was reached instead of an accuracy.

    Args:
        scene: with an accuracy.
        done: the best result, whose summary says that it has failed from now on.
        why: what ends the message, on attempts that would have been better.
        advice: what to try; None for what the largest part of the error calls for.
    """
    error = done.summary["error"]
    worst = max(WORDS, key=lambda name: part(error, name))
    by_worst = {
        "time": "a looser accuracy, or fixed steps without one",
        "space": "a looser accuracy" + (", or a finer mesh file" if scene.structure.mesh_file is not None else ""),
        "model": f"a looser accuracy, or a richer model.theory than {scene.model.theory}",
        "round_off": "a looser accuracy, or a section of less different stiffnesses",
    }[worst]
    if error["total"] is None:
        unknown = ", ".join(WORDS[name] for name in WORDS if error.get(name, 0.0) is None)
        reached = f"the error of what was reached is not known ({unknown})"
    else:
        reached = f"{error['total']:.2g} was reached, most of it ({WORDS[worst]}) {part(error, worst):.2g}"
    failure = Missed(f"an accuracy of {scene.accuracy:g} was not met: {reached}{why}", advice=advice or by_worst)
    done.summary["status"] = "failed"
    done.summary["failure"] = {"what": failure.what, "time": None, "advice": failure.advice}
    vars(failure)["result"] = done
    return failure
