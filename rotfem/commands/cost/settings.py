"""The settings a work–precision study tries, and the next finer or coarser one of each. No dolfinx in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import prod
from typing import Any

from rotfem import registry
from rotfem.errors import SceneError
from rotfem.mechanics.theories import ladder as theory_ladder
from rotfem.mechanics.theories import theories as all_theories
from rotfem.scene import Scene
from rotfem.scene.problems import did_you_mean
from rotfem.scene.stepping import estimates_error

Elements = int | tuple[int, int] | None

#: What errors may be of: the tip's motion, eigenvalues at the scene's speed, frequencies over a range of speeds.
OUTPUTS = ("tip", "frequencies", "campbell")

#: Speeds of a Campbell diagram that is studied: from rest to the scene's speed.
SPEEDS = 9

#: Steps tried, as multiples of the scene's own; a step is never longer than this part of the interval.
STEPS_FULL, STEPS_QUICK, LONGEST = (0.45, 10.5), (1.9, 10.5), 1 / 20

#: Tolerances of adaptive steps tried, as multiples of the scene's own.
TOLERANCES_FULL, TOLERANCES_QUICK = (1000.0, 100.0, 10.0, 1.0, 0.1), (100.0, 10.0, 1.0)

#: Numbers of elements tried, as multiples of the scene's own.
MESHES_FULL, MESHES_QUICK = (0.25, 0.5, 1.0, 2.0), (0.5, 1.0)

HIGHEST_DEGREE = 6


@dataclass(frozen=True)
class Setting:
    """One way to compute a scene.

    Attributes:
        theory: order of the strains.
        elements: number of elements, (nx, ny) of a plate, or None where a mesh file says it.
        degree: polynomial degree.
        scheme: time stepping, or None outside a time history.
        step: fixed time step, s, or None.
        tolerance: of adaptive steps, or None.
        every: steps from one sample of the history to the next.
    """

    theory: str
    elements: Elements
    degree: int
    scheme: str | None = None
    step: float | None = None
    tolerance: float | None = None
    every: int = 1

    def key(self) -> dict[str, Any]:
        """Return what identifies the setting, JSON-able."""
        elements = list(self.elements) if isinstance(self.elements, tuple) else self.elements
        return {**asdict(self), "elements": elements}

    def changes(self, scene: Scene) -> dict[str, Any]:
        """Return dotted key ↦ value that make a scene of this setting; keys it says nothing about stay."""
        out: dict[str, Any] = {"model.theory": self.theory, "mesh.degree": self.degree}
        if self.elements is not None:
            out["mesh.elements"] = list(self.elements) if isinstance(self.elements, tuple) else self.elements
        if self.scheme is None or scene.time is None:
            return out
        out |= {"time.step": self.step, "time.tolerance": self.tolerance, "time.output_every": self.every}
        out["time.scheme"] = self.scheme  # given or not: the default of fixed and of adaptive steps is not the same
        if self.tolerance is None:
            out |= {"time.max_step": None, "time.min_step": None}
        if self.scheme != scene.time.scheme:
            out |= {"time.spectral_radius": None, "time.beta": None, "time.gamma": None}
        return out


def cells(elements: Elements) -> int:
    """Return the number of cells."""
    return elements[0] * elements[1] if isinstance(elements, tuple) else elements or 0


def scaled(elements: Elements, factor: float) -> Elements:
    """Return a number of elements times a factor, at least 1 in each direction."""
    if isinstance(elements, tuple):
        return max(1, round(elements[0] * factor)), max(1, round(elements[1] * factor))
    return None if elements is None else max(1, round(elements * factor))


def remeshed(setting: Setting, factor: float) -> Setting | None:
    """Return a setting with a number of elements times a factor; of a mesh file with a degree more or less.

    None where there is none.
    """
    if setting.elements is None:
        degree = setting.degree + (1 if factor > 1.0 else -1)
        return replace(setting, degree=degree) if 1 <= degree <= HIGHEST_DEGREE else None
    other = replace(setting, elements=scaled(setting.elements, factor))
    return None if other == setting else other


def restepped(setting: Setting, factor: float, interval: float) -> Setting | None:
    """Return a setting with its step, or tolerance, times a factor; None where there is neither.

    Args:
        setting: of a history, or not.
        factor: of the step.
        interval: between rows of the history, s.
    """
    if setting.step is not None:
        step = factor * setting.step
        return replace(setting, step=step, every=samples_every(interval, step))
    return None if setting.tolerance is None else replace(setting, tolerance=factor * setting.tolerance)


def count(setting: Setting) -> int:
    """Return the number of nodes of a mesh, that of a mesh file in units of its own."""
    counts = setting.elements if isinstance(setting.elements, tuple) else (setting.elements or 1,)
    return prod(n * setting.degree + 1 for n in counts)


def scheme_of(setting: Setting) -> Any:
    """Return the class of a setting's scheme, which has `order` and `stages`; None outside a history."""
    return None if setting.scheme is None else registry.schemes[setting.scheme]


