"""The history of a linear theory by a reduced model whose basis grows until nothing that it lacks is seen any more.

What the basis V lacks is seen in the residual r = M V η̈ + C V η̇ + K V η + f of the full system, which the reduced
equations make orthogonal to V. K⁻¹ r is the static answer to it: an estimate of the error of V η where what is lacking
is stiff, and the shapes that lack. So the basis starts from the static answers to what drives the system, and grows by
the answers to residuals at some instants, those of most energy first. The change of the history with the last shapes is
an estimate that sees what is not stiff, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.reduced.drive import Drive
from rotfem.analysis.reduced.free_hub import free_solution
from rotfem.analysis.reduced.model import ReducedModel
from rotfem.analysis.reduced.refinement import refined
from rotfem.analysis.reduced.solution import Solution, Trajectory, after, nothing
from rotfem.analysis.reduced.tips import largest, tips_of

Array = npt.NDArray[np.float64]

#: Rounds in which a basis may grow, shapes that one adds, and most columns.
ROUNDS, ADDED, MOST = 12, 6, 60

#: Columns from which a basis is wide, and the part of an accuracy by which a shape hardly moves.
WIDE, NEGLIGIBLE = 24, 0.01

#: Instants at which the full system's residual is looked at, and rows of which these are chosen.
INSTANTS, CHOSEN_OF = 24, 600

#: Independent loads, relative to the largest, and most of them.
INDEPENDENT, LOADS = 1e-9, 8

#: Accuracy that is asked for if none is.
ACCURACY = 1e-5


@dataclass(frozen=True)
class Response:
    """A history in the coordinates of a basis.

    Attributes:
        model: the basis and its small matrices.
        solution: how it is solved in time.
        trajectory: coordinates and rates in the rows.
        projection_error, time_error: estimates, relative to the largest displacement of the tip.
        met: whether both are within what was asked for.
        rounds: solutions until the basis was large enough.
        seconds: of processor and clock, what all of it took, compilation apart.
    """

    model: ReducedModel
    solution: Solution
    trajectory: Trajectory
    projection_error: float
    time_error: float
    met: bool
    rounds: int
    seconds: dict[str, float]

    @property
    def times(self) -> Array:
        """Times of the rows, s."""
        return self.solution.times

    @property
    def q(self) -> Array:
        """Coordinates in the rows, (n, m)."""
        return self.trajectory.q

    @property
    def v(self) -> Array:
        """Rates of the coordinates in the rows, (n, m)."""
        return self.trajectory.v

    @property
    def tips(self) -> Array:
        """The unknowns at the tip in all rows, (n, components)."""
        return self.q @ tips_of(self.model).T

    def accelerations(self) -> Array:
        """Return the accelerations of the coordinates in all rows, (n, m)."""
        return self.model.accelerations(self.factors(), self.q, self.v)

    def factors(self) -> Array:
        """Return the factors of all pieces in all rows, just after what jumps there, (n, pieces)."""
        return self.solution.drive.factors(after(self.times))

    def summary(self) -> dict[str, Any]:
        """Return what a summary says of it."""
        return {
            "vectors": self.model.size,
            "rounds": self.rounds,
            "method": "exact exponential" if self.trajectory.exact else "collocation",
            "steps": self.trajectory.steps,
            "projection_error": self.projection_error,
            "time_error": self.time_error,
            "seconds": self.seconds,
        }


def reduced_response(
    system: Any, times: Array, start: Array | None = None, accuracy: float = ACCURACY, parts: int | None = None
) -> Response:
    """Return the history of a linear theory by a reduced model.

    Args:
        system: compiled equations of a linear theory, its hub held or free.
        times: times of the rows, the first 0, s.
        start: shape at t = 0, at rest in the turning frame, local dof array; undeformed if None.
        accuracy: error of basis and time, relative to the largest displacement of the tip, each.
        parts: of each first step of a collocation, whose error is then infinite; as the accuracy asks for if None.

    Raises:
        ComputationError: the stiffness is singular, or the history not finite.
    """
    began = process_time(), perf_counter()
    solution = Solution(Drive(system, times), times) if system.hub is None else free_solution(system, times)
    growth = Growth(ReducedModel(system.held, solution.active), solution, start)
    path, projection = growth.narrow(*growth.grow(accuracy), accuracy)
    path, error = refined(growth, path, accuracy, parts)
    seconds = {"cpu": process_time() - began[0], "wall": perf_counter() - began[1]}
    met = projection <= accuracy and error <= accuracy
    return Response(growth.model, solution, path, projection, error, met, growth.rounds, seconds)


class Growth:
    """A basis that grows with what the full system's residual says it lacks.

    Args:
        model: the reduced model, its basis empty.
        solution: of the history.
        start: shape at t = 0, local dof array; None where undeformed.
    """

    def __init__(self, model: ReducedModel, solution: Solution, start: Array | None):
        self.model, self.solution, self.start = model, solution, start
        self.drive = drive = solution.drive
        self.rounds = 0
        looks = drive.looks()
        self._factors = drive.factors(looks)
        # a motion that begins at rest has the stiffness of the strains there, whose factor is known
        looks = np.append(looks, drive.within(drive.knots[:1], drive.knots[1:2], np.zeros(1)))
        speeds = np.abs(drive.speed(looks))
        ends = [int(speeds.argmax()), int(speeds.argmin())][: 1 if solution.constant else 2]
        self._speeds = speeds[ends]
        self._solvers = [model.stiffness(factors) for factors in drive.factors(looks[ends])]
        self._begin()

    def _begin(self) -> None:
        """Take the static answers to what drives the system at the extreme speeds, their inertia's, and the start."""
        model = self.model
        columns: list[Array] = [] if self.start is None or not np.any(self.start) else [self.start]
        loads = self._loads().T
        answers = [model.solve(solver, loads).T for solver in self._solvers]
        columns += [answer for of_load in zip(*answers, strict=True) for answer in of_load]
        if columns:
            model.grow(np.array(columns).T)
        for kind in "MC":
            strongest = int(np.argmax(np.abs(self._factors[:, model.kinds[kind]]).sum(axis=1)))
            forces = model.forces(kind, self._factors[strongest])
            if forces.size:
                model.grow(model.solve(self._solvers[0], forces))

    def _loads(self) -> Array:
        """Return the independent loads of the history, owned rows, (k, n)."""
        model, numbers = self.model, self.model.kinds["f"]
        if not numbers:
            return np.empty((0, model.owned.stop))
        norms = np.array([float(model.system.pieces[i].operator.norm()) for i in numbers])
        _, sizes, parts = np.linalg.svd(self._factors[:, numbers] * norms, full_matrices=False)
        parts = parts[sizes > INDEPENDENT * max(sizes[0], 1e-300)][:LOADS]
        c = np.zeros((len(parts), self._factors.shape[1]))
        c[:, numbers] = parts / norms
        return np.array([model.load(row) for row in c]).reshape(len(c), model.owned.stop)

    # --- rounds ------------------------------------------------------------------------------------------------------

    def grow(self, accuracy: float) -> tuple[Trajectory, float]:
        """Return the history in a basis large enough, and the estimate of what it lacks.

        Raises:
            ComputationError: the stiffness is singular, or the history not finite.
        """
        model, lacking, error = self.model, np.inf, np.inf
        before: Array | None = None
        if model.size == 0:
            # where nothing moves a structure its free hub may turn yet, of which there is no history
            return nothing(len(self.solution.times)), 0.0 if self.solution.hub is None else np.inf
        while True:
            self.rounds += 1
            path = self.solve()
            tips: Array = path.q @ tips_of(model).T
            size = largest(model, tips)
            if size == 0.0:
                return path, 0.0
            answers = self._answers(path)
            last, lacking = lacking, largest(model, np.array([model.system.tip(x, 0.0) for x in answers])) / size
            if before is not None:
                change = largest(model, tips - before) / size
                error = max(lacking, change * min(1.0, lacking / max(last, 1e-300)))
                if error <= accuracy or self.rounds == ROUNDS:
                    return path, error
            before = tips
            energy = float(np.max(np.einsum("ij,ij->i", path.q, path.q)))
            least = (NEGLIGIBLE * accuracy) ** 2 * energy
            if model.size >= MOST or model.grow(answers.T, ADDED, least) == 0:
                return path, lacking if not np.isfinite(error) else error

    def narrow(self, path: Trajectory, error: float, accuracy: float) -> tuple[Trajectory, float]:
        """Take what hardly moves out of a wide basis that is to be solved in by many steps.

        Args:
            path: the history in the basis that is there.
            error: estimate of what that lacks.
            accuracy: of the tip, relative.

        Returns:
            History and estimate.
        """
        wide, moved = self.model, path.q @ tips_of(self.model).T
        size = largest(wide, moved)
        if path.exact or wide.size < WIDE or self.solution.hub is not None or error > accuracy or not size > 0.0:
            return path, error
        turns = np.linalg.svd(path.q, full_matrices=False)[2].T
        most = np.abs(path.q @ turns).max(axis=0)
        self.model = wide.turned(turns[:, most > NEGLIGIBLE * accuracy * most.max()])
        narrow = self.solve()
        off = error + largest(wide, narrow.q @ tips_of(self.model).T - moved) / size
        if off <= accuracy:
            return narrow, off
        self.model = wide
        return path, error

    def solve(self) -> Trajectory:
        """Return the history in the basis that is there."""
        model = self.model
        rest: Array = np.zeros(model.size)
        return self.solution.solve(model, rest if self.start is None else model.coordinates(self.start), rest)

    def _answers(self, path: Trajectory) -> Array:
        """Return the static answers to the residual at instants of the history, local dof arrays (k, n)."""
        model, times = self.model, self.solution.times
        rows = np.unique(np.linspace(0, len(times) - 1, CHOSEN_OF).astype(int))
        t = after(times[rows])
        c, q, v = self.drive.factors(t), path.q[rows], path.v[rows]
        a = model.accelerations(c, q, v)
        strength = np.linalg.norm(a, axis=1)
        windows = np.array_split(np.arange(len(rows)), min(INSTANTS, len(rows)))
        chosen = [int(w[np.argmax(strength[w])]) for w in windows]
        speeds = np.abs(self.drive.speed(t[chosen]))
        nearest = np.argmin(np.abs(self._speeds - speeds[:, None]), axis=1)
        residuals = model.residuals(*(x[chosen] for x in (c, q, v, a)))
        out = np.empty((len(chosen), len(model.V)))
        for number, solver in enumerate(self._solvers):
            out[nearest == number] = -model.solve(solver, residuals[:, nearest == number]).T
        return out
