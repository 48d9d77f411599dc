"""What an attempt at an accuracy takes and how it is said: its work, by which times are compared, and its words.

The time of a march goes with its work,

    steps · (stages + 1) · nodes^p,

p = 1 along a beam and 1.5 over a plate.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

from rotfem.analysis.schemes import Scheme
from rotfem.selection.accuracy import Settings
from rotfem.selection.steps_ahead import BESIDE

#: Exponents over the number of unknowns by the dimension of the mesh: a band, and nested dissection of a plane graph.
TIME_EXPONENT = {1: 1.0, 2: 1.5}


@dataclass
class Rate:
    """What an attempt took.

    Attributes:
        setup: CPU time before its first step, s.
        march: CPU time of its steps, s.
        work: that they were.
        steps: number of them.
        settings: what it was.
    """

    setup: float
    march: float
    work: float
    steps: float
    settings: Settings


def key(settings: Settings) -> str:
    """Return by what settings take alike for the same work."""
    model = settings.models[0]
    return f"{model['theory']}{' reduced' if model.get('reduced') else ''}"


def work(settings: Settings, steps: float) -> float:
    """Return the work of so many steps; of none, that of the mesh."""
    elements, degree = settings.elements, settings.degree
    along = elements if isinstance(elements, tuple) else (elements or 1,)
    nodes: float = float(prod(n * degree + 1 for n in along)) ** TIME_EXPONENT[len(along)]
    if settings.scheme is None or settings.models[0].get("reduced"):
        return nodes
    stages: int = Scheme.registry[settings.scheme].stages
    return max(1.0, steps) * (stages + BESIDE) * nodes


def order_of(settings: Settings) -> int:
    """Return the order of the scheme of settings with a history."""
    assert settings.scheme is not None
    order: int = Scheme.registry[settings.scheme].order
    return order


def words(settings: Settings, end: float) -> str:
    """Return in words what settings are."""
    model, elements = settings.models[0], settings.elements
    if model.get("reduced"):
        parts = [f"reduced {model['theory']}"]
    elif settings.step is not None:
        parts = [model["theory"], f"{end / settings.step:.0f} steps of {settings.step:.2g} s by {settings.scheme}"]
    elif settings.tolerance is not None:
        parts = [model["theory"], f"adaptive steps to {settings.tolerance:.1g} by {settings.scheme}"]
    else:
        parts = [model["theory"]]
    if elements is not None:
        number = f"{elements[0]}×{elements[1]}" if isinstance(elements, tuple) else str(elements)
        parts.append(f"{number} elements")
    return ", ".join(parts)


def lasting(seconds: float) -> str:
    """Return seconds as they are read: 40 s, 3.5 min, 2 h."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.3g} s" if seconds < 100.0 else f"{seconds:.0f} s"
