"""rotfem: rotating beams and plates with FEniCSx.

One noun, the scene (`Scene`, `load_scene`), and verbs on it (`check`, `run`, `modes`, `campbell`, `response`,
`explain`, `cost`, `sweep`), and on results `compare`. Between scene and equations stands the `Problem`, which a script
can build too. `register` adds a `Theory`, `Effect`, `Scheme`, `MotionLaw`, `DampingModel`, `StructureKind`, `Shape`,
`Output` or `BladeFormat` of a user's own. Everything is imported when it is first used, FEniCSx by what computes.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotfem.errors import ComputationError, InputError, OutputError, SceneError
from rotfem.registry import register
from rotfem.version import __version__

if TYPE_CHECKING:
    from rotfem.analysis.alpha_family import GeneralisedAlpha, Newmark
    from rotfem.analysis.runge_kutta import ESDIRK4
    from rotfem.analysis.schemes import Scheme, Stage, State
    from rotfem.commands.campbell import campbell
    from rotfem.commands.check import check
    from rotfem.commands.cost.result import CostResult
    from rotfem.commands.cost.study import cost
    from rotfem.commands.explain import explain
    from rotfem.commands.import_blade import import_blade
    from rotfem.commands.modes import modes
    from rotfem.commands.problem import Problem
    from rotfem.commands.response import response
    from rotfem.commands.run import run
    from rotfem.commands.sweep import sweep
    from rotfem.mechanics.effects import DampingModel, Effect
    from rotfem.mechanics.free_hub import FreeHub, Torque
    from rotfem.mechanics.loads import ConstantLoad, Loads
    from rotfem.mechanics.motion import Motion, MotionLaw
    from rotfem.mechanics.problem import Output
    from rotfem.mechanics.theories import Theory
    from rotfem.results import CampbellResult, CheckResult, ExplainResult, ModesResult, ResponseResult, RunResult
    from rotfem.results.compare import CompareResult, compare
    from rotfem.results.sweep import SweepResult
    from rotfem.scene import BeamMesh, PlateMesh, Scene, load_scene
    from rotfem.scene.beams import PlanarBeamStructure as PlanarBeam
    from rotfem.scene.beams import SpatialBeamStructure as SpatialBeam
    from rotfem.scene.blades.deck import Asked, BladeFormat, Deck
    from rotfem.scene.plates import PlateStructure as Plate
    from rotfem.scene.section_shapes import Geometry, Shape
    from rotfem.scene.structure import StructureKind

#: Public name ↦ module and name there: what type checkers see above is imported when it is first asked for.
_LATER = {
    alias.asname or alias.name: (str(node.module), alias.name)
    for block in ast.parse(Path(__file__).read_text(encoding="utf-8")).body
    if isinstance(block, ast.If)
    for node in block.body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}

__all__ = [
    "ESDIRK4",
    "Asked",
    "BeamMesh",
    "BladeFormat",
    "CampbellResult",
    "CheckResult",
    "CompareResult",
    "ComputationError",
    "ConstantLoad",
    "CostResult",
    "DampingModel",
    "Deck",
    "Effect",
    "ExplainResult",
    "FreeHub",
    "GeneralisedAlpha",
    "Geometry",
    "InputError",
    "Loads",
    "ModesResult",
    "Motion",
    "MotionLaw",
    "Newmark",
    "Output",
    "OutputError",
    "PlanarBeam",
    "Plate",
    "PlateMesh",
    "Problem",
    "ResponseResult",
    "RunResult",
    "Scene",
    "SceneError",
    "Scheme",
    "Shape",
    "SpatialBeam",
    "Stage",
    "State",
    "StructureKind",
    "SweepResult",
    "Theory",
    "Torque",
    "__version__",
    "campbell",
    "check",
    "compare",
    "cost",
    "explain",
    "import_blade",
    "load_scene",
    "modes",
    "register",
    "response",
    "run",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'rotfem' has no attribute {name!r}")
    module, attribute = _LATER[name]
    if not module.startswith(("rotfem.scene", "rotfem.results")):
        import_module("rotfem.numerics")  # before dolfinx, which would start PETSc in its own way
    value = globals()[name] = getattr(import_module(module), attribute)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
