"""What a user says: the scene, validated once. No dolfinx in it."""

from rotfem import registry
from rotfem.scene.beams import PlanarBeamStructure, SpatialBeamStructure
from rotfem.scene.loads import Load, Loads, MomentLoad
from rotfem.scene.motion import CallableMotion, ConstantMotion, SpinUpMotion, TableMotion, TorqueMotion
from rotfem.scene.output import OutputTable
from rotfem.scene.plates import PlateStructure
from rotfem.scene.scene import Scene, as_scene, load_scene
from rotfem.scene.section_shapes import Geometry, Shape
from rotfem.scene.settings import BeamMesh, Initial, Model, Modes, PlateMesh, Solver, Time
from rotfem.scene.signals import Signal

__all__ = [
    "EFFECTS",
    "THEORIES",
    "BeamMesh",
    "CallableMotion",
    "ConstantMotion",
    "Geometry",
    "Initial",
    "Load",
    "Loads",
    "Model",
    "Modes",
    "MomentLoad",
    "OutputTable",
    "PlanarBeamStructure",
    "PlateMesh",
    "PlateStructure",
    "Scene",
    "Shape",
    "Signal",
    "Solver",
    "SpatialBeamStructure",
    "SpinUpMotion",
    "TableMotion",
    "Time",
    "TorqueMotion",
    "as_scene",
    "load_scene",
]

#: Names of all effects, and of all theories from the poorest to the richest, as they are registered when asked for.
EFFECTS: tuple[str, ...]
THEORIES: tuple[str, ...]


def __getattr__(name: str) -> tuple[str, ...]:
    if name == "EFFECTS":
        return registry.effects.names
    if name == "THEORIES":
        return tuple(theory.name for theory in sorted(registry.theories, key=lambda theory: theory.rank))
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
