"""The settings that a study of cost tries: theories × meshes × steps, around the scene's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

from rotfem import registry
from rotfem.commands.accuracy import degree_of
from rotfem.commands.problem import motion_of
from rotfem.errors import SceneError
from rotfem.mechanics.theories import theories
from rotfem.refinement.refine import Setting, grown
from rotfem.scene import Scene
from rotfem.scene.settings import estimates_error

#: What errors may be of: the tip's motion, eigenvalues at the scene's speed, frequencies over a range of speeds.
OUTPUTS = ("tip", "frequencies", "campbell")

#: Multiples of the scene's own steps, tolerances and numbers of elements that are tried, of a full and a quick study.
STEPS = {False: (8.0, 4.0, 2.0, 1.0, 0.5), True: (8.0, 4.0, 2.0, 1.0)}
TOLERANCES = {False: (1000.0, 100.0, 10.0, 1.0, 0.1), True: (100.0, 10.0, 1.0)}
MESHES = {False: (0.25, 0.5, 1.0, 2.0), True: (0.5, 1.0)}

#: Lists of values that take the place of the default ones, None where none are given.
Chosen = Mapping[str, Sequence[Any] | None]


def with_theory(setting: Setting, theory: str) -> Setting:
    """Return a setting in another theory."""
    return replace(setting, models=({"theory": theory},))


def parts_of(setting: Setting) -> tuple[tuple[Any, ...], ...]:
    """Return what has an error of its own in a setting: the theory, the mesh, and the steps."""
    s = setting
    return ("theory", s.theory), ("mesh", s.elements, s.degree), ("steps", s.scheme, s.tolerance, s.step)


def own_setting(scene: Scene, output: str = "tip") -> Setting:
    """Return the setting of the scene itself; steps are part of it where the output is a history."""
    mesh, time = scene.mesh, scene.time if output == "tip" else None
    elements = None if scene.structure.mesh_file is not None else getattr(mesh, "elements", None)
    own = Setting(({"theory": scene.model.theory},), elements, degree_of(scene))
    return own if time is None else replace(own, scheme=time.scheme, tolerance=time.tolerance, step=time.step)


def grid(scene: Scene, output: str, quick: bool, chosen: Chosen, step: float | None) -> list[Setting]:
    """Return the settings of a study around the scene's own, which is among them unless the choice leaves it out.

    Args:
        scene: validated scene.
        output: one of OUTPUTS.
        quick: a small grid.
        chosen: `theories`, `elements`, `degrees`, `steps`, `schemes` that replace the default ones, as `check_choice`
            allows them.
        step: the scene's own fixed step (s), or a mean one of its adaptive steps; None outside histories.
    """
    own = own_setting(scene, output)
    counts = [None] if own.elements is None else [grown(own.elements, factor) for factor in MESHES[quick]]
    lower = [] if quick or own.degree == 1 or own.elements is None else [own.degree - 1]
    of_lists = [tuple(n) if isinstance(n, list) else n for n in chosen.get("elements") or counts]
    meshes = [(n, k) for n in of_lists for k in chosen.get("degrees") or [*lower, own.degree]]
    out = []
    for theory in chosen.get("theories") or default_theories(scene, quick):
        for scheme, tolerance, length in _ways(scene, quick, chosen, step) if own.moving else [(None, None, None)]:
            # Another scheme changes nothing in space: one mesh shows what it does.
            other = scheme != own.scheme and not chosen.get("schemes")
            there = (own.elements, own.degree) if (own.elements, own.degree) in meshes else meshes[-1]
            pairs = [there] if other else meshes
            out += [Setting(({"theory": theory},), n, k, scheme, tolerance, length) for n, k in pairs]
    return list({setting.key(): setting for setting in out}.values())


def _ways(
    scene: Scene, quick: bool, chosen: Chosen, step: float | None
) -> list[tuple[str | None, float | None, float | None]]:
    """Return (scheme, tolerance, step) of a history: schemes × steps, and tolerances of schemes that allow them."""
    time = scene.time
    assert time is not None
    others = [] if quick else [name for name in registry.schemes.names if name != time.scheme]
    schemes = chosen.get("schemes") or [time.scheme, *others]
    steps = chosen.get("steps") or [f * step for f in STEPS[quick] if step is not None and f * step <= time.end]
    own = None if chosen.get("steps") else time.tolerance
    tolerances = [] if own is None else [factor * own for factor in TOLERANCES[quick]]
    adaptive = [scheme for scheme in schemes if estimates_error(registry.schemes[scheme])]
    return [*((s, None, h) for s in schemes for h in steps), *((s, e, None) for s in adaptive for e in tolerances)]


def default_theories(scene: Scene, quick: bool) -> list[str]:
    """Return the theories that the scene allows, few of them for a quick study, poorest first."""
    if scene.model.frame == "inertial":
        return [scene.model.theory]
    there = [theory for theory in theories() if theory.holds_for(scene.structure.type)]
    return [t.name for t in there if not quick or t.quick or t.name == scene.model.theory]


def allowed_by(setting: Setting, chosen: Chosen) -> bool:
    """Return whether a setting may be recommended: it is in all lists that were given."""
    values: dict[str, Any] = {"theories": setting.theory, "elements": setting.elements, "degrees": setting.degree}
    values |= {"steps": setting.step, "schemes": setting.scheme}
    lists = {
        name: [tuple(v) if isinstance(v, list) else v for v in values] for name, values in chosen.items() if values
    }
    return all(values[name] in wanted for name, wanted in lists.items())


def sweep_speeds(scene: Scene) -> list[float]:
    """Return the speeds (rad/s) of the Campbell diagram that a study computes.

    Raises:
        SceneError: the scene does not turn.
    """
    top = motion_of(scene).top_speed(None if scene.time is None else scene.time.end)
    if not top > 0.0:
        raise SceneError(scene.file, "cost --of", "campbell", "the scene has no speed to go up to")
    return [top * i / 8 for i in range(9)]


def without_choices(scene: Scene) -> Scene:
    """Return a scene in its own setting."""
    names = ("accuracy", "accuracy_of", "accuracy_budget")
    changes: dict[str, Any] = dict.fromkeys(names)
    if scene.time is not None:  # an accuracy may have given its steps
        changes |= {"time.tolerance": scene.time.tolerance, "time.step": scene.time.step}
    return scene.replace(changes)


def checked(scene: Scene, accuracy: float, repeat: int, output: str | None) -> str:
    """Return the output that is compared.

    Raises:
        SceneError: what is asked for is not valid, or has no meaning for the scene.
    """
    if not 0 < accuracy < inf:
        raise SceneError(scene.file, "cost --accuracy", accuracy, "must be a number greater than 0")
    if repeat < 1:
        raise SceneError(scene.file, "cost --repeat", repeat, "must be an integer at least 1")
    if output is None:  # what the scene computes
        steady = scene.motion.is_steady and not scene.modes.model_fields_set
        at_rest = not (motion_of(scene).is_spinning or scene.loads.model_fields_set)
        output = "frequencies" if scene.time is None and (at_rest or not steady) else "tip"
    if output not in OUTPUTS:
        raise SceneError(scene.file, "cost --of", output, f"allowed: {', '.join(OUTPUTS)}")
    if output == "tip":
        scene.check_run()
    if output == "campbell":
        sweep_speeds(scene)
    return output


def check_choice(scene: Scene, chosen: Chosen) -> None:
    """Check the values that are to replace the default grid, each on its own.

    Raises:
        SceneError: one is not allowed, or has no meaning for this scene.
    """
    own = own_setting(scene)
    keys = {"theories": "model.theory", "elements": "mesh.elements", "degrees": "mesh.degree"}
    keys |= {"schemes": "time.scheme", "steps": "time.step"}
    for name, value in ((name, value) for name, values in chosen.items() for value in values or ()):
        if name in ("steps", "schemes") and scene.time is None:
            raise SceneError(scene.file, "time", None, "missing; steps and schemes have a meaning only with [time]")
        if name == "elements" and own.elements is None:
            raise SceneError(scene.file, "cost --elements", value, "has no meaning with structure.mesh; leave it out")
        changes: dict[str, Any] = {keys[name]: value}
        if name in ("steps", "schemes") and scene.time is not None:
            changes |= {f"time.{key}": None for key in ("tolerance", "max_step", "min_step", *scene.time.parameters)}
            changes = {"time.step": scene.time.step or scene.time.end} | changes
        try:
            scene.replace(changes)
        except SceneError as error:
            raise SceneError(scene.file, f"cost --{name}", value, error.allowed) from None
