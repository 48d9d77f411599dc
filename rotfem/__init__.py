"""rotfem: rotating beams and plates with FEniCSx.

One noun, the scene (`Scene`, `load_scene`), and verbs on it (`run`, `modes`, `campbell`, `explain`, `cost`). The verbs
load FEniCSx when first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rotfem.errors import ComputationError, OutputError, SceneError
from rotfem.registry import register
from rotfem.scene import Scene, load_scene
from rotfem.version import __version__

if TYPE_CHECKING:
    from rotfem.commands.campbell import campbell
    from rotfem.commands.cost.study import cost
    from rotfem.commands.explain import explain
    from rotfem.commands.modes import modes
    from rotfem.commands.run import run

__all__ = [
    "ComputationError",
    "OutputError",
    "Scene",
    "SceneError",
    "__version__",
    "campbell",
    "cost",
    "explain",
    "load_scene",
    "modes",
    "register",
    "run",
]

#: Name ↦ module that has it: what loads FEniCSx is imported when it is first asked for.
_LATER = {
    "campbell": "rotfem.commands.campbell",
    "cost": "rotfem.commands.cost.study",
    "explain": "rotfem.commands.explain",
    "modes": "rotfem.commands.modes",
    "run": "rotfem.commands.run",
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'rotfem' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_LATER[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
