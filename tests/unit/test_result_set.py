"""A result folder holds one whole set, or says that it does not, whatever happens while it is written."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from rotfem.errors import OutputError
from rotfem.results import ModesResult, RunResult
from rotfem.results.files import csv_text, read_csv
from rotfem.results.result_set import NAME, OURS, FolderLock, ResultSet, read_summary, said_of
from rotfem.results.run import LiveTable, Table

ROOT = Path(__file__).resolve().parents[2]


def run_result(value: float, shape: bool = True) -> RunResult:
    history = {"t": np.array([0.0, 0.5]), "tip_u1": np.array([0.0, value])}
    summary = {"command": "run", "status": "done", "value": value, "warnings": []}
    return RunResult(summary, history, {"x": np.array([0.0, value])} if shape else {})


def modes_result() -> ModesResult:
    summary = {"command": "modes", "status": "done", "speed": 1.0, "warnings": []}
    return ModesResult(summary, [{"mode": 1, "frequency": 2.0}], {"mode 1": {"x": np.zeros(2)}})


def files(folder: Path) -> set[str]:
    return set(os.listdir(folder))


def test_a_set_takes_the_place_of_the_one_before_and_of_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "measured.csv").write_text("mine")
    run_result(1.0).write(tmp_path)
    assert files(tmp_path) == {"notes.txt", "measured.csv", "history.csv", "shape.csv", "summary.json"}
    modes_result().write(tmp_path)
    assert files(tmp_path) == {
        "notes.txt",
        "measured.csv",
        "modes.csv",
        "mode_shapes.csv",
        "modes.json",
        "summary.json",
    }
    run_result(2.0, shape=False).write(tmp_path)
    assert files(tmp_path) == {"notes.txt", "measured.csv", "history.csv", "summary.json"}
    assert (tmp_path / "notes.txt").read_text() == (tmp_path / "measured.csv").read_text() == "mine"


@pytest.mark.parametrize("name", ["modes.csv", "summary.json", "M.npz", "checkpoint.h5"])
def test_nothing_is_written_where_somebody_else_has_files_like_results(tmp_path: Path, name: str) -> None:
    """With a figure in it, which a script may have drawn, a folder can be one of rotfem's; it stays, too."""
    (tmp_path / "modes.png").write_text("mine")
    run_result(1.0).write(tmp_path / "drawn")
    (tmp_path / name).write_text('{"status": "mine"}')
    before = {path: path.read_text() for path in tmp_path.iterdir() if path.is_file()}
    with pytest.raises(OutputError, match=rf"{name}: cannot be written: it is there already"):
        run_result(1.0).write(tmp_path)
    assert {path: path.read_text() for path in tmp_path.iterdir() if path.is_file()} == before


def test_the_folder_of_an_early_rotfem_that_was_killed_is_one_of_ours(tmp_path: Path) -> None:
    left = {"command": "run", "status": "running", "pid": 1, "host": "x", "warnings": []}
    (tmp_path / "summary.json").write_text(json.dumps(left))
    (tmp_path / "history.csv").write_text("t\n")
    modes_result().write(tmp_path)
    assert "history.csv" not in files(tmp_path)


@pytest.mark.parametrize("name", ["history.csv", "summary.json", "fields.bp/data.0", "path.csv"])
def test_inputs_are_never_outputs(tmp_path: Path, name: str) -> None:
    """Also in a folder of rotfem's, where a table may be that an earlier run has written; and through a link."""
    with ResultSet(tmp_path / "results", "run") as results:
        results.put({"path.csv": "t\n", "history.csv": "t\n"})
        results.finish({"command": "run", "status": "done"})
    (tmp_path / "link").symlink_to(tmp_path / "results")
    for folder, path in (("results", tmp_path / "link" / name), ("link", tmp_path / "results" / name)):
        with pytest.raises(OutputError, match=rf"{name.split('/')[0]}: cannot be written: the scene reads it"):
            ResultSet(tmp_path / folder, "modes", [path])
    with ResultSet(tmp_path / "results", "modes", [tmp_path / "history.csv", tmp_path / "results" / "gusts.csv"]):
        assert "history.csv" in files(tmp_path / "results")


