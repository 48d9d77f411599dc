"""Refinement to an accuracy: from a coarse answer on, every contribution to its error is reduced by its order.

The error of an answer is known from differences of computed ones (`rotfem.refinement.companion`). With e the
contribution of steps or mesh and s the allowed one, the next answer has

    tolerance' = tolerance · s/e,    n' = n (e/s)^{1/(k + 1)},

n the number of elements of degree k. After an error of 100 % and more, s is at least the bound of the asymptotic range:
no order says how far a finer answer is. A model whose own error is too large is replaced by the next richer one. The
loop ends with the first answer whose error is within the accuracy, if nothing is left to refine, if a finer setting
gives the same answer (steps are no more exact than the increments of Newton's method), or if the next answer would
exceed the budget. Its time is predicted from the last one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Generic, Self, TypeVar

from mpi4py import MPI

from rotfem.errors import ComputationError, InputError
from rotfem.listeners import Compiling, Hint, cpu_time
from rotfem.refinement.estimate import ASYMPTOTIC

R = TypeVar("R")

#: Safety factor of estimated errors (theory.md, section 18). The part of the steps needs none: the difference of a
#: fourth-order scheme is not divided by 2^p − 1.
SAFETY = 2.0

#: Largest number of answers.
MOST_ANSWERS = 8

#: Aim of the next answer, as a part of the allowed contribution.
AIM = 0.5

#: First tolerance under a budget.
COARSE = 1e-2

#: Ratio of steps or cells of two answers whose difference bounds the error of the finer one, for orders p ≥ 2.
RATIO = math.sqrt(2.0)

#: Highest degree of elements.
HIGHEST = 6

#: Largest growth of the number of steps or cells from one answer to the next: errors are extrapolated over three
#: halvings at most.
MOST_GROWTH = 8.0

Elements = int | tuple[int, int] | None


@dataclass(frozen=True)
class Setting:
    """How an answer is computed.

    Attributes:
        models: keys of [model] of the available models, from the cheapest to the richest; the first is in use.
        elements: number of elements, (nx, ny) of a plate; None of a mesh file.
        degree: their polynomial degree.
        scheme: of the steps of a history; None without one.
        tolerance: of adaptive steps; None without.
        step: of fixed steps, s; None without.
    """

    models: tuple[Mapping[str, Any], ...]
    elements: Elements
    degree: int
    scheme: str | None = None
    tolerance: float | None = None
    step: float | None = None

    @property
    def moving(self) -> bool:
        """Whether it is that of a history."""
        return self.scheme is not None

    @property
    def theory(self) -> str:
        """Name of the theory in use."""
        return str(self.models[0]["theory"])

    def changes(self) -> dict[str, Any]:
        """Return the scene's keys ↦ values of this setting; None removes what the scene says."""
        out: dict[str, Any] = {f"model.{key}": value for key, value in self.models[0].items()}
        out["mesh.degree"] = self.degree
        if self.elements is not None:
            out["mesh.elements"] = list(self.elements) if isinstance(self.elements, tuple) else self.elements
        if self.moving:
            out |= {"time.scheme": self.scheme, "time.tolerance": self.tolerance, "time.step": self.step}
            out |= {"time.max_step": None, "time.min_step": None} if self.tolerance is None else {}
        return out

    def summary(self) -> dict[str, Any]:
        """Return the keys of the setting that are in use."""
        used = {**self.models[0], **{key: value for key, value in asdict(self).items() if key != "models"}}
        return {key: value for key, value in used.items() if value is not None}

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the setting of a row or a summary, with its model alone."""
        elements = tuple(row["elements"]) if isinstance(row.get("elements"), list) else row.get("elements")
        return cls(
            ({"theory": row["theory"]},),
            elements,
            row["degree"],
            row.get("scheme"),
            row.get("tolerance"),
            row.get("step"),
        )

    def key(self) -> str:
        """Return an identifier of the setting: all of it as JSON."""
        return json.dumps(asdict(self), sort_keys=True)

    def words(self) -> str:
        """Return it in words."""
        steps, cells = "", f", degree {self.degree}"
        if self.moving:
            length = f"to {self.tolerance:.2g}" if self.step is None else f"of {self.step:.3g} s"
            steps = f", steps {length} by {self.scheme}"
        if self.elements is not None:
            number = "×".join(map(str, self.elements if isinstance(self.elements, tuple) else [self.elements]))
            cells = f", {number} elements of degree {self.degree}"
        return f"{self.theory}{steps}{cells}"

    def richer(self) -> Self | None:
        """Return this setting with the next richer model; None if this is the richest."""
        return replace(self, models=self.models[1:]) if len(self.models) > 1 else None

    def finer(self, error: Mapping[str, Any], accuracy: float) -> Self | None:
        """Return the next setting after an answer that missed the accuracy; None where nothing is left to refine.

        Args:
            error: `time`, `space` and `model` of the answer, as far as it has them, None where unknown.
            accuracy: wanted.
        """
        allowed, new = (accuracy - contribution(error, "round_off")) / SAFETY, self
        if contribution(error, "model") > AIM * allowed:
            richer = self.richer()
            if richer is not None:
                return richer
            if contribution(error, "model") >= allowed:
                return None
        parts = max(1, ("time" in error) + ("space" in error))
        each = (allowed - contribution(error, "model")) / parts  # steps and mesh get equal parts of the rest
        if each <= 0.0:
            return None
        known, of_steps = contribution(error, "time"), SAFETY * each
        if self.tolerance is not None and (error.get("time", 0.0) is None or known > of_steps):
            less = aimed_at(known, of_steps) / known if known > 0.0 else AIM**2
            new = replace(new, tolerance=self.tolerance * max(less, MOST_GROWTH**-4))
        if (space := contribution(error, "space")) > each or error.get("space", 0.0) is None:
            order = 2 * self.degree if "round_off" in error else self.degree + 1  # of frequencies, of displacements
            growth = (space / aimed_at(space, each)) ** (1 / order) if space > 0.0 else 2.0
            if self.elements is not None:
                new = replace(new, elements=grown(self.elements, min(max(growth, 1.25), MOST_GROWTH)))
            elif self.degree < HIGHEST:
                new = replace(new, degree=self.degree + 1)
            else:
                return None
        return self.richer() if new == self else new

    def coarser(self) -> dict[str, Self]:
        """Return `time` and `space` ↦ a coarser setting; the difference of its answer bounds the error of this one.

        Steps or cells are longer by r = √2 or more: for an order p ≥ 2 the difference is (r^p − 1) ≥ 1 times the
        error. Steps of a fourth-order scheme are r times as long at r⁴ times the tolerance. A mesh file gets one degree
        less.
        """
        out = dict[str, Self]()
        if self.tolerance is not None:
            out["time"] = replace(self, tolerance=RATIO**4 * self.tolerance)
        if self.elements is None:
            return out | {"space": replace(self, degree=self.degree - 1)} if self.degree > 1 else out
        fewer = grown(self.elements, 1.0 / RATIO, math.floor)
        return out if fewer == self.elements else out | {"space": replace(self, elements=fewer)}

    def unknowns(self) -> float:
        """Return the number of nodes, which the number of unknowns is proportional to."""
        cells = self.elements if isinstance(self.elements, tuple) else (self.elements or 1,)
        return float(math.prod(n * self.degree + 1 for n in cells))

    def work(self) -> float:
        """Return a number proportional to the time of an answer: work of a step times number of adaptive steps.

        With n unknowns a step takes O(n) of a beam, whose matrices are a band, and O(n^{3/2}) of a plane mesh (nested
        dissection; A. George, SIAM J. Numer. Anal. 10, 1973).
        """
        power = 1.5 if isinstance(self.elements, tuple) else 1.0
        return float(self.unknowns() ** power * (self.tolerance or 1.0) ** -0.25)


def contribution(error: Mapping[str, Any], name: str) -> float:
    """Return a contribution to an error; 0 if it is unknown or missing."""
    return float(error.get(name) or 0.0)


def aimed_at(known: float, allowed: float) -> float:
    """Return what a contribution is to be in the next answer: a part of what is allowed.

    After an error of all of the output, which no order holds for, it is a part of the asymptotic range first.
    """
    return AIM * (allowed if known < 1.0 else max(allowed, ASYMPTOTIC))


def is_known(error: Mapping[str, Any]) -> bool:
    """Return whether all contributions to an error are known."""
    return all(error.get(name, 0.0) is not None for name in ("time", "space", "model"))


def is_within(error: Mapping[str, Any], accuracy: float) -> bool:
    """Return whether an error is known and bounds + SAFETY · estimates is within an accuracy.

    `time`, a plain difference, and `round_off` are bounds.
    """
    if not is_known(error) or error["total"] is None:
        return False
    bounds = contribution(error, "round_off") + contribution(error, "time")
    return bool(SAFETY * (error["total"] - bounds) + bounds <= accuracy)


def grown(
    elements: int | tuple[int, int], factor: float, rounded: Callable[[float], int] = math.ceil
) -> int | tuple[int, int]:
    """Return numbers of elements times a factor, at least 1 in each direction."""
    if isinstance(elements, tuple):
        x, y = (max(1, rounded(n * factor)) for n in elements)
        return x, y
    return max(1, rounded(elements * factor))


# --- time ------------------------------------------------------------------------------------------------------------


class OverBudget(ComputationError):
    """An answer would take more than is left of the budget."""


class Clock:
    """CPU time of the answers of a refinement, against a budget.

    Args:
        budget: of all answers together, s; None without a limit.
        comm: of the processes that compute them; rank 0 decides for all.
        announce: called with a line before every long answer; None for none.
        key: scene key or option of the budget.
    """

    def __init__(
        self, budget: float | None, comm: MPI.Comm, announce: Hint | None = None, key: str = "accuracy_budget"
    ):
        self.budget, self.comm, self.key, self._announce = budget, comm, key, announce or (lambda line: None)
        self.wanted: float | None = None
        self._started, self._compiling, self._began, self._next = cpu_time(), Compiling.seconds, 0.0, 1

    def used(self) -> float:
        """Return the time used so far, s."""
        return float(self.comm.bcast(cpu_time() - self._started))

    def compiled(self) -> float:
        """Return the time of compilation since the last answer began, s."""
        return float(self.comm.bcast(Compiling.seconds - self._compiling))

    def begin(self, words: str, number: int, predicted: float | None) -> None:
        """Begin an answer.

        Args:
            words: its setting.
            number: of the answer, from 1.
            predicted: time that it takes, s; None if unknown.

        Raises:
            OverBudget: that is more than is left.
        """
        self._began, self._compiling, self._next = self.used(), Compiling.seconds, 1
        if self.budget is not None and predicted is not None and predicted > self.budget - self._began:
            raise self._over(predicted)
        if predicted is not None and predicted > 5.0:
            self._announce(f"answer {number}: {words}: about {predicted:.2g} s")

    def __call__(self, steps: int, done: float) -> None:
        """Check the budget after a step of an answer.

        Args:
            steps: taken so far.
            done: part of the answer that is computed.

        Raises:
            OverBudget: the rest would take more than is left.
        """
        if self.budget is None or steps < self._next:
            return
        self._next = steps + max(1, steps // 8)
        start = self._began + self.compiled()
        left, elapsed = self.budget - start, self.used() - start
        # adaptive steps are extrapolated from a third of the remaining budget on
        if elapsed > left or (elapsed > left / 3 and elapsed > left * done):
            raise self._over(elapsed / done if done > 0.0 else None)

    def _over(self, predicted: float | None) -> OverBudget:
        self.wanted = predicted
        would = "" if predicted is None else f"the next answer would take about {predicted:.2g} s, "
        left = max(0.0, (self.budget or 0.0) - self._began)
        return OverBudget(
            f"{would}{left:.2g} s of {self.key} are left", advice=f"a looser accuracy, or a larger {self.key}"
        )

    def summary(self) -> dict[str, float | None]:
        """Return the table `budget` of a summary: `seconds`, `used`, and `wanted` by the answer that was refused."""
        return {"seconds": self.budget, "used": self.used(), "wanted": self.wanted}


# --- the loop --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer(Generic[R]):
    """A computed answer.

    Attributes:
        setting: how it was computed.
        error: `time`, `space`, `model`, … and `total`, relative.
        seconds: CPU time that it took, without compilation.
        result: what was computed.
    """

    setting: Setting
    error: Mapping[str, Any]
    seconds: float
    result: R

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: answers with a known error first, by their error."""
        total = self.error["total"]
        return (not is_known(self.error), math.inf if total is None else total)


