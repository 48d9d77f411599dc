"""What theory says of M, C and K, held against what was assembled and solved."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.modal import ModalAnalysis, Spinning

Array = npt.NDArray[Any]


def self_checks(analysis: ModalAnalysis, spinning: Spinning) -> dict[str, float]:
    """Return how far symmetry, the spectrum and the linearisation are from what theory says (all relative).

    M and K symmetric and C skew without damping and follower loads; then −λ̄ is an eigenvalue with λ. The tangents are
    compared with central differences of the residual in the nonlinear theories.
    """
    out = {f"asymmetry_{name}": value for name, value in spinning.pencil.asymmetries().items()}
    if spinning.pencil.spectrum_error is not None:
        out["spectrum"] = spinning.pencil.spectrum_error
    if not analysis.system.linear:  # a linear system's residual is made of these very matrices
        out["linearisation"] = linearisation_error(analysis, spinning)
    return out


def linearisation_error(analysis: ModalAnalysis, spinning: Spinning) -> float:
    """Return the relative difference between M, C, K times a vector and central differences of the residual."""
    system, pencil = analysis.system.held, spinning.clamped
    zero = system.zeros()
    # A direction without structure: for a mode, K x is what is left when large axial terms cancel.
    system.q.x.array[:] = np.random.default_rng(1).standard_normal(zero.size) * system.scale
    system.q.x.scatter_forward()
    direction = system.q.x.array.copy()
    system.set_time(0.0, system.motion.at_speed(spinning.speed))
    worst = 0.0

    def residual(q: Array, v: Array, a: Array) -> Array:
        system.set_state(q, v, a)
        return -np.asarray(system.residual_in_motion().array)

    owned = system.V.dofmap.index_map.size_local * system.V.dofmap.index_map_bs
    direction[system.clamped] = 0.0
    # The residual is quadratic in v and linear in a, so that central differences are exact there, however long.
    for A, slot, step in ((pencil.K, 0, 1e-7), (pencil.C, 1, 1.0), (pencil.M, 2, 1.0)):
        plus, minus = [spinning.q, zero, zero], [spinning.q, zero, zero]
        plus[slot], minus[slot] = plus[slot] + step * direction, minus[slot] - step * direction
        difference = (residual(*plus) - residual(*minus)) / (2 * step)
        exact = pencil.apply(A, direction[:owned, None].astype(complex))[:, 0].real
        exact[system.clamped] = 0.0
        sums = np.array([np.sum((difference - exact) ** 2), np.sum(exact**2)])
        error, size = analysis.comm.allreduce(sums)
        worst = max(worst, float(np.sqrt(error / size)) if size > 0 else 0.0)
    system.set_state(spinning.q)
    return worst