def own_setting(scene: Scene) -> Setting:
    """Return the setting of the scene itself."""
    elements = getattr(scene.mesh, "elements", None)
    if getattr(scene.structure, "mesh", None) is not None:
        elements = None
    model, time = scene.model, scene.time
    if time is None:
        return Setting(model.theory, elements, scene.mesh.degree)
    every = time.output_every if time.tolerance is None else 1
    return Setting(model.theory, elements, scene.mesh.degree, time.scheme, time.step, time.tolerance, every)


def default_output(scene: Scene) -> str:
    """Return "tip" for a history or a steady state that the scene asks for, "frequencies" otherwise."""
    if scene.time is not None:
        return "tip"
    steady = scene.motion.is_steady and not scene.modes.model_fields_set
    return "tip" if steady and (scene.motion.is_spinning or scene.loads.model_fields_set) else "frequencies"


def grid(
    scene: Scene, output: str, quick: bool, base_step: float | None, chosen: Mapping[str, Sequence[Any] | None]
) -> list[Setting]:
    """Return the settings of a study around the scene's own, which is among them unless the choice leaves it out.

    Args:
        scene: validated scene.
        output: one of OUTPUTS.
        quick: a small grid.
        base_step: a fixed step (s) of about the scene's accuracy; its own where it has one.
        chosen: `theories`, `elements`, `degrees`, `steps`, `schemes` that replace the default ones, or None each, as
            `check_choice` allows them.
    """
    own = own_setting(scene)
    theories = list(chosen.get("theories") or default_theories(scene, quick))
    factors = MESHES_QUICK if quick else MESHES_FULL
    meshes = list(chosen.get("elements") or unique([scaled(own.elements, factor) for factor in factors]))
    lower = [] if quick or own.degree == 1 else [own.degree - 1]
    degrees = list(chosen.get("degrees") or [*lower, own.degree])
    ways = [(None, None, None, 1)] if output != "tip" or scene.time is None else _ways(scene, quick, base_step, chosen)
    out = []
    for theory in theories:
        for scheme, step, tolerance, every in ways:
            # Another scheme changes nothing in space: one mesh shows what it does.
            other = scheme is not None and not chosen.get("schemes") and scheme != own.scheme
            pairs = [(meshes[-1] if own.elements not in meshes else own.elements, degrees[-1])]
            pairs = pairs if other else [(n, k) for n in meshes for k in degrees]
            out += [Setting(theory, n, k, scheme, step, tolerance, every) for n, k in pairs]
    return unique(out)


def _ways(
    scene: Scene, quick: bool, base_step: float | None, chosen: Mapping[str, Sequence[Any] | None]
) -> list[tuple[str | None, float | None, float | None, int]]:
    """Return (scheme, step, tolerance, samples every) of a time history, schemes × steps."""
    time = scene.time
    assert time is not None
    assert base_step is not None
    interval = sample_interval(scene, base_step)
    steps = list(chosen.get("steps") or ladder(base_step, interval, time.end, *(STEPS_QUICK if quick else STEPS_FULL)))
    factors = TOLERANCES_QUICK if quick else TOLERANCES_FULL
    own = time.tolerance if not chosen.get("steps") else None
    tolerances = [] if own is None else [own * factor for factor in factors]
    others = [] if quick else [name for name in registry.schemes.names if name != time.scheme]
    schemes = chosen.get("schemes") or [time.scheme, *others]
    fixed = [(scheme, h, None, samples_every(interval, h)) for scheme in schemes for h in steps]
    adaptive = [scheme for scheme in schemes if estimates_error(registry.schemes[scheme])]
    return [*fixed, *((scheme, None, tolerance, 1) for scheme in adaptive for tolerance in tolerances)]


