"""How much a model's outputs change when an effect is left out or the theory replaced.

Both models are solved on the same coarse mesh with the same few steps (see `rotfem.selection.coarse_model`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

from rotfem.selection.coarse_model import Trial
from rotfem.selection.distance import Outputs, change, notes

#: Factor by which an estimate may be wrong: estimates below a tolerance are believed only with it.
SAFETY = 3.0

#: A relative change that nobody would call negligible, and one that changes the answer.
NOTICEABLE, LARGE = 1e-2, 1e-1


@dataclass
class Change:
    """What one step from a model to another changes.

    Attributes:
        kind: "effect" or "theory".
        name: of the effect, or of the theory that takes the place of the model's.
        included: whether the model itself has it.
        estimate: output ↦ relative change; infinite where one of the models fails.
        notes: output ↦ why a model fails.
        truth: output ↦ relative change on the case's own mesh and steps, where it was computed.
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
        """Word for it: "negligible" (below 1 % even with the safety factor), "noticeable" or "large"."""
        if self.worst >= LARGE:
            return "large"
        return "negligible" if SAFETY * self.worst < NOTICEABLE else "noticeable"

    def row(self) -> dict[str, Any]:
        """Return it as a dictionary fit for JSON."""
        row: dict[str, Any] = {"kind": self.kind, "name": self.name, "included": self.included}
        row |= {"estimate": self.estimate, "worst": self.worst, "verdict": self.verdict}
        return row | ({"notes": self.notes} if self.notes else {}) | ({"truth": self.truth} if self.truth else {})


class Estimates:
    """The changes that steps from one model make.

    Args:
        trial: the case to be tried out.
        theory: name of that of the model that is changed.
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
        """Return what another theory makes of the case."""
        return self._change("theory", theory, theory == self.theory, self.trial.outputs(theory, self.without))

    def all(self) -> list[Change]:
        """Return every effect there are data for, then every other theory."""
        effects = [self.effect(name) for name in self.trial.effects]
        return effects + [self.replaced(name) for name in self.trial.theories if name != self.theory]

    def _change(self, kind: str, name: str, included: bool, other: Outputs) -> Change:
        estimate = change(self.own, other, self.trial.wanted)
        return Change(kind, name, included, estimate, notes(self.own, other))
