"""The cache of compiled forms: a folder that only the user can write to, with an index of the libraries in it.

A library is code, so it is loaded only if no other user can write to its folder, and if it has the SHA-256 that the
index of the folder holds for it. What is missing, damaged or unknown there is compiled anew. FFCx generates and
compiles the code, with options that are all given here: it and dolfinx would else read some from files of the current
folder. Neither searches the cache: FFCx would wait for what a killed process left, and load whatever it finds.
"""

from __future__ import annotations

import atexit
import fcntl
import gc
import importlib.metadata
import importlib.util
import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha1, sha256
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import ffcx.codegeneration.jit as ffcx_jit
import ffcx.options

#: Options of FFCx: its defaults, whatever a file says.
OPTIONS = {name: value for name, (_, value, *_) in ffcx.options.FFCX_DEFAULT_OPTIONS.items()}

#: File of a cache with the lines "name sum", of which the last one of a name counts.
INDEX = "index"

#: How files of a cache are opened: a link is not followed.
NO_LINK = os.O_NOFOLLOW | os.O_CLOEXEC

#: The plug-ins of all packages installed, which setuptools looks for some six times with every form.
plug_ins: Any = cache(importlib.metadata.entry_points)

_temporary: Path | None = None

#: Compiles into a folder: folder ↦ (objects, module, code), by FFCx.
Compile = Callable[[Path], Any]


class Library(NamedTuple):
    """A compiled library.

    Attributes:
        path: its file.
        name: of the module.
        entries: names of its forms or expressions, in their order.
    """

    path: Path
    name: str
    entries: tuple[str, ...]

    def load(self) -> tuple[list[Any], Any]:
        """Return (objects, module).

        Raises:
            ImportError: it cannot be loaded.
            AttributeError: it has no such entries.
        """
        spec = importlib.util.spec_from_file_location(self.name, self.path)
        if spec is None or spec.loader is None:
            raise ImportError(f"{self.path} is no module")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return [getattr(module.lib, entry) for entry in self.entries], module

    def is_sound(self) -> bool:
        """Return whether it has the sum that the index of its folder holds for it, and can be loaded."""
        try:
            _, known, text = _index(self.path.parent).rpartition(f"{self.name} ".encode())
            if not known or text[:64] != sha256(self.path.read_bytes()).hexdigest().encode():
                return False
            self.load()
        except (OSError, ImportError, AttributeError):  # a library that it was linked to may have gone
            return False
        return True


def library(compile_in: Compile) -> Library:
    """Return the library that FFCx compiles, out of the cache where it is there and sound.

    Raises:
        Exception: it cannot be compiled, by FFCx or setuptools.
    """
    name, entries = _signature(compile_in)
    why = unusable()
    found = Library((temporary(why) if why else home()) / f"{name}.so", name, entries)
    if found.is_sound():
        return found
    logging.getLogger("rotfem.compilation").info("compiling (first run only)")
    with _locked(found):
        if found.is_sound():  # another program has compiled it in between
            return found
        try:
            return _compiled(found, compile_in)
        except Exception:
            if _has_room(found.path.parent):
                raise
    return _compiled(found._replace(path=temporary("cannot be written") / found.path.name), compile_in)


