"""States that a motion has passed, kept until they are looked at together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.schemes import State

Array = npt.NDArray[np.float64]


@dataclass
class Inner:
    """A motion at instants within steps at which the equations hold.

    Attributes:
        steps: numbers of the steps, increasing, (k,).
        t: times, s, increasing, (k,).
        motion: displacements, rates and accelerations, (k, r) each.
    """

    steps: npt.NDArray[np.int64]
    t: Array
    motion: tuple[Array, ...]


@dataclass
class Samples:
    """States of a motion, and the steps between them.

    Attributes:
        states: t (s), q, v, a (local dof arrays), and what rotations are counted from.
        steps: numbers of the states that a step starts and ends with.
        pieces: numbers of the states with which what drives the motion starts afresh.
        size: largest displacement of the tip, m, once it is known.
        inner: number of the step, and t (s), q, v, a at instants within it at which the equations hold.
    """

    states: list[tuple[float, Array, Array, Array, Any]]
    steps: list[tuple[int, int]]
    pieces: list[int]
    size: float = np.inf
    inner: list[tuple[int, float, Array, Array, Array]] = field(default_factory=list)

    @cached_property
    def displacements(self) -> Array:
        """Displacements of the states, local dof arrays (n, unknowns)."""
        return np.array([state[1] for state in self.states])

    def within(self, coordinates: Callable[[Array], Array]) -> Inner | None:
        """Return the motion within steps in coordinates of local dof arrays (n, unknowns); None if none is known."""
        if not self.inner:
            return None
        steps, t, *motion = zip(*self.inner, strict=True)
        return Inner(np.array(steps), np.array(t), tuple(coordinates(np.array(x)) for x in motion))

    def forget(self) -> None:
        """Let go of the states; steps and pieces stay."""
        self.states.clear()
        self.inner.clear()
        vars(self).pop("displacements", None)

    @property
    def middle(self) -> tuple[int, float]:
        """Number of the state in the middle, and the length of the step to it, s."""
        t = [self.states[end][0] for _, end in self.steps]
        begin, end = self.steps[int(np.searchsorted(t, 0.5 * (t[0] + t[-1])))]
        return end, self.states[end][0] - self.states[begin][0]

    def state(self, number: int) -> State:
        """Return the state of a number."""
        t, q, v, a, datum = self.states[number]
        return State(t, q, v, a, datum=datum)

    def smooth(self, number: int) -> int:
        """Return how many states on either side of one are there and smooth with it."""
        own = int(np.searchsorted(self.pieces, number, side="right")) - 1
        first, last = self.pieces[own], [*self.pieces, len(self.states)][own + 1] - 1
        most, datum = min(number - first, last - number), self.states[number][4]
        around = range(1, most + 1)
        other = (i for i in around if not self.states[number - i][4] is self.states[number + i][4] is datum)
        return next(other, most + 1) - 1


def middle(lengths: Array) -> float:
    """Return the median of lengths; of an even number the upper one of the two in the middle."""
    half = len(lengths) // 2
    return float(np.partition(lengths, half)[half])
