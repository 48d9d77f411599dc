"""The speed at which a linear theory loses its stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from slepc4py import SLEPc

from rotfem.errors import ComputationError
from rotfem.numerics.balance import unknown_scale
from rotfem.numerics.linear import use_direct_solver
from rotfem.numerics.projection import summed, times


def critical_speed(system: Any) -> float | None:
    """Return the lowest speed (rad/s) at which the stiffness of a linear theory is singular; None if there is none.

    Of a nonlinear theory there is none: its stiffness is that of each equilibrium.

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
    eps = SLEPc.EPS().create(K_1.comm)
    # nu = 1/Omega² is the largest eigenvalue of −K_2 x = nu K_1 x. K_1 is definite, but round-off can have taken that
    # away, so it is no inner product.
    K_2.scale(-1.0)
    eps.setOperators(K_2, K_1)
    eps.setProblemType(SLEPc.EPS.ProblemType.GNHEP)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_REAL)
    eps.setDimensions(1, min(K_1.getSize()[0], 100))
    eps.setTolerances(1e-12, 2000)
    K_1.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    use_direct_solver(eps.getST().getKSP(), K_1.getSize()[0], symmetric=True)
    eps.solve()
    if eps.getConverged() == 0:
        raise ComputationError("the eigenproblem of the critical speed did not converge")
    nu = eps.getEigenvalue(0).real
    return float(1 / np.sqrt(nu)) if nu > 0 else None


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
