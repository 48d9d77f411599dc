"""What the commands report of the error of their results: its contributions, and when a warning is due."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import stability_of
from rotfem.analysis.theory_error import RESOLVED, TheoryError
from rotfem.commands.first_state import Start
from rotfem.commands.recorder import Monitor
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.theories import compared
from rotfem.numerics.newton import Newton
from rotfem.refinement.coarser import on_other_mesh
from rotfem.refinement.distance import OUTPUTS, Output, largest, of_columns, sizes, tip
from rotfem.refinement.estimate import NOTICED, ErrorEstimate, percent
from rotfem.scene import Scene

Array = npt.NDArray[np.float64]

#: What the contributions are called in warnings.
NAMES = {"time": "time steps", "space": "mesh", "model": "theory"}


@dataclass
class RunErrors:
    """The errors of what a run has computed.

    Attributes:
        scene: what was run.
        system: of its problem.
        history: columns of its rows.
        wanted: whether errors are to be estimated.
        monitor: what has seen its states.
        shape: the equilibrium, a local dof array; None of a history.
        stepper: of a march; None of others.
        start: returns what the history starts from in another system of the problem.
    """

    scene: Scene
    system: Any
    history: Mapping[str, Array]
    wanted: bool
    monitor: Monitor
    shape: Array | None
    stepper: Any
    start: Callable[[Any], Start]

    @property
    def problem(self) -> Problem:
        """What was computed."""
        problem: Problem = self.system.model.problem
        return problem

    @property
    def _scale(self) -> float:
        """Largest displacement of the tip, m."""
        return largest(of_columns("tip", self.history, self.system.structure))

    def estimate(self) -> ErrorEstimate | None:
        """Return the error, relative to the largest value of its output; None if not wanted, or nothing was computed.

        The output is the displacement of the tip, or what `accuracy_of` names.
        """
        if not self.wanted or not len(self.history["t"]):
            return None
        of = output_of(self.scene)
        scale = largest(of_columns(of, self.history, self.system.structure))
        contributions: dict[str, float | None] = {"time": None, "space": None}
        found: dict[str, Any] = {"scale": scale}
        if self.shape is not None:
            contributions = {"time": 0.0, "space": self._of_mesh(OUTPUTS[of])}
        return ErrorEstimate({**contributions, "model": None if self.theory is None else self.theory.estimate}, found)

    @cached_property
    def theory(self) -> TheoryError | None:
        """Error of the theory; None where it is unknown, not wanted, or nothing was computed."""
        if not len(self.history["t"]):
            return None
        names = self.system.structure.components
        tips = np.array([np.max(np.abs(self.history[f"tip_{name}"])) for name in names])
        in_balance = self.scene.time is not None and self.scene.initial.first is None
        richer = richer_problem(self.problem)
        if richer is None:
            return self.monitor.farthest.error(self.system, tips, in_balance)
        try:
            found = self._apart(richer) if self.wanted else None
        except (ComputationError, InputError):
            return None
        if found is None:
            return None
        system, apart, components = found
        if self.shape is not None and self._buckles(system):
            why = "it is above a buckling load that this theory does not have"
            return TheoryError(1.0, why, self.problem.theory.name)
        base = self.monitor.farthest.error(system, tips, in_balance)
        if base is None:
            return None
        sizes = tips * self.system.structure.lever
        resolved = sizes > RESOLVED * np.max(sizes, initial=0.0)
        each = zip(names, components, sizes, resolved, strict=True)
        own = {f"tip_{name}": d / size for name, d, size, known in each if known}
        return base.of_poorer(self.problem.theory, apart, own)

    def _apart(self, richer: Problem) -> tuple[Any, float, Array] | None:
        """Return the system of a richer theory, how far its tip is from the run's, relative, and by components, m.

        None where that is not known. The difference of equilibria is relative to the smaller displacement.

        Raises:
            ComputationError: there is no answer in that theory.
            InputError: it cannot have what the problem has.
        """
        if self.shape is None:
            return None
        system = compile_system(richer.replace(outputs={}), self.system.comm, moving=False)
        own, there = self._answer(self.system), self._answer(system)
        scale = min(largest(own), largest(there))
        return system, _relative(largest(there - own), scale), np.abs(there - own).max(axis=0)

    def _answer(self, system: Any, output: Output = tip) -> Array:
        """Return an output (1, components) of the equilibrium in the run's system or another one.

        Raises:
            ComputationError: there is none.
        """
        solver, speed = self.scene.solver, self.problem.motion.speed(0.0)
        if system is self.system and self.shape is not None:
            q = self.shape.copy()
        else:
            q = steady_state(system, speed, Newton.of(solver))
        return output(system, State.at_rest(system, *system.start(q)))[None, :]

    def _of_mesh(self, output: Output) -> float | None:
        """Return the error of an output by the mesh: its difference to the one on another mesh; None if unknown."""
        own, other = self._answer(self.system, output), on_other_mesh(self.problem, self.system, moving=False)
        if other is None:
            return None
        try:
            there = self._answer(other.system, output)
        except ComputationError:
            return None
        return other.error(largest(there - own) / (largest(own) or np.inf))

    def _buckles(self, system: Any) -> bool:
        """Return whether a richer theory has no stable equilibrium where the run's is stable; its state is set."""
        there = stability_of(system, system.held.q.x.array.copy(), self.problem.motion.speed(0.0))
        return there.stable is False and self.monitor.stability is not None and self.monitor.stability.stable is True

    def warnings(self, error: ErrorEstimate) -> list[str]:
        """Return what is to be known of an error; nothing where it is small, asked for, or reported already."""
        scene, time = self.scene, self.scene.time
        if scene.accuracy is not None:  # what asked for it says what was reached
            return []
        unknown = [word for name, word in NAMES.items() if error.contributions[name] is None]
        said = []
        if unknown:
            why = self._why_unknown(error)
            said = [f"the error by the {' and the '.join(unknown)} could not be estimated: {why}"]
        allowed = max(NOTICED, (time and time.tolerance) or 0.0)
        if error.total is None or error.total <= allowed:
            return said
        steps, mesh, model = sizes = [error.contributions[name] or 0.0 for name in NAMES]
        if steps + mesh <= NOTICED and self.theory is not None and self.theory.warning():
            return said
        cures = []
        if steps >= NOTICED / 2 and self.stepper is not None:
            assert time is not None
            factor = min(1.0, NOTICED / 2 / steps)
            if time.tolerance is not None:
                cures.append(f"time.tolerance = {rounded_down(time.tolerance * factor)}")
            else:
                step = time.step * factor ** (1 / self.stepper.scheme.order)
                cures.append(f"time.step = {rounded_down(step)} or shorter")
        if mesh >= NOTICED / 2:
            cures.append("a higher mesh.degree" if scene.structure.mesh_file else "more mesh.elements")
        if model >= NOTICED / 2:
            cures.append("a more exact theory")
        named = zip(NAMES.values(), sizes, strict=True)
        parts = ", ".join(f"{percent(size)} by the {name}" for name, size in named if size > sum(sizes) / 10)
        off = f"the tip may be in error by {percent(error.total)} of its largest displacement (estimated: {parts})"
        return [f"{off}; to reduce it: {', '.join(cures)}" if cures else off, *said]

    def _why_unknown(self, error: ErrorEstimate) -> str:
        """Return why a contribution is unknown."""
        if error.contributions["time"] is None:
            return "errors of histories are not estimated"
        if error.contributions["space"] is None:
            return "there is no other mesh to compare with, or the run failed on it"
        return "the run failed with a more exact theory"


