"""`rotfem import`: a scene from a blade or rotor file of another program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rotfem.scene import Scene
from rotfem.scene.files import apply_overrides


def import_blade(
    file: str | Path, format: str | None = None, changes: Sequence[str] = (), rigid: bool = False
) -> Scene:
    """Return the scene of a blade or rotor file, at rest, with nothing in it but that and what is changed.

    Args:
        file: the file, of one of the formats in `docs/blades.md`.
        format: its name; None takes what the file says of itself.
        changes: keys that the file leaves open, such as "structure.length=61.5", applied in order.
        rigid: give stiffnesses that the file leaves open a value at which they add nothing.

    Raises:
        SceneError: the file cannot be read, naming line and column; or something that it does not have is missing.
    """
    path = Path(file)
    section = {"from": str(path.resolve()), "format": format, "rigid": rigid or None}
    tables: dict[str, Any] = {
        "structure": {"type": "spatial_beam", "section": {k: v for k, v in section.items() if v is not None}},
        "motion": {"type": "constant", "speed": 0.0},
        "output": {"frequency": "Hz"},
    }
    tables = apply_overrides(path.name, tables, changes)
    scene = Scene.from_dict(tables, path.stem)
    structure = scene.structure.model_dump(exclude_unset=True, exclude_none=True)
    if structure.get("root", {}).get("driven"):
        tables = {**tables, "motion": {"axis": [1.0, 0.0, 0.0], **tables["motion"]}}
    imported = Scene.from_dict({**tables, "structure": {"type": "spatial_beam", **structure}}, path.stem)
    imported._hints, imported._inputs = scene._hints, scene._inputs
    return imported
