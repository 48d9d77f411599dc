"""How much each effect and each theory changes an answer: plain runs with and without it, in one coarse setting.

The change of an output is the distance of two answers in the same setting (`rotfem.results.distance`). The setting is
the first one, from half the cells and a loose tolerance on, whose own answer is near to that of the next finer one.
Steps are then of equal length, as many as the adaptive ones of the own model, so that errors by steps cancel in the
difference. A change that is neither negligible nor large is computed in the finer setting, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rotfem import registry
from rotfem.accuracy.answer import Answer, Answers, Setting, distance
from rotfem.accuracy.errors import ASYMPTOTIC, finer, on_other_meshes
from rotfem.accuracy.ladder import TOLERANCES
from rotfem.errors import ComputationError, InputError

#: Names of the outputs that models are compared by.
HISTORY, STEADY, MODES = "history", "steady", "modes"

#: Factor within which two computed changes must agree, else the larger one is a bound; relative changes from which one
#: is noticeable, and large. They define the words of a verdict.
SAFETY, NOTICEABLE, LARGE = 3.0, 1e-2, 1e-1

#: Smallest change that is resolved: Newton's increments, and round-off of eigenvalues.
RESOLVED = 1e-8

#: Relative error of an answer above which changes are unknown: that of a sine delayed by a twelfth of its period.
FAR = 0.5

#: Settings of a history that are tried.
MOST = 5

#: Part of an accuracy that what is left out may change the answer by, all together.
SHARE = 0.25


@dataclass
class Change:
    """A change of the answer by an effect or a theory.

    Attributes:
        kind: "effect" or "theory".
        name: of the effect, or of the other theory.
        included: whether the own model has it.
        estimate: output ↦ relative change; infinite where the other model fails, None where it is unknown.
        notes: output ↦ why a model fails.
        bounds: outputs whose estimate is an upper bound.
        refused: why the scene cannot have it; "" if it can.
        truth: output ↦ relative change in the scene's own setting, where that was asked for.
    """

    kind: str
    name: str
    included: bool
    estimate: dict[str, float | None] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    bounds: list[str] = field(default_factory=list)
    refused: str = ""
    truth: dict[str, float] = field(default_factory=dict)

    def of(self, own: Setting) -> Setting:
        """Return a setting of the own model with this change."""
        if self.kind == "theory":
            return replace(own, theory=self.name)
        return replace(own, effects=tuple(sorted(set(own.effects or ()) ^ {self.name})))

    @property
    def worst(self) -> float:
        """Largest known estimate over the outputs."""
        return max((x for x in self.estimate.values() if x is not None), default=0.0)

    @property
    def verdict(self) -> str:
        """Word for it: "negligible" (SAFETY times it is below 1 %), "noticeable", "large" or "unknown"."""
        if self.refused:
            return "not available"
        if self.worst >= LARGE:
            return "large"
        if None in self.estimate.values():
            return "unknown"
        return "negligible" if SAFETY * self.worst < NOTICEABLE else "noticeable"

    def row(self) -> dict[str, Any]:
        """Return it as a dictionary for JSON."""
        row: dict[str, Any] = {"kind": self.kind, "name": self.name, "included": self.included}
        row |= {"estimate": self.estimate, "worst": self.worst, "verdict": self.verdict}
        more = {"notes": self.notes, "bounds": self.bounds, "truth": self.truth}
        return row | {name: value for name, value in more.items() if value}


@dataclass(frozen=True)
class Compared:
    """The own model in two settings that changes are computed in.

    Attributes:
        own: its answers in the coarse and the finer setting.
        error: of each, relative.
    """

    own: tuple[Answer, Answer]
    error: tuple[float, float]


def settings(own: Setting) -> Iterator[Setting]:
    """Yield settings from the coarsest on: half the cells, the scene's own, twice them where nothing moves."""
    coarse = on_other_meshes(own)[0]
    first = own if coarse.factor < 1.0 else coarse.setting
    if not own.moving:
        yield from dict.fromkeys((first, own, finer(own)))
        return
    for mesh, tolerance in zip((first, *[own] * MOST), TOLERANCES[:MOST], strict=False):
        yield replace(mesh, scheme="esdirk4", tolerance=tolerance, step=None, max_step=None)


