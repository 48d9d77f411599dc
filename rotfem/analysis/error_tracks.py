"""Errors of a motion from window to window, for the frequencies that its tangents say and others that they may mean.

A tangent in the middle of a window is that of one instant: what vibrates there has changed stress and stiffness. So the
squares of the frequencies are smoothed over windows, as α + β Ω² near each, and what scatters about that is how far
they are known. Where a phase would not be known by that, several tracks are followed, with frequencies all over the
range, and the largest error counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_recursion import Complex, Index, Propagator, accumulated, interpolated, settled
from rotfem.analysis.error_stretch import Stretch, in_windows, stretches
from rotfem.analysis.error_unresolved import largest_unresolved
from rotfem.analysis.error_window import TINY, Window

Array = npt.NDArray[np.float64]

#: Samples of γ a polynomial goes through, beyond the order of the scheme.
BEYOND = 2

#: Windows over which frequencies are smoothed, the phase (rad) that one may lose before others are tried, the number of
#: the lowest shapes whose phases count, and the most that squares of frequencies are tried above and below.
WIDTH, UNSURE, LOWEST, MOST = 1.5, 0.3, 3, 0.3

#: By what the largest of several tracks is multiplied: the true frequencies lie between them, or vary. Motions as large
#: as the structure feed errors by more than a tangent knows, even where all tracks agree: by as much again.
MARGIN = 1.3

#: Part of the length from which a motion is large; of smaller ones the mesh leaves out less of what large ones have, by
#: its square, and frequencies say the rest, as in linear theories.
LARGE = 0.3

#: Tracks: in which part of their scatter frequencies are tried, and the relative error below which none is; motions
#: then count as large by the square of their size in lengths of the structure.
FACTORS, SMALL = (0.0, -1.0, 1.0), 1e-3

#: In amplitudes, what a vibration is off by at most that has another frequency or phase.
OFF = 2.0

#: Factor to what instants within steps say of an error: a scheme and polynomials through them fail alike.
DOUBT = 2.0


def largest_errors(
    windows: Sequence[Window], scheme: Any, linear: bool, scale: float, length: float
) -> dict[str, tuple[float, float]]:
    """Return the largest errors of the tip, `time`, `space` and, by phases, `model`: size (m) and when (s).

    Args:
        windows: the motion.
        scheme: that made it.
        linear: whether the tangents are those of a linear theory, known as they are.
        scale: largest displacement of the tip, m.
        length: of the structure, m.
    """
    if linear:
        return _both(windows, _followed(windows, scheme, linear, [[window.K] for window in windows])[0])
    (changes, spreads), phase = smoothed(windows)
    sure = phase < UNSURE
    factors = FACTORS[:1] if sure else FACTORS
    stiffness = [
        [window.K + np.linalg.solve(window.M, np.diag(x + factor * y)) for factor in factors]
        for window, x, y in zip(windows, changes, spreads, strict=True)
    ]
    best, *others = _followed(windows, scheme, linear, stiffness)
    size, when = best["missing"]
    best["missing"] = (size * min(1.0, (scale / (LARGE * length)) ** 2), when)
    fed = 1.0 + scale / length
    if not sure and best["time"][0] >= SMALL * scale:
        times = [best["time"], *(found["time"] for found in others)]
        (largest, when), least = max(times), min(size for size, _ in times)
        best["time"] = (MARGIN * max(largest, fed * least), when)
        best["space"] = (MARGIN * fed * best["space"][0], best["space"][1])
        best["missing"] = (fed * best["missing"][0], best["missing"][1])
    elif not sure:
        large = min(1.0, (scale / length) ** 2)
        for name, most in (("time", MARGIN * fed), ("space", MARGIN * fed), ("missing", fed)):
            best[name] = ((1.0 + large * (most - 1.0)) * best[name][0], best[name][1])
    return _both(windows, best)


def _followed(
    windows: Sequence[Window], scheme: Any, linear: bool, stiffness: Sequence[Sequence[Array]]
) -> list[dict[str, tuple[float, float]]]:
    """Return the largest errors on every track (see `Tracks.errors`); of steps by all that is known of them.

    The ends of steps know too little of what drives a motion that goes up and down in each. What is known within the
    steps is what the scheme itself has seen of it.
    """
    found = Tracks(scheme, linear).errors(windows, stiffness)
    if any(window.inner is None for window in windows):
        return found
    for track, within in zip(found, Tracks(scheme, linear, within=True).errors(windows, stiffness), strict=True):
        size, when = within["time"]
        track["time"] = min(track["time"], (DOUBT * size, when))
    return found


def _both(windows: Sequence[Window], found: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Return errors: of space the largest one, by frequencies, resolved or not, or by what the motion lacks."""
    size, when = found["missing"]
    (resolved, at), (unresolved, later) = found["space"], largest_unresolved(windows)
    vibrating = (float(np.hypot(resolved, unresolved)), at if resolved > unresolved else later)
    return {"time": found["time"], "space": max(vibrating, (MARGIN * size, when)), "model": found["model"]}


