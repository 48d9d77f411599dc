"""Where compiled forms are kept, and the options they are compiled with.

A library is code that is loaded, so only the user can write to its folder. dolfinx and FFCx read
options from files of the working folder too. Those that are passed win over them, so all are passed here.
"""

from __future__ import annotations

import atexit
import fcntl
import inspect
import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import dolfinx.jit
import ffcx.codegeneration.jit as ffcx_jit
import ffcx.options

from rotfem.errors import InputError

#: Longest wait for a form that another program compiles, s.
LONGEST_WAIT = 300

#: Options of FFCx: its defaults; with this verbosity its log says when something is compiled.
FORM_OPTIONS = {name: value for name, (_, value, *_) in ffcx.options.FFCX_DEFAULT_OPTIONS.items()} | {"verbosity": 20}


def jit_options(folder: Path, flags: list[str]) -> dict[str, Any]:
    """Return all options of the compilation into a folder with these flags of the C compiler."""
    given = {"cache_dir": folder, "timeout": LONGEST_WAIT, "cffi_extra_compile_args": flags}
    parameters = inspect.signature(ffcx_jit.compile_forms).parameters.values()
    out = {p.name: p.default for p in parameters if p.name not in ("forms", "options")} | given
    try:
        ffcx.options.get_options()
        further = dolfinx.jit.get_options().keys() - out.keys()
    except (OSError, ValueError, TypeError) as error:
        raise InputError("dolfinx_jit_options.json or ffcx_options.json", None, f"cannot be used: {error}") from None
    if further:
        raise InputError("dolfinx_jit_options.json", sorted(further), f"unknown option; allowed: {', '.join(out)}")
    return out


@cache
def folder() -> Path:
    """Return `rotfem/forms` in the user's cache; a folder of this process alone where that one is not safe."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    path = (Path(given) if os.path.isabs(given) else Path.home() / ".cache") / "rotfem" / "forms"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        why = unsafe(path) or ("" if os.access(path, os.W_OK) else "cannot be written")
    except OSError:
        why = "cannot be written"
    if why:
        message = "rotfem: the cache of compiled forms %s %s, so all forms are compiled anew in every start"
        logging.getLogger("rotfem").warning(message, path, why)
        path = Path(tempfile.mkdtemp(prefix="rotfem-forms-"))
        atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


@cache
def part(name: str) -> Path:
    """Return a folder in the cache: FFCx lists the whole folder of a form that it loads, so that it must be short."""
    path = folder() / name
    path.mkdir(mode=0o700, exist_ok=True)
    clear(path)
    return path


def unsafe(path: Path) -> str:
    """Return why code in a folder is not to be trusted; empty where only the user can put something there."""
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


@contextmanager
def in_use(path: Path) -> Iterator[None]:
    """Show other programs that forms are compiled or loaded; what an interrupted compilation leaves is removed."""
    with open(path / "lock", "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        try:
            yield
        except KeyboardInterrupt:
            lock.close()
            clear(path)
            raise


def clear(path: Path) -> None:
    """Remove what killed compilations left in a folder, for which FFCx would wait, unless it is in use."""
    with open(path / "lock", "a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return
        for source in path.glob("*.c"):
            if not source.with_suffix(".c.cached").exists():
                source.unlink()
