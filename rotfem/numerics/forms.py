"""Forms, compiled and assembled."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import basix
import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import cpp, fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc
from ufl.algorithms import expand_derivatives, extract_coefficients
from ufl.algorithms.analysis import extract_constants
from ufl.algorithms.map_integrands import map_integrand_dags
from ufl.constantvalue import Zero
from ufl.corealg.map_dag import map_expr_dag
from ufl.corealg.multifunction import MultiFunction

from rotfem.listeners import Compiling, cpu_time
from rotfem.numerics import compat, form_cache

SAME_PATTERN = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


#: Size of blocks up to which dolfinx assembles its own matrices from Python.
LARGEST_BLOCK = 9


class Assembler:
    """Makes PETSc matrices of forms whose entries are all in one pattern.

    The cells' matrices are added up by dolfinx, which takes less than half of PETSc's time. On one process those of a
    kind share their row and column numbers.

    Args:
        form: compiled form that has all entries.

    Attributes:
        pattern: a matrix with the pattern.
        coupled: which components of nodes stiffness matrices couple, directly or by others.
    """

    def __init__(self, form: Any, bcs: list[Any]):
        own = self._own = fem.create_matrix(form, la.BlockMode.expanded)
        self._bcs, self._constraints, dofmap = bcs, [bc._cpp_object for bc in bcs], form.function_spaces[0].dofmap
        owned, nodes, self._block = own.index_map(0).size_local, dofmap.index_map, dofmap.index_map_bs
        self._comm, self._sizes = form.mesh.comm, ((owned, own.index_map(0).size_global),) * 2
        numbers = nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32))
        self._numbers = PETSc.LGMap().create(numbers.astype(PETSc.IntType), bsize=self._block, comm=self._comm)
        rows = np.array(own.indptr[: owned + 1], PETSc.IntType)
        columns = own.index_map(1).local_to_global(own.indices[: rows[-1]]).astype(PETSc.IntType)
        constrained = [dof for bc in bcs for dof in bc.dof_indices()[0] if dof < owned]
        at = [rows[dof] + np.searchsorted(own.indices[rows[dof] : rows[dof + 1]], dof) for dof in constrained]
        self._diagonal, self._all = np.array(at, dtype=np.intp), np.asarray(own.data)
        self._entries = self._all[: rows[-1]]  # the owned ones
        #: By kind of matrix, that of all others "K": the places of its entries in the whole pattern, rows and columns.
        self._patterns: dict[str, tuple[Any, Any, Any]] = {"K": (None, rows, columns)}
        self.pattern, self.coupled = self.zero(), np.ones((self._block, self._block), dtype=bool)

    def release(self) -> None:
        """Give back the memory of a matrix; no form is assembled any more."""
        self._patterns = {kind: (None, *csr) for kind, (_, *csr) in self._patterns.items()}
        del self._own, self._all, self._entries

    def zero(self, kind: str = "K") -> Any:
        """Return a new matrix of zeros, which on one process takes up memory when it is filled."""
        return self._with(np.zeros(len(self._pattern(kind)[2])), kind)

    def __call__(self, *several: Any, kind: str = "K", diagonal: float | None = None, into: Any = None) -> Any:
        """Return compiled forms added up as a matrix."""
        entries, (kept, *csr) = self._assembled(*several, diagonal=diagonal), self._pattern(kind)
        entries = entries if kept is None else entries[kept]
        if into is None:
            return self._with(entries.copy() if kept is None else entries, kind)
        if self._comm.size == 1:
            into.getAttr("__csr__")[2][:] = entries
            into.stateIncrease()
        else:
            into.setValuesCSR(*csr, entries)
            into.assemble()
        return into

    def narrow(self, several: Mapping[str, Sequence[Any]]) -> None:
        """Take components of nodes that no form couples out of the pattern, as those of a flat plate in and across it.

        The factor fills in by as much less.
        """
        (_, rows, columns), block = self._patterns["K"], self._block
        neighbours = np.diff(rows) // block
        starts, component = np.cumsum(neighbours) - neighbours, np.arange(len(neighbours)) % block
        coupled = {}
        for kind, those in several.items():
            there = np.logical_or.reduceat(self._assembled(*those).reshape(-1, block) != 0.0, starts)
            here = np.any(there.reshape(-1, block, block), axis=0)
            coupled[kind] = np.any(self._comm.allgather(here | here.T | np.eye(block, dtype=bool)), axis=0)
        self.coupled = np.linalg.matrix_power(coupled["K"].astype(int), block) > 0
        coupled["K"] = np.any(list(coupled.values()), axis=0)
        for kind, those in coupled.items():
            kept = np.flatnonzero(those[np.repeat(component, neighbours)])
            ends = np.append(0, np.cumsum(neighbours * those.sum(axis=1)[component])).astype(PETSc.IntType)
            self._patterns[kind] = kept, ends, columns[kept]
        self.pattern = self.zero()

    def _assembled(self, *several: Any, diagonal: float | None = None) -> Any:
        """Return the owned entries of a sum of compiled forms in the whole pattern; the next ones overwrite them."""
        A, constrained = self._own._cpp_object, [] if diagonal is None else self._constraints
        self._all.fill(0.0)
        if self._block > LARGEST_BLOCK:
            return self._by_petsc(several, diagonal)
        for form in several:
            code = form._cpp_object
            cpp.fem.assemble_matrix(A, code, cpp.fem.pack_constants(code), cpp.fem.pack_coefficients(code), constrained)
        if self._comm.size > 1:
            self._own.scatter_reverse()
        if diagonal is not None:
            self._entries[self._diagonal] = diagonal
        return self._entries

    def _by_petsc(self, several: Sequence[Any], diagonal: float | None) -> Any:
        """Return the same, assembled by PETSc, which knows blocks of any size."""
        A = self.zero()
        for form in several:
            fem_petsc.assemble_matrix(A, form, self._bcs if diagonal is not None else [])
        A.assemble()
        self._entries[:] = A.getValuesCSR()[2]
        if diagonal is not None:
            self._entries[self._diagonal] = diagonal
        return self._entries

    def _pattern(self, kind: str) -> tuple[Any, Any, Any]:
        return self._patterns.get(kind, self._patterns["K"])

    def _with(self, entries: npt.NDArray[np.float64], kind: str) -> Any:
        csr = (*self._pattern(kind)[1:], entries)
        A = PETSc.Mat().createAIJWithArrays(self._sizes, csr, comm=self._comm)
        A.setBlockSize(self._block)  # which `createAIJWithArrays` does not heed
        A.setLGMap(self._numbers)
        A.assemble()
        return A


def add_vector(b: npt.NDArray[np.float64], form: Any) -> None:
    """Add a compiled linear form to a local dof array."""
    code = form._cpp_object
    cpp.fem.assemble_vector(b, code, cpp.fem.pack_constants(code), cpp.fem.pack_coefficients(code))


def assembled(form: Any, V: fem.FunctionSpace, clamped: Any, b: Any = None) -> Any:
    """Return a linear form as a PETSc vector (b if given, overwritten), zero at clamped unknowns."""
    b = compat.create_vector(V) if b is None else b
    with b.localForm() as local:
        values = local.array
        values.fill(0.0)
        add_vector(values, form)
    if b.comm.size > 1:
        b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
    b.array[clamped] = 0.0
    return b


def functional(form: Any) -> float:
    """Return this process's part of a compiled functional."""
    code = form._cpp_object
    return float(cpp.fem.assemble_scalar(code, cpp.fem.pack_constants(code), cpp.fem.pack_coefficients(code)))


