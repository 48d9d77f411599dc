"""`rotfem import`: a scene from a blade file of another program."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rotfem.results.files import write_text
from rotfem.scene import Scene
from rotfem.scene.files import apply_overrides
from rotfem.scene.scene import plain


def import_blade(file: str | Path, format: str | None = None, changes: Sequence[str] = ()) -> Scene:
    """Return the scene of a blade file, at rest, with nothing in it but the blade and what is changed.

    Args:
        file: the blade file, of one of the formats in `docs/blades.md`.
        format: its name; None takes what the file says of itself.
        changes: keys that the file leaves open, such as "structure.length=61.5", applied in order.

    Raises:
        SceneError: the file cannot be read, naming line and column; or something that it does not have is missing.
    """
    path = Path(file)
    section = {"from": str(path.resolve())} | ({} if format is None else {"format": format})
    tables: dict[str, Any] = {
        "structure": {"type": "spatial_beam", "section": section},
        "motion": {"type": "constant", "speed": 0.0},
    }
    tables = apply_overrides(path.name, tables, changes)
    scene = Scene.from_dict(tables, path.stem)
    read = scene.structure
    structure: dict[str, Any] = {"type": read.type} | {
        key: value for key, value in plain(read).items() if key in read.model_fields_set
    }
    imported = Scene.from_dict({**tables, "structure": structure}, path.stem)
    imported._hints, imported._inputs = scene._hints, scene._inputs
    return imported


def write_imported(scene: Scene, source: Path, path: Path) -> Path:
    """Write an imported scene as TOML, one row of a table on a line, with what it came from; return the path."""
    head = f"# imported from {source.name}; axes, signs and centres as in docs/blades.md, SI units, rad\n"
    return write_text(path, head + toml_text(scene.tables))


def toml_text(tables: Mapping[str, Any], above: str = "") -> str:
    """Return nested tables as TOML; tables of numbers have a row on each line."""
    lines = [f"\n[{above}]"] if above and any(not isinstance(value, Mapping) for value in tables.values()) else []
    for key, value in tables.items():
        if isinstance(value, Mapping):
            continue
        if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
            rows = "".join(f"  {json.dumps(row)},\n" for row in value)
            lines.append(f"{key} = [\n{rows}]")
        else:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    text = "".join(f"{line}\n" for line in lines)
    inner = ((f"{above}.{key}".lstrip("."), value) for key, value in tables.items() if isinstance(value, Mapping))
    return text + "".join(toml_text(value, name) for name, value in inner)