def rounded_down(x: float) -> str:
    """Return a positive number with one digit, not above it."""
    power = 10.0 ** math.floor(math.log10(x))
    return f"{math.floor(x / power * (1 + 1e-9)) * power:.1g}"


def _relative(apart: float, scale: float) -> float:
    """Return a difference relative to a scale; all of it where there is no scale."""
    if apart == 0.0:
        return 0.0
    return apart / scale if scale > 0.0 else 1.0


def richer_problem(problem: Problem) -> Problem | None:
    """Return a problem in the richer theory that it is compared with; None where there is none."""
    richer = compared(problem.theory, problem.structure.type)
    return None if richer is None else problem.replace(theory=richer)


def output_of(scene: Scene) -> str:
    """Return the name of the output whose error a run of a scene estimates."""
    return scene.accuracy_of if scene.accuracy_of in OUTPUTS else "tip"


def error_of_modes(rows: Sequence[Mapping[str, Any]], theory: TheoryError | None) -> ErrorEstimate:
    """Return the largest error of the eigenvalues of rows, relative to each.

    Of one that is zero to round-off it is relative to the least at the same speed that is not.
    """
    flexible = [row for row in rows if row.get("stability") != "neutral"]
    mesh, bound = [row["mesh_error"] for row in flexible], 0.0
    for speed in {row.get("speed") for row in flexible}:
        there = [row for row in flexible if row.get("speed") == speed]
        bounds, found = np.array([(row["error_bound"], complex(row["growth"], row["frequency"])) for row in there]).T
        with np.errstate(over="ignore"):  # none of them is resolved
            of_others = np.abs(bounds * found) / sizes(np.where(np.abs(bounds) < 1.0, found, 0.0))
        bound = max(bound, float(np.minimum(np.abs(bounds), of_others).max()))
    space = None if None in mesh else float(max(mesh, default=0.0))
    return ErrorEstimate({"space": space, "model": None if theory is None else theory.estimate, "round_off": bound})