#: Levels of the C compiler by dimension of the cells, for what is assembled often, and what is assembled a few times or
#: on a few cells. -O2 makes code for lines quicker by a tenth. That for surfaces is long: -O2 takes twice as long over
#: it as -O1, and makes it no quicker up to degree 3, at degree 4 by a seventh; -O0 makes it three times slower.
OFTEN, SELDOM = {1: "-O2", 2: "-O1"}, {1: "-O0", 2: "-O1"}

#: All are compiled in haste for many short computations, as those of tests: ROTFEM_HASTE in the environment, not empty.
if os.environ.get("ROTFEM_HASTE"):
    OFTEN = SELDOM = dict.fromkeys(OFTEN, "-O0")

#: Further options of the C compiler.
FLAGS = ("-g0", "-w")


def form(f: Any, once: bool = False) -> Any:
    """Return a UFL form compiled, over the communicator of its mesh."""
    mesh = f.ufl_domains()[0].ufl_cargo()
    wide = any(max(a.ufl_shape, default=1) > LARGEST_BLOCK for a in f.arguments())  # code as long as for surfaces
    flag = SELDOM[mesh.topology.dim] if once else OFTEN[2 if wide else mesh.topology.dim]
    return _compiled(fem.form, f, comm=mesh.comm, part=f.signature()[:2], flag=flag)


