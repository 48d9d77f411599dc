"""Features that meet: every pair of choices in scenes that are computed every day, every triple at night.

What is held of every scene is said in `tests.pairs.answers`; one that fails is printed. Source: covering
arrays (Cohen, Dalal, Fredman & Patton, IEEE Trans. Softw. Eng. 23 (1997) 437).
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotfem.errors import ComputationError, InputError
from tests.launch import MPIRUN, environment
from tests.pairs.answers import answer, check_answer, check_same, columns_of
from tests.pairs.covering import Row, completed, covering
from tests.pairs.refusals import FREE, REFUSALS, UNTRIED, Refusal
from tests.pairs.scenes import ACTIVE, LEVELS, PLAIN, TOLERANCE, tables_of

CONFLICTS = [*(refusal.choices for refusal in REFUSALS), *UNTRIED]
#: Error of an answer on two processes, of adaptive steps, which may be others then, and of one to an accuracy.
DIGITS = {"tolerance": TOLERANCE, "accuracy": 0.8}
#: Rows of two processes, and their answers on one.
ALONE: list[tuple[Row, dict[str, Any]]] = []


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "row" in metafunc.fixturenames:
        nightly = "nightly" in str(metafunc.config.option.markexpr)
        rows = covering(3 if nightly else 2, LEVELS, ACTIVE, CONFLICTS, ("structure", "theory"), seed=1)
        marks = [pytest.mark.nightly] if nightly else []
        metafunc.parametrize("row", [pytest.param(row, id="-".join(row.values()), marks=marks) for row in rows])


def test_pairs(row: Row, tmp_path: Path) -> None:
    try:
        result = answer(row, tmp_path)
        check_answer(row, result, tmp_path)
    except Exception as error:
        raise AssertionError(f"{error}\n{row}\n{tables_of(row)}") from error
    if row["ranks"] == "2":
        ALONE.append((row, answers(columns_of(result))))


@pytest.mark.mpi
@pytest.mark.skipif(MPIRUN is None, reason="there is no mpirun")
def test_two_processes(tmp_path: Path) -> None:
    """The rows of two processes that were computed on one have the same answers there."""
    (tmp_path / "rows.json").write_text(json.dumps([row for row, _ in ALONE]))
    command = [str(MPIRUN), "-n", "2", "--oversubscribe", sys.executable, "-m", "tests.pairs.on_ranks", str(tmp_path)]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    for number, (row, alone) in enumerate(ALONE):
        if row["command"] == "modes" and row["root"] == "hinge" and row["motion"] in FREE:
            continue  # three eigenvalues are zero, and round-off says which of them are the nearest ones
        with np.load(tmp_path / f"{number}.npz") as file:
            there = answers(dict(file))
        check_same(alone, there, DIGITS.get(row["time"], 1e-5), str(row))


def answers(columns: dict[str, Any]) -> dict[str, Any]:
    """Return the columns that do not depend on how a mesh is distributed."""

    def counts(name: str) -> bool:
        table, _, column = name.partition(".")
        is_answer = column.startswith(("frequency", "damping", "growth", "speed", "tip", "root"))
        return table == "history" or (table == "rows" and is_answer and not column.endswith("_phase"))

    return {name: values for name, values in columns.items() if counts(name)}


def rows_with(refusal: Refusal) -> list[Row]:
    """Return the plainest rows with these choices that nothing else is said against."""
    levels = {factor: sorted(LEVELS[factor], key=lambda level: level != PLAIN[factor]) for factor in PLAIN}
    others = [other.choices for other in REFUSALS if other is not refusal]
    meetings = (dict(zip(refusal.choices, chosen, strict=True)) for chosen in product(*refusal.choices.values()))
    return [row for meeting in meetings if (row := completed(meeting, levels, others)) is not None]


@pytest.mark.parametrize("refusal", REFUSALS, ids=lambda refusal: " × ".join(refusal.choices))
def test_refusals(refusal: Refusal, tmp_path: Path) -> None:
    rows = rows_with(refusal)
    assert rows
    for row in rows[:: max(1, len(rows) // 3)]:  # others differ by a level that the refusal does not ask for
        with pytest.raises((InputError, ComputationError)) as caught:
            answer(row, tmp_path)
        assert re.search(refusal.says, str(caught.value)), row
