"""Stress resultants of a plate at its nodes, and their equivalent stress, where a state is written into its system.

Membrane forces n = h Q ε (N/m), shear forces q = k h G γ (N/m) and moments m = (h³/12) Q κ (N) are best at the points
of the reduced rule. Every cell carries them to its nodes by the polynomial of degree k − 1 that they have there, and a
node has the mean of its cells. The equivalent stress (von Mises) is the largest of both faces, σ = n/h ± 6 m/h²,
and of the middle, σ = n/h with the parabola of the shear stress, 3/2 q/h.
"""

from __future__ import annotations

from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import la

from rotfem.equations.stations import DampedStress
from rotfem.numerics import forms
from rotfem.section_quantities import RESULTANTS

Array = npt.NDArray[np.float64]

#: Strains whose conjugates are the resultants, in their order; others only keep elements from locking.
STRAINS = ("membrane", "shear", "bending")


def von_mises(values: Array, thickness: Array) -> Array:
    """Return the largest equivalent stress (…,), Pa, of n, q, m in their order (…, 8) over a thickness (…,), m."""
    h = thickness[..., None]
    n, q, m = values[..., :3] / h, values[..., 3:5] / h, 6 * values[..., 5:] / h**2

    def squared(s: Array) -> Array:
        out: Array = s[..., 0] ** 2 - s[..., 0] * s[..., 1] + s[..., 1] ** 2 + 3 * s[..., 2] ** 2
        return out

    middle = squared(n) + 3 * np.sum((1.5 * q) ** 2, axis=-1)
    return np.asarray(np.sqrt(np.maximum(np.maximum(squared(n + m), squared(n - m)), middle)))


class PlateResultants:
    """What a plate carries: the system is that of the plate, its hub held.

    Attributes:
        names: of all quantities.
    """

    names = RESULTANTS["plate"]

    def __init__(self, system: Any):
        self.system, self.V = system, system.V
        mesh, element = self.V.mesh, self.V.element.basix_element
        self._points = forms.quadrature_points(mesh, element.degree)
        self._cells = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        lower = basix.create_element(basix.ElementFamily.P, element.cell_type, element.degree - 1, discontinuous=True)
        at_points, at_nodes = (lower.tabulate(0, x)[0, :, :, 0] for x in (self._points, element.points))
        self._carry = at_nodes @ np.linalg.pinv(at_points)
        self._sum = la.vector(self.V.dofmap.index_map, len(self.names) + 1)
        self._damped = DampedStress(system)

    def _expression(self) -> Any:
        """Return resultants and thickness as one UFL vector."""
        parts: list[Any] = []
        for name in STRAINS:
            force = self._damped.of(self.system.model.mechanics.resultant(name))
            parts += [force[i] for i in range(ufl.as_ufl(force).ufl_shape[0])]
        return ufl.as_vector([*parts, self.system.structure.section["thickness"]])

    def __call__(self) -> Array:
        """Return all quantities at all nodes in the order of `structure.nodes`, (n, names), on every rank."""
        width, total = len(self.names), self._sum.array.reshape(-1, len(self.names) + 1)
        total[:] = 0.0
        self._damped.update(self.system.v.x.array)
        if len(self._cells):
            found = self._damped.compiled(self._expression, self._points).eval(self.V.mesh, self._cells)
            found = found.reshape(len(self._cells), len(self._points), -1)
            nodal = np.einsum("np,cpj->cnj", self._carry, found)
            stress = von_mises(nodal[..., : width - 1], nodal[..., -1])
            values = np.concatenate([nodal[..., :-1], stress[..., None], np.ones_like(stress)[..., None]], axis=-1)
            np.add.at(total, self.V.dofmap.list[self._cells], values)
        if self.system.comm.size > 1:
            self._sum.scatter_reverse(la.InsertMode.add)
        owned = self.V.dofmap.index_map.size_local
        here = total[:owned, :-1] / total[:owned, -1:]
        return np.asarray(self.system.structure.ordered(here))
