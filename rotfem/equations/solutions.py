"""Solutions with the matrices of a system: Newton's corrections, and the acceleration at a state."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.numerics.linear import DirectSolver, SingularSolver, is_regular

Array = npt.NDArray[Any]


class Solutions:
    """Solutions with the matrices of equations that have `residual`, `tangent` and `matrix` (see `System`).

    Attributes:
        factored_before: factorisations of the same computation before this object was made.
    """

    residual: Callable[[], Any]
    tangent: Callable[..., tuple[Any, bool]]
    matrix: Callable[..., Any]
    set_state: Callable[..., None]
    set_time: Callable[..., None]
    local: Callable[[Array], Array]
    count_rotations_from: Callable[[Any], None]
    seconds: dict[str, float]
    keeps_factor: bool
    model: Any
    reference: Any
    factored_before = 0
    _state: tuple[Array, ...]
    _solver: DirectSolver | None
    _mass: tuple[Any, tuple[DirectSolver | SingularSolver, Array]] | None = None

    def correction(self, shifts: tuple[float, float, float], before: Array | None = None) -> Array:
        """Return −(c_k K + c_v C + c_m M)⁻¹ F at the state, Newton's correction of q (a local array, reused)."""
        started = perf_counter()
        b = self.residual()
        A, changed = self.tangent(*shifts, before)
        return self._timed(started, b, A, changed)

    def chord(self) -> Array:
        """Return the correction of q at the state with the present factor."""
        started = perf_counter()
        return self._timed(started, self.residual())

    def _timed(self, started: float, b: Any, A: Any = None, changed: bool = False) -> Array:
        """Return the solution of A x = b, of the factor at hand without A, and count the time of its two parts."""
        assembled = perf_counter()
        dq = self.local(self.factor(A, changed).solve(b))
        self.seconds["assemble"] += assembled - started
        self.seconds["solve"] += perf_counter() - assembled
        return dq

    def imbalance(self) -> Array:
        """Return the owned part of −F at the state, a copy."""
        return np.array(self.residual().array)

    def factor(self, A: Any, changed: bool = True) -> DirectSolver:
        """Return the solver of the system's tangent A, with a new factor where it has changed."""
        if self._solver is None or changed:
            self._solver = self._solver or DirectSolver(A)
            self._solver.refresh(A)
        return self._solver

    @property
    def factorisations(self) -> int:
        """Number of matrix factorisations so far."""
        return self.factored_before + (self._solver.factorisations if self._solver else 0)

    def acceleration(self, at_rest: bool = False) -> Array:
        """Return the correction δa with which F = 0 at the state and time set: M δa = −F.

        Unknowns without inertia (the rotation without rotary inertia) follow the others: K δa = 0 in their rows.
        """
        solver, massless = self.mass_solver(at_rest)
        b = self.residual()
        b.array[massless] = 0.0
        return self.local(solver.solve(b))

    def mass_solver(self, at_rest: bool = False) -> tuple[DirectSolver | SingularSolver, Array]:
        """Return a solver with M at the state, or at rest (see `acceleration`), and unknowns without inertia."""
        if not at_rest:
            return self._new_mass_solver()
        if self._mass is None or self._mass[0] is not self.reference:
            q, v, a = (x.copy() for x in self._state)
            self.set_state(np.zeros_like(q))
            self._mass = self.reference, self._new_mass_solver()
            self.set_state(q, v, a)
        return self._mass[1]

    def _new_mass_solver(self) -> tuple[DirectSolver | SingularSolver, Array]:
        """Return a solver with M, where it has to be completed with K, and which owned unknowns have no inertia.

        A mass off the axis can leave a combination of rotations without inertia; then a multiple of K is added to M
        that is negligible for all motions with inertia.
        """
        M = self.matrix(0.0, 0.0, 1.0, 1.0)
        none = M.getDiagonal()
        none.array[:] = none.array == 0.0
        massless = np.asarray(none.array > 0.0)
        if none.norm() > 0.0:
            K = self.matrix(1.0, 0.0, 0.0, 1.0)
            K.diagonalScale(none)
            M.axpy(1.0, K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        solver = DirectSolver(M)
        if is_regular(M, solver):
            return solver, massless
        K = self.matrix(1.0, 0.0, 0.0, 1.0)
        K.scale(1e-9 * M.norm() / K.norm())
        return SingularSolver(M, K), massless
