"""What a user says: the scene, validated once. No dolfinx in it."""

from rotfem.scene.beams import PlanarBeamStructure as PlanarBeamStructure
from rotfem.scene.beams import SpatialBeamStructure as SpatialBeamStructure
from rotfem.scene.plates import PlateStructure as PlateStructure
from rotfem.scene.scene import Scene as Scene
from rotfem.scene.scene import as_scene as as_scene
from rotfem.scene.scene import load_scene as load_scene
from rotfem.scene.settings import BeamMesh as BeamMesh
from rotfem.scene.settings import PlateMesh as PlateMesh
from rotfem.scene.settings import Time as Time
