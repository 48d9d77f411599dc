"""The slowest eigenpairs of a large gyroscopic pencil, by a block Krylov method; no physics.

Of M and K symmetric and C skew the Galerkin projection on a real basis has the same symmetry, and with it eigenvalues
λ, −λ̄. Each round adds K⁻¹ (λ² M + λ C + K) x of all pairs that are not done to the basis, which is one block of the
second-order Krylov space of K⁻¹C and K⁻¹M (Bai & Su 2005). K⁻¹ is applied to all of them at once, which reads its
factor once. That column is also the error of x, to first order and but for a factor near one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.errors import ComputationError
from rotfem.numerics.damped import quadratic
from rotfem.numerics.linear import DirectSolver
from rotfem.numerics.projection import new_directions, summed, times

Array = npt.NDArray[Any]

#: Relative error of a vector at which a pair is done: that of its eigenvalue is of second order in it.
DONE = 1e-7


def gyroscopic_pairs(
    matrices: tuple[Any, Any, Any], scale: Array, solver: DirectSolver, count: int, near: Array | None = None
) -> tuple[Array, Array, Array]:
    """Return (λ, x, normwise backward error) of at least `count` pairs nearest to zero, and of their conjugates.

    Args:
        matrices: M, C, K, PETSc matrices.
        scale: D of the unknowns that D K D has a diagonal of about one with, owned rows.
        solver: of K.
        count: number of pairs; of conjugate ones, one counts.
        near: complex columns (owned rows) near the vectors, if any are known.

    Raises:
        ComputationError: they do not converge, or K is singular.
    """
    comm: MPI.Comm = matrices[0].comm.tompi4py()
    wanted, random, d = 2 * count + 2, np.random.default_rng(comm.rank), scale[:, None]
    norms = [_norm(comm, A, d * random.choice([-1.0, 1.0], d.shape), d) for A in matrices]
    W = solver.solve_all(times(matrices[0], d * random.standard_normal((len(d), wanted if near is None else 2))))
    if near is not None:  # which may lack a mode
        W = np.hstack([near.real[:, : count + 1], near.imag[:, : count + 1], W])
    Q: Array = np.zeros((len(d), 0))
    projected: list[Array] = [np.zeros((0, 0)) for _ in matrices]
    before = np.inf
    for _ in range(12):
        W = new_directions(comm, Q, W / d)
        for i, (A, sign) in enumerate(zip(matrices, (1.0, -1.0, 1.0), strict=True)):
            AW = times(A, d * W)
            AW *= d
            mixed, own = summed(comm, Q.T @ AW), summed(comm, W.T @ AW)
            projected[i] = np.block([[projected[i], mixed], [sign * mixed.T, 0.5 * (own + sign * own.T)]])
        Q = np.hstack([Q, W])
        values, z, _ = quadratic(projected[0], projected[1], projected[2], 0.0)
        upper = np.flatnonzero(values[:wanted].imag >= 0.0)
        values, z = values[upper], z[:, upper]
        swings, powers = values.imag > 0.0, np.array([values**2, values, np.ones_like(values)])
        both = np.append(np.ones_like(swings), swings)  # a real pair has no imaginary part
        X, residual = d * (Q @ np.hstack([z.real, z.imag])[:, both]), np.zeros((len(d), int(both.sum())))
        for A, power in zip(matrices, powers, strict=True):
            re, im = np.diag(power.real), np.diag(power.imag)
            residual += times(A, X) @ np.block([[re, im], [-im, re]])[both][:, both]
        W = solver.solve_all(residual)
        lengths, left, change = (
            _squares(comm, Y, s, swings) for Y, s in ((X, 1 / scale), (residual, scale), (W, 1 / scale))
        )
        errors = np.sqrt(change / lengths)
        worst = float(np.max(errors[:count]))
        if worst < DONE or 0.5 * before < worst < 1e-5:  # round-off may leave that
            chosen, imaginary = np.flatnonzero(errors <= max(DONE, worst)), len(values) + np.cumsum(swings) - 1
            X -= W  # a step of inverse iteration
            x, swings = X[:, chosen] + 1j * swings[chosen] * X[:, imaginary[chosen]], swings[chosen]
            values, backward = values[chosen], (np.sqrt(left / lengths) / (norms @ np.abs(powers)))[chosen]
            conjugates = values[swings].conj(), x[:, swings].conj(), backward[swings]
            return np.append(values, conjugates[0]), np.hstack([x, conjugates[1]]), np.append(backward, conjugates[2])
        before, live = worst, errors > DONE
        W = W[:, np.append(live, live)[both]]
    raise ComputationError("the eigensolver did not converge", advice="fewer modes.count or another mesh")


def _squares(comm: MPI.Comm, X: Array, scale: Array, swings: Array) -> Array:
    """Return the squared lengths of scaled columns, which the imaginary parts of those that swing follow."""
    squares = np.asarray(summed(comm, np.einsum("i,ij,ij->j", scale**2, X, X)))
    out = squares[: len(swings)]
    out[swings] += squares[len(swings) :]
    return out


def _norm(comm: MPI.Comm, A: Any, signs: Array, d: Array) -> float:
    """Return a lower bound of the norm ‖D A D‖_∞, from random signs times D."""
    return float(comm.allreduce(float(np.max(np.abs(d * times(A, signs)), initial=0.0)), op=MPI.MAX))
