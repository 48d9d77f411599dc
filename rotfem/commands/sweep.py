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
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from multiprocessing.connection import wait
from pathlib import Path
from threading import Thread
from typing import Any

import click
import numpy as np
import typer
from mpi4py import MPI

from rotfem.commands.verbs import app
from rotfem.errors import ComputationError, InputError, OutputError
from rotfem.listeners import ONE_PROCESS, Progress
from rotfem.results.files import write_text
from rotfem.results.result_set import ResultFolder, read_summary
from rotfem.results.sweep import SweepResult, quantities
from rotfem.scene import load_scene
from rotfem.scene.extensions import load, loaded
from rotfem.units import unit_of
from rotfem.version import __version__, versions

#: Verbs that can be swept.
VERBS = ("run", "modes", "campbell", "response", "unbalance", "check")


@dataclass(frozen=True)
class Point:
    """One point of the grid: values of the keys, the changes of the scene that they are, and its folder."""

    values: dict[str, Any]
    changes: list[str]
    folder: Path

    @property
    def settled(self) -> bool:
        """Whether it is done, or has failed."""
        return read_summary(self.folder).get("status") in ("done", "failed")

    def row(self, reason: str = "") -> dict[str, Any]:
        """Return its row: values of the keys, what was computed, how it went; or why nothing was."""
        summary = read_summary(self.folder)
        status = summary.get("status", "failed")
        found = quantities(summary) if status == "done" else {}
        went = {"status": status, "reason": summary["failure"]["what"] if "failure" in summary else reason}
        went["seconds"] = summary.get("timings", {}).get("total", 0.0)
        return {**self.values, **found, **went, "folder": self.folder.name}


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


def grid(scene: Path, keys: Mapping[str, Sequence[Any]], verb: Sequence[str], folder: Path) -> list[Point]:
    """Return the points of all combinations, the last key fastest. Every scene is read."""
    out = []
    for values in product(*keys.values()):
        changes = [f"{k}={v if isinstance(v, str) else json.dumps(v)}" for k, v in zip(keys, values, strict=True)]
        read = load_scene(scene, changes)
        mesh = read.structure.mesh_file
        content = "" if mesh is None else hashlib.sha256(Path(mesh).read_bytes()).hexdigest()
        text = json.dumps([read.to_dict(), content, " ".join(verb), __version__], sort_keys=True, default=str)
        name = hashlib.sha256(text.encode()).hexdigest()[:16]
        out.append(Point(dict(zip(keys, values, strict=True)), changes, folder / "points" / name))
    return out


def settle(point: Point, scene: Path, verb: Sequence[str], files: Sequence[Path] = ()) -> dict[str, Any]:
    """Return the row of a point after the verb was run there in this process, with what files register."""
    for file in files:
        load(str(file), file, "sweep", "--load")
    changes = [part for change in point.changes for part in ("--set", change)]
    given = [*verb[:1], str(scene), *verb[1:], *changes, "-o", str(point.folder), "-q", "--no-plots", "--debug"]
    reason = ""
    try:
        app(given, prog_name="rotfem", standalone_mode=False)
    except (ComputationError, InputError) as error:
        reason = str(error)
    return point.row(reason)


def rows_of(
    points: Sequence[Point], scene: Path, verb: Sequence[str], jobs: int
) -> Iterator[tuple[Point, dict[str, Any]]]:
    """Yield points with their rows as they are settled."""
    if jobs == 1:
        yield from ((point, settle(point, scene, verb)) for point in points)
        return
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), end_with_parent) as pool:
        tasks = {pool.submit(settle, point, scene, verb, loaded()): point for point in points}
        try:
            yield from ((tasks[task], task.result()) for task in as_completed(tasks))
        finally:
            pool.shutdown(cancel_futures=True)


def end_with_parent() -> None:
    """Let this process end as soon as the one that started it has ended, however that did."""
    parent: Any = multiprocessing.parent_process()
    Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()


def sweep(
    scene: str | Path,
    keys: Mapping[str, Sequence[Any]],
    verb: Sequence[str],
    folder: str | Path,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
) -> SweepResult:
    """Return what a verb gives for all combinations of values of scene keys. Settled points are not computed again.

    Args:
        scene: path of a scene file.
        keys: dotted keys ↦ values.
        verb: its name and options as on the command line, such as `["campbell", "--speeds", "0:10:11"]`.
        folder: where every point has its results, in `points`, and the table grows.
        jobs: processes that compute; where there are several, a script guards itself by `if __name__ == "__main__"`.
        progress: called with the share of the points done, between 0 and 1.

    Raises:
        InputError: keys or verb are not such that can be swept.
        SceneError: the scene of a point is not valid.
        OutputError: a folder cannot be written.
    """
    scene, folder = Path(scene), Path(folder)
    check_asked(keys, verb)
    points = grid(scene, keys, verb, folder)
    rows = {p.folder: p.row() for p in points if p.settled}
    swept = {key: list(values) for key, values in keys.items() if len(values) > 1}
    of_all: dict[str, Any] = {"command": "sweep", "status": "done", "name": scene.stem, "verb": list(verb)}
    of_all |= {"keys": swept, "fixed": {key: values[0] for key, values in keys.items() if key not in swept}}

    def result() -> SweepResult:
        there = [
            {k: v for k, v in rows[p.folder].items() if k not in of_all["fixed"]} for p in points if p.folder in rows
        ]
        reasons = [row["reason"] for row in there if row["status"] != "done"]
        warnings = [f"{len(reasons)} of {len(points)} points failed, the first one: {reasons[0]}"] if reasons else []
        counts = {"points": len(points), "failed": len(reasons), "seconds": sum(row["seconds"] for row in there)}
        return SweepResult({**of_all, **counts, "warnings": warnings, "versions": versions()}, there)

    with ResultFolder(ONE_PROCESS, folder, "sweep", [scene]) as results:
        results.begin()
        for point, row in rows_of([p for p in points if p.folder not in rows], scene, verb, jobs):
            rows[point.folder] = row
            with suppress(OutputError):  # which the last table raises
                write_text(folder / "sweep.csv", result().texts()["sweep.csv"])
            if progress is not None:
                progress(len(rows) / len(points))
        found = result()
        results.publish(found.texts())
        results.summarise(found.summary)
        return found


def check_asked(keys: Mapping[str, Sequence[Any]], verb: Sequence[str]) -> None:
    """Refuse what cannot be swept, before anything is computed."""
    if MPI.COMM_WORLD.size > 1:
        raise InputError("sweep", None, "runs without mpirun; -j N shares out its points among N processes")
    if not verb or verb[0] not in VERBS:
        raise InputError("sweep", " ".join(verb), f"needs -- and a verb after it: {', '.join(VERBS)}")
    if max(map(len, keys.values()), default=0) < 2 or not all(keys.values()):
        several = "must give a key several values, KEY=first:last:number or KEY=a,b"
        raise InputError("sweep --set", " ".join(keys), several)
    try:
        commands: Any = typer.main.get_command(app)
        commands.commands[verb[0]].make_context(verb[0], ["scene", *verb[1:]])
    except click.UsageError as error:
        raise InputError("sweep", " ".join(verb), error.format_message()) from None
