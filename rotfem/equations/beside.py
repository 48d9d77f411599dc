"""The equations of unknowns that are left out, beside those that move.

With q = (a, b), b left out, F = (F_a, F_b). Motions with b = 0 solve the equations, whatever a does, where

    F_b(a, ȧ, ä; b = 0) = 0    for all a, ȧ, ä and all that drives the structure.

F is analytic in them, so one random state at which F_b vanishes is as good as all, but for a set of measure zero.
Small motions of b are stable at a state of a while K_b = ∂F_b/∂b is positive there; of a symmetric structure no other
part of ∂F/∂q is of b.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI

from rotfem.equations.geometric import geometric_stiffness
from rotfem.equations.model import Model
from rotfem.errors import ComputationError
from rotfem.mechanics.problem import Problem
from rotfem.numerics import forms
from rotfem.numerics.inertia import negative_eigenvalues
from rotfem.numerics.linear import transposed

Array = npt.NDArray[np.float64]

#: Size of the random displacements, in lengths of the structure, and of rotations: beyond what linearises.
LARGE = 0.2

#: The same for a linear theory, whose equations are the odd part of F to first order.
SMALL = 1e-4

#: Part of F_b at a random b up to which it is nothing: what is left out for symmetry is a sum of products with zeros.
NOTHING = float(np.finfo(np.float64).eps)


class OfOthers(Model):
    """A model whose variation is that of the unknowns left out, with these in the function `b`."""

    def compose(self) -> None:
        """Write the mechanics and the terms with both kinds of unknowns."""
        s = self.structure
        size, cell = len(s.components) - s.size, s.mesh.basix_cell()
        V = fem.functionspace(s.mesh, element("Lagrange", cell, s.V.element.basix_element.degree, shape=(size,)))
        self.b = fem.Function(V)
        s.use(s.kinematics(s.k.functions, (self.b, ufl.TestFunction(V))))
        super().compose()


class Beside:
    """F_b and K_b of a problem that leaves unknowns out.

    Args:
        problem: it, with what it leaves out.
        comm: MPI communicator.
    """

    def __init__(self, problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD):
        self.comm, self.linear = comm, problem.theory.linear
        self.model = OfOthers(problem, comm)
        s = self.structure = self.model.structure
        self._state, self._b = s.k.functions[:3], self.model.b
        self.V = self._b.function_space
        self._base = fem.Function(self._state[0].function_space)
        others = [i for i in range(len(s.components)) if i not in s.kept]
        self.bcs = s.clamp_conditions(self.V, others)

    @cached_property
    def _F(self) -> Any:
        return forms.form(self.model.residual, once=True)

    @cached_property
    def _K(self) -> Any:
        u, w, theory = ufl.TestFunction(self.V), ufl.TrialFunction(self.V), self.model.theory
        K = ufl.derivative(self.model.residual, self._b, w)
        if theory.prestress:
            K += geometric_stiffness(self.model, (self._state[0], self._base), u, w, theory, self._b)
        return forms.form(K, once=True)

    def stays_zero(self, driven: dict[str, Array]) -> bool:
        """Return whether what is left out stays zero while what is kept moves at will.

        Args:
            driven: name of a constant of frame or loads ↦ its components that may be other than zero, 1, others 0.
        """
        random, s = np.random.default_rng(7), self.structure
        constants = {**self.model.frame.constants, **{n: c for n, (c, _) in s.load_constants.items()}}
        spread = {n for n, (amplitude, _) in s.load_constants.items() if amplitude.spread}
        for name, constant in constants.items():
            each = driven.get(name, np.ones(1)) if name not in spread else np.ones(1)
            each = each[-1:] if constant.value.size == 1 else each  # a pressure is along axis 3, a spin about it
            which = np.broadcast_to(each, constant.value.shape)
            constant.value[...] = which * random.uniform(0.5, 1.5, constant.value.shape)
        s.update_loads()
        size = SMALL if self.linear else LARGE
        for x, rate in zip(self._state, (1.0, 3.0, 10.0), strict=True):
            x.x.array[:] = size * rate * s.scales() * random.uniform(-1.0, 1.0, x.x.array.size)
            x.x.scatter_forward()
        found = [self._size()]
        names = [name for i, name in enumerate(s.components) if i not in s.kept]
        scale = [s.length if name.startswith("u") else 1.0 for name in names]
        self._b.x.array.reshape(-1, len(scale))[:] = size * np.array(scale)
        self._b.x.array[:] *= random.uniform(-1.0, 1.0, self._b.x.array.size)
        self._b.x.scatter_forward()
        found.append(self._size())
        return bool(found[0] <= NOTHING * found[1])

    def _size(self) -> float:
        """Return |F_b| at the state that is set; of a linear theory |F_b(0)| and the odd part of the rest."""
        if not self.linear:
            return self._norm(self._assembled())
        ahead, functions = self._assembled(), (*self._state, self._b)
        kept = [x.x.array.copy() for x in functions]
        for x in functions:
            x.x.array[:] *= -1.0
        back = self._assembled()
        for x in functions:
            x.x.array[:] = 0.0
        still = self._assembled()
        for x, values in zip(functions, kept, strict=True):
            x.x.array[:] = values
        return self._norm(ahead - back) + self._norm(still)

    def _assembled(self) -> Array:
        b = fem.assemble_vector(self._F)
        owned = self.V.dofmap.index_map.size_local * self.V.dofmap.index_map_bs
        b.scatter_reverse(la.InsertMode.add)
        return np.array(b.array[:owned])

    def _norm(self, x: Array) -> float:
        return float(np.sqrt(self.comm.allreduce(float(x @ x))))

    def negative(self, q: Array, constants: dict[str, Array]) -> int | None:
        """Return how many eigenvalues of the symmetric part of K_b are negative at rest in a state.

        None if one is zero.

        Args:
            q: the state of what is kept, local dof array; of a linear theory what the loads displace at rest.
            constants: values of frame and loads, by name.
        """
        for x, values in zip(self._state, (q, 0.0, 0.0), strict=True):
            x.x.array[:] = values
        self._b.x.array[:] = 0.0
        known = {**self.model.frame.constants, **{n: c for n, (c, _) in self.structure.load_constants.items()}}
        for name, constant in known.items():
            constant.value[...] = constants[name]
        self.structure.update_loads()
        if self.linear:  # K is that at q = 0, and what loads displace makes forces there
            self._base.x.array[:] = q
            self._state[0].x.array[:] = 0.0
        K = fem_petsc.assemble_matrix(self._K, self.bcs)
        K.assemble()
        K.axpy(1.0, transposed(K))
        try:
            return negative_eigenvalues(K)
        except ComputationError:
            return None
