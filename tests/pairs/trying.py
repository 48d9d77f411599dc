"""How rows of choices are tried, on one process and on two, and what is counted of them."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.launch import MPIRUN, environment
from tests.pairs.answers import answer, check_answer, check_same, columns_of
from tests.pairs.covering import Levels, Row, covering, missing, sets_of
from tests.pairs.refusals import REFUSALS, WHOLE
from tests.pairs.scenes import ACTIVE, ALSO, LEVELS, TOLERANCE, as_toml, forms_of, shuffled, tables_of

#: What no row has.
CONFLICTS: list[Levels] = [*(refusal.choices for refusal in REFUSALS), *WHOLE]
#: Seconds that a row of two processes may take, compilation included, before its processes are taken to hang.
PATIENCE = 180.0
#: Error of an answer on two processes: of sums in another order and Newton's last increment, of adaptive steps, which
#: may be others then, and of what is computed to an accuracy.
DIGITS = {"tolerance": TOLERANCE, "accuracy": 0.8}


def name_of(row: Row) -> str:
    """Return the levels of a row as the name of a test."""
    return "-".join(level.replace(" ", "_") for level in row.values())


def rows_of(strength: int, seed: int, also: Sequence[Levels] = ALSO) -> Iterator[Row]:
    """Return rows with every set of so many choices that can occur together, and those of some factors."""
    return (row for row, _ in covering(strength, shuffled, ACTIVE, CONFLICTS, seed, also, forms_of))


def on_few_ranks(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the same pairs, on one process those of which others have all pairs with two processes."""
    out = list(rows)
    pairs = [{pair for pair in sets_of(row, 2, ACTIVE, ()) if ("ranks", "2") in pair} for row in rows]
    for i, own in enumerate(pairs):
        if own <= {pair for other in pairs[:i] + pairs[i + 1 :] for pair in other}:
            out[i], pairs[i] = {**rows[i], "ranks": "1"}, set()
    return out


#: Mark of tests on two processes.
RANKED = pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")


def parameters(rows: Sequence[Row], before: str = "", marks: Sequence[Any] = ()) -> list[Any]:
    """Return rows as parameters of a test."""
    return [pytest.param(row, id=before + name_of(row), marks=marks) for row in rows]


class Trial:
    """What has been tried of some rows.

    Args:
        rows: all that are to be tried.
        folder: for files.
    """

    def __init__(self, rows: Sequence[Row], folder: Path):
        self.rows, self.folder = list(rows), folder
        self.done: list[Row] = []
        #: Rows of two processes, and their answers on one.
        self.alone: list[tuple[Row, dict[str, Any]]] = []

    def __call__(self, row: Row) -> None:
        """Try a row.

        Raises:
            AssertionError: with its scene, what is wrong.
        """
        try:
            result = answer(row, self.folder)
            check_answer(row, result, self.folder)
        except Exception as error:
            raise AssertionError(self._failure(row, error)) from error
        if row["ranks"] == "2":
            self.alone.append((row, answers(columns_of(result))))
        self.done.append(row)

    def on_ranks(self) -> None:
        """See that the rows of two processes have the same answers there; their forms are compiled by then.

        Raises:
            AssertionError: with the scenes, what is wrong.
        """
        folder = self.folder / "ranks"
        folder.mkdir(exist_ok=True)
        compute_on_ranks([row for row, _ in self.alone], folder)
        failures = []
        for number, (row, alone) in enumerate(self.alone):
            try:
                done = folder / f"{number}.npz"
                assert done.exists(), f"on two processes: {(folder / f'{number}.txt').read_text()}"
                with np.load(done) as file:
                    there = {name: file[name] for name in file.files}
                check_same(alone, answers(there), DIGITS.get(row["time"], 1e-5), "one process and two")
            except AssertionError as error:
                failures.append(self._failure(row, error))
        assert not failures, "\n\n".join(failures)

    def check_complete(self, strength: int) -> None:
        """See that every set of so many choices that can occur together was in a row that has been computed."""
        if len(self.done) < len(self.rows):
            pytest.skip(f"{len(self.done)} of {len(self.rows)} rows were computed")
        assert missing(self.done, strength, LEVELS, ACTIVE, CONFLICTS, ALSO) == []

    def _failure(self, row: Row, error: Exception) -> str:
        return f"{type(error).__name__}: {error}\n{as_toml(row, tables_of(row, self.folder))}"


def answers(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that do not depend on how a mesh is distributed, and are no estimates of an error."""

    def counts(name: str) -> bool:
        table, _, column = name.partition(".")
        is_answer = column.startswith(("frequency", "damping", "growth", "speed", "tip", "root"))
        return table == "history" or (table == "rows" and is_answer and not column.endswith("_phase"))

    return {name: values for name, values in columns.items() if counts(name)}


def compute_on_ranks(rows: Sequence[Row], folder: Path) -> None:
    """Compute rows on two processes; where these end or hang, what is left is computed by others."""
    listed = folder / "rows.json"
    listed.write_text(json.dumps(rows))
    command = [str(MPIRUN), "-n", "2", "--oversubscribe", sys.executable, "-m", "tests.pairs.on_ranks"]
    while left := [i for i in range(len(rows)) if not any((folder / f"{i}.{end}").exists() for end in ("npz", "txt"))]:
        processes = subprocess.Popen([*command, str(listed), str(folder)], env=environment())
        while processes.poll() is None:
            time.sleep(0.1)
            if time.time() - folder.stat().st_mtime > PATIENCE:  # of the last row that was begun or done
                processes.terminate()
                processes.wait(timeout=PATIENCE)
        (folder / f"{left[0]}.txt").touch()  # of processes that did not even start
