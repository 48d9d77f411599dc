"""Triples of choices, all of them at night: `pytest -m nightly tests/pairs`."""

from __future__ import annotations

import os
from datetime import date

import pytest

from tests.pairs.covering import Row
from tests.pairs.trying import RANKED, Trial, parameters, rows_of

pytestmark = pytest.mark.nightly

#: Others every night: chosen by the day, or by ROTFEM_PAIRS_SEED; names of tests have the number.
SEED = int(os.environ.get("ROTFEM_PAIRS_SEED", date.today().toordinal()))
ROWS: list[Row] = []


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "row" not in metafunc.fixturenames:
        return
    if not ROWS and "nightly" in str(metafunc.config.option.markexpr):
        ROWS.extend(rows_of(3, SEED))
    metafunc.parametrize("row", parameters(ROWS, f"seed{SEED}-"))


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return Trial(ROWS, tmp_path_factory.mktemp("triples"))


def test_triples(trial: Trial, row: Row) -> None:
    trial(row)


@pytest.mark.mpi
@RANKED
def test_two_processes(trial: Trial) -> None:
    """The rows are those that were computed before on one process."""
    trial.on_ranks()


def test_every_triple_was_computed(trial: Trial) -> None:
    trial.check_complete(3)
