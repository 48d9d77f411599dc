"""Settings of a study of cost, computed and timed; each is kept on disk as soon as it is there."""

from __future__ import annotations

import ctypes
import gc
import hashlib
import json
import resource
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from rotfem.analysis.equilibrium import check_steady
from rotfem.commands.accuracy import changes_of
from rotfem.commands.campbell import diagram
from rotfem.commands.cost.settings import sweep_speeds
from rotfem.commands.interrupts import held_back
from rotfem.commands.modes import analysis_of
from rotfem.commands.problem import Problem
from rotfem.commands.run import Simulation
from rotfem.commands.run_store import RunStore
from rotfem.errors import ComputationError, InputError, OutputError, input_of
from rotfem.listeners import cpu_time
from rotfem.refinement.coarser import lines
from rotfem.refinement.distance import of_columns
from rotfem.refinement.refine import Clock, OverBudget, Setting
from rotfem.results.files import writing
from rotfem.scene import Scene
from rotfem.version import __version__

Array = npt.NDArray[np.float64]

#: Values of an output, numbers of unknowns, steps and Newton iterations, and the lines of the mesh (see `lines`).
Output = tuple[Array, tuple[int, int, int], list[Array]]


@dataclass
class Measurement:
    """One setting, computed.

    Attributes:
        status: "done", "failed", or "stopped" where the time of the study was over.
        reason: why it failed.
        values: the output (rows, components): over time, or a row an eigenvalue, or of a steady state; m, rad/s.
        wall, cpu: of every repetition, s, without set-up.
        setup, setup_cpu: of every repetition, s: mesh, forms (compiled before, on disk), constant operators.
        memory: bytes at the height, above what the program needs by itself; of all processes.
        dofs, steps, iterations: sizes and counts.
        lines: coordinates of the vertices of the mesh along each axis, m.
    """

    status: str = "done"
    reason: str = ""
    values: Array | None = None
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    setup: list[float] = field(default_factory=list)
    setup_cpu: list[float] = field(default_factory=list)
    memory: float = 0.0
    dofs: int = 0
    steps: int = 0
    iterations: int = 0
    lines: list[Array] = field(default_factory=list)

    def median(self, name: str) -> float:
        """Return the median of `wall`, `cpu`, `setup` or `setup_cpu`, s; nan where nothing was measured."""
        values = getattr(self, name)
        return float(np.median(values)) if values else float("nan")

    @property
    def cost(self) -> float:
        """CPU time (s) of set-up and computation, by which settings are ranked; that of other programs is not in it."""
        return self.median("setup_cpu") + self.median("cpu")


class Bench:
    """Measures settings of one scene.

    Args:
        scene: validated scene.
        output: "tip", "frequencies" or "campbell".
        comm: MPI communicator.

    Attributes:
        compiling: CPU time (s) in which forms were compiled.
        memory: that the program needs by itself, bytes.
    """

    def __init__(self, scene: Scene, output: str, comm: MPI.Comm):
        self.scene, self.output, self.comm = scene, output, comm
        self._warm: set[tuple[str, int, str | None]] = set()
        self.compiling = 0.0
        self.memory = restart_memory()

    def measure(self, setting: Setting, repeat: int, before: Measurement | None, clock: Clock) -> Measurement:
        """Return the output of a setting with its timings, or the reason why there is none.

        Forms are compiled once for each theory, degree and scheme, in a run of a few steps that is not timed.

        Args:
            setting: what is measured.
            repeat: how often in all.
            before: what was measured of it already.
            clock: ends a history that would take more than there is.
        """
        out = before or Measurement()
        try:
            variant = self.compiled(setting)
            for _ in range(repeat - len(out.wall)):
                self._once(variant, out, clock)
            if out.values is not None and not np.all(np.isfinite(out.values)):
                raise ComputationError("the output is not finite")
        except OverBudget as error:
            out.status, out.reason, out.values = "stopped", error.what, None
        except (ComputationError, InputError) as error:
            out.status, out.reason, out.values = "failed", str(error), None
        return out

    def compiled(self, setting: Setting) -> Scene:
        """Return the scene in a setting, the forms of its theory, degree and scheme compiled.

        Raises:
            SceneError: the scene cannot be computed so.
            ComputationError: its first steps fail.
        """
        variant = self.scene.replace(changes_of(self.scene, setting))
        key, time = (setting.theory, setting.degree, setting.scheme), variant.time
        if key in self._warm:
            return variant
        started, short = cpu_time(), variant
        if setting.moving and time is not None:
            # three steps, as the first one of a scheme may have forms of its own
            few = 3 * time.step if time.step is not None else time.output_step or time.end
            short = variant.replace({"time.end": min(few, time.end)})
        self._prepared(short, None, "frequencies" if self.output == "campbell" else self.output)()
        self._warm.add(key)
        self.compiling += cpu_time() - started
        return variant

    def _once(self, variant: Scene, out: Measurement, clock: Clock) -> None:
        restart_memory()
        start = perf_counter(), process_time()
        go = self._prepared(variant, clock, self.output)
        ready = perf_counter(), process_time()
        try:
            values, counts, out.lines = go()
        finally:
            end = perf_counter(), process_time()
            peak = bytes_of("VmHWM") or 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            out.setup.append(ready[0] - start[0])
            out.setup_cpu.append(ready[1] - start[1])
            out.wall.append(end[0] - ready[0])
            out.cpu.append(end[1] - ready[1])
            out.memory = max(out.memory, self.comm.allreduce(max(peak - self.memory, 0.0)))
        out.values, (out.dofs, out.steps, out.iterations) = values, counts

    def _prepared(self, variant: Scene, clock: Clock | None, output: str) -> Callable[[], Output]:
        """Return what computes an output once everything is set up."""
        with input_of(variant.file):
            if output == "tip":
                return self._motion(variant, clock)
            return self._sweep(variant) if output == "campbell" else self._modal(variant)

    def _motion(self, variant: Scene, clock: Clock | None) -> Callable[[], Output]:
        variant.check_run()
        problem = Problem.of(variant)
        if variant.time is None:
            check_steady(problem)
        simulation = Simulation(variant, problem, RunStore(self.comm), clock=clock)

        def go() -> Output:
            result = simulation.run()
            tips, s = of_columns("tip", result.history, simulation.system.structure), result.summary
            counts = s["dofs"], s["steps"], s["newton_iterations"]
            return tips, counts, lines(simulation.system)

        return go

    def _modal(self, variant: Scene) -> Callable[[], Output]:
        problem = Problem.of(variant)
        analysis = analysis_of(variant, problem, self.comm)
        V, speed = analysis.system.V, problem.motion.final_speed(variant.time.end if variant.time is not None else 0.0)

        def go() -> Output:
            values = analysis.at(speed, variant.modes.count).pairs.values[: variant.modes.count]
            dofs = V.dofmap.index_map.size_global * V.dofmap.index_map_bs
            counts = dofs, 0, analysis.newton.iterations
            return np.column_stack([values.imag, values.real]), counts, lines(analysis.system)

        return go

    def _sweep(self, variant: Scene) -> Callable[[], Output]:
        speeds, started = sweep_speeds(variant), perf_counter()
        analysis = analysis_of(variant, Problem.of(variant).spinning(), self.comm)

        def go() -> Output:
            result = diagram(variant, analysis, speeds, started)
            rows = sorted((r["speed"], r["frequency"]) for r in result.rows if not r["refined"])
            values = np.array([[frequency] for _, frequency in rows])
            counts = result.summary["dofs"], result.summary["speeds_solved"], 0
            return values, counts, lines(analysis.system)

        return go


