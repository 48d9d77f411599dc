"""Eigenpairs of a pencil in a basis that grows by K⁻¹ times the residuals of Ritz pairs; no physics.

*Gyroscopic*, the slowest of a large one: of M and K symmetric and C skew the Galerkin projection on a real basis has
the same symmetry, and with it eigenvalues λ, −λ̄. Each round adds K⁻¹ (λ² M + λ C + K) x of all pairs that are not done
to the basis, one block of the second-order Krylov space of K⁻¹C and K⁻¹M (Bai & Su 2005). K⁻¹ is applied to all of them
at once, which reads its factor once. That column is also the error of x, to first order and but for a factor near one.
Columns are in Fortran order, as PETSc wants them.

*Heavily damped*, overdamped ones too: with much damping the eigenvalues of least |λ| are no longer those of the
smoothest shapes: viscosity η of the stiffness gives every stiff shape of the mesh a slow eigenvalue at −1/η, where all
of them crowd together. What is wanted are the eigenvalues of the shapes that vibrate slowest without damping, a
conjugate pair or two real ones each. So the undamped modes are the first basis; Ritz pairs are put in the order of
ω = √(x^H K x / x^H M x), and the basis grows by the residuals of right and left vectors (Davidson's method) until these
are round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from rotfem.errors import ComputationError
from rotfem.numerics.linear import ROUNDED, DirectSolver
from rotfem.numerics.projection import combined, new_directions, sparse_part, summed, times, times_transposed

Array = npt.NDArray[Any]
Matrices: TypeAlias = tuple[Any, Any, Any]

#: A size that is none.
TINY = 1e-300

#: Undamped modes, and Ritz pairs, beyond those wanted.
MORE = 4

#: Backward error at which a pair is done; relative error of a vector at which a gyroscopic one is: that of its
#: eigenvalue is of second order in it.
DONE, CLOSE = 1e-13, 1e-5

#: Relative distance of real eigenvalues that are one.
EQUAL = 1e-9


def heavily_damped(values: Array) -> bool:
    """Return whether eigenvalues (1/s) that are not zero have heavy damping among them, −Re λ > 0.3 |λ|."""
    return bool(np.any(values.real < -0.3 * np.abs(values)))


def quadratic(m: Array, c: Array, k: Array, target: float) -> tuple[Array, Array, Array]:
    """Return (λ, x, y): all eigenvalues of a small dense pencil, nearest to the target first, and unit vectors.

    With λ = target + λ', the least λ' are the largest eigenvalues of the linear form in 1/λ', so that stiff directions
    do not spoil them; with K on the right they would set the size of the error for all.
    """
    from scipy.linalg import eig  # slow to load, and most commands solve no eigenproblem

    n = len(k)
    unit = np.sqrt(max(float(np.trace(k)) / max(float(np.trace(m)), TINY), TINY))
    shifted = [k + target * c + target**2 * m, unit * (c + 2 * target * m), unit**2 * m]
    try:
        right_side = np.linalg.solve(shifted[0], np.hstack(shifted[1:]))
        nu, left, right = eig(np.vstack([-right_side, np.eye(n, 2 * n)]), left=True)
        order = np.argsort(-np.abs(nu), kind="stable")
        order = order[np.abs(nu[order]) > 0.0]
        x, y = right[n:, order], np.linalg.solve(shifted[0].conj().T, left[:n, order])
    except np.linalg.LinAlgError:  # of a matrix or of its transpose: round-off may tell them apart
        what = "the stiffness matrix is singular" if target == 0.0 else "the matrices are singular to round-off"
        raise ComputationError(what, advice="a slightly different speed") from None
    # A vector that is too small for numbers stays zero: it has no mass, and is none.
    x, y = (vectors / np.maximum(np.linalg.norm(vectors, axis=0), TINY) for vectors in (x, y))
    return target + unit / nu[order], x, y


# --- gyroscopic -------------------------------------------------------------------------------------------------------


def gyroscopic_pairs(
    matrices: tuple[Any, Any, Any], scale: Array, solver: DirectSolver, count: int
) -> tuple[Array, Array, Array]:
    """Return (λ, x, normwise backward error) of at least `count` pairs nearest to zero, and of their conjugates."""
    comm: MPI.Comm = matrices[0].comm.tompi4py()
    wanted, random, d = 2 * count + 2, np.random.default_rng(comm.rank), scale[:, None]
    norms = [_norm(comm, A, d * random.choice([-1.0, 1.0], d.shape), d) for A in matrices]
    W = solver.solve_all(times(matrices[0], d * random.standard_normal((len(d), wanted))))
    Q: Array = np.zeros((len(d), 0))
    projected: list[Array] = [np.zeros((0, 0)) for _ in matrices]
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
        pair = np.append(np.arange(len(values)), np.flatnonzero(swings))  # of a column
        turns = [np.block([[np.diag(p.real), np.diag(p.imag)], [-np.diag(p.imag), np.diag(p.real)]]) for p in powers]
        turns = [turn[both][:, both] for turn in turns]
        X = d * combined(Q, np.hstack([z.real, z.imag])[:, both])
        W = solver.solve_all(_summed(matrices[:2], turns[:2], X))
        W += X
        lengths, change = (_squares(comm, Y, 1 / scale) for Y in (X, W))
        lengths = np.bincount(pair, lengths)
        errors = np.sqrt(np.bincount(pair, change) / lengths)
        if np.all(errors[:count] < CLOSE):
            chosen, imaginary = np.flatnonzero(errors < CLOSE), len(values) + np.cumsum(swings) - 1
            X -= W  # a step of inverse iteration
            left = np.bincount(pair, _squares(comm, _summed(matrices, turns, X), scale))  # of the residual
            x, swings = X[:, chosen] + 1j * swings[chosen] * X[:, imaginary[chosen]], swings[chosen]
            values, backward = values[chosen], (np.sqrt(left / lengths) / (norms @ np.abs(powers)))[chosen]
            conjugates = values[swings].conj(), x[:, swings].conj(), backward[swings]
            return np.append(values, conjugates[0]), np.hstack([x, conjugates[1]]), np.append(backward, conjugates[2])
        W = W.T[change > (CLOSE / 2) ** 2 * lengths[pair]].T
    raise ComputationError("the eigensolver did not converge", advice="fewer modes.count or another mesh")


def _summed(matrices: Sequence[Any], factors: Sequence[Array], X: Array) -> Array:
    """Return Σ A X c of matrices A and small matrices c."""
    return np.asarray(sum(combined(times(A, X), c) for A, c in zip(matrices, factors, strict=True)))


def _squares(comm: MPI.Comm, X: Array, scale: Array) -> Array:
    """Return the squared lengths of scaled columns."""
    return np.asarray(summed(comm, np.einsum("i,ij,ij->j", scale**2, X, X)))


def _norm(comm: MPI.Comm, A: Any, signs: Array, d: Array) -> float:
    """Return a lower bound of the norm ‖D A D‖_∞, from random signs times D."""
    return float(comm.allreduce(float(np.max(np.abs(d * times(A, signs)), initial=0.0)), op=MPI.MAX))


# --- damped -----------------------------------------------------------------------------------------------------------


def place(values: Array, X: Array, MX: Array, KX: Array) -> Array:
    """Return what to sort eigenvalues by: ω of their shape, of the fast one of two real ones that of the slow one.

    ω = √|x^H K x / x^H M x|, the frequency of the shape without damping (Rayleigh quotient). The slow one may be zero,
    as that of a hinge with a damper and no spring, and so have either sign.
    """
    mass, stiffness = (np.abs(np.sum(X.conj() * Y, axis=0)) for Y in (MX, KX))
    omega = np.asarray(np.sqrt(stiffness / mass))
    real = values.imag == 0.0
    slow, fast = (np.flatnonzero(real & part) for part in (np.abs(values) < omega, ~(np.abs(values) < omega)))
    if len(slow) and len(fast):
        sizes = np.sqrt(np.abs(np.sum(X.conj() * MX, axis=0)))
        alike = np.abs(X[:, fast].conj().T @ MX[:, slow]) / np.outer(sizes[fast], sizes[slow])
        alike[np.abs(values[fast])[:, None] <= np.abs(values[slow])] = 0.0
        there = np.any(alike, axis=1)
        omega[fast[there]] = omega[slow[np.argmax(alike[there], axis=1)]]
    return omega


def turn_equal(values: Array, vectors: tuple[Array, Array], matrices: tuple[Array, Array, Array]) -> None:
    """Make eigenvalues that are one real one equal, in place; turn their vectors to shapes of their own frequencies.

    With C = η K + M/η all slow eigenvalues are −1/η, and any combination of their shapes is one.
    """
    from scipy.linalg import eig

    (x, y), (m, c, k) = vectors, matrices
    real = np.flatnonzero((np.abs(values.imag) <= EQUAL * np.abs(values)) & (values.real < 0.0))
    real = real[np.argsort(values.real[real])]
    groups = np.split(real, 1 + np.flatnonzero(np.diff(values.real[real]) > EQUAL * np.abs(values.real[real][1:])))
    for group in (g for g in groups if len(g) > 1):
        X, Y = (_real_span(v[:, group]) for v in (x, y))
        _, turn = eig(X.T @ k @ X, X.T @ m @ X)
        if not np.all(np.isfinite(turn)) or np.max(np.abs(turn.imag)) > 0.0:
            continue
        lam = float(np.mean(values.real[group]))
        X = X @ turn.real
        Y = Y @ np.linalg.pinv(Y.T @ (2 * lam * m + c) @ X).T
        values[group] = lam
        x[:, group], y[:, group] = X / np.linalg.norm(X, axis=0), Y / np.linalg.norm(Y, axis=0)


def _real_span(v: Array) -> Array:
    """Return as many orthonormal real columns as v has, that span its real and imaginary parts best."""
    return np.asarray(np.linalg.svd(np.hstack([v.real, v.imag]), full_matrices=False)[0][:, : v.shape[1]])


def smoothest(
    pairs: tuple[Array, Array, Array], matrices: tuple[Array, Array, Array], count: int, norm: float
) -> tuple[Array, Array, Array]:
    """Return those (λ, x, y) of all of a small pencil that have the smoothest shapes, slowest without damping first.

    Of each conjugate pair there is one. The entries of K are rounded to a part of the norm.
    """
    (values, x, y), (m, c, k) = pairs, matrices
    turn_equal(values, (x, y), (m, c, k))
    # The square of a larger eigenvalue, times anything, may be no number any more.
    upper = (values.imag >= 0.0) & (np.abs(np.sum(x.conj() * (m @ x), axis=0)) > 0.0) & (np.abs(values) < 1e140)
    zero = np.abs(np.sum(x.conj() * (k @ x), axis=0)) < len(k) * ROUNDED * norm
    both = np.abs(values[:, None] + values) < 0.1 * np.abs(values)  # of a double zero, round-off makes ±λ, or ±iλ
    falling = (values.imag == 0.0) & (values.real < 0.0)
    upper &= ~(falling & np.any(both & zero[:, None] & zero, axis=0))
    if not np.any(upper):
        raise ComputationError("damping is so far out of proportion that no mode is left")
    values, x, y = values[upper], x[:, upper], y[:, upper]
    order = np.lexsort((np.abs(values), place(values, x, m @ x, k @ x)))[:count]
    return values[order], x[:, order], y[:, order]


def damped_pairs(matrices: Matrices, undamped: Array, count: int, target: float) -> tuple[Array, Array, Array, Array]:
    """Return (λ, x, y, backward errors) of the shapes that vibrate slowest without damping.

    Directions are K⁻¹ times the residuals: residual inverse iteration (Neumaier 1985), quick where λ is near a target.
    A real λ of an overdamped pair may be far from it: its own are P(λ)⁻¹ P'(λ) x, Newton's method for P(λ) x = 0.

    Args:
        matrices: M, C, K, balanced.
        undamped: first directions, complex columns of owned unknowns.
        count: number of pairs.
        target: where K + σ C + σ² M is factorised, 0, or away from the zero eigenvalue of a free hub.
    """
    (M, C, K), comm = matrices, matrices[2].comm.tompi4py()
    norms = np.array([A.norm(PETSc.NormType.INFINITY) for A in matrices])

    def solver_at(sigma: float) -> DirectSolver:
        P = K.copy()
        for A, factor in ((C, sigma), (M, sigma**2)):
            if factor != 0.0:
                P.axpy(factor, sparse_part(A))  # near enough to find new directions
        return DirectSolver(P)

    def adjoint(A: Any, Y: Array) -> Array:
        both, n = times_transposed(A, np.hstack([Y.real, Y.imag])), Y.shape[1]
        return np.asarray(both[:, :n] + 1j * both[:, n:])

    solver, V = solver_at(target), np.zeros((K.getLocalSize()[0], 0))
    products, new = [V] * 3, np.hstack([undamped.real, undamped.imag])
    for number in range(13):
        W = new_directions(comm, V, new)
        if W.shape[1] == 0:
            break
        V, products = np.hstack([V, W]), [np.hstack([P, times(A, W)]) for P, A in zip(products, matrices, strict=True)]
        m, c, k = (summed(comm, V.T @ P) for P in products)
        values, x, y = smoothest(quadratic(m, c, k, target), (m, c, k), count, norms[2])
        right, left, powers = V @ x, V @ y, np.array([values**2, values, np.ones_like(values)])
        sides = sum(p * (P @ x) for p, P in zip(powers, products, strict=True))
        others = sum(p.conj() * adjoint(A, left) for p, A in zip(powers, matrices, strict=True))
        residuals = [r / (norms @ np.abs(powers)) for r in (sides, others)]
        errors = np.maximum(*(np.sqrt(summed(comm, np.sum(np.abs(r) ** 2, axis=0))) for r in residuals))
        if float(np.max(errors)) <= DONE or V.shape[1] > 400:
            break
        columns: list[Array] = []
        for i in np.flatnonzero(errors > DONE):
            lam, there, both = values[i], solver, [r[:, i] for r in residuals]
            if number >= 6 and lam.imag == 0.0 and np.isfinite(lam.real):
                there, vectors = solver_at(float(lam.real)), np.stack([right[:, i].real, left[:, i].real], axis=1)
                both = list((2 * lam.real * times(M, vectors) + times(C, vectors)).T)
            columns += [*there.solve_all(np.array([part for r in both for part in (r.real, r.imag)]).T).T]
        # by largest entries, whose squares may be no numbers any more; `new_directions` makes lengths one
        sizes = summed(comm, np.array([np.abs(c).max(initial=0.0) for c in columns]))
        found = [c / size for c, size in zip(columns, sizes, strict=True) if 0.0 < size < np.inf]
        if not found:
            break
        new = np.array(found).T
    return values, right, left, errors
