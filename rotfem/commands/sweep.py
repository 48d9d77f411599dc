"""`rotfem sweep`: a verb over a grid of scene keys, on one or several processes or ranks; a killed sweep goes on.

Every point has a folder of its own, named after all that its result depends on, with the result as the verb writes it.
Each worker has points of its own. A point is settled when its summary says done or failed.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
import typer
from mpi4py import MPI

from rotfem.commands.console import ALONE
from rotfem.commands.job import app
from rotfem.commands.processes import raise_first
from rotfem.errors import ComputationError, InputError, OutputError
from rotfem.listeners import ONE_PROCESS, Progress
from rotfem.results.result_set import ResultFolder, read_summary
from rotfem.results.sweep import SweepResult, quantities
from rotfem.scene import Scene, load_scene
from rotfem.scene.extensions import load, loaded
from rotfem.version import __version__, versions

#: Verbs that can be swept.
VERBS = ("run", "modes", "campbell", "response", "check")

RANGE = re.compile(r"([^:,]+):([^:,]+):(\d+)\s*([^\d\s].*)?")
WITH_UNIT = re.compile(r"\s*([-+.\d]+(?:[eE][-+]?\d+)?+)\s*([^-+.\d\s].*)")


@dataclass(frozen=True)
class Point:
    """One point of the grid: values of the swept keys, the changes of the scene that they are, and its folder."""

    values: dict[str, Any]
    changes: list[str]
    folder: Path

    @property
    def settled(self) -> bool:
        """Whether it is done, or has failed."""
        return read_summary(self.folder).get("status") in ("done", "failed")


def values_of(text: str) -> list[Any]:
    """Return the values of "first:last:number" or "a,b,…", with a unit at the end; the text where it is one value."""
    if found := RANGE.fullmatch(text):
        first, last, number, unit = found.groups()
        try:
            values = [float(f"{value:.12g}") for value in np.linspace(float(first), float(last), int(number))]
            whole = "." not in first + last and all(value == round(value) for value in values)
        except (ValueError, OverflowError):
            raise InputError("sweep --set", text, "must be first:last:number, of numbers") from None
        numbers = list(map(round, values)) if whole else values
        return [f"{value!r} {unit}" for value in numbers] if unit else list(numbers)
    with suppress(ValueError):
        tomllib.loads(f"value = {text}")
        return [text]
    parts = [part.strip() for part in text.split(",")]
    if any(part.count(a) != part.count(b) for part in parts for a, b in ("[]", "{}")):
        raise InputError("sweep --set", text, "must be values without commas within, which stand between them")
    if (last_one := WITH_UNIT.fullmatch(parts[-1])) and not any(map(WITH_UNIT.fullmatch, parts[:-1])):
        parts = [f"{part} {last_one[2]}" for part in [*parts[:-1], last_one[1]]]
    return [_number(part) for part in parts]


def _number(text: str) -> Any:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(text)
    return text


def fingerprint(scene: Scene, verb: str) -> str:
    """Return a hash of all that a point depends on: scene, verb, version. A mesh file counts by its content."""
    mesh = getattr(scene.structure, "mesh", None)
    content = hashlib.sha256(Path(mesh).read_bytes()).hexdigest() if mesh is not None else None
    text = json.dumps([scene.to_dict(), content, verb, __version__], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def grid(scene: Path, keys: Mapping[str, Sequence[Any]], verb: Sequence[str], folder: Path) -> list[Point]:
    """Return the points of all combinations, the last key fastest. Every scene is read."""
    out = []
    for values in product(*keys.values()):
        changes = [f"{k}={v if isinstance(v, str) else json.dumps(v)}" for k, v in zip(keys, values, strict=True)]
        name = fingerprint(load_scene(scene, changes), " ".join(verb))
        out.append(Point(dict(zip(keys, values, strict=True)), changes, folder / "points" / name))
    return out


def settle(point: Point, scene: Path, verb: Sequence[str]) -> None:
    """Run the verb at a point in this process, alone, unless that is done; a failure is in the point's summary."""
    if point.settled:
        return
    import rotfem.commands.cli  # noqa: F401  the verbs

    changes = [part for change in point.changes for part in ("--set", change)]
    given = [*verb[:1], str(scene), *verb[1:], *changes, "-o", str(point.folder), "-q", "--no-plots", "--debug"]
    token = ALONE.set(True)
    try:
        app(given, prog_name="rotfem", standalone_mode=False)
    except (ComputationError, InputError) as error:
        if not point.settled:
            with ResultFolder(ONE_PROCESS, point.folder, verb[0]) as results:
                results.begin()
                results.close(error)
    finally:
        ALONE.reset(token)


def work(points: Sequence[Point], scene: Path, verb: Sequence[str], progress: Progress, parent: int = 0) -> None:
    """Settle points one after the other; stop if the process that started this one is gone."""
    for number, point in enumerate(points, start=1):
        if parent and os.getppid() != parent:
            return
        settle(point, scene, verb)
        progress(number / len(points))


