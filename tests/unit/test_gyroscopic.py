"""Block Krylov eigenpairs of gyroscopic pencils against all eigenvalues of the same pencil by LAPACK."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from petsc4py import PETSc

from rotfem.numerics import eigenproblem
from rotfem.numerics.eigenproblem import Pencil

N = 120


def pencil(stiffnesses: np.ndarray[Any, Any], spin: float) -> tuple[Pencil, np.ndarray[Any, Any]]:
    """Return a pencil with M and K symmetric, C skew, in units far apart, and all its eigenvalues."""
    rng = np.random.default_rng(3)
    Q, _ = np.linalg.qr(rng.normal(size=(N, N)))
    d = 10.0 ** rng.uniform(-3.0, 3.0, N)
    M = np.eye(N) + 0.1 * (Q + Q.T)
    C = spin * (G := rng.normal(size=(N, N))) - spin * G.T
    K = (Q * stiffnesses) @ Q.T
    M, C, K = (d[:, None] * (A + sign * A.T) / 2 * d for A, sign in ((M, 1.0), (C, -1.0), (K, 1.0)))
    unscaled = [A / d[:, None] / d for A in (M, C, K)]
    A = np.linalg.solve(unscaled[0], np.hstack([-unscaled[2], -unscaled[1]]))
    values = np.linalg.eigvals(np.vstack([np.eye(N, 2 * N, N), A]))
    matrices = []
    for A in (M, C, K):
        B = PETSc.Mat().createDense((N, N), array=np.array(A, order="F"), comm=PETSc.COMM_SELF)
        B.assemble()
        matrices.append(B.convert("aij"))
    return Pencil(*matrices), values


def spectrum(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return eigenvalues with a positive imaginary part, or real and positive, smallest first."""
    scale = 1e-6 * np.abs(values)
    upper = values[(values.imag > scale) | ((np.abs(values.imag) <= scale) & (values.real > 0.0))]
    return upper[np.argsort(np.abs(upper))]


@pytest.mark.parametrize("lowest", [1.0, -3.0])
@pytest.mark.parametrize("spin", [0.0, 0.05])
def test_pairs_are_those_of_lapack(lowest: float, spin: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a definite K, and of one with a negative eigenvalue, a divergence: λ to 1e-9, residuals to 1e-8."""
    monkeypatch.setattr(eigenproblem, "SMALL", 10)
    monkeypatch.setattr(Pencil, "_nearest", lambda *_: pytest.fail("not by blocks"))
    given, values = pencil(np.append(lowest, np.geomspace(4.0, 1e6, N - 1)), spin)
    pairs = given.solve(5)
    expected = spectrum(values)[:5]
    np.testing.assert_allclose(np.abs(pairs.values[:5]), np.abs(expected), rtol=1e-9)
    np.testing.assert_allclose(np.abs(pairs.values[:5].real), np.abs(expected.real), atol=1e-8)
    assert np.max(pairs.errors[:5]) < 1e-8
    assert given.factor is not None  # serves what follows