def default_theories(scene: Scene, quick: bool) -> list[str]:
    """Return the theories that the scene allows, few of them for a quick study, poorest first."""
    if scene.model.frame == "inertial":
        return [scene.model.theory]
    there = [theory for theory in all_theories() if theory.holds_for(scene.structure.type)]
    return [t.name for t in there if not quick or t.quick or t.name == scene.model.theory]


def ladder(own: float, interval: float, end: float, low: float, high: float) -> list[float]:
    """Return steps between low·own and high·own, largest first, and the own one.

    All but that are the interval between samples times a power of two, so that the samples of one are those of others.
    """
    steps = [interval * 2.0**k for k in range(-40, 41)]
    steps = [h for h in steps if low * own <= h <= high * own and h <= LONGEST * end and abs(h / own - 1) > 0.05]
    return sorted([*steps, own], reverse=True)


def sample_interval(scene: Scene, base_step: float) -> float:
    """Return the time (s) between rows of history.csv that the scene asks for."""
    assert scene.time is not None
    return base_step * (scene.time.output_every if scene.time.tolerance is None else 1)


def sweep_speeds(scene: Scene) -> list[float]:
    """Return the speeds (rad/s) of the Campbell diagram that a study computes.

    Raises:
        SceneError: the scene does not turn.
    """
    top = scene.motion.top_speed(None if scene.time is None else scene.time.end)
    if not top > 0.0:
        raise SceneError(scene.file, "cost --of", "campbell", "the scene has no speed to go up to")
    return [top * i / (SPEEDS - 1) for i in range(SPEEDS)]


def samples_every(interval: float, step: float) -> int:
    """Return how many steps (s) there are from one sample to the next, where they are an interval (s) apart."""
    return max(1, round(interval / step))


def check_choice(scene: Scene, chosen: Mapping[str, Sequence[Any] | None]) -> None:
    """Check the values that are to replace the default grid.

    Raises:
        SceneError: one is of the wrong kind, or has no meaning for this scene.
    """
    for name, allowed in (("theories", theory_ladder()), ("schemes", registry.schemes.names)):
        for value in chosen.get(name) or ():
            if value not in allowed:
                reason = f"{did_you_mean(value, allowed)}allowed: {', '.join(allowed)}"
                raise SceneError(scene.file, f"cost --{name}", value, reason)
    for name, kind in (("elements", int), ("degrees", int), ("steps", float)):
        for value in chosen.get(name) or ():
            parts = value if isinstance(value, tuple | list) else (value,)
            if not all(isinstance(v, int | kind) and not isinstance(v, bool) and v > 0 for v in parts):
                what = "numbers greater than 0 (s)" if kind is float else "integers greater than 0"
                raise SceneError(scene.file, f"cost --{name}", value, f"must be {what}")
    if scene.time is None and (chosen.get("steps") or chosen.get("schemes")):
        raise SceneError(scene.file, "time", None, "missing; steps and schemes have a meaning only with [time]")
    end = scene.time.end if scene.time is not None else 0.0
    too_long = [h for h in chosen.get("steps") or () if h > end]
    if too_long:
        raise SceneError(scene.file, "cost --steps", too_long[0], f"must be at most time.end = {end:g}")
    for name, values in chosen.items():
        for value in values or ():
            _check_value(scene, name, value)


def _check_value(scene: Scene, name: str, value: Any) -> None:
    """Check that the scene allows a value on its own.

    Raises:
        SceneError: it does not.
    """
    own = own_setting(scene)
    if name == "elements" and own.elements is None:
        raise SceneError(scene.file, "cost --elements", value, "has no meaning with structure.mesh; leave it out")
    fields = {"theories": "theory", "elements": "elements", "degrees": "degree", "schemes": "scheme", "steps": "step"}
    change: dict[str, Any] = {fields[name]: tuple(value) if isinstance(value, list) else value}
    change |= {"tolerance": None} if name == "steps" else {}
    try:
        scene.replace(replace(own, **change).changes(scene))
    except SceneError as error:
        raise SceneError(scene.file, f"cost --{name}", value, error.allowed) from None


def unique(values: Sequence[Any]) -> list[Any]:
    """Return the values without repetitions, in order."""
    return list(dict.fromkeys(values))
