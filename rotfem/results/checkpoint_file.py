"""The file of a checkpoint: HDF5 with a head that says what it is and what its content must sum up to.

The head, the user block of the HDF5 file, is text: format, length and SHA-256 of what follows. The content is a tree of
plain values as JSON, with arrays as datasets of their own. Nothing in it is code.
"""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rotfem.errors import SceneError
from rotfem.results.files import CHECKPOINT_MAGIC as MAGIC
from rotfem.results.files import write_whole

#: Number of the format; another one is refused.
FORMAT = 1

#: Length of the head of the file.
HEAD = 512


def write_checkpoint(path: Path, tree: dict[str, Any]) -> None:
    """Write a tree (dicts, lists, numbers, text, arrays), whole or not at all, and wait until it is on the disk.

    Raises:
        OutputError: it cannot be written; the one before is still there.
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
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            text = _array(file["tree"], len(data)).tobytes().decode()
            arrays = [_array(file[f"arrays/{i}"], len(data)) for i in range(len(file.get("arrays", ())))]
        tree = _full(json.loads(text), arrays)
    except (OSError, KeyError, ValueError, TypeError, IndexError, AttributeError, RecursionError) as error:
        raise refused(f"is damaged ({type(error).__name__}); start the run anew, without --resume") from None
    if not isinstance(tree, dict):
        raise refused("is damaged (no tree); start the run anew, without --resume")
    return tree


def _array(data: Any, size: int) -> np.ndarray[Any, Any]:
    """Return an HDF5 dataset of numbers that lies in the file as it is, so that it takes no more memory than that.

    Args:
        data: the dataset.
        size: of the file, bytes.

    Raises:
        ValueError: it is none: packed, of text, elsewhere, or of a shape that is not all in the file.
    """
    placed = data.size == 0 or data.id.get_offset() is not None  # what is packed, missing or elsewhere has no place
    if data.dtype.kind not in "biufc" or not placed or data.nbytes > size:
        raise ValueError("a dataset is not in the file")
    out: np.ndarray[Any, Any] = data[()]
    return np.asarray(out)


def _plain(value: Any, arrays: list[Any]) -> Any:
    """Return a tree that JSON knows; arrays are put into the list and referred to by their place in it."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, dict):
        return {"dict": {key: _plain(entry, arrays) for key, entry in value.items()}}
    if isinstance(value, tuple):
        return {"tuple": [_plain(entry, arrays) for entry in value]}
    if isinstance(value, list):
        return [_plain(entry, arrays) for entry in value]
    return value.item() if isinstance(value, np.generic) else value


def _full(value: Any, arrays: list[Any]) -> Any:
    if isinstance(value, list):
        return [_full(entry, arrays) for entry in value]
    if not isinstance(value, dict):
        return value
    ((kind, entry),) = value.items()
    if kind == "array":
        return arrays[entry]
    if kind == "tuple":
        return tuple(_full(part, arrays) for part in entry)
    return {key: _full(part, arrays) for key, part in entry.items()}
