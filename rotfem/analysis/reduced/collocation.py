"""Collocation of many steps at once: Radau IIA of order 5 for M(t) a + C(t) v + K(t) q + f(t) = 0 of few unknowns.

With the accelerations a_j at the nodes c_j of a step of length h from t, and Radau's matrix A,

    v_i = v + h Σ A_ij a_j,    q_i = q + c_i h v + h² Σ (A²)_ij a_j,

the equations at the nodes are one dense linear system a step. A step's system does not need what came before, only
its right-hand side does, and linearly: all are solved at once for every right-hand side that can be, which gives the
propagators x ↦ R x + s of the steps; these are then applied one after the other (Hairer & Wanner, Solving Ordinary
Differential Equations II, IV.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: (t (n,)) ↦ M, C, K (n, m, m) and f (n, m).
Operators = Callable[[Array], tuple[Array, Array, Array, Array]]

#: Times (n,), coordinates, rates and accelerations (n, m) ↦ forces (n, m), several.
Lacking = Callable[[Array, Array, Array, Array], Sequence[Array]]

#: Steps whose systems are solved at once: memory is that of their matrices.
BATCH = 256

#: Radau's nodes of order 5; the last is the end of the step.
NODES = np.array([(4 - np.sqrt(6)) / 10, (4 + np.sqrt(6)) / 10, 1.0])


def _integrals(shares: Array, times: int) -> Array:
    """Return the integrals from 0, once or twice, of the Lagrange polynomials of the nodes, shape (n, nodes)."""
    powers = np.linalg.inv(np.vander(NODES, increasing=True))  # column j: coefficients of the polynomial of node j
    degree = np.arange(len(NODES))
    divisor = np.ones(len(NODES))
    for k in range(times):
        divisor = divisor * (degree + k + 1)
    return np.asarray((shares[:, None] ** (degree + times) / divisor) @ powers)


#: A and A²; the integrals over a whole step.
ONCE = _integrals(NODES, 1)
TWICE = ONCE @ ONCE
ONCE_BY_END, TWICE_BY_END = (_integrals(np.ones(1), k)[0] for k in (1, 2))


@dataclass(frozen=True)
class Steps:
    """The steps of a solution: ends (n + 1,), what they start from (n + 1, m), accelerations at nodes (n, nodes, m)."""

    ends: Array
    q: Array
    v: Array
    a: Array

    def at(self, t: Array) -> tuple[Array, Array]:
        """Return coordinates and rates (n, m) at times (n,) within the steps, of the order of the steps' own."""
        i = np.clip(np.searchsorted(self.ends, t, side="left") - 1, 0, len(self.ends) - 2)
        h = self.ends[i + 1] - self.ends[i]
        share = (t - self.ends[i]) / h
        once, twice = (np.einsum("nj,njm->nm", _integrals(share, k), self.a[i]) for k in (1, 2))
        v = self.v[i] + h[:, None] * once
        return self.q[i] + (share * h)[:, None] * self.v[i] + (h**2)[:, None] * twice, v

    def state(self, t: Array) -> tuple[Array, ...]:
        """Return coordinates, rates and accelerations (n, m) at times (n,) within the steps."""
        return *self.at(t), self.rates_of(t)

    def plus(self, other: Steps) -> Steps:
        """Return the sum with a solution by the same steps."""
        return Steps(self.ends, self.q + other.q, self.v + other.v, self.a + other.a)

    def nodes(self, part: slice = slice(None)) -> tuple[Array, Array, Array]:
        """Return coordinates, rates and accelerations at the nodes of steps, of all unless told, (n, nodes, m) each."""
        h = np.diff(self.ends)[part, None, None]
        q, v, a = self.q[:-1][part, None, :], self.v[:-1][part, None, :], self.a[part]
        once, twice = (np.einsum("ij,njm->nim", matrix, a) for matrix in (ONCE, TWICE))
        return q + NODES[:, None] * h * v + h**2 * twice, v + h * once, a

    def rates_of(self, t: Array) -> Array:
        """Return the accelerations (n, m) at times (n,) within the steps, by the polynomials through the nodes'."""
        i = np.clip(np.searchsorted(self.ends, t, side="left") - 1, 0, len(self.ends) - 2)
        share = (t - self.ends[i]) / (self.ends[i + 1] - self.ends[i])
        return np.asarray(np.einsum("nj,njm->nm", _integrals(share, 0), self.a[i]))


def collocate(
    operators: Operators, nodes: Callable[..., Array], ends: Array, q: Array, v: Array, forces: Array | None = None
) -> Steps:
    """Return the solution over steps.

    Args:
        operators: of the equations.
        nodes: (begin, end, shares) ↦ times of these shares of steps, (n, shares).
        ends: of the steps, the first the start, s.
        q: coordinates at the start, (m,).
        v: rates at the start, (m,).
        forces: f at the nodes of all steps, (n, nodes, m), in the place of that of the operators.
    """
    out = _Course(ends, q, v)
    for part, t, h in batches(nodes, ends):
        M, C, K, f = operators(t.ravel())
        left, right = _equations((M, C, K, f if forces is None else forces[part]), h, len(q))
        answers: Array = _solved(left, right).reshape(len(h), len(NODES), len(q), -1)
        by_start, alone = answers[..., :-1], answers[..., -1]
        out.advance(part, _propagator(by_start, h), by_start, alone)
    return out.steps


