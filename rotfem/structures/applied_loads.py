"""The loads of a structure in its forms: the work of each, and the constants or fields that their amplitudes are.

The force (or moment) of a load in the forms is f = Σ_k a_k s_k (see `rotfem.mechanics.loads`). Of a uniform load the
amplitudes are the components of a constant; of any other one the factors of shapes, whose sum is a field, linear in
each cell; of a function of place the values at the nodes of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.mechanics.bodies import AppliedLoad, Kinematics
from rotfem.mechanics.loads import AnyLoad, Load, PlaceLoad, PointLoads, Shapes, is_moment, named
from rotfem.mechanics.problem import Problem
from rotfem.structures.points import Points
from rotfem.structures.section_fields import SectionField

Array = npt.NDArray[np.float64]


class Amplitude:
    """The components of a vector that is the same everywhere: a constant of the forms.

    Attributes:
        spread: whether these are factors of shapes over the span, not the components of a vector.
        follows_nodes: whether these are values at the nodes of the mesh, not amplitudes of the load itself.
        dead: whether it keeps its direction in the frame of the hub.
        value: the amplitudes, the same on every process; what is written there holds after `update`.
        vector: the force in the forms.
    """

    spread: ClassVar[bool] = False
    follows_nodes: bool = False
    dead: bool = True

    def __init__(self, constant: fem.Constant):
        self.vector: Any = constant

    @property
    def value(self) -> Any:
        """The amplitudes."""
        return self.vector.value

    def turned(self, value: Array, turn: Array) -> Array:
        """Return the amplitudes of the turned vector (3, 3); one alone is about the axis of the turn."""
        n = value.size
        return np.asarray(turn[:n, :n] @ value) if n > 1 else value

    def update(self, turn: Array | None = None) -> None:
        """Do nothing: what is written to a constant holds."""


class SpanField(Amplitude):
    """A field f(x) = Σ_k a_k s_k(x).

    Args:
        function: the field, blocked by the components.
        basis: s_k, (k, local dofs); None where the amplitudes are the values at all nodes.
        places: number of each local node among all of these, then.
        size: number of amplitudes.
    """

    spread = True

    def __init__(self, function: fem.Function, basis: Array | None, places: npt.NDArray[np.int64] | None, size: int):
        self._function, self._basis, self._places = function, basis, places
        self.follows_nodes, self._value = basis is None, np.zeros(size)
        self.vector = function if function.ufl_shape else ufl.as_vector([function])

    @property
    def value(self) -> Any:
        """The amplitudes a_k."""
        return self._value

    @classmethod
    def of_shapes(cls, structure: Any, load: Load, n: int) -> SpanField:
        """Return the field of the shapes of a load, with n components."""
        rows = structure.inner_rows
        degree = structure.V.element.basix_element.degree if len(rows) else 1
        f = fem.Function(_space(structure, "DG", degree, n))
        cells, parts = f.function_space.dofmap.list, []
        for shapes in (term.shapes for term in load.terms):
            at = partial(_columns, shapes, n)
            values = SectionField(at, rows, degree).values(f.function_space).reshape(cells.size, -1, n)
            if shapes.region:
                there = np.zeros(len(values), dtype=bool)
                there[cells[structure.cells_of(shapes.region)].ravel()] = True
                values[~there] = 0.0
            parts.append(np.moveaxis(values, 1, 0).reshape(values.shape[1], -1))
        basis = np.concatenate(parts)
        return cls(f, basis, None, len(basis))

    @classmethod
    def of_place(cls, structure: Any, load: PlaceLoad, n: int) -> tuple[SpanField, Callable[[float], Array]]:
        """Return the field through the nodes of the structure, and time (s) ↦ its amplitudes.

        That of a function which does not change is evaluated once, and has the single amplitude 1.
        """
        f = fem.Function(_space(structure, "Lagrange", structure.V.element.basix_element.degree, n))
        index, x = f.function_space.dofmap.index_map, f.function_space.tabulate_dof_coordinates()
        points = np.concatenate(structure.comm.allgather(x[: index.size_local]))
        nodes = index.local_to_global(np.arange(len(x), dtype=np.int32))
        places = tuple(map(structure.place, points))

        def amplitudes(t: float) -> Array:
            return np.ravel(first(load.on(places, t).reshape(len(places), -1), n))

        if load.constant:
            field = cls(f, amplitudes(0.0).reshape(-1, n)[nodes].reshape(1, -1), None, 1)
            field.follows_nodes = True
            return field, lambda t: np.ones(1)
        return cls(f, None, nodes, len(places) * n), amplitudes

    def turned(self, value: Array, turn: Array) -> Array:
        """Return the amplitudes as they are: the field is turned in `update`."""
        return value

    def update(self, turn: Array | None = None) -> None:
        """Make the field of the amplitudes; vectors turned by a matrix (3, 3) if that is given."""
        n, a = self._function.function_space.dofmap.bs, self._value
        dofs = a @ self._basis if self._basis is not None else a.reshape(-1, n)[self._places].ravel()
        if turn is not None and n > 1:
            dofs = (dofs.reshape(-1, n) @ turn[:n, :n].T).ravel()
        self._function.x.array[:] = dofs


def _columns(shapes: Shapes, n: int, x: Array, near: Array) -> Array:
    """Return the first n components of all shapes at places (m), (places, shapes, n)."""
    return np.moveaxis(first(shapes.along(x, near), n), 0, 1)


def first(values: Array, n: int) -> Array:
    """Return the first n components (…, n); the last one if it is one alone: a moment about axis 3, or a pressure."""
    return values[..., -1:] if n == 1 else values[..., :n]


def _space(structure: Any, family: str, degree: int, n: int) -> fem.FunctionSpace:
    return fem.functionspace(structure.mesh, (family, degree, (n,) if n > 1 else ()))


class LoadsOfStructure:
    """The loads of a structure (see `rotfem.structures.structure.Structure`).

    Attributes:
        load_constants: name of a load ↦ its amplitude, and what this is at time t (s).
    """

    #: Components of a force, and of a moment.
    dimension: ClassVar[int] = 3
    turns_in: ClassVar[int] = 3

    problem: Problem
    comm: Any
    mesh: Any
    V: fem.FunctionSpace
    k: Kinematics
    dx: Any
    tip: Any
    points: Points
    load_constants: dict[str, tuple[Amplitude, Callable[[float], Array]]]

    def position(self, q: Any) -> Any:
        """Return the axis or mid-surface r(q), frame components (m)."""
        raise NotImplementedError

    def turned(self, q: Any, v: Any) -> Any:
        """Return a vector that turns with the section, frame components; v is what it is at q = 0."""
        raise NotImplementedError

    def constant(self, value: npt.ArrayLike) -> fem.Constant:
        """Return a constant on the mesh: its value can change without a new compilation."""
        raise NotImplementedError

    def moment(self, name: str, m: Any, measure: Any, dead: bool) -> list[AppliedLoad]:
        """Return the work of a moment m (components of its amplitude) on the rotations."""
        raise NotImplementedError

    def place(self, point: Array) -> Any:
        """Return the place of a point (3,) of the mesh as functions of place are given it: x (m) along a beam."""
        return float(point[0])

    def cells_of(self, region: str) -> npt.NDArray[np.int32]:
        """Return the local cells of a region of the mesh; a structure without regions is not asked."""
        raise NotImplementedError

    @property
    def point_loads(self) -> tuple[PointLoads, ...]:
        """What works at points of the structure."""
        return self.problem.loads.at

    def loads(self) -> list[AppliedLoad]:
        """Return the work of the problem's non-zero loads, forces first; dead ones keep their direction in the frame.

        Raises:
            InputError: the structure lacks what one of them works on.
        """
        given = sorted(named(self.problem.loads).items(), key=lambda item: is_moment(item[0]))
        return [work for name, load in given if not load.is_zero for work in self.applied(name, load)]

    def applied(self, name: str, load: AnyLoad) -> list[AppliedLoad]:
        """Return the work of one load."""
        dead, measure, q = load.kind == "dead", self._measure(name), self.k.q
        if is_moment(name):
            return self.moment(name, self.amplitude(name, load, self.turns_in), measure, dead)
        f = self.amplitude(name, load, self.dimension)
        vector = ufl.as_vector([f[i] if i < self.dimension else 0 for i in range(3)])
        force = self.spread(name, vector if dead else self.turned(q, vector))
        return [AppliedLoad(name, force, self.position(q), measure, dead)]

    def _measure(self, name: str) -> Any:
        """Return what a load works on: the tip, a point, or the whole structure."""
        if name.startswith("at."):
            return self.points.measure(self.point_loads[int(name.split(".")[1])].x)
        return self.tip if name.startswith("tip") else self.dx

    def spread(self, name: str, load: Any) -> Any:
        """Return the density of a load on its measure: the load itself at a point and where it is a density already."""
        return load

    def amplitude(self, name: str, load: AnyLoad, size: int) -> Any:
        """Return a load in the forms, its first `size` components, and remember its amplitude."""
        made: Amplitude
        at: Callable[[float], Array] = load.at
        if isinstance(load, PlaceLoad):
            made, at = SpanField.of_place(self, load, size)
        elif load.is_uniform:
            made, at = Amplitude(self.constant(np.zeros(size))), lambda t: first(load.at(t), size)
        else:
            made = SpanField.of_shapes(self, load, size)
        made.dead = load.kind == "dead"
        self.load_constants[name] = (made, at)
        return made.vector

    def update_loads(self, turn: Array | None = None) -> None:
        """Make the fields of loads over the span of the amplitudes that have been set.

        Args:
            turn: matrix (3, 3) that turns those of dead loads, in a frame that does not turn with the hub.
        """
        for amplitude, _ in self.load_constants.values():
            amplitude.update(turn if amplitude.dead else None)
