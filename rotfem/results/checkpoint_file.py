"""The file of a checkpoint: arrays by name in an npz file, and all else as JSON. Nothing in it is executed.

A dataclass is stored by the names of its fields, with its own name.
"""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from rotfem.errors import ComputationError, SceneError
from rotfem.results.files import write_whole

#: Number of the format; another one is refused.
FORMAT = 3


def write_checkpoint(path: Path, tree: dict[str, Any]) -> None:
    """Write a tree of dicts, lists, tuples, dataclasses, arrays, numbers and texts, whole or not at all."""
    arrays: dict[str, Any] = {}
    head = json.dumps({"format": FORMAT, "tree": _plain(tree, "", arrays)}).encode()
    image = io.BytesIO()
    np.savez(image, head=np.frombuffer(head, dtype=np.uint8), **arrays)
    with image.getbuffer() as content:
        write_whole(path, content)


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return the tree of a checkpoint file."""
    if not path.exists():
        why = "there is no checkpoint; start the run with --checkpoint, and without --resume"
        raise SceneError("command line", "--resume", path, why)
    with checkpoint_of(path), np.load(path, allow_pickle=False) as file:
        head = json.loads(file["head"].tobytes())
        if (found := head["format"]) != FORMAT:
            why = f"has format {found}, this rotfem reads {FORMAT}; start the run anew, without --resume"
            raise SceneError("command line", "--resume", path, why)
        tree: dict[str, Any] = _full(head["tree"], {name: file[name] for name in file.files})
    return tree


@contextmanager
def checkpoint_of(path: Path) -> Iterator[None]:
    """Say in one error that a file is not a checkpoint of this program."""
    try:
        yield
    except SceneError:
        raise
    except Exception as error:  # of any kind, as anything may lie anywhere
        why = f"is damaged, or no checkpoint of this rotfem ({type(error).__name__}); start the run without --resume"
        raise SceneError("command line", "--resume", path, why) from None


def _plain(value: Any, name: str, arrays: dict[str, Any]) -> Any:
    """Return a tree that JSON knows; arrays are put into a dict by their path in the tree, and referred to by it."""

    def inner(entries: Any) -> dict[str, Any]:
        return {str(key): _plain(entry, f"{name}.{key}".strip("."), arrays) for key, entry in entries}

    if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
        arrays[name] = value
        return {"array": name}
    if isinstance(value, dict):
        return {"dict": inner(value.items())}
    if isinstance(value, list | tuple):
        return {type(value).__name__: list(inner(enumerate(value)).values())}
    if is_dataclass(value):
        of_fields = inner((field.name, getattr(value, field.name)) for field in fields(value) if field.init)
        return {f"{type(value).__module__}:{type(value).__qualname__}": of_fields}
    if isinstance(value, np.generic):
        return value.item()
    if value is not None and not isinstance(value, bool | int | float | str):
        raise ComputationError(f"a checkpoint cannot hold {name}, a {type(value).__qualname__}")
    return value


def _full(value: Any, arrays: dict[str, Any]) -> Any:
    """Return the tree that `_plain` has made one of JSON."""
    if not isinstance(value, dict):
        return value
    ((kind, entry),) = value.items()
    if kind == "array":
        return arrays[entry]
    if kind in ("list", "tuple"):
        return {"list": list, "tuple": tuple}[kind](_full(part, arrays) for part in entry)
    inner = {key: _full(part, arrays) for key, part in entry.items()}
    return inner if kind == "dict" else _dataclass(kind)(**inner)


def _dataclass(name: str) -> Any:
    """Return a dataclass of the program, or of a file that it has loaded, by "module:name"; nothing else is called."""
    module, _, attribute = name.partition(":")
    found = getattr(import_module(module) if module.startswith("rotfem.") else sys.modules.get(module), attribute, None)
    if not (isinstance(found, type) and is_dataclass(found)):
        raise SceneError("command line", "--resume", name, "is no dataclass of rotfem or of what --load has read")
    return found
