"""Vibrations that jumps of what drives a reduced model start, told without following them.

A jump of the accelerations by Δa, in the modes of M and K at rest Δa_j, starts vibrations of amplitude Δa_j/ω_j². A
beam that is spun at once rings along its axis so, too fast for steps that its bending needs.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.drive import BESIDE
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.tips import tips_of

Array = npt.NDArray[np.float64]

#: Frequency times the longest step of a response from which it has not resolved a vibration.
FAST = 2.0

#: Part of the largest displacement of the tip from which a vibration is told of.
TOLD = 1e-7


def struck(response: Response) -> tuple[tuple[float, float], ...]:
    """Return frequency (rad/s) and largest amplitude of the tip (m) of the modes that a response passes over."""
    model, drive = response.model, response.solution.drive
    if model.size == 0 or response.trajectory.exact:
        return ()
    knots = drive.knots[:-1]
    q, v = response.trajectory.at(knots)
    before, after = knots * (1 - BESIDE), np.maximum(knots * (1 + BESIDE), np.spacing(drive.knots[-1]))
    jumps = model.accelerations(drive.factors(after), q, v)
    jumps[1:] -= model.accelerations(drive.factors(before), q, v)[1:]
    M, _, K, _ = (x[0] for x in model.operators(drive.factors(after[:1])))
    squares, modes = np.linalg.eig(np.linalg.solve(M, K))
    stiff = squares.real > (FAST / np.diff(response.solution.ends(model)).max()) ** 2
    parts = np.abs(np.linalg.solve(modes, jumps.T)[stiff]).max(axis=1) / squares.real[stiff]
    moves = [name.startswith("u") for name in model.system.structure.components]
    amplitudes = parts * np.linalg.norm((tips_of(model)[moves] @ modes[:, stiff]).real, axis=0)
    size = float(np.linalg.norm(response.tips[:, moves], axis=1).max(initial=0.0))
    return tuple(
        (float(np.sqrt(w)), float(a)) for w, a in zip(squares.real[stiff], amplitudes, strict=True) if a > TOLD * size
    )
