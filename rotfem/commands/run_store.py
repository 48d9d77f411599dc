"""What of a run is on disk while it goes on: the rows of its history, and checkpoints.

A checkpoint holds what a run must know to go on as if it had never ended: of every object that learns, all attributes
but the parts that a run makes anew. Of a shared mesh each process keeps its own arrays. A kept factor is that of a
tangent at a state, which is kept in its place.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.analysis.schemes import State
from rotfem.analysis.stepper import Stepper
from rotfem.commands.interrupts import Interrupts
from rotfem.commands.recorder import Log, Monitor, Recorder
from rotfem.errors import OutputError, SceneError, Stopped
from rotfem.refinement.refine import Setting
from rotfem.results.checkpoint_file import read_checkpoint, write_checkpoint
from rotfem.results.files import CHECKPOINT
from rotfem.results.result_set import ResultFolder, ResultSet, read_summary
from rotfem.results.run import LiveTable
from rotfem.scene import Scene, Time
from rotfem.version import versions

Tree = dict[str, Any]

_STEPPER = ("system", "newton", "back_off", "scheme", "scheme_back_off", "observers", "_linearised", "_about")
#: By class, attributes that a run makes anew or that have a place of their own in a checkpoint.
APART = {
    "Log": ("started", "elapsed", "advice"),
    "Monitor": ("system", "critical", "farthest"),
    "Farthest": ("system",),
    "StationRows": ("output", "names", "_stations", "_columns"),
    "ResultantRows": ("names", "frames", "_resultants", "_nodes", "_columns", "_stress"),
    "Stepper": _STEPPER,
}


# --- what a checkpoint holds ------------------------------------------------------------------------------------------


def identity(scene: Scene, terms: Mapping[str, Any], outputs: Mapping[str, Any]) -> Tree:
    """Return all that a run depends on, but for its end: scene, content of a mesh file, names of what scripts added."""
    mesh = scene.structure.mesh_file
    content = None if mesh is None else hashlib.sha256(Path(mesh).read_bytes()).hexdigest()
    tables = comparable(scene.digest())
    tables.get("time", {}).pop("end", None)
    return {"scene": tables, "mesh": content, "terms": sorted(terms), "outputs": sorted(outputs)}


def comparable(scene: Any) -> Any:
    """Return the tables of a scene as a file has them, without those that nothing computed depends on."""
    tables = json.loads(json.dumps(scene, default=str))
    return {k: v for k, v in tables.items() if k not in ("name", "limits")} if isinstance(tables, dict) else tables


def differences(there: Any, here: Any, key: str = "") -> list[str]:
    """Return which keys of two identities differ, and how."""
    if isinstance(there, dict) and isinstance(here, dict):
        keys = list(dict.fromkeys([*there, *here]))
        return [line for k in keys for line in differences(there.get(k), here.get(k), f"{key}.{k}" if key else k)]
    if there == here:
        return []
    shown = [value if len(value) <= 40 else value[:39] + "…" for value in map(json.dumps, (there, here))]
    return [f"{key.removeprefix('scene.')} is {shown[0]} there and {shown[1]} here"]


def check_identity(path: Path, tree: Tree, mine: Tree, end: float) -> None:
    """Refuse a checkpoint of another run, or one that lies after an end (s).

    Raises:
        SceneError: it is of another scene, or of another version of the program; says what differs.
    """
    there, here = tree["versions"]["rotfem"], versions()["rotfem"]
    if there != here:
        why = f"was written by rotfem {there}, this is {here}; start the run anew, without --resume"
        raise SceneError("command line", "--resume", path, why)
    lines = differences(tree["identity"], mine)
    if lines:
        more = f", and {len(lines) - 4} more" if len(lines) > 4 else ""
        raise SceneError("command line", "--resume", path, f"is of another run: {'; '.join(lines[:4])}{more}")
    if end < tree["t"]:
        raise SceneError("command line", "--resume", path, f"is of t = {tree['t']:g} s, after time.end = {end:g} s")


@dataclass
class Memory:
    """What of a run a checkpoint holds: what marches, and what observes it; without a stepper nothing can be kept."""

    time: Time
    system: Any
    stepper: Stepper | None
    record: Recorder
    monitor: Monitor
    log: Log
    setting: Setting | None

    @property
    def _common(self) -> list[Any]:
        """Objects that are the same on all ranks."""
        rows = self.record.resultants
        return [self.log, self.record.stations, rows, rows and rows.frames]

    @property
    def _own(self) -> list[Any]:
        """Objects that have arrays of a rank."""
        return [self.monitor, self.monitor.farthest, self.record.snapshots]

    def taken(self, state: State, mine: Tree) -> Tree:
        """Return what the run knows at a state, on rank 0.

        Args:
            state: the state at the end of the last step.
            mine: identity of the run.
        """
        record, comm = self.record, self.system.comm
        assert self.stepper is not None
        own = {
            "positions": self.system.V.tabulate_dof_coordinates(),
            "state": state.changed(inner=()),
            "stepper": of_stepper(self.stepper),
            "parts": [known(part) for part in self._own],
        }
        return {
            "identity": mine,
            "versions": versions(),
            "t": state.t,
            "elapsed": self.log.elapsed + perf_counter() - self.log.started,
            "factorisations": self.system.factorisations,
            "rows": np.array(record.history.rows()).reshape(len(record.history), -1),
            "parts": [known(part) for part in self._common],
            "settings": None if self.setting is None else vars(self.setting),
            "processes": comm.gather(own),
        }

    def put_back(self, path: Path, tree: Tree) -> State:
        """Make the run know what a checkpoint says; return the state to go on from.

        Raises:
            SceneError: the mesh is another one, or other processes share it.
        """
        comm, here, ranks = self.system.comm, self.system.V.tabulate_dof_coordinates(), len(tree["processes"])
        if ranks != comm.size:
            why = f"is of a mesh that {ranks} processes share, and here are {comm.size}: go on with as many"
            raise SceneError("command line", "--resume", path, why)
        own = tree["processes"][comm.rank]
        there, near = own["positions"], 1e-9 * float(np.max(np.ptp(here, axis=0)))
        same = there.shape == here.shape and bool(np.max(np.abs(there - here)) <= near)
        if not comm.allreduce(same, MPI.LAND):
            raise SceneError("command line", "--resume", path, "is of another mesh")
        state: State = own["state"]
        assert self.stepper is not None
        for part, values in zip([*self._common, *self._own], [*tree["parts"], *own["parts"]], strict=True):
            if part is not None:
                vars(part).update(values)
        self.log.elapsed = tree["elapsed"]
        for row in tree["rows"]:
            self.record.history.append(row)
        put_back_stepper(self.stepper, own["stepper"], state)
        self.system.held.factored_before = tree["factorisations"] - self.system.held.factorisations
        return state


def known(thing: Any) -> Tree | None:
    """Return the attributes of an object but those in `APART`; None of nothing."""
    apart = APART.get(type(thing).__name__, ())
    return None if thing is None else {name: value for name, value in vars(thing).items() if name not in apart}


def learning(stepper: Stepper) -> dict[str, Any]:
    """Return a stepper and its parts that learn from its steps, by name."""
    parts = ("newton", "back_off", "scheme_back_off")
    return {"own": stepper, **{name: getattr(stepper, name) for name in parts}}


def of_stepper(stepper: Stepper) -> Tree:
    """Return what a stepper has learnt, and what its matrices and its factor are about."""
    about = {"matrices": stepper.matrices, "factored": stepper.system.held.factored}
    return {name: known(part) for name, part in learning(stepper).items()} | about


def put_back_stepper(stepper: Stepper, tree: Tree, state: State) -> None:
    """Make a stepper know what it had learnt at a state; its factor and its matrices are made anew."""
    held = stepper.system.held
    held.count_rotations_from(state.reference)
    held.refactor(tree["factored"])
    stepper.make_matrices(tree["matrices"])
    held.count_rotations_from(state.reference)
    stepper.system.set_time(state.t)
    for name, part in learning(stepper).items():
        vars(part).update(tree[name])


# --- when it is written -----------------------------------------------------------------------------------------------


def interval(text: str | int) -> float | int:
    """Return the time (s, a float) from one checkpoint to the next of "30s", or the number of steps of "500".

    Raises:
        SceneError: it is none.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)(s?)", str(text))
    if found is None or float(found[1]) == 0.0 or not (found[2] or found[1].isdigit()):
        allowed = 'must be a time in seconds such as "30s", or a number of steps such as "500"'
        raise SceneError("command line", "--checkpoint", text, allowed)
    return float(found[1]) if found[2] else int(found[1])


