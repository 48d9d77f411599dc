"""Forms compiled so that a kill in the middle, or two programs at once, do no harm.

FFCx marks a form in its cache as taken before it compiles it, and waits ten seconds for a form that is taken. What was
killed in between is taken for ever; what takes longer than that, as the forms of spatial beams do, fails in a second
program that wants it at the same time. Here who compiles holds a lock on the form, which ends with the process: what is
taken but not locked was left behind, and is made anew.
"""

from __future__ import annotations

import fcntl
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha1
from pathlib import Path
from typing import Any

import numpy.typing as npt
from dolfinx import fem
from dolfinx import jit as dolfinx_jit

#: What FFCx says when it has waited in vain, with the file that is in the way; what dolfinx says on the other ranks.
IN_VAIN, ELSEWHERE = re.compile(r"remove (.*\.c)\)"), "Compilation failed on root node"

#: Seconds to wait for a form that is taken, though the lock on it is ours.
PATIENCE = 1


def form(f: Any) -> Any:
    """Return a UFL form compiled, over the communicator of its mesh.

    Raises:
        RuntimeError: the compiler failed.
    """
    comm = f.ufl_domains()[0].ufl_cargo().comm
    return _compiled(lambda options: fem.form(f, jit_options=options), comm, f.signature())


def expression(e: Any, points: npt.NDArray[Any], comm: Any) -> fem.Expression:
    """Return a UFL expression compiled for evaluation at points of the reference cell, shape (number, dim).

    Raises:
        RuntimeError: the compiler failed.
    """
    return _compiled(lambda options: fem.Expression(e, points, jit_options=options), comm, "expression")


def _compiled(compile_it: Callable[[dict[str, int]], Any], comm: Any, name: str) -> Any:
    with _locked(comm, name) as options:
        try:
            return compile_it(options)
        except (TimeoutError, RuntimeError) as error:
            left_behind = IN_VAIN.search(str(error))
            # dolfinx lets all ranks fail together, so that all come here.
            if left_behind is None and ELSEWHERE not in str(error):
                raise
            if not comm.bcast(left_behind is not None, root=0):
                raise
            if comm.rank == 0 and left_behind is not None:
                Path(left_behind[1]).unlink(missing_ok=True)
            comm.Barrier()
            return compile_it(options)


@contextmanager
def _locked(comm: Any, name: str) -> Iterator[dict[str, int]]:
    """Let one program at a time compile what has this name, on its rank 0, for which dolfinx lets the others wait."""
    if comm.rank != 0:
        yield {}
        return
    try:
        cache = Path(dolfinx_jit.get_options()["cache_dir"])
        cache.mkdir(parents=True, exist_ok=True)
        file = (cache / "rotfem.lock").open("w")
    except OSError:  # dolfinx will say it better
        yield {}
        return
    with file:
        try:  # a byte of the file for each name; closing it ends the lock, and so does the end of the process
            fcntl.lockf(file, fcntl.LOCK_EX, 1, int(sha1(name.encode()).hexdigest()[:7], 16))
            options = {"timeout": PATIENCE}
        except OSError:  # a file system without locks
            options = {}
        yield options
