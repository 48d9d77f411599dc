"""What a run must know to go on as if it had never ended, taken out of its objects and put back into them.

Numbers that the stepper and Newton's method have learnt are all their attributes but the parts that a run makes anew;
of a shared mesh each process keeps its own arrays. A kept factor is that of a tangent at a state, which is kept in its
place.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, cast

import numpy as np
from mpi4py import MPI

from rotfem.analysis.schemes import State
from rotfem.analysis.stepper import Stepper
from rotfem.commands.monitor import Log, Monitor
from rotfem.commands.recorder import Recorder
from rotfem.errors import SceneError
from rotfem.refinement.companion import Companion
from rotfem.refinement.refine import Setting
from rotfem.scene import Scene, Time
from rotfem.version import versions

#: By class, attributes that a run makes anew or that have a place of their own in a checkpoint.
_STEPPER = ("system", "newton", "back_off", "scheme", "scheme_back_off", "observers", "_linearised", "_about")
APART = {
    "Stepper": _STEPPER,
    "FollowingStepper": (*_STEPPER, "followed", "carried", "differences", "_there", "_curves"),
    "Companion": ("system", "followed", "output", "interval", "stepper", "further", "state", "waiting", "_step"),
}

Tree = dict[str, Any]


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
    companions: Sequence[Companion]
    setting: Setting | None

    def taken(self, state: State, mine: Tree) -> Tree:
        """Return what the run knows at a state, on rank 0.

        Args:
            state: the state at the end of the last step.
            mine: identity of the run.
        """
        record, comm, snapshots = self.record, self.system.comm, self.record.snapshots
        assert self.stepper is not None
        own = {
            "positions": self.system.V.tabulate_dof_coordinates(),
            "state": state.changed(inner=()),
            "factored": self.system.held.factored,
            "stepper": of_stepper(self.stepper),
            "monitor": {name: getattr(self.monitor, name) for name in ("since", "stability")},
            "farthest": (self.monitor.farthest.seen, self.monitor.farthest.first),
            "companions": [of_companion(companion) for companion in self.companions],
            "snapshots": None if snapshots is None else vars(snapshots),
        }
        return {
            "identity": mine,
            "versions": versions(),
            "t": state.t,
            "log": {name: getattr(self.log, name) for name in ("steps", "warnings", "resumed")},
            "elapsed": self.log.elapsed + perf_counter() - self.log.started,
            "factorisations": self.system.factorisations,
            "rows": np.array(record.history.rows()).reshape(len(record.history), -1),
            "stations": None if record.stations is None else record.stations.known(),
            "resultants": None if record.resultants is None else record.resultants.known(),
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
        stepper, record, state = self.stepper, self.record, own["state"]
        assert stepper is not None
        restored(self.system, own["factored"], state)
        self.system.held.factored_before = tree["factorisations"] - self.system.held.factorisations
        vars(self.log).update(tree["log"], elapsed=tree["elapsed"])
        vars(self.monitor).update(own["monitor"])
        self.monitor.farthest.seen, self.monitor.farthest.first = own["farthest"]
        put_back_stepper(stepper, own["stepper"], state)
        for companion, known in zip(self.companions, own["companions"], strict=True):
            put_back_companion(companion, known)
        for row in tree["rows"]:
            record.history.append(row)
        if record.stations is not None:
            record.stations.put_back(tree["stations"])
        if record.resultants is not None:
            record.resultants.put_back(tree["resultants"])
        if record.snapshots is not None:
            vars(record.snapshots).update(own["snapshots"])
        return cast(State, state)


def of_companion(companion: Companion) -> Tree:
    """Return what a companion knows."""
    return {
        "state": companion.state and companion.state.changed(inner=()),
        "waiting": companion.waiting,
        "differences": companion.stepper.differences,
        "factored": companion.system.held.factored,
        "known": known(companion),
        "stepper": of_stepper(companion.stepper),
    }


def put_back_companion(companion: Companion, tree: Tree) -> None:
    """Make a companion know what it knew (see `of_companion`)."""
    companion.state, companion.waiting = tree["state"], tree["waiting"]
    companion.stepper.differences = tree["differences"]
    vars(companion).update(tree["known"])
    if companion.state is not None:
        restored(companion.system, tree["factored"], companion.state)
        put_back_stepper(companion.stepper, tree["stepper"], companion.state)


def restored(system: Any, factored: Any, state: State) -> None:
    """Make the factor that a system kept at a state anew, from what is known of it."""
    system.held.count_rotations_from(state.reference)
    system.held.refactor(factored)
    system.held.count_rotations_from(state.reference)
    system.set_time(state.t)


def learning(stepper: Stepper) -> dict[str, Any]:
    """Return a stepper and its parts that learn from its steps, by name."""
    return {
        "own": stepper,
        "newton": stepper.newton,
        "back_off": stepper.back_off,
        "scheme_back_off": stepper.scheme_back_off,
    }


def of_stepper(stepper: Stepper) -> Tree:
    """Return what a stepper has learnt, and what its matrices are about."""
    return {name: known(part) for name, part in learning(stepper).items()} | {"matrices": stepper.matrices}


def put_back_stepper(stepper: Stepper, tree: Tree, state: State) -> None:
    """Make a stepper know what it had learnt at a state."""
    stepper.make_matrices(tree["matrices"])
    stepper.system.held.count_rotations_from(state.reference)
    stepper.system.set_time(state.t)
    for name, part in learning(stepper).items():
        vars(part).update(tree[name])


def known(thing: Any) -> Tree:
    """Return the attributes of an object but those in `APART`."""
    apart = APART.get(type(thing).__name__, ())
    return {name: value for name, value in vars(thing).items() if name not in apart}
