"""One run: the compiled system, its march or its equilibrium, and what is watched on the way."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.critical_speed import critical_speed
from rotfem.analysis.dense_output import RowTimes
from rotfem.analysis.equilibrium import steady_state
from rotfem.analysis.reduced.foreshortened import Foreshortened
from rotfem.analysis.reduced.response import Response
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import Stability, stability_of
from rotfem.analysis.stepper import Stepper
from rotfem.analysis.theory_error import Farthest, TheoryError, said_of
from rotfem.analysis.time_loop import LARGEST_LINEAR_DEFLECTION, March, Steps
from rotfem.commands import energy_growth
from rotfem.commands.energy_growth import diverged
from rotfem.commands.error_report import error_of_run, error_wanted, output_of, theory_error_of_run, warnings_of_run
from rotfem.commands.first_state import first_state
from rotfem.commands.interrupts import Interrupted
from rotfem.commands.keeper import Keeper
from rotfem.commands.loads import held
from rotfem.commands.problem import scheme_of
from rotfem.commands.recorder import Recorder
from rotfem.commands.reduced_history import by_reduced_model
from rotfem.commands.summary import run_summary
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError
from rotfem.listeners import Progress
from rotfem.mechanics.problem import Problem
from rotfem.numerics.newton import Newton
from rotfem.refinement.discretisation import HistoryErrors, richer_problem
from rotfem.refinement.distance import OUTPUTS
from rotfem.refinement.estimate import ErrorEstimate
from rotfem.refinement.refine import Setting
from rotfem.results.run import RunResult
from rotfem.scene import Scene, Time
from rotfem.selection.model_choice import Choice, RangeExceeded
from rotfem.structures.symmetry import inactive_unknowns

Array = npt.NDArray[np.float64]


class Simulation:
    """One run of a scene.

    Args:
        scene: the scene as it was asked for.
        problem: its problem, with the model it is run with.
        comm: MPI communicator.
        choice: how this model was chosen, if it was.
        keeper: what is kept of it on disk while it goes on.
    """

    def __init__(
        self,
        scene: Scene,
        problem: Problem,
        comm: MPI.Comm = MPI.COMM_WORLD,
        choice: Choice | None = None,
        keeper: Keeper | None = None,
    ):
        self.started = perf_counter()
        self.keeper = keeper or Keeper(comm)
        self.scene, self.comm, self.choice = scene, comm, choice
        self.setting: Setting | None = None
        self.clock: Callable[[int, float], None] | None = None
        self.warnings: list[str] = [] if choice is None else choice.upgrade_warnings()
        self.advice: list[str] = []
        if scene.time is None and problem.frame == "inertial":
            problem = problem.replace(frame="rotating")
            self.warnings.append("a steady state is one only in the rotating frame, where it was computed")
        self.problem = problem = self._of_active_unknowns(problem)
        self.system: Any = compile_system(problem, comm, moving=scene.time is not None)
        self.system.compile_readings()
        self.compiled = perf_counter() - self.started
        self.record = Recorder(self.system, scene.output)
        self.newton = Newton.of(scene.solver)
        self.stepper: Stepper | None = None
        self.reduced: Response | None = None
        self.response: Response | None = None
        self.foreshortened: Foreshortened | None = None
        self.steps, self.elapsed = 0, 0.0
        self.resumed: list[dict[str, Any]] = []
        by_basis = scene.time is not None and bool(scene.model.reduced)
        self.critical = None if by_basis else critical_speed(self.system)
        self.stability: Stability | None = None
        self.farthest = Farthest(self.system)
        self.theory_error: TheoryError | None = None
        self.companions: HistoryErrors | None = None
        self.rows: RowTimes | None = None
        self.last: State | None = None
        self.error: ErrorEstimate | None = None
        self._critical_since: float | None = None
        self._exceeded = ""

    def _of_active_unknowns(self, problem: Problem) -> Problem:
        """Return the problem of a history without the unknowns that symmetry keeps at zero."""
        model, initial = self.scene.model, self.scene.initial
        undisturbed = not initial.moves and initial.tip_displacement is None
        if self.scene.time is None or model.all_unknowns or model.reduced or not undisturbed:
            return problem
        return problem.replace(inactive=inactive_unknowns(problem))

    def run(self, progress: Progress | None = None) -> RunResult:
        """Return the result of the scene (see `rotfem.run`).

        Raises:
            ComputationError: it failed; its attribute `result` holds what was computed until then.
        """
        try:
            self._steady() if self.scene.time is None else self._march(progress or (lambda share: None))
        except (ComputationError, KeyboardInterrupt) as error:
            failure = self._failure(error) if isinstance(error, ComputationError) else None
            if self.comm.size > 1 and failure is None and not isinstance(error, Interrupted):
                raise  # the others may be anywhere
            status = "interrupted" if failure is None else "failed"
            vars(failure or error)["result"] = self.result(status, failure)
            if failure is not None and failure is not error:
                raise failure from error
            raise
        return self.result("done")

    # --- the two kinds of run ----------------------------------------------------------------------------------------

    def _steady(self) -> None:
        omega = self.problem.motion.speed(0.0)
        past = self.scene.solver.past_limits
        self.warnings += held(self.problem)
        q = steady_state(self.system, omega, self.newton, past_limits=past, notes=self.warnings)
        self.stability = stability_of(self.system, q, omega)
        q, v = self.system.start(q)
        self._keep(State.at_rest(self.system, q, v))
        if said := self.stability.warning():
            if self.critical is not None and abs(omega) > self.critical:
                said += (
                    f"; {abs(omega):g} rad/s is above the speed {self.critical:.6g} rad/s at which the "
                    f"{self.problem.theory.name} stiffness is singular"
                )
            self.warnings.append(said)

    def _march(self, progress: Progress) -> None:
        time = self.scene.time
        assert time is not None
        newton = Newton.of(self.scene.solver)
        scheme, steps = scheme_of(time), Steps.of(time)
        start, rates = (None, None) if self.keeper.goes_on else first_state(self)
        if self.scene.model.reduced and by_reduced_model(self, start, progress):
            return
        march = March(self.system, scheme, steps, newton, start, rates)
        self.stepper = march.stepper
        if error_wanted(self):
            self.companions = HistoryErrors(
                self.problem,
                self.system,
                scheme,
                newton,
                lambda s: (start, rates) if self.keeper.goes_on else self.start_of(s, (start, rates)),
                OUTPUTS[output_of(self.scene)],
                richer_problem(self.problem),
            )
            self.stepper.watch = self.companions
        march.reached = self.keeper.start(self)
        if time.output_step is not None:
            passed = max(len(self.record.history) - 1, 0)
            self.rows = self.stepper.watch = RowTimes(
                time.output_step, time.end, scheme.order, self.stepper.watch, passed
            )
        with self.keeper.interrupts():
            first = 0 if march.reached is None else self.steps + 1
            for self.steps, state in enumerate(march, first):
                self._stepped(state, time, progress)

    def start_of(
        self, system: Any, own: tuple[Array | None, Array | None] | None = None
    ) -> tuple[Array | None, Array | None]:
        """Return the shape and the velocities at t = 0 of a companion's system.

        Args:
            system: of the companion.
            own: of this run, for a companion on the same mesh in the same theory.
        """
        problem = system.model.problem
        same = system.V.dofmap.index_map.size_global == self.system.V.dofmap.index_map.size_global
        if own is not None and same and problem.theory == self.problem.theory:
            return own
        there = copy(self)
        there.problem, there.system, there.warnings = (
            self.problem.replace(mesh=problem.mesh, theory=problem.theory),
            system,
            [],
        )
        return first_state(there)

    def look(self, state: State) -> None:
        """See that a state of a linear theory that no step has led to is in the range of the theory."""
        self._check(state)
        self.farthest(state.q, state.t)

    def _stepped(self, state: State, time: Time, progress: Progress) -> None:
        """Look at a state of the march, and keep what is to be kept of it."""
        if (why := self.scene.limits.refusal("steps", self.steps)) is not None:
            raise ComputationError(f"the motion {why}", time=state.t)
        self._check(state)
        rows = [state]
        if self.rows is not None and state.t > 0.0:
            rows = self.rows.taken()
        elif self.steps % time.output_every and state.t < time.end * (1 - 1e-9):
            rows = []
        for row in rows:
            self._keep(row)
            progress(row.t / time.end)
        self.last = state
        self.keeper.stepped(self, state)
        if self.clock is not None:
            self.clock(self.steps, state.t / time.end)

    # --- what is watched ---------------------------------------------------------------------------------------------

    def _keep(self, state: State) -> None:
        """Record a state, and see that the model still holds for it."""
        if not self.system.linear:
            self.system.structure.check_range(state.q, state.t)
        self.record(state)
        self.last = state
        self.farthest(state.q, state.t)
        if self.choice is None or self._exceeded:
            return
        sizes = self.system.sizes(state.q)
        self._exceeded = self.choice.check(sizes)
        if not self._exceeded:
            return
        if self.scene.model.on_exceed != "warn":
            raise RangeExceeded(self._exceeded, state.t if self.scene.time is not None else None, sizes)
        self.warnings.append(f"{self._exceeded}, at t = {state.t:.6g} s")

    def _check(self, state: State) -> None:
        """Stop a history that has left the range of its theory.

        Raises:
            ComputationError: displacements of a linear theory beyond the structure's length, or not finite.
        """
        if not self.system.linear:
            return
        speed = abs(self.system.motion.speed(state.t))
        if self._critical_since is None and self.critical is not None and speed > self.critical:
            self._critical_since = state.t
        size = self.system.size(state.q)
        if np.isfinite(size) and size <= LARGEST_LINEAR_DEFLECTION:
            return
        raise diverged(self.problem.theory, state.t, self.critical, self._critical_since)

    # --- the result --------------------------------------------------------------------------------------------------

    def result(self, status: str, failure: ComputationError | None = None) -> RunResult:
        """Return everything computed so far with a summary of how it went."""
        history = self.record.history.arrays()
        self._warn_of_steps()
        if failure is None and self.stepper is not None:
            said = energy_growth.said(self.system, history, self.rows is not None)
            self.warnings += [said] if said else []
        if status == "done" and self._critical_since is not None:
            self.warnings.append(
                f"the speed is above {self.critical:.6g} rad/s, where the {self.problem.theory.name} stiffness is no "
                f"longer definite, since t = {self._critical_since:.4g} s"
            )
        self.theory_error = theory_error_of_run(self, history)
        if self.theory_error is not None and (said := self.theory_error.warning()):
            self.warnings.append(said)
        if said := said_of(self.farthest.lost_digits() or 0.0):
            self.warnings.append(said)
        self.error = None if failure is not None else error_of_run(self)
        self.warnings += [] if self.error is None else warnings_of_run(self, self.error)
        summary = run_summary(self, status, history)
        if failure is not None:
            summary["failure"] = {"what": failure.what, "time": failure.time, "advice": failure.advice}
        return self.record.result(summary, history)

    def _failure(self, error: ComputationError) -> ComputationError:
        """Return a failure, with what was wrong before it as its cause if something was."""
        if self.stepper is None:
            return error
        return energy_growth.with_cause(error, self.system, self.record.history.arrays(), self.rows is not None)

    def _warn_of_steps(self) -> None:
        self.warnings += [] if self.stepper is None else self.stepper.said()
        if self.iteration.roundoff > 0:
            self.warnings.append(f"Newton stopped at round-off, increments {self.iteration.roundoff:.1e} (relative)")

    @property
    def iteration(self) -> Newton:
        """The iteration control that did the work."""
        return self.newton if self.stepper is None else self.stepper.newton
