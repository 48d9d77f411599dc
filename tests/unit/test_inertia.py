"""The count of negative eigenvalues against the eigenvalues themselves."""

from __future__ import annotations

import numpy as np
import pytest
from petsc4py import PETSc

from rotfem.errors import ComputationError
from rotfem.numerics import linear


def matrix(A: np.ndarray) -> PETSc.Mat:
    out = PETSc.Mat().createAIJ(A.shape, nnz=A.shape[1], comm=PETSc.COMM_SELF)
    rows = np.arange(A.shape[0], dtype=PETSc.IntType)
    out.setValues(rows, rows, A)
    out.assemble()
    return out


@pytest.mark.parametrize("shift", [-20.0, 0.0, 0.4, 20.0])
def test_as_many_as_eigenvalues(capfd: pytest.CaptureFixture[str], shift: float) -> None:
    # By CHOLMOD where all are positive, else by MUMPS; neither prints anything.
    A = np.random.default_rng(3).standard_normal((40, 40))
    A = A + A.T + shift * np.eye(40)
    assert linear.negative_eigenvalues(matrix(A)) == np.sum(np.linalg.eigvalsh(A) < 0.0)
    assert not any(capfd.readouterr())


def test_zero_diagonal() -> None:
    # A saddle point: without pivoting there is no factor.
    assert linear.negative_eigenvalues(matrix(np.array([[0.0, 1.0], [1.0, 0.0]]))) == 1


def test_singular_matrix_has_no_count() -> None:
    with pytest.raises(ComputationError, match="singular|factored"):
        linear.negative_eigenvalues(matrix(np.diag([1.0, 0.0, 2.0])))
