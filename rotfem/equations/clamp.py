"""Force and moment of the hub on the structure, and the clamp's motion in a frame that does not turn with the hub.

The residual F(q, v, a; δq) of the equations of motion is zero for all unknowns but the clamped ones. For those it is
the work of the clamp, so with the rigid motions of the clamp, δu = δs + δφ×(x − x_root), δφ of its sections and
directors, force and moment are

    f_i = F(q, v, a; δs = e_i),        m_i = F(q, v, a; δφ = e_i).

Both are of the theory that is computed, in balance with its inertia and loads: exactly about the displaced structure in
the exact theory, whose strains feel no rigid turn, to the order of the theory in the others. The moment is about the
root, the clamped end of the beam or the middle of the clamped edges of the plate, not about the axis of spin. What is
clamped does not turn relative to the hub, so its rotation unknowns change by δφ itself.

Damping by mode and by mass, C v = B Bᵀ v and a0 M v, acts between hub and structure, as springs of the root do. The
reaction that balances inertia and loads alone is the constraint force less the work of these forces in a rigid motion:

    f_i = F(δq of the clamp) − (C v)·R_i(q),

R_i the rigid motion of the displaced structure with the clamp. The equation of a
free hub contains no forces between hub and structure.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from rotfem.equations.modal_damping import EFFECT
from rotfem.equations.model import Model
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.rotations import turned_vectors
from rotfem.numerics.projection import times_transposed
from rotfem.structures.beam import Beam
from rotfem.structures.structure import Structure

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


#: Rotation unknown ↦ its change in a unit turn δφ; the director of a plate, t = a_3 − alpha_γ a_γ, changes by δφ×t.
TURNS = {
    "alpha": (0.0, 0.0, 1.0),
    **{f"theta{i + 1}": tuple(float(i == j) for j in range(3)) for i in range(3)},
    "alpha1": (0.0, -1.0, 0.0),
    "alpha2": (1.0, 0.0, 0.0),
}


def along_axis(names: tuple[str, ...], place: Array, axis: Array) -> tuple[Array, Array]:
    """Return e·(place×f + m) of unit components f1 … m3, and the components of m = e; place (m) and e are (3,)."""
    units = {name: np.eye(3)[int(name[1]) - 1] for name in names}
    arms = [axis @ (np.cross(place, unit) if name[0] == "f" else unit) for name, unit in units.items()]
    turn = [axis @ unit if name[0] == "m" else 0.0 for name, unit in units.items()]
    return np.array(arms), np.array(turn)


class RootReaction:
    """The rigid motions of a clamp, in its unknowns.

    Attributes:
        names: of the components that the structure has: f1, f2, f3 (N), m1, m2, m3 (N·m).
        point: what moments are about, a place of the undeformed structure on its mesh, (3,) in m.
        place: the same in the frame, from the axis of spin, (3,) in m.
        weights: change of every owned unknown in a unit motion of the clamp, shape (unknowns, components of names).
    """

    def __init__(self, structure: Structure):
        self._structure = structure
        self.point, data = structure.clamp_middle(), structure.data
        self.place = self.point + np.asarray(getattr(data, "root_position", (data.hub_radius, 0.0, 0.0)))
        space = structure.V.dofmap
        owned = space.index_map.size_local
        nodes = structure.clamped[structure.clamped < owned]
        components = structure.components
        turns: tuple[int, ...] = (2,) if structure.planar else (0, 1, 2)
        if not any(name in TURNS for name in components):
            turns = ()
        forces = (i for i in range(3) if f"u{i + 1}" in components)
        self.names = (*(f"f{i + 1}" for i in forces), *(f"m{i + 1}" for i in turns))
        rows = (nodes[:, None] * structure.size + np.arange(structure.size)).ravel()
        self.weights: Array = np.zeros((owned * structure.size, len(self.names)))
        self.weights[rows] = self.carried()[rows]

    def carried(self, q: Array | None = None) -> Array:
        """Return what all owned unknowns change by in the unit motions if the whole structure goes along.

        Rotation vectors are turned as such, ∂θ/∂φ = T⁻¹(θ); the angles of plates as small ones.
        Shape (unknowns, components of names); the structure is displaced by q, a local dof array.
        """
        structure, owned = self._structure, self._structure.V.dofmap.index_map.size_local
        values: Array = np.zeros((owned, structure.size))
        if q is not None:
            values[:] = q[: values.size].reshape(values.shape)
        arms = structure.V.tabulate_dof_coordinates()[:owned] - self.point
        places, theta = arms.copy(), np.zeros((owned, 3))
        for column, name in zip(values.T, structure.unknowns, strict=True):
            if name in ("u1", "u2", "u3"):
                places[:, int(name[1]) - 1] += column
            elif name in ("theta1", "theta2", "theta3"):
                theta[:, int(name[-1]) - 1] = column
        out = np.zeros((owned, structure.size, len(self.names)))
        for columns, name in zip(np.moveaxis(out, 2, 0), self.names, strict=True):
            axis, force = np.eye(3)[int(name[1]) - 1], name[0] == "f"
            moved = np.broadcast_to(axis, arms.shape) if force else np.cross(axis, places)
            vectors = np.zeros_like(arms) if force else turned_vectors(theta, axis)
            for column, unknown in zip(columns.T, structure.unknowns, strict=True):
                if unknown in TURNS:
                    column[:] = vectors @ TURNS[unknown]
                elif unknown in ("u1", "u2", "u3"):
                    column[:] = moved[:, int(unknown[1]) - 1]
        return out.reshape(values.size, len(self.names))


# --- of a linear theory ----------------------------------------------------------------------------------------------


class AtClamp:
    """Products of operators, without the constraint, with the unit motions of the clamp, of this process."""

    def __init__(self, model: Model, clamped: npt.NDArray[Any], root: RootReaction):
        self._model = model
        fixed = np.zeros((len(root.weights), 1), dtype=bool)
        fixed[clamped] = True
        self._motions = self._moved(np.where(fixed, root.weights, 0.0))
        self._turns = self._moved(np.where(fixed, 0.0, root.weights))  # of its hinges
        damping = model.mechanics.damping
        by_mass = damping.mass is not None or bool(damping.models)
        self._others = self._moved(np.where(fixed, 0.0, root.carried())) if by_mass else None

    def _moved(self, columns: Array) -> tuple[Any, Array]:
        """Return the rows that motions (owned rows, a column each) move, global numbers, and what these are there."""
        rows = np.flatnonzero(np.any(columns != 0.0, axis=1))
        V = self._model.structure.V
        numbers = V.dofmap.index_map.local_range[0] * V.dofmap.index_map_bs + rows
        return PETSc.IS().createGeneral(numbers.astype(PETSc.IntType), comm=V.mesh.comm), columns[rows]

    def of_vector(self, b: Any) -> Array:
        """Return one number for each motion."""
        rows, motions = self._motions
        return np.asarray(b.array[rows.getIndices() - b.getOwnershipRange()[0]] @ motions)

    def of_matrix(self, A: Any, of: Collection[str]) -> Array:
        """Return a row for each owned unknown, of a matrix of some terms (see `Piece`)."""
        # Only the rows of A that motions move are multiplied.
        sign, (rows, motions) = 1.0, self._motions
        if any(self._model.acting[n].at_root for n in of if n in self._model.acting):
            sign, (rows, motions) = -1.0, self._turns
        elif EFFECT in of and self._others is not None:  # the hub takes up what strains do not (see `hub_damping`)
            sign, (rows, motions) = -1.0, self._others
        return times_transposed(A.createSubMatrix(rows), sign * motions)


class ClampRows:
    """Sums of pieces in the unit motions of the clamp, of this process."""

    def __init__(self, pieces: Sequence[Any], motions: int):
        self._motions = motions
        kinds = {kind: [i for i, p in enumerate(pieces) if p.kind == kind] for kind in "MCKf"}
        self._kinds: dict[str, Index] = {kind: np.array(index, dtype=np.int64) for kind, index in kinds.items()}
        parts = [pieces[i].at_root for i in self._kinds["f"]]
        self._loads = np.array(parts).reshape(len(parts), motions)
        #: For each kind the unknowns that act on the clamp, and what each piece makes of them.
        self._near: dict[str, tuple[Index, Array]] = {}
        for kind in "KCM":
            rows = [pieces[i].at_root for i in self._kinds[kind]]
            whole = np.array(rows).reshape(len(rows), -1, motions) if rows else np.zeros((0, 0, motions))
            near = np.flatnonzero(np.any(whole != 0.0, axis=(0, 2)))
            self._near[kind] = near, whole[:, near].reshape(len(rows), len(near) * motions)

    def tangents(self, c: Array, unknowns: int) -> tuple[Array, Array, Array]:
        """Return the derivatives of these forces to q, v and a, each (unknowns, motions), at factors of all pieces."""
        out = np.zeros((3, unknowns, self._motions))
        for part, kind in zip(out, "KCM", strict=True):
            near, products = self._near[kind]
            part[near] = (c[self._kinds[kind]] @ products).reshape(len(near), self._motions)
        return out[0], out[1], out[2]

    def __call__(self, c: Array, state: tuple[Array, ...]) -> Array:
        """Return the forces of the clamp, (motions,), at factors of all pieces and local arrays of q, v, a."""
        out: Array = c[self._kinds["f"]] @ self._loads
        for kind, x in zip("KCM", state, strict=True):
            near, products = self._near[kind]
            out = out + x[near] @ (c[self._kinds[kind]] @ products).reshape(len(near), self._motions)
        return out


# --- in a frame that does not turn ------------------------------------------------------------------------------------


class TurningClamp:
    """Prescribed q = (u_1, u_2, alpha) of the clamped node, without alpha in a hinge, and rigid turns of the beam.

    In a frame that does not turn with the hub (theory section 4) the inertia of a planar beam is linear (A_rho ü,
    I_rho α̈) and the spin enters as the motion of the clamped end, Simo & Vu-Quoc 1986, claim (v).
    """

    def __init__(self, structure: Beam, motion: Motion):
        self.motion, self.structure = motion, structure
        self._clamped_components = np.arange(2 if structure.hinges else 3)
        self.dofs = (structure.clamped[:, None] * 3 + self._clamped_components).ravel()
        self._x = structure.V.tabulate_dof_coordinates()[:, 0] + structure.hub_radius

    def angle(self, t: float) -> float:
        """Return the angle of the hub about a_3 at time t (s), rad."""
        return float(self.motion.axis[2]) * self.motion.angle(t)

    def at(self, t: float) -> tuple[Array, Array, Array]:
        """Return q, q̇ and q̈ of the clamped unknowns at time t (s), inertial components."""
        R, sign = self.structure.hub_radius, float(self.motion.axis[2])
        psi, w, dw = self.angle(t), sign * self.motion.speed(t), sign * self.motion.rate(t)
        c, s = np.cos(psi), np.sin(psi)
        q = np.array([R * (c - 1), R * s, psi])
        v = w * np.array([-R * s, R * c, 1.0])
        a = dw * np.array([-R * s, R * c, 1.0]) - w * w * np.array([R * c, R * s, 0.0])
        constrained, repeat = self._clamped_components, len(self.dofs) // len(self._clamped_components)
        return np.tile(q[constrained], repeat), np.tile(v[constrained], repeat), np.tile(a[constrained], repeat)

    def rigid(self, relative: Array, t: float) -> tuple[Array, Array]:
        """Return (q, q̇) in inertial components of a shape given in the turning frame and at rest there."""
        r = relative.reshape(-1, 3)
        x, y = self._turn(self._x + r[:, 0], r[:, 1], self.angle(t))
        w = float(self.motion.axis[2]) * self.motion.speed(t)
        q = np.column_stack([x - self._x, y, r[:, 2] + self.angle(t)])
        return q.ravel(), (w * np.column_stack([-y, x, np.ones_like(x)])).ravel()

    def turned(self, q: Array, v: Array, t0: float, t1: float) -> Array:
        """Return the configuration q at t0 carried to t1 by the hub's turn and its velocity relative to the hub."""
        p, u = q.reshape(-1, 3), v.reshape(-1, 3)
        w, h = float(self.motion.axis[2]) * self.motion.speed(t0), t1 - t0
        x, y = self._x + p[:, 0], p[:, 1]
        x, y = x + h * (u[:, 0] + w * y), y + h * (u[:, 1] - w * x)
        turn = self.angle(t1) - self.angle(t0)
        x, y = self._turn(x, y, turn)
        return np.column_stack([x - self._x, y, p[:, 2] + turn + h * (u[:, 2] - w)]).ravel()

    def relative(self, q: Array, X: Any, t: float) -> Array:
        """Return (u_1, u_2, alpha), shape (n, 3), in the turning frame from inertial q (n, 3) of points at X (m)."""
        reach = self.reach(X)
        x, y = self._turn(reach + q[:, 0], q[:, 1], -self.angle(t))
        return np.column_stack([x - reach, y, q[:, 2] - self.angle(t)])

    def reach(self, X: Any) -> Any:
        """Return the distance of points at X (m) from the axis of rotation, undeformed."""
        return self.structure.hub_radius + X

    @staticmethod
    def _turn(x: Any, y: Any, angle: float) -> tuple[Any, Any]:
        c, s = np.cos(angle), np.sin(angle)
        return c * x - s * y, s * x + c * y
