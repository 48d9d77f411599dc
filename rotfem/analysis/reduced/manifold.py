"""Foreshortening of a reduced model: second-order displacements ½ Θ η η of its motion, and their forces.

A beam that bends comes nearer to its clamp, a second-order displacement that linear strains do not have. Θ_ij is the
answer to a pair of shapes of the second order of the exact strains Γ,

    K₀ Θ_ij + ∫ N(δq)·D²Γ[V_i, V_j] = 0,

N the forces of a linear structure, with which no strain is of second order. On the manifold q = V η + ½ Θ η η the
equations are those projected on its tangent V + Θ η (Jain, Tiso, Rutzmoser & Rixen 2017, section 3). The forces of
inertia of second order that the linear equations lack are

    Vᵀ(M q̈₂ + C q̇₂ + K_x q₂) + (Θη)ᵀ(M V η̈ + C V η̇ + K_x V η),    q₂ = ½ Θ η η,

where K_x is K without the stiffness of strains and stresses. The work of the loads on q₂ is the geometric stiffness,
which the linear equations have. What has the rate of the speed as a factor is of third order, as the motion is of its
order.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.equations.nonlinear import assembled
from rotfem.equations.pieces import PRESTRESS, Piece, second_order_work
from rotfem.mechanics.effects import INTERNAL, Effect
from rotfem.numerics import forms
from rotfem.numerics.projection import summed, times

Array = npt.NDArray[np.float64]


class Manifold:
    """The second-order displacements of the motion of a reduced model, and their forces.

    Args:
        model: the basis.
        q: coordinates of a motion of it, (n, m).

    Attributes:
        shapes: coordinates of the shapes whose pairs are taken, (m, r): six at most, with amplitudes of 2e-3 of the
            largest. The error by those that are not is of the square of that.
        pairs: numbers (i, j) of these, i ≤ j, (p, 2).
        Theta: second-order displacements of a product of coordinates, local dof arrays (n, p).
    """

    def __init__(self, model: ReducedModel, q: Array):
        self.model = model
        _, sizes, turns = np.linalg.svd(q, full_matrices=False)
        keep = sizes > 2e-3 * sizes[:1].max(initial=0.0)
        self.shapes: Array = turns[keep][:6].T
        pairs = list(combinations_with_replacement(range(self.shapes.shape[1]), 2))
        self.pairs = np.array(pairs, dtype=int).reshape(-1, 2)
        self.Theta = self._displacements()
        self._tips, self._basis_tips = model.tips(self.Theta), model.tips()
        self._project()

    def _displacements(self) -> Array:
        """Return Θ of all pairs, one solution each; half of it where a shape meets itself."""
        model, system, V = self.model, self.model.system, self.model.V @ self.shapes
        one, other = fem.Function(system.V), fem.Function(system.V)
        out = np.zeros((len(V), len(self.pairs)))
        if not len(self.pairs):
            return out
        form = forms.form(second_order_work(system.model, (one, other), ufl.TestFunction(system.V)), once=True)
        right = out[model.owned]
        for column, (i, j) in zip(right.T, self.pairs, strict=True):
            one.x.array[:], other.x.array[:] = V[:, i] * (0.5 if i == j else 1.0), V[:, j]
            column[:] = assembled(form, system.V, system.clamped).array[model.owned]
        return -model.solve(system.material_solver, right)

    def _project(self) -> None:
        """Project the pieces of inertia on V and Θ; those of strains do not feel the manifold."""
        model, pieces, owned = self.model, self.model.system.pieces, self.model.owned
        V, Theta, m, p = model.V[owned], self.Theta[owned], model.size, len(self.pairs)
        self._pieces: dict[str, tuple[list[int], Array, Array]] = {}
        for kind in "MCK":
            numbers = [i for i in model.kinds[kind] if of_inertia(pieces[i])]
            on_pairs = [times(pieces[i].operator, Theta) if p else Theta for i in numbers]
            on_basis = [times(pieces[i].operator, V) if m else V for i in numbers]
            second = np.array([summed(model.comm, V.T @ P) for P in on_pairs]).reshape(len(numbers), m, p)
            first = np.array([summed(model.comm, Theta.T @ P) for P in on_basis]).reshape(len(numbers), p, m)
            self._pieces[kind] = numbers, second, first

    # --- motion on the manifold --------------------------------------------------------------------------------------

    def _products(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Return the products of the pairs, and their rates, of coordinates, rates and accelerations (n, m)."""
        (x, y), (dx, dy), (ddx, ddy) = (np.moveaxis((z @ self.shapes)[:, self.pairs], 2, 0) for z in (q, v, a))
        return x * y, dx * y + x * dy, ddx * y + 2 * dx * dy + x * ddy

    def tip(self, q: Array) -> Array:
        """Return the unknowns at the tip of coordinates (n, m), (n, components)."""
        return np.asarray(q @ self._basis_tips.T + self._products(q, q, q)[0] @ self._tips.T)

    def shape(self, q: Array) -> Array:
        """Return the displacement (local dof array) of coordinates (m,)."""
        rows = q[None, :]
        return np.asarray(self.model.V @ q + self.Theta @ self._products(rows, rows, rows)[0][0])

    def forces(self, c: Array, q: Array, v: Array, a: Array) -> Array:
        """Return the forces of second order, (n, m).

        Args:
            c: factors of all pieces, (n, pieces).
            q: coordinates, (n, m).
            v: rates.
            a: accelerations.
        """
        s, ds, dds = self._products(q, v, a)
        on_basis, on_pairs = np.zeros_like(q), np.zeros((len(q), len(self.pairs)))
        for kind, x, y in (("M", a, dds), ("C", v, ds), ("K", q, s)):
            numbers, second, first = self._pieces[kind]
            for number, P, B in zip(numbers, second, first, strict=True):
                on_basis += c[:, number, None] * (y @ P.T)
                on_pairs += c[:, number, None] * (x @ B.T)
        return on_basis + self.along(q, on_pairs)

    def along(self, q: Array, on_pairs: Array) -> Array:
        """Return the transpose of ∂(products)/∂η times forces on the pairs, (n, m)."""
        x, out = q @ self.shapes, np.zeros((len(q), self.shapes.shape[1]))
        for force, (i, j) in zip(on_pairs.T, self.pairs, strict=True):
            out[:, i] += force * x[:, j]
            out[:, j] += force * x[:, i]
        return out @ self.shapes.T


def of_inertia(piece: Piece) -> bool:
    """Return whether a piece has forces of second order: not of stresses, damping or prestress, nor of the rate."""
    effects = [Effect.registry[name] for name in piece.of if name in Effect.registry]
    strained = PRESTRESS in piece.of or INTERNAL.name in piece.of or any(effect.internal for effect in effects)
    return not strained and all(name != "dw" for name, _ in piece.key)
