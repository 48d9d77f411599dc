"""The Mindlin plate q = (u_1, u_2, u_3, alpha_1, alpha_2) in the plane (a_1, a_2), held along edges.

Membrane force, shear force and moment are those of plane stress, N = h Q ε, V = k h G γ, M = (h³/12) Q κ. Membrane and
shear energy are integrated with 2k − 1, bending and inertia fully: the elements then do not lock in the thin limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.spatial import Delaunay, KDTree

from rotfem.along import ONE
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.bodies import Body, Kinematics, Strain
from rotfem.mechanics.loads import AppliedLoad, Load
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.strains import PlateGradients, director, triad
from rotfem.mechanics.theories import richest
from rotfem.numerics import forms
from rotfem.numerics.projection import with_ghosts
from rotfem.structures.mesh import PlateGrid, plate_grid
from rotfem.structures.mode_names import NEARLY, ROUND, Disk, ModeName, Wave, plate_mode_name
from rotfem.structures.points import Points
from rotfem.structures.reference_rotation import DirectorTurns
from rotfem.structures.section_fields import field_values
from rotfem.structures.structure import Array, PointValues, Structure, check_memory
from rotfem.users_functions import number_of


def plate_points(plate: Structure) -> Points:
    """Return the points of masses and loads of a plate."""
    data, applied = plate.data, list(plate.problem.loads.places)
    rows = {key: [row[:2] for row in getattr(data, key)] for key in ("point_masses", "point_supports")}
    points = Points(plate.mesh, [*rows["point_masses"], *rows["point_supports"], *applied])
    missing = points.missing
    if missing is None:
        return points
    why = f"({missing[0]:g}, {missing[1]:g}) is not on the plate"
    for key, places in rows.items():
        if missing in places:
            raise InputError(f"structure.{key}", list(getattr(data, key)[places.index(missing)]), why)
    raise InputError(f"loads.at.{applied.index(missing)}.x", list(missing), why)


@dataclass(frozen=True, kw_only=True)
class EdgeMoment(AppliedLoad):
    """A moment per length on the directors of an edge (N, frame components): it works on t×δt.

    Its part along t, about which a director has no rotation, does no work. With x = (alpha_2, −alpha_1, 0) the
    potential −M·x, if it is dead, is right as long as the plate bends about one direction.
    """

    director: Any

    def variation(self, k: Kinematics) -> Any:
        """Return t×δt."""
        return ufl.cross(self.director, k.variation(self.director))

    def rigid_turn(self, e: Any) -> Any:
        """Return the turn in a unit rigid turn about e, without its part along t."""
        return e - ufl.dot(e, self.director) * self.director


def properties(data: Any) -> dict[str, Any]:
    """Return name ↦ value of thickness (m), moduli (Pa), Poisson's ratio, density (kg/m³), and shear correction."""
    names = ("E1", "E2", "nu12", "G12", "G13", "G23") if data.is_orthotropic else ("E", "nu")
    values: dict[str, Any] = {name: getattr(data, name) for name in ("thickness", *names, "rho", "shear_correction")}
    return {name: values["G12"] if value is None else value for name, value in values.items()}


