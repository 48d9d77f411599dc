"""The history of a linear theory by a reduced model, in a basis and in steps that are refined until nothing changes.

What the basis V lacks is in the residual r = M V η̈ + C V η̇ + K V η + f of the full system, which the reduced equations
make orthogonal to V. Its static solution K⁻¹ r is what the basis grows by, at those instants of the history where the
accelerations are largest, shapes of most energy first (a greedy basis, Quarteroni, Manzoni & Negri 2016, chapter 7).
The error by the basis is the difference that the last shapes have made, that by the steps the difference between the
steps and those of half the length, that of the linear theory the difference that its foreshortening makes.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter, process_time
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.equations import Excitation, FreeHubEquations, HeldEquations, rigid_turn
from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.solution import Solution, States, cut

Array = npt.NDArray[np.float64]

#: Shapes that a round adds to the basis, most columns, and instants at which the residual is taken.
ADDED, MOST, INSTANTS = 6, 60, 24

#: Part of an accuracy below which the amplitude of a shape is of no account.
NEGLIGIBLE = 0.01

#: Steps in a history at first, and how often they are halved at most.
FIRST, HALVINGS = 64, 10

#: Accuracy that is asked for if none is.
ACCURACY = 1e-5


@dataclass(frozen=True)
class Response:
    """A history in the coordinates of a basis.

    Attributes:
        model: the basis and its small matrices.
        equations: of the linear theory.
        times: of the rows, s.
        solution: of the linear equations.
        states: coordinates, rates and accelerations in the rows, (n, m) each.
        basis_error, time_error: relative to the largest displacement of the tip.
        rounds: solutions until the basis was large enough.
        seconds: of processor and clock, what all of it took, compilation excluded.
        manifold: on which it is foreshortened; None where the theory's own displacements are wanted.
        bent: solution of the equations on it.
        foreshortening: largest difference that it makes at the tip, relative.
    """

    model: ReducedModel
    equations: Any
    times: Array
    solution: Solution
    states: States
    basis_error: float
    time_error: float
    rounds: int
    seconds: dict[str, float]
    manifold: Manifold | None = None
    bent: Solution | None = None
    foreshortening: float | None = None

    @cached_property
    def bent_states(self) -> Array:
        """Coordinates of the motion on the manifold in all rows, (n, m); of the linear motion without one."""
        return self.states[0] if self.bent is None else self.equations.coordinates(self.bent, self.times)[0]

    @property
    def tips(self) -> Array:
        """The unknowns at the tip in all rows, (n, components)."""
        if self.manifold is not None:
            return self.manifold.tip(self.bent_states)
        return self.states[0] @ self.model.tips().T

    @property
    def turn(self) -> Array:
        """Angle (rad), speed and its rate of the frame in all rows, (n, 3)."""
        return np.asarray(self.equations.turn(self.times, self.solution))

    def summary(self) -> dict[str, Any]:
        """Return what a summary says of it."""
        out = {
            "vectors": self.model.size,
            "rounds": self.rounds,
            "steps": self.solution.steps,
            "projection_error": self.basis_error,
            "time_error": self.time_error,
            "seconds": self.seconds,
        }
        if self.manifold is not None:
            out["foreshortening"] = {"shapes": self.manifold.shapes.shape[1], "error": self.foreshortening}
        return out


def after(times: Array) -> Array:
    """Return times just after those given, where signals have what follows a jump."""
    return np.asarray(times * (1 + 1e-12))


def reduced_response(
    system: Any,
    times: Array,
    start: Array | None = None,
    accuracy: float = ACCURACY,
    foreshortening: bool = False,
) -> Response:
    """Return the history of a linear theory by a reduced model, from rest in the turning frame.

    Args:
        system: equations of a linear theory, bordered if its hub is free.
        times: of the rows, the first the start, s.
        start: shape at the start, local dof array; undeformed if None.
        accuracy: of the tip, relative to its largest displacement, by the basis and by the steps.
        foreshortening: whether the motion is also computed with its foreshortening.

    Raises:
        ComputationError: the stiffness is singular, or no motion is found.
    """
    return Growth(system, times, start).response(accuracy, foreshortening)


class Growth:
    """A basis that grows with what the full system's residual shows it to lack, and the equations in it.

    Args:
        system: equations of a linear theory.
        times: of the rows, s.
        start: shape at the start, local dof array; None where undeformed.
    """

    def __init__(self, system: Any, times: Array, start: Array | None):
        self.began = process_time(), perf_counter()
        self.system, self.times, self.start = system, times, start
        self.excitation = excitation = Excitation(system.held, times)
        samples = np.append(after(times[:1]), excitation.samples())
        free = system.hub is not None
        turn = rigid_turn(system, samples) if free else excitation.turn(samples)
        self._factors = excitation.factors(samples, turn)
        # of a free hub, whose motion is not known yet, at any speed and rate
        found = excitation.factors(samples, np.ones_like(turn)) if free else self._factors
        self.model = ReducedModel(system.held, np.flatnonzero(np.abs(found).max(axis=0) > 0.0))
        speeds = np.abs(turn[:, 1])
        ends = sorted({int(speeds.argmin()), int(speeds.argmax())}) if np.ptp(speeds) > 0.0 else [0]
        self._speeds, self._solvers = speeds[ends], [self.model.stiffness(self._factors[k]) for k in ends]
        columns = [] if start is None or not np.any(start) else [start[:, None]]
        columns += [self.model.solve(solver, self._loads()) for solver in self._solvers]
        self.model.grow(np.hstack(columns))

    def _loads(self) -> Array:
        """Return the independent loads of the history, eight at most, owned rows, (n, k)."""
        model, numbers = self.model, self.model.kinds["f"]
        norms = np.array([float(model.system.pieces[i].operator.norm()) for i in numbers])
        _, sizes, parts = np.linalg.svd(self._factors[:, numbers] * norms, full_matrices=False)
        parts = parts[sizes > 1e-9 * max(sizes.max(initial=0.0), 1e-300)][:8]
        return np.asarray((parts / norms @ model.loads).T)

    def equations(self) -> HeldEquations:
        """Return the equations in the basis that is there."""
        if self.system.hub is None:
            return HeldEquations(self.model, self.excitation)
        return FreeHubEquations(self.model, self.excitation, self.system)

    def solved(self, equations: HeldEquations, longest: float) -> tuple[Solution, States]:
        """Return the solution by steps no longer than this (s), and the states of the structure in the rows."""
        solution = Solution(equations, cut(self.excitation.knots, longest), *equations.start(self.start))
        return solution, equations.coordinates(solution, self.times)

    def response(self, accuracy: float, foreshortening: bool) -> Response:
        """Return the history in a basis and in steps that an accuracy asks for (see `reduced_response`)."""
        rounds, basis_error, before = 0, np.inf, None
        longest = float(self.times[-1] - self.times[0]) / FIRST
        while True:
            rounds += 1
            equations = self.equations()
            solution, states = self.solved(equations, longest)
            tips = self._tips(states)
            if before is not None:
                basis_error = self._difference(tips, before)
            if basis_error <= accuracy or self.model.size >= MOST:
                break
            before = tips
            negligible = NEGLIGIBLE * accuracy
            energy = float(np.einsum("ni,ni->n", states[0], states[0]).max(initial=0.0))
            if self.model.grow(self._lacking(equations, solution, states), ADDED, negligible**2 * energy) == 0:
                basis_error = negligible if self.model.size else 0.0
                break
        time_error = 0.0
        for _ in range(HALVINGS if self.model.size else 0):
            longest /= 2
            solution, states = self.solved(equations, longest)
            tips, before = self._tips(states), tips
            time_error = self._difference(tips, before)
            if time_error <= accuracy:
                break
        out = Response(
            self.model, equations, self.times, solution, states, basis_error, time_error, rounds, {"cpu": 0.0}
        )
        if foreshortening:
            manifold = Manifold(self.model, states[0])
            beside = copy(equations)
            beside.further = equations.second_order(manifold, solution)
            bent, (q, _, _) = self.solved(beside, longest)
            found = manifold.tip(q)
            difference = self.model.largest(found - tips) / max(self.model.largest(found), 1e-300)
            out = replace(out, manifold=manifold, bent=bent, foreshortening=difference)
        began, now = self.began, (process_time(), perf_counter())
        return replace(out, seconds={"cpu": now[0] - began[0], "wall": now[1] - began[1]})

    def _tips(self, states: States) -> Array:
        return np.asarray(states[0] @ self.model.tips().T)

    def _difference(self, tips: Array, before: Array) -> float:
        """Return the largest difference of the tips in all rows, relative to the largest displacement."""
        change = self.model.largest(tips - before)
        return change / self.model.largest(tips) if change > 0.0 else 0.0

    def _lacking(self, equations: HeldEquations, solution: Solution, states: States) -> Array:
        """Return the static solutions K⁻¹ r at instants of the history, local dof arrays (n, k)."""
        strength = np.linalg.norm(states[2], axis=1)
        parts = np.array_split(np.arange(len(strength)), min(INSTANTS, len(strength)))
        chosen = np.array([part[np.argmax(strength[part])] for part in parts])
        turn = equations.turn(after(self.times[chosen]), solution)
        factors = self.excitation.factors(after(self.times[chosen]), turn)
        residuals = self.model.residuals(factors, *(x[chosen] for x in states))
        nearest = np.argmin(np.abs(self._speeds - np.abs(turn[:, 1:2])), axis=1)
        found = [self.model.solve(s, residuals[:, nearest == k]) for k, s in enumerate(self._solvers)]
        return np.hstack(found)
