"""`rotfem import`: a scene from a blade or rotor file of another program."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rotfem.results.files import write_text
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


def write_imported(scene: Scene, source: Path, path: Path) -> Path:
    """Write an imported scene as TOML, one row of a table on a line, with what it came from; return the path."""
    head = f"# imported from {source.name}; axes, signs and centres as in docs/blades.md, SI units, rad\n"
    return write_text(path, head + toml_text(scene.tables))


def toml_text(tables: Mapping[str, Any], above: str = "", head: str = "[{}]") -> str:
    """Return nested tables as TOML; tables of numbers have a row on each line."""
    nested, lines = dict[str, Any](), list[str]()
    for key, value in tables.items():
        rows = isinstance(value, list | tuple) and len(value) > 0 and value[0]
        if isinstance(value, Mapping) or isinstance(rows, Mapping):
            nested[f"{above}.{key}".lstrip(".")] = value
        elif isinstance(rows, list | tuple):
            lines.append(f"{key} = [\n" + "".join(f"  {json.dumps(row)},\n" for row in value) + "]")
        else:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    text = "".join(f"{line}\n" for line in ([f"\n{head.format(above)}", *lines] if above and lines else lines))
    for name, value in nested.items():
        text += toml_text(value, name) if isinstance(value, Mapping) else ""
        text += "".join(toml_text(row, name, "[[{}]]") for row in value) if isinstance(value, list | tuple) else ""
    return text
