"""A complex system by a solver of one nearby: residuals in the norm of their solutions made least; no physics.

Generalised conjugate residuals (Eisenstat, Elman & Schultz 1983), preconditioned from the left: what is nearby may
differ in a few directions by as much as it likes, each of which takes a round.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.errors import ComputationError
from rotfem.numerics.projection import summed

Complex = npt.NDArray[np.complex128]

#: Correction, relative to the solution, that ends the rounds; one that is good enough where they end; most rounds.
DONE, GOOD, ROUNDS = 1e-13, 1e-8, 60


def solve_by_nearby(
    times: Callable[[Complex], Complex], nearby: Callable[[Complex], Complex], b: Complex, comm: MPI.Comm
) -> Complex:
    """Return x of A x = b, owned rows.

    Args:
        times: x ↦ A x.
        nearby: b ↦ N⁻¹ b of an N that is nearly A.
        b: right-hand side.
        comm: communicator that the rows are distributed over.

    Raises:
        ComputationError: A is singular to working precision.
    """

    def dot(x: Complex, y: Complex) -> Any:
        return summed(comm, complex(np.vdot(x, y)))

    def size(x: Complex) -> float:
        return float(np.sqrt(abs(dot(x, x))))

    x: Complex = np.zeros_like(b)
    left = nearby(b)
    directions: list[tuple[Complex, Complex]] = []
    for _ in range(ROUNDS):
        z, w = left, nearby(times(left))
        for old, image in directions:
            share = dot(image, w)
            z, w = z - share * old, w - share * image
        length = size(w)
        if length == 0.0:
            break
        z, w = z / length, w / length
        directions.append((z, w))
        step = dot(w, left)
        x, left = x + step * z, left - step * w
        if size(left) <= DONE * size(x):
            break
    if not size(left) <= GOOD * size(x):
        raise ComputationError("the matrix is singular: its solution was not found")
    return x
