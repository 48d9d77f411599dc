"""Displacements of third order of a structure that bends: Ξ η η η beside V η + ½ Θ η η (see `manifold`).

A line that turns by θ and does not stretch moves by sin θ along the normal where a linear theory has θ. Ξ is the answer
to the third order of the exact strains Γ,

    K₀ Ξ + ∫ N(δq)·(⅙ D³Γ[V, V, V] + D²Γ[V, ½ Θ]) = 0,

N the forces of all of them, with which none is strained to that order but as the linear theory says: along a line
nothing is in the way. In space the torsion takes part, which bending in two planes goes with. The inertia of these
displacements is as large as that of the foreshortening of third order, and mostly opposed to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement, permutations

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.tips import tips_of
from rotfem.equations.geometric import third_order_work
from rotfem.equations.pieces import PRESTRESS
from rotfem.mechanics.effects import INTERNAL, LOADS, Effect
from rotfem.numerics import compat, forms
from rotfem.numerics.projection import summed, times

Array = npt.NDArray[np.float64]

#: Structures all of whose exact strains vanish to third order: those of a line can. Plates come ten times nearer to the
#: exact motion by it, but what is left is more than a further round moves.
EXPANDED = ("planar_beam", "spatial_beam")


@dataclass(frozen=True)
class Motion:
    """Coordinates s of products of shapes (n, p), and their rates and accelerations."""

    s: Array
    v: Array
    a: Array


class ThirdOrder:
    """The third-order displacements of shapes, and the forces of their inertia and of loads on them.

    Args:
        model: reduced model of a structure that `expands`.
        shapes: coordinates of the shapes, (m, r).
        seconds: (i, j), i ≤ j ↦ answer to this pair times its factor, a local dof array.

    Attributes:
        triples: numbers (i, j, k), i ≤ j ≤ k, of the shapes of the products, (p, 3).
        Xi: answers to them, local dof arrays (n, p).
        tips: the unknowns at the tip of these, (components, p).
    """

    def __init__(self, model: ReducedModel, shapes: Array, seconds: dict[tuple[int, int], Array]):
        self.model, self.shapes = model, shapes
        number = range(shapes.shape[1])
        self.triples = np.array(list(combinations_with_replacement(number, 3)), dtype=int).reshape(-1, 3)
        self.Xi = self._answers(seconds)
        self.tips = tips_of(model, self.Xi)
        self._project()

    def _answers(self, seconds: dict[tuple[int, int], Array]) -> Array:
        """Return Ξ of all triples, one solution each."""
        model, system = self.model, self.model.system
        V, functions = model.V @ self.shapes, [fem.Function(system.V) for _ in range(5)]
        out = np.zeros((len(V), len(self.triples)))
        if not len(self.triples):
            return out
        form = forms.form(third_order_work(system.model, functions, ufl.TestFunction(system.V)), once=True)
        right = out[model.owned]
        for column, triple in zip(right.T, self.triples, strict=True):
            orders = sorted(set(permutations(int(i) for i in triple)))
            first = {order[0]: (min(order[1:]), max(order[1:])) for order in orders}
            for function, i in zip(functions, triple, strict=False):
                function.x.array[:] = V[:, i]
            cubic, b = len(orders) / 6, compat.create_vector(system.V)
            functions[0].x.array[:] *= cubic
            for i, pair in first.items():  # the cubic part once, the others one by one
                functions[3].x.array[:], functions[4].x.array[:] = V[:, i], seconds[pair]
                fem_petsc.assemble_vector(b, form)
                functions[0].x.array[:] = 0.0
            b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            b.array[system.clamped] = 0.0
            column[:] = b.array[model.owned]
        return -model.solve(system.material_solver, right)

    def _project(self) -> None:
        """Project the pieces of inertia and loads on V and Ξ."""
        model, system = self.model, self.model.system
        Xi, V = self.Xi[model.owned], model.V[model.owned]
        self._pieces: dict[str, tuple[list[int], Array, Array]] = {}
        m, p = model.size, len(self.triples)  # both 0 where nothing moves
        for kind in "MCK":
            numbers = [i for i in model.kinds[kind] if not inside(system.pieces[i].of)]
            third = [summed(model.comm, V.T @ times(system.pieces[i].operator, Xi)) for i in numbers]
            first = [summed(model.comm, Xi.T @ model.product(i)) for i in numbers]
            n = len(numbers)
            self._pieces[kind] = numbers, np.array(third).reshape(n, m, p), np.array(first).reshape(n, p, m)
        loads = [summed(model.comm, Xi.T @ system.pieces[i].operator.array[model.owned]) for i in model.kinds["f"]]
        self._loads = np.array(loads).reshape(len(loads), p)

    def products(self, q: Array) -> Array:
        """Return the coordinates of the triples of coordinates (n, m)."""
        return np.asarray((q @ self.shapes)[:, self.triples].prod(axis=2))

    def motion(self, q: Array, v: Array, a: Array) -> Motion:
        """Return the coordinates of the triples, and their rates, of coordinates, rates and accelerations (n, m)."""
        x, dx, ddx = ((y @ self.shapes)[:, self.triples] for y in (q, v, a))
        others = ((0, 1, 2), (1, 0, 2), (2, 0, 1))
        rate = sum(dx[..., i] * x[..., j] * x[..., k] for i, j, k in others)
        turn = sum(ddx[..., i] * x[..., j] * x[..., k] + 2 * x[..., i] * dx[..., j] * dx[..., k] for i, j, k in others)
        return Motion(self.products(q), np.asarray(rate), np.asarray(turn))

    def forces(self, c: Array, q: Array, v: Array, a: Array) -> Array:
        """Return the forces of third order that these displacements bring to the tangent of a manifold, (n, m).

        Args:
            c: factors of all pieces, (n, pieces).
            q: coordinates, (n, m).
            v: rates.
            a: accelerations.
        """
        model, motion = self.model, self.motion(q, v, a)
        on_basis, on_triples = np.zeros_like(q), c[:, model.kinds["f"]] @ self._loads
        for kind, x, s in (("M", a, motion.a), ("C", v, motion.v), ("K", q, motion.s)):
            numbers, third, first = self._pieces[kind]
            for number, P, B in zip(numbers, third, first, strict=True):
                on_basis += c[:, number, None] * (s @ P.T)
                on_triples += c[:, number, None] * (x @ B.T)
        y = q @ self.shapes
        out = np.zeros_like(y)
        for force, (i, j, k) in zip(on_triples.T, self.triples, strict=True):
            for one, other, another in ((i, j, k), (j, i, k), (k, i, j)):
                out[:, one] += force * y[:, other] * y[:, another]
        return on_basis + out @ self.shapes.T


def expands(model: ReducedModel) -> bool:
    """Return whether all that is of third order is known: loads that turn with a structure have more of it."""
    pieces = [model.system.pieces[i] for i in model.kinds["K"]]
    turning = any(LOADS.name in piece.of and PRESTRESS not in piece.of for piece in pieces)
    return model.system.structure.type in EXPANDED and not turning


def inside(of: frozenset[str]) -> bool:
    """Return whether a piece is of stresses, damping or prestress; the manifold leaves the membrane unstrained."""
    effects = [Effect.registry[name] for name in of if name in Effect.registry]
    return PRESTRESS in of or INTERNAL.name in of or any(effect.internal for effect in effects)