def smoothed(windows: Sequence[Window]) -> tuple[tuple[list[Array], list[Array]], float]:
    """Return changes of the squares of frequencies in each window, and how far they are known; the phase at stake."""
    r = min(w.shapes.V.shape[1] for w in windows)
    squares = np.array([w.shapes.squares[:r] for w in windows])
    speeds = np.array([w.speed**2 for w in windows])
    number = np.arange(len(windows))
    fitted, spread = squares, np.zeros_like(squares)
    if len(windows) > 1:
        weights = np.exp(-0.5 * (np.subtract.outer(number, number) / WIDTH) ** 2)
        scaled = np.subtract.outer(speeds, speeds).T / (speeds.max() or 1.0)
        base = np.stack([np.ones_like(scaled), scaled], axis=2)  # of every window, at all windows
        weighed = np.swapaxes(weights[:, :, None] * base, 1, 2)
        fit = np.linalg.solve(weighed @ base + np.diag([0.0, 1e-3]), weighed @ squares)
        fitted = np.clip(fit[:, 0], squares.min(axis=0), squares.max(axis=0))  # a fit may overshoot, to below 0
        spread = np.sqrt((weights[:, None] @ (squares - base @ fit) ** 2)[:, 0] / weights.sum(axis=1)[:, None])
    spread = np.minimum(spread, MOST * np.abs(fitted))
    lengths = np.array([w.t[-1] - w.t[0] for w in windows])
    rates = np.sqrt(np.maximum(np.abs(fitted), 1e-300))
    phase = float(np.max((lengths[:, None] * spread / (2 * rates)).sum(axis=0)[:LOWEST], initial=0.0))
    around = [_padded(x, w) for x, w in zip(spread, windows, strict=True)]
    changes = [_padded(x, w) for x, w in zip(fitted - squares, windows, strict=True)]
    return (changes, around), phase


def limited(errors: Array, most: Array, omega: Array) -> Array:
    """Return errors c and ċ, (lanes, 2 r), with vibrations of c at rates ω, rad/s, that are no larger than `most`.

    Args:
        errors: c and ċ of every lane, (lanes, 2 r).
        most: largest amplitude of each coordinate, (r,); ∞ where there is no bound.
        omega: ω of each coordinate, (r,); ∞ where ċ does not count.
    """
    c, rate = errors.reshape(len(errors), 2, -1).swapaxes(0, 1)
    size = np.hypot(c, rate / omega)
    factor = np.minimum(1.0, most / np.maximum(size, TINY))
    return np.asarray(np.tile(factor, 2) * errors)


def _padded(x: Array, window: Window) -> Array:
    """Return changes of all coordinates of a window."""
    out = np.zeros(len(window.K))
    out[: len(x)] = x
    return out


