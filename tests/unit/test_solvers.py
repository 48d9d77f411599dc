"""Newton's iteration: when it stops, when it gives up, and what it says; the direct solver."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from rotfem.errors import ComputationError
from rotfem.numerics import linear
from rotfem.numerics.linear import DirectSolver, SingularSolver, combine, is_regular, symmetric
from rotfem.numerics.newton import Factor, Newton
from rotfem.numerics.projection import LowRank, PlusLowRank, times, times_transposed


class Scalar:
    """Newton for f(x) = 0 with one unknown."""

    def __init__(self, f: Callable[[float], float], slope: Callable[[float], float], x: float):
        self.f, self.slope, self.x = f, slope, x

    def increment(self, renewed: bool = True) -> tuple[float, bool]:
        d = -self.f(self.x) / self.slope(self.x)
        self.x += d
        return abs(d), False

    def size(self) -> float:
        return abs(self.x)


def test_converges_quadratically_and_counts() -> None:
    newton, root = Newton(tolerance=1e-9), Scalar(lambda x: x * x - 2, lambda x: 2 * x, 1.5)
    count = newton.solve(root.increment, root.size)
    assert root.x == pytest.approx(np.sqrt(2), abs=1e-15)
    assert count <= 4
    assert newton.iterations == count


@pytest.mark.parametrize(("slope", "made"), [(14.0, 0), (60.0, 1)])
def test_an_old_slope_is_kept_as_long_as_it_serves(slope: float, made: int) -> None:
    """x³ = 8, where the slope is 12: errors shrink to a seventh each time with one of 14, to 0.8 with one of 60."""
    slopes, factor = [slope], Factor(True)
    root = Scalar(lambda x: x**3 - 8, lambda x: slopes[-1], 2.01)

    def increment(renewed: bool) -> tuple[float, bool]:
        if renewed:
            slopes.append(3 * root.x**2)
        return root.increment()

    Newton(tolerance=1e-3).solve(increment, root.size, factor)
    assert root.x == pytest.approx(2.0, abs=1e-4)
    assert len(slopes) == 1 + made


def matrix(values: list[list[float]]) -> PETSc.Mat:
    A = PETSc.Mat().createDense((len(values), len(values)), array=np.array(values))
    A = A.convert("aij")
    A.assemble()
    return A


def test_a_singular_matrix_is_a_computation_error() -> None:
    A = matrix([[1.0, 1.0], [1.0, 1.0]])
    b = A.createVecLeft()
    b.set(1.0)
    with pytest.raises(ComputationError, match="singular"):
        DirectSolver(A).solve(b)


def spread(rng: np.random.Generator, n: int) -> PETSc.Mat:
    """Return a matrix whose eigenvalues lie far apart: no few iterations with the factor of 1 solve it."""
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    return matrix((Q * np.geomspace(1.0, 1e4, n) @ Q.T).tolist())


@pytest.mark.parametrize("symmetric", [False, True])
@pytest.mark.parametrize("small", [True, False])
def test_solutions_for_many_sides_at_once_are_those_one_by_one(
    symmetric: bool, small: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By either factorisation, with columns added to the matrix and without; products likewise, to round-off."""
    monkeypatch.setattr(linear, "SMALL", 5000 if small else 10)
    monkeypatch.setattr(linear, "MIDDLE", 5000 if small else 10)
    rng, n = np.random.default_rng(5), 60
    A, right = spread(rng, n), rng.normal(size=(60, 7))
    part = LowRank(rng.normal(size=(n, 2)), MPI.COMM_SELF)
    for matrix, whole in ((A, A[:, :]), (PlusLowRank(A, part, 3.0), A[:, :] + 3.0 * part.B @ part.B.T)):
        solver = DirectSolver(matrix, symmetric)
        X = solver.solve_all(right)
        assert solver.factorisations == 1
        np.testing.assert_allclose(whole @ X, right, atol=1e-9)
        np.testing.assert_allclose(solver.solve_all(right[:, :1]), X[:, :1], rtol=1e-9)
        np.testing.assert_allclose(times(matrix, right), whole @ right, rtol=1e-12, atol=1e-9)


def test_a_matrix_with_a_part_of_low_rank_is_scaled_and_bounded_as_one() -> None:
    """D (S + c B Bᵀ) D, sums with others, products with the transpose, and a bound of its norm."""
    rng, n = np.random.default_rng(6), 30
    S = spread(rng, n)
    A = PlusLowRank(S.copy(), LowRank(rng.normal(size=(n, 2)), MPI.COMM_SELF), 0.5)
    d = S.createVecLeft()
    d.array[:] = rng.uniform(1.0, 2.0, n)
    whole = S[:, :] + 0.5 * A.part.B @ A.part.B.T
    total = combine(S.duplicate(), [S, A], np.array([2.0, -3.0]))
    np.testing.assert_allclose(times(total, np.eye(n)), 2.0 * S[:, :] - 3.0 * whole, rtol=1e-9, atol=1e-9)
    A.diagonalScale(d, d)
    A.scale(4.0)
    whole = 4.0 * d.array[:, None] * whole * d.array
    x = rng.normal(size=(n, 2))
    np.testing.assert_allclose(times_transposed(A, x), whole.T @ x, rtol=1e-9, atol=1e-9)
    assert np.linalg.norm(whole, np.inf) <= A.norm(PETSc.NormType.INFINITY) <= 4.0 * np.linalg.norm(whole, np.inf)


def test_a_small_skew_part_is_none_of_round_off() -> None:
    """Symmetric to round-off is A; with 1e-9 of its largest entry in one corner only it is not."""
    A = spread(np.random.default_rng(7), 40)
    assert symmetric(A)
    A.setValue(0, 39, A[0, 39] + 1e-9 * np.abs(A[:, :]).max())
    A.assemble()
    assert not symmetric(A)


def test_what_a_singular_matrix_does_not_feel_follows_the_other() -> None:
    """A n = 0 for n = (1, 1): x has the part of b that A feels, n·K x = 0, and nothing of round-off along n."""
    A, K = (
        PETSc.Mat().createAIJ((2, 2), csr=([0, 2, 4], [0, 1, 0, 1], values))
        for values in ([1.0, -1.0, -1.0, 1.0], [2.0, 0.0, 0.0, 3.0])
    )
    for matrix in (A, K):
        matrix.assemble()
    assert is_regular(K, DirectSolver(K))
    assert not is_regular(A, DirectSolver(A))
    K.scale(1e-9)
    b = A.createVecLeft()
    b.array[:] = [1.0, -1.0 + 1e-14]
    # A x = b and 2 x₁ + 3 x₂ = 0; to what K is beside A
    np.testing.assert_allclose(SingularSolver(A, K).solve(b), [0.6, -0.4], rtol=1e-7)


def test_an_indefinite_matrix_is_factorised_without_a_word(capfd: pytest.CaptureFixture[str]) -> None:
    """CHOLMOD, which is tried first, has a warning of its own for standard output, where summaries are."""
    n = 40
    A = PETSc.Mat().createAIJ((n, n), nnz=3, comm=PETSc.COMM_SELF)
    for i in range(n):
        A[i, i] = 4.0 if i % 7 else -4.0
        if i:
            A[i, i - 1] = A[i - 1, i] = 1.0
    A.assemble()
    solver = DirectSolver(A, symmetric=True, counting=True)
    solver.factorise()
    assert solver.negative == 6
    assert capfd.readouterr() == ("", "")
