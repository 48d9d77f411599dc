"""Files of a user that register theories, effects, motion laws, …: `rotfem --load FILE`, and [extensions] of a scene.

Such a file is Python and is run as Python: a scene that loads one does whatever the file does. So the files of a scene
run only where its reader is told to trust it, or ROTFEM_TRUST is 1.
"""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from rotfem import registry
from rotfem.errors import SceneError, shown
from rotfem.scene.files import Unreadable, read_bytes
from rotfem.scene.table import LISTED, SceneModel

#: How to let a scene run code.
TRUSTING = "--trust lets it (ROTFEM_TRUST=1; in Python load_scene(…, trust=True))"

#: Resolved paths of the files that have been run.
_LOADED: set[Path] = set()


class Untrusted(SceneError):
    """A scene would run Python."""


class Extensions(SceneModel):
    """The [extensions] table.

    Attributes:
        load: paths of Python files, from the folder of the scene, that are run before the scene is read.
    """

    load: Annotated[tuple[str, ...], LISTED] = ()


def load_wanted(tables: dict[str, Any], file: str, directory: str, trust: bool) -> None:
    """Run the files that the [extensions] table of a scene names; what is no list is left to its validation.

    Without trust in the scene they must have been run before, by it or by `--load`.
    """
    table = tables.get("extensions")
    wanted = table.get("load") if isinstance(table, dict) else None
    names = [wanted] if isinstance(wanted, str) else wanted if isinstance(wanted, list | tuple) else []
    paths = {name: Path(directory) / name for name in names if isinstance(name, str) and name}
    unknown = [shown(path) for path in paths.values() if path.exists() and path.resolve() not in _LOADED]
    if unknown and not (trust or os.environ.get("ROTFEM_TRUST") == "1"):
        which = ", ".join(map(str, unknown))
        raise Untrusted(file, "extensions.load", None, f"is Python of the scene that would run: {which}; {TRUSTING}")
    for name, path in paths.items():
        load(name, path, file, "extensions.load")


def load(name: str, path: Path, file: str, key: str) -> None:
    """Run a Python file that registers something, once; where it fails, what it registered is taken back."""
    try:
        source = read_bytes(path)
        path = path.resolve()
    except (Unreadable, OSError) as error:
        raise SceneError(file, key, name, str(error)) from None
    if path in _LOADED:
        return
    before = [(kind, kind.names) for kind in registry.ALL]
    module = ModuleType(f"{path.stem} of {path.parent}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module  # where dataclasses look for what annotations mean
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[module.__name__]
        for kind, names in before:
            for new in set(kind.names) - set(names):
                kind.remove(new)
        raise SceneError(file, key, name, f"failed: {_described(error, path)}") from None
    _LOADED.add(path)


def loaded() -> tuple[Path, ...]:
    """Return the files that have been run."""
    return tuple(_LOADED)


def failure(error: Exception) -> str:
    """Return the message of an unexpected error that files may have to do with, with the line of a file; or ""."""
    for path in _LOADED:
        if any(frame.filename == str(path) for frame in traceback.extract_tb(error.__traceback__)):
            return f"{shown(path)}: {_described(error, path)}"
    files = ", ".join(str(shown(path)) for path in sorted(_LOADED))
    where = traceback.extract_tb(error.__traceback__)[-1]
    what = f"what {files} registers may not fit: {type(error).__name__}: {error} ({where.name})"
    return f"{what}; --debug shows the calls" if files else ""


def _described(error: BaseException, path: Path) -> str:
    """Return the type and the words of an error, and the line of the file that it comes from."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    said = error.msg if isinstance(error, SyntaxError) else str(error)
    where = "" if line is None else f"line {line}: "
    return f"{where}{type(error).__name__}: {said}" if said else f"{where}{type(error).__name__}"
