"""How far the mesh puts each frequency off, by the compliance of the structure on cells of half the size.

A mode x = q e^{iωt} is what inertia, a load f of density z = (ω² + s) q, makes of A = K + sM: q = A⁻¹f. On a finer mesh
A⁻¹f has what the cells of the mode could not follow, and the compliance fᵀA⁻¹f is larger by η of it. So the energy
qᵀA q is off by η of it, whatever holds the structure straight, bending or stress, and an eigenvalue λ by

    δλ/λ = η qᴴA q / (λ xᴴ(2λM + C) x),

η (ω² + s)/2ω² where rates have no forces and the hub is not free. Where it is, x has its angle ψ, too, M of x that of
the hub, and z has ω² ψ times the place, which is found from f.
A shift s > 0 keeps A regular where a structure is free to turn or about to buckle; it lies between the squares of the
lowest and of the highest frequency, so that neither round-off nor what a mode has of lower ones is taken for an error.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from petsc4py import PETSc

from rotfem.analysis.refined_mesh import RefinedMesh
from rotfem.errors import ComputationError
from rotfem.numerics.bounds import RoundOff
from rotfem.numerics.linear import DirectSolver, Increment
from rotfem.numerics.refinement import NotRefined

Array = npt.NDArray[Any]

#: Of an error what half the cells tell where a corner slows convergence down; elsewhere they tell 0.94 and more.
TOLD = 0.8

#: Most corrections of the equilibrium on the finer mesh, and the relative size of the last.
CORRECTIONS, SMALL = 6, 1e-6

#: Largest difference of entries, in units of the largest, up to which a matrix is symmetric.
SYMMETRIC = 1e-12

#: Most unknowns of the finer mesh, whose factor is most of the work.
MOST = 40_000

#: What round-off makes of the difference of two compliances, in that of the stiffness that a mode feels: its own, and
#: four times that on cells of half the size, as with the nodes, or with nodes and entries of a line, the sum grows.
TWO = 5.0

#: Error of a frequency that this may come to, at most, for the difference to be told: a mesh that is called coarse has
#: more. What is told is a tenth of this bound off at most in plates of 1e-3 to 3e-6 of their length, as rows err apart.
UNKNOWN = 0.02

#: Modes slower than this part of the highest have no stiffness.
STILL = 1e-6

#: Part of its stiffness, in units of its mass and the highest frequency, that a structure has for mass.
LITTLE = 1e-6


class FrequencyErrors:
    """Errors of frequencies by the mesh, of one structure at any speed.

    Args:
        system: equations of motion in the rotating frame; time and state are set in it.
    """

    def __init__(self, system: Any):
        self.system, self._refined = system, RefinedMesh(system)

    def __call__(self, spinning: Any, motion: Any, balanced: bool) -> list[float] | None:
        """Return the relative error of every mode; None where no finer mesh says it.

        Args:
            spinning: equilibrium and eigenpairs.
            motion: with its speed.
            balanced: whether the equilibrium is that of loads and spin, not the undeformed structure.
        """
        inner = self.system.held
        size = self.system.A.getSize()[0]
        large = size * 2**inner.structure.mesh.topology.dim > MOST
        if large or inner.datum is not None or spinning.datum is not None or not len(spinning.pairs.values):
            return None
        if spinning.clamped.M.getSize() != inner.A.getSize():  # modes are in coordinates of a basis
            return None
        if (fine := self._refined.equations) is None:
            return None
        inner.set_time(0.0, motion)
        inner.set_state(spinning.q)
        lam = spinning.pairs.values
        sizes = np.abs(lam)
        shift = float(sizes.min() * sizes.max())
        weights = _weights(spinning, shift) / TOLD
        if not np.all(TWO * _rounded(spinning, shift) * weights < UNKNOWN):
            return None
        try:
            fine.take()
            if balanced and not inner.linear and not _balance(fine):
                return None
            off = np.abs(self._softened(spinning, fine, shift)) * weights
        except (ComputationError, NotRefined):
            return None
        return [float(x) for x in np.minimum(off, 1.0)] if np.all(np.isfinite(off)) else None

    def _softened(self, spinning: Any, fine: Any, shift: float) -> Array:
        """Return η of every mode."""
        inner, M, K = self.system.held, spinning.clamped.M, spinning.clamped.K
        owned = M.getLocalSize()[0]
        shapes = _in_phase(inner.comm, spinning.pairs.right)
        densities = shapes[:owned]
        if spinning.pencil is not spinning.clamped:
            densities = _densities(spinning, shapes, shift)
        densities = _local(inner, densities)
        here = _compliances(M, _shifted(K, shift, M), densities[:owned], inner.clamped)
        M = fine.matrix("M")
        there = fine.carried(densities)[: M.getLocalSize()[0]]
        return _compliances(M, _shifted(fine.matrix("K"), shift, M), there, fine.clamped) / here - 1.0


def _rounded(spinning: Any, shift: float) -> Array:
    """Return for every mode what round-off of K can make of the shifted stiffness that it feels, relative, at most."""
    clamped, squares = spinning.clamped, np.abs(spinning.pairs.values) ** 2 + shift
    q = spinning.pairs.right[: clamped.M.getLocalSize()[0]]
    local = np.real(np.sum(q.conj() * clamped.apply(clamped.M, q), axis=0))
    inertia = squares * (clamped.comm.allreduce(local) if clamped.comm.size > 1 else local)
    lost = RoundOff(clamped, clamped.sizes).stiffness(q, q)
    moving = squares > shift + STILL**2 * squares.max()
    return np.where(moving, lost / inertia, 0.0)


def _weights(spinning: Any, shift: float) -> Array:
    """Return |qᴴA q / (λ xᴴ(2λM + C) x)| of every mode."""
    pencil, clamped, lam, X = spinning.pencil, spinning.clamped, spinning.pairs.values, spinning.pairs.right
    q = X[: clamped.M.getLocalSize()[0]]
    parts = [(pencil, pencil.M, X), (pencil, pencil.C, X), (clamped, clamped.K, q), (clamped, clamped.M, q)]
    local = np.array([np.sum(Y.conj() * p.apply(A, Y), axis=0) for p, A, Y in parts])
    mass, rates, stiffness, own = pencil.comm.allreduce(local) if pencil.comm.size > 1 else local
    return np.asarray(np.abs((stiffness + shift * own) / (lam * (2.0 * lam * mass + rates))))


def _densities(spinning: Any, shapes: Array, shift: float) -> Array:
    """Return z of modes of a free hub, real shapes with its angle, owned columns of the structure.

    What has no mass has z by a little of its stiffness.
    """
    pencil, clamped = spinning.pencil, spinning.clamped
    squares, q = np.abs(spinning.pairs.values) ** 2, shapes[: clamped.M.getLocalSize()[0]]
    loads = squares * pencil.apply(pencil.M, shapes)[: len(q)] + shift * clamped.apply(clamped.M, q)
    solver = DirectSolver(_shifted(clamped.M, LITTLE / float(squares.max()), clamped.K))
    f, z = clamped.M.createVecs()
    out = np.empty_like(q)
    for column, load in zip(out.T, loads.T, strict=True):
        f.array[:] = load
        solver.solve(f, z)
        column[:] = z.array
    return out


def _balance(fine: Any) -> bool:
    """Balance a steady state on the finer mesh; return whether that ends."""
    q, increment = fine.q.x.array, Increment(fine.V)
    for _ in range(CORRECTIONS):
        dq = increment.solve(DirectSolver(fine.matrix("K")), fine.imbalance())
        q += dq
        last, size = float(np.abs(dq).max(initial=0.0)), float(np.abs(q).max(initial=0.0))
        if not np.isfinite(last):
            return False
        if last <= SMALL * size:
            return True
    return False


def _in_phase(comm: Any, right: Array) -> Array:
    """Return the real shapes of complex modes, owned columns, at the phase where most of them is."""
    squares = np.sum(right * right, axis=0)
    squares = comm.allreduce(squares) if comm.size > 1 else squares
    return np.asarray(np.real(right * np.exp(-0.5j * np.angle(squares))))


def _local(system: Any, owned: Array) -> Array:
    """Return owned columns as local ones, with the values of ghosts."""
    function = fem.Function(system.V)
    out = np.empty((len(function.x.array), owned.shape[1]))
    for column, values in zip(out.T, owned.T, strict=True):
        function.x.array[: len(values)] = values
        function.x.scatter_forward()
        column[:] = function.x.array
    return out


def _shifted(K: Any, shift: float, M: Any) -> Any:
    """Return K + shift M, a new matrix."""
    A = K.copy()
    A.axpy(shift, M, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return A


def _compliances(M: Any, A: Any, X: Array, clamped: Any) -> Array:
    """Return fᵀA⁻¹f of f = M x of owned columns X; every process has the finer mesh as a whole."""
    x, f = M.createVecs()
    loads = np.empty_like(X)
    for load, column in zip(loads.T, X.T, strict=True):
        x.array[:] = column
        M.mult(x, f)
        f.array[clamped] = 0.0
        load[:] = f.array
    symmetric = bool(A.isSymmetric(SYMMETRIC * A.norm(PETSc.NormType.NORM_INFINITY)))
    out = np.einsum("ij,ij->j", loads, DirectSolver(A, symmetric).solve_all(loads))
    return np.asarray(M.comm.tompi4py().allreduce(out)) if M.comm.size > 1 else out
