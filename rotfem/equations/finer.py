"""The equations of a system on its mesh refined, at the states and times that are set in the system itself.

Forms, constants and scalars are the system's own, carried to the refined mesh (`rotfem.numerics.refinement`); fields
and states are what they are on the coarse mesh. So nothing is compiled, and building it takes some milliseconds.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from rotfem.numerics import compat
from rotfem.numerics.extended_cells import ExtendedCells
from rotfem.numerics.linear import DirectSolver, Increment, NearbySolver, held
from rotfem.numerics.low_rank import LowRank, PlusLowRank
from rotfem.numerics.projection import times
from rotfem.numerics.refinement import refinement
from rotfem.structures.tip_values import TipValues

Array = npt.NDArray[np.float64]

#: Number of unknowns up to which a factor costs less than iterations with another one.
FEW = 500


class FinerEquations:
    """M, C, K and −F of a system with cells of half the size.

    Args:
        system: equations of the structure, its hub held.

    Attributes:
        V: the space of the unknowns on the refined mesh.
        tip: reads the values at the tip of an array over it.

    Raises:
        NotRefined: the mesh, or what is on it, cannot be refined.
    """

    def __init__(self, system: Any):
        self.system, self.compilations = system, system.compilations
        self._refined = refinement(system.V)
        self.V = self._refined.V
        self.q, self.v, self.a = (fem.Function(self.V) for _ in range(3))
        self._functions: dict[Any, fem.Function] = {system.q: self.q, system.v: self.v, system.a: self.a}
        self._forms: dict[str, tuple[Any, ExtendedCells | None]] = {}
        #: Of a linear theory: matrices at the time that was taken.
        self._matrices: dict[str, Any] = {}
        #: A matrix with the pattern of all.
        self._pattern: Any = None
        #: A factor of before; all matrices are near its one.
        self._near: DirectSolver | None = None
        nodes, structure = self._refined.clamped(system.structure.clamped), system.structure
        self.clamped, self._hinged = structure.clamped_unknowns(nodes), structure.hinged_unknowns(nodes)
        self._bcs = structure.clamp_conditions(self.V, nodes=nodes)
        self.tip = TipValues(self.V, _tip(system))

    def take(self, stressed: bool = True) -> None:
        """Take the state, and all fields, that are set in the system; where it is not stressed, without its stress."""
        self._matrices = {kind: A for kind, A in self._matrices.items() if kind == "M"}
        for f, g in self._functions.items():
            if hasattr(f, "on_mesh"):
                continue
            g.x.array[:] = self._refined.carried(f.function_space, f.x.array, g.function_space)
        if stressed and self.system.linear and self.system.prestressed:
            self._prestress()

    def _prestress(self) -> None:
        """Set the displacement that stresses a linear theory to that of the finer mesh."""
        s = self.system
        base = self._functions.setdefault(s.prestressing, fem.Function(self.V))
        load = compat.create_vector(self.V)
        self._assemble(load, "F")
        load.array[self.clamped] = 0.0
        base.x.array[:] = -Increment(self.V).solve(self.material[1], load)

    @cached_property
    def material(self) -> tuple[Any, DirectSolver]:
        """Of a linear theory the stiffness of the strains alone, and a solver of it that holds hinges, too."""
        with self.system.of_material():
            K = A = self._assembled(("K",), 1.0)
        if len(self._hinged):
            held(A := K.copy(), self._hinged)
        self._near = DirectSolver(A, symmetric=True)
        return K, self._near

    def carried(self, columns: Array) -> Array:
        """Return columns (n, r) of local dof arrays of the system on the refined mesh."""
        return self._refined.carried(self.system.V, columns, self.V)

    def matrix(self, kind: str) -> Any:
        """Return M, C or K at the state that was taken, a PETSc matrix; K has 1 at clamped unknowns, the others have 0.

        Of a linear theory it is the same one until another state is taken, M always.
        """
        names, shifts = self.system.tangent_forms(kind)
        diagonal = float(kind == "K")
        if not self.system.linear:
            self.system.shift(shifts)
            return self._assembled(names, diagonal)
        if kind not in self._matrices:
            self._matrices[kind] = self._assembled(names, diagonal)
        return self._matrices[kind]

    def mass_damping_stiffness(self) -> tuple[Any, Any, Any]:
        """Return (M, C, K) on the refined mesh, as those of the system."""
        M, K = self.matrix("M"), self.matrix("K")
        if self.system.tangent_forms("C")[0]:
            C = self.matrix("C")
        else:
            C = K.duplicate()
            C.assemble()
        return M, C if self.system.by_mode is None else PlusLowRank(C, self._by_mode), K

    def at_rest(self) -> Any:
        """Return K of the undeformed structure, if that is the state that was taken, with 1 at clamped unknowns."""
        if not self.system.linear:
            return self.matrix("K")
        return self.material[0] if self.system.only_strains else self._assembled(("K",), 1.0)

    def _assembled(self, names: tuple[str, ...], diagonal: float) -> Any:
        A = fem_petsc.create_matrix(self._form(names[0])[0]) if self._pattern is None else self._pattern.duplicate()
        A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)  # of a damper at the root
        for name in names:
            form, points = self._form(name)
            fem_petsc.assemble_matrix(A, form, self._bcs, 0.0)
            A.assemble()
            if points is not None:
                points.add_to_matrix(A, self.clamped)
                A.assemble()
        d = A.getDiagonal()
        d.array[self.clamped] = diagonal
        A.setDiagonal(d)
        if self._pattern is None and names[0] == self.system.tangent_forms("K")[0][0]:
            self._pattern = A
        return A

    def solver(self, A: Any) -> DirectSolver | NearbySolver:
        """Return a solver of a matrix on the refined mesh, which must not change any more."""
        if self._near is not None and A.getSize()[0] > FEW:
            return NearbySolver(A, self._near)
        self._near = DirectSolver(A)
        return self._near

    def imbalance(self) -> Any:
        """Return −F at q, v, a as a PETSc vector, zero at clamped unknowns."""
        b = compat.create_vector(self.V)
        if not self.system.linear or self.system.tangent_forms("f")[0]:  # nothing may drive a linear theory
            for name in self.system.residual_forms:
                self._assemble(b, name)
        if self.system.linear:
            for kind, x in (("M", self.a), ("C", self.v), ("K", self.q)):
                self._add(b, kind, x)
        if self.system.by_mode is not None:
            b.array[:] += self._by_mode.times(self.v.x.array)
        b.scale(-1.0)
        b.array[self.clamped] = 0.0
        return b

    @cached_property
    def _by_mode(self) -> LowRank:
        """Damping by mode on the refined mesh: of the same shapes, with the mass there of the undeformed structure."""
        shapes, function = self.system.by_mode.shapes, fem.Function(self.system.V)
        columns: Array = np.empty((len(function.x.array), shapes.shape[1]))
        for column, shape in zip(columns.T, shapes.T, strict=True):
            function.x.array[: len(shape)] = shape
            function.x.scatter_forward()
            column[:] = function.x.array
        state = [f.x.array.copy() for f in (self.q, self.v, self.a)]
        for f in (self.q, self.v, self.a):
            f.x.array[:] = 0.0
        M = self.matrix("M")
        for f, values in zip((self.q, self.v, self.a), state, strict=True):
            f.x.array[:] = values
        return LowRank(times(M, self.carried(columns)), M)

    def _add(self, b: Any, kind: str, x: fem.Function) -> None:
        """Add A x to a vector, A of a linear theory; it has all of one kind there is, or none."""
        if self.system.tangent_forms(kind)[0]:  # what is clamped is zero, whatever is on the diagonal there
            self.matrix(kind).multAdd(compat.wrap(x.x), b, b)

    def _assemble(self, b: Any, name: str) -> None:
        """Add a form of the system on the refined mesh to a vector."""
        form, points = self._form(name)
        fem_petsc.assemble_vector(b, form)
        if points is not None:
            points.add_to_vector(b)

    def _form(self, name: str) -> tuple[Any, ExtendedCells | None]:
        """Return a form of the system on the refined mesh, and its integrals at points inside of cells there."""
        if name not in self._forms:
            f, compiled = self.system.known_form(name)
            self._forms[name] = self._refined.form(compiled, f, self._functions)
        return self._forms[name]


def _tip(system: Any) -> Array:
    """Return where the tip of a structure is (3,), m."""
    values, x = system.structure.tip_values, system.V.tabulate_dof_coordinates()
    at: Array = np.zeros(3)
    if system.comm.rank == values.owner:
        at[:] = x[values.dofs.start // values.size]
    if system.comm.size > 1:
        system.comm.Bcast(at, root=values.owner)
    return at
