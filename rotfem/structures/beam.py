"""Beams: what planar and spatial ones share, mesh, space, section, forces and node values; and the planar beam.

The planar beam has q = (u_1, u_2, alpha) along a_1 and is clamped at the hub.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, ClassVar

import numpy as np
import ufl
from basix.ufl import element
from dolfinx import fem, mesh
from mpi4py import MPI

from rotfem.along import ONE, apart
from rotfem.mechanics.bodies import Body, RootSpring, Strain
from rotfem.mechanics.loads import AppliedLoad
from rotfem.mechanics.problem import Problem
from rotfem.structures.mesh import beam_nodes, boundary_tags
from rotfem.structures.mode_names import WORDS, ModeName, in_phase, sign_changes
from rotfem.structures.points import Points
from rotfem.structures.section_fields import Valid, field_values, not_negative
from rotfem.structures.structure import Array, PointValues, Structure, check_memory


class Beam(Structure):
    """A discretised beam clamped at X = 0.

    The unknowns are blocked Lagrange functions of degree k; internal work is integrated with k Gauss points, which
    keeps shear and membrane locking away in the thin limit, inertia with k + 1.

    Args:
        problem: what is to be computed; its structure is a beam.
        comm: communicator the mesh is distributed over.
        rows: places of rows of tables along the beam, m; they are nodes where there are elements enough.
        nodes: places that must be nodes, m.
    """

    prestress_strains: ClassVar[tuple[str, ...]] = ("axial",)
    stiff: ClassVar[tuple[str, ...]] = ("axial", "shear", "shear_2", "shear_3", "section")

    def __init__(self, problem: Problem, comm: MPI.Comm, rows: tuple[float, ...], nodes: tuple[float, ...]):
        super().__init__(problem, comm)
        grid, s = problem.mesh, self.data
        root = getattr(s, "root_position", (s.hub_radius, 0.0, 0.0))
        self.length, self.hub_radius, self._section = s.length, root[0], s.section
        # A beam on a free hub, or of round sections, which have no edge, is no blade.
        blade = problem.motion.hub is None and not getattr(s, "has_round_sections", False)
        y, z = np.abs(problem.motion.axis[1:])
        self.words = {family: words[0 if blade else 1 + int(y > z)] for family, words in WORDS.items()}
        self.radius = self._radius()
        check_memory("mesh.elements", grid.elements, grid.elements * grid.degree + 1, self.size, 1, comm)
        #: Places along the beam where section, axis, loads or forces may change at once, m.
        places = apart((*nodes, *problem.loads.jumps), self.length)
        self.knots = apart((*rows, *places, *problem.loads.stations), self.length)
        if len(self.knots) >= grid.elements:  # properties and loads are projected (`rotfem.structures.section_fields`)
            self.inner_rows = np.array([x for x in self.knots if x not in places])
        ends = beam_nodes(self.length, grid.elements, places if len(self.inner_rows) else self.knots)
        interval = mesh.create_interval(comm, len(ends) - 1, [0.0, 1.0])  # which dolfinx refuses below 2e-16 m
        x = interval.geometry.x
        x[:, 0] = np.interp(x[:, 0], np.linspace(0.0, 1.0, len(ends)), ends)
        k = self.degree = grid.degree
        self.discretise(interval, k)
        reduced = 2 * k - 2 if grid.integration == "reduced" else 2 * k
        fixed = [at for name in ("masses", "supports", "couplings") for at in getattr(s, name, ())]
        points = [*problem.loads.places, *((at.x,) for at in fixed)]
        self.points = Points(self.mesh, points)
        dx = ufl.Measure("dx", self.mesh, subdomain_data=self.points.subdomains)
        self.dx_elastic, self.dx = (dx(metadata={"quadrature_degree": degree}) for degree in (reduced, 2 * k))
        near = [lambda p, x=x: np.abs(p[0] - x) < self.length * ONE for x in (self.length, 0.0)]
        at = boundary_tags(self.mesh, 0, near)
        self.tip, self.root = (ufl.ds(tag, domain=self.mesh, subdomain_data=at) for tag in (1, 2))
        self.clamped = fem.locate_dofs_topological(self.V, 0, at.find(2))
        self.tip_values = PointValues(self.V, np.array([self.length, 0.0, 0.0]))

    def _radius(self) -> float:
        """Return √(EI/EA) at the clamp, of the least of the bending stiffnesses, m; 0 of a beam without a section."""
        if self._section is None:
            return 0.0
        at = self._section.at(np.zeros(1))
        if "stiffness" in at:
            C = np.diag(np.asarray(at["stiffness"]).reshape(6, 6))
            return float(np.sqrt(min(C[4], C[5]) / C[0]))
        return float(np.sqrt(at["EI"][0] / at["EA"][0]))

    def root_turn(self, axis: int) -> Any:
        """Return the rotation at the root about an axis, 1 to 3, of the blade there: an expression, rad."""
        raise NotImplementedError

    def rigid_bodies(self) -> list[tuple[str, Any, Any]]:
        """Return name, body and measure of the masses at the tip and along the beam."""
        found = self.data.bodies.items()
        return [(name, body, self.tip if name == "tip" else self.points.measure((body.x,))) for name, body in found]

    def springs(self) -> list[RootSpring]:
        """Return what holds the hinges of the root."""
        found = self.hinges.items()
        return [
            RootSpring(
                self.root_turn(axis),
                self.scalar(f"{hinge.name}_stiffness", hinge.stiffness),
                self.scalar(f"{hinge.name}_damping", hinge.damping),
                self.root,
                axis,
            )
            for axis, hinge in found
        ]

    def stretch(self, strains: list[Strain]) -> Any:
        """Return 1 + Γ₁, Γ₁ the axial strain."""
        return 1 + next(s.value for s in strains if s.name == "axial")

    def section_strains(self, measures: Callable[..., tuple[Any, ...]]) -> Any:
        """Return the strains of a section as one vector, in the order of `rotfem.along.STRAINS`."""
        raise NotImplementedError

    def stored(self, values: Any) -> list[Strain]:
        """Return the strains, each with its stiffness, that make the stored energy of the strains of a section."""
        raise NotImplementedError

    def read_section(self, at: Callable[[Array], dict[str, Array]]) -> None:
        """Take the section properties of at(X), name ↦ values, into the forms."""
        for name in at(np.zeros(1)):

            def values(x: Array, name: str = name) -> Array:
                return at(x)[name]

            self.section[name] = self.profile(name, values)

    def at_sides(self, x: Array, near: Array) -> Array:
        """Return places x (m) of the span, those at a step of the section moved towards others, near them."""
        for step in self.data.section.steps:
            here = np.abs(x - step) < ONE * self.length
            x = np.where(here, step + np.sign(near - step) * 1e-2 * ONE * self.length, x)
        return x

    def profile(self, name: str, at: Callable[[Array], Array], valid: Valid | None = not_negative) -> Any:
        """Return at(X) as a constant where the section is uniform, else as a field."""
        if self._section.uniform:
            return self.constant(at(np.zeros(1))[0])
        return self.field(
            name, lambda x, near: at(self.at_sides(x, near)), 4, valid=valid
        )  # that of I where dimensions taper

    def linear_field(self, name: str, at: Callable[[Array], Array], size: int, valid: Valid | None = None) -> Any:
        """Return the field of at(X), (n, size), that is linear between rows; of values (n,) where the size is 0."""
        return self.field(
            name, lambda x, near: at(self.at_sides(x, near)), self.degree if len(self.inner_rows) else 1, size, valid
        )

    def field(
        self, name: str, at: Callable[[Array, Array], Any], degree: int, size: int = 0, valid: Valid | None = None
    ) -> fem.Function:
        """Return a discontinuous field of a degree (see `field_values`), with so many components, a scalar for 0."""
        cell = self.mesh.basix_cell()
        space = fem.functionspace(self.mesh, element("DG", cell, degree, shape=(size,) if size else ()))
        f = fem.Function(space, name=name)
        f.x.array[:] = field_values(at, self.inner_rows, min(self.degree, degree), space, valid).ravel()
        return f

    # --- values -------------------------------------------------------------------------------------------------

    def mode_name(self, family: str, coordinates: dict[str, Array], values: Array) -> ModeName:
        """Return the name of a mode shape (n, components) by its family and its number, one more than its nodes."""
        number = sign_changes(in_phase(self.oriented(values)[:, self.families[family][1]])) + 1
        return ModeName(self.words.get(family, family), number)


# --- the planar beam --------------------------------------------------------------------------------------------------


class PlanarBeam(Beam):
    """Discretised planar beam; all vectors are in frame components with a zero third one."""

    type = "planar_beam"
    planar = True
    turns_of: ClassVar = {3: 2}
    components = ("u1", "u2", "alpha")
    dimension, turns_in = 2, 1
    tip_inputs = ("tip_force_1", "tip_force_2", "tip_moment")
    families: ClassVar = {"axial": ((0,), 0), "lag": ((1, 2), 1)}

    def __init__(self, problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD):
        s = problem.structure
        super().__init__(problem, comm, s.knots, s.nodes)
        self.read_section(s.section.at)
        self.scalar("hub_radius", self.hub_radius)

    # --- kinematics ---------------------------------------------------------------------------------------------

    def position(self, q: Any) -> Any:
        """Return r = (R + X + u_1) a_1 + u_2 a_2, Simo & Vu-Quoc 1986 eq. (1a)."""
        X = ufl.SpatialCoordinate(self.mesh)[0]
        return ufl.as_vector((self.scalars["hub_radius"] + X + q[0], q[1], 0))

    def triad(self, q: Any) -> tuple[Any, Any]:
        """Return (t_1, t_2), the section axes turned by alpha, Simo & Vu-Quoc 1986 eq. (1b)."""
        c, s = ufl.cos(q[2]), ufl.sin(q[2])
        return ufl.as_vector((c, s, 0)), ufl.as_vector((-s, c, 0))

    def turned(self, q: Any, v: Any) -> Any:
        """Return v_1 t_1 + v_2 t_2."""
        t_1, t_2 = self.triad(q)
        return v[0] * t_1 + v[1] * t_2

    def root_turn(self, axis: int) -> Any:
        """Return the rotation at the root: alpha."""
        return self.k.q[2]

    def strains(self, measures: Callable[..., tuple[Any, ...]]) -> list[Strain]:
        """Return the strains of one theory's measures with this section's EA, GA_s and EI."""
        return self.stored(measures(self.k.q))

    def section_strains(self, measures: Callable[..., tuple[Any, ...]]) -> Any:
        """Return (Γ₁, Γ₂, κ)."""
        return ufl.as_vector(measures(self.k.q))

    def stored(self, values: Any) -> list[Strain]:
        """Return (Γ₁, Γ₂, κ) with EA, GA_s and EI."""
        stiffness = (self.section["EA"], self.section["GA"], self.section["EI"])
        names = ("axial", "shear", "bending")
        return [Strain(n, g, c, self.dx_elastic) for n, g, c in zip(names, values, stiffness, strict=True)]

    def bodies(self, effects: Collection[str]) -> list[Body]:
        """Return axis, section director, tip mass and its director, as the effects call for them."""
        q = self.k.q
        r, director = self.position(q), self.triad(q)[1]
        bodies = [Body(r, self.section["mass_per_length"], self.dx)]
        if "rotary_inertia" in effects:
            bodies.append(Body(director, self.section["rotary_inertia"], self.dx, False, "rotary_inertia"))
        return bodies + self._rigid_bodies() if "tip_mass" in effects else bodies

    def _rigid_bodies(self) -> list[Body]:
        """Return the masses at the tip and along the beam, and their directors."""
        out, q = [], self.k.q
        for name, body, at in self.rigid_bodies():
            x = self.position(q)
            if any(body.offset):
                arm = [self.scalar(f"{name}_offset_{j}", c) for j, c in enumerate(body.offset[:2], start=1)]
                x += self.turned(q, arm)
            if body.mass > 0:
                out.append(Body(x, self.scalar(f"{name}_mass", body.mass), at, True, "tip_mass"))
            if body.inertia > 0:
                inertia = self.scalar(f"{name}_inertia", body.inertia)
                out.append(Body(self.triad(q)[1], inertia, at, False, "tip_mass"))
        return out

    def moment(self, name: str, m: Any, measure: Any, dead: bool) -> list[AppliedLoad]:
        """Return the work of a moment about axis 3, on alpha: it is the same whether dead or follower."""
        return [AppliedLoad(name, m[0], self.k.q[2], measure)]
