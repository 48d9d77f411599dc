"""One writer a folder: a lock that ends with the process that holds it, however it ends."""

from __future__ import annotations

import errno
import fcntl
import os
import socket
from pathlib import Path

from rotfem.errors import OutputError

#: Name of the file that is locked, while it is; it says who holds the lock.
NAME = ".rotfem.lock"

#: Folders that this process has locked ↦ descriptor, and how often.
_held: dict[str, tuple[int, int]] = {}


class FolderLock:
    """Lock on a result folder. A process may hold it several times over; another one is refused.

    What a killed process leaves of it is a file that nobody holds, and no obstacle.

    Args:
        folder: the folder; it must be there.
    """

    def __init__(self, folder: Path):
        self.folder, self._key, self._mine = folder, os.path.realpath(folder), False

    def acquire(self) -> None:
        """Take the lock.

        Raises:
            OutputError: another process has it, or nothing can be written in the folder.
        """
        if self._mine:
            return
        descriptor, times = _held.get(self._key, (-1, 0))
        if times == 0:
            try:
                descriptor = self._locked()
            except OSError as error:
                if error.errno == errno.ELOOP:
                    raise OutputError(self.folder / NAME, "it is a symbolic link, which is not followed") from None
                raise OutputError(self.folder, error.strerror or str(error)) from None
        _held[self._key] = (descriptor, times + 1)
        self._mine = True

    def release(self) -> None:
        """Give the lock back, and remove its file with the last hold on it."""
        if not self._mine:
            return
        self._mine = False
        descriptor, times = _held.pop(self._key)
        if times > 1:
            _held[self._key] = (descriptor, times - 1)
            return
        Path(self._key, NAME).unlink(missing_ok=True)
        os.close(descriptor)

    def _locked(self) -> int:
        """Return the descriptor of the file, locked."""
        path = Path(self._key, NAME)
        while True:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                owner = _named_in(descriptor)
                os.close(descriptor)
                raise OutputError(self.folder, f"{owner} is writing its results there") from None
            except OSError:  # a file system without locks: whoever shares it must take care
                return descriptor
            try:
                ours = os.path.samestat(os.stat(path), os.fstat(descriptor))
            except FileNotFoundError:
                ours = False
            if ours:
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
                return descriptor
            os.close(descriptor)  # whoever held it has removed the file in between


def holder(folder: Path) -> str:
    """Return which process holds the lock on a folder, in words; empty where none does. Nothing is changed."""
    try:
        descriptor = os.open(folder / NAME, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return ""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return ""
    except OSError:  # it is held, or the file system has no locks and whoever wrote the file may be there
        return _named_in(descriptor)
    finally:
        os.close(descriptor)


def _named_in(descriptor: int) -> str:
    return os.pread(descriptor, 200, 0).decode(errors="replace").strip() or "another process"
