"""What all structures share: space and unknowns, constants and fields of the forms, damping, forces, scales."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import default_scalar_type, fem
from mpi4py import MPI

from rotfem.errors import InputError, shown
from rotfem.mechanics.bodies import Body, Damping, Kinematics, RootSpring, Strain, Support
from rotfem.mechanics.loads import AppliedLoad, Load, PlaceLoad, Shapes, is_moment
from rotfem.mechanics.problem import Problem
from rotfem.numerics import forms
from rotfem.numerics.projection import summed
from rotfem.structures.mode_names import ModeName, Wave
from rotfem.structures.points import Points, locate
from rotfem.structures.reference_rotation import Turns
from rotfem.structures.section_fields import field_values

Array = npt.NDArray[np.float64]


def check_memory(
    key: str, value: object, nodes: float, components: int, dimension: int, comm: MPI.Comm, times: float = 1.0
) -> None:
    """Refuse a mesh whose matrices do not fit into memory."""
    unknowns = float(nodes) * components
    if unknowns < 1e5:  # nothing is asked of the system for what fits anywhere
        return
    # Bytes per unknown, component and dimension of the mesh, of what takes least, so that nothing is refused that fits:
    # modes of plates of 10⁵ to 10⁶ unknowns took 6.4 to 7.5 kB per unknown, on two processes together 18 to 20 kB;
    # planar beams of 4·10⁴ elements 3 kB (degrees 1 and 3). Errors of histories take more (docs/scaling.md).
    needed = times * 600 * (2.8 if comm.size > 1 else 1.0) * components * dimension * unknowns
    there = comm.allreduce(memory(), MPI.MIN) * len(set(comm.allgather(MPI.Get_processor_name())))
    if needed > there:
        why = f"makes {unknowns:.3g} unknowns, which need {needed / 1e9:.3g} GB or more; there are {there / 1e9:.3g} GB"
        raise InputError(key, value, f"{why}: take fewer elements, or set ROTFEM_MEMORY to the GB that may be used")


def memory() -> float:
    """Return the bytes that this machine lets a program have, or that the user says it may have."""
    given = os.environ.get("ROTFEM_MEMORY", "")
    if given:
        try:
            return 1e9 * float(given)
        except ValueError:
            raise InputError("ROTFEM_MEMORY", given, "must be a number of GB") from None
    machine = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    try:
        return min(machine, float(Path("/sys/fs/cgroup/memory.max").read_text()))
    except (OSError, ValueError):  # no such group, or one without a bound
        return machine


class PointValues:
    """Reads a blocked Lagrange function at a point: Σ_k φ_k q_k over the nodes of a cell that holds it.

    That of the nearest node if no cell does, as at a curved edge.

    Attributes:
        dofs: local numbers of the unknowns of those nodes that this process owns, (nodes, unknowns of a node).
        weights: φ_k of these nodes at the point.
    """

    def __init__(self, V: fem.FunctionSpace, point: Array):
        self._comm, nodes, size = V.mesh.comm, V.dofmap.index_map, V.dofmap.index_map_bs
        place, here = locate(V.mesh, list(point)), None
        if place is None:
            apart = np.linalg.norm(V.tabulate_dof_coordinates()[: nodes.size_local] - point, axis=1)
            nearest = float(apart.min(initial=np.inf)), self._comm.rank
            if nearest == min(self._comm.allgather(nearest)):
                here = nodes.local_to_global(np.array([apart.argmin()], dtype=np.int32)), np.ones(1)
        elif len(place[0]):
            shapes = V.element.basix_element.tabulate(0, place[1])[0, 0, :, 0]
            here = nodes.local_to_global(V.dofmap.cell_dofs(place[0][0])), np.round(shapes, 14)  # 0 and 1 at nodes
        numbers, weights = next(found for found in self._comm.allgather(here) if found is not None)
        local = nodes.global_to_local(numbers)
        own = (local >= 0) & (local < nodes.size_local) & (weights != 0.0)
        self.dofs, self.weights = local[own, None] * size + np.arange(size), weights[own]

    def __call__(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return the values (block size,) at the point of a local dof array of the space, or of its owned part."""
        return np.asarray(summed(self._comm, self.weights @ values[self.dofs]))

    def columns(self, length: int) -> Array:
        """Return the weights of the unknowns in these values, (length, block size), on one process."""
        out = np.zeros((length, self.dofs.shape[1]))
        out[self.dofs, np.arange(self.dofs.shape[1])] = self.weights[:, None]
        return out


