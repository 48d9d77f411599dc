"""`rotfem run`: the steady state or the time history of a scene.

A run is the compiled system, what yields its states, the observers that see them, and a summary of it all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.accuracy.answer import Answer, Answers, Setting
from rotfem.accuracy.outputs import OUTPUTS, chords, lines, of_columns, output_of
from rotfem.analysis.dense_output import RowTimes, multiples
from rotfem.analysis.equilibrium import check_steady, steady_state
from rotfem.analysis.march import March, Steps
from rotfem.analysis.schemes import State
from rotfem.analysis.stability import critical_speed, stability_of
from rotfem.commands.advice import advise, beyond, frozen_inputs, hints_of_start
from rotfem.commands.answers import ROOT_MOMENT, check_of, clock_of, to_accuracy, with_error
from rotfem.commands.first_state import Start, first_state
from rotfem.commands.interrupts import together
from rotfem.commands.problem import Problem, scheme_of
from rotfem.commands.processes import communicator, summary, timings
from rotfem.commands.recorder import Log, Monitor, Recorder
from rotfem.commands.run_store import RunStore
from rotfem.equations.compiled import compile_system
from rotfem.errors import ComputationError, InputError, Stopped, input_of
from rotfem.listeners import Hint, Progress, computing
from rotfem.mechanics.effects import Work
from rotfem.mechanics.problem import Functional, inactive_unknowns
from rotfem.mechanics.problem import Problem as ProblemData
from rotfem.numerics.newton import Newton
from rotfem.results.distance import Series
from rotfem.results.run import RunResult, figures
from rotfem.scene import Scene, Time
from rotfem.units import speed_text

Array = npt.NDArray[np.float64]

#: What to do where a controlled torque holds the motion at its own jump.
SMOOTHER = (
    "a torque that is continuous there, as one proportional to the deviation between its limits, or a hysteresis that "
    "leaves the motion time between two switches"
)


class Simulation:
    """One run of a scene.

    Args:
        scene: the scene as it was asked for.
        problem: its problem, with the model it is run with.
        store: what is kept of it on disk while it goes on, and the processes that run it.
        clock: called with the number of steps and the part of the history that is done.
        times: rows (s) at which the output alone is wanted, to be compared, and the rest when `result` asks for it;
            None for the rows of the scene, each with all that a history has.
        progress: called with the part of the history that is done.
    """

    #: There is no bound of the error by round-off; a warning says where it is large.
    round_off = None

    def __init__(
        self,
        scene: Scene,
        problem: ProblemData,
        store: RunStore,
        clock: Callable[[int, float], None] = lambda steps, share: None,
        times: Array | None = None,
        progress: Progress = lambda share: None,
    ):
        self.scene, self.clock, self.times, self.progress = scene, clock, times, progress
        self.comm, self.store, self.log = store.comm, store, Log()
        if scene.time is None and problem.frame == "inertial":
            problem = problem.turning()
            self.log.warnings.append("a steady state is one only in the rotating frame, where it was computed")
        if scene.time is not None and not (scene.model.all_unknowns or scene.initial.first is not None):
            problem = problem.replace(inactive=inactive_unknowns(problem))
        self.problem, there = problem, communicator(problem, self.comm)
        self.system = compile_system(problem, there, moving=scene.time is not None)
        if times is None:
            self.system.compile_readings()
        self.compiled = perf_counter() - self.log.started
        self.record = Recorder(self.system, scene.output)
        self.monitor = Monitor(self.system, critical_speed(self.system) if times is None else None)
        self.iteration = Newton.of(scene.solver)
        #: What the states of a history came from, and rows between its steps.
        self.march: March | None = None
        self.rows: RowTimes | None = None
        #: The output at the rows so far, and states of rows whose other values wait to be asked for.
        self._output = OUTPUTS[output_of(scene)]
        self._values = list[Array]()
        self._waiting = list[State]()

    @property
    def output(self) -> Series:
        """The output at the rows."""
        if self.times is not None:
            return Series(self.times[: len(self._values)], np.array(self._values))
        history = self.record.history.arrays()
        return Series(history["t"], of_columns(output_of(self.scene), history, self.system.structure))

    @property
    def steps(self) -> int:
        """Number of steps that were taken, parts of steps counted each."""
        return 0 if self.march is None else self.march.parts

    @property
    def stable(self) -> bool | None:
        """Whether the equilibrium is stable; None of a history."""
        known = self.monitor.stability if self.scene.time is None else None
        return None if known is None else known.stable

    @property
    def lines(self) -> list[Array]:
        """Coordinates (m) of the vertices of the mesh along each axis."""
        return lines(self.system)

    @property
    def chords(self) -> float:
        """Error by straight edges along curves."""
        return chords(self.system)

    def compute(self) -> Simulation:
        """Compute the rows; return this."""
        time, start = self.scene.time, Start()
        if time is None:
            self._steady()
            return self
        if not self.store.goes_on:
            start = first_state(self.scene, self.problem, self.system, judged=self.times is None)
        self.monitor.stability = start.stability
        self.log.warnings += start.warnings
        self._march(time, start)
        return self

    def result(self) -> RunResult:
        """Return the whole result of what was computed."""
        if self.times is not None:
            self.system.compile_readings()
            self.monitor.critical = critical_speed(self.system)
            for state in self._waiting:
                self._recorded(state)
            self._waiting = []
        return self.summarised("done")

    def run(self) -> RunResult:
        """Return the result of the scene (see `rotfem.run`)."""
        try:
            return self.compute().result()
        except ComputationError as error:
            failure = self._with_cause(error)
            failure.result = self.summarised("failed", failure)
            raise failure from (None if failure is error else error)
        except KeyboardInterrupt as stop:
            if not together(self.comm, stop):
                raise
            raise Stopped(self.summarised("interrupted")) from stop

    # --- what yields states -----------------------------------------------------------------------------------------

    def _steady(self) -> None:
        """Compute the equilibrium at the speed of t = 0."""
        system, log, speed = self.system, self.log, self.problem.motion.speed(0.0)
        log.warnings += frozen_inputs(self.problem)
        shape = steady_state(system, speed, self.iteration, notes=log.warnings)
        stability = self.monitor.stability = stability_of(system, shape, speed)
        self._row(State.at_rest(system, *system.start(shape)))
        critical = self.monitor.critical
        if self.times is None and (said := stability.warning()):
            if critical is not None and abs(speed) > critical:
                said += (
                    f"; {speed_text(abs(speed))} is above the speed {speed_text(critical)} at which the "
                    f"{self.problem.theory.name} stiffness is singular"
                )
            log.warnings.append(said)

    def _march(self, time: Time, start: Start) -> None:
        """March through the history."""
        scheme = scheme_of(time)
        march = self.march = March(self.system, scheme, Steps.of(time), self.iteration, start.q, start.v)
        march.reached = self.store.start(self)
        times = self.times
        if times is None and time.output_step is not None:
            times = multiples(time.output_step, time.end)
        if times is not None:
            begin = 0.0 if march.reached is None else march.reached.t
            self.rows = RowTimes(times, scheme.order, self.system.comm, begin)
            march.observers.append(self.rows)
        with self.store.interrupts:
            first = 0 if march.reached is None else self.log.steps + 1
            for self.log.steps, state in enumerate(march, first):
                self._stepped(state, time)

    # --- what sees them ---------------------------------------------------------------------------------------------

    def _stepped(self, state: State, time: Time) -> None:
        """Show a state of the march to all that observe it."""
        steps = self.log.steps
        self.monitor.step(state)
        rows = [state]
        if self.rows is not None and state.t > 0.0:
            rows = self.rows.taken()
        elif steps % time.output_every and state.t < time.end * (1 - 1e-9):
            rows = []
        for row in rows:
            self._row(row)
            self.progress(row.t / time.end)
        self.store.stepped(state)
        self.clock(steps, state.t / time.end)

    def _row(self, state: State) -> None:
        """Record a row, or take its output alone; the rest of it waits."""
        if self.times is None:
            self._recorded(state)
        else:
            self._values.append(self._output(self.system, state))
            self._waiting.append(state)

    def _recorded(self, state: State) -> None:
        self.monitor.row(state)
        self.record(state)

    # --- the result -------------------------------------------------------------------------------------------------

    def summarised(self, status: str, failure: ComputationError | None = None) -> RunResult:
        """Return everything computed so far with a summary of how it went."""
        history, log = self.record.history.arrays(), self.log
        log.warnings += beyond(self.problem, history["psi_dot"])
        log.warnings += [] if self.march is None else self.march.warnings()
        if self.iteration.roundoff > 0:
            log.warnings.append(f"Newton stopped at round-off, increments {self.iteration.roundoff:.1e} (relative)")
        watched = self.monitor
        if status == "done" and watched.since is not None and watched.critical is not None:
            log.warnings.append(
                f"the speed is above {speed_text(watched.critical)}, where the {self.problem.theory.name} stiffness is "
                f"no longer definite, since t = {watched.since:.4g} s"
            )
        log.warnings += [lost] if (lost := watched.round_off()) else []
        found = self._summary(status, history)
        if self.record.resultants is not None:
            found["stress"] = self.record.resultants.summary()
        if watched.stability is not None:
            found["stability"] = watched.stability.summary()
        if failure is not None:
            found["failure"] = {"what": failure.what, "time": failure.time, "advice": failure.advice}
        return self.record.result(found, history)

    def _with_cause(self, error: ComputationError) -> ComputationError:
        """Return a failure, with what was wrong before it as its cause if something was."""
        if self.march is None:
            return error
        if self.log.steps == 0:
            self.system.model.check_smooth()
        if self.system.hub is not None and self.system.hub.torque.controlled:
            what = f"{error.what}; where a torque jumps with the motion, the equations of a step may have no solution"
            return ComputationError(what, error.time, SMOOTHER)
        return error

    def _summary(self, status: str, history: dict[str, Array]) -> dict[str, Any]:
        """Return what was computed and how it went."""
        scene, system, log, march = self.scene, self.system, self.log, self.march
        space, mesh = system.V.dofmap, system.structure.mesh
        parts = {"compile": self.compiled, **(system.seconds if march else {})}
        before = {"before": log.elapsed} if log.resumed else {}
        out = {
            **summary("run", scene, self.comm, system.comm),
            "status": status,
            "kind": "steady" if scene.time is None else "history",
            "theory": self.problem.theory.name,
            "frame": self.problem.frame,
            "effects": list(system.model.effects),
            "dofs": space.index_map.size_global * space.index_map_bs,
            "elements": mesh.topology.index_map(mesh.topology.dim).size_global,
            "steps": log.steps,
            "newton_iterations": self.iteration.iterations,
            "factorisations": system.factorisations if march else self.iteration.iterations,
            "timings": timings(parts, log.started, before),
            "figures": figures(history),
            "warnings": log.warnings,
            "advice": log.advice,
            "root": {"place": [float(c) for c in system.root.place]},
        }
        if scene.time is None and len(history["t"]):
            out["root"] |= {name: float(x[-1]) for name, x in history.items() if name.startswith("root_")}
        if self.monitor.critical is not None:
            out["figures"]["critical_speed"] = self.monitor.critical
        if log.resumed:
            out["resumed"] = log.resumed
        if march is not None and march.rejected:
            out["rejected_steps"] = march.rejected
        if self.problem.inactive:
            why = "structure, loads and spin are symmetric, so that nothing moves them"
            out["left_out"] = {"unknowns": list(self.problem.inactive), "why": why}
        return out


# --- the verb -----------------------------------------------------------------------------------------------------


def simulate(
    scene: Scene,
    store: RunStore,
    progress: Progress | None,
    hint: Hint | None,
    terms: Mapping[str, Work] | None = None,
    outputs: Mapping[str, Functional] | None = None,
    shown: Callable[[RunResult], object] = lambda result: None,
    parts: bool = False,
) -> RunResult:
    """Return the result of a scene (see `rotfem.run`), with what is kept of it on disk while it goes on.

    `shown` takes the result before its error is estimated.
    """
    comm, clock = store.comm, clock_of(scene, store.comm, hint)
    scene.check_run()
    store.open(scene, terms or {}, outputs or {})

    def compute(variant: Scene, times: Array | None) -> Simulation:
        rows = rows_of(variant) if times is None else times
        problem = Problem.of(variant, terms=terms, outputs=outputs)
        return Simulation(variant, problem, RunStore(comm), clock, rows).compute()

    answers = Answers(scene, compute)
    with input_of(scene.file):
        if scene.time is None:
            check_steady(Problem.of(scene, terms=terms, outputs=outputs))
        if scene.accuracy is not None:
            check_of(scene, ("tip", ROOT_MOMENT), "run")
            answers.times, more = rows_of(scene), dict[str, Any]()
            if scene.model.effects == "needed" and output_of(scene) == "tip":
                from rotfem.commands.explain import needed_model  # other runs do without

                found = needed_model(scene, terms or {}, comm)
                answers.scene = scene.replace({"model.effects": list(found.effects)})
                answers.neglected = {"effects": found.change}
                more = {"needed": {"dropped": list(found.dropped), "change": found.change}}
            done: RunResult = to_accuracy(
                answers, output_of(scene), clock, comm, lambda result, errors: result.with_summary(**more)
            )
            return done
        if scene.model.effects == "needed":
            raise InputError("model.effects", "needed", "needs accuracy, which says what is needed")
        problem = Problem.of(scene, terms=terms, outputs=outputs)
        simulation = Simulation(scene, problem, store, progress=progress or (lambda share: None))
        also, critical = hints_of_start(scene, simulation.problem), simulation.monitor.critical
        simulation.log.advice = advise(scene, hint, critical=critical, also=also)
        result = simulation.run()
        if not scene.output.error:
            return result
        degree, log = simulation.system.V.element.basix_element.degree, simulation.log  # a default differs by cell
        own = Answer(replace(Setting.of(scene), degree=degree), simulation, log.cpu + computing() - log.began)
        answers.keep(own)
        shown(result)
        return with_error(result, answers, own, comm, parts)


#: Rows of a history that does not say it.
ROWS = 1000


def rows_of(scene: Scene) -> Array:
    """Return the times (s) of the rows that a scene asks for; 0 of a steady state."""
    time = scene.time
    if time is None:
        return np.zeros(1)
    step = time.output_step or (time.step and time.step * time.output_every) or time.end / ROWS
    return multiples(step, time.end)
