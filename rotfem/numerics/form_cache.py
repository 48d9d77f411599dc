"""The cache of compiled forms: what is damaged in it is made anew, what it cannot take is kept in a temporary one.

FFCx marks a form in its cache as taken before it compiles it, and waits ten seconds for a form that is taken. What was
killed in between is taken for ever; what takes longer than that, as the forms of spatial beams do, fails in a second
program that wants it at the same time. Here who compiles holds a lock on the form, which ends with the process: what is
taken but not locked was left behind. Nor does FFCx look at what it loads: a library that was cut short ends the process
without a word. So the sum of each is noted beside it.
"""

from __future__ import annotations

import atexit
import fcntl
import importlib.metadata
import importlib.util
import logging
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha1, sha256
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

import ffcx.codegeneration.jit as ffcx_jit
from dolfinx import jit as dolfinx_jit

#: What FFCx says when it has waited in vain, with the file that is in the way.
IN_VAIN = re.compile(r"remove (.*\.c)\)")

#: The line in FFCx's note on a form with the sum of its library.
SUM = re.compile(r"^rotfem sha256 ([0-9a-f]{64})$", re.MULTILINE)

#: Seconds to wait for a form that is taken, though the lock on it is ours.
PATIENCE = 1

#: Bytes that a cache must have room for to be of use.
ROOM = 1 << 20

#: The plug-ins of all packages installed, which setuptools looks for some six times with every form.
plug_ins: Any = cache(importlib.metadata.entry_points)

_temporary: Path | None = None


def folder() -> Path:
    """Return where dolfinx keeps compiled forms."""
    return Path(dolfinx_jit.get_options()["cache_dir"])


@contextmanager
def locked(name: str) -> Iterator[dict[str, Any]]:
    """Let one program at a time compile what has this name; give the options of the compiler that follow from it."""
    try:
        cache = folder()
        cache.mkdir(parents=True, exist_ok=True)
        file = (cache / "rotfem.lock").open("w")
    except OSError:  # nothing can be written there: compiling it will fail, and go elsewhere
        yield {}
        return
    with file:
        try:  # a byte of the file for each name; closing it ends the lock, and so does the end of the process
            fcntl.lockf(file, fcntl.LOCK_EX, 1, int(sha1(name.encode()).hexdigest()[:7], 16))
            options = {"timeout": PATIENCE}
        except OSError:  # a file system without locks
            options = {}
        yield options


class Watch:
    """Stands in the place of FFCx's search in its cache, checks what is found, and notes the sum of what is new.

    While it does so, plug-ins for setuptools are looked for once a process, which takes a fifth of a small form's time.

    Attributes:
        module: name of the form searched for last.
        cache: the folder it was searched in.
        new: whether it was not there.
    """

    def __init__(self) -> None:
        self._real, self._plug_ins = ffcx_jit.get_cached_module, importlib.metadata.entry_points
        self.module, self.cache, self.new = "", Path(), True

    def __enter__(self) -> Watch:
        ffcx_jit.get_cached_module, importlib.metadata.entry_points = self, plug_ins
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        ffcx_jit.get_cached_module, importlib.metadata.entry_points = self._real, self._plug_ins
        if error is None and self.new and self.module:
            self._seal()

    def __call__(self, module_name: str, object_names: Any, cache_dir: Any, timeout: int) -> Any:
        """Return what FFCx would find, after what is damaged was removed."""
        self.module, self.cache, self.new = module_name, Path(cache_dir), True
        sound = self._is_sound()
        if not sound:
            self.discard()
        elif self._note.exists() and len(libraries := self._libraries()) == 1:
            self.new = False
            return _loaded(module_name, libraries[0], object_names)
        found = self._real(module_name, object_names, cache_dir, timeout)
        self.new = found[0] is None
        return found

    @property
    def _note(self) -> Path:
        return self.cache / f"{self.module}.c.cached"

    def _libraries(self) -> list[Path]:
        # By their names: a cache holds thousands of files, and listing them takes longer than all checks.
        return [path for end in EXTENSION_SUFFIXES if (path := self.cache / f"{self.module}{end}").exists()]

    def _seal(self) -> None:
        try:
            (library,) = self._libraries()
            with self._note.open("a", encoding="utf-8") as note:
                note.write(f"\nrotfem sha256 {sha256(library.read_bytes()).hexdigest()}\n")
        except (OSError, ValueError):  # one that is not sealed is trusted, as FFCx does
            return

    def _is_sound(self) -> bool:
        try:
            text = self._note.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return True  # it is not there, or not ready
        libraries, known = self._libraries(), SUM.search(text)
        if len(libraries) != 1:
            return False
        return known is None or sha256(libraries[0].read_bytes()).hexdigest() == known[1]

    def discard(self) -> bool:
        """Remove the form from the cache; return whether that could be done."""
        try:
            for path in self.cache.glob(f"{self.module}.*"):
                path.unlink(missing_ok=True)
        except OSError:
            return False
        return True

    def mend(self, error: Exception) -> bool:
        """Remove what made a form of the cache fail; return whether to try again is worth it."""
        left_behind = IN_VAIN.search(str(error))
        if left_behind is not None:
            Path(left_behind[1]).unlink(missing_ok=True)
            return True
        is_there = self._note.exists() and isinstance(error, ImportError | AttributeError | OSError | RuntimeError)
        return is_there and self.discard()


def _loaded(name: str, library: Path, object_names: Any) -> tuple[list[Any], Any]:
    """Return (objects, module) of a compiled form, as FFCx does, which lists the whole cache to find it."""
    spec = importlib.util.spec_from_file_location(name, library)
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"{library} is no module")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return [getattr(module.lib, entry) for entry in object_names], module


def noted(name: str, count: Callable[[], int]) -> int:
    """Return a number that depends on its name alone: counted once, then kept beside the compiled forms."""
    file = folder() / "rotfem-counts" / sha1(name.encode()).hexdigest()
    try:
        return int(file.read_text(encoding="ascii"))
    except (OSError, ValueError):
        number = count()
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False) as new:
            new.write(str(number))
        Path(new.name).replace(file)
    except OSError:  # it is counted again then
        pass
    return number


def has_room() -> bool:
    """Return whether the cache can take another form."""
    try:
        with tempfile.TemporaryFile(dir=folder()) as file:
            file.write(bytes(ROOM))
        return True
    except OSError:
        return False


def temporary() -> Path:
    """Return a cache that goes with this process, and say once that it is used."""
    global _temporary
    if _temporary is None:
        _temporary = Path(tempfile.mkdtemp(prefix="rotfem-forms-"))
        atexit.register(shutil.rmtree, _temporary, ignore_errors=True)
        logging.getLogger("rotfem").warning(
            "rotfem: the cache of compiled forms %s cannot be written: what is not in it is compiled in every start",
            folder(),
        )
    return _temporary
