"""Structures: what is meshed, which spaces hold it, what carries mass and strain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from rotfem.errors import SceneError
from rotfem.scene import Scene
from rotfem.structures.beam import Beam
from rotfem.structures.planar_beam import PlanarBeam
from rotfem.structures.spatial_beam import SpatialBeam

STRUCTURES: dict[str, Callable[..., Beam]] = {"planar_beam": PlanarBeam, "spatial_beam": SpatialBeam}


def build(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> Any:
    """Return the discretised structure of a scene.

    Raises:
        SceneError: the structure type has no implementation yet.
    """
    kind = scene.structure.type
    if kind not in STRUCTURES:
        raise SceneError(scene.name, "structure.type", kind, f"can be computed so far: {', '.join(STRUCTURES)}")
    return STRUCTURES[kind](scene, comm)