@dataclass
class Refinement(Generic[R]):
    """The answers of a refinement.

    Attributes:
        tried: settings and errors of all answers.
        best: the best of them; None before the first.
        failure: why it ended before its accuracy was met; None if it did not.
    """

    tried: list[dict[str, Any]] = field(default_factory=list)
    best: Answer[R] | None = None
    failure: ComputationError | None = None

    def predicted(self, setting: Setting) -> float | None:
        """Return the predicted time (s) of an answer, from the best one of the same model; None without one."""
        if self.best is None or self.best.setting.models != setting.models:
            return None
        return self.best.seconds * setting.work() / self.best.setting.work()


def refine(
    first: Setting,
    compute: Callable[[Setting], tuple[R, Mapping[str, Any]]],
    accuracy: float,
    clock: Clock,
    found: Refinement[R] | None = None,
) -> Refinement[R]:
    """Return the answers up to the first whose error is within an accuracy, or up to the last possible one.

    Args:
        first: setting to begin with.
        compute: setting ↦ result and its error.
        accuracy: wanted.
        clock: of all answers.
        found: that answers are added to, so that an interrupt leaves them; a new one if None.

    Raises:
        ComputationError: no answer was found.
    """
    found = Refinement() if found is None else found
    following: Setting | None = first
    while following is not None and len(found.tried) < MOST_ANSWERS:
        setting, following, began = following, None, clock.used()
        try:
            clock.begin(setting.words(), len(found.tried) + 1, found.predicted(setting))
            result, error = compute(setting)
        except (InputError, ComputationError) as failure:  # a richer model may have what this one cannot
            why = failure.allowed if isinstance(failure, InputError) else failure.what
            found.tried.append({**setting.summary(), "failed": why, "seconds": clock.used() - began})
            over = isinstance(failure, OverBudget)
            following = None if over else setting.richer()
            if following is None:
                of_model = found.best is not None and found.best.setting.models == setting.models
                if isinstance(failure, InputError) or found.best is None or not (over or of_model):
                    raise
                found.failure = failure
            continue
        seconds = clock.used() - began
        answer = Answer(setting, error, seconds - clock.compiled(), result)
        found.tried.append({**setting.summary(), "error": error["total"], "seconds": seconds})
        same, met = found.best is not None and error == found.best.error, is_within(error, accuracy)
        if met or found.best is None or answer.rank <= found.best.rank:  # contributions do not weigh the same
            found.best = answer
        if same and is_known(error) and not met:
            what = "a finer setting gave the same answer"
            found.failure = ComputationError(what, advice="a looser accuracy, or a smaller solver.increment_tolerance")
        elif not met:
            following = clock.comm.bcast(setting.finer(error, accuracy))
    return found
