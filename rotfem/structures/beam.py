"""What planar and spatial beams share: mesh, space, section and load constants, forces, damping, node values."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import default_scalar_type, fem, mesh
from mpi4py import MPI

from rotfem.kinematics import AppliedLoad, Damping, Kinematics
from rotfem.scene import BeamMesh, Load, PlanarBeamStructure, Scene, SpatialBeamStructure
from rotfem.structures.probe import Probe

Array = npt.NDArray[np.float64]

#: Polynomial degree that holds any section property of linearly tapered dimensions (I of a tube: fourth degree).
TAPER_DEGREE = 4


def beam_nodes(length: float, elements: int, knots: tuple[float, ...]) -> Array:
    """Return elements + 1 node positions on [0, length], evenly spaced between knots that are all nodes (m)."""
    stations = np.array([0.0, *knots, length])
    if len(stations) - 1 > elements:
        elements = len(stations) - 1
    share = np.diff(stations) / length * elements
    counts = np.maximum(1, np.floor(share).astype(int))
    while counts.sum() < elements:
        counts[np.argmax(share / counts)] += 1
    while counts.sum() > elements:
        counts[np.argmin(np.where(counts > 1, share / counts, np.inf))] -= 1
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(stations[:-1], stations[1:], counts, strict=True)]
    return np.concatenate([*pieces, [length]])


def _first(load: Load, n: int, t: float) -> Array:
    return load.at(t)[:n]


class Beam:
    """A discretised beam clamped at X = 0.

    The unknowns are blocked Lagrange functions of degree k; internal work is integrated with k Gauss points, which
    keeps shear and membrane locking away in the thin limit, inertia with k + 1.

    Args:
        scene: a validated scene.
        structure: its [structure] table.
        comm: communicator the mesh is distributed over.
        knots: places along the beam that must be nodes, m.
    """

    type: ClassVar[str]
    planar: ClassVar[bool]
    #: Names of the unknowns.
    components: ClassVar[tuple[str, ...]]
    #: Components of a force.
    dimension: ClassVar[int]
    #: Strains whose force makes geometric stiffness in the prestressed linear theories.
    prestressing: ClassVar[tuple[str, ...]] = ("axial",)

    def __init__(
        self,
        scene: Scene,
        structure: PlanarBeamStructure | SpatialBeamStructure,
        comm: MPI.Comm,
        knots: tuple[float, ...],
    ):
        grid = scene.mesh
        assert isinstance(grid, BeamMesh)
        self.scene, self.comm = scene, comm
        self.length, self.hub_radius = structure.length, structure.hub_radius
        self._section, self._damping = structure.section, structure.damping
        nodes = beam_nodes(self.length, grid.elements, knots)
        self.mesh = mesh.create_interval(comm, len(nodes) - 1, [0.0, self.length])
        self.elements = len(nodes) - 1
        x = self.mesh.geometry.x
        x[:, 0] = np.interp(x[:, 0], np.linspace(0.0, self.length, len(nodes)), nodes)
        k, self.size = grid.degree, len(self.components)
        self.V = fem.functionspace(self.mesh, element("Lagrange", self.mesh.basix_cell(), k, shape=(self.size,)))
        q, v, a = (fem.Function(self.V, name=name) for name in "qva")
        self.k = Kinematics(q, v, a, ufl.TestFunction(self.V))
        reduced = 2 * k - 2 if grid.integration == "reduced" else 2 * k
        self.dx_elastic = ufl.dx(self.mesh, metadata={"quadrature_degree": reduced})
        self.dx = ufl.dx(self.mesh, metadata={"quadrature_degree": 2 * k})
        tip = mesh.locate_entities_boundary(self.mesh, 0, lambda p: np.isclose(p[0], self.length))
        tags = mesh.meshtags(self.mesh, 0, tip, np.full(len(tip), 1, dtype=np.int32))
        self.ds_tip = ufl.ds(1, domain=self.mesh, subdomain_data=tags)
        root = mesh.locate_entities_boundary(self.mesh, 0, lambda p: np.isclose(p[0], 0.0))
        self.clamped = fem.locate_dofs_topological(self.V, 0, root)
        #: Section properties by name: a constant each where the section is uniform, a field each where it is not.
        self.section: dict[str, Any] = {}
        #: Single numbers that the forms contain, by name.
        self.scalars: dict[str, fem.Constant] = {}
        self.load_constants: dict[str, tuple[fem.Constant, Callable[[float], Array]]] = {}
        self.probe = Probe(self.V, np.array([self.length, 0.0, 0.0]))

    def position(self, q: Any) -> Any:
        """Return the axis r(q), frame components (m)."""
        raise NotImplementedError

    def turned(self, q: Any, v: Any) -> Any:
        """Return a vector that turns with the section, frame components; v is what it is at q = 0."""
        raise NotImplementedError

    # --- constants and fields -----------------------------------------------------------------------------------

    def constant(self, value: npt.ArrayLike) -> fem.Constant:
        """Return a constant on the mesh: its value can change without a new compilation."""
        return fem.Constant(self.mesh, np.asarray(value, dtype=default_scalar_type))

    def scalar(self, name: str, value: float) -> fem.Constant:
        """Return the constant of a named number of the scene, one and the same at every call."""
        return self.scalars.setdefault(name, self.constant(value))

    def profile(self, name: str, at: Callable[[Array], Array]) -> Any:
        """Return at(X) as a constant where the section is uniform, else as a field."""
        if self._section.uniform:
            return self.constant(at(np.zeros(1))[0])
        f = fem.Function(fem.functionspace(self.mesh, ("DG", TAPER_DEGREE)), name=name)
        f.interpolate(lambda x: at(x[0]))
        return f

    # --- damping and loads --------------------------------------------------------------------------------------

    def damping(self) -> Damping:
        """Return Kelvin–Voigt plus stiffness-proportional viscosity, and the mass-proportional rate."""
        d = self._damping
        eta, a0 = d.kelvin_voigt + d.rayleigh[1], d.rayleigh[0]
        return Damping(self.constant(eta) if eta > 0 else None, self.constant(a0) if a0 > 0 else None)

    def forces(self) -> list[AppliedLoad]:
        """Return the scene's non-zero forces; dead ones keep their direction in the frame, followers turn."""
        loads, q = self.scene.loads, self.k.q
        out = []
        for name, load, measure in (
            ("tip_force", loads.tip_force, self.ds_tip),
            ("distributed", loads.distributed, self.dx),
        ):
            if load is None or load.is_zero:
                continue
            f = self.add_load(name, self.dimension, partial(_first, load, self.dimension))
            dead = load.kind == "dead"
            vector = ufl.as_vector([f[i] if i < self.dimension else 0 for i in range(3)])
            force = vector if dead else self.turned(q, vector)
            out.append(AppliedLoad(name, force, self.position(q), measure, dead))
        return out

    def add_load(self, name: str, size: int, at: Callable[[float], Array]) -> fem.Constant:
        """Return the amplitude constant (size,) of a load and remember at(t), its value at time t (s)."""
        constant = self.constant(np.zeros(size))
        self.load_constants[name] = (constant, at)
        return constant

    # --- values -------------------------------------------------------------------------------------------------

    def scales(self) -> Array:
        """Return the natural size of every local unknown: length (m) for displacements, 1 for rotations."""
        nodes = self.V.dofmap.index_map.size_local + self.V.dofmap.index_map.num_ghosts
        return np.tile([self.length if name.startswith("u") else 1.0 for name in self.components], nodes)

    def nodes(self, values: Array) -> tuple[Array, Array]:
        """Return (X, q): positions (n,) in m, increasing, and q (n, components) at all nodes, on every rank.

        Args:
            values: local dof array of q (or of the owned part of it).
        """
        owned = self.V.dofmap.index_map.size_local
        X = np.concatenate(self.comm.allgather(self.V.tabulate_dof_coordinates()[:owned, 0]))
        q = np.concatenate(self.comm.allgather(values[: self.size * owned].reshape(-1, self.size)))
        order = np.argsort(X)
        return X[order], q[order]

    def oriented(self, values: Array) -> Array:
        """Return the components along the undeformed beam of nodal values (n, components, …): modes are named by it."""
        return values

    def check_range(self, q: Array, time: float | None = None) -> None:
        """Refuse a state (local dof array) outside the range of the unknowns; there is none here.

        Raises:
            ComputationError: never here; see the spatial beam.
        """