def home() -> Path:
    """Return where libraries are kept if that is possible: `rotfem/forms` in the user's cache."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    top = Path(given) if os.path.isabs(given) else Path.home() / ".cache"
    return top / "rotfem" / "forms"


def unusable() -> str:
    """Return why the cache cannot be used; empty where it can. It is made where it is not there."""
    try:
        path = home()
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        return unsafe(path)
    except (OSError, RuntimeError):  # RuntimeError: the user's folder is unknown
        return "cannot be written"


def unsafe(path: Path) -> str:
    """Return why libraries in a folder are not to be trusted; empty where only the user can put something there.

    Owners of the folders above are not asked for: a folder that they put in its place would not be the user's.
    """
    real = path.resolve()
    status = real.stat()
    if status.st_uid != os.geteuid():
        return "belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "can be written by others"
    for parent in real.parents:
        above = parent.stat()
        of_others = above.st_mode & stat.S_IWOTH or (above.st_mode & stat.S_IWGRP and above.st_gid != os.getegid())
        if of_others and not above.st_mode & stat.S_ISVTX:
            return f"can be replaced by others, who can write to {parent}"
    return ""


def temporary(why: str) -> Path:
    """Return a cache that goes with this process, and say once why it is used."""
    global _temporary
    if _temporary is None:
        _temporary = Path(tempfile.mkdtemp(prefix="rotfem-forms-"))
        atexit.register(shutil.rmtree, _temporary, ignore_errors=True)
        logging.getLogger("rotfem").warning(
            "rotfem: the cache of compiled forms %s: what is not in it is compiled in every start", why
        )
    return _temporary


def noted(name: str, count: Callable[[], int]) -> int:
    """Return a number that depends on its name alone: counted once, then kept beside the compiled forms."""
    if unusable():
        return count()
    file = home() / "counts" / sha1(name.encode()).hexdigest()
    try:
        return int(file.read_text(encoding="ascii"))
    except (OSError, ValueError):
        number = count()
    try:
        file.parent.mkdir(exist_ok=True)
        _replace(file, str(number).encode())
    except OSError:  # it is counted again then
        pass
    return number


class _Signature(Exception):
    """Ends FFCx where it would search its cache, and says what for."""


def _signature(compile_in: Compile) -> tuple[str, tuple[str, ...]]:
    """Return (name of the module, names of its entries), as FFCx makes them of forms and options."""

    def named(module_name: str, object_names: Any, *_: Any) -> NoReturn:
        raise _Signature(module_name, tuple(object_names))

    with _steered(named):
        try:
            compile_in(Path())
        except _Signature as found:
            name, entries = found.args
            return name, entries
    raise AssertionError("FFCx did not search its cache")


@contextmanager
def _steered(search: Callable[..., Any]) -> Iterator[None]:
    """Let FFCx search by this function and take its options from `OPTIONS`, and setuptools look for plug-ins once.

    Garbage is collected afterwards: of the many nodes that FFCx makes, a collection finds nearly all in use.
    """
    collecting = gc.isenabled()
    gc.disable()
    handlers = logging.getLogger().handlers  # which FFCx takes away, and gives back only if all went well
    real = ffcx_jit.get_cached_module, ffcx.options.get_options, importlib.metadata.entry_points
    ffcx_jit.get_cached_module, importlib.metadata.entry_points = search, plug_ins
    ffcx.options.get_options = lambda given=None: OPTIONS | (given or {})
    try:
        yield
    finally:
        ffcx_jit.get_cached_module, ffcx.options.get_options, importlib.metadata.entry_points = real
        logging.getLogger().handlers = handlers
        if collecting:
            gc.enable()


def _compiled(wanted: Library, compile_in: Compile) -> Library:
    """Return a library after it was compiled and put into its place, with its sum into the index."""
    work = wanted.path.with_suffix(".work")
    shutil.rmtree(work, ignore_errors=True)  # left there by a process that was killed
    work.mkdir(mode=0o700)
    try:
        with _steered(lambda *_: (None, None)):
            compile_in(work)
        (made,) = work.glob(f"{wanted.name}.*so")
        content = made.read_bytes()
        _replace(wanted.path, content)
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | NO_LINK
        with os.fdopen(os.open(wanted.path.parent / INDEX, flags, 0o600), "wb") as index:
            index.write(f"{wanted.name} {sha256(content).hexdigest()}\n".encode())
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return wanted


def _index(place: Path) -> bytes:
    """Return the content of an index; one that is not the user's alone is removed."""
    path = place / INDEX
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | NO_LINK), "rb") as file:
            status = os.fstat(file.fileno())
            if status.st_uid == os.geteuid() and not status.st_mode & 0o077:
                return file.read()
    except FileNotFoundError:
        return b""
    except OSError:  # a link
        pass
    path.unlink()
    return b""


@contextmanager
def _locked(wanted: Library) -> Iterator[None]:
    """Let one program at a time compile a library; the lock ends with the process, however it ends."""
    descriptor = -1
    try:  # a byte of the file for each name
        descriptor = os.open(wanted.path.parent / "lock", os.O_RDWR | os.O_CREAT | NO_LINK, 0o600)
        fcntl.lockf(descriptor, fcntl.LOCK_EX, 1, int(sha1(wanted.name.encode()).hexdigest()[:7], 16))
    except OSError:  # a folder that cannot be written, or a file system without locks
        pass
    try:
        yield
    finally:
        if descriptor >= 0:
            os.close(descriptor)


def _replace(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    descriptor, new = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        os.replace(new, path)
    except BaseException:
        os.unlink(new)
        raise


def _has_room(place: Path) -> bool:
    """Return whether a cache can take another form, a megabyte at most."""
    try:
        with tempfile.TemporaryFile(dir=place) as file:
            file.write(bytes(1 << 20))
        return True
    except OSError:
        return False