def drives(stretch: Stretch, C: Array, K: Array, scheme: Any) -> Array:
    """Return γ over every step of a stretch, coefficients in powers of s/h, shape (powers, steps, tracks, r).

    Args:
        stretch: of the motion.
        C: its matrices, (windows, r, r).
        K: on every track, (windows, tracks, r, r).
        scheme: that made the motion.
    """
    (c, v, a), begin, end = stretch.motion, stretch.begin, stretch.end
    t, rows, later = stretch.t, stretch.samples, a
    if not scheme.balanced_at_end:
        t, c, v = (0.5 * (x[begin] + x[end]) for x in (t, c, v))
        later, rows = a[end], stretch.steps
    tracks, r = K.shape[1:3]
    apart, together = decoupled(K) if stretch.windows[0].free else (None, None)
    values = _forces((c, v, later), C, K, rows, apart)
    spans = stretch.at_ends if scheme.balanced_at_end else stretch.in_middles
    if stretch.inner is not None and scheme.balanced_at_end:
        (samples, within), spans, inner = stretch.among, stretch.in_all, stretch.inner
        own = _forces(inner.motion, C, K, stretch.inner_rows, apart)
        t, values = _merged(samples, within, (t, inner.t)), _merged(samples, within, (values, own))
    elif scheme.balanced_at_end:
        values = settled(t, values, stretch.pieces)
    found = interpolated(t, values, spans, scheme.order + BEYOND)
    found = np.moveaxis(found.reshape(*found.shape[:2], tracks, r), 1, 0)
    if together is not None:
        found = np.concatenate(
            [np.einsum("kij,qnkj->qnki", A, found[:, part]) for part, A in zip(stretch.steps, together, strict=True)],
            axis=1,
        )
    return found


def decoupled(K: Array) -> tuple[Array, Array]:
    """Return matrices that take forces apart into those on the eigenvectors of K (…, r, r), and put them together.

    What a free hub couples cancels in them. By itself each force of two that cancel is as quick as the quicker one, and
    what is taken for its course between samples is not that of the other.
    """
    values, vectors = np.linalg.eig(K)
    real = np.all(np.imag(values) == 0.0, axis=-1)[..., None, None]
    together = np.where(real, np.real(vectors), np.eye(K.shape[-1]))
    return np.linalg.inv(together), together


def _forces(motion: Sequence[Array], C: Array, K: Array, rows: Sequence[slice], apart: Array | None) -> Array:
    """Return c̈ + C ċ + K c of samples (n, r), in windows, on all tracks, (n, tracks r), taken apart by matrices."""
    c, v, a = motion
    tracks, r = K.shape[1:3]
    out = in_windows(c, K.reshape(len(K), -1, r), rows)
    out += np.tile(a + in_windows(v, C, rows), tracks)
    if apart is not None:
        parts = (np.einsum("kij,nkj->nki", A, out[p].reshape(-1, tracks, r)) for p, A in zip(rows, apart, strict=True))
        out = np.concatenate([part.reshape(-1, tracks * r) for part in parts])
    return np.asarray(out)


def _merged(samples: Index, within: Index, values: tuple[Array, Array]) -> Array:
    """Return values at samples and within steps in one row."""
    out = np.empty((len(samples) + len(within), *values[0].shape[1:]))
    out[samples], out[within] = values
    return out


