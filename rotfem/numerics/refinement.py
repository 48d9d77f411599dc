"""The mesh of a space with every cell cut into equal parts, and what is known on the one carried to the other.

Cells keep their shape: a line is halved, a triangle or a quadrilateral quartered along the middles of its edges, curved
ones too. Compiled forms are used again as they are, with the constants that they have: no form is made or compiled.
Every process holds the whole refined mesh.
"""

from __future__ import annotations

from copy import copy
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from basix.ufl import element
from dolfinx import fem, mesh
from dolfinx.fem.forms import get_integration_domains
from mpi4py import MPI

from rotfem.numerics import compat
from rotfem.numerics.by_mesh import ByMesh
from rotfem.numerics.extended_cells import ExtendedCells, InnerPoint

Array = npt.NDArray[np.float64]

#: Corners of the parts of a triangle, in halves of its edges; parts of lines and quadrilaterals are shifted halves.
PARTS_OF_TRIANGLE = (
    ((0, 0), (1, 0), (0, 1)),
    ((1, 0), (2, 0), (1, 1)),
    ((0, 1), (1, 1), (0, 2)),
    ((1, 1), (0, 1), (1, 0)),
)

#: Weights that are none, and the steps in which weights of nodes are told apart.
NONE, STEP = 1e-10, 1e-6


class NotRefined(Exception):
    """What is on the mesh cannot be carried to a finer one."""


@lru_cache(maxsize=4)
def parts(cell: str) -> tuple[Array, Array]:
    """Return (origins, axes) of the parts of a reference cell: a point X of part i lies at origin_i + axes_i X.

    Raises:
        NotRefined: no line, triangle or quadrilateral.
    """
    if cell == "triangle":
        corners = np.array(PARTS_OF_TRIANGLE) / 2
        return corners[:, 0], np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    if cell not in ("interval", "quadrilateral"):
        raise NotRefined(cell)
    dim = 1 if cell == "interval" else 2
    origins = np.array(list(product((0.0, 0.5), repeat=dim)))
    return origins, np.tile(np.eye(dim) / 2, (len(origins), 1, 1))


@lru_cache(maxsize=16)
def weights_in_parts(base: Any) -> list[Array]:
    """Return for every part of a cell the values of the basis of an element at its nodes there, (nodes, basis).

    Raises:
        NotRefined: it has no nodes, or no basis to be told at points.
    """
    try:
        points, (origins, axes) = base.basix_element.points, parts(base.cell_type.name)
        return [base.tabulate(0, origin + points @ A.T)[0] for origin, A in zip(origins, axes, strict=True)]
    except (AttributeError, NotImplementedError) as error:
        raise NotRefined(str(base)) from error


@lru_cache(maxsize=16)
def parts_on(cell: str, side: int) -> list[tuple[int, int]]:
    """Return the (part, its facet) that lie on a facet of a whole cell."""
    base = element("Lagrange", cell, 1).basix_element
    corners, out = base.entity_closure_dofs[-2], []
    for i, (origin, A) in enumerate(zip(*parts(cell), strict=True)):
        weights = base.tabulate(0, origin + base.points @ A.T)[0, :, :, 0]
        beside = np.delete(weights, corners[side], axis=1)
        out += [(i, m) for m, ends in enumerate(corners) if np.all(np.abs(beside[ends]) < NONE)]
    return out


