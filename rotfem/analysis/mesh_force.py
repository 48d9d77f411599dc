"""What a motion lacks of the forces on a few shapes, because the cells follow neither the motion nor the shapes.

With q_h the best that a mesh has, the force on a shape φ is off by the energy a(q − q_h, φ − φ_h) of what is missing of
both. In every cell the curvatures of both are expanded in orthonormal polynomials (`rotfem.analysis.mesh_estimate`).
The first degree that is missing has ρ of the energy of the highest that there is, and so

    a(q − q_h, φ − φ_h) ≈ √(ρ_q ρ_φ) Σ_cells EI q_L φ_L,

q_L and φ_L the parts of the highest degree. Where q is a shape c φ that is 2 ε ω² c, ε the error of its frequency by
the mesh. In large motions it is much more: what they bend sharply no shape about a straight beam knows. Nothing is
solved but once, for EI.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.mesh_estimate import Part
from rotfem.analysis.ritz_vectors import RitzVectors
from rotfem.analysis.shape_error import ShapeError
from rotfem.numerics.linear import DirectSolver, held

Array = npt.NDArray[np.float64]

#: A curvature that is none, 1/m.
TINY = 1e-300


class MeshForce:
    """Forces that the mesh leaves out, of one structure on its mesh.

    Args:
        system: equations of motion; time and state are set in it.
        shape: errors of shapes.
    """

    def __init__(self, system: Any, shape: ShapeError):
        self.system, self.estimate, self.turns = system, shape.estimate, shape.turns
        self._size = len(system.held.structure.unknowns)

    def __call__(self, states: Array, shapes: RitzVectors) -> Array:
        """Return the forces on shapes, (n, r); those on the ones that stretch mean nothing.

        Args:
            states: displacements and rotations from the undeformed state, local dof arrays (n, unknowns).
            shapes: about the tangent of one of these states.
        """
        estimate, stiffness = self.estimate, self.stiffness * self.estimate.volumes[:, None]
        q, x = (self._coefficients(columns) for columns in (states, self._whole(shapes.V)))
        energies = [estimate.energies(c) for c in (q, x)]
        out = np.zeros((len(q), len(x)))
        for part in estimate.parts:
            ratios = [estimate.highest(energy, part)[1] for energy in energies]
            kept, of_shapes = (self._highest(c, part) for c in (q, x))
            forces = (kept * stiffness[:, None, :]).reshape(len(q), -1) @ of_shapes.reshape(len(x), -1).T
            out += np.sqrt(np.outer(*ratios)) * forces
        return estimate.sum(out)

    def _coefficients(self, columns: Array) -> Array:
        """Return the gradients of the rotations in local dof arrays (n, unknowns), expanded in every cell."""
        return self.estimate.coefficients(columns.reshape(len(columns), -1, self._size)[:, :, self.turns])

    @staticmethod
    def _highest(coefficients: Array, part: Part) -> Array:
        """Return what has the highest degree, shape (n, cells, polynomials, components)."""
        return np.asarray(coefficients[..., part.direction][:, :, part.polynomials])

    def _whole(self, owned: Array) -> Array:
        """Return owned columns (n, r) as local dof arrays (r, unknowns), with the values of ghosts."""
        if self.system.comm.size == 1:
            return np.ascontiguousarray(owned.T)
        function = self.system.held.q.copy()
        out = np.empty((owned.shape[1], len(function.x.array)))
        for i, column in enumerate(owned.T):
            function.x.array[: len(owned)] = column
            function.x.scatter_forward()
            out[i] = function.x.array
        return out

    @cached_property
    def stiffness(self) -> Array:
        """Moment over curvature in every cell, for every rotation, shape (cells, components); N·m², of plates N·m.

        A unit moment at the tip bends a beam by 1/EI at each place. A plate's is one number: the energy of such a
        moment over that of the curvatures.
        """
        system, inner = self.system, self.system.held
        system.count_rotations_from(None)
        inner.set_time(0.0, inner.motion.at_speed(0.0), 0.0)
        inner.set_state(inner.zeros())
        K = inner.matrix(1.0, 0.0, 0.0, 1.0)
        held(K, inner.structure.hinged_unknowns())
        solver, (load, answer) = DirectSolver(K), K.createVecs()
        tip = inner.structure.tip_values
        columns = np.empty((len(self.turns), len(load.array)))
        for column, turn in zip(columns, self.turns, strict=True):
            load.set(0.0)
            if inner.comm.rank == tip.owner:
                load.array[tip.dofs.start + turn] = 1.0
            solver.solve(load, answer)
            column[:] = answer.array
        whole = self._whole(columns.T)
        c = self._coefficients(whole)
        own = np.array([(c[i, :, :, i] ** 2).sum(axis=(1, 2)) for i in range(len(c))]).T
        if inner.structure.mesh.topology.dim == 1:
            return np.asarray(1.0 / np.sqrt(np.maximum(own, TINY)))
        turned = [tip(x)[turn] for x, turn in zip(whole, self.turns, strict=True)]
        energy = self.estimate.sum(self.estimate.volumes @ own)
        return np.tile(np.array(turned) / energy, (len(own), 1))
