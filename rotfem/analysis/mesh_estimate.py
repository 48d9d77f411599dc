"""How far the mesh can put a frequency off, told from the mode's own shape.

The error of ω² is, to its leading order, the energy of what the elements cannot follow. In every cell the gradients of
a mode are expanded in orthonormal polynomials; the energies A_0, A_1, … of their degrees fall by a constant factor
where the shape is smooth, so that the first degree that is missing has about κ A_L²/A_{L−1}, L the highest that there
is. κ is what a sine has, A_n ∝ (n!/(2n)!)²/(2n+1). Nothing is solved again, and nothing leaves a cell.

Rotations are what bends, displacements what stretches; the reduced integration that keeps locking away adds about as
much again, for which a factor stands.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import factorial
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
from basix.ufl import element
from dolfinx import fem

from rotfem.numerics.by_mesh import ByMesh

Array = npt.NDArray[Any]


#: What is told, in units of the estimate: of beams and plates it is 0.2 to 1 of the true error where that is small.
SAFE = 3.0

#: An energy that is none.
TINY = 1e-300


@lru_cache
def _sine(n: int) -> float:
    return (factorial(n) / factorial(2 * n)) ** 2 / (2 * n + 1)


@dataclass(frozen=True)
class Part:
    """The highest degree along one direction of the cells, of the gradient along one direction.

    Attributes:
        level: degree of every polynomial along the one.
        direction: the other.
        top: the highest.
    """

    level: Array
    direction: int
    top: int

    @property
    def polynomials(self) -> npt.NDArray[np.bool_]:
        """Which polynomials have it."""
        return np.asarray(self.level == self.top)


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
        per_length = 1 / np.linalg.norm(J, axis=2)
        #: Of the cells, length, area or volume.
        self.volumes = (weights * np.abs(np.linalg.det(J))).sum(axis=1)
        polynomials = basix.tabulate_polynomials(basix.PolynomialType.legendre, cell, self.degree, points)
        self._expand = np.einsum("pq,q,dqn,cqd->cpnd", polynomials, weights, shape, per_length)
        rows = self._expand.shape[1] * tdim
        self._rows = np.ascontiguousarray(np.moveaxis(self._expand, 2, 3)).reshape(owned, rows, shape.shape[2])
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

    def of(self, V: Any) -> MeshEstimate:
        """Return this of another space whose cells and nodes are the same ones, in the same order."""
        out = copy(self)
        out.V = V
        return out

    def __call__(self, values: Array) -> float:
        """Return the estimated relative error of ω (half that of ω²) of nodal values (local nodes, components)."""
        energy = self.energies(self.coefficients(values[None]))
        total = float(energy.sum())
        if total == 0.0:
            return 0.0
        missing = sum((kept * ratio).sum() for kept, ratio in (self.highest(energy, part) for part in self.parts))
        return float(min(1.0, SAFE * 0.5 * missing / total))

    def coefficients(self, values: Array) -> Array:
        """Return the gradients of nodal values (states, local nodes, components), expanded in every cell.

        Their squares times the volumes are energies; shape (states, cells, polynomials, components, directions).
        """
        cells, nodes = self.cells.shape
        states, size = len(values), values.shape[2]
        found = self._rows @ np.moveaxis(values, 0, 1)[self.cells].reshape(cells, nodes, states * size)
        out = found.reshape(cells, self._expand.shape[1], self._expand.shape[3], states, size)
        return np.asarray(np.transpose(out, (3, 0, 1, 4, 2)))

    def energies(self, coefficients: Array) -> Array:
        """Return the energies over all cells, by polynomial and direction, shape (states, polynomials, directions)."""
        return self.sum(np.einsum("c,scpkd->spd", self.volumes, coefficients**2))

    def sum(self, local: Array) -> Array:
        """Return the sum over all ranks."""
        comm = self.V.mesh.comm
        return np.asarray(comm.allreduce(local)) if comm.size > 1 else local

    @cached_property
    def parts(self) -> list[Part]:
        """The degrees along every direction of the cells that are the highest, for every direction of the gradient."""
        out = []
        for level in self._levels:
            for i in range(self._expand.shape[3]):
                # A derivative along a direction has one degree less in it.
                less = len(self._levels) == 1 or self._levels[i] is level
                out.append(Part(level, i, self.degree - 1 if less else self.degree))
        return out

    def highest(self, energy: Array, part: Part) -> tuple[Array, Array]:
        """Return the energy of the highest degree, and that of the first missing one as a part of it, shape (states,).

        Args:
            energy: shape (states, polynomials, directions).
            part: which degree and direction.
        """
        top = part.top
        along = (part.level == np.arange(self.degree + 1)[:, None]) @ energy[:, :, part.direction].T
        if top == 0:
            return along[0], np.ones(len(energy))
        ratio = along[top] / np.maximum(along[top - 1], TINY) * _sine(top + 1) * _sine(top - 1) / _sine(top) ** 2
        if top > 1:  # a shape that is even or odd in every cell has only every other degree
            spread = np.sqrt(along[top] / np.maximum(along[top - 2], TINY) * _sine(top - 2) / _sine(top))
            ratio = np.maximum(ratio, spread * _sine(top + 1) / _sine(top))
        return along[top], np.minimum(1.0, ratio)

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


#: Makes an estimate of a space, once for all with the same cells and nodes.
mesh_estimate = ByMesh(MeshEstimate)