def sweep(
    scene: str | Path,
    keys: Mapping[str, Sequence[Any]],
    verb: Sequence[str],
    folder: str | Path,
    *,
    jobs: int = 1,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: Progress | None = None,
) -> SweepResult:
    """Return what a verb gives for all combinations of values of scene keys. Points that are done are not done again.

    Args:
        scene: path of a scene file.
        keys: dotted keys ↦ values.
        verb: its name and options as on the command line, such as `["campbell", "--speeds", "0:10:11"]`.
        folder: where every point has its results, in `points`.
        jobs: processes that compute, this one included. They know what the scene or `--load` registers.
        comm: ranks that share the points, each computing alone.
        progress: called with the share of the points done, between 0 and 1.

    Raises:
        InputError: keys or verb are not such that can be swept.
        SceneError: the scene of a point is not valid.
        OutputError: a folder cannot be written.
    """
    scene, folder = Path(scene), Path(folder)
    check_asked(keys, verb, jobs, comm)
    points, progress = grid(scene, keys, verb, folder), progress or (lambda share: None)
    problem = None
    try:
        try:
            if comm.rank == 0:  # which also compiles the forms
                settle(points[0], scene, verb)
        finally:
            comm.Barrier()
        with helpers(scene, keys, verb, folder, jobs - 1):
            share = comm.rank if comm.size > 1 else 0
            work(points[share :: max(jobs, comm.size)], scene, verb, progress)
        if jobs > 1:
            work(points, scene, verb, progress)  # what a helper has left
    except OutputError as error:
        problem = error
    raise_first(comm.allgather(problem))
    swept = {key: list(values) for key, values in keys.items() if len(values) > 1}
    rows = comm.bcast([row_of(point, swept) for point in points] if comm.rank == 0 else None)
    reasons = [row["reason"] for row in rows if row["status"] != "done"]
    warnings = [f"{len(reasons)} of {len(rows)} points failed, the first one: {reasons[0]}"] if reasons else []
    summary = {
        "command": "sweep",
        "status": "done",
        "name": scene.stem,
        "verb": list(verb),
        "keys": swept,
        "fixed": {key: values[0] for key, values in keys.items() if key not in swept},
        "points": len(points),
        "failed": len(reasons),
        "seconds": sum(row["seconds"] for row in rows),
        "warnings": warnings,
        "versions": versions(),
    }
    return SweepResult(summary, rows)


def check_asked(keys: Mapping[str, Sequence[Any]], verb: Sequence[str], jobs: int, comm: MPI.Comm) -> None:
    """Refuse what cannot be swept, before anything is computed."""
    import rotfem.commands.cli  # noqa: F401  the verbs

    if not verb or verb[0] not in VERBS:
        raise InputError("sweep", " ".join(verb), f"needs -- and a verb after it: {', '.join(VERBS)}")
    if max((len(values) for values in keys.values()), default=0) < 2 or not all(map(len, keys.values())):
        raise InputError(
            "sweep --set", " ".join(keys), "must give a key several values, KEY=first:last:number or KEY=a,b"
        )
    if jobs < 1 or (jobs > 1 and comm.size > 1):
        raise InputError("sweep --jobs", jobs, "must be at least 1; under mpirun the ranks share the points")
    try:
        commands: Any = typer.main.get_command(app)
        commands.commands[verb[0]].make_context(verb[0], ["scene", *verb[1:]])
    except click.UsageError as error:
        raise InputError("sweep", " ".join(verb), error.format_message()) from None


@contextmanager
def helpers(
    scene: Path, keys: Mapping[str, Sequence[Any]], verb: Sequence[str], folder: Path, number: int
) -> Iterator[None]:
    """Let further processes compute points meanwhile."""
    code = f"from {__name__} import help_out; help_out()"
    started = [subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) for _ in range(number)]
    for share, process in enumerate(started, start=1):
        assert process.stdin is not None
        points = [share, number + 1]
        given = [str(scene), dict(keys), list(verb), str(folder), points, os.getpid(), [*map(str, loaded())]]
        with suppress(BrokenPipeError), process.stdin as pipe:
            pipe.write(json.dumps(given).encode())
    try:
        yield
    except BaseException:
        for process in started:
            process.terminate()
        raise
    finally:
        for process in started:
            process.wait()


def help_out() -> None:
    """Compute points in a process that `helpers` has started. What it cannot write the other one says."""
    scene, keys, verb, folder, (share, jobs), parent, files = json.load(sys.stdin)
    with suppress(KeyboardInterrupt, OutputError):
        for file in files:
            load(file, Path(file), "sweep", "--load")
        points = grid(Path(scene), keys, verb, Path(folder))[share::jobs]
        work(points, Path(scene), verb, lambda share: None, parent)


def row_of(point: Point, swept: Collection[str]) -> dict[str, Any]:
    """Return the row of a point: values of the swept keys, what was computed, how it went."""
    summary = read_summary(point.folder)
    done, seconds = summary["status"] == "done", summary.get("timings", {}).get("total", 0.0)
    went = {"status": summary["status"], "reason": "" if done else summary["failure"]["what"], "seconds": seconds}
    found = quantities(summary) if done else {}
    return {**{k: v for k, v in point.values.items() if k in swept}, **found, **went, "folder": point.folder.name}