@contextmanager
def checkpoint_of(path: Path) -> Iterator[None]:
    """Say in one error that the content of a checkpoint is not that of this program, as of another state of it.

    Raises:
        SceneError: in the place of what goes wrong with it.
    """
    try:
        yield
    except (SceneError, OSError):
        raise
    except Exception as error:  # of any kind, as anything may lie anywhere
        what = f"holds something else than this rotfem writes ({type(error).__name__}); start anew, without --resume"
        raise SceneError("command line", "--resume", path, what) from None


class RunStore:
    """Keeps a run's rows and checkpoints on disk, and ends it between steps when it is asked to.

    Args:
        comm: communicator of the run.
        folder: where its results go; None keeps nothing.
        every: from one checkpoint to the next, see `interval`; None writes none.
        resume: whether the run goes on from the checkpoint in the folder.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        folder: ResultFolder | None = None,
        every: float | int | None = None,
        resume: bool = False,
    ):
        self.comm, self.folder, self.every, self.resume = comm, folder, every, resume
        self._live: LiveTable | None = None
        self._run: Memory | None = None
        self._tree: Tree | None = None
        self._identity: Tree = {}
        self._written = monotonic()
        #: Time (s) and step at which ranks last talked to each other, and the step at which they do so next.
        self._talked, self._next = (monotonic(), 0), 0
        self._failed = False

    @property
    def goes_on(self) -> bool:
        """Whether there is a checkpoint to go on from."""
        return self._tree is not None

    def open(self, scene: Scene, terms: Mapping[str, Any], outputs: Mapping[str, Any]) -> None:
        """Read the checkpoint that the run is to go on from, and see that it is one of this run.

        Args:
            scene: what is run.
            terms: terms that a script adds.
            outputs: outputs that it asks for.

        Raises:
            SceneError: there is none, or it is damaged, or of another run; or there is nothing to go on with.
        """
        if self.every is None and not self.resume:
            return
        option = "--resume" if self.resume else "--checkpoint"
        if scene.time is None:
            raise SceneError("command line", option, None, "needs a scene with [time]; a steady state has no steps")
        if self.folder is None:
            raise SceneError("command line", option, None, "needs a folder")
        self._identity, path, end = identity(scene, terms, outputs), self.folder.path / CHECKPOINT, scene.time.end

        def read(files: ResultSet) -> Tree:
            with checkpoint_of(path):
                tree = read_checkpoint(path)
                check_identity(path, tree, self._identity, end)
            return tree

        if self.resume:
            self._tree = self.folder.first_does(read)
            self.every = self.every or self._tree["every"]

    def finished(self, scene: Scene) -> Tree | None:
        """Return the summary in the folder if it is that of this run, done; None otherwise."""
        if self.folder is None:
            return None
        summary = self.folder.first_does(lambda files: read_summary(files.folder))
        is_done = summary.get("command") == "run" and summary.get("status") == "done"
        return summary if is_done and comparable(summary.get("scene")) == comparable(scene.digest()) else None

    def setting(self) -> Setting | None:
        """Return the setting of the run that goes on, which an accuracy has led to; None without."""
        if self._tree is None or self._tree["settings"] is None:
            return None
        return Setting(**self._tree["settings"])

    def interrupts(self) -> Interrupts:
        """Return the context in which a march is interrupted between steps, where that is needed."""
        self._interrupts = Interrupts(self.comm, self._secure, self.comm.size > 1 or self.every is not None)
        return self._interrupts

    def start(self, run: Memory) -> State | None:
        """Begin the set of a run; return the state that it goes on from, if it does.

        Raises:
            OutputError: the folder cannot be written.
            SceneError: the checkpoint does not fit.
        """
        self._run, self._talked, self._next = run, (monotonic(), run.log.steps), 0
        if self.folder is None:
            return None
        state, path = None, self.folder.path / CHECKPOINT
        if self._tree is not None:
            with checkpoint_of(path):
                state = run.put_back(path, self._tree)
            run.log.resumed.append({"time": state.t, "ranks": self.comm.size})
        keep = (CHECKPOINT,) if self._tree is not None else ()
        self._tree = None  # a richer model would start afresh

        def begin(files: ResultSet) -> None:
            files.begin("running", keep)
            self._live = files.grow("history.csv", run.record.history)

        self.folder.first_does(begin)
        self._written = monotonic()
        return state

    def stepped(self, state: State) -> None:
        """Take note of the end of a step.

        Raises:
            Stopped: a signal has asked one of the ranks to end.
        """
        if self._live is not None:
            self._live.update()
        (asked, due), left = self._agreed(), self._left(state)
        fixed = self._run is not None and self._run.time.step is not None
        # The last state that a run with a later end would have met, too, is kept; none after it.
        if left >= 1 - 1e-6 and (asked or due or (fixed and left < 2 - 1e-6)):
            self._save(state)
        if asked and self._interrupts.active:
            raise Stopped

    def _agreed(self) -> tuple[bool, bool]:
        """Return whether a signal has come to one of the ranks, and whether a checkpoint is due, the same on all.

        Ranks talk to each other after so many steps only as take about 50 ms on rank 0, as mpirun gives its processes a
        quarter of a second to end: they need not meet in between.
        """
        asked, every = self._interrupts.asked, self.every
        steps = 0 if self._run is None else self._run.log.steps
        due = isinstance(every, int) and steps > 0 and steps % every == 0
        if self.comm.size > 1 and steps < self._next:
            return False, due
        late = isinstance(every, float) and steps > 0 and monotonic() - self._written >= every
        if self.comm.size > 1:
            now = monotonic()
            pace, self._talked = (now - self._talked[0]) / max(1, steps - self._talked[1]), (now, steps)
            told = self.comm.allgather((asked, late, pace))
            asked, (_, late, pace) = any(rank[0] for rank in told), told[0]
            self._next = steps + max(1, int(0.05 / max(pace, 1e-9)))
        return asked, due or late

    def _left(self, state: State) -> float:
        """Return how many more steps there are at least; of adaptive ones whether there is one."""
        assert self._run is not None
        time = self._run.time
        return (time.end - state.t) / (time.step or 1e-9 * time.end)

    def _save(self, state: State) -> None:
        """Write a checkpoint."""
        if self.folder is None or self._run is None or self.every is None:
            return
        tree = self._run.taken(state, self._identity) | {"every": self.every}
        if self.folder.set is not None:
            try:
                write_checkpoint(self.folder.path / CHECKPOINT, tree)
            except OutputError as error:
                if not self._failed:
                    self._run.log.warnings.append(
                        f"a checkpoint could not be written at t = {state.t:.6g} s: {error.reason}"
                    )
                self._failed = True
        self._written = monotonic()

    def _secure(self) -> None:
        """Put on disk at once what can be."""
        if self._live is None or self.folder is None or self.folder.set is None:
            return
        self._live.flush()
        self.folder.set.mark("interrupted")