def over_place(data: Any, name: str, grid: PlateGrid, rows: Array, degree: int) -> fem.Function:
    """Return a property that varies: by region, along x (see `section_fields`), over r, or as a function says.

    What varies over r, or by a function, is that at the nodes of a field of the degree of the unknowns in each cell.
    """
    value = getattr(data, name)
    if isinstance(value, dict):
        f = fem.Function(fem.functionspace(grid.mesh, ("DG", 0)), name=name)
        for region, number in value.items():
            f.x.array[grid.regions.find(grid.region_names[region])] = number
        f.x.scatter_forward()
        return f
    if not callable(value) and getattr(value, "over", "x") == "x":
        f = fem.Function(fem.functionspace(grid.mesh, ("DG", degree if len(rows) else 1)), name=name)
        space, at = f.function_space, lambda x, near: data.at(name, x, near)
        f.x.array[:] = field_values(at, rows, degree, space, positive).ravel()
        return f
    f = fem.Function(fem.functionspace(grid.mesh, ("DG", degree)), name=name)
    x, cells = f.function_space.tabulate_dof_coordinates(), f.function_space.dofmap.list
    if callable(value):
        given = number_of(value, f"structure.{name}", name)
        f.x.array[:] = [given(*map(float, point[:2])) for point in x]
    else:
        middle = np.empty_like(x)
        middle[cells] = x[cells].mean(axis=1)[:, None]
        f.x.array[:] = data.at(name, np.linalg.norm(x, axis=1), np.linalg.norm(middle, axis=1))
    if len(bad := np.flatnonzero(f.x.array <= 0.0)) and not name.startswith("nu"):
        at = x[bad[0]]
        raise InputError(
            f"structure.{name}", float(f.x.array[bad[0]]), f"must be greater than 0, as at {at[0]:g}, {at[1]:g}"
        )
    return f


def positive(values: Array) -> bool:
    """Return whether all values are positive."""
    return bool(np.all(values > 0.0))


