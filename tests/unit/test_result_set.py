"""A result folder is rotfem's own, holds whole files, and says whether they are all there."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from rotfem.errors import OutputError
from rotfem.listeners import ONE_PROCESS
from rotfem.results.files import Table, csv_text, json_text, read_csv, write_text
from rotfem.results.modes import ModesResult
from rotfem.results.result_set import RESULTS, ResultFolder, read_summary, said_of
from rotfem.results.run import RunResult


def run_result(value: float, shape: bool = True) -> RunResult:
    history = {"t": np.array([0.0, 0.5]), "tip_u1": np.array([0.0, value])}
    summary = {"command": "run", "status": "done", "value": value, "warnings": []}
    return RunResult(summary, history, {"x": np.array([0.0, value])} if shape else {})


def modes_result() -> ModesResult:
    summary = {"command": "modes", "status": "done", "speed": 1.0, "warnings": []}
    return ModesResult(summary, [{"mode": 1, "frequency": 2.0}], {"mode 1": {"x": np.zeros(2)}})


def open_folder(path: Path, *inputs: Path) -> ResultFolder:
    return ResultFolder(ONE_PROCESS, path, "run", inputs)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_results_take_the_place_of_those_before_and_of_nothing_else(tmp_path: Path) -> None:
    run_result(1.0).write(tmp_path)
    assert set(contents(tmp_path)) == {"history.csv", "shape.csv", "summary.json"}
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / ".rotfem-history.csv-x.part").write_text("left by a killed one")
    modes_result().write(tmp_path)
    assert set(contents(tmp_path)) == {"notes.txt", "modes.csv", "mode_shapes.csv", "modes.json", "summary.json"}
    run_result(2.0, shape=False).write(tmp_path)
    assert set(contents(tmp_path)) == {"notes.txt", "history.csv", "summary.json"}
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["notes.txt", "modes.csv", "summary.json", ".hidden"])
def test_a_folder_of_somebody_else_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text('{"status": "done"}')
    before = contents(tmp_path)
    with pytest.raises(OutputError, match=rf"cannot be written: it holds {name}, and no results of rotfem"):
        run_result(1.0).write(tmp_path)
    assert contents(tmp_path) == before


def test_a_folder_is_made_where_that_is_possible(tmp_path: Path) -> None:
    run_result(1.0).write(tmp_path / "a" / "b")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file/below.*cannot be written.*-o DIR"):
        run_result(1.0).write(tmp_path / "file" / "below")


def test_what_a_study_goes_on_with_is_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / "points").mkdir()
    (tmp_path / "speeds.npz").write_bytes(b"")
    run_result(1.0).write(tmp_path)
    assert {"points", "speeds.npz"} < set(os.listdir(tmp_path))


def test_no_link_is_followed(tmp_path: Path) -> None:
    """In a folder that somebody else has filled, whose summary says that it is rotfem's."""
    target, folder = tmp_path / "precious.csv", tmp_path / "results"
    target.write_text("mine")
    for name in ("history.csv", "points", "checkpoint.npz", "elsewhere"):
        run_result(1.0).write(folder)
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(target)
        with pytest.raises(OutputError, match=rf"{name}: cannot be written: it is a symbolic link"):
            run_result(2.0).write(folder)
        (folder / name).unlink()
    (tmp_path / "link").symlink_to(folder)  # which the user has named
    run_result(2.0).write(tmp_path / "link")
    assert target.read_text() == "mine"


@pytest.mark.parametrize("name", ["history.csv", "summary.json", "gusts.csv", "fields.bp/data.0"])
def test_inputs_are_never_outputs(tmp_path: Path, name: str) -> None:
    """Also in a folder of rotfem's, where a table may be that an earlier run has written; and through a link."""
    run_result(1.0).write(tmp_path / "results")
    (tmp_path / "link").symlink_to(tmp_path / "results")
    for folder, path in (("results", tmp_path / "link" / name), ("link", tmp_path / "results" / name)):
        with pytest.raises(OutputError, match=rf"it holds .*{name}, which is read"):
            open_folder(tmp_path / folder, path)
    with open_folder(tmp_path / "results", tmp_path / "history.csv"):
        assert (tmp_path / "results" / "history.csv").exists()