class Tracks:
    """Errors that go from window to window, of time on several tracks, of space and model on the first one.

    Args:
        scheme: that made the motion.
        linear: whether what the tangents say may grow.
        within: whether instants within steps are samples, too.
    """

    def __init__(self, scheme: Any, linear: bool, within: bool = False):
        self.scheme, self.bounded, self.within = scheme, not linear, within
        #: Errors c and ċ at the end of the last window, (lanes, 2 r); a lane is an error on a track.
        self.carried: Array = np.zeros((0, 0))
        #: Largest vibration so far of each coordinate that stretches, (r,).
        self.ringing: Array = np.zeros(0)
        #: Names of the errors beside that of time.
        self.beside: list[str] = []

    def errors(
        self, windows: Sequence[Window], stiffness: Sequence[Sequence[Array]]
    ) -> list[dict[str, tuple[float, float]]]:
        """Return the largest errors of the tip on every track, size (m) and when (s), the others on the first.

        Args:
            windows: the motion.
            stiffness: K of every window on every track.
        """
        tracks = len(stiffness[0])
        by_theory = windows[0].theory is not None
        self.beside = ["space", *["missing"] * self.bounded, *["model"] * by_theory]
        self.lanes = np.array([*range(tracks), *[0] * len(self.beside)])
        best = [(0.0, 0.0)] * len(self.lanes)
        for stretch, which in stretches(windows, self.within):
            matrices = [stretch.stiffness(track) for track in zip(*stiffness[which], strict=True)]
            for found in self._through(stretch, np.stack(matrices, axis=1)):
                best = [max(pair) for pair in zip(best, found, strict=True)]
        out = [{"time": error} for error in best[:tracks]]
        out[0] |= dict.fromkeys(("missing", "model"), (0.0, 0.0)) | dict(zip(self.beside, best[tracks:], strict=True))
        return out

    def _through(self, stretch: Stretch, K: Array) -> Iterator[list[tuple[float, float]]]:
        """Go on with the errors through the windows of a stretch; yield the largest of the tip and when they are."""
        exact = Propagator(stretch.C, K, stretch.lengths, stretch.of, self.bounded)
        defects, turns, tips = self._defects(exact, stretch, K), stretch.turns, stretch.tips
        factors, vibrations = exact.carried[:, self.lanes], stretch.vibrations
        tracks, r = K.shape[1:3]
        if not self.carried.size:
            self.carried, self.ringing = np.zeros((len(self.lanes), 2 * r)), np.zeros(r)
        for i, steps in enumerate(stretch.steps):
            turned = (self.carried.reshape(-1, 2, r) @ turns[i].T).reshape(-1, 2 * r)
            start = exact.started(i, self.lanes, turned)
            errors = accumulated(start, factors[steps], defects[steps])
            amplitude, omega = vibrations[i]
            self.ringing = np.maximum(self.ringing, np.where(np.isfinite(amplitude), amplitude, 0.0))
            own = np.where(np.isfinite(amplitude), OFF * self.ringing, np.inf)
            self.carried = limited(exact.sampled(i, self.lanes, errors[-1]), own, omega)
            moved = exact.displacements(i, self.lanes, errors)
            beside = OFF * np.abs(stretch.motion[0][stretch.samples[i]]).max(axis=0)
            np.clip(moved[:tracks], -own, own, out=moved[:tracks])
            np.clip(moved[tracks:], -beside, beside, out=moved[tracks:])
            sizes = np.linalg.norm(moved @ tips[i], axis=2)
            at, times = sizes.argmax(axis=1), stretch.t[stretch.end[steps]]
            yield [(float(size[k]), float(times[k])) for size, k in zip(sizes, at, strict=True)]

    def _defects(self, exact: Propagator, stretch: Stretch, K: Array) -> Complex:
        """Return what steps, mesh and theory add to the errors in every step, shape (n, lanes, m)."""
        begin, end = stretch.begin, stretch.end
        (c, rate, _), tracks = stretch.motion, K.shape[1]
        states = exact.modal(c, rate, stretch.samples)
        forced = exact.forced(drives(stretch, stretch.C, K, self.scheme), stretch.steps, self.lanes[:tracks])
        off = stretch.forces_off(self.beside)
        beside = exact.forced(np.stack([off[begin], off[end] - off[begin]]), stretch.steps, self.lanes[tracks:])
        return np.concatenate([states[end] - exact.factors * states[begin] - forced, beside], axis=1)
