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

import basix
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import jit as dolfinx_jit
from ufl.algorithms import expand_derivatives
from ufl.algorithms.map_integrands import map_integrand_dags
from ufl.constantvalue import Zero
from ufl.corealg.multifunction import MultiFunction

#: What FFCx says when it has waited in vain, with the file that is in the way; what dolfinx says on the other ranks.
IN_VAIN, ELSEWHERE = re.compile(r"remove (.*\.c)\)"), "Compilation failed on root node"

#: Seconds to wait for a form that is taken, though the lock on it is ours.
PATIENCE = 1


#: Flags of the C compiler for what is assembled often, and for what is assembled a few times on a few cells.
OFTEN, SELDOM = ["-O2", "-g0", "-w"], ["-O0", "-g0", "-w"]


def form(f: Any, once: bool = False) -> Any:
    """Return a UFL form compiled, over the communicator of its mesh.

    Args:
        f: the form.
        once: whether it is assembled a few times only; on lines that is compiled in haste.

    Raises:
        RuntimeError: the compiler failed.
    """
    domain = f.ufl_domains()[0].ufl_cargo()
    flags = SELDOM if once and domain.topology.dim == 1 else OFTEN
    more = {"cffi_extra_compile_args": flags}
    return _compiled(lambda options: fem.form(f, jit_options=options | more), domain.comm, f.signature())


def expression(e: Any, points: npt.NDArray[Any], comm: Any) -> fem.Expression:
    """Return a UFL expression compiled for evaluation at points of the reference cell, shape (number, dim).

    Raises:
        RuntimeError: the compiler failed.
    """
    return _compiled(lambda options: fem.Expression(e, points, jit_options=options), comm, "expression")


def without(f: Any, *functions: Any) -> Any:
    """Return a UFL form or expression with these functions set to zero: what vanishes with them is not compiled."""
    expanded = expand_derivatives(f)
    if isinstance(expanded, ufl.Form) and expanded.empty():
        return expanded
    zero = {u: ufl.as_vector([0] * u.ufl_shape[0]) for u in functions}
    return map_integrand_dags(_NoEmptyBranches(), ufl.replace(expanded, zero))


class _NoEmptyBranches(MultiFunction):  # type: ignore[misc]
    """Makes a conditional zero whose branches are both zero: UFL leaves it, and does not know what to add it to."""

    expr = MultiFunction.reuse_if_untouched

    def conditional(self, o: Any, condition: Any, true: Any, false: Any) -> Any:
        if isinstance(true, Zero) and isinstance(false, Zero):
            return Zero(o.ufl_shape, o.ufl_free_indices, o.ufl_index_dimensions)
        return self.reuse_if_untouched(o, condition, true, false)


def quadrature_points(domain: Any, number: int) -> Any:
    """Return the points of the Gauss rule that has `number` of them in each direction, reference cell coordinates."""
    return basix.make_quadrature(domain.basix_cell(), 2 * number - 1)[0]


def integral_count(f: Any) -> int:
    """Return the number of integrals of a UFL form after differentiation."""
    expanded = expand_derivatives(f)
    return 0 if expanded.empty() else len(expanded.integrals())


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
