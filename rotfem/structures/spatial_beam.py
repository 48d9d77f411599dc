"""The spatial beam q = (u, θ): axis and section triad in space, with pretwist, precone, hub offset and tip body.

The section axes are t_i = Λ(θ) t_i⁰ (Simo & Vu-Quoc 1986, Comput. Meth. Appl. Mech. Eng. 58, 79), θ the rotation vector
relative to the undeformed triad t_i⁰, all in components of the rotating frame. t_1⁰ is the undeformed axis
e = (cos β, 0, sin β), β the precone; t_2⁰ and t_3⁰ are turned about it by the pretwist. The strains are the components
along t_i⁰ of

    Γ = Λᵀ (e + u') − e,        K = T(θ) θ' = axial(Λᵀ Λ'),

since t⁰ᵀ Λᵀ (Λ t⁰)' = t⁰ᵀ (Λᵀ Λ') t⁰ + t⁰ᵀ t⁰', whose last part, the initial twist and curvature K⁰, drops out. So it
does not matter whether the axis is straight: sweep turns e about t_3⁰ by an angle that may vary, or jump, along X, and
a reference line in space turns it by two.

What is fixed in a section turns with Λ(θ), at the rate ω = T(θ) θ̇ along the turned axes. A director is followed in
these axes, where it stands still and Λᵀw takes the place of w: the same accelerations as for any vector, but made of
first derivatives of T instead of second ones of Λ, which compile to much less code.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from basix.ufl import element
from dolfinx import fem
from mpi4py import MPI
from ufl import cross

from rotfem.along import ONE
from rotfem.errors import InputError
from rotfem.mechanics.bodies import Body, Kinematics, Strain, Support
from rotfem.mechanics.loads import AppliedLoad
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.rotations import Turn
from rotfem.structures.beam import Beam
from rotfem.structures.mode_names import Wave, shaft_waves
from rotfem.structures.reference_rotation import SectionTurns, check_sections
from rotfem.structures.spatial_section import SectionForms, euler_tensor
from rotfem.structures.structure import Array, PointValues

#: Degree of the polynomials the axis of an arc is held in; strains see its exact angle, only inertia sees these.
AXIS_DEGREE = 5


def curved_axis(beam: Beam, line: Any) -> tuple[Any, Any, Any]:
    """Return (χ, ζ, r): angles of the tangent (rad, see `rotfem.scene.reference_line`) and position (m) over X.

    Angles are discontinuous, so that they jump at kinks. Where no point of the line lies inside an element they are
    right to their degree. The axes that are made of them are unit vectors across each other everywhere.
    """
    both = beam.field("angles", lambda x, near: np.stack(line.angles(x, near), axis=-1), AXIS_DEGREE, 2)
    space = element("Lagrange", beam.mesh.basix_cell(), AXIS_DEGREE, shape=(3,))
    r = fem.Function(fem.functionspace(beam.mesh, space), name="line")
    r.interpolate(lambda p: line.at(p[0])[0].T)
    return both[0], both[1], r


def rotation_part(q: Any) -> Any:
    """Return θ of q = (u, θ), θ̇ of q̇ and so on."""
    return ufl.as_vector([q[i] for i in (3, 4, 5)])


@dataclass(frozen=True)
class SectionTurn(Turn):
    """The turn of a section: rates of Λ d for a d fixed in the section, all times Λᵀ."""

    def spin(self, k: Kinematics) -> Any:
        """Return ω = T θ̇."""
        return self.material_rate(rotation_part(k.v))

    def rate(self, k: Kinematics, d: Any) -> Any:
        """Return ω×d."""
        return cross(self.spin(k), d)

    def second_rate(self, k: Kinematics, d: Any) -> Any:
        """Return ω̇×d + ω×(ω×d), ω̇ = T θ̈ + Ṫ θ̇."""
        w = self.spin(k)
        dw = self.material_rate(rotation_part(k.a)) + k.rate(w)
        return cross(dw, d) + cross(w, cross(w, d))

    def variation(self, k: Kinematics, d: Any) -> Any:
        """Return (T δθ)×d."""
        return cross(self.material_rate(rotation_part(k.dq)), d)


@dataclass(frozen=True, kw_only=True)
class SectionBody(Body):
    """What is fixed in a section: a director Λ d, seen along the turned axes, or a mass at r + Λ d off the axis.

    Attributes:
        arm: d, what the director or the offset is in the undeformed beam.
        turn: Λ.
        axis: r, an expression of q; None of a director.
    """

    arm: Any
    turn: SectionTurn
    axis: Any = None

    def rate(self, k: Kinematics) -> Any:
        """Return ω×d, or ṙ + Λ (ω×d)."""
        return self._moved(k.rate, self.turn.rate(k, self.arm))

    def second_rate(self, k: Kinematics) -> Any:
        """Return ω̇×d + ω×(ω×d), or r̈ + Λ times it."""
        return self._moved(k.second_rate, self.turn.second_rate(k, self.arm))

    def variation(self, k: Kinematics) -> Any:
        """Return T δθ×d, or δr + Λ (T δθ×d)."""
        return self._moved(k.variation, self.turn.variation(k, self.arm))

    def spin(self, k: Kinematics) -> Any:
        """Return ω = T θ̇."""
        return self.turn.spin(k)

    def _moved(self, change: Callable[[Any], Any], of_arm: Any) -> Any:
        return of_arm if self.axis is None else change(self.axis) + self.turn.rotate(of_arm)

    def resolve(self, v: Any) -> Any:
        """Return Λᵀ v of a director, v of a mass."""
        return self.turn.rotate_back(v) if self.axis is None else v


@dataclass(frozen=True, kw_only=True)
class AppliedMoment(AppliedLoad):
    """A moment on a section (N·m, frame components): it works on k(δθ), the turning along the axes of the frame.

    With x = θ its potential −M·θ, if it is dead, is right as long as θ keeps to one axis: a moment of fixed direction
    has none in general (Argyris, Comput. Meth. Appl. Mech. Eng. 32 (1982) 85).
    """

    section: SectionTurn
    conservative: ClassVar[bool] = False

    def variation(self, k: Kinematics) -> Any:
        """Return k(δθ)."""
        return self.section.spatial_rate(rotation_part(k.dq))

    def rigid_turn(self, e: Any) -> Any:
        """Return the turn in a unit rigid turn about e, e itself."""
        return e


class SpatialBeam(Beam):
    """Discretised spatial beam.

    Directors and centres of mass turn with Λ of second order in θ in linear theories, which is all that enters there,
    and with the exact Λ in the others.

    Raises:
        InputError: a 6×6 mass matrix that no section has, a pitch over time that is not in the motion.
    """

    type = "spatial_beam"
    planar = False
    turns_of: ClassVar = {1: 3, 2: 4, 3: 5}
    components = ("u1", "u2", "u3", "theta1", "theta2", "theta3")
    planes: ClassVar = {1: (0, 2, 4), 2: (0, 1, 5)}
    dimension = 3
    prestress = "all"
    tip_inputs = ("tip_force_1", "tip_force_2", "tip_force_3", "tip_moment_1", "tip_moment_2", "tip_moment_3")
    families: ClassVar = {"axial": ((0,), 0), "lag": ((1, 5), 1), "flap": ((2, 4), 2), "torsion": ((3,), 3)}

    def __init__(self, problem: Problem, comm: MPI.Comm = MPI.COMM_WORLD):
        s, pitch = problem.structure, problem.motion.pitch
        if s.pitches and pitch is None:
            raise InputError("structure.root.pitch", None, "changes with time: the motion of the problem must have it")
        #: Pitch at t = 0; that of later times is in the motion of the frame.
        self._first_pitch = s.root.pitch.constant if pitch is None else pitch.start
        #: Displacements of housings across the beam, unknowns of the nodes of their supports.
        self.extra = tuple(
            f"u{d}_housing_{j}" for j in range(max((len(b.housing) for b in s.supports), default=0)) for d in (2, 3)
        )
        jumping = [name for name in self.components if any(c.of(name)[0] is not None for c in s.couplings)]
        self.extra += tuple(f"{name}_coupling" for name in jumping)
        super().__init__(problem, comm, s.knots, (*s.nodes, *(u.x for u in problem.unbalances)))
        self._turn = SectionTurn(rotation_part(self.k.q), exact=not problem.theory.linear)
        self._forms = SectionForms(self, s.section)
        if s.hub_offset is None:
            self._root = ufl.as_vector((self.scalar("hub_radius", self.hub_radius), 0, 0))
        else:
            parts = [self.scalar(f"hub_offset_{i}", x) for i, x in enumerate(s.root_position, start=1)]
            self._root = ufl.as_vector(parts)
        self._pretwist: Any = 0
        self._triad = self._undeformed_triad()
        # behind one hinge turns add up; behind two or three the clamp is one of turns from the hub
        counted = len(self.active) == len(self.components) and len(self.released) <= 1 and not s.couplings
        self.turns = SectionTurns.of(self) if counted else None

    @classmethod
    def is_symmetric(cls, data: Any, normal: int) -> bool:
        """Return whether the undeformed beam is symmetric about the plane through its root with this normal, 1 or 2.

        Its axis is in the plane then, section axis `normal` + 1 is the normal all along, and no entry of section
        matrices and inertia tensors couples what a reflection turns round, of (Γ, K) or (v, ω), with the rest. Supports
        have no cross-coupling.
        """
        if np.any(np.atleast_2d(data.pretwist)[:, -1]) or data.pitches or data.root.pitch.constant != 0.0:
            return False
        if data.couplings or any(support.couples or support.housing for support in data.supports):
            return False
        leaves = {1: data.sweep, 2: data.precone}[normal]  # the plane (1, 3) by sweep, the plane (1, 2) by precone
        if np.any(np.atleast_2d(leaves)[:, -1]) or np.any(np.array(data.line or [(0.0, 0.0, 0.0)])[:, normal]):
            return False
        rigid = [(body.offset, body.inertia_matrix) for body in data.bodies.values()]
        if any(offset[normal] != 0.0 or np.any(np.delete(J[normal], normal)) for offset, J in rigid):
            return False
        knots = np.union1d(data.section.knots, data.length)
        places = np.union1d(knots, (knots[1:] + knots[:-1]) / 2)
        across = np.arange(3) == normal
        mirrored = np.concatenate([across, ~across])
        coupling = mirrored[:, None] != mirrored
        return not any(np.any(matrix[..., coupling]) for matrix in data.section.at(places).values())

    # --- the undeformed beam ------------------------------------------------------------------------------------

    def _undeformed_triad(self) -> tuple[Any, Any, Any]:
        """Return t_1⁰, t_2⁰, t_3⁰; without precone and pretwist they are unit vectors that vanish from the forms."""
        cone, twist = self.data.precone, self.data.pretwist
        beta = self.scalar("precone", cone) if cone != 0.0 else 0
        c, s = (ufl.cos(beta), ufl.sin(beta)) if cone != 0.0 else (1, 0)
        e_1, e_2, e_3 = ufl.as_vector((c, 0, s)), ufl.as_vector((0, 1, 0)), ufl.as_vector((-s, 0, c))
        self._root_axes = (e_1, e_2, e_3)
        if self._first_pitch != 0.0:
            pitch = self.scalar("pitch", self._first_pitch)
            c, s = ufl.cos(pitch), ufl.sin(pitch)
            e_2, e_3 = c * e_2 + s * e_3, c * e_3 - s * e_2
        X = ufl.SpatialCoordinate(self.mesh)[0]
        self._axis = X * e_1
        line = self.data.reference_line
        if line is not None:
            chi, zeta, r = curved_axis(self, line)
            self._axis = r[0] * e_1 + r[1] * e_2 + r[2] * e_3
            e_1, e_2 = ufl.cos(chi) * e_1 + ufl.sin(chi) * e_2, ufl.cos(chi) * e_2 - ufl.sin(chi) * e_1
            e_1, e_3 = ufl.cos(zeta) * e_1 + ufl.sin(zeta) * e_3, ufl.cos(zeta) * e_3 - ufl.sin(zeta) * e_1
        if isinstance(twist, tuple) and any(angle != 0.0 for _, angle in twist):
            angle = self.section["pretwist"] = self.linear_field(
                "pretwist", lambda x: np.interp(x, *np.array(twist).T), 0
            )
            self._pretwist = angle.dx(0)
        elif isinstance(twist, float) and twist != 0.0:
            angle = self.scalar("pretwist", twist)
        else:
            return e_1, e_2, e_3
        c, s = ufl.cos(angle), ufl.sin(angle)
        return e_1, c * e_2 + s * e_3, c * e_3 - s * e_2

    def _from_reference(self, v: Any) -> Any:
        """Return R v, what a vector v of the undeformed section is where θ is counted from."""
        R = None if self.turns is None else self.turns.rotation
        return v if R is None else ufl.as_vector([sum(R[i, j] * v[j] for j in range(3)) for i in range(3)])

    def _along_triad(self, v: Any) -> Any:
        """Return the components of v along R t_i⁰."""
        triad = [self._from_reference(t) for t in self._triad]
        return ufl.as_vector([sum(t[i] * v[i] for i in range(3)) for t in triad])

    def _from_triad(self, components: Any) -> Any:
        """Return the vector with these components along R t_i⁰."""
        pairs = list(zip(components, self._triad, strict=True))
        return self._from_reference(ufl.as_vector([sum(c * t[i] for c, t in pairs) for i in range(3)]))

    @property
    def root_turned(self) -> Array:
        """The turn of axes at the root by precone and first pitch, (3, 3), numbers as in `_undeformed_triad`."""
        (c, s), (d, t) = ((np.cos(a), np.sin(a)) for a in (self.data.precone, self._first_pitch))
        precone, pitch = [[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]], [[1.0, 0.0, 0.0], [0.0, d, -t], [0.0, t, d]]
        return np.asarray(np.array(precone) @ pitch)

    def places(self, coordinates: dict[str, Array]) -> Array:
        """Return where points of the undeformed axis are in the frame, (n, 3) in m, by their coordinates."""
        x, line = coordinates["x"], self.data.reference_line
        along = np.column_stack([x, np.zeros((len(x), 2))]) if line is None else line.at(x)[0]
        return np.asarray(self.data.root_position + along @ self.root_turned.T)

    def twist(self, values: Array, x: Array) -> Array:
        """Return the turn (rad) of sections at x (m) about the bent axis, of their unknowns (n, 6).

        That is the turn τ about the tangent t before the shortest turn leads t to the bent axis (swing and twist):
        tan ½τ = tan ½|θ| θ·t/|θ|.
        """
        line, theta = self.data.reference_line, values[:, 3:]
        tangents = np.tile([1.0, 0.0, 0.0], (len(x), 1)) if line is None else line.at(x)[1]
        half = np.linalg.norm(theta, axis=1) / 2
        along = np.sum(theta * (tangents @ self.root_turned.T), axis=1) / 2 * np.sinc(half / np.pi)
        return np.asarray(2 * np.arctan2(along, np.cos(half)))

    def oriented(self, values: Array) -> Array:
        """Return components along the undeformed beam, without its pretwist, of nodal values (n, 6, …)."""
        c, s = np.cos(self.data.precone), np.sin(self.data.precone)
        R = np.kron(np.eye(2), np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))
        return np.concatenate([np.einsum("ij,nj...->ni...", R, values[:, :6]), values[:, 6:]], axis=1)

    def waves(self, coordinates: dict[str, Array], values: Array, axis: Array) -> list[Wave]:
        """Return the whirl of modes where the beam is a shaft: its undeformed axis is that of the spin."""
        off = np.linalg.norm(np.cross(self.places(coordinates), axis), axis=1)
        if np.max(off) > 1e-9 * self.length:  # round-off of its directions
            return []
        return shaft_waves(values[..., :3], self.length * values[..., 3:], axis)

    # --- kinematics ---------------------------------------------------------------------------------------------

    def position(self, q: Any) -> Any:
        """Return r = r_root + ∫ t_1⁰ dX + u, X e for a straight beam."""
        return self._root + self._axis + ufl.as_vector([q[i] for i in (0, 1, 2)])

    def turned(self, q: Any, v: Any) -> Any:
        """Return Λ v = exp(θ) R v."""
        return SectionTurn(rotation_part(q), self._turn.exact).rotate(self._from_reference(v))

    @property
    def released(self) -> set[int]:
        """Turns in hinges; of the root of a driven shaft all that is across its axis."""
        return self.data.root.released or super().released

    def supports(self, frame: Any) -> list[Support]:
        """Return the supports, across direction 1: of displacements and of turns, and what is under their housings."""
        out, q, along = [], self.k.q, abs(self.problem.motion.axis[0]) == 1.0
        theta = self._total_rotation()
        for i, support in enumerate(self.data.supports):
            at, at_rest = self.points.measure((support.x,)), along and support.frame != "rotating"
            places = [(q[1], q[2]), *(self._housing(j) for j in range(len(support.housing))), (0, 0)]
            springs = [(f"supports_{i}_", support, "")]
            springs += [(f"supports_{i}_housing_{j}_", under, "") for j, under in enumerate(support.housing)]
            moves = [tuple(x - y for x, y in zip(*pair, strict=True)) for pair in pairwise(places)]
            for (name, of, kind), x in [
                *zip(springs, moves, strict=True),
                ((f"supports_{i}_", support, "tilt_"), (theta[1], theta[2])),
            ]:
                keys = [f"{kind}stiffness", f"{kind}damping"]
                K, D = (frame.coefficients(f"{name}{key}", getattr(of, key)) for key in keys)
                out.append(Support(ufl.as_vector(x), K, D, at, at_rest))
        return out

    @cached_property
    def _at_supports(self) -> list[PointValues]:
        return [PointValues(self.V, np.array([support.x, 0.0, 0.0])) for support in self.data.supports]

    def support_forces(
        self, frame: Any, speed: float, q: npt.NDArray[Any], v: npt.NDArray[Any]
    ) -> dict[str, npt.NDArray[Any]]:
        """Return the force of the beam on every support (N), "support_0_f", and a moment (N·m), "support_0_m".

        Args:
            frame: constants, with what coefficients of supports depend on.
            speed: of rotation, rad/s.
            q: local dof array, or that of complex amplitudes.
            v: its rates.

        Returns:
            Components along directions 2 and 3 of the frame, (2,) each.
        """
        out: dict[str, npt.NDArray[Any]] = {}
        fixed = frame.spun or abs(self.problem.motion.axis[0]) != 1.0
        for i, (support, at) in enumerate(zip(self.data.supports, self._at_supports, strict=True)):
            x, rate = (dict(zip(self.unknowns, at(y), strict=True)) for y in (q, v))
            for kind, of, name in (("", "u", "f"), ("tilt_", "theta", "m")):
                K, D = (frame.coefficient(getattr(support, f"{kind}{key}"), speed) for key in ("stiffness", "damping"))
                d, dd = (np.array([y.get(f"{of}{i}", 0.0) for i in (2, 3)]) for y in (x, rate))
                if support.housing and not kind:
                    d, dd = (a - [y[f"u{i}_housing_0"] for i in (2, 3)] for a, y in ((d, x), (dd, rate)))
                if not (fixed or support.frame == "rotating"):
                    dd = dd + speed * self.problem.motion.axis[0] * np.array([-d[1], d[0]])
                if not kind or np.any([K, D]):
                    out[f"support_{i}_{name}"] = K @ d + D @ dd
        return out

    @property
    def _jumps(self) -> dict[str, int]:
        """Component that jumps in some coupling ↦ number of its jump among the unknowns of a node."""
        first = len(self.components)
        names = enumerate(self.extra, start=first)
        return {name.removesuffix("_coupling"): i for i, name in names if name.endswith("_coupling")}

    def _kinematics(self, functions: tuple[Any, Any, Any, Any]) -> Kinematics:
        """Return q, v, a and δq; in an element that begins at a coupling the jump there adds to the values of the node.

        The coupling divides the beam so at a point; at other nodes, and before it, there is no jump.
        """
        if not self.data.couplings:
            return super()._kinematics(functions)
        space = fem.functionspace(self.mesh, ("DG", 0))
        beyond = fem.Function(space, name="beyond")
        begins = self.mesh.geometry.x[self.mesh.geometry.dofmap, 0].min(axis=1)
        apart = np.abs(begins[:, None] - [coupling.x for coupling in self.data.couplings])
        beyond.x.array[space.dofmap.list[:, 0]] = np.any(apart < ONE * self.length, axis=1)
        names, jumps = [*self.components, *self.extra], self._jumps
        whole = [[f[i] + beyond * f[jumps[n]] if n in jumps else f[i] for i, n in enumerate(names)] for f in functions]
        q, v, a, dq = map(ufl.as_vector, whole)
        return Kinematics(q, v, a, dq, made_of=functions)

    def couplings(self, frame: Any) -> list[Support]:
        """Return the couplings: of jumps across the axis, of turns across it, and of stretch and twist along it."""
        out, jumps = [], {name: self.k.q[i] for name, i in self._jumps.items()}
        turns = ufl.as_vector([jumps.get(f"theta{i}", 0) for i in (1, 2, 3)])
        if not self.problem.theory.linear:
            turns = self._turn.material_rate(turns)
        jumps |= {f"theta{i}": turns[i - 1] for i in (1, 2, 3)}
        for i, c in enumerate(self.data.couplings):
            at = self.points.measure((c.x,))
            for first, second in (("u2", "u3"), ("theta2", "theta3"), ("u1", "theta1")):
                K, D = (
                    frame.coefficients(f"couplings_{i}_{first}_{kind}", ((a or 0.0, 0.0), (0.0, b or 0.0)))
                    for kind, a, b in zip(("stiffness", "damping"), c.of(first), c.of(second), strict=True)
                )
                x = ufl.as_vector([jumps.get(first, 0), jumps.get(second, 0)])
                out.append(Support(x, K, D, at, at_rest=False, across=first != "u1"))
        return out

    def _housing(self, j: int) -> tuple[Any, Any]:
        """Return the displacements across the beam of the j-th housing under a support."""
        first = len(self.components) + 2 * j
        return self.k.q[first], self.k.q[first + 1]

    def without_extra(self) -> list[npt.NDArray[np.int32]]:
        """Return of each displacement of a housing, and jump in a coupling, the local nodes without such a one."""
        x, s = self.V.tabulate_dof_coordinates()[:, 0], self.data
        jumps = self._jumps
        places = [[b.x for b in s.supports if len(b.housing) > j // 2] for j in range(len(self.extra) - len(jumps))]
        places += [[c.x for c in s.couplings if c.of(name)[0] is not None] for name in jumps]
        away = (np.all(np.abs(x[:, None] - there) > ONE * self.length, axis=1) for there in places)
        return [np.flatnonzero(a).astype(np.int32) for a in away]

    def root_turn(self, axis: int) -> Any:
        """Return θ·e at the root, e the axis of the blade there (1), the flap axis (2) or the lag axis (3)."""
        theta, e = self._total_rotation(), self._root_axes[axis - 1]
        return sum(e[i] * theta[i] for i in range(3))

    def strains(self, measures: Callable[..., tuple[Any, Any]]) -> list[Strain]:
        """Return the strains (Γ, K) of one theory's measures with the section's stiffness."""
        return self._forms.strains(*self._measured(measures), self.dx_elastic, self._pretwist)

    def section_strains(self, measures: Callable[..., tuple[Any, Any]]) -> Any:
        """Return (Γ, K) along the section's axes t_i, of the reference axis."""
        return ufl.as_vector([x[i] for x in self._measured(measures) for i in range(3)])

    def stored(self, values: Any) -> list[Strain]:
        """Return the strains that make the stored energy of (Γ, K)."""
        Gamma, K = [values[i] for i in (0, 1, 2)], [values[i] for i in (3, 4, 5)]
        return self._forms.strains(Gamma, K, self.dx_elastic, self._pretwist)

    def _measured(self, measures: Callable[..., tuple[Any, Any]]) -> tuple[Any, Any]:
        """Return Γ and K of one theory's measures along t_i; from a reference with its axis R e and its curvature."""
        q, e = self.k.q, self._triad[0]
        dq = q.dx(0)
        du = ufl.as_vector([dq[i] for i in (0, 1, 2)])
        if self.turns is None or self.turns.rotation is None:
            Gamma, K = measures(du, rotation_part(q), rotation_part(dq), e)
            return self._along_triad(Gamma), self._along_triad(K)
        turned = self._from_reference(e)
        Gamma, K = measures(e + du - turned, rotation_part(q), rotation_part(dq), turned)
        before = ufl.as_vector([sum(t[i] * self.turns.curvature[i] for i in range(3)) for t in self._triad])
        return self._along_triad(Gamma), self._along_triad(K) + before

    def bodies(self, effects: Collection[str]) -> list[Body]:
        """Return mass-centre line, section directors, tip body and its directors, as the effects call for them."""
        forms = self._forms
        bodies = [self._mass(forms.mass, forms.mass_center, self.dx)]
        if "rotary_inertia" in effects:
            bodies += [self._director(axis, moment, self.dx, "rotary_inertia") for axis, moment in forms.directors]
        for rigid in self.rigid_bodies() if "tip_mass" in effects else ():
            bodies += self._rigid_body(*rigid)
        for i, support in enumerate(self.data.supports if {"supports", "tip_mass"} <= set(effects) else ()):
            for j, under in enumerate(support.housing):
                mass = self.scalar(f"supports_{i}_housing_{j}_mass", under.mass)
                x, at = ufl.as_vector((0, *self._housing(j))), self.points.measure((support.x,))
                bodies.append(Body(x, mass, at, effect="tip_mass"))
        return bodies

    def _mass(self, density: Any, center: tuple[Any, ...], measure: Any, effect: str = "") -> Body:
        """Return mass at r + Λ c; c has these components along t_i⁰."""
        r = self.position(self.k.q)
        if all(isinstance(c, int) for c in center):
            return Body(r, density, measure, effect=effect)
        arm = self._from_triad(center)
        x = r + self._turn.rotate(arm)
        return SectionBody(x, density, measure, effect=effect, axis=r, arm=arm, turn=self._turn)

    def _director(self, axis: tuple[Any, ...], density: Any, measure: Any, effect: str) -> Body:
        d = self._from_triad(axis)
        return SectionBody(d, density, measure, False, effect, arm=d, turn=self._turn)

    def _rigid_body(self, name: str, body: Any, at: Any) -> list[Body]:
        """Return a mass at its offset (section axes), and its directors."""
        mass, offset = body.mass, body.offset
        out = []
        if mass > 0:
            if self.problem.frame == "fixed":  # what is off the axis turns: it is unbalance
                offset = (offset[0], 0.0, 0.0)
            center = tuple(
                self.scalar(f"{name}_offset_{i}", c) if c != 0.0 else 0 for i, c in enumerate(offset, start=1)
            )
            out.append(self._mass(self.scalar(f"{name}_mass", mass), center, at, "tip_mass"))
        for i, (moment, axis) in enumerate(euler_tensor(body.inertia_matrix), start=1):
            if isinstance(body.inertia, float):  # isotropic: each director has half of it
                density = self.scalar(f"{name}_inertia", body.inertia) / 2
            else:
                density = self.scalar(f"{name}_director_inertia_{i}", moment)
            out.append(self._director(tuple(axis), density, at, "tip_mass"))
        return out

    def moment(self, name: str, m: Any, measure: Any, dead: bool) -> list[AppliedLoad]:
        """Return the work of a moment on the turns of the sections; a follower turns with Λ."""
        M = m if dead else self.turned(self.k.q, m)
        return [AppliedMoment(name, M, self._total_rotation(), measure, dead, section=self._turn)]

    def _total_rotation(self) -> Any:
        """Return θ, counted from the reference, and the total rotation vector of the reference."""
        theta = self._turn.theta
        if self.turns is None or self.turns.before is None:
            return theta
        return theta + rotation_part(self.turns.before)

    def check_range(self, q: Array, time: float | None = None) -> None:
        """Refuse sections turned by more than a turn without a reference; in a plane there is no limit."""
        in_plane = len(self.active) < len(self.components) and self.problem.theory.exact
        if self.turns is None and not in_plane:
            check_sections(self, q, time)
