"""Foreshortening given back to a reduced linear model: q = V η + ½ Θ η η, the motion on that manifold, and its forces.

A beam that bends comes nearer to its clamp, a second-order displacement that linear strains do not have. Θ_ij is the
answer of the membrane to a pair of bending shapes,

    K₀ Θ_ij + ∫ N(δq) D²Γ₁[V_i, V_j] = 0,

with which the membrane is not strained by them to second order. What moves in the second order also has inertia. Its
forces, projected on the tangent V + Θ η of the manifold (Jain, Tiso, Rutzmoser & Rixen 2017, section 3), are those that
the linear equations lack: the answer to them is an estimate of what is left, and of how large an effect is.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from rotfem.analysis.reduced.collocation import Lacking
from rotfem.analysis.reduced.fourth_order import FourthOrder
from rotfem.analysis.reduced.load_work import LoadWork
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.reduced.solution import Solution, Trajectory
from rotfem.analysis.reduced.third_order import Motion, ThirdOrder, expands, inside
from rotfem.analysis.reduced.tips import largest, tips_of
from rotfem.equations.geometric import second_order_work
from rotfem.mechanics.theories import stiffened
from rotfem.numerics import compat, forms
from rotfem.numerics.projection import summed, times

Array = npt.NDArray[np.float64]

#: Amplitude of a shape, relative to the largest, from which its foreshortening matters, and most shapes.
MATTERS, MOST = 2e-3, 6

#: How many times as long steps may be in which answers to forces are found, if that puts these, a small part of the
#: motion, off by no more than this part of the error of the steps.
LONGER, SMALL = (8, 4, 2, 1), 0.2

#: Rounds in which forces of third order are balanced where all of them are known.
ROUNDS = 2


class Manifold:
    """The second-order displacements of a response, and the forces of their inertia.

    Args:
        response: history of a reduced model.
        third: whether with what is of third order, of structures that have it.

    Attributes:
        shapes: coordinates of the shapes whose pairs are taken, (m, r).
        pairs: numbers (i, j) of these, i ≤ j.
        Theta: answers to the pairs, local dof arrays (n, p).
        third: displacements of third order, or None.
        fourth: the work of loads in those of fourth order, or None.
    """

    def __init__(self, response: Response, third: bool = False):
        self.response, self.model = response, response.model
        _, sizes, turns = np.linalg.svd(response.q, full_matrices=False)
        keep = sizes > MATTERS * sizes[:1].max(initial=0.0)
        self.shapes: Array = turns[keep][:MOST].T
        self.pairs = list(combinations_with_replacement(range(self.shapes.shape[1]), 2))
        self._i, self._j = np.array(self.pairs, dtype=int).reshape(-1, 2).T
        self._factor = np.where(self._i == self._j, 0.5, 1.0)
        self.third: ThirdOrder | None = None
        self.fourth: FourthOrder | None = None
        self._loads: LoadWork | None = None
        third = third and expands(self.model)
        # what the exact strains have of second order is in the geometric stiffness, of all of them or of some
        some = third and not all(map(self.model.system.model.prestresses, self.model.system.model.mechanics.strains))
        self.Theta = self._answers(whole=some)
        self.tips = tips_of(self.model, self.Theta)
        self._project()
        if some:
            self._loads = LoadWork(self.model, self.shapes, self.pairs, self._factor * self.Theta)
        if third:
            seconds = {p: f * x for p, f, x in zip(self.pairs, self._factor, self.Theta.T, strict=True)}
            self.third = ThirdOrder(self.model, self.shapes, seconds)
            if response.solution.hub is None:
                self.fourth = FourthOrder(self.model, self.shapes, self._displaced)

    def _answers(self, whole: bool) -> Array:
        """Return Θ of all pairs, one solution each, of the prestressed strains or of the whole of them."""
        system, V = self.model.system, self.model.V @ self.shapes
        first, second = fem.Function(system.V), fem.Function(system.V)
        test = ufl.TestFunction(system.V)
        if whole:
            work = second_order_work(system.model, (first, second), test)
        else:
            work = system.geometric(first, second, test, stiffened())
        out = np.zeros((len(V), len(self.pairs)))
        if not self.pairs:
            return out
        form, right = forms.form(work, once=True), out[self.model.owned]
        for column, (i, j) in zip(right.T, self.pairs, strict=True):
            first.x.array[:], second.x.array[:] = V[:, i], V[:, j]
            b = compat.create_vector(system.V)
            fem_petsc.assemble_vector(b, form)
            b.ghostUpdate(addv=compat.ADD, mode=compat.REVERSE)
            b.array[system.clamped] = 0.0
            column[:] = b.array[self.model.owned]
        return -self.model.solve(system.material_solver, right)

    def _project(self) -> None:
        """Project the pieces of inertia and loads on V and Θ; those of strains and prestress vanish or are linear."""
        model, system = self.model, self.model.system
        owned, V = model.owned, model.V[model.owned]
        Theta = self.Theta[owned]
        self._pieces: dict[str, tuple[list[int], Array, Array]] = {}
        for kind in "MCK":
            numbers = [i for i in model.kinds[kind] if not inside(system.pieces[i].of)]
            on_pairs = [times(system.pieces[i].operator, Theta) for i in numbers]
            on_basis = [model.product(i) for i in numbers]
            whole = np.hstack([V, Theta])
            second = np.array([summed(model.comm, whole.T @ P) for P in on_pairs])
            first = np.array([summed(model.comm, Theta.T @ P) for P in on_basis])
            n, m, p = len(numbers), model.size, len(self.pairs)  # where nothing moves there is no m, and no p
            self._pieces[kind] = (numbers, second.reshape(n, m + p, p), first.reshape(n, p, m))

    def _displaced(self, y: Array) -> tuple[Array, Array, Array]:
        """Return displacements of first, second and third order (local dof arrays) of coordinates of shapes (r,)."""
        assert self.third is not None
        q = (self.shapes @ y)[None, :]
        return self.model.V @ q[0], self.Theta @ self.second(q).s[0], self.third.Xi @ self.third.products(q)[0]

    # --- motion on the manifold --------------------------------------------------------------------------------------

    def second(self, q: Array, v: Array | None = None, a: Array | None = None) -> Motion:
        """Return the coordinates of the pairs, and their rates, of coordinates, rates and accelerations (n, m)."""
        x = q @ self.shapes
        i, j, c = self._i, self._j, self._factor
        dx, ddx = (np.zeros_like(x) if y is None else y @ self.shapes for y in (v, a))
        rate = c * (dx[:, i] * x[:, j] + x[:, i] * dx[:, j])
        return Motion(
            c * x[:, i] * x[:, j], rate, c * (ddx[:, i] * x[:, j] + 2 * dx[:, i] * dx[:, j] + x[:, i] * ddx[:, j])
        )

    def tip(self, q: Array, third: bool = True) -> Array:
        """Return the unknowns at the tip of coordinates (n, m), foreshortening with them, (n, components)."""
        out = q @ tips_of(self.model).T + self.second(q).s @ self.tips.T
        return out if self.third is None or not third else out + self.third.products(q) @ self.third.tips.T

    def shape(self, q: Array) -> Array:
        """Return the displacement (local dof array) of coordinates (m,)."""
        out = self.model.V @ q + self.Theta @ self.second(q[None, :]).s[0]
        return np.asarray(out if self.third is None else out + self.third.Xi @ self.third.products(q[None, :])[0])

    def forces(self, c: Array, q: Array, v: Array, a: Array, third: bool) -> Array:
        """Return the forces of inertia and loads that the linear equations lack, on the tangent, (n, m).

        Args:
            c: factors of all pieces, (n, pieces).
            q: coordinates, (n, m).
            v: rates.
            a: accelerations.
            third: whether with those of third order, to which the rate of the speed counts as of first.
        """
        m, motion, p = self.model.size, self.second(q, v, a), len(self.pairs)
        on_basis, on_pairs = np.zeros((len(q), m)), np.zeros((len(q), p))
        for kind, x, s in (("M", a, motion.a), ("C", v, motion.v), ("K", q, motion.s)):
            numbers, second, first = self._pieces[kind]
            for number, P, B in zip(numbers, second, first, strict=True):
                if not third and any(name == "dw" for name, _ in self.model.system.pieces[number].key):
                    continue
                weight = c[:, number, None]
                both = weight * (s @ P.T)
                on_basis += both[:, :m]
                on_pairs += weight * (x @ B.T) + third * both[:, m:]
        if self._loads is not None:
            on_basis += self._loads.forces(c, q)
        return on_basis + self._along(q, on_pairs)

    def _along(self, q: Array, on_pairs: Array) -> Array:
        """Return the transpose of ∂s/∂η times forces on the pairs, (n, m)."""
        x, out = q @ self.shapes, np.zeros((len(q), self.shapes.shape[1]))
        for k, (i, j) in enumerate(self.pairs):
            force = self._factor[k] * on_pairs[:, k]
            out[:, i] += force * x[:, j]
            out[:, j] += force * x[:, i]
        return out @ self.shapes.T

    def corrections(self, solution: Solution, orders: Sequence[bool] = (True,)) -> tuple[Trajectory, list[Array]]:
        """Return a trajectory, and the answers of the linear equations to the forces that they lack on it, (rows, m).

        The trajectory is one by collocation, which has no vibrations faster than its steps: their forces average to
        nothing.

        Args:
            solution: of the trajectory, with no free hub.
            orders: `third` of `forces`, of each answer.
        """
        start = self.response.q[0], self.response.v[0]
        if self.model.size == 0:  # nothing moves
            return self.response.trajectory, [self.response.q for _ in orders]
        return solution.answered(self.model, *start, self._lacking(solution, orders))

    def _lacking(self, solution: Solution, orders: Sequence[bool]) -> Lacking:
        def lacking(t: Array, q: Array, v: Array, a: Array) -> list[Array]:
            c = solution.drive.factors(t)
            return [self._all_forces(c, q, v, a, third) for third in orders]

        return lacking

    def _all_forces(self, c: Array, q: Array, v: Array, a: Array, third: bool) -> Array:
        """Return the `forces`, with all of third order where these are known, (n, m)."""
        found = self.forces(c, q, v, a, third)
        if third and self.third is not None and self.fourth is not None:
            found += self.third.forces(c, q, v, a) + self.fourth.forces(c, q)
        return found

    @cached_property
    def own(self) -> tuple[Trajectory, list[Array]]:
        """The `corrections` of the response without and with forces of third order; a round more if all are known."""
        response, hub, path = self.response, self.response.solution.hub, self.response.trajectory
        if self.fourth is not None and self.model.size:
            size = largest(self.model, response.tips)
            for longer in LONGER:
                solution = response.solution.again(longer)
                off = response.solution.of_longer(longer)
                if longer > 1 and not off < size:
                    continue
                lacking = self._lacking(solution, (False, True))
                path, answers = solution.rounds(self.model, (response.q[0], response.v[0]), lacking, ROUNDS)
                moved = largest(self.model, answers[-1] @ tips_of(self.model).T)
                if longer == 1 or off * moved <= SMALL * response.time_error * size**2:
                    return path, answers
        if hub is None:
            return self.corrections(self.response.solution, (False, True))
        if self.third is not None:
            return path, self.with_hub(hub, rounds=2)
        return path, [self.with_hub(hub, third)[0] for third in (False, True)]

    def with_hub(self, solution: Any, third: bool = True, rounds: int = 1) -> list[Array]:
        """Return the answers of structure and free hub to the forces that they lack, of each round, (rows, m).

        The hub feels all displacements beside the basis. With those of third order all forces of that order are there.

        Args:
            solution: of the trajectory, with a free hub.
            third: see `forces`.
            rounds: of Newton's method.
        """
        model, more, r = self.model, self.third, self.shapes.shape[1]
        beside = self.Theta if more is None else np.hstack([model.V @ self.shapes, self.Theta, more.Xi])
        felt = solution.moment_along(beside, first_order=more is None)

        def lacking(t: Array, state: tuple[Array, ...]) -> Array:
            turn, (q, v, a) = np.stack([y[:, -1] for y in state], axis=1), (y[:, :-1] for y in state)
            c, motion = solution.drive.made_of(solution.drive.constants(t, *turn.T), len(t)), self.second(q, v, a)
            found, whole = self.forces(c, q, v, a, third), [motion.s, motion.v, motion.a]
            rest = [0 * s for s in whole]
            if more is not None:
                found, cubic = found + more.forces(c, q, v, a), more.motion(q, v, a)
                first, triples = [y @ self.shapes for y in (q, v, a)], (cubic.s, cubic.v, cubic.a)
                whole = [np.hstack(parts) for parts in zip(first, whole, triples, strict=True)]
                rest = [np.hstack([x, 0 * y[:, r:]]) for x, y in zip(first, whole, strict=True)]
            return np.column_stack([found, felt(t, turn, *whole) - felt(t, turn, *rest)])

        answers: list[Array] = solution.corrections(model, lacking, rounds)
        return answers
