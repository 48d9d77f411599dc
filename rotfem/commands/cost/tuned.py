"""A scene with another setting, written as TOML. No dolfinx in it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from rotfem.commands.cost.settings import Setting, own_setting, sample_interval
from rotfem.errors import SceneError
from rotfem.results.files import write_text
from rotfem.scene import Scene
from rotfem.scene.beam_files import is_path

#: Keys whose value, where it is a string, is the path of a file, whatever it ends with.
FILE_KEYS = {
    "table",
    "base_acceleration",
    "tip_force",
    "tip_moment",
    "distributed",
    "distributed_moment",
    "mesh",
    "from",
    "file",
}


def tuned(scene: Scene, setting: Setting) -> Scene:
    """Return the scene with a setting, its rows of history.csv as nearly as possible where they were.

    Raises:
        SceneError: the combination is not valid.
    """
    changes = setting.changes(scene)
    if setting.step is not None and scene.time is not None:
        own = own_setting(scene)
        if own.step is not None:
            changes["time.output_every"] = max(1, round(sample_interval(scene, own.step) / setting.step))
    elif setting.tolerance is not None:
        changes["time.output_every"] = scene.time.output_every if scene.time is not None else None
    return scene.replace(changes)


def write_tuned(scene: Scene, setting: Setting, path: Path, remark: str) -> Path:
    """Write the scene with a setting: what was set in it, the changes, nothing else; return the path.

    Paths in the scene are written relative to the new file's folder.

    Raises:
        SceneError: the scene holds a Python function, which no file can.
        OutputError: the file cannot be written.
    """
    tables = tuned(scene, setting).tables
    start, goal = Path(scene.directory).resolve(), path.parent.resolve()
    try:
        text = tomli_w.dumps(_moved(tables, start, goal))
    except TypeError:
        raise SceneError(scene.file, allowed="holds a Python function, so that it cannot be written as TOML") from None
    return write_text(path, "".join(f"# {line}\n" for line in remark.splitlines()) + "\n" + text)


def _moved(tables: Mapping[str, Any], start: Path, goal: Path) -> dict[str, Any]:
    """Return tables with the relative paths of start made relative to goal."""
    out: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, Mapping):
            out[key] = _moved(value, start, goal)
        elif isinstance(value, str | Path) and (key in FILE_KEYS or is_path(value)) and not Path(value).is_absolute():
            out[key] = os.path.relpath(start / value, goal) if start != goal else str(value)
        else:
            out[key] = value
    return out
