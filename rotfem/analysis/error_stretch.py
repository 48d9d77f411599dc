"""Windows of a motion one after the other, put together: what is done to each is done to all of them at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_recursion import Index, Spans, settled
from rotfem.analysis.error_samples import Inner
from rotfem.analysis.error_window import TINY, Window

Array = npt.NDArray[np.float64]

#: Steps from which windows are not put together, as numbers then take longer than what handles them.
MANY = 4000


def stretches(windows: Sequence[Window], within: bool = False) -> Iterator[tuple[Stretch, slice]]:
    """Yield the windows put together as far as they are short, `within` steps too, and which of them they are."""
    size, first = max(len(window.K) for window in windows), 0
    while first < len(windows):
        last, steps = first + 1, len(windows[first].lengths)
        while last < len(windows) and (steps := steps + len(windows[last].lengths)) <= MANY:
            last += 1
        yield Stretch(windows[first:last], size, within), slice(first, last)
        first = last


class Stretch:
    """Samples, steps and matrices of windows, with one number of coordinates: those that a window lacks do not move.

    Args:
        windows: one after the other.
        size: number of coordinates, r.
        within: whether instants within steps are wanted.

    Attributes:
        t: times of the samples, s, (N,).
        motion: c, ċ, c̈ of the samples, (N, r) each.
        begin, end: numbers of the samples that steps start and end with, (n,).
        of: numbers of the windows that steps are in, (n,).
        samples, steps: those of every window.
        pieces: numbers of the samples with which what drives the motion starts afresh.
        inner: the motion at instants within steps, (k, r) each; None where it is not known in all steps.
        inner_rows: those of every window.
    """

    def __init__(self, windows: Sequence[Window], size: int, within: bool = False):
        self.windows, self.size = windows, size
        self.t = np.concatenate([window.t for window in windows])
        self.motion = tuple(self._rows([window.motion[i] for window in windows]) for i in range(3))
        lengths = [len(window.t) for window in windows]
        offsets = np.cumsum([0, *lengths])
        ends = [window.ends for window in windows]
        self.begin, self.end = (
            np.concatenate([e[i] + at for e, at in zip(ends, offsets, strict=False)]) for i in (0, 1)
        )
        self.of: Index = np.repeat(np.arange(len(windows)), [len(e[0]) for e in ends])
        self.samples = _slices(lengths)
        self.steps = _slices([len(e[0]) for e in ends])
        pieces = [np.array(window.samples.pieces) + at for window, at in zip(windows, offsets, strict=False)]
        self.pieces: Index = np.concatenate(pieces)
        self.inner, self.inner_rows = self._within() if within else (None, [])

    def _within(self) -> tuple[Inner | None, list[slice]]:
        """Return the motion within the steps of all windows, and the rows of every window."""
        found = [window.inner for window in self.windows if window.inner is not None]
        if len(found) < len(self.windows):
            return None, []
        steps = np.concatenate([part.start + inner.steps for part, inner in zip(self.steps, found, strict=True)])
        if len(np.unique(steps)) < len(self.begin):
            return None, []
        motion = tuple(self._rows([inner.motion[i] for inner in found]) for i in range(3))
        t = np.concatenate([inner.t for inner in found])
        return Inner(steps, t, motion), _slices([len(inner.t) for inner in found])

    @property
    def C(self) -> Array:
        """For c̈ + C ċ + K c, (windows, r, r)."""
        return self._square([window.C for window in self.windows], 0.0)

    def stiffness(self, matrices: Sequence[Array]) -> Array:
        """Return K of the windows with one number of coordinates, (windows, r, r)."""
        return self._square(matrices, 1.0)

    @property
    def turns(self) -> Array:
        """What errors are handed on to every window by, (windows, r, r)."""
        return self._square([np.zeros((0, 0)) if w.turn is None else w.turn for w in self.windows], 0.0)

    @cached_property
    def vibrations(self) -> Array:
        """Amplitudes and rates, rad/s, of the vibrations that stretch, (windows, 2, r); ∞ of what bends, and of a hub.

        Of what goes slowly, and follows what bends, c̈/ω² and ċ/ω are next to nothing.
        """
        _, v, a = self.motion
        out = np.full((len(self.windows), 2, self.size), np.inf)
        for (amplitude, rate), window, part in zip(out, self.windows, self.samples, strict=True):
            which = np.flatnonzero(~window.bends)
            omega = np.sqrt(np.maximum(np.abs(window.shapes.squares[which]), TINY))
            amplitude[which] = np.hypot(a[part, which] / omega**2, v[part, which] / omega).max(axis=0)
            rate[which] = omega
        return out

    @property
    def tips(self) -> Array:
        """Displacement of the tip of each coordinate, (windows, r, d)."""
        out = np.zeros((len(self.windows), self.size, len(self.windows[0].shapes.tip)))
        for row, window in zip(out, self.windows, strict=True):
            row[: window.shapes.tip.shape[1]] = window.shapes.tip.T
        return out

    @cached_property
    def lengths(self) -> Array:
        """Of the steps, s."""
        return np.asarray(self.t[self.end] - self.t[self.begin])

    @property
    def at_ends(self) -> Spans:
        """The steps, and the samples around them."""
        piece = np.searchsorted(self.pieces, self.begin, side="right") - 1
        first, last = self.pieces[piece], np.append(self.pieces[1:], len(self.t))[piece] - 1
        return Spans(self.t[self.begin], self.lengths, self.begin, first, last)

    @cached_property
    def among(self) -> tuple[Index, Index]:
        """Numbers of the samples, and of the instants within steps, where both are put in one row; with instants."""
        assert self.inner is not None
        before = self.begin[self.inner.steps]
        samples = np.arange(len(self.t))
        return samples + np.searchsorted(before, samples), before + 1 + np.arange(len(before))

    @property
    def in_all(self) -> Spans:
        """The steps, the samples and the instants within steps around them, and those that a step has itself."""
        ends, (samples, _) = self.at_ends, self.among
        return Spans(
            ends.starts, ends.lengths, samples[ends.near], samples[ends.first], samples[ends.last], samples[self.end]
        )

    @property
    def in_middles(self) -> Spans:
        """The steps, and samples that lie in their middles: one fewer in each piece."""
        spans = self.at_ends
        piece = np.searchsorted(self.pieces, self.begin, side="right") - 1
        number = np.arange(len(self.begin))
        return Spans(spans.starts, spans.lengths, number, spans.first - piece, spans.last - piece - 1)

    def forces_off(self, names: Sequence[str]) -> Array:
        """Return what mesh and theory make of forces, shape (N, names, r).

        By frequencies (`space`) it is 2 ε c̈: of the forces of inertia, whose static answer the mesh puts off by 2 ε;
        by a theory (`model`) likewise. In large motions (`missing`) it is what the mesh leaves out of them.
        """
        out = np.zeros((len(self.t), len(names), self.size))
        a = settled(self.t, self.motion[2], self.pieces)
        for window, rows in zip(self.windows, self.samples, strict=True):
            r = len(window.epsilon)
            out[rows, 0, :r] = 2.0 * window.epsilon * a[rows, :r]
            if window.missing is not None and "missing" in names:
                out[rows, names.index("missing"), :r] = window.missing
            if window.theory is not None and "model" in names:
                out[rows, names.index("model"), :r] = 2.0 * window.theory * a[rows, :r]
        return out

    def _rows(self, arrays: Sequence[Array]) -> Array:
        """Return arrays (n, coordinates of a window) below one another, (Σ n, r)."""
        if all(x.shape[1] == self.size for x in arrays):
            return np.concatenate(arrays)
        out = np.zeros((sum(len(x) for x in arrays), self.size))
        for rows, x in zip(_slices([len(x) for x in arrays]), arrays, strict=True):
            out[rows, : x.shape[1]] = x
        return out

    def _square(self, matrices: Sequence[Array], diagonal: float) -> Array:
        """Return matrices of the coordinates with a value on the diagonal of those that are added."""
        out = np.tile(diagonal * np.eye(self.size), (len(matrices), 1, 1))
        for whole, A in zip(out, matrices, strict=True):
            whole[: A.shape[0], : A.shape[1]] = A
        return out


def _slices(lengths: Sequence[int]) -> list[slice]:
    """Return slices of these lengths one after the other."""
    at = np.cumsum([0, *lengths]).tolist()
    return [slice(*pair) for pair in pairwise(at)]


def in_windows(x: Any, matrices: Any, rows: Sequence[slice]) -> Any:
    """Return x Aᵀ of rows (N, r), A (windows, k, r) that of the window a row is in, shape (N, k)."""
    return np.concatenate([x[part] @ A.T for part, A in zip(rows, matrices, strict=True)])