def test_no_link_is_followed(tmp_path: Path) -> None:
    target = tmp_path / "precious"
    target.write_text("mine")
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / NAME).symlink_to(target)
    with pytest.raises(OutputError, match=r"\.rotfem\.lock: cannot be written: it is a symbolic link"):
        run_result(1.0).write(folder)
    (folder / NAME).unlink()
    with ResultSet(folder, "run") as results:
        live = results.grow("history.csv", Table(("t",)))
        live.path.unlink()
        live.path.symlink_to(target)
        live.table.append((1.0,))
        assert not live.flush()
        results.put({"history.csv": "t\n2.0\n"})
        results.finish({"command": "run", "status": "done"})
    assert not (folder / "history.csv").is_symlink()
    assert target.read_text() == "mine"


def test_what_ends_unexpectedly_has_failed(tmp_path: Path) -> None:
    for error, status in ((KeyboardInterrupt(), "interrupted"), (ZeroDivisionError("by zero"), "failed")):
        results = ResultSet(tmp_path, "run")
        results.grow("history.csv", Table(("t",)))
        results.close(error)
        assert read_summary(tmp_path)["status"] == status
    assert said_of(tmp_path).startswith(f"{tmp_path}: run failed: ZeroDivisionError: by zero")


def test_a_summary_says_failed_on_a_full_disk_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(**_: object) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError), ResultSet(tmp_path, "run") as results:  # noqa: PT012
        results.grow("history.csv", Table(("t",)))
        monkeypatch.setattr(tempfile, "mkstemp", full)
        results.finish({"command": "run", "status": "done"})
    assert read_summary(tmp_path)["status"] == "failed"
    assert "No space left on device" in said_of(tmp_path)


def test_what_a_killed_process_was_at_is_said(tmp_path: Path) -> None:
    table = Table(("t", "x"))
    results = ResultSet(tmp_path, "run")
    live = results.grow("history.csv", table)
    table.append((0.5, 1.0))
    live.flush()
    assert f"run running, by process {os.getpid()}" in said_of(tmp_path)
    results._lock.release()  # as the end of a process does
    said = said_of(tmp_path)
    assert f"run failed: process {os.getpid()}" in said
    assert "was running and has ended without a word; history.csv has 1 rows, up to t = 0.5 s" in said
    with ResultSet(tmp_path, "run") as after:
        assert after.before == said
    with pytest.raises(OutputError, match="no results"):
        said_of(tmp_path / "elsewhere")


def test_names_of_all_files_are_known() -> None:
    """So that the next set finds them even if this one is killed before it can list them."""
    results = (run_result(1.0), modes_result())
    for result in results:
        assert all(OURS.fullmatch(name) for name in result.files() if name != "summary.json")
    for name in (
        "fields.bp",
        "modes.xdmf",
        "mode_12.gif",
        "M.npz",
        "K.mtx",
        "cost.csv",
        "campbell.png",
        "checkpoint.h5",
    ):
        assert OURS.fullmatch(name), name
    for name in ("notes.txt", "my_history.csv", "history.csv.bak", "cost.jsonl", "scene.toml", "mode_x.gif"):
        assert not OURS.fullmatch(name), name


def test_a_file_of_another_name_is_listed_and_goes_with_its_set(tmp_path: Path) -> None:
    with ResultSet(tmp_path, "run") as results:
        results.put({"path.csv": "t\n"})
        results.finish({"command": "run", "status": "done"})
    assert read_summary(tmp_path)["files"] == ["path.csv"]
    modes_result().write(tmp_path)
    assert "path.csv" not in files(tmp_path)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {root!r})
import rotfem.results.result_set as module
from tests.unit.test_result_set import run_result

def counted(name):
    real = getattr(os, name)
    def call(*arguments, **options):
        global left
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*arguments, **options)
    setattr(os, name, call)

left = int(sys.argv[2])
for name in ("replace", "unlink", "open", "chmod", "mkdir", "close"):
    counted(name)
