"""How far the mesh can put a frequency off, told from the mode's own shape.

The error of ω² is, to its leading order, the energy of what the elements cannot follow. In every cell the gradients of
a mode are expanded in orthonormal polynomials; the energies A_0, A_1, … of their degrees fall by a constant factor
where the shape is smooth, so that the first degree that is missing has about κ A_L²/A_{L−1}, L the highest that there
is. κ is what a sine has, A_n ∝ (n!/(2n)!)²/(2n+1). Nothing is solved again, and nothing leaves a cell.

Rotations are what bends, displacements what stretches; the reduced integration that keeps locking away adds about as
much again, for which a factor stands.
"""

from __future__ import annotations

from functools import cached_property
from math import factorial
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from basix.ufl import element
from dolfinx import fem

Array = npt.NDArray[Any]


#: What is told, in units of the estimate: of beams and plates it is 0.2 to 1 of the true error where that is small.
SAFE = 3.0


def _sine(n: int) -> float:
    return (factorial(n) / factorial(2 * n)) ** 2 / (2 * n + 1)


class MeshEstimate:
    """Gradients of nodal values in the cells of a space, expanded by degree.

    Args:
        V: blocked Lagrange space.
    """

    def __init__(self, V: Any):
        mesh, self.V = V.mesh, V
        cell, self.degree = mesh.basix_cell(), V.element.basix_element.degree
        tdim, n = mesh.topology.dim, self.degree + 1
        points, weights = basix.make_quadrature(cell, 2 * n + 1)
        owned = mesh.topology.index_map(tdim).size_local
        self.cells = V.dofmap.list[:owned]
        shape = V.element.basix_element.tabulate(1, points)[1 : tdim + 1, :, :, 0]
        geometry = element("Lagrange", cell, mesh.geometry.cmap.degree).tabulate(1, points)
        dN = geometry[1 : tdim + 1].reshape(tdim, len(points), -1)
        x = mesh.geometry.x[mesh.geometry.dofmap[:owned]][:, :, :tdim]
        J = np.einsum("cpi,dqp->cqid", x, dN)
        # Along the directions of the cell, whose degrees are counted, and per unit length.
        self._per_length = 1 / np.linalg.norm(J, axis=2)
        self._weights = weights * np.abs(np.linalg.det(J))
        self._shape, self._points = shape, points
        self._polynomials = basix.tabulate_polynomials(basix.PolynomialType.legendre, cell, self.degree, points)
        self._reference = weights
        if cell == basix.CellType.quadrilateral:
            i, j = np.divmod(np.arange(n * n), n)
            self._levels = [i, j]
        else:
            total = {basix.CellType.interval: np.arange(n)}
            pq = [(p, q) for p in range(n) for q in range(n - p)]
            order = np.zeros(len(pq), dtype=int)
            for p, q in pq:
                order[basix.index(q, p)] = p + q
            self._levels = [total.get(cell, order)]

    def __call__(self, values: Array) -> float:
        """Return the estimated relative error of ω (half that of ω²) of nodal values (local nodes, components)."""
        local = values[self.cells]  # (cells, nodes, components)
        reference = np.einsum("cnk,dqn->cqkd", local, self._shape)
        gradient = reference * self._per_length[:, :, None, :]
        volume = self._weights.sum(axis=1)
        coefficients = np.einsum("pq,q,cqki->cpki", self._polynomials, self._reference, gradient)
        energy = np.einsum("c,cpki->pi", volume, coefficients**2)  # by polynomial and direction of the gradient
        comm = self.V.mesh.comm
        energy = comm.allreduce(energy) if comm.size > 1 else energy
        total = float(energy.sum())
        if total == 0.0:
            return 0.0
        return min(1.0, SAFE * 0.5 * sum(self._missing(energy, level) for level in self._levels) / total)

    @cached_property
    def _top(self) -> Array:
        """What the values at the nodes of a cell have of the highest degree, shape (polynomials, nodes)."""
        e = self.V.ufl_element()
        base = e.sub_elements[0] if e.block_size > 1 else e
        values = base.tabulate(0, self._points)[0]
        highest = np.max(self._levels, axis=0) == self.degree
        return np.asarray(self._polynomials[highest] * self._reference @ values)

    def roughness(self, values: Array) -> Array:
        """Return how much of the highest degree nodal values (states, local nodes, components) have, shape (states,).

        That is what the mesh follows last: where it is large, the mesh is the farthest off.
        """
        own = (np.einsum("pn,scnk->scpk", self._top, values[:, self.cells]) ** 2).sum(axis=(1, 2, 3))
        comm = self.V.mesh.comm
        return np.asarray(comm.allreduce(own) if comm.size > 1 else own)

    def of_shapes(self, X: Array, components: list[list[int]]) -> list[float]:
        """Return the estimates of complex shapes, columns of owned unknowns, each for some of their components."""
        function, size = fem.Function(self.V), self.V.dofmap.index_map_bs
        owned, out = self.V.dofmap.index_map.size_local * size, []
        for x, chosen in zip(X[:owned].T, components, strict=True):
            largest = x[np.argmax(np.abs(x))] if x.size else 0.0
            phase = np.angle(max(self.V.mesh.comm.allgather(complex(largest)), key=abs))
            function.x.array[:owned] = np.real(x * np.exp(-1j * phase))
            function.x.scatter_forward()
            out.append(self(function.x.array.reshape(-1, size)[:, chosen]))
        return out

    def _missing(self, energy: Array, level: Array) -> float:
        """Return the energy of the first missing degree along one direction, summed over the gradient's directions."""
        out = 0.0
        for i in range(energy.shape[1]):
            along = np.array([energy[level == n, i].sum() for n in range(self.degree + 1)])
            # A derivative along a direction has one degree less in it.
            top = self.degree - 1 if len(self._levels) == 1 or self._levels[i] is level else self.degree
            if top == 0:
                out += float(along[0])
                continue
            ratio = along[top] / max(along[top - 1], 1e-300) * _sine(top + 1) * _sine(top - 1) / _sine(top) ** 2
            if top > 1:  # a shape that is even or odd in every cell has only every other degree
                spread = np.sqrt(along[top] / max(along[top - 2], 1e-300) * _sine(top - 2) / _sine(top))
                ratio = max(ratio, float(spread) * _sine(top + 1) / _sine(top))
            out += float(along[top] * min(1.0, ratio))
        return out
