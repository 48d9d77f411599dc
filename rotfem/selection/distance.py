"""What a model gives, and how far the outputs of two models are apart.

history, steady   max_t |Δu_tip| / max_t |u_tip|        displacement of the tip
modes             max_i |Δλ_i| / |λ_i|                  eigenvalues, so frequency and damping, sorted by size
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import ComputationError

Array = npt.NDArray[Any]

#: Names of the outputs that models are compared by.
HISTORY, STEADY, MODES = "history", "steady", "modes"


@dataclass
class Outputs:
    """What one model gives.

    Attributes:
        tip: displacement of the tip over time, shape (steps + 1, components), or (1, components) if steady; m.
        values: eigenvalues λ at the final speed, 1/s, sorted by size; one of each conjugate pair.
        sizes: largest displacement over L, or rotation in rad, of each component.
        failed: output ↦ why there is none of it.
    """

    tip: Array = field(default_factory=lambda: np.empty((0, 0)))
    values: Array = field(default_factory=lambda: np.empty(0))
    sizes: Array = field(default_factory=lambda: np.zeros(0))
    failed: dict[str, str] = field(default_factory=dict)

    @property
    def size(self) -> float:
        """Largest displacement over L, or rotation in rad, of all."""
        return float(self.sizes.max(initial=0.0))


class Beyond(ComputationError):
    """A history is farther from another one than was asked for."""


@dataclass(frozen=True)
class Bound:
    """The history of another model, and how far from it (relative to its largest displacement) one may be."""

    of: Outputs
    allowed: float

    @cached_property
    def radius(self) -> float:
        """How far, m."""
        return self.allowed * float(np.linalg.norm(self.of.tip, axis=1).max())

    def passed(self, i: int, u: Array) -> bool:
        """Return whether the displacement u of sample i is farther off."""
        return bool(np.linalg.norm(u - self.of.tip[i]) > self.radius)


def change(of: Outputs, to: Outputs, wanted: Collection[str]) -> dict[str, float]:
    """Return output ↦ relative change from one model's outputs to another's; infinite where one has none."""
    out = {}
    for name in wanted:
        if name in of.failed or name in to.failed:
            out[name] = np.inf
        elif name == MODES:
            out[name] = modes_change(of.values, to.values)
        else:
            out[name] = tip_change(of.tip, to.tip)
    return out


def tip_change(of: Any, to: Any) -> float:
    """Return max |Δu| / max |u| of displacements, shape (times, components)."""
    return _relative(np.linalg.norm(to - of, axis=1).max(), np.linalg.norm(of, axis=1).max())


def modes_change(of: Any, to: Any) -> float:
    """Return max |Δλ| / |λ| of eigenvalues sorted by size."""
    n = min(len(of), len(to))
    return max((_relative(abs(b - a), abs(a)) for a, b in zip(of[:n], to[:n], strict=True)), default=0.0)


def _relative(difference: float, size: float) -> float:
    if size > 0.0:
        return float(difference / size)
    return 0.0 if difference == 0.0 else np.inf


def notes(*models: Outputs) -> dict[str, str]:
    """Return output ↦ why one of the models has none."""
    return {name: why for model in models for name, why in model.failed.items()}


def outputs_of(wanted: Collection[str], history: Mapping[str, Any], rows: list[Mapping[str, Any]]) -> Outputs:
    """Return the outputs of full results: columns of a history (or its one steady row) and rows of modes."""
    out = Outputs()
    if HISTORY in wanted or STEADY in wanted:
        out.tip = np.stack([values for name, values in history.items() if name.startswith("tip_u")], axis=1)
    if MODES in wanted:
        out.values = np.array([complex(row["growth"], row["frequency"]) for row in rows])
    return out
