"""How far rotations hold where they are counted from the undeformed structure: in theories of moderate rotation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.errors import ComputationError
from rotfem.mechanics.rotations import FULL_TURN
from rotfem.mechanics.theories import richest

if TYPE_CHECKING:
    from rotfem.structures.structure import Structure

Array = npt.NDArray[np.float64]

#: Largest |alpha_2|, rad: at π/2 the two angles of the director meet their pole.
LARGEST_TILT = 1.5


def check_sections(beam: Structure, q: Array, time: float | None = None) -> None:
    """Refuse a state in which some section of a spatial beam has turned by more than a full turn.

    Raises:
        ComputationError: says where; rotation vectors stand for rotations one to one only up to there.
    """
    coordinates, values = beam.nodes(q)
    turns = np.linalg.norm(values[:, 3:], axis=1)
    worst = int(np.argmax(turns))
    if turns[worst] > FULL_TURN:
        theory = beam.problem.theory
        limited = "behind a hinge" if theory.exact else f"in the theory {theory.name}"
        others = "a spring or a damper at the root" if theory.exact else f'model.theory = "{richest().name}"'
        raise ComputationError(
            f"the section at X = {coordinates['x'][worst]:.4g} m has turned by {turns[worst] / (2 * np.pi):.3g} turns "
            f"relative to the frame; {limited} rotations are limited to one",
            time,
            f"a smaller load, or {others}",
        )


def check_directors(plate: Structure, q: Array, time: float | None = None) -> None:
    """Refuse a state in which the director of a plate has come to the pole of its angles.

    Raises:
        ComputationError: says how far it has come.
    """
    owned = plate.V.dofmap.index_map.size_local
    tilt = np.abs(q[: plate.size * owned].reshape(-1, plate.size)[:, 4])
    worst = plate.comm.allreduce(float(tilt.max(initial=0.0)), op=MPI.MAX)
    if worst > LARGEST_TILT:
        raise ComputationError(
            f"the plate has turned about direction 1 by {worst:.3g} rad (largest: {LARGEST_TILT}); in the theory "
            f"{plate.problem.theory.name} the director's angles are limited there, not about direction 2",
            time,
            f'a smaller load, or model.theory = "{richest().name}", which holds for any rotation',
        )