def _compiled(make: Callable[..., Any], *arguments: Any, comm: MPI.Comm, part: str, flag: str) -> Any:
    """Return what dolfinx makes of a form or an expression; rank 0 says in which part of the cache its code is."""
    began, folder = cpu_time(), comm.bcast(form_cache.part(part) if comm.rank == 0 else None)
    options = {"form_compiler_options": dict(form_cache.FORM_OPTIONS)}
    with form_cache.in_use(folder):
        out = make(*arguments, **options, jit_options=form_cache.jit_options(folder, [flag, *FLAGS]))
    Compiling.seconds += cpu_time() - began
    return out


class MeshFree(NamedTuple):
    """A compiled form without its mesh, for further meshes.

    Attributes:
        code: FFCx's form, and its module.
        coefficients, constants: their places among those of a whole.
        parts: places of the constants of each integral.
    """

    code: tuple[Any, Any]
    coefficients: list[int]
    constants: list[int]
    parts: list[list[int]]

    def on(self, V: fem.FunctionSpace, whole: tuple[Sequence[Any], Sequence[Any]], regions: Any) -> tuple[Any, Any]:
        """Return (constants of each integral, compiled form) on the mesh of a space of the arguments."""
        coefficients = [whole[0][i] for i in self.coefficients]
        constants = [whole[1][i] for i in self.constants]
        made = compat.form_of(*self.code, V, coefficients, constants, regions)
        return [[whole[1][i] for i in part] for part in self.parts], made


def mesh_free(f: Any, compiled: Any, whole: tuple[Sequence[Any], Sequence[Any]]) -> MeshFree | None:
    """Return a UFL form and what `form` makes of it without its mesh; None where it has more than a whole."""
    code, functions, (coefficients, constants) = compiled.ufcx_form, f.coefficients(), whole
    used = [functions[code.original_coefficient_positions[i]] for i in range(code.num_coefficients)]
    if any(x not in coefficients for x in used) or any(x not in constants for x in f.constants()):
        return None
    places, parts = {c: i for i, c in enumerate(constants)}, constants_of(f)
    own = [places[c] for c in f.constants()], [[places[c] for c in part] for part in parts]
    return MeshFree((code, compiled.module), [coefficients.index(x) for x in used], *own)


def constants_of(f: Any) -> list[list[Any]]:
    """Return the constants of each integral of a UFL form."""
    return [extract_constants(part.integrand()) for part in f.integrals()]


def constant(domain: Any, value: npt.NDArray[Any]) -> fem.Constant:
    """Return a constant on a mesh, which forms sort by when it was made.

    UFL sorts constants by their text, in which 10 comes before 9: a form made anew could have its factors in another
    order than before, and would be compiled again.
    """
    out = fem.Constant(domain, value)
    out._repr = f"Constant({out.ufl_domain()!r}, {out.ufl_shape!r}, {out.count():012d})"
    return out


def expression(e: Any, points: npt.NDArray[Any], comm: Any) -> fem.Expression:
    """Return a UFL expression compiled for evaluation at points of the reference cell, shape (number, dim)."""
    return _compiled(fem.Expression, e, points, comm, comm=comm, part="expressions", flag="-O2")


def without(f: Any, *functions: Any) -> Any:
    """Return a UFL form or expression with these functions set to zero: what vanishes with them is not compiled."""
    return zeroed(expand_derivatives(f), *functions)


def zeroed(expanded: Any, *functions: Any) -> Any:
    """Return a UFL form or expression, its derivatives expanded already, with these functions set to zero."""
    if isinstance(expanded, ufl.Form) and expanded.empty():
        return expanded
    zero = {u: ufl.as_vector([0] * u.ufl_shape[0]) for u in functions}
    return map_integrand_dags(_Branches(), ufl.replace(expanded, zero))


