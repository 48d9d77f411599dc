"""rotfem: rotating beams and plates with FEniCSx.

One noun, the scene (`Scene`, `load_scene`), and verbs on it (`run`). The verbs load FEniCSx when first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rotfem.errors import ComputationError, OutputError, SceneError
from rotfem.scene import Scene, load_scene

if TYPE_CHECKING:
    from rotfem.simulation import run

__version__ = "0.1.0"

__all__ = ["ComputationError", "OutputError", "Scene", "SceneError", "load_scene", "run"]

_LAZY = {"run": "rotfem.simulation"}


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module 'rotfem' has no attribute {name!r}")
