"""Linear beams with 6×6 sections by polynomials of high degree, in numpy alone: references of frequencies at rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

Array = npt.NDArray[np.float64]


def frequencies(
    knots: Sequence[float],
    matrices: Callable[[float], tuple[Array, Array]],
    triad: Callable[[float], Array],
    degree: int = 9,
) -> Array:
    """Return the frequencies (rad/s) of a beam at rest that is clamped at the first knot, lowest first.

    It has the strains Γ = Tᵀ(u' − θ×t₁), K = Tᵀθ' and the velocities Tᵀu̇, Tᵀθ̇, T = (t₁ t₂ t₃); no locking, as u and θ
    are polynomials of a degree at which that plays no part.

    Args:
        knots: ends of the elements (m).
        matrices: x ↦ stiffness and mass (6, 6) along T.
        triad: x ↦ T (3, 3), its columns the section axes.
        degree: of the polynomials in each element.
    """
    nodes = -np.cos(np.linspace(0.0, np.pi, degree + 1))
    to_monomials = np.linalg.inv(np.vander(nodes, increasing=True))
    points, weights = np.polynomial.legendre.leggauss(2 * degree)
    values = np.vander(points, degree + 1, increasing=True) @ to_monomials
    powers = np.arange(degree + 1)
    slopes = (powers * np.vander(points, degree + 1, increasing=True)[:, np.maximum(powers - 1, 0)]) @ to_monomials
    size = 6 * (degree * (len(knots) - 1) + 1)
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for number, (a, b) in enumerate(pairwise(knots)):
        half = (b - a) / 2
        dofs = 6 * degree * number + np.arange(6 * (degree + 1))
        for s, w, N, dN in zip(points, weights, values, slopes / half, strict=True):
            x = a + half * (1 + s)
            T = triad(x)
            both = np.kron(np.eye(2), T.T)
            C, m = matrices(x)
            across = np.array([[0, -T[2, 0], T[1, 0]], [T[2, 0], 0, -T[0, 0]], [-T[1, 0], T[0, 0], 0]])  # t₁ ×
            turn = np.zeros((6, 6))
            turn[:3, 3:] = across  # −θ×t₁ = t₁×θ
            B = both @ (np.kron(dN, np.eye(6)) + np.kron(N, turn))
            V = both @ np.kron(N, np.eye(6))
            K[np.ix_(dofs, dofs)] += half * w * B.T @ C @ B
            M[np.ix_(dofs, dofs)] += half * w * V.T @ m @ V
    return np.sqrt(eigh(K[6:, 6:], M[6:, 6:], eigvals_only=True))
