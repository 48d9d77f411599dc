"""How rows of choices are tried, on one process and on two, and what is counted of them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.launch import MPIRUN, environment
from tests.pairs.answers import answer, check_answer, check_same, columns_of
from tests.pairs.covering import Levels, Row, covering, missing
from tests.pairs.refusals import REFUSALS, WHOLE
from tests.pairs.scenes import ACTIVE, ALSO, LEVELS, as_toml, shuffled, tables_of

#: What no row has.
CONFLICTS: list[Levels] = [*(refusal.choices for refusal in REFUSALS), *WHOLE]
#: Seconds that rows of two processes may take each, compilation included, before one of them is taken to hang.
PATIENCE = 180.0
#: Error of an answer on two processes: of sums in another order and Newton's last increment, of adaptive steps, which
#: may be others then, and of what is computed to an accuracy.
DIGITS = {"tolerance": 1e-3, "accuracy": 0.8}


def name_of(row: Row) -> str:
    """Return the levels of a row as the name of a test."""
    return "-".join(level.replace(" ", "_") for level in row.values())


def rows_of(strength: int, seed: int) -> Iterator[Row]:
    """Return rows with every set of so many choices that can occur together."""
    return (row for row, _ in covering(strength, shuffled, ACTIVE, CONFLICTS, seed, ALSO))


def parameters(rows: Sequence[Row], before: str = "", marks: Sequence[Any] = ()) -> list[Any]:
    """Return rows as parameters of a test, those of two processes where there is mpirun."""
    ranked = [pytest.mark.mpi, pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")]
    return [
        pytest.param(row, id=before + name_of(row), marks=[*marks, *(ranked if row["ranks"] == "2" else [])])
        for row in rows
    ]


class Trial:
    """What has been tried of some rows.

    Args:
        rows: all that are to be tried.
        folder: for files.
    """

    def __init__(self, rows: Sequence[Row], folder: Path):
        self.rows, self.folder = list(rows), folder
        self.done: list[Row] = []
        self._ranked: Path | None = None

    def __call__(self, row: Row) -> None:
        """Try a row.

        Raises:
            AssertionError: with its scene, what is wrong.
        """
        try:
            result = answer(row, self.folder)
            check_answer(row, result, self.folder)
            if row["ranks"] == "2":
                self._check_ranks(row, result)
        except Exception as error:
            scene = as_toml(row, tables_of(row, self.folder))
            raise AssertionError(f"{type(error).__name__}: {error}\n{scene}") from error
        self.done.append(row)

    def check_complete(self, strength: int) -> None:
        """See that every set of so many choices that can occur together was in a row that has been computed."""
        if len(self.done) < len(self.rows):
            pytest.skip(f"{len(self.done)} of {len(self.rows)} rows were computed")
        assert missing(self.done, strength, LEVELS, ACTIVE, CONFLICTS, ALSO) == []

    def _check_ranks(self, row: Row, result: Any) -> None:
        if self._ranked is None:
            self._ranked = self.folder / "ranks"
            self._ranked.mkdir()
            compute_on_ranks([other for other in self.rows if other["ranks"] == "2"], self._ranked)
        number = [other for other in self.rows if other["ranks"] == "2"].index(row)
        done = self._ranked / f"{number}.npz"
        assert done.exists(), f"on two processes: {(self._ranked / f'{number}.txt').read_text()}"
        with np.load(done) as file:
            there = {name: file[name] for name in file.files}
        digits = DIGITS.get(row["time"], 1e-5)
        check_same(answers(columns_of(result)), answers(there), digits, "one process and two")


def answers(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that do not depend on how a mesh is distributed, and are no estimates of an error."""

    def counts(name: str) -> bool:
        table, _, column = name.partition(".")
        is_answer = column.startswith(("frequency", "damping", "growth", "speed", "tip", "root"))
        return table == "history" or (table == "rows" and is_answer and not column.endswith(("_phase", "_modal")))

    return {name: values for name, values in columns.items() if counts(name)}


def compute_on_ranks(rows: Sequence[Row], folder: Path) -> None:
    """Compute rows on two processes; where these end or hang, what is left is computed by others."""
    listed = folder / "rows.json"
    listed.write_text(json.dumps(rows))
    command = [str(MPIRUN), "-n", "2", "--oversubscribe", sys.executable, "-m", "tests.pairs.on_ranks"]
    while left := [i for i in range(len(rows)) if not any((folder / f"{i}.{end}").exists() for end in ("npz", "txt"))]:
        with suppress(subprocess.TimeoutExpired):
            patience = PATIENCE * (len(left) + 1)
            subprocess.run([*command, str(listed), str(folder)], env=environment(), check=False, timeout=patience)
        (folder / f"{left[0]}.txt").touch()  # of processes that did not even start
