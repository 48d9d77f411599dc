"""How much a model's outputs change when an effect is left out or the theory replaced.

    history, steady   max_t |Δu_tip| / max_t |u_tip|        displacement of the tip
    modes             max_i |Δλ_i| / |λ_i|                  eigenvalues, so frequency and damping, sorted by size

Both models are solved on the same coarse mesh with the same few steps (see `rotfem.trial`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rotfem.trial import HISTORY, MODES, STEADY, Outputs, Trial

#: From the cheapest to the richest theory.
LADDER = ("linear", "consistent_linear", "von_karman_linear", "second_order", "von_karman", "reissner")

#: Factor by which an estimate may be wrong: estimates below a tolerance are believed only with it.
SAFETY = 3.0

#: A relative change that nobody would call negligible, and one that changes the answer.
NOTICEABLE, LARGE = 1e-2, 1e-1


@dataclass
class Change:
    """What one step from a model to another changes.

    Attributes:
        kind: "effect" or "theory".
        name: of the effect, or of the theory that takes the place of the scene's.
        included: whether the scene's own model has it.
        estimate: output ↦ relative change; infinite where one of the models fails.
        notes: output ↦ why a model fails.
        truth: output ↦ relative change on the scene's own mesh and steps, where it was computed.
    """

    kind: str
    name: str
    included: bool
    estimate: dict[str, float]
    notes: dict[str, str] = field(default_factory=dict)
    truth: dict[str, float] = field(default_factory=dict)

    @property
    def worst(self) -> float:
        """Largest estimate over the outputs."""
        return max(self.estimate.values(), default=0.0)

    @property
    def verdict(self) -> str:
        """ "negligible", "noticeable" or "large"; only what stays below 1 % with the safety factor is negligible."""
        if self.worst >= LARGE:
            return "large"
        return "negligible" if SAFETY * self.worst < NOTICEABLE else "noticeable"

    def row(self) -> dict[str, Any]:
        """Return it as a dictionary fit for JSON."""
        row: dict[str, Any] = {"kind": self.kind, "name": self.name, "included": self.included}
        row |= {"estimate": self.estimate, "worst": self.worst, "verdict": self.verdict}
        return row | ({"notes": self.notes} if self.notes else {}) | ({"truth": self.truth} if self.truth else {})


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


class Estimates:
    """The changes that steps from one model make.

    Args:
        trial: the scene to be tried out.
        theory: of the model that is changed.
        effects: of that model.
    """

    def __init__(self, trial: Trial, theory: str, effects: Collection[str]):
        self.trial, self.theory = trial, theory
        self.without = frozenset(trial.effects) - frozenset(effects)

    @property
    def own(self) -> Outputs:
        """Outputs of the model itself."""
        return self.trial.outputs(self.theory, self.without)

    def effect(self, name: str) -> Change:
        """Return what the model loses without an effect, or gains with one that it leaves out."""
        included = name not in self.without
        return self._change("effect", name, included, self.trial.outputs(self.theory, self.without ^ {name}))

    def replaced(self, theory: str) -> Change:
        """Return what another theory makes of the scene."""
        return self._change("theory", theory, theory == self.theory, self.trial.outputs(theory, self.without))

    def all(self) -> list[Change]:
        """Return every effect the scene has data for, then every other theory."""
        effects = [self.effect(name) for name in self.trial.effects]
        return effects + [self.replaced(name) for name in self.trial.theories() if name != self.theory]

    def _change(self, kind: str, name: str, included: bool, other: Outputs) -> Change:
        estimate = change(self.own, other, self.trial.wanted)
        return Change(kind, name, included, estimate, notes(self.own, other))


def outputs_of(wanted: Collection[str], history: Mapping[str, Any], rows: list[Mapping[str, Any]]) -> Outputs:
    """Return the outputs of full results: columns of a history (or its one steady row) and rows of modes."""
    out = Outputs()
    if HISTORY in wanted or STEADY in wanted:
        out.tip = np.stack([values for name, values in history.items() if name.startswith("tip_u")], axis=1)
    if MODES in wanted:
        out.values = np.array([complex(row["growth"], row["frequency"]) for row in rows])
    return out
