"""How long the attempts at an accuracy take: predicted, told where it is long, and kept to what they may take in all.

An attempt takes what its forms and operators do, once, and from then on a time that goes with its work
(`rotfem.commands.attempts`). What has been computed by a theory predicts its next attempt before that starts; the first
one by a theory is predicted from its own first steps. All times are CPU time of rank 0, so that other programs on the
machine do not count and all ranks decide alike.
"""

from __future__ import annotations

from collections.abc import Callable

from mpi4py import MPI

from rotfem.commands.attempts import Rate, key, lasting, order_of, words, work
from rotfem.commands.cost.budget import cpu_time
from rotfem.errors import ComputationError
from rotfem.listeners import Hint
from rotfem.selection.accuracy import Settings

#: Attempts that are told, s; time of a march from which it predicts itself, s; change of a prediction that is told.
LONG, SHOWN, CHANGED = 5.0, 1.0, 1.5

#: By how much a prediction must exceed what is left to end an attempt, part of that from which adaptive steps are known
#: well enough for it, and part of it that a cheaper attempt is to take.
SURE, ADAPTED, FILLED = 1.1, 0.3, 0.7

#: Steps of a run beside from one look at the clock to the next, and adaptive steps that are those of a start.
STRIDE, FIRST = 16, 100

#: By how much looser accuracies are tried, and what to do where a budget does not do.
LOOSER = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 1e4)
TOO_LITTLE = "a looser accuracy, or a larger accuracy_budget"


class TooDear(ComputationError):
    """An attempt would take more than what is left of the budget."""


