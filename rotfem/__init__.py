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
    from rotfem.analysis.schemes import ESDIRK4 as ESDIRK4
    from rotfem.analysis.schemes import GeneralisedAlpha as GeneralisedAlpha
    from rotfem.analysis.schemes import Newmark as Newmark
    from rotfem.analysis.schemes import Scheme as Scheme
    from rotfem.analysis.schemes import Stage as Stage
    from rotfem.analysis.schemes import State as State
    from rotfem.commands.cost import CostResult as CostResult
    from rotfem.commands.import_blade import import_blade as import_blade
    from rotfem.commands.script import Problem as Problem
    from rotfem.commands.sweep import sweep as sweep
    from rotfem.commands.verbs import campbell as campbell
    from rotfem.commands.verbs import check as check
    from rotfem.commands.verbs import cost as cost
    from rotfem.commands.verbs import explain as explain
    from rotfem.commands.verbs import modes as modes
    from rotfem.commands.verbs import response as response
    from rotfem.commands.verbs import run as run
    from rotfem.commands.verbs import unbalance as unbalance
    from rotfem.mechanics.effects import DampingModel as DampingModel
    from rotfem.mechanics.effects import Effect as Effect
    from rotfem.mechanics.free_hub import FreeHub as FreeHub
    from rotfem.mechanics.free_hub import Torque as Torque
    from rotfem.mechanics.motion import Motion as Motion
    from rotfem.mechanics.motion import MotionLaw as MotionLaw
    from rotfem.mechanics.problem import Output as Output
    from rotfem.mechanics.theories import Theory as Theory
    from rotfem.results.campbell import CampbellResult as CampbellResult
    from rotfem.results.compare import CompareResult as CompareResult
    from rotfem.results.compare import compare as compare
    from rotfem.results.modes import ModesResult as ModesResult
    from rotfem.results.modes import ResponseResult as ResponseResult
    from rotfem.results.of_scene import CheckResult as CheckResult
    from rotfem.results.of_scene import ExplainResult as ExplainResult
    from rotfem.results.run import RunResult as RunResult
    from rotfem.results.sweep import SweepResult as SweepResult
    from rotfem.results.unbalance import UnbalanceResult as UnbalanceResult
    from rotfem.scene import BeamMesh as BeamMesh
    from rotfem.scene import PlateMesh as PlateMesh
    from rotfem.scene import Scene as Scene
    from rotfem.scene import load_scene as load_scene
    from rotfem.scene.beams import PlanarBeamStructure as PlanarBeam
    from rotfem.scene.beams import SpatialBeamStructure as SpatialBeam
    from rotfem.scene.blades.deck import Asked as Asked
    from rotfem.scene.blades.deck import BladeFormat as BladeFormat
    from rotfem.scene.blades.deck import Deck as Deck
    from rotfem.scene.loads import LoadsTable as Loads
    from rotfem.scene.plates import PlateStructure as Plate
    from rotfem.scene.section_shapes import Geometry as Geometry
    from rotfem.scene.section_shapes import Shape as Shape
    from rotfem.scene.structure import StructureKind as StructureKind

#: Public name ↦ module and name there: what type checkers see above is imported when it is first asked for.
_LATER = {
    alias.asname or alias.name: (str(node.module), alias.name)
    for block in ast.parse(Path(__file__).read_text(encoding="utf-8")).body
    if isinstance(block, ast.If)
    for node in block.body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}

__all__ = ["ComputationError", "InputError", "OutputError", "SceneError", "__version__", "register"]
__all__ += sorted(_LATER)


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
