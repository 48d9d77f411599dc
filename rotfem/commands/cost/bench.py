"""One setting of a work–precision study, computed and timed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter, process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady
from rotfem.commands.campbell import Diagram
from rotfem.commands.cost.budget import PeakMemory, cpu_time
from rotfem.commands.cost.record import Measurement
from rotfem.commands.cost.reference import Samples
from rotfem.commands.cost.settings import Setting, sweep_speeds
from rotfem.commands.modes import analysis_of
from rotfem.commands.problem import Problem
from rotfem.commands.simulation import Simulation
from rotfem.equations.model import Model
from rotfem.errors import ComputationError, InputError, SceneError, input_of
from rotfem.listeners import Progress
from rotfem.scene import Scene

#: Steps of the run that warms up: the first ones load compiled forms and touch every library once.
WARM_STEPS = 3

#: What computes an output once everything is set up: samples, and numbers of unknowns, steps, Newton iterations.
Go = Callable[[Progress], tuple[Samples, tuple[int, int, int]]]


class OverTime(Exception):
    """The time of the study is over, in the middle of a computation."""


class Bench:
    """Measures settings of one scene.

    Args:
        scene: validated scene.
        output: "tip", "frequencies" or "campbell".
        comm: MPI communicator.

    Attributes:
        compiling: CPU time (s) of all runs that warmed up.
        memory: at the height.
    """

    def __init__(self, scene: Scene, output: str, comm: MPI.Comm = MPI.COMM_WORLD):
        self.scene, self.output, self.comm = scene, output, comm
        self._warm: set[tuple[str, int, str | None]] = set()
        self.compiling = 0.0
        self.memory = PeakMemory()

    def measure(
        self, setting: Setting, repeat: int, before: Measurement | None = None, limit: float = float("inf")
    ) -> Measurement:
        """Return the output of a setting with its timings, or the reason why there is none.

        Forms are compiled once for each theory and degree, in a run of a few steps that is not timed.

        Args:
            setting: what is measured.
            repeat: how often in all.
            before: what was measured of it already.
            limit: CPU time (s) after which a computation on one process is stopped.
        """
        out = before or Measurement()
        try:
            variant = self.scene.replace(setting.changes(self.scene))
            self._warm_up(variant)
            for _ in range(repeat - len(out.wall)):
                self._once(variant, out, limit)
        except OverTime:
            out.status, out.reason, out.samples = "stopped", f"not done after {limit:.3g} s", None
        except (ComputationError, SceneError) as error:
            out.status, out.reason, out.samples = "failed", str(error), None
        if out.samples is not None and not np.all(np.isfinite(out.samples.values)):
            out.status, out.reason, out.samples = "failed", "the output is not finite", None
        return out

    def _warm_up(self, variant: Scene) -> None:
        """Compile the forms of a theory and degree."""
        marching = self.output == "tip" and variant.time is not None
        key = (variant.model.theory, variant.mesh.degree, variant.time.scheme if marching and variant.time else None)
        if key in self._warm:
            return
        started = cpu_time()
        short = variant
        if marching and variant.time is not None and variant.time.step is not None:
            end = min(WARM_STEPS * variant.time.step, variant.time.end)
            short = variant.replace({"time.end": end, "time.output_every": 1})
        if self.output == "campbell":
            self._modal(short)(lambda share: None)  # the forms of a sweep, at one speed
        else:
            self._start(short)(lambda share: None)
        self._warm.add(key)
        self.compiling += cpu_time() - started

    def _once(self, variant: Scene, out: Measurement, limit: float) -> None:
        self.memory.restart()
        clock = perf_counter(), process_time()
        go = self._start(variant)
        ready = perf_counter(), process_time()

        def observer(share: float) -> None:
            if self.comm.size == 1 and process_time() - ready[1] > limit:
                raise OverTime

        try:
            samples, counts = go(observer)
        finally:
            end = perf_counter(), process_time()
            out.setup.append(ready[0] - clock[0])
            out.setup_cpu.append(ready[1] - clock[1])
            out.wall.append(end[0] - ready[0])
            out.cpu.append(end[1] - ready[1])
            out.memory = max(out.memory, self.comm.allreduce(self.memory.height()))
        out.samples = samples
        out.dofs, out.steps, out.iterations = counts

    def _start(self, variant: Scene) -> Go:
        """Return what computes the output once everything is set up."""
        ways = {"tip": self._motion, "frequencies": self._modal, "campbell": self._sweep}
        return ways[self.output](variant)

    def _motion(self, variant: Scene) -> Go:
        variant.check_run()
        problem = Problem.of(variant)
        with input_of(variant.file):
            if variant.time is None:
                check_steady(problem)
            simulation = Simulation(variant, problem, self.comm)

        def go(progress: Progress) -> tuple[Samples, tuple[int, int, int]]:
            result = simulation.run(progress)
            columns = [name for name in ("tip_u1", "tip_u2", "tip_u3") if name in result.history]
            values = np.column_stack([result.history[name] for name in columns])
            times = result.history["t"] if variant.time is not None else np.empty(0)
            s = result.summary
            return Samples(values, times), (s["dofs"], s["steps"], s["newton_iterations"])

        return go

    def _modal(self, variant: Scene) -> Go:
        problem = Problem.of(variant)
        with input_of(variant.file):
            analysis = analysis_of(variant, problem, self.comm)
        V, speed = analysis.system.V, problem.motion.final_speed(variant.time.end if variant.time is not None else 0.0)

        def go(progress: Progress) -> tuple[Samples, tuple[int, int, int]]:
            spinning = analysis.at(speed, variant.modes.count)
            values: Any = spinning.pairs.values[: variant.modes.count]
            dofs = V.dofmap.index_map.size_global * V.dofmap.index_map_bs
            samples = Samples(np.column_stack([values.imag, values.real]), np.empty(0))
            return samples, (dofs, 0, analysis.newton.iterations)

        return go

    def _sweep(self, variant: Scene) -> Go:
        problem, speeds, started = Problem.of(variant), sweep_speeds(variant), perf_counter()
        with input_of(variant.file):
            diagram = Diagram(variant, problem, speeds, self.comm, None)

        def go(progress: Progress) -> tuple[Samples, tuple[int, int, int]]:
            result = diagram.result(None, progress, started)
            rows = sorted((r["speed"], r["frequency"]) for r in result.rows if not r["refined"])
            samples = Samples(np.array([[frequency] for _, frequency in rows]), np.empty(0))
            return samples, (result.summary["dofs"], result.summary["speeds_solved"], 0)

        return go


def check_degrees(scene: Scene, degrees: Sequence[int], comm: MPI.Comm = MPI.COMM_WORLD) -> None:
    """Check that elements of these degrees may be used; of a mesh file only the file says of what shape they are.

    Raises:
        SceneError: they may not.
    """
    for degree in degrees if getattr(scene.structure, "mesh", None) is not None else ():
        try:
            Model(Problem.of(scene.replace({"mesh.degree": degree})).replace(effects=()), comm)
        except InputError as error:
            raise SceneError(scene.file, "cost --degrees", degree, error.allowed) from None