class Pace:
    """Watches the attempts of one pursuit.

    Args:
        budget: CPU time that they may take in all, compilation included, s; None where there is no limit.
        comm: of the processes that compute them.
        tell: takes a line on every attempt that is long; None tells nothing.
        end: of the history, s; 0 without one.

    Attributes:
        wanted: CPU time that the attempt which was too dear is predicted to take, s; None where none was.
        dear: its settings.
    """

    def __init__(self, budget: float | None, comm: MPI.Comm, tell: Hint | None = None, end: float = 0.0):
        self.budget, self.comm, self.end = budget, comm, end
        self._tell = tell or (lambda line: None)
        self.wanted: float | None = None
        self.dear: Settings | None = None
        self._started = cpu_time()
        self._rates: dict[str, Rate] = {}
        self._settings: Settings | None = None
        self._number, self._began, self._left, self._longer = 0, 0.0, 0.0, False
        self._forget()

    def _forget(self) -> None:
        """Start the clocks of an attempt."""
        self._marching: float | None = None
        self._next, self._told, self._steps = 0, 0.0, 0
        self._look = (0.0, 0.0)

    def _used(self) -> float:
        return float(self.comm.bcast(cpu_time() - self._started))

    def left(self) -> float:
        """Return the CPU time that is left, s; infinite without a limit."""
        return float("inf") if self.budget is None else self.budget - self._used()

    # --- before an attempt -------------------------------------------------------------------------------------------

    def begins(self, settings: Settings, number: int) -> None:
        """Take note that an attempt starts.

        Args:
            settings: that it is computed with.
            number: of it, from 1.

        Raises:
            TooDear: it is predicted to take more than what is left, or nothing is left and another one has been done.
        """
        self._settings, self._number, self._left = settings, number, self.left()
        self._began = self._used()
        self._forget()
        predicted = self.predicted(settings)
        if self._left <= 0.0 and number > 1:
            raise self._dear(predicted)
        if predicted is None:
            return
        if predicted > SURE * self._left:
            raise self._dear(predicted)
        self._say(predicted)

    def predicted(self, settings: Settings) -> float | None:
        """Return the CPU time (s) of an attempt; None where no other one by its theory has been computed."""
        rate = self._rates.get(key(settings))
        if rate is None:
            return None
        return rate.setup + rate.march * work(settings, self._count(settings, rate)) / rate.work

    def cheaper(self, looser: Callable[[float], Settings | None]) -> Settings | None:
        """Return settings of a looser accuracy that what is left suffices for, once.

        Args:
            looser: factor by which the accuracy is looser ↦ its settings, None where there are none.

        Returns:
            None where there are none, or it has been asked for before.
        """
        if self._longer:
            return None
        self._longer, allowed = True, FILLED * self.left()
        for factor in LOOSER:
            settings: Settings | None = self.comm.bcast(looser(factor))  # all ranks decide alike
            if settings is None:
                return None
            predicted = self.predicted(settings)
            if predicted is not None and predicted <= allowed:
                return settings
        return None

    # --- while it goes on --------------------------------------------------------------------------------------------

    def __call__(self, steps: int, share: float) -> None:
        """Take note of a step.

        Args:
            steps: number of those that were taken.
            share: of the history that they have gone through.

        Raises:
            TooDear: the attempt is predicted to take more than what is left.
        """
        self._steps = steps
        if steps < self._next:
            return
        elapsed = self._used() - self._began
        if self._marching is None:
            self._marching = elapsed
        march = elapsed - self._marching
        self._next = 2 * steps + 1 if march < SHOWN else steps + max(1, int(steps * SHOWN / march))
        assert self._settings is not None
        is_adaptive = self._settings.step is None
        if elapsed > self._left:
            raise self._dear(None)
        if march < SHOWN or (is_adaptive and steps < FIRST):
            return
        (before, gone), self._look = self._look, (elapsed, share)
        if share <= gone:
            return
        predicted = elapsed + (elapsed - max(before, self._marching)) * (1.0 - share) / (share - gone)
        self._learn(elapsed, (predicted - self._marching) / march)
        self._say(predicted, march)
        known = not is_adaptive or elapsed > ADAPTED * self._left
        if known and predicted > SURE * self._left:
            raise self._dear(predicted)

    def beside(self, steps: int, share: float) -> None:
        """Take note of a step of a run that is only compared (see `__call__`), which predicts nothing.

        Raises:
            TooDear: nothing is left.
        """
        if self.budget is not None and steps % STRIDE == 0 and self._used() - self._began > self._left:
            raise self._dear(None)

    def ends(self) -> None:
        """Take note that an attempt has been done, with the steps that it took."""
        if self._settings is None:
            return
        self._learn(self._used() - self._began, 1.0)

    def _learn(self, elapsed: float, whole: float) -> None:
        """Take up what the attempt has taken so far (s), and how many times as long all of its march would take."""
        assert self._settings is not None
        setup = elapsed if self._marching is None else self._marching
        steps = whole * self._steps
        rate = Rate(setup, whole * (elapsed - setup), work(self._settings, steps), steps, self._settings)
        self._rates[key(self._settings)] = rate

    def summary(self) -> dict[str, float | None]:
        """Return what a summary says of a budget: `seconds`, `used` and `wanted`, of the attempt that was too dear."""
        return {"seconds": self.budget, "used": self._used(), "wanted": self.wanted}

    def why(self) -> str:
        """Return what ends a message on an accuracy that was missed as an attempt was too dear; "" where none was."""
        if self.dear is None or self.budget is None:
            return ""
        would = "" if self.wanted is None else f", which would take about {lasting(self.wanted)}"
        settings = words(self.dear, self.end)
        return f", and of {lasting(self.budget)} allowed too little is left for more ({settings}{would})"

    def _dear(self, predicted: float | None) -> TooDear:
        self.wanted, self.dear = predicted, self._settings
        would = "" if predicted is None else f"would take about {lasting(predicted)}, "
        left = lasting(max(0.0, self._left))
        return TooDear(
            f"{would}{left} of accuracy_budget are left",
            advice=TOO_LITTLE,
        )

    def _say(self, predicted: float, march: float = 0.0) -> None:
        """Tell how long the attempt is predicted to take, if that is long and has not been told."""
        assert self._settings is not None
        is_new = self._told == 0.0 or not 1 / CHANGED < predicted / self._told < CHANGED
        if predicted < LONG or not is_new or (self._told > 0.0 and march < LONG):
            return
        self._told = predicted
        self._tell(f"attempt {self._number}: {words(self._settings, self.end)}: about {lasting(predicted)}")

    def _count(self, settings: Settings, rate: Rate) -> float:
        """Return the number of steps that settings are expected to need."""
        if settings.step is not None:
            return self.end / settings.step
        before = rate.settings
        if settings.tolerance is None or before.tolerance is None or before.step is not None:
            return rate.steps
        return float(rate.steps * (before.tolerance / settings.tolerance) ** (1 / order_of(settings)))
