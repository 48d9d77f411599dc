"""How far the mesh puts a motion off, by its own equations on cells of half the size.

*A state.* Put on the finer mesh, its forces are out of balance by what the cells could not follow. The displacements
that balance them, by Newton's method with velocities and accelerations as they are, are the error of the coarser mesh.

*Frequencies.* Shapes X of the coarse mesh become Y = (K + sM)⁻¹ M X on either mesh, by which what the cells cannot
follow is out of them, and the frequencies of the two meshes in Y are compared one by one: those of the undeformed
structure at rest, with s = 0 where K is regular. About a state that moves they say less: a tangent is off by stress in
the points of integration, and the path of the motion is not. What motions bend sharply is for
`rotfem.analysis.mesh_force`.

Both leave out the error of the finer mesh, a small part: (½)^{2k} of it in smooth shapes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg
from dolfinx import fem
from petsc4py import PETSc

from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.schemes import State
from rotfem.equations.finer import FinerEquations
from rotfem.errors import ComputationError
from rotfem.numerics.linear import DirectSolver, Increment, NearbySolver
from rotfem.numerics.refinement import NotRefined

Array = npt.NDArray[np.float64]

#: Most corrections, the relative size of one that is small, and how many of these in a row are the last.
CORRECTIONS, SMALL, ENOUGH = 15, 0.02, 2

#: Number of the lowest shapes whose frequencies are always compared.
LOWEST = 3

#: Part of the square of a frequency that is left at rest below which it is that of a rigid turn about a hinge.
RIGID = 1e-3

#: Most unknowns of the refined mesh.
MOST = 40_000


class RefinedMesh:
    """The equations of a system on its mesh refined, made when they are first asked for.

    Args:
        system: equations of motion, in the frame that turns; states and times are set in it.
    """

    def __init__(self, system: Any):
        self.system = system
        inner = system.held
        cells = 2**inner.structure.mesh.topology.dim
        self._known = system.clamp is None and cells * system.A.getSize()[0] <= MOST
        self._made: FinerEquations | None = None

    @property
    def equations(self) -> FinerEquations | None:
        """The equations on the refined mesh; None where there are none."""
        inner = self.system.held
        if self._known and (self._made is None or self._made.compilations != inner.compilations):
            try:
                self._made = FinerEquations(inner)
            except NotRefined:
                self._known = False
        return self._made if self._known else None

    def of_state(self, state: State) -> float | None:
        """Return the error (m) of the tip at a state; None where it cannot be found."""
        system = self.system
        system.count_rotations_from(state.datum)
        if (fine := self.equations) is None:
            return None
        system.set_time(state.t)
        system.set_state(state.q, state.v, state.a)
        try:
            fine.take()
            return self._corrected(fine)
        except (ComputationError, NotRefined):
            return None

    def _corrected(self, fine: FinerEquations) -> float | None:
        """Return by how much the tip moves when a state is balanced on the finer mesh; None where that does not end."""
        q, start = fine.q.x.array, fine.q.x.array.copy()
        increment, done = Increment(fine.V), 0
        moves = [i for i, name in enumerate(self.system.held.structure.unknowns) if name.startswith("u")]
        for _ in range(CORRECTIONS):
            dq = increment.solve(fine.solver(fine.matrix("K")), fine.imbalance())
            q += dq
            last = float(np.linalg.norm(fine.tip(dq)[moves]))
            size = float(np.linalg.norm(fine.tip(q - start)[moves]))
            if not np.isfinite(size):
                return None
            done = done + 1 if last <= SMALL * size else 0
            # The next one is about the square of the last.
            if self.system.held.linear or done == ENOUGH or last <= SMALL**ENOUGH * size:
                return size
        return None

    def of_frequencies(self, shapes: RitzVectors, most: float = np.inf) -> Array | None:
        """Return (ω − ω_fine)/ω of shapes at rest, shape (r,); None where it cannot be found.

        Args:
            shapes: of the system's own mesh.
            most: frequency above which shapes are left out, but for the lowest, rad/s; their errors are 0.
        """
        if (fine := self.equations) is None:
            return None
        inner = self.system.held
        try:
            self.system.count_rotations_from(None)
            inner.set_time(0.0, inner.motion.at_speed(0.0), 0.0)
            inner.set_state(inner.zeros())
            fine.take(stressed=False)
            V = shapes.V[:, : max(LOWEST, int(np.sum(shapes.squares <= most**2)))]
            K, M = inner.matrix(1.0, 0.0, 0.0, 1.0), inner.matrix(0.0, 0.0, 1.0, 0.0)
            regular = inner.linear and inner.only_strains  # and solvers of it are there
            solver = inner.material_solver if regular else DirectSolver(_shifted(K, shapes.shift, M))
            here = shapes.sum(_energies((M, K, inner.clamped), solver, V))
            K, M = fine.at_rest(), fine.matrix("M")
            X = fine.carried(_local(inner, V))
            solver = fine.material[1] if regular else fine.solver(_shifted(K, shapes.shift, M))
            there = _energies((M, K, fine.clamped), solver, X)
            here, there = (scipy.linalg.eigh(*energies, eigvals_only=True) for energies in (here, there))
        except (ComputationError, NotRefined, np.linalg.LinAlgError):
            return None
        out = np.zeros(shapes.V.shape[1])
        least = RIGID * np.abs(shapes.squares[: len(here)]) + np.finfo(float).tiny
        errors = 0.5 * (here - there) / np.maximum(np.abs(here), least)
        out[: len(errors)] = np.clip(errors, -1.0, 1.0)
        return out if np.all(np.isfinite(errors)) else None


def _local(system: Any, owned: Array) -> Array:
    """Return owned columns with the values of ghosts."""
    if system.comm.size == 1:
        return owned
    function = fem.Function(system.V)
    out = np.empty((len(function.x.array), owned.shape[1]))
    for i, column in enumerate(owned.T):
        function.x.array[: len(owned)] = column
        function.x.scatter_forward()
        out[:, i] = function.x.array
    return out


def _shifted(K: Any, shift: float, M: Any) -> Any:
    """Return K + shift M, a new matrix."""
    A = K.copy()
    A.axpy(shift, M, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return A


def _energies(system: tuple[Any, Any, Any], solver: DirectSolver | NearbySolver, X: Array) -> Array:
    """Return the part of this process in the stiffness and the mass of A⁻¹ M X, shape (2, r, r).

    Args:
        system: M, K (with 1 at clamped unknowns), and the clamped unknowns.
        solver: of A.
        X: columns.
    """
    M, K, clamped = system
    Y = _times(M, X)
    x, y = M.createVecs()
    for column in Y.T:
        x.array[:] = column
        x.array[clamped] = 0.0
        solver.solve(x, y)
        column[:] = y.array
    small: Array = np.array([Y.T @ _times(B, Y) for B in (K, M)])
    return np.asarray(0.5 * (small + np.swapaxes(small, 1, 2)))


def _times(A: Any, X: Array) -> Array:
    """Return A X of columns."""
    x, y = A.createVecs()
    out = np.empty_like(X)
    for i, column in enumerate(X.T):
        x.array[:] = column
        A.mult(x, y)
        out[:, i] = y.array
    return out