run_result(2.0).write(Path(sys.argv[1]))
"""


def test_killed_at_any_call_the_folder_never_mixes_two_sets(tmp_path: Path) -> None:
    """Killed before its first, second, … call that changes files until one start gets through."""
    states = set()
    for count in range(0, 400, 3):
        folder = tmp_path / str(count)
        folder.mkdir()
        modes_result().write(folder)
        done = subprocess.run(
            [sys.executable, "-c", KILLED.format(root=str(ROOT)), str(folder), str(count)], check=False, timeout=60
        )
        summary, there = read_summary(folder), {name for name in files(folder) if OURS.fullmatch(name)}
        states.add(summary["status"])
        if summary["status"] == "done":
            whole = {"run": {"history.csv", "shape.csv"}, "modes": {"modes.csv", "mode_shapes.csv", "modes.json"}}
            assert there == whole[summary["command"]], f"killed at call {count}"
        run_result(3.0).write(folder)  # what the killed one left is no obstacle, and goes
        assert files(folder) == {"history.csv", "shape.csv", "summary.json"}
        assert read_csv(folder / "history.csv")["tip_u1"][-1] == 3.0
        if done.returncode == 0:
            break
    else:
        pytest.fail("no start got through")
    assert states == {"done", "writing"}


def test_a_full_disk_leaves_the_set_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_result(1.0).write(tmp_path)
    before = {name: (tmp_path / name).read_bytes() for name in files(tmp_path)}
    real = os.fdopen

    class Full:
        def __init__(self, descriptor: int, mode: str):
            self.file = real(descriptor, mode)

        def __enter__(self) -> Full:
            return self

        def __exit__(self, *_: object) -> None:
            self.file.close()

        def write(self, content: bytes) -> None:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fdopen", Full)
    with pytest.raises(OutputError, match="No space left on device"):
        run_result(2.0).write(tmp_path)
    monkeypatch.undo()
    assert {name: (tmp_path / name).read_bytes() for name in files(tmp_path)} == before


def test_a_folder_in_the_place_of_a_file_is_no_end_of_the_set_before(tmp_path: Path) -> None:
    modes_result().write(tmp_path)
    (tmp_path / "shape.csv").mkdir()
    with pytest.raises(OutputError, match=r"shape\.csv.*Is a directory"):
        run_result(1.0).write(tmp_path)
    assert read_summary(tmp_path)["command"] == "modes"
    assert {"modes.csv", "mode_shapes.csv", "modes.json"} <= files(tmp_path)


HOLDER = """
import sys, time
from pathlib import Path
from rotfem.results.result_set import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("locked", flush=True)
time.sleep(60)
"""


def test_another_process_is_refused_until_the_first_has_ended_or_was_killed(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "locked\n"
        with pytest.raises(OutputError, match=rf"{tmp_path}.*process {holder.pid} on .* is writing its results there"):
            run_result(1.0).write(tmp_path)
    finally:
        holder.kill()
        holder.wait()
    assert NAME in files(tmp_path)  # left behind, and no obstacle
    run_result(1.0).write(tmp_path)
    assert NAME not in files(tmp_path)


def test_a_lock_is_held_until_it_is_released(tmp_path: Path) -> None:
    lock = FolderLock(tmp_path)
    with pytest.raises(OutputError, match="is writing its results there"):
        FolderLock(tmp_path)
    lock.release()
    lock.release()
    assert files(tmp_path) == set()


def test_a_growing_table_is_whole_lines_and_ends_as_if_written_at_once(tmp_path: Path) -> None:
    table, path = Table(("t", "x")), tmp_path / "history.csv"
    live = LiveTable(path, table)
    assert path.read_text() == "t,x\n"
    for i in range(5):
        table.append((0.1 * i, 1e-17 * i))
        live.update()
    assert live.flush()
    assert path.read_text() == csv_text(table.arrays())
    table.append((1.0, np.nan))
    assert live.flush()
    assert path.read_text() == csv_text(table.arrays())


def test_a_growing_table_outlives_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table, path = Table(("t", "x")), tmp_path / "history.csv"
    live = LiveTable(path, table)
    table.append((0.0, 1.0))
    real = os.pwrite
    table.append((1.0, 2.0))
    monkeypatch.setattr(os, "pwrite", lambda descriptor, data, at: real(descriptor, data[:12], at))
    assert not live.flush()
    assert path.read_text() == "t,x\n0.0,1.0\n", "a torn line"
    monkeypatch.undo()
    table.append((2.0, 3.0))
    assert live.flush()
    assert path.read_text() == csv_text(table.arrays())


def test_a_line_that_was_cut_short_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    path.write_text("t,x\n0.0,1.0\n0.5,2.12")
    assert {name: list(values) for name, values in read_csv(path).items()} == {"t": [0.0], "x": [1.0]}


def test_a_summary_that_cannot_be_read_is_none(tmp_path: Path) -> None:
    for text in ("", "{", "[1]", json.dumps("x")):
        (tmp_path / "summary.json").write_text(text)
        assert read_summary(tmp_path) == {}
