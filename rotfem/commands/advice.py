"""Hints at the start of a computation: settings that will disappoint, seen beforehand.

Frequencies are those of a uniform Euler–Bernoulli cantilever and rod with the mean section, raised by the spin; what is
reported of them is rounded to its accuracy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rotfem.commands.problem import motion_of
from rotfem.listeners import Hint
from rotfem.registry import theories
from rotfem.scene.scene import Scene
from rotfem.section_quantities import FORCES

#: Steps a period, below which the error of the first mode's frequency is more than 1 %, and those to be advised.
FEW_STEPS, GOOD_STEPS = 18, 40

#: Nodes a half wave, below which a mode is not resolved to 1 %.
FEW_NODES = 2.5

#: β₁L … β₄L of a clamped–free beam; (n − ½)π above.
CANTILEVER = (1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349)


class Estimate(NamedTuple):
    """A mode of the mean beam: family, half waves along the beam, frequency (rad/s)."""

    family: str
    half_waves: float
    frequency: float


def estimates(scene: Scene, speed: float, count: int) -> list[Estimate]:
    """Return the lowest modes of a beam at a speed (rad/s), roughly, lowest first; none for a plate.

    None with full matrices or supports either. The spin raises the square of a bending frequency across the plane of
    rotation by about (n(2n − 1) + 0.2) Ω², and by 1.5 n(2n − 1) Ω² R/L more with a hub; in the plane by Ω² less. For a
    chain without hub n(2n − 1) is exact.
    """
    structure: Any = scene.structure
    if structure.type not in FORCES or structure.section.way.name == "matrix" or getattr(structure, "supports", ()):
        return []
    properties = structure.section.at if structure.is_planar else structure.section.central
    L, hub = structure.length, structure.root_position[0]
    means = {name: float(np.mean(values)) for name, values in properties(np.linspace(0.0, L, 33)).items()}
    EA, mass = means["EA"], means["mass_per_length"] + (structure.tip_mass + sum(m.mass for m in structure.masses)) / L
    lag = means["EI" if structure.is_planar else "EI3"]  # of each family EI, and 1 across the plane of rotation
    bending = {"lag": (lag, 0.0)} if structure.is_planar else {"flap": (means["EI2"], 1.0), "lag": (lag, 0.0)}
    out = [Estimate("axial", n - 0.5, float((n - 0.5) * np.pi / L * np.sqrt(EA / mass))) for n in range(1, count + 1)]
    for family, (EI, across) in bending.items():
        for n in range(1, count + 1):
            beta = CANTILEVER[n - 1] if n <= len(CANTILEVER) else (n - 0.5) * np.pi
            at_rest = (beta / L) * (beta / L) * float(np.sqrt(EI / mass))  # no power of L, which may be no number
            spin = (n * (2 * n - 1) * (1 + 1.5 * hub / L) - 0.8 + across) * speed**2
            out.append(Estimate(family, n - 0.5, float(np.sqrt(at_rest * at_rest + spin))))
    return sorted(out, key=lambda mode: mode.frequency)[:count]


def advise(
    scene: Scene,
    command: str,
    hint: Hint | None,
    speed: float | None = None,
    critical: float | None = None,
    also: Sequence[str] = (),
) -> list[str]:
    """Return hints, one line each, for `run`, `modes` or `campbell`, and hand them on.

    Args:
        scene: validated scene.
        command: the verb.
        hint: called with every line; None asks for no advice.
        speed: the largest speed of the computation, rad/s; what the scene prescribes if None.
        critical: the speed at which the stiffness of a linear theory is singular, rad/s; None if there is none.
        also: further hints, which the scene alone does not give.
    """
    if hint is None:
        return []
    end = None if scene.time is None else scene.time.end
    speed = motion_of(scene).top_speed(end) if speed is None else abs(speed)
    out = [*scene.hints, *also, *_nodes(scene)]
    if command == "run":
        out += _step(scene, speed)
    if command != "run" or scene.modes.model_fields_set:
        out += _elements(scene, speed)
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
        f'model.theory = "{theory.name}" has no centrifugal stiffening, and loses its stiffness at {critical:.3g} '
        f'rad/s; the scene reaches {speed:.3g} rad/s: use "{stiffened.name}", which costs the same'
    ]


def _step(scene: Scene, speed: float) -> list[str]:
    """Return a hint where a fixed step is long for the highest mode wanted: the first, or the last of [modes]."""
    time = scene.time
    if time is None or time.step is None:
        return []
    wanted = scene.modes.count if scene.modes.model_fields_set else 1
    bending = [m for m in estimates(scene, speed, max(wanted, 8)) if m.family != "axial"][:wanted]
    if not bending:
        return []
    period = 2 * np.pi / bending[-1].frequency
    if period / time.step >= FEW_STEPS:
        return []
    # Of the trapezoidal rule: ω h is replaced by 2 arctan(ω h / 2).
    half = np.pi * time.step / period
    low = 1 - np.arctan(half) / half
    return [
        f"time.step = {time.step:g} s is long for mode {len(bending)}, whose period is about {period:.2g} s: its "
        f"frequency would be {100 * low:.2g} % too low; {_rounded(period / GOOD_STEPS):g} s gives {GOOD_STEPS} steps "
        "per period"
    ]


def _elements(scene: Scene, speed: float) -> list[str]:
    """Return a hint where the mesh has too few nodes for the shortest wave among the modes wanted."""
    modes = estimates(scene, speed, scene.modes.count)
    elements = getattr(scene.mesh, "elements", None)
    if not modes or not isinstance(elements, int):
        return []
    shortest = max(modes, key=lambda mode: mode.half_waves)
    nodes = elements * scene.mesh.degree
    if nodes >= FEW_NODES * shortest.half_waves:
        return []
    enough = int(np.ceil(2 * FEW_NODES * shortest.half_waves / scene.mesh.degree))
    return [
        f"mesh.elements = {elements} is too coarse for {shortest.family} {shortest.half_waves + 0.5:g}, the shortest "
        f"wave among modes.count = {scene.modes.count} modes: use {enough} elements"
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


def _rounded(value: float) -> float:
    """Return 1, 2 or 5 times a power of ten, not above the value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(m for m in (1, 2, 5) if m * power <= value * (1 + 1e-9)))
