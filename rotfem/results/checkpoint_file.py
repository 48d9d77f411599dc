"""The file of a checkpoint: HDF5 with a head that says what it is and what its content must sum up to.

The head, the user block of the HDF5 file, is text: format, length and SHA-256 of what follows. A file with a right sum
is trusted to be what this program wrote. The content is a tree of plain values as JSON, with arrays as datasets of
their own. Nothing in it is code.
"""

from __future__ import annotations

import hashlib
import io
import json
import sys
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rotfem.errors import ComputationError, SceneError
from rotfem.results.files import CHECKPOINT_MAGIC as MAGIC
from rotfem.results.files import write_whole

#: Number of the format; another one is refused.
FORMAT = 2

#: Length of the head of the file.
HEAD = 512

#: What a scheme may remember of the steps before.
STORED = "a memory of the scheme that is of numbers, texts, arrays, tuples, lists, dicts and dataclasses"


def write_checkpoint(path: Path, tree: dict[str, Any]) -> None:
    """Write a tree, whole or not at all, and wait until it is on the disk.

    It is of dicts, lists, tuples, dataclasses of the program, arrays, numbers and text.

    Raises:
        OutputError: it cannot be written; the one before is still there.
        ComputationError: something in it is of another type, and would be lost.
    """
    content = content_of(tree)
    head = f"{MAGIC} {FORMAT}\n{len(content)}\n{hashlib.sha256(content).hexdigest()}\n".encode().ljust(HEAD, b"\0")
    write_whole(path, head, content, durable=True)


def content_of(tree: dict[str, Any]) -> bytes:
    """Return the content of a checkpoint file."""
    image = io.BytesIO()
    with h5py.File(image, "w", userblock_size=HEAD) as file:
        arrays: list[np.ndarray[Any, Any]] = []
        text = json.dumps(_plain(tree, arrays))
        file.create_dataset("tree", data=np.frombuffer(text.encode(), dtype=np.uint8))
        for i, array in enumerate(arrays):
            file.create_dataset(f"arrays/{i}", data=array)
    return image.getvalue()[HEAD:]


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Return the tree of a checkpoint file.

    Raises:
        SceneError: there is none, or it is damaged, of another format, or no checkpoint.
    """

    def refused(why: str) -> SceneError:
        return SceneError("command line", "--resume", path, why)

    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise refused("there is no checkpoint; start the run with --checkpoint, and without --resume") from None
    except OSError as error:
        raise refused(f"cannot be read: {error.strerror or error}") from None
    words = data[:HEAD].rstrip(b"\0").decode(errors="replace").split()
    if len(words) != 4 or words[0] != MAGIC:
        raise refused("is no checkpoint of rotfem, or its head is damaged; start the run anew, without --resume")
    if words[1] != str(FORMAT):
        raise refused(f"has format {words[1]}, this rotfem reads {FORMAT}; start the run anew, without --resume")
    content = data[HEAD:]
    if words[2:] != [str(len(content)), hashlib.sha256(content).hexdigest()]:
        raise refused("is damaged: it does not sum up to what its head says; start the run anew, without --resume")
    with h5py.File(io.BytesIO(data), "r") as file:
        text = file["tree"][()].tobytes().decode()
        arrays = [file[f"arrays/{i}"][()] for i in range(len(file.get("arrays", ())))]
    tree: dict[str, Any] = _full(json.loads(text), arrays)
    return tree


def _plain(value: Any, arrays: list[Any]) -> Any:
    """Return a tree that JSON knows; arrays are put into the list and referred to by their place in it.

    Raises:
        ComputationError: something in it is of another type, and would be lost.
    """
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, dict):
        return {"dict": {key: _plain(entry, arrays) for key, entry in value.items()}}
    if isinstance(value, tuple):
        return {"tuple": [_plain(entry, arrays) for entry in value]}
    if isinstance(value, list):
        return [_plain(entry, arrays) for entry in value]
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value):
        values = {field.name: _plain(getattr(value, field.name), arrays) for field in fields(value)}
        return {f"{type(value).__module__}:{type(value).__qualname__}": values}
    if value is not None and not isinstance(value, bool | int | float | str):
        raise ComputationError(f"a checkpoint cannot hold a {type(value).__qualname__}", advice=STORED)
    return value


def _full(value: Any, arrays: list[Any]) -> Any:
    """Return the tree that `_plain` has made one of JSON."""
    if isinstance(value, list):
        return [_full(entry, arrays) for entry in value]
    if not isinstance(value, dict):
        return value
    ((kind, entry),) = value.items()
    if kind == "array":
        return arrays[entry]
    if kind == "tuple":
        return tuple(_full(part, arrays) for part in entry)
    inner = {key: _full(part, arrays) for key, part in entry.items()}
    return inner if kind == "dict" else _record(kind)(**inner)


def _record(name: str) -> Any:
    """Return a dataclass of the program, or of what it has loaded, by "module:name"; nothing else is made of a file."""
    module, _, attribute = name.partition(":")
    found = getattr(import_module(module) if module.startswith("rotfem.") else sys.modules.get(module), attribute, None)
    if not (isinstance(found, type) and is_dataclass(found)):
        raise SceneError("command line", "--resume", name, "is no dataclass of rotfem or of what --load has read")
    return found
