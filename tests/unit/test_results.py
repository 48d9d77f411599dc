"""Results: what is written is read back, whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest

from rotfem.errors import OutputError
from rotfem.results.files import csv_text, json_text, read_csv, write_text
from rotfem.results.run import RunResult, Table
from rotfem.version import __version__


def test_table_grows_by_rows() -> None:
    table = Table(("a", "b"))
    assert {name: column.shape for name, column in table.arrays().items()} == {"a": (0,), "b": (0,)}
    table.append((1, 2.5))
    table.append(iter((3.0, 4.0)))
    assert len(table) == 2
    np.testing.assert_array_equal(table.arrays()["b"], [2.5, 4.0])


def test_csv_keeps_every_digit(tmp_path: Path) -> None:
    columns = {"t": np.array([0.1, 1 / 3, 1e-300]), "u": np.array([np.pi, -np.inf, np.nan])}
    path = write_text(tmp_path / "history.csv", csv_text(columns))
    again = read_csv(path)
    assert list(again) == ["t", "u"]
    for name in columns:
        np.testing.assert_array_equal(again[name], columns[name])


def test_json_holds_only_what_json_knows() -> None:
    data = {"a": np.float64(0.1), "b": np.arange(2), "c": float("nan"), "d": (1, np.inf), "e": np.bool_(True), 1: None}
    text = json_text(data)
    assert json.loads(text) == {"a": 0.1, "b": [0, 1], "c": None, "d": [1, None], "e": True, "1": None}
    assert text.endswith("\n")


def test_write_and_read_a_result(tmp_path: Path) -> None:
    history = {"t": np.array([0.0, 0.5]), "tip_u1": np.array([0.0, 1e-17])}
    result = RunResult({"status": "done", "x": 1.5}, history, {})
    written = result.write(tmp_path)
    assert sorted(p.name for p in written) == ["history.csv", "summary.json"]  # no shape, so no file of it
    assert sorted(os.listdir(tmp_path)) == ["history.csv", "summary.json"]
    np.testing.assert_array_equal(read_csv(tmp_path / "history.csv")["tip_u1"], history["tip_u1"])
    assert json.loads((tmp_path / "summary.json").read_text()) == {
        "versions": {"rotfem": __version__},
        "status": "done",
        "x": 1.5,
    }


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_text(tmp_path / "summary.json", "old")

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OutputError, match="summary.json.*No space left on device"):
        write_text(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["summary.json"]


def test_files_get_the_usual_permissions(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        path = write_text(tmp_path / "summary.json", "{}")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o640
