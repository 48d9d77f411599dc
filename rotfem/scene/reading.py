"""Files as a scene or a table may be: bounded in size, whatever they are, and never waited for without end."""

from __future__ import annotations

import os
import select
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

#: What a pipe may keep one waiting (s) before it has anything to say.
PATIENCE = 10.0

_PIECE = 1 << 20

#: Files that a scene which is being read consists of; None where nobody asks.
_read: ContextVar[list[Path] | None] = ContextVar("read", default=None)


@contextmanager
def noted_files() -> Iterator[list[Path]]:
    """Give a list that the paths of all files are in which are read in the meantime."""
    files: list[Path] = []
    before = _read.get()
    token = _read.set(files)
    try:
        yield files
    finally:
        _read.reset(token)
        if before is not None:
            before += files


def note(path: Path) -> None:
    """Take note of a file that is read."""
    files = _read.get()
    if files is not None:
        files.append(path.absolute())


class Unreadable(Exception):
    """A file cannot be read.

    Attributes:
        reason: why.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def read_bytes(path: Path, most: int) -> bytes:
    """Return the content of a file or a pipe.

    Args:
        path: the file.
        most: bytes it may have.

    Raises:
        Unreadable: there is none, it is a directory, it has more bytes, or nothing comes out of a pipe.
    """
    note(path)
    try:
        # A pipe that nobody writes to would stop here.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        raise Unreadable("no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise Unreadable(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise Unreadable("is a directory; a scene is a TOML file")
        return _all(descriptor, most, waits=not stat.S_ISREG(mode))
    except OSError as error:
        raise Unreadable(f"cannot be read: {error.strerror or error}") from None
    finally:
        os.close(descriptor)


def _all(descriptor: int, most: int, waits: bool) -> bytes:
    pieces: list[bytes] = []
    size = 0
    while True:
        if waits and not select.select([descriptor], [], [], PATIENCE)[0]:
            raise Unreadable(f"nothing can be read from it: no byte came in {PATIENCE:g} s")
        try:
            piece = os.read(descriptor, _PIECE)
        except BlockingIOError:
            continue
        if not piece:
            return b"".join(pieces)
        pieces.append(piece)
        size += len(piece)
        if size > most:
            raise Unreadable(f"is larger than {most} bytes")
