"""What a reduced linear model is off as linear theories take the stretch of a structure for none, and steady."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.solution import Trajectory
from rotfem.analysis.reduced.tips import largest, tips_of

Array = npt.NDArray[np.float64]

#: How many times as long the steps are by which two motions are only compared.
COARSE = 4


def stretched(response: Response) -> float:
    """Return how far the tip is with stiffnesses that are off by what the stretch does to them, m."""
    model, solution = response.model, response.solution
    stretch = float(np.abs(response.tips[:, 0]).max(initial=0.0)) / model.system.structure.length
    model.system.scale_stiffness(*(1 + times_off * stretch for times_off in model.system.structure.stretched))
    start = response.q[0], response.v[0]
    try:
        other = solution.again(COARSE).solve(model, *start)
    finally:
        solution.drive.whole.leave_out(())
    same = response.trajectory.exact or other.steps == response.trajectory.steps
    own = response.q if same else solution.again(COARSE).solve(model, *start).q
    return largest(model, (other.q - own) @ tips_of(model).T)


def unseen(response: Response, shapes: Array) -> float:
    """Return the part of the largest stretch that shapes (m, r) leave out, whose products are not known."""
    rows = tips_of(response.model)[0]
    left = (response.q - (response.q @ shapes) @ shapes.T) @ rows
    whole = float(np.abs(response.q @ rows).max(initial=0.0))
    return min(1.0, float(np.abs(left).max(initial=0.0)) / whole) if whole > 0.0 else 0.0


def ringing(response: Response, slow: Trajectory) -> float:
    """Return what the tip may be off, m, as the force along the structure rings where linear theories have it steady.

    What is struck by the ringing itself, as the bending by its Coriolis forces, sees that force change as fast. The
    part of a bending stiffness that is of it is at most the square of the speed over the frequency.
    """
    model, drive, times = response.model, response.solution.drive, response.times
    if not response.trajectory.exact or model.size == 0:
        return 0.0
    rings = (response.q - slow.q) @ tips_of(model).T[:, 0]
    M, _, K, _ = model.operators(response.factors()[:1])
    squares = np.linalg.eigvals(np.linalg.solve(M[0], K[0])).real
    lowest, speed = float(squares[squares > 0.0].min(initial=np.inf)), float(np.abs(drive.speed(times)).max())
    return float(np.abs(rings).max()) * min(1.0, speed**2 / lowest)