class Refinement:
    """A refined mesh, with the space of the unknowns on it.

    Args:
        V: the space on the mesh that is refined.

    Attributes:
        mesh, V: the refined ones.
        corners: where the nodes of the cells lie that are refined, of all processes, m, shape (cells, nodes, 3).
    """

    def __init__(self, V: fem.FunctionSpace):
        self._coarse, self._comm, old = V, V.mesh.comm, V.mesh
        self._cell = old.topology.cell_name()
        self.origins, self.axes = parts(self._cell)
        self._owned = old.topology.index_map(old.topology.dim).size_local
        self._first = sum(self._comm.allgather(self._owned)[: self._comm.rank])
        cells, x = self._nodes(old)
        gdim, degree = old.geometry.dim, old.geometry.cmap.degree
        domain = element("Lagrange", self._cell, degree, shape=(gdim,))
        self.mesh = mesh.create_mesh(MPI.COMM_SELF, cells=cells, x=x[:, :gdim].copy(), e=domain)
        #: Number of every refined cell as it was made: parts of one cell follow one another.
        made = np.asarray(self.mesh.topology.original_cell_index, dtype=np.int64)
        self._parent, self._part = np.divmod(made, len(self.origins))
        self._number = np.empty_like(made)
        self._number[made] = np.arange(len(made))
        self.V = fem.functionspace(self.mesh, V.ufl_element())
        self._carriers = self._carriers_to(V, self.V)

    def of(self, V: fem.FunctionSpace) -> Refinement:
        """Return this of another space whose cells and nodes are the same ones, in the same order."""
        out = copy(self)
        out._coarse = V
        return out

    def _nodes(self, old: Any) -> tuple[npt.NDArray[np.int64], Array]:
        """Return the nodes of all parts, and where each node lies (m); what cells share is one node."""
        geometry = old.geometry
        dofmap = geometry.dofmap[: self._owned]
        known = np.concatenate(self._comm.allgather(np.asarray(geometry.input_global_indices)[dofmap]))
        self.corners = at = np.concatenate(self._comm.allgather(geometry.x[dofmap]))
        weights = np.stack(weights_in_parts(element("Lagrange", self._cell, geometry.cmap.degree)))
        keys = np.rint(weights / STEP).astype(np.int64)
        numbers: dict[tuple[Any, ...], int] = {}
        cells = np.empty((len(known), *weights.shape[:2]), dtype=np.int64)
        used = [[np.flatnonzero(key) for key in part] for part in keys]
        for c, nodes in enumerate(known):
            for i, part in enumerate(used):
                for j, chosen in enumerate(part):
                    key = tuple(sorted((int(nodes[n]), int(keys[i, j, n])) for n in chosen))
                    cells[c, i, j] = numbers.setdefault(key, len(numbers))
        x = np.empty((len(numbers), 3))
        x[cells.ravel()] = np.einsum("ijn,cnd->cijd", weights, at).reshape(-1, 3)
        return cells.reshape(-1, cells.shape[2]), x

    def _at(self, part: int, points: Array) -> Array:
        """Return where points of a part lie in the whole reference cell."""
        return np.asarray(self.origins[part] + points @ self.axes[part].T)

    # --- functions ---------------------------------------------------------------------------------------------------

    def carried(self, space: Any, values: Array, to: Any) -> Array:
        """Return local values of a space, unknowns (n,) or columns (n, r), at the unknowns of the same on the new mesh.

        Args:
            space: of Lagrange functions, continuous or not.
            values: of this process, ghosts too.
            to: the same space on the refined mesh.
        """
        bs, dofmap = space.dofmap.index_map_bs, space.dofmap.list[: self._owned]
        columns = values.reshape(-1, bs * (values.shape[1] if values.ndim > 1 else 1))
        cells = columns[dofmap] if self._comm.size == 1 else np.concatenate(self._comm.allgather(columns[dofmap]))
        parent, weights = self._carriers if to is self.V else self._carriers_to(space, to)
        out: Array = (weights[:, None] @ cells[parent])[:, 0]
        return out.reshape(-1, *values.shape[1:])

    def _carriers_to(self, space: Any, to: Any) -> tuple[npt.NDArray[np.int64], Array]:
        """Return for every node of a space on the new mesh a cell that it lies in, and the basis of a space there."""
        parent = np.empty(to.dofmap.index_map.size_local, dtype=np.int64)
        part = np.empty_like(parent)
        parent[to.dofmap.list] = self._parent[:, None]
        number = np.empty_like(parent)
        number[to.dofmap.list] = np.arange(to.dofmap.list.shape[1])
        part[to.dofmap.list] = self._part[:, None]
        return parent, np.stack(weights_in_parts(_base(space)))[part, number]

    def function(self, f: fem.Function) -> fem.Function:
        """Return a function on the refined mesh with the values of one on the coarse mesh.

        One with `on_mesh`, which sets it on any mesh, is set anew.
        """
        space = f.function_space
        to = self.V if space == self._coarse else fem.functionspace(self.mesh, space.ufl_element())
        out = fem.Function(to)
        if hasattr(f, "on_mesh"):
            f.on_mesh(out)
            return out
        out.x.array[:] = self.carried(space, f.x.array, to)
        return out

    def clamped(self, nodes: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """Return the nodes of the unknowns on the refined mesh that hang on these nodes (local numbers) alone."""
        space = self._coarse
        free = np.ones(space.dofmap.index_map.size_local + space.dofmap.index_map.num_ghosts, dtype=bool)
        free[nodes] = False
        cells = np.concatenate(self._comm.allgather(free[space.dofmap.list[: self._owned]]))
        out = np.zeros(self.V.dofmap.index_map.size_local, dtype=bool)
        for i, weights in enumerate(weights_in_parts(_base(space))):
            mine = self._part == i
            out[self.V.dofmap.list[mine]] = cells[self._parent[mine]] @ (np.abs(weights.T) > NONE)
        return np.flatnonzero(~out).astype(np.int32)

    def number(self, cell: int, part: int) -> int:
        """Return the number of a part of a cell (over all processes) on the refined mesh."""
        return int(self._number[cell * len(self.origins) + part])

    def extension(self, space: Any, part: int) -> Array:
        """Return the values at the nodes of a cell of what is known at those of its part, continued as a polynomial.

        Raises:
            NotRefined: the functions of the space have no nodes.
        """
        base = _base(space)
        if not hasattr(base, "basix_element"):
            raise NotRefined(str(base))
        points = base.basix_element.points
        inside = np.linalg.solve(self.axes[part], (points - self.origins[part]).T).T
        return np.asarray(base.tabulate(0, inside)[0])

    # --- forms -------------------------------------------------------------------------------------------------------

    def form(self, compiled: Any, f: Any, functions: dict[Any, fem.Function]) -> tuple[Any, ExtendedCells | None]:
        """Return a compiled form on the refined mesh, and its integrals at points inside of parts of cells.

        Args:
            compiled: what dolfinx has made of f.
            f: the UFL form.
            functions: those of f ↦ those on the refined mesh; others are carried there, and kept here.

        Raises:
            NotRefined: it has integrals over parts of the cells.
        """
        domains: dict[str, list[Any]] = next(iter(f.subdomain_data().values()))
        coefficients = f.coefficients()
        for number in range(compiled.ufcx_form.num_coefficients):
            c = coefficients[compiled.ufcx_form.original_coefficient_positions[number]]
            if c not in functions:
                functions[c] = self.function(c)
        inner: list[InnerPoint] = []
        subdomains = {name: self._subdomains(f, name, data[0], inner) for name, data in domains.items()}
        made = compat.form_elsewhere(compiled, f, self.V, functions, subdomains)
        return made, ExtendedCells(self, inner, (compiled, f), functions) if inner else None

    def _subdomains(
        self, f: Any, name: str, data: Any, inner: list[InnerPoint]
    ) -> list[tuple[int, npt.NDArray[np.int32]]]:
        """Return the parts of the entities that integrals of one type go over, by their numbers.

        Points inside of parts are added to `inner`.
        """
        if data is None:
            return []
        if name == "cell":
            return self._points(f, dict(data), inner)
        if name != "exterior_facet":
            raise NotRefined(name)
        ids = sorted({i for part in f.integrals() if part.integral_type() == name for i in _numbers(part)})
        found = get_integration_domains(fem.IntegralType.exterior_facet, data, ids)
        out: list[tuple[int, npt.NDArray[np.int32]]] = []
        for number, entities in found:
            pairs = np.asarray(entities).reshape(-1, 2) + np.array([self._first, 0])
            everywhere = np.concatenate(self._comm.allgather(pairs))
            cut = [(self.number(c, i), m) for c, side in everywhere for i, m in parts_on(self._cell, int(side))]
            shape = (-1, 2) if np.ndim(entities) == 2 else -1  # flat in dolfinx 0.9
            out.append((number, np.array(cut, dtype=np.int32).reshape(shape)))
        return out

    def _points(
        self, f: Any, cells: dict[int, Any], inner: list[InnerPoint]
    ) -> list[tuple[int, npt.NDArray[np.int32]]]:
        """Return the parts that hold the points that integrals of one point go over, where these are corners.

        Such a point has the same reference coordinates in the cell and in its part. All others are added to `inner`.
        """
        out: dict[int, npt.NDArray[np.int32]] = {}
        integrals = [part for part in f.integrals() if part.integral_type() == "cell"]
        for number, integral in {number: part for part in integrals for number in _numbers(part)}.items():
            points = np.asarray(integral.metadata()["quadrature_points"])
            same = [i for i in range(len(self.origins)) if np.allclose(self._at(i, points), points, atol=NONE)]
            mine = np.asarray(cells[number], dtype=np.int64) + self._first
            every = np.concatenate(self._comm.allgather(mine))
            chosen = self._number[every * len(self.origins) + same[0]] if same else []
            out[number] = np.asarray(chosen, dtype=np.int32)
            if not same:
                inner += [InnerPoint(number, int(cell), self._part_about(points)) for cell in every]
        return sorted(out.items())

    def _part_about(self, points: Array) -> int:
        """Return the part of a cell that holds a point (1, d) of it, in reference coordinates."""
        inside = [np.linalg.solve(axes, (points - o).T).T for o, axes in zip(self.origins, self.axes, strict=True)]
        # How far it is outside: of a triangle its coordinates have a sum of at most 1, else each has.
        most = [x.sum() if self._cell == "triangle" else x.max() for x in inside]
        return int(np.argmin([max(-x.min(), top - 1.0) for x, top in zip(inside, most, strict=True)]))


#: Refines a space, once for all with the same cells and nodes.
refinement = ByMesh(Refinement)


def _numbers(integral: Any) -> list[int]:
    """Return the numbers of the subdomains that an integral goes over."""
    number = integral.subdomain_id()
    return [i for i in (number if isinstance(number, tuple) else (number,)) if isinstance(i, int)]


def _base(space: Any) -> Any:
    """Return the element of one component of a space."""
    e = space.ufl_element()
    return e.sub_elements[0] if e.sub_elements else e  # one unknown of a node makes a block, too
