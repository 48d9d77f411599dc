"""Down the ladder to an accuracy: one rung at a time, until an answer is near enough to the one above it.

With q the ratio of the errors of two rungs and d the distance of their answers, the error of the finer one is
d/(q − 1), and is taken as SAFETY times that. q is the ratio of the tolerances or that of the meshes by their order,
whichever is smaller, and the observed ratio d'/d of the rungs above if that is smaller still. Above the asymptotic
range it is SAFETY d.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from rotfem import registry
from rotfem.accuracy.answer import Answer, Answers, Setting, distance
from rotfem.accuracy.errors import ASYMPTOTIC, Errors, of_theory, row
from rotfem.accuracy.ladder import TOLERANCES, ladder
from rotfem.errors import ComputationError, InputError
from rotfem.listeners import Compiling, Hint, cpu_time
from rotfem.results.distance import Spectrum

#: Factor of an extrapolated error; smallest ratio of the errors of two rungs that is reckoned with.
SAFETY, SLOW = 1.5, 1.2

#: Error of a rung of smooth motions as a part of its tolerance, by which the first rung is chosen; it decides nothing
#: but where the walk begins.
USUAL = 0.25

#: Rungs that may fail before one that does not.
MOST_FAILURES = 3

#: Seconds from which an answer is announced.
LONG = 5.0


class OverBudget(ComputationError):
    """An answer would take more than is left of the budget."""


class Clock:
    """CPU time of answers, against a budget.

    Args:
        budget: of all answers together, s; None without a limit.
        agree: value ↦ that of the first of several processes, which decides for all.
        announce: called with a line before every long answer; None for none.
        key: what the budget is called.
    """

    def __init__(
        self,
        budget: float | None,
        agree: Callable[[float], float] = float,
        announce: Hint | None = None,
        key: str = "accuracy_budget",
    ):
        self.budget, self._agree, self._announce, self.key = budget, agree, announce or (lambda line: None), key
        self.wanted: float | None = None
        self._started, self._began, self._compiling, self._next = cpu_time(), 0.0, Compiling.seconds, 1

    def used(self) -> float:
        """Return the time used so far, s."""
        return self._agree(cpu_time() - self._started)

    def begin(self, words: str, predicted: float | None) -> None:
        """Begin an answer.

        Args:
            words: its setting.
            predicted: time that it takes, s; None if unknown.

        Raises:
            OverBudget: that is more than is left.
        """
        self._began, self._compiling, self._next = self.used(), Compiling.seconds, 1
        if predicted is None:
            return
        predicted = self._agree(predicted)
        if self.budget is not None and predicted > self.budget - self._began:
            raise self._over(predicted)
        if predicted > LONG:
            self._announce(f"{words}: about {predicted:.2g} s")

    def __call__(self, steps: int, done: float) -> None:
        """Check the budget after a step of an answer, of which a part is done.

        Raises:
            OverBudget: the rest would take more than is left.
        """
        if self.budget is None or steps < self._next:
            return
        self._next = steps + max(1, steps // 8)
        start = self._began + self._agree(Compiling.seconds - self._compiling)
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


@dataclass
class Walk:
    """What a walk down the ladder has found.

    Attributes:
        rows: settings with their errors and seconds (see `rotfem.accuracy.errors.row`).
        best: the answer with the smallest known error, and its error; None before the first.
        met: whether that is within the accuracy.
        failure: why it ended before; None if it did not.
        following: the rung after the last one, and the ratio of their errors.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    best: tuple[Answer, Errors] | None = None
    met: bool = False
    failure: ComputationError | None = None
    following: tuple[Setting, float] | None = None

    def predicted(self) -> float | None:
        """Return the time of the next answer, s, by the growth of the last two; None without an answer."""
        times = [r["seconds"] for r in self.rows if "failed" not in r]
        if not times:
            return None
        return float(times[-1] * (min(max(times[-1] / max(times[-2], 1e-3), 1.0), 8.0) if len(times) > 1 else 2.0))

    def table(self) -> list[dict[str, Any]]:
        """Return the rows, and the next one extrapolated."""
        last, seconds = self.rows[-1], self.predicted()
        if last.get("error") is None or seconds is None or self.following is None:
            return self.rows
        setting, ratio = self.following
        return [*self.rows, row(setting, last["error"] / ratio, seconds, True)]

    def keep(self, answer: Answer, errors: Errors) -> None:
        """Keep an answer if nothing better is known."""
        if self.best is None or _size(errors) <= _size(self.best[1]) or self.best[1].total is None:
            self.best = answer, errors


def _size(errors: Errors) -> float:
    return math.inf if errors.total is None else errors.total


