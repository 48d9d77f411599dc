"""The attempts at an accuracy, one after the other: what one has given, or how it has failed, says what follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any, Generic, TypeVar

from rotfem.commands.accuracy import is_met, known, missed, told
from rotfem.commands.ahead import Ahead
from rotfem.commands.interrupts import together
from rotfem.commands.pace import TOO_LITTLE, Pace, TooDear
from rotfem.errors import ComputationError
from rotfem.results.result import Result
from rotfem.results.run import RunResult
from rotfem.scene import Scene
from rotfem.selection.accuracy import Settings

R = TypeVar("R", bound=Result)

#: Settings that are tried at most, and what is left of an error that finer settings have not made smaller.
MOST_ATTEMPTS, STALLED = 6, 0.9

#: Loosest accuracy that is tried where a budget allows no better one.
LOOSEST = 0.1


def pursue(
    scene: Scene, settings: Settings, attempt: Callable[[Settings], R], pace: Pace, ahead: Ahead | None = None
) -> R:
    """Return the first result whose estimated error meets the accuracy of a scene.

    Args:
        scene: with an accuracy.
        settings: to begin with.
        attempt: settings ↦ their result, with an `error` in its summary.
        pace: of the attempts, with the communicator of the processes that compute them.
        ahead: what the attempts have shown of a motion; None without one.

    Raises:
        Missed: it was not met; its attribute `result` holds the best that was reached.
        ComputationError: the richest model failed.
        KeyboardInterrupt: its attribute `result` holds the best that was reached, if anything was.
    """
    pursuit: Pursuit[R] = Pursuit(scene, pace, ahead)
    following: Settings | None = settings
    while following is not None:
        following = pursuit.after(following, attempt)
    return pursuit.concluded()


@dataclass(frozen=True)
class Best(Generic[R]):
    """The best result so far.

    Attributes:
        done: the result.
        settings: that it was computed with.
        seconds: that it took.
    """

    done: R
    settings: Settings
    seconds: float

    def or_before(self, before: Best[R] | None) -> Best[R]:
        """Return the better one of this and one before it, which must be better to stay."""
        return self if before is None or rank(self.done) <= rank(before.done) else before


class Pursuit(Generic[R]):
    """The attempts so far.

    Args:
        scene: with an accuracy.
        pace: of the attempts.
        ahead: what they have shown of a motion; None without one.

    Attributes:
        tried: what they were and gave, as a summary says it.
        best: their best result; None before the first.
        failure: of the last one, where one before it stands; None of all others.
    """

    def __init__(self, scene: Scene, pace: Pace, ahead: Ahead | None):
        self.scene, self.pace, self.ahead, self.comm = scene, pace, ahead, pace.comm
        self.tried: list[dict[str, Any]] = []
        self.best: Best[R] | None = None
        self.failure: ComputationError | None = None
        self._started = perf_counter()

    def after(self, settings: Settings, attempt: Callable[[Settings], R]) -> Settings | None:
        """Make an attempt; return the settings of the one that is to follow, None if it was the last.

        Raises:
            ComputationError: it has failed, and nothing stands that was computed before.
            KeyboardInterrupt: with the best result so far, if there is one.
        """
        began = perf_counter()
        try:
            self.pace.begins(settings, len(self.tried) + 1)
            done = attempt(settings)
            self.pace.ends()
        except ComputationError as failure:
            self.tried.append({**settings.summary(), "failed": failure.what, "seconds": perf_counter() - began})
            return self._after_failure(settings, failure)
        except KeyboardInterrupt as stop:
            self._leave_best(stop)
            raise
        error = done.summary["error"]
        if self.ahead is not None and isinstance(done, RunResult):
            self.ahead.judge(done, settings)
        seconds = perf_counter() - began
        self.tried.append({**settings.summary(), "error": error["total"], "seconds": seconds})
        self.best = Best(done, settings, seconds).or_before(self.best)
        is_over = is_met(self.scene, error) or len(self.tried) == MOST_ATTEMPTS or stalled(self.tried)
        found: Settings | None = self.comm.bcast(None if is_over else self._next(settings, done))
        return found

    def _next(self, settings: Settings, done: R) -> Settings | None:
        """Return the settings to follow those of a result that has missed; None where none would meet the accuracy."""
        error, accuracy = done.summary["error"], self.scene.accuracy
        assert accuracy is not None
        following = settings.better(error, accuracy)
        if following is None or self.ahead is None:
            return following
        if following.models == settings.models:
            return self.ahead.meshed(following, error)
        return self.ahead.prepared(following, error)

    def _after_failure(self, settings: Settings, failure: ComputationError) -> Settings | None:
        """Return the settings to follow those of an attempt that has failed, None where one before it stands.

        What was computed with the same model does; one of another model is another motion.

        Raises:
            ComputationError: there are none, and none stands.
        """
        may_follow = len(self.tried) < MOST_ATTEMPTS
        if isinstance(failure, TooDear):
            cheaper = self.pace.cheaper(partial(self._looser, settings)) if may_follow else None
            if cheaper is None and self.best is None:
                raise failure
            return cheaper
        richer = settings.richer() if may_follow else None
        if richer is not None:
            found: Settings = richer if self.ahead is None else self.comm.bcast(self.ahead.prepared(richer, {}))
            return found
        if self.best is None or self.best.settings.models != settings.models:
            raise failure
        self.failure = failure
        return None

    def _looser(self, settings: Settings, factor: float) -> Settings | None:
        """Return settings of a history for an accuracy that is so many times looser; None where there are none."""
        accuracy = self.scene.accuracy
        assert accuracy is not None
        if not settings.moving or settings.models[0].get("reduced") or factor * accuracy > LOOSEST:
            return None
        planned = settings if self.ahead is None else self.ahead.looser(settings, factor)
        return planned if planned != settings else settings.looser(factor)

    def _leave_best(self, stop: KeyboardInterrupt) -> None:
        """Leave the best result to what interrupts the attempts: it is whole, and theirs is not."""
        if self.best is None or not together(self.comm, stop):
            return
        done = self.best.done
        done.summary["status"] = "interrupted"
        self._describe(self.best)
        vars(stop)["result"] = done

    def _describe(self, best: Best[R]) -> None:
        """Write into the summary of a result how it was found."""
        done = best.done
        done.summary["scene"] = self.scene.digest()
        done.summary["accuracy"] = told(self.scene, best.settings, done.summary["error"], self.tried)
        if self.pace.budget is not None:
            done.summary["accuracy"]["budget"] = self.pace.summary()
        timings = done.summary["timings"]
        timings["choice"] = perf_counter() - self._started - best.seconds
        timings["total"] += timings["choice"]

    def concluded(self) -> R:
        """Return the best result with what its summary says of how it was found.

        Raises:
            Missed: it does not meet the accuracy.
        """
        assert self.best is not None
        done = self.best.done
        self._describe(self.best)
        if self.ahead is not None:
            done.summary["accuracy"]["effects"] = self.ahead.effects(done.summary["error"])
        if is_met(self.scene, done.summary["error"]):
            return done
        if self.failure is not None:
            raise missed(self.scene, done, f", and a further attempt failed: {self.failure.what}", self.failure.advice)
        raise missed(self.scene, done, self.pace.why(), None if self.pace.dear is None else TOO_LITTLE)


def rank(done: Result) -> tuple[bool, float]:
    """Return by what results are better: those whose error is known come first, by their error."""
    error = done.summary["error"]
    return (not known(error), float("inf") if error["total"] is None else error["total"])


def stalled(tried: list[dict[str, Any]]) -> bool:
    """Return whether finer settings of the same model have not made the error smaller."""
    if len(tried) < 2 or "error" not in tried[-2]:
        return False
    before, now = tried[-2:]
    is_same = all(now[key] == before[key] for key in ("theory", "reduced"))
    return is_same and None not in (now["error"], before["error"]) and now["error"] >= STALLED * before["error"]