def test_what_ends_unexpectedly_keeps_its_rows_and_has_failed(tmp_path: Path) -> None:
    table = Table(("t",))
    for error, status in ((KeyboardInterrupt(), "interrupted"), (ZeroDivisionError("by zero"), "failed")):
        folder = open_folder(tmp_path)
        folder.begin()
        folder.grow("history.csv", table)
        table.append((0.5,))
        assert said_of(tmp_path).startswith(f"{tmp_path}: run is running, or was killed")
        folder.close(error)
        assert read_summary(tmp_path)["status"] == status
        assert list(read_csv(tmp_path / "history.csv")["t"]) == [0.5] * len(table.rows)
    said = f"{tmp_path}: run failed: ZeroDivisionError: by zero; history.csv has 2 rows, up to t = 0.5 s"
    assert said_of(tmp_path) == said
    with pytest.raises(OutputError, match="no results"):
        said_of(tmp_path / "elsewhere")


def test_the_summary_says_running_until_all_is_there(tmp_path: Path) -> None:
    seen = []

    def large(folder: Path) -> None:
        seen.append((read_summary(folder)["status"], sorted(os.listdir(folder))))
        raise OutputError(folder / "fields.h5", "no room")

    with open_folder(tmp_path) as folder:
        problems = run_result(1.0).write_into(folder, further=[large])
    assert seen == [("running", ["history.csv", "shape.csv", "summary.json"])]
    assert [type(problem) for problem in problems] == [OutputError]
    summary = read_summary(tmp_path)
    assert summary["status"] == "done"
    assert "not written: output" in summary["warnings"][0]


def test_a_file_is_whole_or_that_of_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    run_result(1.0).write(tmp_path)
    before = contents(tmp_path)
    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match="No space left on device"):
        run_result(2.0).write(tmp_path)
    assert contents(tmp_path) == before


def test_names_of_all_files_are_known() -> None:
    """So that the next computation removes them."""
    for result in (run_result(1.0), modes_result()):
        assert all(RESULTS.fullmatch(name) for name in result.texts())
    for name in ("fields.bp", "modes.xdmf", "mode_12.gif", "M.npz", "cost.csv", "campbell.png", "checkpoint.npz"):
        assert RESULTS.fullmatch(name), name
    for name in ("notes.txt", "my_history.csv", "history.csv.bak", "speeds.npz", "scene.toml", "mode_x.gif"):
        assert not RESULTS.fullmatch(name), name


def test_a_growing_table_is_whole_lines_with_every_digit(tmp_path: Path) -> None:
    table, path = Table(("t", "x")), tmp_path / "history.csv"
    table.keep(path)
    assert path.read_text() == "t,x\n"
    for i in range(5):
        table.append((0.1 * i, 1e-17 / (i + 1)))
        table.flush(1e3)
    table.append((1.0, np.nan))
    table.flush()
    assert path.read_text() == csv_text(table.arrays())
    np.testing.assert_array_equal(read_csv(path)["x"], table.arrays()["x"])


def test_a_line_that_was_cut_short_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    path.write_text("t,x\n0.0,1.0\n0.5,2.12")
    assert {name: list(values) for name, values in read_csv(path).items()} == {"t": [0.0], "x": [1.0]}


def test_a_summary_that_cannot_be_read_is_none(tmp_path: Path) -> None:
    for text in ("", "{", "[1]", json.dumps("x")):
        (tmp_path / "summary.json").write_text(text)
        assert read_summary(tmp_path) == {}


def test_json_holds_only_what_json_knows() -> None:
    data = {"a": np.float64(0.1), "b": np.arange(2), "c": float("nan"), "d": (1, np.inf), "e": np.bool_(True), 1: None}
    text = json_text(data)
    assert json.loads(text) == {"a": 0.1, "b": [0, 1], "c": None, "d": [1, None], "e": True, "1": None}


def test_files_get_the_usual_permissions(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        path = write_text(tmp_path / "summary.json", "{}")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640