def plane_stress(p: Mapping[str, Any]) -> Any:
    """Return Q of σ = Q (ε_11, ε_22, 2ε_12), shape (3, 3), Pa, from the material's constants."""
    if "E" in p:
        E, nu = p["E"], p["nu"]
        return E / (1 - nu**2) * ufl.as_matrix([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    E1, E2, nu12 = p["E1"], p["E2"], p["nu12"]
    both = 1 - nu12**2 * E2 / E1
    coupling = nu12 * E2 / both
    return ufl.as_matrix([[E1 / both, coupling, 0], [coupling, E2 / both, 0], [0, 0, p["G12"]]])


def shear_moduli(p: Mapping[str, Any]) -> Any:
    """Return k G of the transverse shear stresses, shape (2, 2), Pa."""
    if "E" in p:
        return p["shear_correction"] * p["E"] / (2 * (1 + p["nu"])) * ufl.Identity(2)
    return p["shear_correction"] * ufl.as_matrix([[p["G13"], 0], [0, p["G23"]]])


#: Stiffness per length of what holds an edge that runs along no axis, times that of the plate over its thickness: the
#: layer along an edge that its shear bends is as wide as the plate is thick, so that this part of it is not held.
ASKEW = 1e4

#: Part of the energy that reduced integration does not see and is put back; all of it would stiffen the plate.
SEEN = 0.1


def _voigt(tensor: Any) -> Any:
    """Return (e_11, e_22, 2 e_12) of a symmetric tensor."""
    return ufl.as_vector((tensor[0, 0], tensor[1, 1], 2 * tensor[0, 1]))


class Plate(Structure):
    """Discretised plate.

    Args:
        problem: what is to be computed; its structure is a plate.
        comm: communicator the mesh is distributed over.

    Raises:
        InputError: a mesh file that is no mesh of a plate, elements that lock on it, masses off it, more processes
            than the mesh can be shared by.
    """

    type = "plate"
    components = ("u1", "u2", "u3", "alpha1", "alpha2")
    planes: ClassVar = {2: (0, 1)}
    is_flat = True
    prestress_strains: ClassVar = ("membrane", "membrane, full", "membrane, reduced")
    stiff: ClassVar = ("shear",)
    tip_inputs = ("tip_force_1", "tip_force_2", "tip_force_3", "tip_moment_alpha1", "tip_moment_alpha2")
    families: ClassVar = {"bending": ((2, 3, 4), 2), "in-plane": ((0, 1), 1)}

    def __init__(self, problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD):
        super().__init__(problem, comm)
        s, settings = self.data, problem.mesh
        if s.mesh is None:
            nodes = math.prod(n * settings.degree + 1 for n in settings.elements)
            check_memory("mesh.elements", list(settings.elements), nodes, self.size, 2, comm)
        self.grid: PlateGrid = plate_grid(problem, comm)
        cell = self.grid.mesh.topology.cell_name()
        k = settings.degree_on(cell)
        if (why := settings.locking_on(cell)) is not None:
            raise InputError("mesh.degree", k, why)
        self.discretise(self.grid.mesh, k)
        if s.mesh is not None:  # whose lines are where they are
            self.inner_rows = np.unique([*s.knots, *problem.loads.stations])
        self.check_shared()
        self.points = plate_points(self)
        subdomains = self.points.subdomains
        self.dx = ufl.dx(self.mesh, subdomain_data=subdomains, metadata={"quadrature_degree": 2 * k})
        reduced = (2 * k - 1 if cell == "quadrilateral" else 2 * k - 2) if settings.integration == "reduced" else 2 * k
        self.dx_elastic = ufl.dx(self.mesh, subdomain_data=subdomains, metadata={"quadrature_degree": reduced})
        self._hold()
        low, high = self._box()
        self.length = float(np.max(high - low))
        self._has_tip = "tip" in self.grid.curve_names
        self.tip = self.grid.along("tip") if self._has_tip else None
        self.tip_values = PointValues(self.V, self._tip_point(low, high))
        self._properties()
        h = self.section["thickness"]
        thickest = np.max(h.value if isinstance(h, fem.Constant) else h.x.array, initial=0.0)
        self.radius = float(comm.allreduce(float(thickest), MPI.MAX)) / math.sqrt(12.0)
        self.turns = DirectorTurns.of(self) if self.size == len(self.components) else None

    @classmethod
    def is_symmetric(cls, data: Any, normal: int) -> bool:
        """Return whether these data are symmetric about the middle surface, as those of any plate are."""
        return True

    # --- edges ------------------------------------------------------------------------------------------------------

    def _hold(self) -> None:
        """Find the edges that are held, which way they run, and their nodes."""
        grid, known = self.grid, self.grid.curve_names
        for name in self.data.edges:
            if name not in known:
                raise InputError(
                    "structure.edges", name, f"is no named edge of the plate; there are {', '.join(known)}"
                )
        self.edges = {name: edge for name, edge in self.data.holds.items() if name in known}
        self.edge_nodes = {n: fem.locate_dofs_topological(self.V, 1, grid.edges(n)) for n in self.edges}
        nodes = [n for name, n in self.edge_nodes.items() if self._zero(name)]
        self.clamped = np.unique(np.concatenate([np.empty(0, dtype=np.int32), *nodes]))

    def _along(self, name: str) -> int | None:
        """Return the axis, 0 or 1, that an edge runs along; None where along neither."""
        a, b = np.moveaxis(self.grid.ends(name)[..., :2], 1, 0)
        aside = np.max(np.abs(b - a) / np.linalg.norm(b - a, axis=1, keepdims=True), axis=0)
        return next((axis for axis in (0, 1) if aside[1 - axis] < ONE), None)

    def _zero(self, name: str) -> set[str]:
        """Return the components that are zero on an edge; on one along no axis springs do it (see `_springs`)."""
        edge, along = self.edges[name], self._along(name)
        zero = {"u1", "u2"} if edge.held_in_plane else set()
        if edge.kind == "symmetric":
            return set() if along is None else {f"u{2 - along}", f"alpha{2 - along}"}
        if edge.kind == "clamped":
            return {*zero, "u3", "alpha1", "alpha2"}
        if edge.kind == "elastic":
            return zero
        return {*zero, "u3"} | (
            {f"alpha{1 + along}"} if edge.kind == "simply_supported" and along is not None else set()
        )

    def holds(self) -> list[tuple[npt.NDArray[np.int32], list[int]]]:
        """Return the nodes of edges, and which of their unknowns are zero."""
        names, zero = [self.components[i] for i in self.active], {name: self._zero(name) for name in self.edges}
        of = {name: [i for i, component in enumerate(names) if component in zero[name]] for name in self.edges}
        return [(self.edge_nodes[name], places) for name, places in of.items() if places]

    def clamp_middle(self) -> Array:
        """Return the middle of all edges that are held, by their length, (3,) in m; the origin where none is."""
        ends = np.concatenate([np.zeros((0, 2, 3)), *map(self.grid.ends, self.edges)])
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        return np.asarray(lengths @ ends.mean(axis=1) / lengths.sum()) if len(ends) else np.zeros(3)

    def _springs(self) -> list[Strain]:
        """Return the springs of elastic edges and points, and those that hold edges along no axis (see `ASKEW`).

        These have as few points as the shear has: a tilt that is zero all along curved cells makes them too stiff.
        """
        h, Q, k = self.section["thickness"], plane_stress(self.section)[0, 0], self.V.element.basix_element.degree
        n, u, t, out = ufl.FacetNormal(self.mesh), self.k.q, self.director(self.k.q), list[Strain]()
        normal, along = ufl.as_vector((n[0], n[1], 0)), ufl.as_vector((-n[1], n[0], 0))
        for name, edge in self.edges.items():
            askew, springs = self._along(name) is None, list[tuple[Any, Any]]()
            if edge.kind == "elastic":
                stiffness = [self.scalar(f"edge_{name}_{n}", getattr(edge, n)) for n in ("stiffness", "rotation")]
                springs = list(zip((u[2], ufl.dot(t, normal)), stiffness, strict=True))
            elif edge.kind == "symmetric" and askew:
                springs = [(u[0] * n[0] + u[1] * n[1], ASKEW * Q), (ufl.dot(t, normal), ASKEW * Q * h**2 / 12)]
            elif edge.kind == "simply_supported" and askew:
                springs = [(ufl.dot(t, along), ASKEW * Q * h**2 / 12)]
            ds = self.grid.along(name)(metadata={"quadrature_degree": 2 * k - 3 if askew else 2 * k})
            out += [Strain(f"edge {name}", value, stiffness, ds) for value, stiffness in springs]
        for i, (x, y, stiffness) in enumerate(self.data.point_supports, start=1):
            value, at = self.scalar(f"point_support_{i}", stiffness), self.points.measure((x, y))
            out.append(Strain(f"point support {i}", u[2], value, at))
        return out

    # --- mesh -------------------------------------------------------------------------------------------------------

    def _box(self) -> tuple[Array, Array]:
        """Return the least and the largest coordinates of the mesh, shape (2,) each."""
        x = self.mesh.geometry.x[:, :2]
        low = x.min(axis=0) if len(x) else np.full(2, np.inf)
        high = x.max(axis=0) if len(x) else np.full(2, -np.inf)
        return np.min(self.comm.allgather(low), axis=0), np.max(self.comm.allgather(high), axis=0)

    def _tip_point(self, low: Array, high: Array) -> Array:
        """Return the middle of the edge "tip"; without one, the point of the plate farthest from the clamp."""
        if self.data.length is not None and not self.data.edges:
            return np.array([self.data.length, 0.0, 0.0])
        x = self.V.tabulate_dof_coordinates()
        if self._has_tip:
            return self._middle(*np.moveaxis(self.grid.ends("tip")[..., :2], 1, 0))
        held = np.concatenate(self.comm.allgather(x[self.clamped]))
        held = held if len(held) else np.array([[*(low + high) / 2, 0.0]])  # nothing is: farthest from the middle
        distance = KDTree(held).query(x)[0]
        best = int(np.argmax(distance)) if len(x) else 0
        candidates = self.comm.allgather((float(distance[best]), *map(float, x[best])) if len(x) else (-1.0, 0, 0, 0))
        return np.array(max(candidates)[1:])

    @staticmethod
    def _middle(a: Array, b: Array) -> Array:
        """Return the point of a curve, edges from a to b (n, 2), that is nearest to its centre of length, m."""
        length = np.linalg.norm(b - a, axis=1)
        centre = length @ (a + b) / (2 * length.sum())
        along = np.clip(np.sum((centre - a) * (b - a), axis=1) / length**2, 0.0, 1.0)
        points = a + along[:, None] * (b - a)
        return np.asarray(points[np.argmin(np.linalg.norm(points - centre, axis=1))])

    # --- section ----------------------------------------------------------------------------------------------------

    def _properties(self) -> None:
        """Make the constants and fields of thickness and material, and of the hub."""
        s, degree = self.data, self.V.element.basix_element.degree
        for name, value in properties(s).items():
            key = name if getattr(s, name) is not None else "G12"
            uniform = isinstance(value, float)
            self.section[name] = (
                self.constant(value) if uniform else over_place(s, key, self.grid, self.inner_rows, degree)
            )
        names_of = ("hub_radius", "hub_offset_2", "hub_offset_3")
        root = zip(names_of, s.root_position, strict=True)
        self._root = [self.scalar(name, c) if c != 0.0 or name == "hub_radius" else 0 for name, c in root]

    # --- kinematics -------------------------------------------------------------------------------------------------

    def position(self, q: Any) -> Any:
        """Return r = r_0 + (x_γ + u_γ) a_γ + u_3 a_3, Simo & Vu-Quoc 1986 section 5."""
        x = ufl.SpatialCoordinate(self.mesh)
        return ufl.as_vector([self._root[i] + (x[i] if i < 2 else 0) + q[i] for i in range(3)])

    def director(self, q: Any) -> Any:
        """Return t, to second order in linear theories, exact in the others."""
        return self.triad(q)[2] if not self.problem.theory.linear else director(PlateGradients(q).alpha, exact=False)

    def triad(self, q: Any) -> list[Any]:
        """Return (t_1, t_2, t), exact: those of alpha, turned by R where they are counted from a reference."""
        axes, R = triad(PlateGradients(q).alpha), None if self.turns is None else self.turns.rotation
        return list(axes) if R is None else [ufl.dot(R, t) for t in axes]

    def turned(self, q: Any, v: Any) -> Any:
        """Return v_1 t_1 + v_2 t_2 + v_3 t."""
        t = self.triad(q)
        return sum(v[i] * t[i] for i in range(3))

    def stretch(self, strains: list[Strain]) -> Any:
        """Return (r,1 × r,2)·t."""
        p = PlateGradients(self.k.q)
        return ufl.dot(ufl.cross(p.dr[:, 0], p.dr[:, 1]), self.triad(self.k.q)[2])

    def strains(self, measures: Callable[..., tuple[Any, ...]]) -> list[Strain]:
        """Return membrane strain, shear and curvature of one theory's measures with this plate's stiffnesses.

        Reduced integration does not see displacements like (1 − 3ξ²)(1 − 3η²) of neighbouring elements. So the
        membrane, its directors normal to it, is integrated fully in the linear theories, where it does not lock; in the
        others SEEN of its linear part is, and in all of them a part of the shear by u_3 that the bending stiffness
        bounds. What shear adds to the membrane, −½ γ_γ γ_β, has the points of the shear energy, which exceeds it.
        """
        q, counted = self.k.q, self.turns is not None and self.turns.rotation is not None
        membrane, shear, curvature = measures(q, self.director(q)) if counted else measures(q)
        linear, p = self.problem.theory.linear, PlateGradients(self.k.q)
        h, Q, kG = self.section["thickness"], plane_stress(self.section), shear_moduli(self.section)
        strains = [
            Strain("membrane", _voigt(membrane), h * Q, self.dx_elastic),
            Strain("shear", shear, h * kG, self.dx_elastic),
            Strain("bending", _voigt(curvature), h**3 / 12 * Q, self.dx),
            *self._springs(),
        ]
        if self.problem.mesh.integration == "full":
            return strains
        bounded = SEEN * h**3 / (h**2 + abs(ufl.JacobianDeterminant(self.mesh)))
        unseen = measures(ufl.as_vector((q[0], q[1], q[2], *p.dw)))[0] if linear else ufl.sym(p.du)
        in_plane = ("membrane", _voigt(unseen), (1 if linear else SEEN) * h * Q)
        for name, value, stiffness in [in_plane, ("shear", p.dw, bounded * kG)]:
            strains.append(Strain(f"{name}, full", value, stiffness, self.dx))
            strains.append(Strain(f"{name}, reduced", value, -stiffness, self.dx_elastic))
        return strains

    def bodies(self, effects: Collection[str]) -> list[Body]:
        """Return mid-surface, director, point and line masses, as the effects call for them."""
        h, rho, r = self.section["thickness"], self.section["rho"], self.position(self.k.q)
        bodies = [Body(r, rho * h, self.dx)]
        if "rotary_inertia" in effects:
            bodies.append(Body(self.director(self.k.q), rho * h**3 / 12, self.dx, False, "rotary_inertia"))
        if "tip_mass" not in effects:
            return bodies
        for i, (x, y, mass) in enumerate(self.data.point_masses, start=1):
            at = self.points.measure((x, y))
            bodies.append(Body(r, self.scalar(f"point_mass_{i}", mass), at, True, "tip_mass"))
        for name, mass in self.data.line_masses.items():
            bodies.append(Body(r, self.scalar(f"line_mass_{name}", mass), self._on_curve(name), True, "tip_mass"))
        return bodies

    def _on_curve(self, name: str) -> Any:
        key, known = "structure.line_masses", self.grid.curve_names
        if name not in known:
            raise InputError(key, name, f"is no named edge of the plate; there are {', '.join(known)}")
        measure = self.grid.along(name)
        self.mesh.topology.create_connectivity(1, 2)
        edges = self.grid.edges(name)
        cells = self.mesh.topology.connectivity(1, 2)
        inner = sum(len(cells.links(e)) > 1 for e in edges)
        if self.comm.allreduce(inner) > 0:
            raise InputError(key, name, "must be an edge of the plate's boundary")
        return measure

    # --- loads ------------------------------------------------------------------------------------------------------

    def applied(self, name: str, load: Load) -> list[AppliedLoad]:
        """Return the work of one load: tip force and moment are spread over the edge "tip"."""
        if name.startswith("tip") and not self._has_tip:
            why = 'needs a physical curve "tip" in the mesh, which it works on'
            raise InputError(f"loads.{name}", None, why)
        if name != "pressure":
            return super().applied(name, load)
        # p a_3 if dead, p r,1 × r,2 per undeformed area if follower
        r, p, dead = PlateGradients(self.k.q).dr, self.amplitude("pressure", load, 1)[0], load.kind == "dead"
        normal = ufl.as_vector((0, 0, 1)) if dead else ufl.cross(r[:, 0], r[:, 1])
        return [AppliedLoad("pressure", p * normal, self.position(self.k.q), self.dx, dead)]

    def moment(self, name: str, m: Any, measure: Any, dead: bool) -> list[AppliedLoad]:
        """Return what a moment of the tip is on its edge: one on its directors, and a couple of forces in the plane.

        A director has no rotation about itself: the third component of the moment is the couple, e_3×(X − X_c) in
        direction and growing with the distance from the middle X_c of the edge.
        """
        q, alpha, x = self.k.q, PlateGradients(self.k.q).alpha, ufl.SpatialCoordinate(self.mesh)
        tilting = ufl.as_vector((m[0], m[1], 0))
        density = self.spread(name, tilting if dead else self.turned(q, tilting))
        if self.turns is not None and self.turns.before is not None:
            alpha = alpha + PlateGradients(self.turns.before).alpha
        about, director = ufl.as_vector((alpha[1], -alpha[0], 0)), self.director(q)
        length = self._along_tip(self.constant(1.0))
        middle = [self._along_tip(x[i]) / length for i in range(2)]
        arm = ufl.as_vector([x[i] - self.scalar(f"tip_middle_{i + 1}", middle[i]) for i in range(2)])
        inertia = self.scalar("tip_inertia", self._along_tip(ufl.dot(arm, arm)))
        couple = m[2] * (ufl.as_vector((-arm[1], arm[0], 0)) / inertia)  # per length
        return [
            EdgeMoment(name, density, about, measure, dead, director=director),
            AppliedLoad(name, couple if dead else self.turned(q, couple), self.position(q), measure, dead),
        ]

    def place(self, point: Array) -> tuple[float, float]:
        """Return (x, y) of a point (3,) of the mesh, m."""
        return float(point[0]), float(point[1])

    def cells_of(self, region: str) -> npt.NDArray[np.int32]:
        """Return the local cells of a region of the mesh."""
        return np.asarray(self.grid.regions.find(self.grid.region_names[region]), dtype=np.int32)

    def spread(self, name: str, load: Any) -> Any:
        """Return a load of the tip over the length of its edge."""
        if not name.startswith("tip"):
            return load
        if "tip_length" not in self.scalars:
            self.scalar("tip_length", self._along_tip(self.constant(1.0)))
        return load / self.scalars["tip_length"]

    def _along_tip(self, density: Any) -> float:
        """Return the integral of a density over the edge "tip"."""
        here = float(fem.assemble_scalar(forms.form(density * self.tip)))
        return float(self.comm.allreduce(here))

    # --- values -----------------------------------------------------------------------------------------------------

    def ordered(self, values: Array) -> Array:
        """Return values at the nodes of this process (owned, …) as those of all in the order of `nodes`."""
        return np.asarray(np.concatenate(self.comm.allgather(values))[self._order])

    def surface(self) -> npt.NDArray[np.int64]:
        """Return triangles between the nodes in the order of `nodes`, shape (m, 3), on every rank."""
        dofmap, tdim = self.V.dofmap, self.mesh.topology.dim
        cells = dofmap.list[: self.mesh.topology.index_map(tdim).size_local]
        pattern = Delaunay(self.V.element.basix_element.points).simplices  # of one cell, between its nodes
        here = dofmap.index_map.local_to_global(cells[:, pattern].reshape(-1).astype(np.int32)).reshape(-1, 3)
        # The nodes that `gather` returns are in the order of their global numbers.
        triangles: npt.NDArray[np.int64] = np.concatenate(self.comm.allgather(here))
        place = np.empty(dofmap.index_map.size_global, dtype=np.int64)
        place[self._order] = np.arange(len(place))
        return place[triangles]

    @cached_property
    def _outline(self) -> Disk:
        x, _ = self.gather(np.zeros(self.V.dofmap.index_map.size_local * self.size))
        return Disk.of(x[self._order, 0], x[self._order, 1], self.surface())

    @property
    def disk(self) -> Disk | None:
        """Nodes of a round plate; None of others."""
        return self._outline if self._outline.off <= ROUND else None

    @property
    def doubt(self) -> str:
        """What is said of a plate that is nearly round, or of fibres far stiffer than what joins them; "" of others."""
        if ROUND < self._outline.off <= NEARLY:
            off = f"its outline is {100 * self._outline.off:.2g} % off round, more than {100 * ROUND:g} %"
            return (
                f"the plate is nearly a disk, but {off}: its modes are named as a plate's, without synchronous speeds"
            )
        uniform = all(isinstance(getattr(self.data, name), float) for name in ("E1", "E2", "G12", "rho"))
        return self._of_strips() if uniform else ""

    def _of_strips(self) -> str:
        """Return which modes in the plane the mesh has no waves for; "" of most materials.

        Strips along the fibres, x, bend against each other without shear, u_2 = f(x) G,y and u_1 = −f,x G. With
        ∫ f,xx² = k⁴ ∫ f² their G has E_2 G,yyyy + ρ ω² G,yy + E_1 k⁴ G = 0. At a free edge, where it dies away in waves
        of 2π (E_2/E_1)^¼/k, ρ ω² is k² √(E_1 E_2). A cantilever's first k is 1.8751/L.
        """
        s, across = self.data, int(self.data.E1 >= self.data.E2)
        low, high = self._box()
        k, E = 1.8751 / float(high[1 - across] - low[1 - across]), float(np.sqrt(s.E1 * s.E2))
        wave = 2 * np.pi / k * (min(s.E1, s.E2) / max(s.E1, s.E2)) ** 0.25
        x = self.mesh.geometry.x[self.mesh.geometry.dofmap, across]
        widest = self.comm.allreduce(float(np.ptp(x, axis=1).max(initial=0.0)), op=MPI.MAX)
        if s.G12 < E or wave > 2 * widest:
            return ""
        return (
            f"coarse: from about {k * np.sqrt(E / s.rho):.3g} rad/s on strips along fibres bend in the plane, in "
            f"waves of {wave:.2g} m across them, which cells of {widest:.2g} m do not have"
        )

    def mode_name(self, family: str, coordinates: dict[str, Array], values: Array) -> ModeName:
        """Return the name of a mode by its nodal lines, circles or diameters (see `plate_mode_name`)."""
        cantilever = list(self.edges) == ["clamped"] and self.edges["clamped"].kind == "clamped"
        return plate_mode_name(family, coordinates, values[:, self.families[family][1]], self.disk, cantilever)

    def is_rigid(self, coordinates: dict[str, Array], values: Array) -> bool:
        """Return whether the displacements of a shape are those of a rigid body (see `Structure.is_rigid`)."""
        places, u = self.places(coordinates), np.zeros((len(values), 3), dtype=complex)
        u[:, : np.sum(self.moves)] = values[:, self.moves]
        motions = [np.broadcast_to(e, places.shape) for e in np.eye(3)] + [np.cross(e, places) for e in np.eye(3)]
        basis = np.stack([motion.ravel() for motion in motions], axis=1)
        rest = u.ravel() - basis @ np.linalg.lstsq(basis, u.ravel(), rcond=None)[0]
        return bool(np.max(np.abs(rest)) <= 5e-3 * np.max(np.abs(u)))

    def waves(self, coordinates: dict[str, Array], values: Array, axis: Array) -> list[Wave]:
        """Return how modes travel around a disk; empty of other plates."""
        return [] if self.disk is None else [self.disk.wave(w, axis[2]) for w in values[..., 2]]

    def unresolved(self, x: npt.NDArray[Any]) -> float:
        """Return the part of a shape (owned unknowns) that cells of one degree less would not have, of its squares."""
        element, owned = self.V.element.basix_element, self.mesh.topology.index_map(2).size_local
        points, weights = basix.make_quadrature(element.cell_type, 2 * element.degree)
        less = basix.create_element(
            basix.ElementFamily.P, element.cell_type, element.degree - 1, element.lagrange_variant
        )
        whole, part = (np.sqrt(weights)[:, None] * e.tabulate(0, points)[0, :, :, 0] for e in (element, less))
        basis = np.linalg.qr(part)[0]
        nodes = with_ghosts(self.V, x[: len(x) - len(x) % self.size]).reshape(-1, self.size)[:, self.moves]
        shapes = nodes[self.V.dofmap.list[:owned]]
        both = [
            np.sum(np.abs(np.einsum("pn,cni->cpi", A, shapes)) ** 2) for A in (whole - basis @ (basis.T @ whole), whole)
        ]
        left, all_of_it = self.comm.allreduce(np.array(both))
        return float(left / all_of_it)

    def check_range(self, q: Array, time: float | None = None) -> None:
        """Refuse a state whose director has come to the pole of its angles, where these have no reference."""
        if self.turns is not None or self.size < len(self.components):
            return
        owned, limit = self.V.dofmap.index_map.size_local, DirectorTurns.limit
        tilt = np.abs(q[: self.size * owned].reshape(-1, self.size)[:, 4])
        worst = self.comm.allreduce(float(tilt.max(initial=0.0)), op=MPI.MAX)
        if worst > limit:
            what = (
                f"the plate has turned about direction 1 by {worst:.3g} rad; {self.problem.theory.name} ends at {limit}"
            )
            raise ComputationError(what, time, f'a smaller load, or model.theory = "{richest().name}"')