# --- amplitudes of loads in the forms ---------------------------------------------------------------------------------

# The force or moment of a load in the forms is f = Σ_k a_k s_k (`rotfem.mechanics.loads`). Amplitudes of a uniform one
# are the components of a constant, those of one over the span the factors of shapes, whose sum is a field. A function
# of place has its values at the nodes as amplitudes.


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


def of_shapes(structure: Structure, load: Load, n: int) -> Amplitude:
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


def of_place(structure: Structure, load: PlaceLoad, n: int) -> Amplitude:
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


def _space(structure: Structure, family: str, degree: int, n: int) -> fem.FunctionSpace:
    return fem.functionspace(structure.mesh, (family, degree, (n,) if n > 1 else ()))


class Structure:
    """A discretised structure: blocked Lagrange functions on a mesh, clamped somewhere.

    A subclass makes the mesh, calls `discretise`, and gives positions, strains, bodies and loads.

    Attributes:
        mesh, V, k: mesh, space of the unknowns, and the unknowns with their rates.
        dx, dx_elastic: measures of full integration, and of that which keeps locking away.
        tip: measure of the end of the structure that tip forces work on.
        root: measure of the clamped end.
        clamped: local numbers of the nodes that are held in any direction.
        tip_values: reads the values at the tip.
        points: where loads or masses are at a point.
        load_constants: name of a load ↦ its amplitude in the forms.
    """

    type: ClassVar[str]
    planar: ClassVar[bool] = False
    #: Components of a force, and of a moment.
    dimension: ClassVar[int] = 3
    turns_in: ClassVar[int] = 3
    #: Places along it (m) of rows of tables that are no nodes.
    inner_rows: Array = np.empty(0)
    #: Names of the unknowns.
    components: ClassVar[tuple[str, ...]]
    #: Further unknowns of nodes, which are no components of the structure and exist at one node each: see `held`.
    extra: tuple[str, ...] = ()
    #: Normal of a plane that it may be symmetric about, 0 to 2 ↦ the components of motions in that plane.
    planes: ClassVar[dict[int, tuple[int, ...]]] = {}
    #: Whether such a plane is its middle surface, so that to first order its bending is apart from its stretching.
    is_flat: ClassVar[bool] = False
    #: Conjugates of the tip's components: inputs of the state-space model (a moment works on θ or alpha there).
    tip_inputs: ClassVar[tuple[str, ...]]
    #: Family of modes ↦ the components whose kinetic energy counts, and the one whose nodes are counted.
    families: ClassVar[dict[str, tuple[tuple[int, ...], int]]]
    #: Axis of a hinge at the root, 1 to 3 ↦ the component that turns in it.
    turns_of: ClassVar[dict[int, int]] = {}
    #: Strains whose force makes geometric stiffness in the prestressed linear theories, where not those of all do.
    prestress_strains: ClassVar[tuple[str, ...]]
    #: What makes geometric stiffness unless a problem says it: "axial" forces, or "all" forces and moments.
    prestress: ClassVar[str] = "axial"
    #: Strains whose stiffness may outweigh that of the others by so much that round-off of it spoils them.
    stiff: ClassVar[tuple[str, ...]] = ()

    k: Kinematics
    mesh: Any
    dx: Any
    dx_elastic: Any
    tip: Any
    root: Any
    points: Points
    clamped: npt.NDArray[np.int32]
    tip_values: PointValues
    length: float
    #: Radius of gyration of the section at the clamp, √(EI/EA) (m); 0 where there is none.
    radius: float = 0.0

    def __init__(self, problem: Problem, comm: MPI.Comm):
        self.problem, self.comm, self.data = problem, comm, problem.structure
        self.load_constants: dict[str, Amplitude] = {}
        #: Family ↦ its word in names of modes, where that is another one.
        self.words: dict[str, str] = {}
        #: Numbers of the components that are unknowns; the others are inactive, and zero.
        self.active = tuple(i for i, name in enumerate(self.components) if name not in problem.inactive)
        self.size = len(self.active) + len(self.extra)
        #: Section properties by name: a constant each where the section is uniform, a field each where it is not.
        self.section: dict[str, Any] = {}
        #: Single numbers that the forms contain, by name.
        self.scalars: dict[str, fem.Constant] = {}
        #: What finite rotations are counted from; None where they have no limit, or the theory none of large size.
        self.turns: Turns | None = None

    def discretise(self, mesh: Any, degree: int) -> None:
        """Make the space of blocked Lagrange functions of a degree, and the unknowns in it."""
        self.mesh = mesh
        self.V = fem.functionspace(mesh, element("Lagrange", mesh.basix_cell(), degree, shape=(self.size,)))
        q, v, a = (fem.Function(self.V, name=name) for name in "qva")
        self.k = self._kinematics((q, v, a, ufl.TestFunction(self.V)))

    def _kinematics(self, functions: tuple[Any, Any, Any, Any]) -> Kinematics:
        """Return q, v, a and δq with all components, made of functions of the active ones and zeros."""
        if len(self.active) == len(self.components):
            return Kinematics(*functions)
        places = {component: i for i, component in enumerate(self.active)}
        numbers = range(len(self.components))
        q, v, a, dq = (ufl.as_vector([f[places[i]] if i in places else 0 for i in numbers]) for f in functions)
        return Kinematics(q, v, a, dq, made_of=functions)

    @classmethod
    def is_symmetric(cls, data: Any, normal: int) -> bool:
        """Return whether the undeformed structure of these data is symmetric about one of its `planes`."""
        return False

    @cached_property
    def moves(self) -> npt.NDArray[np.bool_]:
        """Of every component whether it is a displacement; the others are rotations."""
        return np.array([name.startswith("u") for name in self.components])

    @cached_property
    def lever(self) -> Array:
        """Factors that make components displacements of a section's points (m): 1, of rotations `radius`."""
        return np.where(self.moves, 1.0, self.radius)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the unknowns of a node: of the active components, and further ones."""
        return (*(self.components[i] for i in self.active), *self.extra)

    def whole_values(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return all components of values (…, unknowns of a node), zeros for inactive ones."""
        if len(self.active) == len(self.components):
            return values[..., : len(self.components)]
        out = np.zeros((*values.shape[:-1], len(self.components)), dtype=values.dtype)
        out[..., self.active] = values
        return out

    def check_shared(self) -> None:
        """Refuse a mesh that leaves a process without cells or unknowns, where it would fail or wait for ever."""
        cells, nodes = self.mesh.topology.index_map(self.mesh.topology.dim), self.V.dofmap.index_map
        idle = self.comm.allreduce(int(min(cells.size_local, nodes.size_local) == 0))
        if idle == 0:
            return
        file = getattr(self.data, "mesh", None)
        key, value = ("structure.mesh", shown(file)) if file else ("mesh.elements", self.problem.mesh.elements)
        why = f"the mesh (cells: {cells.size_global}) cannot be shared by {self.comm.size} processes"
        raise InputError(key, value, f"{why}: {idle} would have nothing to do; start fewer, or refine it")

    def free_unknowns(self) -> int:
        """Return how many unknowns are not clamped, over all processes."""
        here = len(self.clamped_unknowns())
        return self.size * int(self.V.dofmap.index_map.size_global) - int(self.comm.allreduce(here))

    @property
    def hinges(self) -> dict[int, Any]:
        """Axis, 1 to 3, ↦ name, stiffness and damping of the turn that the root may make about it."""
        return getattr(self.data, "hinges", {})

    def springs(self) -> list[RootSpring]:
        """Return what holds the hinges; none here."""
        return []

    def supports(self, frame: Any) -> list[Support]:
        """Return the supports between the structure and the fixed frame; none here."""
        return []

    def couplings(self, frame: Any) -> list[Support]:
        """Return the couplings between parts of the structure; none here."""
        return []

    def support_forces(
        self, frame: Any, speed: float, q: npt.NDArray[Any], v: npt.NDArray[Any]
    ) -> dict[str, npt.NDArray[Any]]:
        """Return the forces of the structure on its supports; none here."""
        return {}

    def clamp_middle(self) -> Array:
        """Return the place that moments at the root are about, on the mesh, (3,) in m."""
        return np.zeros(3)

    @property
    def released(self) -> set[int]:
        """Numbers of the components that the clamp leaves free: turns in hinges."""
        return {self.turns_of[axis] for axis in self.hinges}

    def _clamped_components(self) -> list[int]:
        """Return which of the unknowns of a node the clamp holds."""
        free = self.released
        return [place for place, i in enumerate(self.active) if i not in free]

    def holds(self) -> list[tuple[npt.NDArray[np.int32], list[int]]]:
        """Return local nodes, and which of their unknowns are zero."""
        return [(self.clamped, self._clamped_components())]

    def clamped_unknowns(self, ghosts: bool = False) -> npt.NDArray[np.intp]:
        """Return the local numbers of the unknowns held, at owned nodes or at all, there without further unknowns."""
        found = [self._numbers(nodes, places, ghosts) for nodes, places in self.holds()]
        if self.extra and not ghosts:
            owned = self.V.dofmap.index_map.size_local
            other = enumerate(self.without_extra(), start=len(self.active))
            found += [(n[n < owned] * self.size + i).astype(np.intp) for i, n in other]
        return found[0] if len(found) == 1 else np.unique(np.concatenate([np.empty(0, dtype=np.intp), *found]))

    def without_extra(self) -> list[npt.NDArray[np.int32]]:
        """Return of each further unknown the local nodes that do not have it; of none here."""
        return []

    def hinged_unknowns(self) -> npt.NDArray[np.intp]:
        """Return the local numbers of those of owned nodes that the clamp leaves free, and of further unknowns."""
        constrained = self._clamped_components()
        free = self._numbers(self.clamped, [i for i in range(self.size) if i not in constrained])
        nodes = np.arange(self.V.dofmap.index_map.size_local if self.extra else 0, dtype=np.int32)
        return np.union1d(free, self._numbers(nodes, list(range(len(self.active), self.size)))).astype(np.intp)

    def _numbers(self, nodes: npt.NDArray[np.int32], places: list[int], ghosts: bool = False) -> npt.NDArray[np.intp]:
        if not ghosts:
            nodes = nodes[nodes < self.V.dofmap.index_map.size_local]
        return np.asarray((nodes[:, None] * self.size + np.array(places, dtype=np.intp)).ravel())

    def clamp_conditions(self) -> list[Any]:
        """Return the boundary conditions of the clamp."""
        whole = [nodes for nodes, places in self.holds() if len(places) == self.size]
        held = [(i, nodes) for nodes, places in self.holds() if len(places) < self.size for i in places]
        held += [(len(self.active) + i, nodes) for i, nodes in enumerate(self.without_extra())]
        zero = default_scalar_type(0.0)
        return [
            *(fem.dirichletbc(fem.Function(self.V), nodes) for nodes in whole),
            *(fem.dirichletbc(zero, nodes * self.size + i, self.V.sub(i)) for i, nodes in held),
        ]

    def stretch(self, strains: list[Strain]) -> Any:
        """Return an expression that is 1 where the structure is undeformed and at most 0 where it is inside out."""
        raise NotImplementedError

    def strains(self, measures: Callable[..., tuple[Any, ...]]) -> list[Strain]:
        """Return the strains of one theory's measures with the stiffness of the structure."""
        raise NotImplementedError

    def bodies(self, effects: Collection[str]) -> list[Body]:
        """Return all mass that is always there or that one of these effects brings, which it then names."""
        raise NotImplementedError

    # --- loads --------------------------------------------------------------------------------------------------

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

    # --- constants and fields -----------------------------------------------------------------------------------

    def constant(self, value: npt.ArrayLike) -> fem.Constant:
        """Return a constant on the mesh: its value can change without a new compilation."""
        return forms.constant(self.mesh, np.asarray(value, dtype=default_scalar_type))

    def scalar(self, name: str, value: float) -> fem.Constant:
        """Return the constant of a named number, one and the same at every call."""
        return self.scalars.setdefault(name, self.constant(value))

    # --- damping ------------------------------------------------------------------------------------------------

    def damping(self) -> Damping:
        """Return Kelvin–Voigt plus stiffness-proportional viscosity, the mass-proportional rate, and further models."""
        d = self.data.damping
        eta, a0 = (self.constant(c) if c > 0 else None for c in (d.viscosity, d.mass_rate))
        return Damping(eta, a0, {name: self.scalar(f"damping_{name}", c) for name, c in d.models.items()})

    # --- values -------------------------------------------------------------------------------------------------

    def scales(self) -> Array:
        """Return the natural size of every local unknown: length (m) for displacements, 1 for rotations."""
        nodes = self.V.dofmap.index_map.size_local + self.V.dofmap.index_map.num_ghosts
        return np.tile([self.length if name.startswith("u") else 1.0 for name in self.unknowns], nodes)

    def gather(self, values: npt.NDArray[Any]) -> tuple[Array, npt.NDArray[Any]]:
        """Return positions (n, 3) in m and values (n, components) of a local dof array at all nodes, on every rank."""
        owned = self.V.dofmap.index_map.size_local
        q = self.whole_values(values[: self.size * owned].reshape(-1, self.size))
        return self._points, q if self.comm.size == 1 else np.concatenate(self.comm.allgather(q))

    @cached_property
    def _points(self) -> Array:
        """Positions of all nodes, (n, 3) in m, on every rank."""
        x: Array = self.V.tabulate_dof_coordinates()[: self.V.dofmap.index_map.size_local]
        return x if self.comm.size == 1 else np.concatenate(self.comm.allgather(x))

    def nodes(self, values: npt.NDArray[Any]) -> tuple[dict[str, Array], npt.NDArray[Any]]:
        """Return (coordinates x, of a plate y, (n,) each in m; values (n, components)) at all nodes, on every rank."""
        x, q = self.gather(values)
        names = "xy"[: self.mesh.geometry.dim]
        return {name: x[self._order, i] for i, name in enumerate(names)}, q[self._order]

    @cached_property
    def _order(self) -> npt.NDArray[np.int64]:
        """The permutation that sorts all nodes by x, then y."""
        x, cell = self._points[:, : self.mesh.geometry.dim], 1e-9 * self.length  # closer nodes share a coordinate
        return np.asarray(np.lexsort(np.round(x.T[::-1] / cell)))

    def places(self, coordinates: dict[str, Array]) -> Array:
        """Return where points of the undeformed structure are in the frame, (n, 3) in m, by their coordinates."""
        x, zero = coordinates["x"], np.zeros(len(coordinates["x"]))
        root = getattr(self.data, "root_position", (self.data.hub_radius, 0.0, 0.0))
        return np.asarray(root + np.column_stack([x, coordinates.get("y", zero), zero]))

    def surface(self) -> npt.NDArray[np.int64] | None:
        """Return triangles between the nodes in their order, shape (m, 3), on every rank; None of a line."""
        return None

    def is_rigid(self, coordinates: dict[str, Array], values: Array) -> bool:
        """Return whether a shape (n, components) is that of a rigid body, but for 0.5 % of its largest displacement."""
        places, (u, turns) = self.places(coordinates), np.zeros((2, len(values), 3), dtype=complex)
        u[:, : np.sum(self.moves)] = values[:, self.moves]
        for axis, component in self.turns_of.items():
            turns[:, axis - 1] = values[:, component]
        strained = u - u[0] - np.cross(turns[0], places - places[0]), self.length * (turns - turns[0])
        return bool(np.max(np.abs(strained)) <= 5e-3 * max(np.max(np.abs(u)), self.length * np.max(np.abs(turns))))

    def mode_name(self, family: str, coordinates: dict[str, Array], values: Array) -> ModeName:
        """Return the name of a mode of a family, from its complex shape at the nodes (n, components)."""
        raise NotImplementedError

    def waves(self, coordinates: dict[str, Array], values: Array, axis: Array) -> list[Wave]:
        """Return how modes e^{iωt} precess about an axis, from their complex shapes (modes, nodes, components).

        Empty unless a rotor.
        """
        return []

    def oriented(self, values: Array) -> Array:
        """Return the components along the undeformed structure of nodal values (n, components, …), to name modes by."""
        return values

    def unresolved(self, x: npt.NDArray[Any]) -> float:
        """Return the part of a shape (owned unknowns) that cells of one degree less would not have; of beams none."""
        return 0.0

    def total(self, q: Array) -> Array:
        """Return q (local dof array) with rotations that are counted from the undeformed structure."""
        return q if self.turns is None else self.turns.total(q)

    def check_range(self, q: Array, time: float | None = None) -> None:
        """Refuse a state (local dof array) outside the range of the unknowns; there is none here."""
