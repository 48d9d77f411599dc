"""One accuracy: what it allows of each error, and the settings that are expected to meet it.

The error of a result is that of its steps, of its mesh and of its model together. Each may have a share of the
accuracy; what one leaves over goes to the others. Settings that have missed it are made better where they fell short,
by the order with which each error falls:

    h' = h (share / error_time)^{1/p},    tolerance' = tolerance · share / error_time,
    n' = n (error_space / share)^{1/(k + 1)},

h the step of a scheme of order p, n the number of elements of degree k; a model that is too poor gives way to the next
richer one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

from rotfem.analysis.schemes import Scheme

#: Part of an accuracy that estimates may use up: they are estimates.
SAFETY = 0.8

#: Parts of that for steps, mesh and model, where all three have an error; of plates, whose meshes cost most.
SHARES = {"time": 0.5, "space": 0.2, "model": 0.3}
OF_PLATES = {"time": 0.25, "space": 0.45, "model": 0.3}

#: Least and most that a number of elements grows by at once, and to what a tolerance and a step shrink at most.
FINER, TIGHTER, SHORTER = (1.25, 4.0), 1e-3, 1 / 16

#: Part of an accuracy that a reduced model may be off by while a finer mesh, which costs it little, is still tried.
SPARED = 0.75

#: What is aimed at, as a part of a share: an error as large as its share would be missed by half of all attempts.
AIM = 0.7

Elements = int | tuple[int, int] | None


@dataclass(frozen=True)
class Settings:
    """How a scene is computed.

    Attributes:
        models: keys of [model] of the models there are, from the cheapest to the richest, that in use first.
        elements: number of elements, (nx, ny) of a plate; None where a mesh file says it.
        degree: their polynomial degree.
        scheme: time-stepping scheme; None without a history.
        step: its fixed step, s; None without, or where steps are adaptive.
        tolerance: of its adaptive steps; None without.
        increment: at which Newton's method stops; None where the scene says it.
    """

    models: tuple[Mapping[str, Any], ...]
    elements: Elements
    degree: int
    scheme: str | None = None
    step: float | None = None
    tolerance: float | None = None
    increment: float | None = None

    @property
    def plate(self) -> bool:
        """Whether they are those of a plate with elements along two edges."""
        return isinstance(self.elements, tuple)

    @property
    def moving(self) -> bool:
        """Whether they are those of a history."""
        return self.scheme is not None

    def changes(self) -> dict[str, Any]:
        """Return the scene's keys ↦ values of these settings; None removes what the scene says."""
        out: dict[str, Any] = {f"model.{key}": value for key, value in self.models[0].items()}
        out |= {"mesh.degree": self.degree}
        if self.elements is not None:
            out["mesh.elements"] = list(self.elements) if isinstance(self.elements, tuple) else self.elements
        if self.moving:
            out |= {"time.scheme": self.scheme, "time.tolerance": self.tolerance, "time.step": self.step}
        if self.increment is not None:
            out["solver.increment_tolerance"] = self.increment
        return out

    def summary(self) -> dict[str, Any]:
        """Return the settings in use, as far as there are any."""
        unused = (
            {"models", "scheme", "step", "tolerance", "increment"}
            if self.models[0].get("reduced")
            else {"models", "increment"}
        )
        known = {key: value for key, value in asdict(self).items() if key not in unused and value is not None}
        return {**{key: value for key, value in self.models[0].items() if value is not None}, **known}

    def richer(self) -> Self | None:
        """Return these settings with the next richer model; None if this is the richest."""
        return replace(self, models=self.models[1:]) if len(self.models) > 1 else None

    def looser(self, factor: float) -> Self:
        """Return these settings with steps whose error is expected to be so many times larger."""
        if self.step is not None and self.scheme is not None:
            return replace(self, step=self.step * factor ** (1 / Scheme.registry[self.scheme].order))
        return self if self.tolerance is None else replace(self, tolerance=self.tolerance * factor)

    def better(self, error: Mapping[str, Any], accuracy: float) -> Self | None:
        """Return settings whose errors are expected to meet an accuracy that these have missed.

        Args:
            error: `time`, `space`, `model` of the result, as far as it has them, relative.
            accuracy: the error wanted.

        Returns:
            None where nothing that can be chosen makes the error smaller.
        """
        allowed = shares(error, accuracy, self.plate)
        new = self
        spared = SPARED * SAFETY * accuracy if self.models[0].get("reduced") else 0.0
        if part(error, "model") > max(allowed["model"], spared):
            richer = self.richer()
            if richer is None and part(error, "model") >= accuracy:
                return None
            new = richer or self
            error = error if richer is None else {**error, "model": 0.0}
            allowed = shares(error, accuracy, self.plate)
        if part(error, "time") > allowed["time"]:
            factor = AIM * allowed["time"] / part(error, "time")
            if self.step is not None and self.scheme is not None:
                order = Scheme.registry[self.scheme].order
                new = replace(new, step=self.step * max(SHORTER, factor ** (1 / order)))
            elif self.tolerance is not None:
                new = replace(new, tolerance=self.tolerance * max(TIGHTER, factor))
        if part(error, "space") > allowed["space"]:
            if self.elements is None:
                return None
            growth = (part(error, "space") / (AIM * allowed["space"])) ** (1 / (self.degree + 1))
            new = replace(new, elements=finer(self.elements, min(max(growth, FINER[0]), FINER[1])))
        return self.richer() if new is self else new


def part(error: Mapping[str, Any], name: str) -> float:
    """Return a part of an error; 0 of one that a result does not have."""
    value = error.get(name)
    return 0.0 if value is None else float(value)


def shares(error: Mapping[str, Any], accuracy: float, plate: bool = False) -> dict[str, float]:
    """Return what each part of an error may be: what a part does not need is the others'.

    Args:
        error: relative errors by part; those a result does not have are missing or None.
        accuracy: what all may be together.
        plate: whether the structure is one.
    """
    fair_shares = OF_PLATES if plate else SHARES
    left, wanting = SAFETY * accuracy, dict(fair_shares)
    out = {}
    for name in sorted(fair_shares, key=lambda name: part(error, name) / fair_shares[name]):
        fair = left * wanting[name] / sum(wanting.values())
        out[name] = fair if part(error, name) > AIM * fair or len(wanting) == 1 else part(error, name)
        left -= out[name]
        del wanting[name]
    return out


def finer(elements: int | tuple[int, int], growth: float) -> int | tuple[int, int]:
    """Return numbers of elements that have grown by a factor, at least by one each."""
    if isinstance(elements, tuple):
        return (math.ceil(elements[0] * growth), math.ceil(elements[1] * growth))
    return math.ceil(elements * growth)


def finest(one: Elements, other: Elements) -> Elements:
    """Return the larger numbers of elements of two."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return (max(one[0], other[0]), max(one[1], other[1]))
    assert isinstance(one, int)
    assert isinstance(other, int)
    return max(one, other)