# --- what is kept ----------------------------------------------------------------------------------------------------


def fingerprint(scene: Scene, output: str, ranks: int) -> str:
    """Return a hash of all that a measurement depends on besides its setting: scene, output, version, processes.

    A mesh file counts by its content, a Python function in the scene by its name only. What a measurement consists of
    counts too.
    """
    mesh = getattr(scene.structure, "mesh", None)
    content = hashlib.sha256(Path(mesh).read_bytes()).hexdigest() if mesh is not None else None
    of_what = sorted(vars(Measurement()))
    text = json.dumps([scene.to_dict(), content, output, __version__, ranks, of_what], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Record:
    """Measurements by the key of their setting; each is a line of a file as soon as it is there.

    A line is written whole, by one call; one cut short by a power failure is not read.

    Args:
        path: the file, or None to keep nothing.
        identity: fingerprint of the study; lines of another one are passed over.
        fresh: forget what the file holds.

    Attributes:
        found: key ↦ measurement.

    Raises:
        OutputError: the file cannot be written.
    """

    def __init__(self, path: Path | None, identity: str, fresh: bool = False):
        self.path, self.identity = path, identity
        self.found: dict[str, Measurement] = {}
        if path is None:
            return
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
            if text and not text.startswith('{"study": '):
                raise OutputError(path, "it is there already, and no record of measurements")
            if fresh:
                path.unlink(missing_ok=True)
                text = ""
        if text and not text.endswith("\n"):  # a start that died in the middle of a line
            self._append("\n")
        for line in text.splitlines():
            try:
                entry = json.loads(line)
                if entry["study"] == identity:
                    found = self.found[entry["setting"]] = Measurement(**entry["measurement"])
                    found.values = None if found.values is None else np.array(found.values, dtype=np.float64)
            except (ValueError, KeyError, TypeError):
                continue

    def put(self, key: str, measurement: Measurement) -> None:
        """Keep a measurement.

        Raises:
            OutputError: the file cannot be written.
        """
        self.found[key] = measurement
        entry = {"study": self.identity, "setting": key, "measurement": vars(measurement)}
        self._append(json.dumps(entry, default=np.ndarray.tolist) + "\n")

    def _append(self, text: str) -> None:
        if self.path is None:
            return
        with writing(self.path), open(self.path, "ab", buffering=0) as file:
            file.write(text.encode())


# --- memory ----------------------------------------------------------------------------------------------------------


def restart_memory() -> float:
    """Set back the mark of the most memory of this process, where the system can; return what it has now, bytes.

    What is no longer used is given back before: the last system is large and full of cycles.
    """
    with held_back():  # what a signal raises is lost in the finalisers that a collection runs
        gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc, which keeps what was freed
    if trim is not None:
        trim(0)
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # proc(5): sets VmHWM back
    return bytes_of("VmRSS") or 0.0


def bytes_of(name: str, file: str = "/proc/self/status") -> float | None:
    """Return a number of bytes that Linux says; None elsewhere."""
    with suppress(OSError, StopIteration, ValueError, IndexError):
        lines = Path(file).read_text(encoding="ascii").splitlines()
        return 1024.0 * float(next(line for line in lines if line.startswith(f"{name}:")).split()[1])
    return None
