"""The planar beam q = (u_1, u_2, alpha) along a_1, clamped at the hub: mesh, space, section, bodies, loads, probes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import default_scalar_type, fem, mesh
from mpi4py import MPI

from rotfem.kinematics import AppliedLoad, Body, Damping, Kinematics, Strain
from rotfem.scene import BeamMesh, Load, PlanarBeamStructure, Scene
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


def _in_plane(load: Load, t: float) -> Array:
    return load.at(t)[:2]


class PlanarBeam:
    """Discretised planar beam of a scene; all vectors are in frame components with a zero third one.

    Displacements are blocked Lagrange functions of degree k; internal work is integrated with k Gauss points, which
    keeps shear and membrane locking away in the thin limit, inertia with k + 1.

    Args:
        scene: a validated scene whose structure is a planar beam.
        comm: communicator the mesh is distributed over.
    """

    type = "planar_beam"
    planar = True
    prestressing = ("axial",)
    #: Conjugates of the tip's components: inputs of the state-space model.
    tip_inputs = ("tip_force_1", "tip_force_2", "tip_moment")
    #: Mode families: the components whose kinetic energy counts, and the one whose nodes are counted.
    families: ClassVar = {"axial": ((0,), 0), "lag": ((1, 2), 1)}
    components = ("u1", "u2", "alpha")

    def __init__(self, scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD):
        s = cast(PlanarBeamStructure, scene.structure)
        grid = cast(BeamMesh, scene.mesh)
        self.scene, self.comm, self.data = scene, comm, s
        self.length, self.hub_radius = s.length, s.hub_radius
        nodes = beam_nodes(s.length, grid.elements, s.section.breakpoints)
        self.mesh = mesh.create_interval(comm, len(nodes) - 1, [0.0, s.length])
        self.elements = len(nodes) - 1
        x = self.mesh.geometry.x
        x[:, 0] = np.interp(x[:, 0], np.linspace(0.0, s.length, len(nodes)), nodes)
        k = grid.degree
        self.V = fem.functionspace(self.mesh, element("Lagrange", self.mesh.basix_cell(), k, shape=(3,)))
        q, v, a = (fem.Function(self.V, name=name) for name in "qva")
        self.k = Kinematics(q, v, a, ufl.TestFunction(self.V))
        reduced = 2 * k - 2 if grid.integration == "reduced" else 2 * k
        self.dx_elastic = ufl.dx(self.mesh, metadata={"quadrature_degree": reduced})
        self.dx = ufl.dx(self.mesh, metadata={"quadrature_degree": 2 * k})
        tip = mesh.locate_entities_boundary(self.mesh, 0, lambda p: np.isclose(p[0], s.length))
        tags = mesh.meshtags(self.mesh, 0, tip, np.full(len(tip), 1, dtype=np.int32))
        self.ds_tip = ufl.ds(1, domain=self.mesh, subdomain_data=tags)
        root = mesh.locate_entities_boundary(self.mesh, 0, lambda p: np.isclose(p[0], 0.0))
        self.clamped = fem.locate_dofs_topological(self.V, 0, root)
        self.section = {name: self._property(name) for name in s.section.at(np.zeros(1))}
        #: Single numbers that the forms contain, by name.
        self.scalars = {"hub_radius": self.constant(s.hub_radius)}
        self.load_constants: dict[str, tuple[fem.Constant, Callable[[float], Array]]] = {}
        self.probe = Probe(self.V, np.array([s.length, 0.0, 0.0]))

    def constant(self, value: npt.ArrayLike) -> fem.Constant:
        """Return a constant on the mesh: its value can change without a new compilation."""
        return fem.Constant(self.mesh, np.asarray(value, dtype=default_scalar_type))

    def scalar(self, name: str, value: float) -> fem.Constant:
        """Return the constant of a named number of the scene, one and the same at every call."""
        return self.scalars.setdefault(name, self.constant(value))

    def _property(self, name: str) -> Any:
        section = self.data.section
        if section.uniform:
            return self.constant(section.at(np.zeros(1))[name][0])
        f = fem.Function(fem.functionspace(self.mesh, ("DG", TAPER_DEGREE)), name=name)
        f.interpolate(lambda x: section.at(x[0])[name])
        return f

    # --- kinematics ---------------------------------------------------------------------------------------------

    def position(self, q: Any) -> Any:
        """r = (R + X + u_1) a_1 + u_2 a_2, Simo & Vu-Quoc 1986 eq. (1a)."""
        X = ufl.SpatialCoordinate(self.mesh)[0]
        return ufl.as_vector((self.scalars["hub_radius"] + X + q[0], q[1], 0))

    def triad(self, q: Any) -> tuple[Any, Any]:
        """(t_1, t_2), the section axes turned by alpha, Simo & Vu-Quoc 1986 eq. (1b)."""
        c, s = ufl.cos(q[2]), ufl.sin(q[2])
        return ufl.as_vector((c, s, 0)), ufl.as_vector((-s, c, 0))

    def strains(self, measures: Callable[[Any], tuple[Any, ...]]) -> list[Strain]:
        """Return the strains of one theory's measures with this section's EA, GA_s and EI."""
        values = measures(self.k.q)
        stiffness = (self.section["EA"], self.section["GA"], self.section["EI"])
        names = ("axial", "shear", "bending")
        return [Strain(n, g, c, self.dx_elastic) for n, g, c in zip(names, values, stiffness, strict=True)]

    def bodies(self, effects: tuple[str, ...]) -> list[Body]:
        """Return the bodies the effects call for: axis, section director, tip mass and its director."""
        s, q = self.data, self.k.q
        r, director = self.position(q), self.triad(q)[1]
        bodies = [Body(r, self.section["mass_per_length"], self.dx)]
        if "rotary_inertia" in effects:
            bodies.append(Body(director, self.section["rotary_inertia"], self.dx, is_position=False))
        if "tip_mass" in effects and s.tip_mass > 0:
            bodies.append(Body(r, self.scalar("tip_mass", s.tip_mass), self.ds_tip))
        if "tip_mass" in effects and s.tip_inertia > 0:
            bodies.append(Body(director, self.scalar("tip_inertia", s.tip_inertia), self.ds_tip, is_position=False))
        return bodies

    def damping(self) -> Damping:
        """Return Kelvin–Voigt plus stiffness-proportional viscosity, and the mass-proportional rate."""
        d = self.data.damping
        eta, a0 = d.kelvin_voigt + d.rayleigh[1], d.rayleigh[0]
        return Damping(self.constant(eta) if eta > 0 else None, self.constant(a0) if a0 > 0 else None)

    def loads(self) -> list[AppliedLoad]:
        """Return the scene's non-zero loads; dead ones keep their direction in the frame, followers turn with t_i."""
        loads, q = self.scene.loads, self.k.q
        t_1, t_2 = self.triad(q)
        out = []
        for name, load, measure in (
            ("tip_force", loads.tip_force, self.ds_tip),
            ("distributed", loads.distributed, self.dx),
        ):
            if load is None or load.is_zero:
                continue
            f = self.add_load(name, 2, partial(_in_plane, load))
            dead = load.kind == "dead"
            force = ufl.as_vector((f[0], f[1], 0)) if dead else f[0] * t_1 + f[1] * t_2
            out.append(AppliedLoad(name, force, self.position(q), measure, dead))
        moment = loads.tip_moment
        if moment is not None and not moment.is_zero:
            m = self.add_load("tip_moment", 1, lambda t: np.ravel(moment.at(t))[-1:])
            out.append(AppliedLoad("tip_moment", m[0], q[2], self.ds_tip))
        return out

    def add_load(self, name: str, size: int, at: Callable[[float], Array]) -> fem.Constant:
        """Return the amplitude constant (size,) of a load and remember at(t), its value at time t (s)."""
        constant = self.constant(np.zeros(size))
        self.load_constants[name] = (constant, at)
        return constant

    def scales(self) -> Array:
        """Return the natural size of every local unknown: length (m) for displacements, 1 for the rotation."""
        nodes = self.V.dofmap.index_map.size_local + self.V.dofmap.index_map.num_ghosts
        return np.tile([self.length, self.length, 1.0], nodes)

    def nodes(self, values: Array) -> tuple[Array, Array]:
        """Return (X, q): positions (n,) in m, increasing, and q (n, 3) at all nodes of the beam, on every rank.

        Args:
            values: local dof array of q (or of the owned part of it).
        """
        owned = self.V.dofmap.index_map.size_local
        X = np.concatenate(self.comm.allgather(self.V.tabulate_dof_coordinates()[:owned, 0]))
        q = np.concatenate(self.comm.allgather(values[: 3 * owned].reshape(-1, 3)))
        order = np.argsort(X)
        return X[order], q[order]
