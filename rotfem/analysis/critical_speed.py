"""The speed at which a linear theory loses its stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from slepc4py import SLEPc

from rotfem.errors import ComputationError
from rotfem.numerics.balance import unknown_scale
from rotfem.numerics.linear import negative_eigenvalues, use_direct_solver
from rotfem.numerics.projection import summed, times

#: Part of the largest stiffening by spin, over speed squared, below which a softening is none.
FAR = 1e-6

#: Restarts in which eigenvalues are found that stand apart, and those that are made at most.
SOON, LATE = 20, 2000


def critical_speed(system: Any) -> float | None:
    """Return the lowest speed (rad/s) at which the stiffness of a linear theory is singular; None if there is none.

    Of a nonlinear theory there is none: its stiffness is that of each equilibrium. One beyond a thousand
    times the speed at which spin doubles a stiffness counts as none where it is not found at once.

    Raises:
        ComputationError: the eigensolver did not converge.

    K = K_1 + Omega² K_2: the least positive Omega² of K_1 x = −Omega² K_2 x.
    """
    if not system.linear:
        return None
    K_1, K_2 = system.stiffness_pieces()
    if K_2.norm() == 0.0:
        return None
    d = unknown_scale(K_2, K_1, 1.0)
    K_1.diagonalScale(d, d)
    K_2.diagonalScale(d, d)
    K_2.scale(-1.0)
    # nu = 1/Omega² is the largest eigenvalue of −K_2 x = nu K_1 x.
    nu = _largest(K_2, K_1, SOON)
    if nu is None:
        if _far(K_2, K_1):
            return None
        nu = _largest(K_2, K_1, LATE)
    if nu is None:
        raise ComputationError("the eigenproblem of the critical speed did not converge")
    return float(1 / np.sqrt(nu)) if nu > 0 else None


def _far(A: Any, B: Any) -> bool:
    """Return whether no eigenvalue of A x = nu B x is above FAR times the largest in size, a negative one."""
    stiffens = _largest(A, B, SOON, SLEPc.EPS.Which.LARGEST_MAGNITUDE)
    if stiffens is None or stiffens >= 0.0:
        return False
    there = B.copy()
    there.axpy(1.0 / (FAR * stiffens), A, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return negative_eigenvalues(there) == 0


def _largest(A: Any, B: Any, restarts: int, which: Any = SLEPc.EPS.Which.LARGEST_REAL) -> float | None:
    """Return the largest eigenvalue of A x = nu B x; None if it is not found in so many restarts."""
    eps = SLEPc.EPS().create(A.comm)
    # B is definite, but round-off can have taken that away, so it is no inner product.
    eps.setOperators(A, B)
    eps.setProblemType(SLEPc.EPS.ProblemType.GNHEP)
    eps.setWhichEigenpairs(which)
    eps.setDimensions(1, min(A.getSize()[0], 100))
    eps.setTolerances(1e-12, restarts)
    B.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    use_direct_solver(eps.getST().getKSP(), A.getSize()[0], symmetric=True)
    eps.solve()
    return float(eps.getEigenvalue(0).real) if eps.getConverged() else None


def critical_speed_within(system: Any, V: npt.NDArray[np.float64]) -> float | None:
    """Return the critical speed (rad/s) of a linear theory in a basis, not less than its own; None if there is none.

    Args:
        system: equations of motion.
        V: owned unknowns of the basis, shape (n, m).
    """
    K_1, K_2 = (summed(system.comm, V.T @ times(K, V)) for K in system.stiffness_pieces())
    if not np.any(K_2):
        return None
    nu = float(np.linalg.eigvals(np.linalg.solve(K_1, -K_2)).real.max())
    return float(1 / np.sqrt(nu)) if nu > 0 else None
