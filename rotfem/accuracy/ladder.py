"""The ladder: settings in a row, each some six times as exact, and the walk down to an accuracy.

Rung r has the tolerance 5e-2, 1e-2, 2e-3, … of adaptive steps, or fixed steps whose error falls in the same ratio by
the order of their scheme. Its mesh starts with the fewest cells. An element of degree k has an error of h^(k+1) in
displacements (Strang & Fix 1973, section 3.4). So of a beam, whose solution is smooth, a degree more is worth more than
cells half as long, and costs less: the degree is raised first. Of a plate it is not: strains are not smooth at the
corners of a clamp, and the matrices of 32 cells of degree 2 take an eighth of the time of 8 cells of degree 4, which
have as many nodes. Its cells are cut, in elements of the least degree that does not lock. Of a mesh file only the
degree can be raised.

The walk takes steps and mesh one rung down at a time, until two answers are near enough. With q the ratio of their
errors and d their distance, the error of the finer one is d/(q − 1) and that of the coarser one q d/(q − 1). q is the
least of the ratio of the tolerances, that of the meshes and that of the numbers of steps, both by their order. SAFETY
times that is reported, and as many times more as the error of the coarser one has turned out larger than it was
reported; above the asymptotic range it is SAFETY d. Where the errors of steps and mesh differ by more than EVEN, only
the larger one is refined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from rotfem import registry
from rotfem.accuracy.answer import Answer, Answers, Elements, Setting, distance
from rotfem.accuracy.errors import ASYMPTOTIC, FLOOR, Errors, of_theory, order_of, row
from rotfem.errors import ComputationError, InputError
from rotfem.listeners import Compiling, Hint, cpu_time
from rotfem.results.distance import Spectrum
from rotfem.scene import Scene
from rotfem.scene.settings import estimates_error

#: Tolerances of the rungs.
TOLERANCES = (5e-2, 1e-2, 2e-3, 3e-4, 5e-5, 8e-6, 1.2e-6, 2e-7)

#: Number of elements and degree of a beam by rung.
BEAMS = ((2, 2), (2, 3), (2, 4), (3, 4), (4, 5), (6, 5), (8, 6), (12, 6))

#: Cells across the shorter edge of a plate by rung, of degree 2, or as triangles, one fewer, of degree 3; and the most
#: cells along the longer edge for each of them.
PLATES, LONG_EDGE = (2, 3, 4, 6, 9, 13, 19, 28), 4

#: Degree by rung of a mesh file.
FILES = (2, 3, 4, 5, 6)

#: Steps of the first rung of a fixed-step scheme, in the time of a history.
FIRST_STEPS = 50

#: Factor of the larger one of the errors of steps and mesh, which together are at most twice that.
SAFETY = 2.0

#: Ratio of the errors of steps and mesh up to which both are refined.
EVEN = 2.0

#: Error of a rung of smooth motions as a part of its tolerance, by which the first rung is chosen; it decides nothing
#: but where the walk begins.
USUAL = 0.25

#: Rungs that may fail before one that does not.
MOST_FAILURES = 3

#: Seconds from which an answer is announced.
LONG = 5.0

# --- the settings -----------------------------------------------------------------------------------------------------


def ladder(scene: Scene, theory: str | None = None, scheme: str = "esdirk4", moving: bool = True) -> Iterator[Setting]:
    """Yield the settings of a scene, from the cheapest one on.

    Args:
        scene: validated.
        theory: name; that of the scene if None.
        scheme: of the steps, adaptive where it estimates its error.
        moving: whether a history is computed, if the scene has [time].
    """
    own = Setting.of(scene, moving)
    estimates, order = estimates_error(registry.schemes[scheme]), registry.schemes[scheme].order
    for tolerance, (elements, degree) in zip(TOLERANCES, meshes_of(scene), strict=False):
        setting = Setting(theory or own.theory, elements, degree)
        if own.moving and scene.time is not None:
            number = round(FIRST_STEPS * (TOLERANCES[0] / tolerance) ** (1.0 / order))
            step = None if estimates else scene.time.end / number
            setting = replace(setting, scheme=scheme, tolerance=tolerance if estimates else None, step=step)
        yield setting


def meshes_of(scene: Scene) -> list[tuple[Elements, int]]:
    """Return the elements and their degree by rung."""
    structure: Any = scene.structure
    if structure.mesh_file is not None:
        return [(None, degree) for degree in FILES]
    if structure.type != "plate":
        return list(BEAMS)
    triangles = getattr(scene.mesh, "cell", None) == "triangle"
    return [(cells_of(structure.length / structure.width, n - triangles), 2 + triangles) for n in PLATES]


def cells_of(aspect: float, across: int) -> tuple[int, int]:
    """Return (nx, ny) of a rectangle of an aspect ratio with so many cells across its shorter edge."""
    along = across * min(round(max(aspect, 1 / aspect)), LONG_EDGE)  # so that both are cut in one ratio
    return (along, across) if aspect >= 1.0 else (across, along)


def ratio_of(coarse: Setting, fine: Setting, plate: bool) -> float:
    """Return the ratio of the errors by the meshes of two settings, by the order of displacements.

    That of degrees is (k'/k)² on plates, whose solutions are not smooth (the p-version converges twice as fast as the
    h-version: Babuška & Suri, SIAM Review 36 (1994) 578), and infinite on beams.
    """
    if coarse.degree != fine.degree:
        return (fine.degree / coarse.degree) ** 2 if plate else math.inf
    here, there = (n if isinstance(n, tuple) else (n or 1,) for n in (coarse.elements, fine.elements))
    return float(min(b / a for a, b in zip(here, there, strict=True)) ** (fine.degree + 1))


def more_steps(coarse: Answer, fine: Answer) -> float:
    """Return the ratio of the errors by the steps that two answers took; infinite without steps.

    Where kinks and rows of tables make the steps it is near 1, whatever the tolerances are.
    """
    if coarse.outcome.steps == 0:
        return math.inf
    return float((fine.outcome.steps / coarse.outcome.steps) ** order_of(fine.setting))


def reduced(apart: float, before: float, q: float) -> float:
    """Return the error of the finer of two answers.

    Args:
        apart: their distance.
        before: error that was reported of the coarser one; infinite if none was.
        q: ratio of their errors.
    """
    if apart > ASYMPTOTIC or q <= 1.0:
        return SAFETY * apart if q > 1.0 else math.inf
    return SAFETY * apart / (q - 1.0) * max(1.0, apart * q / (q - 1.0) / max(before, FLOOR))


# --- what it may cost -------------------------------------------------------------------------------------------------


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


# --- the walk ---------------------------------------------------------------------------------------------------------


@dataclass
class Walk:
    """What a walk down the ladder has found.

    Attributes:
        rows: settings with their errors and seconds (see `rotfem.accuracy.errors.row`), the last one extrapolated.
        best: the answer with the smallest known error, and its error; None before the first.
        met: whether that is within the accuracy.
        failure: why it ended before; None if it did not.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    best: tuple[Answer, Errors] | None = None
    met: bool = False
    failure: ComputationError | None = None

    def keep(self, answer: Answer, errors: Errors, accuracy: float) -> None:
        """Add an answer, and keep it if nothing better is known."""
        self.rows.append(row(answer.setting, errors.total, answer.seconds))
        known = math.inf if self.best is None or self.best[1].total is None else self.best[1].total
        if known == math.inf or (errors.total is not None and errors.total <= known):
            self.best = answer, errors
        self.failure, self.met = None, errors.total is not None and errors.total <= accuracy


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
    found, model, plate = found or Walk(), Errors({}), answers.scene.structure.type == "plate"
    rungs = list(ladder(answers.scene, moving=answers.moving))
    first = next((r for r, tau in enumerate(TOLERANCES) if USUAL * tau <= accuracy), len(TOLERANCES) - 1)
    at = dict.fromkeys(("space", "time") if answers.moving else ("space",), min(max(0, first - 1), len(rungs) - 1))
    parts, reported = dict.fromkeys(at, math.inf), dict[tuple[str, ...], float]()
    before: tuple[dict[str, int], Answer] | None = None
    refused, following = None, len(rungs)
    while max(at.values()) < len(rungs):
        setting = replace(rungs[at["space"]], tolerance=rungs[at.get("time", 0)].tolerance)
        try:
            clock.begin(setting.words(), None if before is None else before[1].predicted(setting))
            answer = answers(setting)
        except OverBudget as failure:
            found.failure = failure
            break
        except (ComputationError, InputError) as failure:
            found.rows.append({**row(setting, None, 0.0), "failed": "failed"})
            refused = failure if isinstance(failure, InputError) else None
            found.failure = failure if isinstance(failure, ComputationError) else None
            if before is not None or len(found.rows) >= MOST_FAILURES:
                break
            at = {name: rung + 1 for name, rung in at.items()}
            continue
        if before is None and (chords := answer.outcome.chords) > 0.0:
            model.parts["geometry"] = chords
        if before is None and not registry.theories[setting.theory].exact:
            model.parts["model"] = of_theory(model, answers, answer, answer)
        errors = Errors({}, list(model.unknown), answer.output.scale)
        error: float | None = None
        if before is not None:
            there, changed = distance(answer, before[1]), tuple(name for name in at if at[name] != before[0][name])
            for name in changed:
                q = TOLERANCES[before[0][name]] / TOLERANCES[at[name]]
                if name == "space":
                    q = min(q, ratio_of(before[1].setting, setting, plate))
                shown = more_steps(before[1], answer) if name == "time" else q
                parts[name] = reduced(there.size, reported.get(changed, math.inf), min(q, shown))
                if shown < q:  # the tolerance bounds what the controller sums
                    parts[name] = min(parts[name], there.size + TOLERANCES[at[name]])
            error = max(parts.values())
            reported[changed] = max(parts[name] for name in changed)
            error, errors.at = error if math.isfinite(error) else None, there.at
            if isinstance(answer.output, Spectrum) and error is not None and there.size > 0.0:
                errors.each = [float(e * error / there.size) for e in there.each]
            if len(found.rows) == 1 and math.isfinite(there.size):
                found.rows[0]["error"] = there.size  # that of the first, but for the error of this one
        errors.parts = {"discretisation" if answers.moving else "space": error, **model.parts, **answers.neglected}
        if (lost := answer.outcome.round_off) is not None:
            errors.parts["round_off"] = lost if before is None else min(lost, there.size)  # see `errors.estimate`
        found.keep(answer, errors, accuracy)
        following = max(at.values()) + 1
        curved = error is not None and (model.parts.get("geometry") or 0.0) > accuracy  # no degree reduces that
        if found.met or curved or (model.parts.get("model") or 0.0) > accuracy:
            break
        before, refine = (at, answer), [name for name in at if EVEN * parts[name] >= max(parts.values())]
        at = {name: rung + (name in refine) for name, rung in at.items()}
    if found.best is None:
        raise refused or found.failure or ComputationError("no rung of the ladder has an answer")
    if (error := found.rows[-1]["error"]) is not None and following < len(rungs):
        error *= TOLERANCES[following] / TOLERANCES[following - 1]
        found.rows.append(row(rungs[following], error, answer.predicted(rungs[following]), True))
    return found