def compared(answers: Answers, own: Setting) -> Compared:
    """Return the own model in the first setting whose answer is near that of the next one, and in that.

    Args:
        answers: of the scene.
        own: the setting that it says.

    Raises:
        ComputationError: the own model has no answer.
        InputError: likewise.
    """
    wanted = ASYMPTOTIC / SAFETY if own.moving else NOTICEABLE
    pair: tuple[Answer, ...] = ()
    failure: ComputationError | InputError | None = None
    for setting in settings(own):
        try:
            pair = (*pair[-1:], answers(setting))
        except (ComputationError, InputError) as error:  # elements of a lower degree lock, long steps may fail
            failure = error
            continue
        if len(pair) == 2 and distance(pair[1], pair[0]).size <= wanted:
            break
    if len(pair) < 2:
        raise failure or ComputationError("no setting has an answer")
    coarse, fine = pair
    apart = distance(fine, coarse).size
    if not own.moving:
        return Compared((coarse, fine), (apart, apart))
    fixed = [answers(in_equal_steps(answer, answers)) for answer in pair]
    errors = (distance(fine, fixed[0]).size, distance(fine, fixed[1]).size + apart / SAFETY)
    return Compared((fixed[0], fixed[1]), errors)


def in_equal_steps(answer: Answer, answers: Answers) -> Setting:
    """Return the setting of an adaptive answer with steps of equal length, as many as it took."""
    time = answers.scene.time
    assert time is not None
    return replace(answer.setting, tolerance=None, step=time.end / max(answer.outcome.steps, 1))


def explain(change: Change, output: str, answers: Answers, pair: Compared) -> None:
    """Write the change of an output: in the coarse setting, and in the finer one if it is not known then.

    It is known if it is large, if it is negligible with the own answer in the asymptotic range, or if both agree within
    SAFETY; else the larger one is a bound.
    """
    rough: float | None = None
    for own, error in zip(pair.own, pair.error, strict=True):
        try:
            size = distance(own, answers(change.of(own.setting))).size
            change.notes.pop(output, None)
        except ComputationError as failure:
            size, change.notes[output] = np.inf, failure.what
        except InputError as failure:
            change.refused, change.estimate[output] = failure.allowed, None
            return
        if error > FAR:
            change.estimate[output] = None
            continue
        change.estimate[output] = size
        if size >= LARGE or (error <= ASYMPTOTIC and SAFETY * size < NOTICEABLE):
            return
        if rough is not None and max(size, rough) > SAFETY * min(size, rough):
            change.estimate[output] = max(size, rough)
            change.bounds.append(output)
        rough = size


def fails(changes: list[Change], output: str, what: str) -> None:
    """Note that the own model has no such output."""
    for change in changes:
        change.estimate[output], change.notes[output] = np.inf, what


# --- the model that a scene calls for ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Needed:
    """The poorest model whose answer is within a part of an accuracy of the own one.

    Attributes:
        theory: name.
        effects: those that it has.
        dropped: names of effects that it has not.
        change: of the answer by all that is dropped together, and by the theory, relative.
        seconds: CPU times of a history with this model and with the own one in the setting of the comparison, s.
    """

    theory: str
    effects: tuple[str, ...]
    dropped: tuple[str, ...] = ()
    change: float = 0.0
    seconds: tuple[float, float] | None = None


def needed(
    changes: list[Change],
    own: Setting,
    accuracy: float,
    answers: Mapping[str, Answers],
    pairs: Mapping[str, Compared],
    theory: bool = True,
) -> Needed:
    """Return the model that an accuracy calls for.

    Effects go from the smallest one on, and the poorest theory is taken, while each change is within SHARE of the
    accuracy. Then all is left out together. While that changes an output by more, the largest of it is put back.

    Args:
        changes: by each effect and theory.
        own: setting of the own model, with its effects.
        accuracy: relative.
        answers: output ↦ answers of the scene.
        pairs: output ↦ the own model in the settings of the comparison; the first one gives the times.
        theory: whether a poorer one may be taken, too.
    """
    allowed, effects = SHARE * accuracy, own.effects or ()
    small = [c for c in changes if c.worst <= allowed and c.verdict not in ("unknown", "not available")]
    rank = {t.name: t.rank for t in registry.theories}
    poorer = [c for c in small if theory and c.kind == "theory" and rank[c.name] < rank[own.theory]]
    out = [c for c in small if c.kind == "effect" and c.included]
    out += sorted(poorer, key=lambda c: rank[c.name])[:1]
    while out:
        names = {c.name for c in out if c.kind == "effect"}
        there = next((c.name for c in out if c.kind == "theory"), own.theory)
        kept = tuple(name for name in effects if name not in names)
        try:
            both = [
                (p.own[0], answers[o](replace(p.own[0].setting, theory=there, effects=kept))) for o, p in pairs.items()
            ]
            change = max(distance(one, other).size for one, other in both)
        except (ComputationError, InputError):
            change = np.inf
        if change <= allowed:
            dropped = tuple(c.name for c in sorted(out, key=lambda c: c.worst) if c.kind == "effect")
            times = (both[0][1].seconds, both[0][0].seconds) if HISTORY in pairs else None  # others are too short
            return Needed(there, kept, dropped, change, times)
        out.remove(max(out, key=lambda c: c.worst))
    return Needed(own.theory, effects)
