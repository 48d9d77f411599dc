"""What a run must know to go on as if it had never ended, taken out of its objects and put back into them.

Numbers that the stepper and Newton's method have learnt are all their attributes that are plain values; unknowns are
kept in the common order of nodes, so that any number of processes may go on. A kept factor is that of a tangent at a
state, which is kept in its place.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from rotfem.analysis.schemes import State
from rotfem.analysis.stepper import Stepper
from rotfem.errors import SceneError
from rotfem.scene import Scene
from rotfem.structures.numbering import Numbering
from rotfem.version import versions

if TYPE_CHECKING:
    from rotfem.commands.simulation import Simulation
    from rotfem.refinement.companion import Companion

#: Positions of nodes that differ by this part of the structure's size are those of another mesh.
MOVED = 1e-9

#: What of a simulation changes while it runs, besides what its parts know themselves.
CHANGING = ("steps", "warnings", "resumed", "_critical_since", "_exceeded")

#: Attributes that are made anew from what is known of them.
REMADE = ("_linearised", "_about")

Tree = dict[str, Any]


def identity(scene: Scene, terms: Mapping[str, Any], outputs: Mapping[str, Any]) -> Tree:
    """Return all that a run depends on, but for its end: scene, content of a mesh file, names of what scripts added."""
    mesh = scene.structure.mesh_file
    content = None if mesh is None else hashlib.sha256(Path(mesh).read_bytes()).hexdigest()
    tables = told(scene.digest())
    tables.get("time", {}).pop("end", None)
    return {"scene": tables, "mesh": content, "terms": sorted(terms), "outputs": sorted(outputs)}


def told(scene: Any) -> Any:
    """Return the tables of a scene as a file tells them, without those that nothing computed depends on."""
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


def check_identity(path: Path, tree: Tree, mine: Tree) -> None:
    """Refuse a checkpoint of another run.

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


def check_end(path: Path, tree: Tree, end: float) -> None:
    """Refuse an end (s) that lies before the checkpoint.

    Raises:
        SceneError: it does.
    """
    if end < tree["t"]:
        raise SceneError("command line", "--resume", path, f"is of t = {tree['t']:g} s, after time.end = {end:g} s")


class Packing:
    """Trees with arrays over a mesh, in an order that any number of processes knows.

    Args:
        numbering: of the mesh.
    """

    def __init__(self, numbering: Numbering):
        self.numbering = numbering

    def packed(self, value: Any) -> Any:
        """Return a tree with the arrays over the mesh in the common order; all processes come here together."""
        if isinstance(value, np.ndarray) and value.ndim and (kind := self.numbering.kind(value)):
            return {"kind": kind, "values": self.numbering.gather(value, kind)}
        if isinstance(value, dict):
            return {"kind": "dict", "values": {k: self.packed(v) for k, v in value.items()}}
        if isinstance(value, list | tuple):
            return type(value)(self.packed(v) for v in value)
        if is_dataclass(value) and not isinstance(value, type):
            values = {f.name: self.packed(getattr(value, f.name)) for f in fields(value)}
            return {"kind": f"{type(value).__module__}:{type(value).__qualname__}", "values": values}
        return value

    def unpacked(self, value: Any) -> Any:
        """Return a tree with the arrays of this process."""
        if isinstance(value, list | tuple):
            return type(value)(self.unpacked(v) for v in value)
        if not isinstance(value, dict):
            return value
        kind, values = value["kind"], value["values"]
        if kind == "dict":
            return {k: self.unpacked(v) for k, v in values.items()}
        if ":" in kind:
            return record_of(kind)(**{k: self.unpacked(v) for k, v in values.items()})
        return self.numbering.local(values, kind)