def walk(answers: Answers, accuracy: float, clock: Clock, found: Walk | None = None) -> Walk:
    """Return the answers down the ladder up to the first whose error is within an accuracy.

    Args:
        answers: of a scene.
        accuracy: wanted, relative.
        clock: of all of them.
        found: that they are added to, so that an interrupt leaves them; a new one if None.

    Raises:
        ComputationError: there is no answer.
        InputError: the scene cannot be computed.
    """
    found, model = Walk() if found is None else found, _Model()
    before: tuple[int, Answer] | None = None
    apart, refused = math.inf, None
    rungs = list(ladder(answers.scene, moving=answers.moving))
    for rung, setting in starting(rungs, accuracy):
        try:
            clock.begin(setting.words(), found.predicted())
            answer = answers(setting)
            if before is None:
                model = of_named_theory(answers, answer)
        except OverBudget as failure:
            found.failure = failure
            break
        except (ComputationError, InputError) as failure:
            found.rows.append({**row(setting, None, 0.0), "failed": "failed"})
            refused = failure if isinstance(failure, InputError) else None
            found.failure = failure if isinstance(failure, ComputationError) else None
            if before is not None or len(found.rows) >= MOST_FAILURES:
                break
            continue
        name = "discretisation" if setting.moving else "space"
        errors = Errors({name: None}, list(model.unknown), answer.output.scale)
        if before is not None:
            there, q = distance(answer, before[1]), TOLERANCES[before[0]] / TOLERANCES[rung]
            q = min(q, ratio_of(before[1].setting, setting, answers.scene.structure.type == "plate"))
            errors.parts[name] = reduced(there.size, apart, q)
            errors.at, apart = there.at, there.size
            if isinstance(answer.output, Spectrum) and apart > 0.0:
                errors.each = [float(e * (errors.parts[name] or 0.0) / apart) for e in there.each]
            if len(found.rows) == 1 and math.isfinite(apart):
                found.rows[0]["error"] = apart  # that of the first, but for the error of this one
        errors.parts |= {**model.parts, **answers.neglected}
        if (lost := answer.outcome.round_off) is not None:
            errors.parts["round_off"] = lost
        found.rows.append(row(answer.setting, errors.total, answer.seconds))
        found.failure, found.met = None, errors.total is not None and errors.total <= accuracy
        found.keep(answer, errors)
        if rung + 1 < len(rungs):
            found.following = rungs[rung + 1], TOLERANCES[rung] / TOLERANCES[rung + 1]
        if found.met or (model.parts.get("model") or 0.0) > accuracy:
            break
        before = rung, answer
    if found.best is None:
        raise refused or found.failure or ComputationError("no rung of the ladder has an answer")
    return found


def starting(rungs: Iterable[Setting], accuracy: float) -> Iterator[tuple[int, Setting]]:
    """Yield the rungs and their numbers from the one above the first that usually is within an accuracy."""
    first = next((r for r, tau in enumerate(TOLERANCES) if USUAL * tau <= accuracy), len(TOLERANCES) - 1)
    return ((r, setting) for r, setting in enumerate(rungs) if r >= max(0, first - 1))


def reduced(apart: float, before: float, q: float) -> float | None:
    """Return the error of the finer of two rungs; None where it is unknown.

    Args:
        apart: their distance.
        before: distance of the two rungs above; infinite without them.
        q: ratio of their errors.
    """
    if not math.isfinite(apart):
        return None
    observed = min(q, before / apart) if apart > 0.0 else q
    return SAFETY * apart / (max(observed, SLOW) - 1.0 if apart <= ASYMPTOTIC else 1.0)


def ratio_of(coarse: Setting, fine: Setting, plate: bool) -> float:
    """Return the ratio of the errors by the meshes of two rungs, by the order of displacements.

    That of degrees is (k'/k)² on plates, whose solutions are not smooth (the p-version converges twice as fast as the
    h-version: Babuška & Suri, SIAM Review 36 (1994) 578), and infinite on beams.
    """
    if coarse.degree != fine.degree:
        return (fine.degree / coarse.degree) ** 2 if plate else math.inf
    here, there = (n if isinstance(n, tuple) else (n or 1,) for n in (coarse.elements, fine.elements))
    return float(min(b / a for a, b in zip(here, there, strict=True)) ** (fine.degree + 1))


@dataclass(frozen=True)
class _Model:
    """Error of a theory, by name of the contribution, and why it is unknown."""

    parts: dict[str, float | None] = field(default_factory=dict)
    unknown: tuple[str, ...] = ()


def of_named_theory(answers: Answers, first: Answer) -> _Model:
    """Return the error of the theory that a scene names, by its first answer."""
    if registry.theories[first.setting.theory].exact:
        return _Model()
    errors = Errors({})
    return _Model({"model": of_theory(errors, answers, first, first)}, tuple(errors.unknown))