def containing(f: ufl.Form, function: Any) -> ufl.Form:
    """Return the integrals of a UFL form that a function is in."""
    return ufl.Form([part for part in f.integrals() if function in extract_coefficients(part.integrand())])


def at_rest(f: Any, q: Any, v: Any, a: Any, undeformed: bool = False) -> dict[str, Any]:
    """Return f and its derivatives K, C and M to q, v and a, at v = a = 0, as UFL forms; they may be empty.

    Expanded once: each derivative is that of what is left where the others vanish.
    """
    expanded, du = expand_derivatives(f), ufl.TrialFunction(q.function_space)
    rest = zeroed(expanded, v, a)
    C = ufl.derivative(zeroed(containing(expanded, v), a), v, du)
    M = ufl.derivative(zeroed(containing(expanded, a), v), a, du)
    if undeformed:
        out = {"K": without(ufl.derivative(rest, q, du), q), "C": without(C, q, v), "M": without(M, q)}
        return {"f": zeroed(rest, q), **out}
    return {"f": rest, "K": ufl.derivative(rest, q, du), "C": without(C, v), "M": expand_derivatives(M)}


def first_branches(e: Any) -> Any:
    """Return a UFL expression with the first branch of each conditional, the one that can be derived at rest.

    The derivatives of both branches are added up, 0/0 of the other with them.
    """
    return map_expr_dag(_Branches(first=True), e)


class _Branches(MultiFunction):  # type: ignore[misc]
    """Makes a conditional its first branch, or zero where both are: UFL leaves it, and knows not what to add it to."""

    expr = MultiFunction.reuse_if_untouched

    def __init__(self, first: bool = False):
        super().__init__()
        self._first = first

    def conditional(self, o: Any, condition: Any, true: Any, false: Any) -> Any:
        if isinstance(true, Zero) and isinstance(false, Zero):
            return Zero(o.ufl_shape, o.ufl_free_indices, o.ufl_index_dimensions)
        return true if self._first else self.reuse_if_untouched(o, condition, true, false)


def quadrature_points(domain: Any, number: int) -> Any:
    """Return the points of the Gauss rule that has `number` of them in each direction, reference cell coordinates."""
    return basix.make_quadrature(domain.basix_cell(), 2 * number - 1)[0]


def added(parts: Iterable[Any]) -> Any:
    """Return the sum of UFL forms; 0 of none. Zeros count as none.

    It is made at once: a sum of two goes through all that is in them, and n of them n times.
    """
    forms = [part for part in parts if not isinstance(part, int)]
    if len(forms) < 2:
        return forms[0] if forms else 0
    if all(isinstance(form, ufl.Form) for form in forms):
        return ufl.Form([integral for form in forms for integral in form.integrals()])
    return sum(forms[1:], start=forms[0])


def weighted(factors: Iterable[Any], parts: Iterable[Any]) -> ufl.Form:
    """Return the sum of UFL forms, each times a scalar."""
    return ufl.Form([c * integral for c, form in zip(factors, parts, strict=True) for integral in form.integrals()])


class Functionals:
    """Values of functionals, name ↦ UFL form, compiled as one form with a constant in every cell for each of them.

    Common subexpressions are computed once.
    """

    def __init__(self, parts: dict[str, Any], mesh: Any):
        self.names, self.comm = tuple(parts), mesh.comm
        if not parts:
            return
        constant = element("DG", mesh.basix_cell(), 0, shape=(len(parts),))
        self._V = fem.functionspace(mesh, constant)  # which must outlast its array
        which = ufl.TestFunction(self._V)
        integrals = [
            integral.reconstruct(which[i] * integral.integrand())
            for i, part in enumerate(parts.values())
            for integral in part.integrals()
        ]
        self._form = form(ufl.Form(integrals))
        cells = self._V.dofmap.index_map
        self._of_cells = np.zeros((cells.size_local + cells.num_ghosts, len(parts)))

    def __call__(self) -> dict[str, float]:
        """Return their values over all ranks, at what their forms are evaluated at."""
        if not self.names:
            return {}
        self._of_cells.fill(0.0)
        add_vector(self._of_cells.reshape(-1), self._form)
        values = self._of_cells.sum(axis=0)
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
        return dict(zip(self.names, values.tolist(), strict=True))
