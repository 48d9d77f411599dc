"""Hints at the start of a computation, and warnings of inputs over time that it takes as at t = 0."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rotfem.analysis.stability import act_at_start, are_constant
from rotfem.commands.problem import motion_of
from rotfem.listeners import Hint
from rotfem.mechanics.problem import Problem
from rotfem.registry import theories
from rotfem.scene.scene import Scene
from rotfem.units import speed_text


def advise(
    scene: Scene,
    hint: Hint | None,
    speed: float | None = None,
    critical: float | None = None,
    also: Sequence[str] = (),
) -> list[str]:
    """Return hints, one line each, and hand them on."""
    if hint is None:
        return []
    end = None if scene.time is None else scene.time.end
    speed = motion_of(scene).top_speed(end) if speed is None else abs(speed)
    out = [*scene.hints, *also, *_nodes(scene)]
    if critical is not None and speed > critical:
        out += _softening(scene, speed, critical)
    for line in out:
        hint(line)
    return out


def _softening(scene: Scene, speed: float, critical: float) -> list[str]:
    """Return a hint where the theory is a linear one that the spin softens but does not stiffen."""
    theory = theories[scene.model.theory]
    if not theory.linear or theory.prestress:
        return []
    stiffened = min((t for t in theories if t.linear and t.prestress), key=lambda t: t.rank)
    return [
        f'model.theory = "{theory.name}" has no centrifugal stiffening, and loses its stiffness at '
        f'{speed_text(critical, 3)}; the scene reaches {speed_text(speed, 3)}: use "{stiffened.name}", which costs '
        "the same"
    ]


def _nodes(scene: Scene) -> list[str]:
    """Return a hint where masses and kinks, which are nodes, ask for more elements than the mesh has."""
    places, elements = len(scene.structure.nodes), getattr(scene.mesh, "elements", None)
    if not isinstance(elements, int) or places < elements:
        return []
    return [
        f"point masses and kinks at {places} places along the beam need a node each: the mesh has {places + 1} "
        f"elements, not mesh.elements = {elements}"
    ]


def hints_of_start(scene: Scene, problem: Problem) -> list[str]:
    """Return hints about the start of a history: where it rings, or never moves."""
    initial = scene.initial
    if scene.time is None or initial.tip_displacement is not None or not act_at_start(problem):
        return []
    if initial.state == "undeformed":
        what = "what acts at t = 0 acts all at once, and what that sets ringing is followed to the end"
        return [f'initial.state = "undeformed": {what}; "steady" starts in balance']
    if initial.moves or not are_constant(problem):
        return []
    what = "speed and loads are constant, and the history starts in balance: nothing will move"
    return [f'{what}; initial.state = "undeformed" lets them act all at once at t = 0']


def frozen_inputs(problem: Problem) -> list[str]:
    """Return warnings of motion, gravity and loads over time, which are taken as at t = 0."""
    given = {name: load.unpitched or load for name, load in problem.loads.named.items()}
    names = [f"loads.{name}" for name, load in given.items() if not (load.constant or load.is_zero)]
    said = [f"{', '.join(names)} {'change' if len(names) > 1 else 'changes'} with time: taken as at t = 0"]
    return [*frozen_in_frame(problem), *(said if names else [])]


def frozen_in_frame(problem: Problem) -> list[str]:
    """Return the same of pitch, gravity and base acceleration."""
    motion = problem.motion
    found = {
        "structure.root.pitch changes with time": motion.pitch is not None,
        "loads.gravity turns in the rotating frame": problem.gravity_turns,
        "motion.base_acceleration changes with time": motion.base is not None and not motion.base.constant,
    }
    return [f"{what}: taken as at t = 0" for what, there in found.items() if there]


def beyond(problem: Problem, speeds: npt.ArrayLike, frequencies: npt.ArrayLike = ()) -> list[str]:
    """Return warnings of supports that are constant beyond their tables, at speeds or frequencies of whirl (rad/s)."""
    out, given = [], (np.asarray(speeds, dtype=float), np.asarray(frequencies, dtype=float))
    for i, support in enumerate(getattr(problem.structure, "supports", ())):
        parts = {f"supports.{i}": support, **{f"supports.{i}.housing.{j}": h for j, h in enumerate(support.housing)}}
        for key, part in parts.items():
            tables = {
                name: table for name in type(part).model_fields if hasattr(table := getattr(part, name), "beyond")
            }
            for name, range_of in ((name, table.beyond(*given)) for name, table in tables.items()):
                if range_of:
                    out.append(f"structure.{key}.{name} is a table over {range_of}; beyond them it is held constant")
    return out
