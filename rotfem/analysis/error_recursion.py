"""The error equation of sampled motions: exact propagation between samples against what a scheme made of it.

For ẏ = A y + (0, γ), y = (c, ċ), with γ known at samples, the exact solution of a step from y_n is

    y*_{n+1} = e^{Ah} y_n + ∫ e^{A(h−s)} (0, γ(s)) ds,

γ a polynomial through the samples around the step. What the scheme made is y_{n+1}; so its error obeys
e_{n+1} = e^{Ah} e_n + y_{n+1} − y*_{n+1}. In eigenvectors of A all of it is scalar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

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
        C, K: of the equation, shape (r, r).
        h: lengths of the steps, s, shape (n,).
        bounded: whether errors do not grow by themselves, whatever C and K say.

    Attributes:
        factors, carried: e^{λh} of states and of errors, shape (n, m).
    """

    def __init__(self, C: Array, K: Array, h: Array, bounded: bool = False):
        r = len(K)
        A = np.block([[np.zeros((r, r)), np.eye(r)], [-K, -C]])
        values, vectors = np.linalg.eig(A)
        inverse = np.linalg.inv(vectors)
        upper = values.imag >= 0.0
        self._values = values[upper].astype(complex)
        self._inverse: Complex = inverse[upper].astype(complex)
        self._vectors: Complex = vectors[:, upper] * np.where(values[upper].imag > 0.0, 2.0, 1.0)
        self._h = h
        lengths, self._of_length = np.unique(np.float32(h / h.max()), return_inverse=True)
        self._lengths = np.array([h[np.argmax(self._of_length == i)] for i in range(len(lengths))])
        self.factors: Complex = np.exp(self._lengths[:, None] * self._values)[self._of_length]
        self.carried: Complex = self.factors / np.maximum(np.abs(self.factors), 1.0) if bounded else self.factors

    def modal(self, c: Array, rate: Array) -> Complex:
        """Return the coordinates of states, (n, r) each, shape (n, m)."""
        z: Complex = np.concatenate([c, rate], axis=-1) @ self._inverse.T
        return z

    def forced(self, polynomials: Array) -> Complex:
        """Return ∫ e^{λ(h−s)} γ(s) ds over the steps, shape (n, m).

        Args:
            polynomials: coefficients of γ in powers of s/h, shape (n, k, r).
        """
        r = polynomials.shape[2]
        forces = polynomials @ self._inverse[:, r:].T
        weights = moments(self._lengths[:, None] * self._values, polynomials.shape[1])
        out = np.zeros(forces[:, 0].shape, dtype=complex)
        for k, weight in enumerate(weights):
            out += weight[self._of_length] * forces[:, k]
        out *= self._h[:, None]
        return out

    def displacements(self, z: Complex) -> Array:
        """Return c of coordinates (n, m), shape (n, r)."""
        c: Array = (z @ self._vectors[: len(self._vectors) // 2].T).real
        return c

    def sampled(self, z: Complex) -> Array:
        """Return (c, ċ) of coordinates (k, m), shape (k, 2 r), of what steps can sample: |λ| h < π.

        The rest is none that a later motion could be off by: its rates are large, and not those of the motion.
        """
        y: Array = (np.where(np.abs(self._values) * np.median(self._h) < np.pi, z, 0.0) @ self._vectors.T).real
        return y


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
    """Return e_1 … e_n of e_{n+1} = factor e_n + defect, shape (n, k, m), from e_0 = start, shape (k, m)."""
    out = np.empty_like(defects)
    e = start
    for i, (factor, defect) in enumerate(zip(factors, defects, strict=True)):
        e = factor * e + defect
        out[i] = e
    return out


@dataclass(frozen=True)
class Spans:
    """Steps, and the samples around them.

    Attributes:
        starts, lengths: of the steps, s, shape (n,).
        near: number of the sample at the start of each step, or of the one in its middle.
        first, last: numbers of the first and last sample of the smooth piece each step is in.
    """

    starts: Array
    lengths: Array
    near: Index
    first: Index
    last: Index

    def select(self, index: Index) -> Spans:
        """Return the steps of an index array."""
        s = self
        return Spans(s.starts[index], s.lengths[index], s.near[index], s.first[index], s.last[index])


def settled(times: Array, values: Array, first: Index) -> Array:
    """Return samples (N, r); the first ones of smooth pieces are put on the line of the next two where they jump.

    What a piece starts with may not be what goes on: stress comes up within a step or two that do not resolve how.

    Args:
        times: of the samples, s, (N,).
        values: samples, (N, r).
        first: numbers of the first samples of all pieces.
    """
    out = values.copy()
    ends = np.append(first[1:], len(times))
    for i in first[ends - first > AFTER]:
        t, x = times[i : i + AFTER + 1], values[i : i + AFTER + 1]
        slopes = np.diff(x, axis=0) / np.diff(t)[:, None]
        bends = np.abs(np.diff(slopes, axis=0)) * np.diff(t)[1:, None]
        jumps = bends[:EARLY] > JUMP * bends[EARLY:].max(axis=0)
        for j in range(EARLY):  # those up to j are off if the last jump is there
            off = jumps[j] & ~jumps[j + 1 :].any(axis=0)
            line = x[j + 1] + (t[: j + 1, None] - t[j + 1]) * slopes[j + 1]
            out[i : i + j + 1, off] = line[:, off]
    return out


def interpolated(times: Array, values: Array, spans: Spans, order: int) -> Array:
    """Return polynomials through samples around every step, coefficients in powers of s/h, shape (n, order, r).

    Samples that change as fast as the steps go are joined by straight lines: no polynomial is right between them, and
    the straight one does not overshoot.

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
        out[chosen, :m], sampled = _through(times, values, part, int(m))
        if m > 2:
            straight, _ = _through(times, values, part, 2)
            low = _around(np.abs(np.diff(sampled, n=2 if m > 3 else 1, axis=1)).max(axis=1))
            rough = np.abs(np.diff(sampled, n=int(m) - 1, axis=1)[:, 0]) >= low
            padded = np.zeros((len(chosen), m, values.shape[1]))
            padded[:, :2] = straight
            out[chosen, :m] = np.where(rough[:, None, :], padded, out[chosen, :m])
    return out


def _around(values: Array) -> Array:
    """Return the largest values (n, r) within NEAR steps: at an inflection differences of low order are small."""
    out = values.copy()
    for k in range(1, min(NEAR, len(values) - 1) + 1):
        np.maximum(out[k:], values[:-k], out=out[k:])
        np.maximum(out[:-k], values[k:], out=out[:-k])
    return out


def _through(times: Array, values: Array, spans: Spans, m: int) -> tuple[Array, Array]:
    """Return polynomials through m samples around every step, and these samples, shape (n, m, r) both."""
    lowest = np.clip(spans.near - (m - 1) // 2, spans.first, spans.last - m + 1)
    index = lowest[:, None] + np.arange(m)
    theta = (times[index] - spans.starts[:, None]) / spans.lengths[:, None]
    _, one, of = np.unique(np.rint(theta / ALIKE), axis=0, return_index=True, return_inverse=True)
    inverse = np.linalg.inv(theta[one][:, :, None] ** np.arange(m))
    sampled = values[index]
    return np.asarray(inverse[of.ravel()] @ sampled), sampled
