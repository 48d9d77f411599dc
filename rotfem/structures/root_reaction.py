"""Force and moment that the hub exerts on a structure, of the forces that hold its clamped unknowns.

The residual F(q, v, a; δq) of the equations of motion is zero for all unknowns but the clamped ones. For those it is
the work of the clamp, so with the rigid motions of the clamp, δu = δs + δφ×(x − x_root), δφ of its sections and
directors, force and moment are

    f_i = F(q, v, a; δs = e_i),        m_i = F(q, v, a; δφ = e_i).

Both are of the theory that is computed, in balance with its inertia and loads: exactly about the displaced structure in
the exact theory, whose strains feel no rigid turn, to the order of the theory in the others. The moment is about the
root, the clamped end of the beam or the middle of the clamped edges of the plate, not about the axis of spin. What is
clamped does not turn relative to the hub, so its rotation unknowns change by δφ itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.rotations import turned_vectors

if TYPE_CHECKING:
    from rotfem.structures.structure import Structure

Array = npt.NDArray[np.float64]

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
        self.point, data = self._middle(), structure.data
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

    def _middle(self) -> Array:
        """Return the middle of what is clamped, of edges weighed by their length, (3,) in m."""
        grid = getattr(self._structure, "grid", None)
        if grid is None:
            return np.zeros(3)
        ends = grid.ends("clamped")
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        return np.asarray(lengths @ ends.mean(axis=1) / lengths.sum())
