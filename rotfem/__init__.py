"""rotfem: rotating beams and plates with FEniCSx.

One noun, the scene (`Scene`, `load_scene`), and verbs on it (`run`, `modes`, `campbell`, `explain`, `cost`). The verbs
load FEniCSx when first used.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from rotfem.errors import ComputationError, OutputError, SceneError
from rotfem.scene import Scene, load_scene
from rotfem.version import __version__

if TYPE_CHECKING:
    from rotfem.campbell import campbell
    from rotfem.cost import cost
    from rotfem.explain import explain
    from rotfem.modes import modes
    from rotfem.simulation import run

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
    "run",
]


def _verb(name: str, module: str) -> property:
    """Return a verb as an attribute of the package, even where the module it is in has the same name.

    Importing a submodule binds its name in the package; the setter lets that pass without effect.
    """

    def get(package: ModuleType) -> Any:
        return getattr(import_module(module), name)

    def ignore(package: ModuleType, value: object) -> None:
        return None

    return property(get, ignore)


class _Package(ModuleType):
    run = _verb("run", "rotfem.simulation")
    modes = _verb("modes", "rotfem.modes")
    campbell = _verb("campbell", "rotfem.campbell")
    cost = _verb("cost", "rotfem.cost")
    explain = _verb("explain", "rotfem.explain")


sys.modules[__name__].__class__ = _Package
