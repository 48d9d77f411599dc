"""What a run must know to go on as if it had never ended, taken out of its objects and put back into them.

Numbers that the stepper and Newton's method have learnt are all their attributes but the parts that a run makes anew;
of a shared mesh each process keeps its own arrays. A kept factor is that of a tangent at a state, which is kept in its
place. A sum protects the file from chance only: before anything is put back its tree is compared with that which the
run itself would write.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from time import perf_counter
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from mpi4py import MPI

from rotfem.analysis.schemes import State
from rotfem.analysis.stability import Stability
from rotfem.analysis.stepper import Stepper
from rotfem.commands.monitor import Log, Monitor
from rotfem.commands.recorder import Recorder
from rotfem.errors import SceneError
from rotfem.refinement.companion import Companion, Followed
from rotfem.refinement.refine import Setting
from rotfem.scene import Scene, Time
from rotfem.structures.reference_rotation import ReferenceRotation
from rotfem.version import versions

#: By class, attributes that a run makes anew or that have a place of their own in a checkpoint.
_STEPPER = ("system", "newton", "back_off", "scheme", "scheme_back_off", "observers", "_linearised", "_about")
APART = {
    "Stepper": _STEPPER,
    "FollowingStepper": (*_STEPPER, "followed", "carried", "differences", "_there", "_curves"),
    "Companion": ("system", "followed", "output", "interval", "stepper", "further", "state", "waiting"),
}

Tree = dict[str, Any]

#: Parts of a checkpoint, and the types they may have.
PARTS: dict[str, Any] = {
    **dict.fromkeys(("identity", "versions", "state", "stepper", "log", "monitor"), dict),
    **dict.fromkeys(("factored", "stations", "resultants", "snapshots", "settings"), (dict, NoneType)),
    "positions": (np.ndarray, dict),
    "rows": np.ndarray,
    **dict.fromkeys(("t", "elapsed"), float),
    "given": (np.ndarray, NoneType),
    "factorisations": int,
    "every": (float, int),
    **dict.fromkeys(("columns", "companions"), list),
}


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


@contextmanager
def trusted(path: Path) -> Iterator[None]:
    """Turn whatever goes wrong with the content of a checkpoint whose sum is right into one error.

    Raises:
        SceneError: it does not hold what a checkpoint of this run does.
    """
    try:
        yield
    except SceneError:
        raise
    except Exception as error:  # of any kind, as anything may lie anywhere
        what = " ".join(f"{type(error).__name__}: {error}".split())
        why = f"does not hold what a checkpoint of this run does: {what}; start the run anew, without --resume"
        raise SceneError("command line", "--resume", path, why) from None


def check_parts(tree: Tree) -> None:
    """Refuse a tree that does not consist of what `Memory.taken` writes, each part of its type, by any error."""
    wrong = set(tree) ^ set(PARTS) or {name for name, kinds in PARTS.items() if not isinstance(tree[name], kinds)}
    if wrong:
        raise ValueError(", ".join(sorted(map(str, wrong))))
    json.dumps([tree["identity"], tree["versions"]["rotfem"]])
    if isinstance(tree["every"], bool) or not tree["every"] > 0:
        raise ValueError("every")
    if (settings := tree["settings"]) is not None:
        known = {name: settings[name] for name in ("elements", "scheme")}
        alike(vars(Setting((), None, 0)) | known, settings, "settings")


def packed(comm: MPI.Comm, value: Any) -> Any:
    """Return a tree with the arrays of all processes that share a mesh, on rank 0; all of them come here together."""
    if isinstance(value, np.ndarray) and comm.size > 1:
        return {"kind": "parts", "values": comm.gather(value)}
    if isinstance(value, dict):
        return {"kind": "dict", "values": {k: packed(comm, v) for k, v in value.items()}}
    if isinstance(value, list | tuple):
        return type(value)(packed(comm, v) for v in value)
    if is_dataclass(value) and not isinstance(value, type):
        values = {f.name: packed(comm, getattr(value, f.name)) for f in fields(value)}
        return {"kind": f"{type(value).__module__}:{type(value).__qualname__}", "values": values}
    return value


def unpacked(comm: MPI.Comm, value: Any) -> Any:
    """Return a tree with the arrays of this process."""
    if isinstance(value, np.ndarray) and value.dtype.kind not in "biuf":
        raise ValueError(f"an array of {value.dtype}")
    if isinstance(value, list | tuple):
        return type(value)(unpacked(comm, v) for v in value)
    if not isinstance(value, dict):
        return value
    kind, values = value["kind"], value["values"]
    if len(value) != 2 or not isinstance(kind, str):
        raise ValueError("kind")
    if kind == "dict":
        return {k: unpacked(comm, v) for k, v in values.items()}
    if kind == "parts":
        return unpacked(comm, values[comm.rank])
    record = record_of(kind)(**{k: unpacked(comm, v) for k, v in values.items()})
    for name, hint in get_type_hints(type(record)).items():
        if not suits(getattr(record, name), hint):
            raise TypeError(f"{name} of {type(record).__name__}")
    return record


@dataclass
class Memory:
    """What of a run a checkpoint holds: what marches, and what observes it; without a stepper nothing can be kept."""

    time: Time
    system: Any
    stepper: Stepper | None
    record: Recorder
    monitor: Monitor
    log: Log
    companions: Sequence[Companion]
    setting: Setting | None

    def taken(self, state: State, mine: Tree) -> Tree:
        """Return what the run knows at a state, on rank 0.

        Args:
            state: the state at the end of the last step.
            mine: identity of the run.
        """
        record, comm = self.record, self.system.comm
        pack = partial(packed, comm)
        assert self.stepper is not None
        return {
            "identity": mine,
            "versions": versions(),
            "positions": pack(self.system.V.tabulate_dof_coordinates()),
            "t": state.t,
            "given": state.given,
            "state": pack({k: v for k, v in vars(state).items() if k not in ("given", "inner")}),
            "factored": pack(self.system.held.factored),
            "stepper": of_stepper(self.stepper, comm),
            "log": self._counted(),
            "monitor": pack(self._seen()),
            "companions": [of_companion(companion, comm) for companion in self.companions],
            "elapsed": self.log.elapsed + perf_counter() - self.log.started,
            "factorisations": self.system.factorisations,
            "columns": list(record.history.columns),
            "rows": np.array(record.history.rows()).reshape(len(record.history), -1),
            "stations": None if record.stations is None else record.stations.kept_arrays(),
            "resultants": None if record.resultants is None else record.resultants.kept_arrays(),
            "snapshots": None if record.snapshots is None else pack(vars(record.snapshots)),
            "settings": None if self.setting is None else vars(self.setting),
        }

    def _counted(self) -> Tree:
        return {name: getattr(self.log, name) for name in ("steps", "warnings", "resumed")}

    def _seen(self) -> Tree:
        return {
            "since": self.monitor.since,
            "farthest": self.monitor.farthest.seen,
            "stability": self.monitor.stability,
        }

    def put_back(self, path: Path, tree: Tree) -> State:
        """Make the run know what a checkpoint says; return the state to go on from.

        Raises:
            SceneError: the mesh is another one, or other processes share it, or something in the tree is not what a
                run has.
        """
        with trusted(path):
            comm, here, there = self.system.comm, self.system.V.tabulate_dof_coordinates(), tree["positions"]
            ranks = len(there["values"]) if isinstance(there, dict) else 1
            if ranks != comm.size:
                why = f"is of a mesh that {ranks} processes share, and here are {comm.size}: go on with as many"
                raise SceneError("command line", "--resume", path, why)
            there, near = unpacked(comm, there), 1e-9 * float(np.max(np.ptp(here, axis=0)))
            same = there.shape == here.shape and bool(np.max(np.abs(there - here)) <= near)
            if not comm.allreduce(same, MPI.LAND):
                raise SceneError("command line", "--resume", path, "is of another mesh")
            self._check_rows(tree)
            return self._put_back(tree)

    def _put_back(self, tree: Tree) -> State:
        stepper, monitor, record, comm = self.stepper, self.monitor, self.record, self.system.comm
        assert stepper is not None
        state, system = State(**unpacked(comm, tree["state"]), given=tree["given"]), self.system.held
        check_state(self.system, stepper, state)
        if state.t != tree["t"]:
            raise ValueError("t")
        seen, rows = unpacked(comm, tree["monitor"]), tree["rows"]
        alike(self._counted(), tree["log"], "log")
        alike(self._seen() | {"stability": None}, {**seen, "stability": None}, "monitor")
        if not suits(seen["stability"], Stability | None) or len(seen["farthest"]) != len(monitor.farthest.seen):
            raise TypeError("monitor")
        for name, kind in (("warnings", str), ("resumed", dict)):
            if not all(isinstance(entry, kind) for entry in tree["log"][name]):
                raise TypeError(name)
        restored(self.system, unpacked(comm, tree["factored"]), state)
        system.factored_before = tree["factorisations"] - system.factorisations
        vars(self.log).update(tree["log"], elapsed=tree["elapsed"])
        monitor.since, monitor.farthest.seen, monitor.stability = seen["since"], seen["farthest"], seen["stability"]
        put_back_stepper(stepper, comm, tree["stepper"], state)
        for companion, known in zip(self.companions, tree["companions"], strict=True):
            put_back_companion(companion, self.system, known)
        for row in rows:
            record.history.append(row)
        if record.stations is not None:
            record.stations.put_back(tree["stations"], len(rows))
        if record.resultants is not None:
            record.resultants.put_back(tree["resultants"], len(rows))
        if record.snapshots is not None:
            snapshots = unpacked(comm, tree["snapshots"])
            if any(x.shape != self.system.zeros().shape for _, x in snapshots["kept"]):
                raise ValueError("snapshots")
            record.snapshots.put_back(snapshots, len(rows))
        return state

    def _check_rows(self, tree: Tree) -> None:
        """Refuse a history that has not as many rows as the steps have made, of columns as they are here.

        Raises:
            ValueError: it is.
        """
        rows, t, time = tree["rows"], tree["t"], self.time
        if tree["columns"] != list(self.record.history.columns) or tree["log"]["steps"] < 0:
            raise ValueError("columns")
        if time.output_step is None:
            due = 1 + tree["log"]["steps"] // time.output_every
        else:
            due = 1 + int(min(t, time.end) / time.output_step * (1 + 1e-9))
        if rows.ndim != 2 or rows.shape[1] != len(tree["columns"]) or not due <= len(rows) <= due + 1:
            raise ValueError(f"rows of shape {rows.shape} for {due} of {len(tree['columns'])} columns")
        if rows[0, 0] != 0.0 or np.any(np.diff(rows[:, 0]) <= 0.0) or rows[-1, 0] > t or not np.all(np.isfinite(rows)):
            raise ValueError("rows")


def of_companion(companion: Companion, comm: MPI.Comm) -> Tree:
    """Return what a companion of a run on these processes knows."""
    state = companion.state
    return {
        "state": packed(comm, state and state.changed(given=None, inner=())),
        "given": state and state.given,
        "waiting": packed(comm, companion.waiting),
        "differences": packed(comm, companion.stepper.differences),
        "factored": packed(comm, companion.system.held.factored),
        "known": plain(companion),
        "stepper": of_stepper(companion.stepper, comm),
    }


def put_back_companion(companion: Companion, followed: Any, tree: Tree) -> None:
    """Make a companion know what it knew (see `of_companion`) of the system that it follows."""
    stepper, comm = companion.stepper, followed.comm
    state, waiting, differences = (unpacked(comm, tree[name]) for name in ("state", "waiting", "differences"))
    alike(plain(companion), tree["known"], "known")
    if not suits(state, State | None) or not suits(tuple(waiting), tuple[Followed | None, Followed | None]):
        raise TypeError("companions")
    for end in (end for step in waiting if step is not None for pair in step.steps for end in pair):
        check_motion(followed, vars(end))
    alike([(0.0, companion.system.zeros())] * min(len(differences), 2), differences, "differences")
    companion.state, companion.waiting, stepper.differences = state, waiting, differences
    vars(companion).update(tree["known"])
    if state is not None:
        state.given = tree["given"]
        check_state(companion.system, stepper, state)
        restored(companion.system, unpacked(comm, tree["factored"]), state)
        put_back_stepper(stepper, comm, tree["stepper"], state)


def check_state(system: Any, stepper: Stepper, state: State) -> None:
    """Refuse a state that a system cannot be in, or that a stepper cannot go on from.

    Raises:
        ValueError: it is one.
    """
    check_motion(system, vars(state))
    if not 0.0 <= state.t < np.inf or not isinstance(state.balanced, bool):
        raise ValueError("state")
    if state.jump is not None and state.jump.shape != state.q.shape:
        raise ValueError("jump")
    if (state.given is None) != (system.hub is None) or (state.given is not None and state.given.shape != (3,)):
        raise ValueError("given")
    if not suits(state.reference, ReferenceRotation | None):
        raise ValueError("reference")
    memory, first = state.memory, stepper.scheme.start(state.changed(memory=None)).memory
    kinds = (type(first),) if first is not None else (stepper.scheme.remembers, tuple, type(None))
    arrays = [x for x in (*vars(memory).values(),) if isinstance(x, np.ndarray)] if is_dataclass(memory) else [memory]
    shapes = {x.shape for x in arrays if isinstance(x, np.ndarray)}
    if not isinstance(memory, kinds) or not shapes <= {state.q.shape}:
        raise ValueError("memory")


def check_motion(system: Any, known: Mapping[str, Any]) -> None:
    """Refuse q, v and a that a system does not have.

    Raises:
        ValueError: they are of other sizes, or not finite.
    """
    for name in "qva":
        if known[name].shape != system.zeros().shape or not np.all(np.isfinite(known[name])):
            raise ValueError(name)


def restored(system: Any, factored: Any, state: State) -> None:
    """Make the factor that a system kept at a state anew, from what is known of it."""
    if factored is not None:
        check_motion(system.held, factored)
        alike((0.0, 0.0, 0.0), tuple(factored["shifts"]), "shifts")
    system.held.count_rotations_from(state.reference)
    system.held.refactor(factored)
    system.held.count_rotations_from(state.reference)
    system.set_time(state.t)


def record_of(name: str) -> Any:
    """Return a dataclass of the program by "module:name"; nothing else is made from a file."""
    module, _, attribute = name.partition(":")
    found = getattr(import_module(module), attribute) if module.startswith("rotfem.") else None
    if not (isinstance(found, type) and is_dataclass(found)):
        raise SceneError("command line", "--resume", name, "is no record of rotfem")
    return found


def suits(value: Any, hint: Any) -> bool:
    """Return whether a value is of the declared type of a field of a record."""
    kind, of = get_origin(hint) or hint, get_args(hint)
    if kind is Any:
        return True
    if kind in (Union, UnionType):
        return any(suits(value, one) for one in of)
    if kind is tuple and isinstance(value, tuple) and of:
        each = [of[0]] * len(value) if of[-1] is Ellipsis else of
        return len(each) == len(value) and all(map(suits, value, each))
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, kind) if isinstance(kind, type) else True


def learning(stepper: Stepper) -> dict[str, Any]:
    """Return a stepper and its parts that learn from its steps, by name."""
    return {
        "own": stepper,
        "newton": stepper.newton,
        "back_off": stepper.back_off,
        "scheme_back_off": stepper.scheme_back_off,
    }


def of_stepper(stepper: Stepper, comm: MPI.Comm) -> Tree:
    """Return what a stepper has learnt, and what its matrices are about."""
    learnt = {name: plain(part) for name, part in learning(stepper).items()}
    return {**learnt, "matrices": packed(comm, stepper.matrices)}


def put_back_stepper(stepper: Stepper, comm: MPI.Comm, tree: Tree, state: State) -> None:
    """Make a stepper know what it had learnt at a state.

    Raises:
        TypeError: it cannot have learnt that.
    """
    learnt = {name: plain(part) for name, part in learning(stepper).items()}
    alike(learnt, {name: value for name, value in tree.items() if name != "matrices"}, "stepper")
    matrices = unpacked(comm, tree["matrices"])
    if matrices is not None:
        check_motion(stepper.system, matrices)
    stepper.make_matrices(matrices)
    stepper.system.held.count_rotations_from(state.reference)
    stepper.system.set_time(state.t)
    for name, part in learning(stepper).items():
        vars(part).update(tree[name])


def plain(thing: Any) -> Tree:
    """Return the attributes of an object, which are numbers, texts, truth values, None, or tuples and dicts of such.

    Those in `APART` are left out.

    Raises:
        TypeError: another one is of none of these types, and would be lost.
    """

    def is_plain(value: Any) -> bool:
        if isinstance(value, tuple):
            return all(map(is_plain, value))
        if isinstance(value, dict):
            return all(map(is_plain, value.values()))
        return value is None or isinstance(value, bool | int | float | str | np.generic)

    apart = APART.get(type(thing).__name__, ())
    found = {name: value for name, value in vars(thing).items() if name not in apart}
    lost = [name for name, value in found.items() if not is_plain(value)]
    if lost:
        raise TypeError(f"a checkpoint cannot hold {', '.join(lost)} of {type(thing).__name__}")
    return found


def alike(here: Any, there: Any, name: str) -> None:
    """Refuse a value that has not the type of the one which is there already, and so at all depths.

    What is None here may be a number, or several, there. Lists may be of any length.

    Raises:
        TypeError: it has not; names it.
    """
    here, there = (x.item() if isinstance(x, np.generic) else x for x in (here, there))
    suitable = type(here) is type(there) or (type(here) is float and type(there) is int)
    inner: list[tuple[Any, Any, Any]] = []
    if here is None:
        entries = there if isinstance(there, tuple) else (there,)
        suitable = all(type(entry) in (int, float, NoneType) for entry in entries)
    elif suitable and isinstance(here, dict) and here:
        suitable = set(here) == set(there)
        inner = [(key, value, there.get(key)) for key, value in here.items()]
    elif suitable and isinstance(here, tuple):
        suitable = len(here) <= len(there)
        inner = [(i, *pair) for i, pair in enumerate(zip(here, there, strict=False))] if len(here) == len(there) else []
    elif suitable and isinstance(here, np.ndarray):
        suitable = here.shape == there.shape
    if not suitable:
        raise TypeError(f"{name} is not what a run has there")
    for key, one, other in inner:
        alike(one, other, f"{name}.{key}")
