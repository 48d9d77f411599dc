"""The planar beam q = (u_1, u_2, alpha) along a_1, clamped at the hub: section, strains, bodies, loads."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, ClassVar

import ufl
from mpi4py import MPI

from rotfem.mechanics.bodies import AppliedLoad, Body, Strain
from rotfem.mechanics.problem import Problem
from rotfem.structures.beam import Beam


class PlanarBeam(Beam):
    """Discretised planar beam; all vectors are in frame components with a zero third one."""

    type = "planar_beam"
    planar = True
    turns_of: ClassVar = {3: 2}
    components = ("u1", "u2", "alpha")
    dimension, turns_in = 2, 1
    #: Conjugates of the tip's components: inputs of the state-space model.
    tip_inputs = ("tip_force_1", "tip_force_2", "tip_moment")
    #: Mode families: the components whose kinetic energy counts, and the one whose nodes are counted.
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
        s, q = self.data, self.k.q
        r, director = self.position(q), self.triad(q)[1]
        bodies = [Body(r, self.section["mass_per_length"], self.dx)]
        if "rotary_inertia" in effects:
            bodies.append(Body(director, self.section["rotary_inertia"], self.dx, False, "rotary_inertia"))
        if "tip_mass" in effects and s.tip_mass > 0:
            bodies.append(Body(r, self.scalar("tip_mass", s.tip_mass), self.tip, True, "tip_mass"))
        if "tip_mass" in effects and s.tip_inertia > 0:
            bodies.append(Body(director, self.scalar("tip_inertia", s.tip_inertia), self.tip, False, "tip_mass"))
        return bodies + self._point_masses() if "tip_mass" in effects else bodies

    def _point_masses(self) -> list[Body]:
        """Return the masses along the beam and their directors."""
        out, q = [], self.k.q
        for i, body in enumerate(self.masses):
            at, name = self.points.measure((body.x,)), f"masses_{i}"
            arm = [self.scalar(f"{name}_offset_{j}", c) for j, c in enumerate(body.offset[:2], start=1)]
            r = self.position(q)
            x = r + self.turned(q, arm) if any(body.offset) else r
            if body.mass > 0:
                out.append(Body(x, self.scalar(name, body.mass), at, True, "tip_mass"))
            if body.inertia > 0:
                inertia = self.scalar(f"{name}_inertia", body.inertia)
                out.append(Body(self.triad(q)[1], inertia, at, False, "tip_mass"))
        return out

    def moment(self, name: str, m: Any, measure: Any, dead: bool) -> list[AppliedLoad]:
        """Return the work of a moment about axis 3, on alpha: it is the same whether dead or follower."""
        return [AppliedLoad(name, m[0], self.k.q[2], measure)]
