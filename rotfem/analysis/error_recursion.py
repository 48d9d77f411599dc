"""The error equation of sampled motions: exact propagation between samples against what a scheme made of it.

For ẏ = A y + (0, γ), y = (c, ċ), with γ known at samples, the exact solution of a step from y_n is

    y*_{n+1} = e^{Ah} y_n + ∫ e^{A(h−s)} (0, γ(s)) ds,

γ a polynomial through the samples around the step. What the scheme made is y_{n+1}; so its error obeys
e_{n+1} = e^{Ah} e_n + y_{n+1} − y*_{n+1}. In eigenvectors of A all of it is scalar.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isqrt

import numpy as np
import numpy.typing as npt

from rotfem.analysis.error_samples import middle

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]

#: |λh| up to which integrals are summed by Gauss points, and these points and weights on (−1, 1).
SMALL, GAUSS = 1.0, np.polynomial.legendre.leggauss(8)

#: Samples at the start of a piece that may jump, those after its first that are looked at, and how many times the bends
#: of these theirs are then.
EARLY, AFTER, JUMP = 3, 8, 4.0

#: Difference of places of samples, in steps, up to which they are alike.
ALIKE = 1e-6

#: Steps on either side in which samples show whether they are smooth.
NEAR = 3


class Propagator:
    """Exact steps of c̈ + C ċ + K c = γ, in coordinates one for each eigenvalue or pair of conjugate ones.

    Args:
        C: of the equation in every window, shape (w, r, r).
        K: of the equation in every window, on each of k tracks, shape (w, k, r, r).
        h: lengths of the steps, s, shape (n,).
        of: numbers of the windows that the steps are in, increasing, shape (n,).
        bounded: whether errors do not grow by themselves, whatever C and K say.

    Attributes:
        factors, carried: e^{λh} of states and of errors, shape (n, k, m).
    """

    def __init__(self, C: Array, K: Array, h: Array, of: Index, bounded: bool = False):
        r = K.shape[-1]
        A = np.zeros((*K.shape[:2], 2 * r, 2 * r))
        A[..., :r, r:] = np.eye(r)
        A[..., r:, :r], A[..., r:, r:] = -K, -C[:, None]
        values, vectors = (x.astype(complex) for x in np.linalg.eig(A))
        inverse = np.linalg.inv(vectors)
        upper = values.imag >= 0.0
        # Where matrices have more real eigenvalues than others, these are filled up by ones that move nothing.
        order = np.argsort(~upper, axis=-1, kind="stable")[..., : upper.sum(axis=-1).max()]
        self._values: Complex = np.take_along_axis(values, order, -1)
        self._inverse: Complex = np.take_along_axis(inverse, order[..., None], -2)
        twice = 1.0 + np.sign(self._values.imag)
        self._vectors: Complex = twice[..., None, :] * np.take_along_axis(vectors, order[..., None, :], -1)
        self._h, self._of_length = h, _alike(h, of)
        first = np.unique(self._of_length, return_index=True)[1]
        self._lengths: Complex = h[first, None, None] * self._values[of[first]]
        factors: Complex = np.exp(self._lengths)
        self.factors: Complex = factors[self._of_length]
        self.carried: Complex = self.factors
        if bounded:
            self.carried = (factors / np.maximum(np.abs(factors), 1.0))[self._of_length]
        self._sampled = np.abs(self._values) * _medians(h, of, len(K))[:, None, None] < np.pi

    def modal(self, c: Array, rate: Array, rows: Sequence[slice]) -> Complex:
        """Return the coordinates of states on all tracks, shape (n, k, m).

        Args:
            c: of the states, (n, r).
            rate: their ċ, (n, r).
            rows: of the windows.
        """
        y = np.concatenate([c, rate], axis=1)
        parts = [y[part] @ A.reshape(-1, A.shape[-1]).T for part, A in zip(rows, self._inverse, strict=True)]
        return np.asarray(np.concatenate(parts).reshape(len(y), *self._values.shape[1:]))

    def forced(self, polynomials: Array, rows: Sequence[slice], tracks: Index) -> Complex:
        """Return ∫ e^{λ(h−s)} γ(s) ds over the steps, shape (n, l, m).

        Args:
            polynomials: coefficients of every γ in powers of s/h, shape (powers, n, l, r).
            rows: of the windows.
            tracks: that each γ is on, (l,).
        """
        count, n, number, r = polynomials.shape
        weights = moments(self._lengths, count)
        out = np.empty((n, number, self._values.shape[2]), dtype=complex)
        for part, inverse in zip(rows, self._inverse, strict=True):
            forces = np.swapaxes(polynomials[:, part], 1, 2) @ np.swapaxes(inverse[tracks, :, r:], 1, 2)
            own = weights[:, self._of_length[part, None], tracks]
            out[part] = np.einsum("qnkm,qknm->nkm", own, forces)
        out *= self._h[:, None, None]
        return out

    def started(self, window: int, tracks: Index, y: Array) -> Complex:
        """Return the coordinates of (c, ċ), shape (l, 2 r), each on a track of a window, shape (l, m)."""
        return np.asarray((self._inverse[window, tracks] @ y[:, :, None])[:, :, 0])

    def displacements(self, window: int, tracks: Index, z: Complex) -> Array:
        """Return c of coordinates (n, l, m), each on a track of a window, shape (l, n, r)."""
        vectors = self._vectors[window, tracks, : self._vectors.shape[2] // 2]
        return np.asarray((np.swapaxes(z, 0, 1) @ np.swapaxes(vectors, 1, 2)).real)

    def sampled(self, window: int, tracks: Index, z: Complex) -> Array:
        """Return (c, ċ) of coordinates (l, m), each on a track of a window, (l, 2 r), of what steps can sample.

        That is |λ| h < π. The rest is none that a later motion could be off by: its rates are large, and not those of
        the motion.
        """
        kept = np.where(self._sampled[window, tracks], z, 0.0)
        return np.asarray((self._vectors[window, tracks] @ kept[:, :, None])[:, :, 0].real)


def _alike(h: Array, of: Index) -> Index:
    """Return numbers of steps, the same for those of one window (numbers, increasing) that are as long."""
    key = of * (1 << 32) + np.float32(h / h.max()).view(np.int32)
    return np.asarray(np.unique(key, return_inverse=True)[1]).ravel()


def _medians(h: Array, of: Index, windows: int) -> Array:
    """Return the median of the lengths of the steps in every window, s."""
    return np.array([middle(part) for part in np.split(h, np.searchsorted(of, np.arange(1, windows)))])


def moments(z: Complex, count: int) -> Complex:
    """Return ∫₀¹ e^{z(1−θ)} θ^k dθ for k < count, shape (count, *z.shape)."""
    out = np.empty((count, *z.shape), dtype=complex)
    small = np.abs(z) <= SMALL
    with np.errstate(divide="ignore", invalid="ignore"):
        out[0] = np.expm1(z) / z
        for k in range(1, count):
            out[k] = (k * out[k - 1] - 1.0) / z
    theta, w = 0.5 + 0.5 * GAUSS[0], 0.5 * GAUSS[1]
    grown = np.exp(z[small][:, None] * (1.0 - theta)) * w
    out[:, small] = np.stack([grown @ theta**k for k in range(count)])
    return out


def accumulated(start: Complex, factors: Complex, defects: Complex) -> Complex:
    """Return e_1 … e_n of e_{n+1} = factor e_n + defect, shape (n, k, m), from e_0 = start, shape (k, m).

    As many blocks of steps as each has steps are gone through side by side, then one after the other.
    """
    n, rest = len(defects), defects.shape[1:]
    size = isqrt(n)
    blocks = -(-n // size)
    e, grown = np.zeros((blocks * size, *rest), complex), np.ones((blocks * size, *rest), complex)
    e[:n], grown[:n] = defects, factors
    e, grown = (x.reshape(blocks, size, *rest) for x in (e, grown))
    for i in range(1, size):
        e[:, i] += grown[:, i] * e[:, i - 1]
        grown[:, i] *= grown[:, i - 1]
    for i in range(blocks):
        e[i] += grown[i] * start
        start = e[i, -1]
    return np.asarray(e.reshape(-1, *rest)[:n])


@dataclass(frozen=True)
class Spans:
    """Steps, and the samples around them.

    Attributes:
        starts, lengths: of the steps, s, shape (n,).
        near: number of the sample at the start of each step, or of the one in its middle.
        first, last: numbers of the first and last sample of the smooth piece each step is in.
        end: numbers of the samples at the ends of the steps, where there are samples between, else None.
    """

    starts: Array
    lengths: Array
    near: Index
    first: Index
    last: Index
    end: Index | None = None

    def select(self, index: Index) -> Spans:
        """Return the steps of an index array."""
        s = self
        own = None if s.end is None else s.end[index]
        return Spans(s.starts[index], s.lengths[index], s.near[index], s.first[index], s.last[index], own)

    def around(self, m: int) -> Index:
        """Return the numbers of m samples around every step, (n, m)."""
        lowest = self.near - (m - 1) // 2
        if self.end is not None:
            lowest = (self.near + self.end - m + 1) // 2
        return np.asarray(np.clip(lowest, self.first, self.last - m + 1)[:, None] + np.arange(m))

    @property
    def within(self) -> Index:
        """The samples that join a step most simply: its ends, and one in its middle if there is any, (n, 2 or 3)."""
        if self.end is None:
            return self.around(2)
        return np.stack([self.near, (self.near + self.end + 1) // 2, self.end], axis=1)


def settled(times: Array, values: Array, first: Index) -> Array:
    """Return samples (N, r); the first ones of smooth pieces are put on the line of the next two where they jump.

    What a piece starts with may not be what goes on: stress comes up within a step or two that do not resolve how.

    Args:
        times: of the samples, s, (N,).
        values: samples, (N, r).
        first: numbers of the first samples of all pieces.
    """
    out = values.copy()
    long = first[np.diff(np.append(first, len(times))) > AFTER]
    if not long.size:
        return out
    index = long[:, None] + np.arange(AFTER + 1)
    t, x = times[index], values[index]
    slopes = np.diff(x, axis=1) / np.diff(t)[..., None]
    bends = np.abs(np.diff(slopes, axis=1)) * np.diff(t)[:, 1:, None]
    jumps = bends[:, :EARLY] > JUMP * bends[:, EARLY:].max(axis=1, keepdims=True)
    for j in range(EARLY):  # those up to j are off if the last jump is there
        piece, column = np.nonzero(jumps[:, j] & ~jumps[:, j + 1 :].any(axis=1))
        slope, at = slopes[piece, j + 1, column], t[piece, j + 1]
        line = x[piece, j + 1, column, None] + (t[piece, : j + 1] - at[:, None]) * slope[:, None]
        out[long[piece, None] + np.arange(j + 1), column[:, None]] = line
    return out


def interpolated(times: Array, values: Array, spans: Spans, order: int) -> Array:
    """Return polynomials through samples around every step, coefficients in powers of s/h, shape (n, order, r).

    Samples that change as fast as the steps go are joined by straight lines, or a parabola where there are some within
    the step: no polynomial is right between them, and these do not overshoot.

    Args:
        times: of the samples, s, (N,).
        values: samples, (N, r).
        spans: the steps.
        order: most samples a polynomial goes through.
    """
    out = np.zeros((len(spans.starts), order, values.shape[1]))
    available = np.minimum(spans.last - spans.first + 1, order)
    for m in np.unique(available):
        chosen = np.flatnonzero(available == m)
        part = spans.select(chosen)
        out[chosen, :m], theta, sampled = _through(times, values, part, part.around(int(m)))
        if m > 2:
            simple, _, _ = _through(times, values, part, part.within)
            low = _around(np.abs(differences(theta, sampled, 2 if m > 3 else 1)).max(axis=1))
            rough = np.abs(differences(theta, sampled, int(m) - 1)[:, 0]) >= low
            padded = np.zeros((len(chosen), m, values.shape[1]))
            padded[:, : simple.shape[1]] = simple
            out[chosen, :m] = np.where(rough[:, None, :], padded, out[chosen, :m])
    return out


def differences(theta: Array, sampled: Array, order: int) -> Array:
    """Return differences of samples (n, m, r) at places (n, m), (n, m − order, r), as if evenly spaced."""
    out, spacing = sampled, (theta[:, -1] - theta[:, 0]) / (theta.shape[1] - 1)
    for k in range(1, order + 1):
        out = k * np.diff(out, axis=1) * (spacing[:, None] / (theta[:, k:] - theta[:, :-k]))[..., None]
    return out


def _around(values: Array) -> Array:
    """Return the largest values (n, r) within NEAR steps: at an inflection differences of low order are small."""
    out = values.copy()
    for k in range(1, min(NEAR, len(values) - 1) + 1):
        np.maximum(out[k:], values[:-k], out=out[k:])
        np.maximum(out[:-k], values[k:], out=out[:-k])
    return out


def _through(times: Array, values: Array, spans: Spans, index: Index) -> tuple[Array, Array, Array]:
    """Return polynomials through samples (n, m) of every step, their places, (n, m), and they, (n, m, r)."""
    m = index.shape[1]
    theta = (times[index] - spans.starts[:, None]) / spans.lengths[:, None]
    _, one, of = np.unique(np.rint(theta / ALIKE), axis=0, return_index=True, return_inverse=True)
    inverse = np.linalg.inv(theta[one][:, :, None] ** np.arange(m))
    sampled = values[index]
    return np.asarray(inverse[of.ravel()] @ sampled), theta, sampled
