"""What of a run is on disk while it goes on: the rows of its history, and checkpoints.

A checkpoint holds the state (t, q, v, a and the memory of the scheme), the rows so far, and what observers and the
march remember. Of a shared mesh it has the arrays of every process. Factors and matrices are made anew, so that a run
that goes on agrees with an unbroken one up to the tolerance of its iterations.

Its file is an npz: arrays, and JSON that refers to them. A dataclass is stored by its name and those of its fields.
Nothing in the file is executed.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import reduce
from importlib import import_module
from pathlib import Path
from time import monotonic, perf_counter
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI

from rotfem.analysis.march import March
from rotfem.analysis.schemes import State
from rotfem.commands.interrupts import Interrupts
from rotfem.commands.recorder import Log, Monitor, Recorder
from rotfem.equations.system import System
from rotfem.errors import ComputationError, SceneError, Stopped
from rotfem.listeners import computing
from rotfem.results.files import write_whole
from rotfem.results.result_set import CHECKPOINT, ResultFolder
from rotfem.scene import Scene
from rotfem.version import __version__

Tree = dict[str, Any]

#: Steps between two talks of ranks that each compute all of a small system: some 50 ms.
SELDOM = 50

#: Keys that stand in the JSON for an array, and for a dataclass.
ARRAY, CLASS = "#array", "#class"

#: What a run remembers besides its state: the attributes of its parts that a checkpoint holds.
REMEMBERED = {
    "log": ("steps", "warnings", "resumed"),
    "monitor": ("since", "stability", "farthest"),
    "record.snapshots": ("kept", "_every", "_count"),
    "record.stations": ("kept", "seen"),
    "record.resultants": ("last", "largest"),
    "march": ("parts", "substeps", "rejected"),
    "march.last": ("long", "confirmed"),
    "march.newton": ("iterations", "roundoff", "_kappa", "_longest"),
}


class Run(Protocol):
    """What a checkpoint is of; without a march nothing can be kept."""

    scene: Scene
    system: System
    march: March | None
    record: Recorder
    monitor: Monitor
    log: Log


def parts_of(run: Run) -> dict[str, Any]:
    """Return the parts of `REMEMBERED` that there are, by name."""
    found = {name: reduce(lambda x, key: x and getattr(x, key), name.split("."), run) for name in REMEMBERED}
    return {name: part for name, part in found.items() if part is not None}


def taken(run: Run, state: State) -> Tree:
    """Return the content of a checkpoint at a state, on all ranks together; complete on rank 0."""
    parts = {name: {key: getattr(part, key) for key in REMEMBERED[name]} for name, part in parts_of(run).items()}
    own = {"positions": run.system.V.tabulate_dof_coordinates(), "state": state, "parts": parts}
    return {
        "t": state.t,
        "elapsed": run.log.elapsed + perf_counter() - run.log.started,
        "cpu": run.log.cpu + computing() - run.log.began,
        "rows": np.array(run.record.history.rows),
        "processes": run.system.comm.gather(own),
    }


def put_back(run: Run, path: Path, tree: Tree) -> State:
    """Make a run know what a checkpoint says; return the state to go on from."""
    comm, here, ranks = run.system.comm, run.system.V.tabulate_dof_coordinates(), len(tree["processes"])
    if ranks != comm.size:
        raise refused(path, f"is of a mesh that {ranks} processes share, and here are {comm.size}: go on with as many")
    own = tree["processes"][comm.rank]
    there, near = own["positions"], 1e-9 * float(np.max(np.ptp(here, axis=0)))
    if not comm.allreduce(there.shape == here.shape and bool(np.max(np.abs(there - here)) <= near), MPI.LAND):
        raise refused(path, "is of another mesh")
    for name, part in parts_of(run).items():
        vars(part).update(own["parts"][name])
    for row in tree["rows"]:
        run.record.history.append(row)
    run.log.elapsed, run.log.cpu = tree["elapsed"], tree["cpu"]
    state: State = own["state"]
    run.log.resumed.append({"time": state.t, "ranks": comm.size})
    run.system.count_rotations_from(state.reference)
    run.system.set_time(state.t)
    return state


# --- the file ---------------------------------------------------------------------------------------------------------


def refused(value: object, why: str) -> SceneError:
    """Return the error of what --resume cannot go on from."""
    return SceneError("command line", "--resume", value, why)


@contextmanager
def checkpoint_of(path: Path) -> Iterator[None]:
    """Say in one error that a file is not a checkpoint of this program."""
    try:
        yield
    except SceneError:
        raise
    except Exception as error:  # of any kind, as anything may lie anywhere
        why = f"is damaged, or no checkpoint of this rotfem ({type(error).__name__}); start the run without --resume"
        raise refused(path, why) from None


def write_checkpoint(path: Path, tree: Tree) -> None:
    """Write a tree of dicts, lists, dataclasses, arrays, numbers and texts, whole or not at all."""
    arrays = list[Any]()

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
            arrays.append(value)
            return {ARRAY: f"arr_{len(arrays) - 1}"}
        if is_dataclass(value):
            own = {field.name: getattr(value, field.name) for field in fields(value) if field.init}
            return {CLASS: f"{type(value).__module__}:{type(value).__qualname__}", **own}
        if isinstance(value, np.generic) and value.dtype.kind in "biuf":
            return value.item()
        raise ComputationError(f"a checkpoint cannot hold a {type(value).__qualname__}")

    head = json.dumps({"rotfem": __version__, **tree}, default=plain).encode()
    image = io.BytesIO()
    np.savez(image, *arrays, head=np.frombuffer(head, dtype=np.uint8))
    with image.getbuffer() as content:
        write_whole(path, content)


def read_checkpoint(path: Path) -> Tree:
    """Return the tree of a checkpoint file; tuples have become lists."""
    if not path.exists():
        raise refused(path, "there is no checkpoint; start the run with --checkpoint, and without --resume")
    with np.load(path, allow_pickle=False) as file:
        head = file["head"].tobytes()
        if (there := json.loads(head)["rotfem"]) != __version__:
            why = f"was written by rotfem {there}, this is {__version__}; start the run anew, without --resume"
            raise refused(path, why)

        def full(entries: Tree) -> Any:
            if CLASS in entries:
                return dataclass_of(entries.pop(CLASS))(**entries)
            return file[entries[ARRAY]] if ARRAY in entries else entries

        tree: Tree = json.loads(head, object_hook=full)
    return tree


def dataclass_of(name: str) -> Any:
    """Return a dataclass of the program, or of a file that it has loaded, by "module:name"; nothing else is called."""
    module, _, attribute = name.partition(":")
    found = getattr(import_module(module) if module.startswith("rotfem.") else sys.modules.get(module), attribute, None)
    if not (isinstance(found, type) and is_dataclass(found)):
        raise refused(name, "is no dataclass of rotfem or of what --load has read")
    return found


# --- of which run -----------------------------------------------------------------------------------------------------


def identity_of(scene: Scene, terms: Mapping[str, Any], outputs: Mapping[str, Any]) -> Tree:
    """Return what a run depends on, but for its end: scene, content of a mesh file, names of what scripts added."""
    mesh = scene.structure.mesh_file
    content = None if mesh is None else hashlib.sha256(Path(mesh).read_bytes()).hexdigest()
    tables: Tree = json.loads(json.dumps(scene.digest(), default=str))
    tables.get("time", {}).pop("end", None)
    tables.pop("name", None)
    return {**tables, "content of the mesh": content, "terms": sorted(terms), "outputs": sorted(outputs)}


def differences(there: Any, here: Any, key: str = "") -> list[str]:
    """Return which keys of two identities differ, and how."""
    if isinstance(there, dict) and isinstance(here, dict):
        keys = dict.fromkeys([*there, *here])
        return [line for k in keys for line in differences(there.get(k), here.get(k), f"{key}.{k}".strip("."))]
    shown = [value if len(value) <= 40 else value[:39] + "…" for value in map(json.dumps, (there, here))]
    return [] if there == here else [f"{key} is {shown[0]} there and {shown[1]} here"]


def check_identity(path: Path, tree: Tree, mine: Tree, end: float) -> None:
    """Refuse a checkpoint of another run, or one that lies after an end (s)."""
    if lines := differences(tree["identity"], mine):
        raise refused(path, f"is of another run: {'; '.join(lines[:4])}")
    if end < tree["t"]:
        raise refused(path, f"is of t = {tree['t']:g} s, after time.end = {end:g} s")


# --- when it is written -----------------------------------------------------------------------------------------------


def interval(text: str | int) -> float | int:
    """Return the time (s, a float) from one checkpoint to the next of "30s", or the number of steps of "500"."""
    found = re.fullmatch(r"(\d+(?:\.\d+)?)(s?)", str(text))
    if found is None or float(found[1]) == 0.0 or not (found[2] or found[1].isdigit()):
        allowed = 'must be a time in seconds such as "30s", or a number of steps such as "500"'
        raise SceneError("command line", "--checkpoint", text, allowed)
    return float(found[1]) if found[2] else int(found[1])


class RunStore:
    """Keeps a run's rows and checkpoints on disk, and ends it between steps when it is asked to.

    Args:
        comm: communicator of the run.
        folder: where its results go; None keeps nothing.
        every: from one checkpoint to the next, see `interval`; None writes none.
        resume: whether the run goes on from the checkpoint in the folder.

    Attributes:
        interrupts: context in which a march is interrupted between steps.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        folder: ResultFolder | None = None,
        every: float | int | None = None,
        resume: bool = False,
    ):
        self.comm, self.folder, self.every, self.resume = comm, folder, every, resume
        self._run: Run | None = None
        self._tree: Tree | None = None
        self._identity: Tree = {}
        self.interrupts = Interrupts(comm.size == 1)
        self._written = monotonic()

    @property
    def goes_on(self) -> bool:
        """Whether there is a checkpoint to go on from."""
        return self._tree is not None

    def open(self, scene: Scene, terms: Mapping[str, Any], outputs: Mapping[str, Any]) -> None:
        """Read the checkpoint to go on from, if one is; refuse that of another run, and runs that have none."""
        if self.every is None and not self.resume:
            return
        option = "--resume" if self.resume else "--checkpoint"
        if scene.time is None:
            raise SceneError("command line", option, None, "needs a scene with [time]; a steady state has no steps")
        if scene.accuracy is not None:
            raise SceneError("command line", option, None, "cannot be combined with accuracy: it takes several answers")
        if self.folder is None:
            raise SceneError("command line", option, None, "needs a folder")
        self._identity, path, end = identity_of(scene, terms, outputs), self.folder.path / CHECKPOINT, scene.time.end

        def read() -> Tree:
            with checkpoint_of(path):
                tree = read_checkpoint(path)
                check_identity(path, tree, self._identity, end)
            return tree

        if self.resume:
            self._tree = self.folder.first_does(read)
            self.every = self.every or self._tree["every"]

    def start(self, run: Run) -> State | None:
        """Begin the results of a run; return the state of the checkpoint that it goes on from, None without."""
        self._run = run
        folder, tree, state = self.folder, self._tree, None
        if folder is None:
            return None
        if tree is not None:
            with checkpoint_of(folder.path / CHECKPOINT):
                state = put_back(run, folder.path / CHECKPOINT, tree)
        self._tree = None  # of this run alone, not of a finer one after it
        folder.begin((CHECKPOINT,) if tree is not None else ())
        folder.grow("history.csv", run.record.history)
        self._written = monotonic()
        return state

    def stepped(self, state: State) -> None:
        """Take note of the end of a step; raise `Stopped` where a signal has asked one of the ranks to end."""
        assert self._run is not None
        self._run.record.history.flush(1.0)
        (asked, due), time = self._agreed(self._run), self._run.scene.time
        assert time is not None
        left = (time.end - state.t) / (time.step or 1e-9 * time.end)  # steps at least; of adaptive ones if there is one
        # The last state that a run with a later end would have met, too, is kept; none after it.
        if left >= 1 - 1e-6 and (asked or due or (time.step is not None and left < 2 - 1e-6)):
            self._save(state)
        if asked:
            if self.folder is not None:  # at once: mpirun gives its processes a quarter of a second to end
                self.folder.close(KeyboardInterrupt())
            raise Stopped

    def _agreed(self, run: Run) -> tuple[bool, bool]:
        """Return whether a signal has come to one of the ranks, and whether a checkpoint is due, the same on all.

        Ranks that share a mesh talk to each other after every step, others, whose steps are quick, seldom.
        """
        asked, every, steps = self.interrupts.asked, self.every, run.log.steps
        due = isinstance(every, int) and steps > 0 and steps % every == 0
        late = isinstance(every, float) and steps > 0 and monotonic() - self._written >= every
        if self.comm.size > 1:
            if run.system.comm.size == 1 and steps % SELDOM:
                return False, due
            told = self.comm.allgather((asked, late))
            asked, late = any(rank[0] for rank in told), told[0][1]
        return asked, due or late

    def _save(self, state: State) -> None:
        """Write a checkpoint."""
        folder = self.folder
        if folder is None or self._run is None or self.every is None:
            return
        tree = taken(self._run, state) | {"identity": self._identity, "every": self.every}
        folder.first_does(lambda: write_checkpoint(folder.path / CHECKPOINT, tree))
        self._written = monotonic()
