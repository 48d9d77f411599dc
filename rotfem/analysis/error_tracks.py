"""Errors of a motion from window to window, for the frequencies that its tangents say and others that they may mean.

A tangent in the middle of a window is that of one instant: what vibrates there has changed stress and stiffness. So the
squares of the frequencies are smoothed over windows, as α + β Ω² near each, and what scatters about that is how far
they are known. Where a phase would not be known by that, several tracks are followed, with frequencies all over the
range, and the largest error counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_recursion import Propagator, accumulated, interpolated, settled
from rotfem.analysis.error_window import Window

Array = npt.NDArray[np.float64]

#: Samples of γ a polynomial goes through, beyond the order of the scheme.
BEYOND = 2

#: Windows over which frequencies are smoothed, the phase (rad) that one may lose before others are tried, the number of
#: the lowest shapes whose phases count, and the most that squares of frequencies are tried above and below.
WIDTH, UNSURE, LOWEST, MOST = 1.5, 0.3, 3, 0.3

#: By what the largest of several tracks is multiplied: the true frequencies lie between them, or vary. Motions as large
#: as the structure feed errors by more than a tangent knows, even where all tracks agree: by as much again.
MARGIN = 1.3

#: Tracks: in which part of their scatter frequencies are tried, and the relative error below which none is.
FACTORS, SMALL = (0.0, -1.0, 1.0), 1e-3


def largest_errors(
    windows: Sequence[Window], scheme: Any, linear: bool, scale: float, length: float
) -> dict[str, tuple[float, float]]:
    """Return the largest errors of the tip, `time` and `space`: size (m) and when (s).

    Args:
        windows: the motion.
        scheme: that made it.
        linear: whether the tangents are those of a linear theory, known as they are.
        scale: largest displacement of the tip, m.
        length: of the structure, m.
    """
    if linear:
        known = [window.K for window in windows]
        return _both(Track(scheme, linear).errors(windows, known, drives(windows, [known], scheme)[0]))
    (changes, spreads), phase = smoothed(windows)
    best: dict[str, tuple[float, float]] = {}
    least = np.inf
    sure = phase < UNSURE
    stiffness = [
        [window.K + np.diag(x + factor * y) for window, x, y in zip(windows, changes, spreads, strict=True)]
        for factor in (FACTORS[:1] if sure else FACTORS)
    ]
    forces = drives(windows, stiffness, scheme)
    for number, (K, driven) in enumerate(zip(stiffness, forces, strict=True)):
        found = Track(scheme, linear, space=not number).errors(windows, K, driven)
        best = {**found, **best, "time": max(best.get("time", (0.0, 0.0)), found["time"])}
        least = min(least, found["time"][0])
        if sure or best["time"][0] < SMALL * scale:
            break
    else:
        fed = 1.0 + scale / length
        best["time"] = (MARGIN * max(best["time"][0], fed * least), best["time"][1])
        best["space"] = (MARGIN * fed * best["space"][0], best["space"][1])
        best["missing"] = (fed * best["missing"][0], best["missing"][1])
    return _both(best)


def _both(found: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Return errors of time and space: of the latter the larger one, by frequencies or by what the motion lacks."""
    size, when = found.get("missing", (0.0, 0.0))
    return {"time": found["time"], "space": max(found["space"], (MARGIN * size, when))}


def smoothed(windows: Sequence[Window]) -> tuple[tuple[list[Array], list[Array]], float]:
    """Return changes of the squares of frequencies in each window, and how far they are known; the phase at stake."""
    r = min(w.shapes.V.shape[1] for w in windows)
    squares = np.array([w.shapes.squares[:r] for w in windows])
    speeds = np.array([w.speed**2 for w in windows])
    number = np.arange(len(windows))
    scale = speeds.max() or 1.0
    fitted, spread = squares.copy(), np.zeros_like(squares)
    for i in number if len(windows) > 2 else ():
        weights = np.exp(-0.5 * ((number - i) / WIDTH) ** 2)
        base = np.column_stack([np.ones(len(windows)), (speeds - speeds[i]) / scale])
        normal = base.T @ (weights[:, None] * base) + np.diag([0.0, 1e-3])
        fit = np.linalg.solve(normal, base.T @ (weights[:, None] * squares))
        fitted[i] = fit[0]
        spread[i] = np.sqrt(weights @ (squares - base @ fit) ** 2 / weights.sum())
    spread = np.minimum(spread, MOST * np.abs(fitted))
    lengths = np.array([w.t[-1] - w.t[0] for w in windows])
    rates = np.sqrt(np.maximum(np.abs(fitted), 1e-300))
    phase = float(np.max((lengths[:, None] * spread / (2 * rates)).sum(axis=0)[:LOWEST], initial=0.0))
    around = [_padded(x, w) for x, w in zip(spread, windows, strict=True)]
    changes = [_padded(x, w) for x, w in zip(fitted - squares, windows, strict=True)]
    return (changes, around), phase


def _padded(x: Array, window: Window) -> Array:
    """Return changes of all coordinates of a window."""
    out = np.zeros(len(window.K))
    out[: len(x)] = x
    return out


