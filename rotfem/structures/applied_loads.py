"""What loads do to a structure: their work, and their amplitudes in the forms, constants and fields.

The force (or moment) of a load in the forms is f = Σ_k a_k s_k (`rotfem.mechanics.loads`). The amplitudes of a uniform
load are the components of a constant, those of a load over the span the factors of shapes, whose sum is a field. A
function of place has its values at the nodes as amplitudes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.mechanics.bodies import Kinematics
from rotfem.mechanics.loads import AppliedLoad, Load, PlaceLoad, Shapes, is_moment
from rotfem.mechanics.problem import Problem
from rotfem.numerics import forms
from rotfem.structures.points import Points
from rotfem.structures.section_fields import field_values

Array = npt.NDArray[np.float64]


class Amplitude:
    """The amplitudes of a load: the components of a constant of the forms, or factors of shapes whose sum is a field.

    Args:
        force: in the forms, the constant, or the field, a function blocked by the components.
        at: time (s) ↦ amplitudes.
        dead: whether it keeps its direction in the frame of the hub.
        dofs: amplitudes ↦ dofs of the field; None of a constant.

    Attributes:
        value: the amplitudes, the same on every process; they take effect by `update`.
        vector: the force in the forms.
    """

    def __init__(
        self, force: Any, at: Callable[[float], Array], dead: bool, dofs: Callable[[Array], Array] | None = None
    ):
        self._force, self.at, self.dead, self._dofs = force, at, dead, dofs
        self.value: Array = force.value if dofs is None else np.zeros_like(at(0.0))
        self.vector: Any = force if force.ufl_shape else ufl.as_vector([force])

    def turned(self, value: Array, turn: Array) -> Array:
        """Return the amplitudes of the turned vector (3, 3); of a field as they are: that is turned in `update`."""
        n = value.size
        return value if self._dofs is not None or n == 1 else np.asarray(turn[:n, :n] @ value)

    def update(self, turn: Array | None = None) -> None:
        """Compute a field from the amplitudes; turn vectors by a matrix (3, 3) if given."""
        if self._dofs is None:
            return
        n, dofs = self._force.function_space.dofmap.bs, self._dofs(self.value)
        if turn is not None and n > 1:
            dofs = (dofs.reshape(-1, n) @ turn[:n, :n].T).ravel()
        self._force.x.array[:] = dofs


def of_shapes(structure: Any, load: Load, n: int) -> Amplitude:
    """Return the amplitudes of the field f(x) = Σ_k a_k s_k(x) of the shapes of a load, with n components."""
    rows = structure.inner_rows
    degree = structure.V.element.basix_element.degree if len(rows) else 1
    f = fem.Function(_space(structure, "DG", degree, n))
    cells, parts = f.function_space.dofmap.list, []
    for shapes in (term.shapes for term in load.terms):

        def at(x: Array, near: Array, shapes: Shapes = shapes) -> Array:
            return np.moveaxis(first(shapes.along(x, near), n), 0, 1)

        values = field_values(at, rows, degree, f.function_space).reshape(cells.size, -1, n)
        if shapes.region:
            there = np.zeros(len(values), dtype=bool)
            there[cells[structure.cells_of(shapes.region)].ravel()] = True
            values[~there] = 0.0
        parts.append(np.moveaxis(values, 1, 0).reshape(values.shape[1], -1))
    basis: Array = np.concatenate(parts)
    return Amplitude(f, load.at, load.kind == "dead", lambda a: np.asarray(a @ basis))


def of_place(structure: Any, load: PlaceLoad, n: int) -> Amplitude:
    """Return the values at the nodes of the field through them; one amplitude, 1, where they do not change."""
    f = fem.Function(_space(structure, "Lagrange", structure.V.element.basix_element.degree, n))
    index, x = f.function_space.dofmap.index_map, f.function_space.tabulate_dof_coordinates()
    points = np.concatenate(structure.comm.allgather(x[: index.size_local]))
    nodes = index.local_to_global(np.arange(len(x), dtype=np.int32))
    places, dead = tuple(map(structure.place, points)), load.kind == "dead"

    def at_nodes(t: float) -> Array:
        return np.ravel(first(load.on(places, t).reshape(len(places), -1), n))

    def dofs(a: Array) -> Array:
        return np.ravel(a.reshape(-1, n)[nodes])

    if load.constant:
        once = dofs(at_nodes(0.0))
        return Amplitude(f, lambda t: np.ones(1), dead, lambda a: a[0] * once)
    return Amplitude(f, at_nodes, dead, dofs)


def first(values: Array, n: int) -> Array:
    """Return the first n components (…, n); the last one if it is one alone: a moment about axis 3, or a pressure."""
    return values[..., -1:] if n == 1 else values[..., :n]


def _space(structure: Any, family: str, degree: int, n: int) -> fem.FunctionSpace:
    return fem.functionspace(structure.mesh, (family, degree, (n,) if n > 1 else ()))


class Loaded:
    """The part of a structure that loads work on.

    Attributes:
        problem: with its loads.
        k: the unknowns with their rates.
        dx: measure of the whole structure.
        tip: measure of its end.
        points: where loads or masses are at a point.
        load_constants: name of a load ↦ its amplitude in the forms.
    """

    #: Components of a force, and of a moment.
    dimension: ClassVar[int] = 3
    turns_in: ClassVar[int] = 3

    k: Kinematics
    mesh: Any
    dx: Any
    tip: Any
    points: Points

    def __init__(self, problem: Problem):
        self.problem = problem
        self.load_constants: dict[str, Amplitude] = {}

    def position(self, q: Any) -> Any:
        """Return the axis or mid-surface r(q), frame components (m)."""
        raise NotImplementedError

    def turned(self, q: Any, v: Any) -> Any:
        """Return a vector that turns with the section, frame components; v is what it is at q = 0."""
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

    def loads(self) -> list[AppliedLoad]:
        """Return the work of the problem's non-zero loads, forces first; dead ones keep their direction."""
        given = sorted(self.problem.loads.named.items(), key=lambda item: is_moment(item[0]))
        return [work for name, load in given if not load.is_zero for work in self.applied(name, load)]

    def applied(self, name: str, load: Load) -> list[AppliedLoad]:
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
            return self.points.measure(self.problem.loads.places[int(name.split(".")[1])])
        return self.tip if name.startswith("tip") else self.dx

    def spread(self, name: str, load: Any) -> Any:
        """Return the density of a load on its measure: the load itself at a point and where it is a density already."""
        return load

    def amplitude(self, name: str, load: Load, size: int) -> Any:
        """Return a load in the forms, its first `size` components, and remember its amplitude."""
        if isinstance(load, PlaceLoad):
            made = of_place(self, load, size)
        elif load.is_uniform:
            constant = forms.constant(self.mesh, np.zeros(size))
            made = Amplitude(constant, lambda t: first(load.at(t), size), load.kind == "dead")
        else:
            made = of_shapes(self, load, size)
        self.load_constants[name] = made
        return made.vector

    def update_loads(self, turn: Array | None = None) -> None:
        """Make the fields of loads over the span of the amplitudes; a matrix (3, 3) turns dead loads."""
        for amplitude in self.load_constants.values():
            amplitude.update(turn if amplitude.dead else None)
