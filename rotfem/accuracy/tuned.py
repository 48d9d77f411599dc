"""A scene with other keys, written as a file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from rotfem.errors import SceneError
from rotfem.results.files import write_text
from rotfem.scene import Scene


def write_variant(scene: Scene, changes: Mapping[str, Any], path: Path, remark: str) -> Path:
    """Write what was set in a scene, with other values of some keys, after a remark of comment lines; return the path.

    Paths of files that the scene reads are written relative to the folder of the new one.

    Raises:
        SceneError: the combination is not valid, or the scene holds a Python function, which no file can.
        OutputError: the file cannot be written.
    """
    there, start, goal = scene.replace(changes), Path(scene.directory), path.parent.resolve()
    files = set(map(os.path.realpath, there.inputs))

    def moved(value: Any) -> Any:
        """Return tables with the paths of files made relative to the folder of the new one."""
        if isinstance(value, Mapping):
            return {key: moved(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [moved(entry) for entry in value]
        is_file = isinstance(value, str | Path) and "\0" not in str(value) and os.path.realpath(start / value) in files
        return os.path.relpath(start.resolve() / value, goal) if is_file and not Path(value).is_absolute() else value

    try:
        text = tomli_w.dumps(moved(there.tables))
    except TypeError:
        raise SceneError(scene.file, allowed="holds a Python function, so that it cannot be written as TOML") from None
    return write_text(path, remark + text)