class Memory:
    """What one run knows.

    Args:
        run: the run.
    """

    def __init__(self, run: Simulation):
        self.run = run
        self.numbering = Numbering(run.system.V)
        self.packing = Packing(self.numbering)

    def taken(self, state: State, mine: Tree) -> Tree:
        """Return what the run knows at a state, on rank 0 in the common order of nodes.

        Args:
            state: the state at the end of the last step.
            mine: identity of the run.
        """
        run, snapshots = self.run, self.run.record.snapshots
        assert run.stepper is not None
        return {
            "identity": mine,
            "versions": versions(),
            "positions": self.numbering.positions,
            "t": state.t,
            "given": state.given,
            "state": self.packing.packed({k: v for k, v in vars(state).items() if k not in ("given", "inner")}),
            "factored": self.packing.packed(run.system.held.factored),
            "stepper": of_stepper(run.stepper, self.packing),
            "run": {name: getattr(run, name) for name in CHANGING},
            "seen": self.packing.packed({"farthest": run.farthest.seen, "stability": run.stability}),
            "companions": self._of_companions(),
            "elapsed": run.elapsed + perf_counter() - run.started,
            "factorisations": run.system.factorisations,
            "columns": list(run.record.history.columns),
            "rows": np.array(run.record.history.rows()).reshape(len(run.record.history), -1),
            "stations": None if run.record.stations is None else run.record.stations.kept_arrays(),
            "resultants": None if run.record.resultants is None else run.record.resultants.kept_arrays(),
            "snapshots": None if snapshots is None else self.packing.packed(vars(snapshots)),
            "choice": None if run.choice is None else vars(run.choice),
            "settings": None if run.setting is None else vars(run.setting),
        }

    def put_back(self, path: Path, tree: Tree) -> State:
        """Make the run know what a checkpoint says; return the state to go on from.

        Raises:
            SceneError: the mesh is another one, or the program that wrote it was.
        """
        run, stepper = self.run, self.run.stepper
        assert stepper is not None
        self._check_mesh(path, tree["positions"])
        if list(run.record.history.columns) != tree["columns"] or set(plain(stepper)) != set(tree["stepper"]["own"]):
            raise SceneError("command line", "--resume", path, "was written by another rotfem; start the run anew")
        state, system = State(**self.packing.unpacked(tree["state"]), given=tree["given"]), run.system.held
        restored(run.system, self.packing.unpacked(tree["factored"]), state)
        system.factored_before = tree["factorisations"] - system.factorisations
        vars(run).update(tree["run"])
        put_back_stepper(stepper, self.packing, tree["stepper"], state)
        seen = self.packing.unpacked(tree["seen"])
        run.farthest.seen, run.stability = seen["farthest"], seen["stability"]
        self._put_back_companions(tree["companions"])
        for row in tree["rows"]:
            run.record.history.append(row)
        if run.record.stations is not None:
            run.record.stations.put_back(tree["stations"])
        if run.record.resultants is not None:
            run.record.resultants.put_back(tree["resultants"])
        if run.record.snapshots is not None:
            vars(run.record.snapshots).update(self.packing.unpacked(tree["snapshots"]))
        run.elapsed = tree["elapsed"]
        return state

    def _companions(self) -> list[tuple[Companion, Packing]]:
        """Return the companions of the march, each with what packs arrays over its own mesh."""
        if self.run.companions is None:
            return []
        return [(c, Packing(Numbering(c.system.V))) for c in self.run.companions.companions]

    def _of_companions(self) -> list[Tree]:
        """Return what the companions know: steps that wait are of the run's mesh, the state of their own."""
        return [
            {
                "state": own.packed(companion.state and companion.state.changed(given=None, inner=())),
                "given": companion.state and companion.state.given,
                "waiting": self.packing.packed(companion.waiting),
                "last": own.packed(companion.stepper.last),
                "factored": own.packed(companion.system.held.factored),
                "known": plain(companion),
                "stepper": of_stepper(companion.stepper, own),
            }
            for companion, own in self._companions()
        ]

    def _put_back_companions(self, trees: list[Tree]) -> None:
        for (companion, own), tree in zip(self._companions(), trees, strict=True):
            companion.state, companion.waiting = own.unpacked(tree["state"]), self.packing.unpacked(tree["waiting"])
            if companion.state is not None:
                companion.state.given = tree["given"]
            vars(companion).update(tree["known"])
            companion.stepper.last = own.unpacked(tree["last"])
            if companion.state is not None:
                restored(companion.system, own.unpacked(tree["factored"]), companion.state)
                put_back_stepper(companion.stepper, own, tree["stepper"], companion.state)

    def _check_mesh(self, path: Path, there: Any) -> None:
        here = self.numbering.comm.bcast(self.numbering.positions)
        size = float(np.max(np.ptp(here, axis=0)))
        if there.shape != here.shape or np.max(np.abs(there - here)) > MOVED * size:
            raise SceneError("command line", "--resume", path, "is of another mesh")


def restored(system: Any, factored: Any, state: State) -> None:
    """Make the factor that a system kept at a state anew, from what is known of it."""
    system.held.count_rotations_from(state.datum)
    system.held.refactor(factored)
    system.held.count_rotations_from(state.datum)
    system.set_time(state.t)


def record_of(name: str) -> Any:
    """Return a dataclass of the program by "module:name"; nothing else is made from a file."""
    module, _, attribute = name.partition(":")
    found = getattr(import_module(module), attribute) if module.startswith("rotfem.") else None
    if not (isinstance(found, type) and is_dataclass(found)):
        raise SceneError("command line", "--resume", name, "is no record of rotfem")
    return found


def learning(stepper: Stepper) -> dict[str, Any]:
    """Return a stepper and its parts that learn from its steps, by name."""
    return {"own": stepper, "newton": stepper.newton, "patience": stepper.patience, "trust": stepper.trust}


def of_stepper(stepper: Stepper, packing: Packing) -> Tree:
    """Return what a stepper has learnt, and what its matrices are about."""
    learnt = {name: plain(part) for name, part in learning(stepper).items()}
    return {**learnt, "matrices": packing.packed(stepper.matrices)}


def put_back_stepper(stepper: Stepper, packing: Packing, tree: Tree, state: State) -> None:
    """Make a stepper know what it had learnt at a state."""
    stepper.make_matrices(packing.unpacked(tree["matrices"]))
    stepper.system.held.count_rotations_from(state.datum)
    stepper.system.set_time(state.t)
    for name, part in learning(stepper).items():
        vars(part).update(tree[name])


def plain(thing: Any) -> Tree:
    """Return the attributes of an object that are numbers, texts, truth values, None, or tuples and dicts of such."""

    def is_plain(value: Any) -> bool:
        if isinstance(value, tuple):
            return all(map(is_plain, value))
        if isinstance(value, dict):
            return all(map(is_plain, value.values()))
        return value is None or isinstance(value, bool | int | float | str | np.generic)

    return {name: value for name, value in vars(thing).items() if name not in REMADE and is_plain(value)}
