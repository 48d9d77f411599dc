"""What loads do in displacements of fourth order of a structure that bends, Ψ η η η η beside those of `third_order`.

A line that turns by θ and does not stretch comes nearer to its clamp by θ²/2 − θ⁴/24, and a force along it, as the
centrifugal one, works on both: what is of third order in the forces of a turning structure is not all there without.
Ψ is the answer to what the exact strains Γ of V η + ½ Θ η η + Ξ η η η have of fourth order. Only
the work of the loads f in it is wanted, which the answers λ to the loads say,

    f·Ψ η η η η = −∫ N(λ)·Γ₄(η),    K₀ λ = f,

a polynomial of fourth degree in η.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.equations.geometric import fourth_order_work
from rotfem.numerics import compat, forms
from rotfem.numerics.projection import summed

Array = npt.NDArray[np.float64]

#: Coordinates of shapes (r,) ↦ displacements of first, second and third order, local dof arrays.
Displacements = Callable[[Array], tuple[Array, Array, Array]]


class FourthOrder:
    """The work of loads in displacements of fourth order of shapes.

    Args:
        model: reduced model.
        shapes: coordinates of the shapes, (m, r).
        displacements: that the shapes make.
    """

    def __init__(self, model: ReducedModel, shapes: Array, displacements: Displacements):
        self.model, self.shapes = model, shapes
        number = shapes.shape[1]
        #: Numbers of the shapes of the products, (p, 4).
        self.products = np.array(list(combinations_with_replacement(range(number), 4)), dtype=int).reshape(-1, 4)
        # a polynomial of products is known from its values where coordinates are how often they are in each
        points = np.array([np.bincount(product, minlength=number) for product in self.products], dtype=float)
        points = points.reshape(len(self.products), number)  # where nothing moves there is no shape
        values = self._work(points, displacements)
        #: Factor of each product in the work of each load, (loads, p).
        self.factors: Array = np.linalg.solve(points[:, self.products].prod(axis=2), values).T if number else values.T

    def _work(self, points: Array, displacements: Displacements) -> Array:
        """Return the work of all loads at coordinates (n, r), (n, loads)."""
        model, system = self.model, self.model.system
        loads = [system.pieces[i].operator.array[model.owned] for i in model.kinds["f"]]
        if not loads or not len(points):
            return np.zeros((len(points), len(loads)))
        answers = model.solve(system.material_solver, np.array(loads).T)[model.owned]
        functions = [fem.Function(system.V) for _ in range(3)]
        form = forms.form(fourth_order_work(system.model, functions, ufl.TestFunction(system.V)), once=True)
        strained = np.empty((model.owned.stop, len(points)))
        for column, point in zip(strained.T, points, strict=True):
            for function, displacement in zip(functions, displacements(point), strict=True):
                function.x.array[:] = displacement
            b = compat.create_vector(system.V)
            fem_petsc.assemble_vector(b, form)
            b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            column[:] = b.array[model.owned]
        return -np.asarray(summed(model.comm, strained.T @ answers))

    def forces(self, c: Array, q: Array) -> Array:
        """Return the forces that the loads bring to the basis by it, (n, m).

        Args:
            c: factors of all pieces, (n, pieces).
            q: coordinates, (n, m).
        """
        y, weights = q @ self.shapes, c[:, self.model.kinds["f"]] @ self.factors
        out = np.zeros_like(y)
        for weight, product in zip(weights.T, self.products, strict=True):
            for place in range(4):
                others = np.delete(product, place)
                out[:, product[place]] += weight * y[:, others].prod(axis=1)
        return out @ self.shapes.T
