"""The history of a linear theory by a reduced model, in a basis and in steps that are refined until nothing changes.

What the basis V lacks is in the residual r = M V η̈ + C V η̇ + K V η + f of the full system, which the reduced equations
make orthogonal to V. Its static solution K⁻¹ r is what the basis grows by, at those instants of the history where the
accelerations are largest, first the shapes that are largest in energy or at the tip (a greedy basis, Quarteroni,
Manzoni & Negri 2016, chapter 7).
The error by the basis is the difference that the last shapes have made, that by the steps the difference between the
steps and those of half the length, that of the linear theory the difference that its foreshortening makes.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from time import perf_counter, process_time
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.equations import Excitation, FreeHubEquations, HeldEquations, rigid_turn
from rotfem.analysis.reduced.manifold import Manifold
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.solution import Solution, States, cut

Array = npt.NDArray[np.float64]

#: Most columns of a basis.
MOST_COLUMNS = 60

#: Part of an accuracy below which a shape is of no account, as a part of the motion.
NEGLIGIBLE = 0.01

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
        states: coordinates, rates and accelerations of them in the rows, (n, m) each.
        tips: the unknowns at the tip in all rows, (n, components).
        basis_error, time_error: relative to the largest displacement of the tip.
        rounds: solutions until the basis was large enough.
        seconds: of processor and clock, what all of it took, compilation excluded.
        manifold: on which it is foreshortened; None where the theory's own displacements are wanted.
        bent: coordinates of the motion on it in the rows, (n, m).
        foreshortening: largest difference that it makes at the tip, relative.
    """

    model: ReducedModel
    equations: Any
    times: Array
    solution: Solution
    states: States
    tips: Array
    basis_error: float
    time_error: float
    rounds: int
    seconds: dict[str, float]
    manifold: Manifold | None = None
    bent: Array | None = None
    foreshortening: float | None = None

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

    Each round adds six shapes to the basis, up to MOST_COLUMNS columns; 64 steps are halved ten times at most.

    Args:
        system: equations of a linear theory, bordered if its hub is free.
        times: of the rows, the first the start, s.
        start: shape at the start, local dof array; undeformed if None.
        accuracy: of the tip, relative to its largest displacement, by the basis and by the steps.
        foreshortening: whether the motion is also computed with its foreshortening.

    Raises:
        ComputationError: the stiffness is singular, or no motion is found.
    """
    began, growth = (process_time(), perf_counter()), BasisEnrichment(system, times, start)
    model, longest = growth.model, float(times[-1] - times[0]) / 64
    rounds, basis_error, time_error, before = 0, np.inf, 0.0, None

    def solved(equations: HeldEquations) -> tuple[Solution, States]:
        solution = Solution(equations, cut(growth.excitation.knots, longest), *equations.start(start))
        return solution, equations.coordinates(solution, times)

    def difference(tips: Array, other: Array) -> float:
        """Return the largest difference of the tips, relative to the largest displacement."""
        return model.largest(tips - other) / max(model.largest(tips), 1e-300)

    while True:
        rounds += 1
        equations = growth.equations()
        solution, states = solved(equations)
        tips = states[0] @ model.tips().T
        if before is not None:
            basis_error = difference(tips, before)
        if basis_error <= accuracy or model.size >= MOST_COLUMNS:
            break
        before = tips
        if model.grow(growth.lacking(equations, solution, states), 6, NEGLIGIBLE * accuracy, states[0]) == 0:
            basis_error = NEGLIGIBLE * accuracy if model.size else 0.0
            break
    for _ in range(10 if model.size else 0):
        longest /= 2
        solution, states = solved(equations)
        tips, before = states[0] @ model.tips().T, tips
        time_error = difference(tips, before)
        if time_error <= accuracy:
            break
    out = Response(model, equations, times, solution, states, tips, basis_error, time_error, rounds, {})
    if foreshortening:
        manifold, bending = Manifold(model, states[0]), copy(equations)
        bending.further = equations.second_order(manifold, solution)
        bent = solved(bending)[1][0]
        found = manifold.tip(bent)
        out = replace(out, manifold=manifold, bent=bent, tips=found, foreshortening=difference(found, tips))
    return replace(out, seconds={"cpu": process_time() - began[0], "wall": perf_counter() - began[1]})


class BasisEnrichment:
    """A basis that grows with what the full system's residual shows it to lack, and the equations in it.

    Args:
        system: equations of a linear theory.
        times: of the rows, s.
        start: shape at the start, local dof array; None where undeformed.
    """

    def __init__(self, system: Any, times: Array, start: Array | None):
        self.system, self.times = system, times
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

    def lacking(self, equations: HeldEquations, solution: Solution, states: States) -> Array:
        """Return the static solutions K⁻¹ r at 24 instants of the history, local dof arrays (n, k)."""
        strength = np.linalg.norm(states[2], axis=1)
        parts = np.array_split(np.arange(len(strength)), min(24, len(strength)))
        chosen = np.array([part[np.argmax(strength[part])] for part in parts])
        turn = equations.turn(after(self.times[chosen]), solution)
        factors = self.excitation.factors(after(self.times[chosen]), turn)
        residuals = self.model.residuals(factors, *(x[chosen] for x in states))
        nearest = np.argmin(np.abs(self._speeds - np.abs(turn[:, 1:2])), axis=1)
        found = [self.model.solve(s, residuals[:, nearest == k]) for k, s in enumerate(self._solvers)]
        return np.hstack(found)