def drives(windows: Sequence[Window], stiffness: Sequence[Sequence[Array]], scheme: Any) -> list[list[Array]]:
    """Return γ over every step as polynomials (see `interpolated`), for every track and window.

    Args:
        windows: the motion.
        stiffness: K of every track and window.
        scheme: that made the motion.
    """
    found = [_drives(window, matrices, scheme) for window, *matrices in zip(windows, *stiffness, strict=True)]
    return [list(track) for track in zip(*found, strict=True)]


def _drives(window: Window, stiffness: Sequence[Array], scheme: Any) -> list[Array]:
    """Return γ over every step of a window with one K or another: all at once, as they have the same samples."""
    (c, v, a), most = window.motion, scheme.order + BEYOND
    begin, end = window.ends
    t, later = window.t, a
    if not scheme.balanced_at_end:
        t, c, v = (0.5 * (x[begin] + x[end]) for x in (t, c, v))
        later = a[end]
    rest = later + v @ window.C.T
    values = np.hstack([rest + c @ K.T for K in stiffness])
    if scheme.balanced_at_end:
        values = settled(t, values, np.array(window.samples.pieces))
    spans = window.at_ends if scheme.balanced_at_end else window.in_middles
    return np.split(interpolated(t, values, spans, most), len(stiffness), axis=2)


class Track:
    """Errors of time and space that go from window to window.

    Args:
        scheme: that made the motion.
        linear: whether what the tangents say may grow.
        space: whether the error of space is wanted too.
    """

    def __init__(self, scheme: Any, linear: bool, space: bool = True):
        self.scheme, self.bounded, self.space = scheme, not linear, space
        self.carried: Array = np.zeros((0, 2, 0))

    def errors(
        self, windows: Sequence[Window], stiffness: Sequence[Array], forces: Sequence[Array]
    ) -> dict[str, tuple[float, float]]:
        """Return the largest errors of the tip: size (m) and when (s).

        Args:
            windows: the motion.
            stiffness: K of every window.
            forces: γ over the steps of every window (see `drives`).
        """
        best: dict[str, tuple[float, float]] = dict.fromkeys(("time", "space", "missing"), (0.0, 0.0))
        for window, K, driven in zip(windows, stiffness, forces, strict=True):
            found = self._through(window, K, driven)
            best |= {name: max(best[name], error) for name, error in zip(best, found, strict=False)}
        return best

    def _through(self, window: Window, K: Array, driven: Array) -> list[tuple[float, float]]:
        """Go on with the errors through a window; return the largest of the tip and when they are."""
        (begin, end), h = window.ends, window.lengths
        exact = Propagator(window.C, K, h, self.bounded)
        states = exact.modal(*window.motion[:2])
        defects = states[end] - exact.factors * states[begin] - exact.forced(driven)
        parts = [defects]
        if self.space:
            for off in self._mesh_forces(window, not self.bounded):
                parts.append(exact.forced(np.stack([off[begin], off[end] - off[begin]], axis=1)))
        c, rate = self._start(window, len(parts))
        errors = accumulated(exact.modal(c, rate), exact.carried, np.stack(parts, axis=1))
        self.carried = exact.sampled(errors[-1]).reshape(len(parts), 2, -1)
        r, tip = window.shapes.V.shape[1], window.shapes.tip
        self.carried[:, :, :r] *= window.bends  # what stretches has no phase to lose
        moved = [exact.displacements(e)[:, :r] for e in np.moveaxis(errors, 1, 0)]
        if self.space:  # a vibration of another frequency is off by twice its amplitude at most
            most = 2.0 * np.abs(window.motion[0][:, :r]).max(axis=0)
            moved[1:] = [np.clip(c, -most, most) for c in moved[1:]]
        sizes = [np.linalg.norm(c @ tip.T, axis=1) for c in moved]
        return [(float(size.max()), float(window.t[end[int(size.argmax())]])) for size in sizes]

    def _start(self, window: Window, parts: int) -> tuple[Array, Array]:
        """Return the errors that a window starts with, c and ċ, shape (parts, r) each."""
        if window.turn is None or not self.carried.size:
            zero = np.zeros((parts, len(window.K)))
            return zero, zero
        turned = self.carried @ window.turn.T
        return turned[:, 0], turned[:, 1]

    @staticmethod
    def _mesh_forces(window: Window, linear: bool) -> list[Array]:
        """Return what the mesh makes of forces: by frequencies, and of a nonlinear theory what it leaves out of them.

        The one is 2 ε c̈: of the forces of inertia, whose static answer the mesh puts off by 2 ε.
        """
        a = settled(window.t, window.motion[2], np.array(window.samples.pieces))
        out = [np.zeros_like(a) for _ in ("vibrating", "missing")[: 1 if linear else 2]]
        r = len(window.epsilon)
        out[0][:, :r] = 2.0 * window.epsilon * a[:, :r]
        if window.missing is not None:
            out[1][:, :r] = window.missing
        return out
