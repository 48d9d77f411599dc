"""How much a model's outputs change when an effect is left out or the theory replaced.

Both models are solved on the same coarse mesh with the same few steps (see `rotfem.selection.coarse_model`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from rotfem.selection.coarse_case import from_file
from rotfem.selection.coarse_model import Trial
from rotfem.selection.discretisation import Discretisation, discretisation
from rotfem.selection.distance import HISTORY, Outputs, change, notes
from rotfem.selection.reduced_effects import reduced_effects

#: Factor by which an estimate may be wrong: estimates below a tolerance are believed only with it.
SAFETY = 3.0

#: A relative change that nobody would call negligible, and one that changes the answer.
NOTICEABLE, LARGE = 1e-2, 1e-1

#: What is smaller is told as smaller: by how much, coarse meshes and few steps do not say within the safety factor.
RESOLVED = 1e-4


@dataclass
class Change:
    """What one step from a model to another changes.

    Attributes:
        kind: "effect", "theory" or "discretisation".
        name: of the effect, of the theory that takes the place of the model's, or the key that is too coarse.
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
        known = {HISTORY: self.reduced[name]} if name in self.reduced else {}
        other = self.trial.outputs(self.theory, self.without ^ {name}, known=known)
        return self._change("effect", name, included, other, known)

    @cached_property
    def reduced(self) -> dict[str, float]:
        """Effect ↦ change of the history without it, as far as a reduced linear model can say it."""
        if HISTORY not in self.trial.wanted or self.without or HISTORY in self.own.failed:
            return {}
        return reduced_effects(self.trial, self.theory, self.trial.effects)

    @cached_property
    def off(self) -> Discretisation:
        """What steps and mesh of the case put its outputs off, as far as it can be told."""
        return discretisation(self.trial, self.theory, self.without)

    def discretisations(self) -> list[Change]:
        """Return what steps and mesh of the case put its outputs off, each as far as it can be told."""
        full = self.trial.full
        fixed = full.steps is not None and full.steps.step is not None
        keys = {
            "time.step" if fixed else "time.tolerance": self.off.steps,
            "mesh.degree" if from_file(full.problem) else "mesh.elements": self.off.mesh,
        }
        wanted = self.trial.wanted
        return [
            Change("discretisation", key, True, {name: found.get(name, 0.0) for name in wanted})
            for key, found in keys.items()
            if found
        ]

    def replaced(self, theory: str) -> Change:
        """Return what another theory makes of the case."""
        return self._change("theory", theory, theory == self.theory, self.trial.outputs(theory, self.without))

    def all(self) -> list[Change]:
        """Return every effect there are data for, then every other theory, the steps of a history, and the mesh."""
        self.trial.fit(self.off.steps.get(HISTORY, 0.0), self.off.sizes.get(HISTORY, 0.0))
        effects = [self.effect(name) for name in self.trial.effects]
        others = [self.replaced(name) for name in self.trial.theories if name != self.theory]
        return [*effects, *others, *self.discretisations()]

    def _change(
        self, kind: str, name: str, included: bool, other: Outputs, known: Mapping[str, float] | None = None
    ) -> Change:
        """Return the change to another model's outputs; of some outputs it may be known."""
        known = known or {}
        found = change(self.own, other, [output for output in self.trial.wanted if output not in known])
        estimate = {output: known.get(output, found.get(output, 0.0)) for output in self.trial.wanted}
        return Change(kind, name, included, estimate, notes(self.own, other))