def answered(
    operators: Operators, nodes: Callable[..., Array], ends: Array, q: Array, v: Array, lacking: Lacking
) -> tuple[Steps, list[Steps]]:
    """Return the solution over steps, and the answers from rest of the same equations to forces that follow from it.

    Args:
        operators: of the equations (see `collocate`).
        nodes: times of shares of steps.
        ends: of the steps, s.
        q: coordinates at the start, (m,).
        v: rates at the start, (m,).
        lacking: of the solution, forces in the place of f.
    """
    solution, answers, rest, m = _Course(ends, q, v), list[_Course](), np.zeros(len(q)), len(q)
    for part, t, h in batches(nodes, ends):
        left, right = _equations(operators(t.ravel()), h, m)
        own: Array = _solved(left, right).reshape(len(h), len(NODES), m, -1)
        by_start = own[..., :-1]
        propagator = _propagator(by_start, h)
        solution.advance(part, propagator, by_start, own[..., -1])
        state = (x.reshape(-1, m) for x in solution.steps.nodes(part))
        forces = np.stack([f.reshape(len(h), -1) for f in lacking(t.ravel(), *state)], axis=2)
        alone: Array = _solved(left, -forces).reshape(*own.shape[:3], -1)
        answers = answers or [_Course(ends, rest, rest) for _ in range(alone.shape[-1])]
        for k, answer in enumerate(answers):
            answer.advance(part, propagator, by_start, alone[..., k])
    return solution.steps, [answer.steps for answer in answers]


class _Course:
    """The steps of a solution, taken in batches.

    Args:
        ends: of the steps, s.
        q: coordinates at the start, (m,).
        v: rates.
    """

    def __init__(self, ends: Array, q: Array, v: Array):
        n, m = len(ends) - 1, len(q)
        self._x, self._h = np.empty((n + 1, 2 * m)), np.diff(ends)
        self._x[0] = np.concatenate([q, v])
        self.steps = Steps(ends, self._x[:, :m], self._x[:, m:], np.empty((n, len(NODES), m)))

    def advance(self, part: slice, propagator: Array, by_start: Array, alone: Array) -> None:
        """Take the steps of a batch, from their propagators (n, 2m, 2m) and the accelerations at their nodes.

        These are `by_start` (n, nodes, m, 2m) times what a step starts from, and those from nothing (n, nodes, m).
        """
        x, offset = self._x, _offset(alone, self._h[part])
        for k in range(len(propagator)):
            x[part.start + k + 1] = propagator[k] @ x[part.start + k] + offset[k]
        self.steps.a[part] = np.einsum("nsij,nj->nsi", by_start, x[part]) + alone


def batches(nodes: Callable[..., Array], ends: Array) -> Iterator[tuple[slice, Array, Array]]:
    """Give the steps of each batch, the times of their nodes (n, nodes) and their lengths (n,), s."""
    for first in range(0, len(ends) - 1, BATCH):
        part = slice(first, min(first + BATCH, len(ends) - 1))
        begin, h = ends[part], np.diff(ends[first : part.stop + 1])
        yield part, nodes(begin, begin + h, NODES), h


def _equations(operators: tuple[Array, Array, Array, Array], h: Array, m: int) -> tuple[Array, Array]:
    """Return the equations of the accelerations at the nodes of steps, (n, nodes · m, nodes · m), and right-hand sides.

    These are those of what the steps start from, (q, v, 1): shape (n, nodes · m, 2m + 1).
    """
    s, n = len(NODES), len(h)
    M, C, K = (x.reshape(n, s, m, m) for x in operators[:3])
    f = operators[3].reshape(n, s, m)
    h4 = h[:, None, None, None]
    right = np.empty((n, s, m, 2 * m + 1))
    right[..., :m] = -K
    right[..., m : 2 * m] = -(C + (NODES[:, None, None] * h4) * K)
    right[..., -1] = -f
    once, twice = h4 * C, h4**2 * K
    left = np.empty((n, s, m, s, m))
    for j in range(s):
        left[:, :, :, j] = ONCE[:, j, None, None] * once + TWICE[:, j, None, None] * twice
        left[:, j, :, j] += M[:, j]
    return left.reshape(n, s * m, s * m), right.reshape(n, s * m, 2 * m + 1)


def _solved(left: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(left, right), dtype=float)


def _propagator(by_start: Array, h: Array) -> Array:
    """Return R (n, 2m, 2m) of the steps x ↦ R x + s with x = (q, v)."""
    m = by_start.shape[2]
    R = _moved(by_start, h)
    index = np.arange(m)
    R[:, index, index] += 1.0
    R[:, index, m + index] += h[:, None]
    R[:, m + index, m + index] += 1.0
    return R


def _offset(alone: Array, h: Array) -> Array:
    """Return s (n, 2m) of the steps x ↦ R x + s."""
    return _moved(alone[..., None], h)[..., 0]


def _moved(a: Array, h: Array) -> Array:
    """Return what accelerations at the nodes (n, nodes, m, k) add to coordinates and rates by the end, (n, 2m, k)."""
    h3 = h[:, None, None]
    return np.concatenate([h3**2 * np.tensordot(TWICE_BY_END, a, (0, 1)), h3 * np.tensordot(ONCE_BY_END, a, (0, 1))], 1)
