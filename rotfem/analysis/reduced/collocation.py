"""Collocation of many steps at once: Radau IIA of order 5 for M(t) a + C(t) v + K(t) q + f(t) = 0 of few unknowns.

With the accelerations a_j at the nodes c_j of a step of length h from t, and Radau's matrix A,

    v_i = v + h Σ A_ij a_j,    q_i = q + c_i h v + h² Σ (A²)_ij a_j,

the equations at the nodes are one dense linear system a step. A step's system does not need what came before, only
its right-hand side does, and linearly: all are solved at once for every right-hand side that can be, which gives the
propagators x ↦ R x + s of the steps; these are then applied one after the other (Hairer & Wanner, Solving Ordinary
Differential Equations II, IV.5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: (t (n,)) ↦ M, C, K (n, m, m) and f (n, m).
Operators = Callable[[Array], tuple[Array, Array, Array, Array]]

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


#: A and A².
ONCE = _integrals(NODES, 1)
TWICE = ONCE @ ONCE


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

    def nodes(self) -> tuple[Array, Array, Array]:
        """Return coordinates, rates and accelerations at the nodes of all steps, (n, nodes, m) each."""
        h = np.diff(self.ends)[:, None, None]
        q, v = self.q[:-1, None, :], self.v[:-1, None, :]
        once, twice = (np.einsum("ij,njm->nim", matrix, self.a) for matrix in (ONCE, TWICE))
        return q + NODES[:, None] * h * v + h**2 * twice, v + h * once, self.a

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
    n, m = len(ends) - 1, len(q)
    x = np.empty((n + 1, 2 * m))
    a = np.empty((n, len(NODES), m))
    x[0] = np.concatenate([q, v])
    for first in range(0, n, BATCH):
        part = slice(first, min(first + BATCH, n))
        begin, h = ends[part], np.diff(ends[first : part.stop + 1])
        t = nodes(begin, begin + h, NODES)
        M, C, K, f = operators(t.ravel())
        answers = _answers((M, C, K, f if forces is None else forces[part]), h, m)
        propagator, offset = _propagators(answers, h, m)
        for k in range(len(h)):
            x[first + k + 1] = propagator[k] @ x[first + k] + offset[k]
        a[part] = np.einsum("nsij,nj->nsi", answers[..., :-1], x[part]) + answers[..., -1]
    return Steps(ends, x[:, :m], x[:, m:], a)


def _answers(operators: tuple[Array, Array, Array, Array], h: Array, m: int) -> Array:
    """Return the accelerations at the nodes by what the steps start from, (q, v, 1): shape (n, nodes, m, 2m + 1)."""
    s, n = len(NODES), len(h)
    M, C, K = (x.reshape(n, s, m, m) for x in operators[:3])
    f = operators[3].reshape(n, s, m)
    h4 = h[:, None, None, None]
    right = np.empty((n, s, m, 2 * m + 1))
    right[..., :m] = -K
    right[..., m : 2 * m] = -(C + (NODES[:, None, None] * h4) * K)
    right[..., -1] = -f
    left = np.empty((n, s, m, s, m))
    for j in range(s):
        left[:, :, :, j] = ONCE[:, j, None, None] * h4 * C + TWICE[:, j, None, None] * h4**2 * K
        left[:, j, :, j] += M[:, j]
    answers: Any = np.linalg.solve(left.reshape(n, s * m, s * m), right.reshape(n, s * m, 2 * m + 1))
    return np.asarray(answers).reshape(n, s, m, 2 * m + 1)


def _propagators(answers: Array, h: Array, m: int) -> tuple[Array, Array]:
    """Return R (n, 2m, 2m) and s (n, 2m) of the steps x ↦ R x + s with x = (q, v)."""
    end = np.ones(1)
    once, twice = (np.einsum("j,njmk->nmk", _integrals(end, k)[0], answers) for k in (1, 2))
    whole = np.concatenate([h[:, None, None] ** 2 * twice, h[:, None, None] * once], axis=1)
    R = whole[..., :-1].copy()
    index = np.arange(m)
    R[:, index, index] += 1.0
    R[:, index, m + index] += h[:, None]
    R[:, m + index, m + index] += 1.0
    return R, whole[..., -1]
