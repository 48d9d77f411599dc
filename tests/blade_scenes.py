"""Beams of blade files that a test writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rotfem.scene import Scene, SpatialBeamStructure

STIFF = {"GA2": 1e10, "GA3": 1e10}
RIGID = {"EA": 1e12, "GJ": 1e12, **STIFF}


def blade(folder: Path, text: str, name: str = "blade.dat", **more: Any) -> SpatialBeamStructure:
    """Return the beam of a file with this text; more are keys of the section, and of the structure after structure_."""
    (folder / name).write_text(text)
    return read(folder, name, **more)


def read(folder: Path, name: str, **more: Any) -> SpatialBeamStructure:
    structure = {key.removeprefix("structure_"): value for key, value in more.items() if key.startswith("structure_")}
    section = {"from": name} | {key: value for key, value in more.items() if not key.startswith("structure_")}
    tables = {"structure": {"type": "spatial_beam", **structure, "section": section}}
    scene = Scene.from_dict(tables | {"motion": {"type": "constant", "speed": 1.0}}, directory=folder)
    assert isinstance(scene.structure, SpatialBeamStructure)
    return scene.structure
