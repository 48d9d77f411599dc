"""Several functionals of the state in one pass over the cells."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
import ufl
from basix.ufl import element
from dolfinx import fem
from mpi4py import MPI

from rotfem.equations.model import Model
from rotfem.numerics import forms
from rotfem.numerics.forms import added
from rotfem.structures.structure import Array


class RigidBody(NamedTuple):
    """Integrals over the undeformed structure, frame axes.

    Attributes:
        mass: ∫ dm (kg).
        first_moment: ∫ x dm about the origin of the frame (kg·m), (3,).
        second_moment: ∫ x xᵀ dm about it, directors included (kg·m²), (3, 3).
    """

    mass: float
    first_moment: Array
    second_moment: Array

    def about(self, point: Array) -> Array:
        """Return the inertia tensor tr(E) 1 − E (kg·m²), (3, 3), about a point (m), of E = ∫ (x−p)(x−p)ᵀ dm."""
        cross = np.outer(self.first_moment, point)
        E = self.second_moment - cross - cross.T + self.mass * np.outer(point, point)
        return np.asarray(np.trace(E) * np.eye(3) - E)


def rigid_body(model: Model) -> RigidBody:
    """Return the integrals of the undeformed structure of a model, with the mass of its effects."""
    bodies = model.mechanics.bodies
    places = [b for b in bodies if b.is_position]

    parts = {"m": added(b.density * b.measure for b in places)}
    parts |= {f"{i}": added(b.density * b.x[i] * b.measure for b in places) for i in range(3)}
    pairs = list(combinations_with_replacement(range(3), 2))
    parts |= {f"{i}{j}": added(b.density * b.x[i] * b.x[j] * b.measure for b in bodies) for i, j in pairs}
    found = Functionals(parts, model.structure.mesh)()
    second = np.array([[found[f"{min(i, j)}{max(i, j)}"] for j in range(3)] for i in range(3)])
    return RigidBody(found["m"], np.array([found[f"{i}"] for i in range(3)]), second)


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
        self._form = forms.form(ufl.Form(integrals))
        cells = self._V.dofmap.index_map
        self._of_cells = np.zeros((cells.size_local + cells.num_ghosts, len(parts)))

    def __call__(self) -> dict[str, float]:
        """Return their values over all ranks, at what their forms are evaluated at."""
        if not self.names:
            return {}
        self._of_cells.fill(0.0)
        forms.add_vector(self._of_cells.reshape(-1), self._form)
        values = self._of_cells.sum(axis=0)
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
        return dict(zip(self.names, values.tolist(), strict=True))
