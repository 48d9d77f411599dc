"""Structures: what is meshed, which spaces hold it, what carries mass and strain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from rotfem.mechanics.problem import Problem
from rotfem.structures.planar_beam import PlanarBeam
from rotfem.structures.plate import Plate
from rotfem.structures.spatial_beam import SpatialBeam
from rotfem.structures.structure import Structure

STRUCTURES: dict[str, Callable[..., Structure]] = {
    "planar_beam": PlanarBeam,
    "spatial_beam": SpatialBeam,
    "plate": Plate,
}


def build(problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD) -> Any:
    """Return the discretised structure of a problem.

    Raises:
        InputError: a mesh or a section that cannot be computed with.
    """
    return STRUCTURES[problem.structure.type](problem, comm)
