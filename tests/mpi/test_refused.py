"""What is refused on several processes is refused by all of them, told once, and none waits for another.

One mpirun for each number of processes goes through all cases: see refused.py.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.bad_meshes import BAD, GROUPS, POINTS, refusal, write_bad
from tests.launch import MPIRUN, environment
from tests.plate_mesh_files import PLATE_SCENE, grid, write_msh

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]

BEAM = """\
[structure]
type = "planar_beam"
length = 1.0
section = { EA = 1e6, GA = 4e5, EI = 1e2, mass_per_length = 1.0, rotary_inertia = 1e-4 }
[motion]
type = "constant"
speed = 5.0
[mesh]
elements = 1
"""
TIME = "[time]\nend = 0.01\nstep = 0.005\n"

#: Meshes of fewer cells than processes: name ↦ number of processes, shape, mesh, and the key that is to blame.
FEW = {
    "one cell": (2, "length = 1.0\nwidth = 0.6", "elements = [1, 1]", "mesh.elements = [1, 1]: "),
    "three cells": (4, "length = 1.0\nwidth = 0.6", "elements = [3, 1]", "mesh.elements = [3, 1]: "),
    "a file of one cell": (2, 'mesh = "one.msh"', "", 'structure.mesh = "one.msh": '),
}


class Answer(NamedTuple):
    """What a command ends with: exit status and stderr by process, and whether there is a folder of results."""

    statuses: list[int]
    told: list[str]
    results: bool


class Ended(NamedTuple):
    """What a mpirun of refused.py ends with: the answers by name, and exit status and stderr of the last command."""

    answers: dict[str, Answer]
    status: int
    told: str


def write_cases(folder: Path, ranks: int) -> list[tuple[str, list[str], bool]]:
    """Write the scenes for a number of processes; return the commands of refused.py."""
    commands: list[tuple[str, list[str], bool]] = []
    write_msh(folder / "one.msh", *grid(1, 1))
    for name, (wanted, shape, mesh, _) in FEW.items():
        if wanted == ranks:
            scene = f"{name.replace(' ', '_')}.toml"
            (folder / scene).write_text(PLATE_SCENE.format(shape=shape, mesh=mesh) + TIME)
            commands += [(f"{name}, {command}", [command, scene], False) for command in ("modes", "run")]
    if ranks == 2:
        commands += [(name, ["modes", write_bad(folder, name)], False) for name in BAD]
        write_msh(folder / "good.msh", POINTS, GROUPS)
        (folder / "good.toml").write_text(PLATE_SCENE.format(shape='mesh = "good.msh"', mesh=""))
        commands.append(("broken reader", ["modes", "good.toml"], True))
        (folder / "beam.toml").write_text(BEAM)
        commands.append(("beam, run", ["run", "beam.toml", "-q", "--no-plots", "-o", "beam"], False))
        commands.append(("beam, modes", ["modes", "beam.toml"], False))
    return [*commands, commands[0]]


def ended(folder: Path, ranks: int) -> Ended:
    """Run all cases on that many processes; fails where they wait for ever, and says at which."""
    commands = write_cases(folder, ranks)
    (folder / "commands.json").write_text(json.dumps(commands))
    script = str(Path(__file__).with_name("refused.py"))
    start = [str(MPIRUN), "-n", str(ranks), "--oversubscribe", sys.executable, script, "commands.json"]
    try:
        done = subprocess.run(
            start, cwd=folder, env=environment(), capture_output=True, text=True, timeout=120, check=False
        )
    except subprocess.TimeoutExpired as waited:
        answered = (waited.stdout or b"").count(b"\n")
        pytest.fail(f"{ranks} processes wait for ever in the case {commands[answered][0]!r}")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(lines) == len(commands) - 1, f"ended in the case {commands[len(lines)][0]!r}: {done.stderr}"
    return Ended({name: Answer(*rest) for name, *rest in lines}, done.returncode, done.stderr)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Ended:
    return ended(tmp_path_factory.mktemp("two"), 2)


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> Ended:
    return ended(tmp_path_factory.mktemp("four"), 4)


def check_refused(answer: Answer, *parts: str) -> None:
    """Check that all processes end with status 2, and that the first one alone tells why, in one line."""
    assert set(answer.statuses) == {2}, answer
    first, *others = ([t for t in text.splitlines() if t.startswith("rotfem:")] for text in answer.told)
    assert len(first) == 1, answer
    assert not any(others), answer
    for part in parts:
        assert part in first[0]
    assert not any("Traceback" in text for text in answer.told)
    assert not answer.results


@pytest.mark.parametrize("name", list(BAD))
def test_bad_meshes(two: Ended, name: str) -> None:
    check_refused(two.answers[name], *refusal(name))


def test_any_failure_of_the_reader_is_told_by_all(two: Ended) -> None:
    """What nobody foresaw fails on rank 0 alone, and ends the other too."""
    message = "cannot be used as the mesh of a plate (ZeroDivisionError: on purpose)"
    check_refused(two.answers["broken reader"], message)


@pytest.mark.parametrize("command", ["modes", "run"])
@pytest.mark.parametrize("name", list(FEW))
def test_more_processes_than_cells(two: Ended, four: Ended, name: str, command: str) -> None:
    ranks, _, _, key = FEW[name]
    answers = {2: two, 4: four}[ranks].answers
    check_refused(answers[f"{name}, {command}"], key, f"cannot be shared by {ranks} processes")


def test_beams_of_fewer_cells_than_processes(two: Ended) -> None:
    """Their modes cannot be computed; their histories and steady states can."""
    check_refused(two.answers["beam, modes"], "mesh.elements = 1: the mesh (cells: 1) cannot be shared by 2 processes")
    assert two.answers["beam, run"].statuses == [0, 0], two.answers["beam, run"].told


def test_exit_status(two: Ended, four: Ended) -> None:
    """The last command of each mpirun, plates of too few cells, as a user sees it."""
    for ranks, done in ((2, two), (4, four)):
        told = [text for text in done.told.splitlines() if text.startswith("rotfem:")]
        assert done.status == 2, done.told
        assert len(told) == 1, done.told
        assert f"cannot be shared by {ranks} processes" in told[0], done.told
        assert "Traceback" not in done.told
