"""`rotfem sweep`: a verb over a grid of scene keys, on one or several processes; a killed sweep goes on.

Every point has a folder of its own, named after all that its result depends on, with the result as the verb writes it.
A point whose summary says done or failed is not computed again. The table sweep.csv grows with them.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from inspect import signature
from itertools import product
from multiprocessing.connection import wait
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
from mpi4py import MPI

from rotfem.commands.verbs import VERBS, AnyScene
from rotfem.errors import ComputationError, InputError, OutputError
from rotfem.listeners import ONE_PROCESS, Progress
from rotfem.results.files import write_text
from rotfem.results.result_set import ResultFolder, read_summary
from rotfem.results.sweep import SweepResult, quantities
from rotfem.scene import Scene, as_scene, load_scene
from rotfem.scene.extensions import load, loaded
from rotfem.scene.files import parse_override, set_keys
from rotfem.units import unit_of
from rotfem.version import __version__, versions

#: Verbs that can be swept.
SWEPT = ("run", "modes", "campbell", "response", "unbalance", "check")


@dataclass(frozen=True)
class Point:
    """One point of the grid: values of the keys, and its folder, if it has one."""

    values: dict[str, Any]
    folder: Path | None

    @property
    def settled(self) -> bool:
        """Whether it is done, or has failed."""
        return self.folder is not None and read_summary(self.folder).get("status") in ("done", "failed")

    def row(self, found: Mapping[str, Any] | None = None, reason: str = "") -> dict[str, Any]:
        """Return its row: values of the keys, what was computed, how it went; or why nothing was."""
        summary = found or ({} if self.folder is None else read_summary(self.folder))
        status = summary.get("status", "failed")
        numbers = quantities(summary) if status == "done" else {}
        went = {"status": status, "reason": summary["failure"]["what"] if "failure" in summary else reason}
        went["seconds"] = summary.get("timings", {}).get("total", 0.0)
        return {**self.values, **numbers, **went, **({} if self.folder is None else {"folder": self.folder.name})}


@dataclass(frozen=True)
class Task:
    """What is computed at every point: a verb with its keywords, of a scene that may run Python if it is trusted."""

    scene: AnyScene
    verb: str
    options: dict[str, Any]
    trust: bool

    def at(self, values: Mapping[str, Any]) -> Scene:
        """Return the scene at values of keys; a text is read as on the command line."""
        given = {k: parse_override("sweep", f"{k}={v}")[1] if isinstance(v, str) else v for k, v in values.items()}
        if isinstance(self.scene, Scene):
            return self.scene.replace(given)
        if isinstance(self.scene, Mapping):
            return as_scene(set_keys("scene", dict(self.scene), given.items()), self.trust)
        return load_scene(
            self.scene, [f"{k}={v if isinstance(v, str) else json.dumps(v)}" for k, v in values.items()], self.trust
        )

    def settle(self, point: Point) -> dict[str, Any]:
        """Return the row of a point after the verb was run there."""
        try:
            more = {} if point.folder is None else {"folder": point.folder, "plots": False}
            return point.row(VERBS[self.verb](self.at(point.values), **{**self.options, **more}).summary)
        except (ComputationError, InputError) as error:
            return point.row(reason=str(error))


def values_of(text: str) -> list[Any]:
    """Return the values of "first:last:number" or "a,b,…", with a unit at the end; the text where it is one value."""
    unit = unit_of(text)
    parts = text.removesuffix(unit).split(",")
    with suppress(ValueError):
        first, last, number = parts[0].split(":")
        parts = [f"{value:.12g}" for value in np.linspace(float(first), float(last), int(number))]
    if unit:
        return [f"{part.strip()} {unit}" for part in parts]
    try:
        found = tomllib.loads(f"values = [{','.join(parts)}]")["values"]
    except tomllib.TOMLDecodeError:
        return [part.strip() for part in parts]
    return [text] if len(found) == 1 else [x if isinstance(x, str | int | float) else json.dumps(x) for x in found]


def grid(task: Task, keys: Mapping[str, Sequence[Any]], folder: Path | None) -> list[Point]:
    """Return the points of all combinations, the last key fastest. Every scene is read."""
    out = []
    for values in (dict(zip(keys, some, strict=True)) for some in product(*keys.values())):
        read, place = task.at(values), None
        if folder is not None:
            mesh = read.structure.mesh_file
            content = "" if mesh is None else hashlib.sha256(Path(mesh).read_bytes()).hexdigest()
            what = [read.to_dict(), content, task.verb, task.options, __version__]
            text = json.dumps(what, sort_keys=True, default=str)
            place = folder / "points" / hashlib.sha256(text.encode()).hexdigest()[:16]
        out.append(Point(values, place))
    return out


def rows_of(points: Sequence[Point], task: Task, jobs: int) -> Iterator[tuple[Point, dict[str, Any]]]:
    """Yield points with their rows as they are settled."""
    if jobs == 1:
        yield from ((point, task.settle(point)) for point in points)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), begin, (loaded(),)) as pool:
        tasks = {pool.submit(task.settle, point): point for point in points}
        try:
            yield from ((tasks[done], done.result()) for done in as_completed(tasks))
        finally:
            pool.shutdown(cancel_futures=True)


def begin(files: Sequence[Path]) -> None:
    """Run the files that register something; let this process end as soon as the one that started it has ended."""
    parent: Any = multiprocessing.parent_process()
    Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()
    for file in files:
        load(str(file), file, "sweep", "--load")


def sweep(
    scene: AnyScene,
    keys: Mapping[str, Sequence[Any]],
    verb: str,
    folder: str | Path | None = None,
    *,
    jobs: int = 1,
    trust: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> SweepResult:
    """Return what a verb gives for all combinations of values of scene keys. Settled points are not computed again.

    Args:
        scene: scene, path of a scene file, or nested tables.
        keys: dotted keys ↦ values.
        verb: its name, such as "campbell".
        folder: where every point has its results, in `points`, and the table grows; None keeps the table alone.
        jobs: processes that compute; where there are several, a script guards itself by `if __name__ == "__main__"`.
        trust: let the scene run the Python files it names.
        progress: called with the share of the points done, between 0 and 1.
        options: keywords of the verb, such as speeds="0:10:11".

    Raises:
        InputError: keys or verb are not such that can be swept.
        SceneError: the scene of a point is not valid.
        OutputError: a folder cannot be written.
    """
    folder = None if folder is None else Path(folder)
    check_asked(keys, verb, options)
    task = Task(scene, verb, options, trust)
    points = grid(task, keys, folder)
    rows = {i: p.row() for i, p in enumerate(points) if p.settled}
    swept = {key: list(values) for key, values in keys.items() if len(values) > 1}
    name = Path(scene).stem if isinstance(scene, str | Path) else as_scene(scene, trust).name
    of_all: dict[str, Any] = {"command": "sweep", "status": "done", "name": name, "verb": [verb], "options": options}
    of_all |= {"keys": swept, "fixed": {key: values[0] for key, values in keys.items() if key not in swept}}

    def result() -> SweepResult:
        there = [{k: v for k, v in rows[i].items() if k not in of_all["fixed"]} for i in sorted(rows)]
        reasons = [row["reason"] for row in there if row["status"] != "done"]
        warnings = [f"{len(reasons)} of {len(points)} points failed, the first one: {reasons[0]}"] if reasons else []
        counts = {"points": len(points), "failed": len(reasons), "seconds": sum(row["seconds"] for row in there)}
        return SweepResult({**of_all, **counts, "warnings": warnings, "versions": versions()}, there)

    inputs = [Path(scene)] if isinstance(scene, str | Path) else []
    with nullcontext() if folder is None else ResultFolder(ONE_PROCESS, folder, "sweep", inputs) as results:
        if results is not None:
            results.begin()
        places = {id(point): i for i, point in enumerate(points)}
        for point, row in rows_of([p for i, p in enumerate(points) if i not in rows], task, jobs):
            rows[places[id(point)]] = row
            with suppress(OutputError):  # which the last table raises
                if folder is not None:
                    write_text(folder / "sweep.csv", result().texts()["sweep.csv"])
            if progress is not None:
                progress(len(rows) / len(points))
        found = result()
        if results is not None:
            results.publish(found.texts())
            results.summarise(found.summary)
        return found


def check_asked(keys: Mapping[str, Sequence[Any]], verb: str, options: Mapping[str, Any]) -> None:
    """Refuse what cannot be swept, before anything is computed."""
    if MPI.COMM_WORLD.size > 1:
        raise InputError("sweep", None, "runs without mpirun; -j N shares out its points among N processes")
    if verb not in SWEPT:
        raise InputError("sweep", verb, f"needs a verb, on the command line after --: {', '.join(SWEPT)}")
    if max(map(len, keys.values()), default=0) < 2 or not all(keys.values()):
        several = "must give a key several values, KEY=first:last:number or KEY=a,b"
        raise InputError("sweep --set", " ".join(keys), several)
    try:
        signature(VERBS[verb]).bind("scene", **options)
    except TypeError as error:
        raise InputError("sweep", verb, str(error)) from None
