"""How a reduced model is solved in time: exactly where its matrices are constant, by batched collocation elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.collocation import NODES, Lacking, Operators, answered, batches, collocate
from rotfem.analysis.reduced.drive import Drive
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.propagator import Propagator, cubics
from rotfem.analysis.reduced.vibrations import Vibrations
from rotfem.errors import ComputationError

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

#: Relative change of a factor that is none.
SAME = 1e-12

#: Length of a first step times the lowest frequency, and fewest steps in a history.
LONG, FEWEST = 1.0, 32


@dataclass(frozen=True)
class Trajectory:
    """Coordinates and rates (n, m) at the times of a history.

    Attributes:
        q, v: coordinates and rates.
        steps: number of steps or intervals.
        exact: whether the solution is exact but for the cubics that stand for what drives it.
        at: (t (n,)) ↦ coordinates and rates (n, m) at other times (s), increasing.
    """

    q: Array
    v: Array
    steps: int
    exact: bool
    at: Callable[[Array], tuple[Array, Array]]


class Solution:
    """Solves reduced models of one history, which differ in their bases.

    Args:
        drive: what is prescribed.
        times: times at which the history is wanted, the first its start, s.

    Attributes:
        active: numbers of the pieces that are ever there.
        parts: in how many parts each of the first steps is cut.
        constant: whether the matrices are constant.
        vibrations: those of the history, once its steps are chosen and where they are known.
        off: relative error of the cubics that stand for the forces, of an exact solution.
    """

    def __init__(self, drive: Drive, times: Array):
        self.drive, self.times = drive, times
        self.parts = 1
        self.off = 0.0
        self.vibrations: Vibrations | None = None
        looks = drive.factors(drive.looks())
        self.active: Index = drive.active()
        kinds = np.array([p.kind for p in drive.system.pieces])
        matrices = looks[:, kinds != "f"]
        self.constant = bool(np.all(np.ptp(matrices, axis=0) <= SAME * np.abs(matrices).max(axis=0, initial=0.0)))
        self._looks = looks
        self._loads = np.flatnonzero(kinds == "f")
        self._steps: Array | None = None

    def solve(self, model: ReducedModel, q: Array, v: Array) -> Trajectory:
        """Return the history of a model from coordinates and rates (m,).

        Raises:
            ComputationError: it is not finite.
        """
        if model.size == 0:
            return nothing(len(self.times))
        path = self._exact(model, q, v) if self.constant else None
        path = path or self._collocated(model, q, v)
        if not np.all(np.isfinite(path.q)):
            raise ComputationError("the solution of the reduced model is not finite")
        return path

    def _cubics(self, times: Array) -> tuple[Array, Array]:
        """Return a grid that has these times, and coefficients of all loads' factors between its times."""
        grid = np.union1d(self.drive.knots, times)
        grid, coefficients, self.off = cubics(lambda t: self.drive.factors(t)[:, self._loads], self.drive.within, grid)
        return grid, coefficients

    @cached_property
    def _at_rows(self) -> tuple[Array, Array]:
        return self._cubics(self.times)

    def _exact(self, model: ReducedModel, q: Array, v: Array) -> Trajectory | None:
        """Return the exact solution; None where modal coordinates lose too many digits."""
        M, C, K, _ = model.operators(self._looks[:1])
        try:
            propagator = Propagator(M[0], C[0], K[0])
        except ComputationError:
            return None
        wanted = np.searchsorted(self._loads, model.kinds["f"])

        def solved(times: Array, cubes: tuple[Array, Array]) -> tuple[Array, Array]:
            grid, coefficients = cubes
            x, rates = propagator.solve(grid, coefficients[:, :, wanted] @ model.small["f"], q, v)
            rows = np.searchsorted(grid, times)
            return x[rows], rates[rows]

        here = self._at_rows
        return Trajectory(*solved(self.times, here), len(here[0]) - 1, True, lambda t: solved(t, self._cubics(t)))

    def _collocated(self, model: ReducedModel, q: Array, v: Array) -> Trajectory:
        ends = self.ends(model)
        steps = collocate(self._operators(model), self.drive.within, ends, q, v)
        return Trajectory(*steps.at(self.times), len(ends) - 1, False, steps.at)

    def given(self) -> dict[str, Array]:
        """Return what a free hub was given in the rows (see `FreeSolution`); nothing where none is free."""
        return {}

    @property
    def hub(self) -> Any:
        """The solution with its free hub (see `FreeSolution`); None where none is free."""
        return None

    def again(self, longer: int = 1) -> Solution:
        """Return a solution of equations with effects switched off or on, by steps so many times as long."""
        other = Solution(self.drive, self.times)
        other.parts, other._steps = -(-self.parts // longer), self._steps
        return other

    def answered(self, model: ReducedModel, q: Array, v: Array, lacking: Lacking) -> tuple[Trajectory, list[Array]]:
        """Return the history by collocation, and in its rows (n, m) the answers of the model from rest to other forces.

        Args:
            model: the reduced model.
            q: coordinates at the start, (m,).
            v: rates at the start, (m,).
            lacking: of the history, f in M a + C v + K q + f = 0.

        Raises:
            ComputationError: they are not finite.
        """
        ends = self.ends(model)
        steps, answers = answered(self._operators(model), self.drive.within, ends, q, v, lacking)
        found = [answer.at(self.times)[0] for answer in answers]
        path = Trajectory(*steps.at(self.times), len(ends) - 1, False, steps.at)
        if not all(np.all(np.isfinite(x)) for x in (path.q, *found)):
            raise ComputationError("the solution of the reduced model is not finite")
        return path, found

    def rounds(
        self, model: ReducedModel, start: tuple[Array, Array], lacking: Lacking, number: int
    ) -> tuple[Trajectory, list[Array]]:
        """Return the history by collocation, and in its rows (n, m) the answers to forces, of more rounds of the last.

        Forces are those of the history in the first round, and with the last answer so far in all others.

        Args:
            model: the reduced model.
            start: coordinates and rates at the start, (m,).
            lacking: see `answered`.
            number: how many rounds.
        """
        ends, operators, rest = self.ends(model), self._operators(model), np.zeros(model.size)
        steps, answers = answered(operators, self.drive.within, ends, *start, lacking)
        for _ in range(number - 1):
            moved, f = steps.plus(answers[-1]), []
            for part, t, h in batches(self.drive.within, ends):
                state = (x.reshape(-1, model.size) for x in moved.nodes(part))
                f.append(lacking(t.ravel(), *state)[-1].reshape(len(h), len(NODES), -1))
            answers.append(collocate(operators, self.drive.within, ends, rest, rest, np.concatenate(f)))
        found = [answer.at(self.times)[0] for answer in answers]
        return Trajectory(*steps.at(self.times), len(ends) - 1, False, steps.at), found

    def _operators(self, model: ReducedModel) -> Operators:
        return lambda t: model.operators(self.drive.factors(t))

    def ends(self, model: ReducedModel, longer: int = 1) -> Array:
        """Return the ends of the steps of a collocation, s, or of steps so many times as long."""
        if self._steps is None:
            self._steps = self._first_steps(model)
        return cut(self._steps, np.full(len(self._steps) - 1, -(-self.parts // longer)))

    def vibrating(self, vibrations: Vibrations, parts: int) -> float:
        """Return what the steps put vibrations off (m) if each of the first ones is cut in so many parts."""
        return 0.0 if self._steps is None else vibrations.off(self._steps, parts)

    def of_longer(self, longer: int) -> float:
        """Return what steps so many times as long put vibrations off, m; infinite where that is not known."""
        known = self.vibrations is not None and self.parts >= longer
        return self.vibrating(self.vibrations, -(-self.parts // longer)) if known and self.vibrations else np.inf

    def _first_steps(self, model: ReducedModel) -> Array:
        """Return the ends of steps that land on all knots and resolve the lowest vibration."""
        middle = self._looks[len(self._looks) // 2][None, :]
        M, _, K, _ = model.operators(middle)
        squares = np.abs(np.linalg.eigvals(np.linalg.solve(M[0], K[0])))
        knots = self.drive.knots
        slowest = LONG / np.sqrt(squares.min()) if squares.size else np.inf  # nothing may move
        longest = min(slowest, (knots[-1] - knots[0]) / FEWEST)
        return cut(knots, np.ceil(np.diff(knots) / longest * (1 - 1e-9)).astype(int))


def nothing(rows: int) -> Trajectory:
    """Return the history of a basis without columns."""
    none = np.zeros((rows, 0))
    return Trajectory(none, none, 0, True, lambda t: (np.zeros((len(t), 0)), np.zeros((len(t), 0))))


def cut(times: Array, parts: Index) -> Array:
    """Return times with each interval cut in so many equal parts, shape (sum of parts + 1,)."""
    begin = np.repeat(times[:-1], parts)
    lengths = np.repeat(np.diff(times) / parts, parts)
    first = np.cumsum(parts) - parts
    number = np.arange(len(begin)) - np.repeat(first, parts)
    return np.append(begin + number * lengths, times[-1])


def after(times: Array) -> Array:
    """Return times just after those given, where they have what follows a jump."""
    return np.asarray(times * (1 + 1e-12))
