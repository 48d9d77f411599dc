"""What a user says: the scene, validated once. No dolfinx in it."""

from rotfem.scene.beams import PlanarBeamStructure, SpatialBeamStructure
from rotfem.scene.plates import PlateStructure
from rotfem.scene.scene import Scene, as_scene, load_scene
from rotfem.scene.settings import BeamMesh, PlateMesh, Time

__all__ = [
    "BeamMesh",
    "PlanarBeamStructure",
    "PlateMesh",
    "PlateStructure",
    "Scene",
    "SpatialBeamStructure",
    "Time",
    "as_scene",
    "load_scene",
]
