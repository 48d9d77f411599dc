"""Triples of choices: some of them every day, others each day, and all of them at night (`pytest -m nightly`)."""

from __future__ import annotations

import os
from datetime import date
from itertools import islice

import pytest

from tests.pairs.covering import Row
from tests.pairs.trying import RANKED, Trial, parameters, rows_of

#: Scenes that are tried each day, chosen by the day, or by ROTFEM_PAIRS_SEED; names of tests have the number.
SAMPLE, SEED = 24, int(os.environ.get("ROTFEM_PAIRS_SEED", date.today().toordinal()))
ROWS: list[Row] = []


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "row" not in metafunc.fixturenames:
        return
    every = "nightly" in str(metafunc.config.option.markexpr)
    ROWS[:] = rows_of(3, SEED) if every else islice(rows_of(3, SEED, also=()), SAMPLE)
    metafunc.parametrize("row", parameters(ROWS, f"seed{SEED}-", [pytest.mark.nightly] if every else []))


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return Trial(ROWS, tmp_path_factory.mktemp("triples"))


def test_triples(trial: Trial, row: Row) -> None:
    trial(row)


@pytest.mark.mpi
@RANKED
@pytest.mark.parametrize("when", ["day", pytest.param("night", marks=pytest.mark.nightly)])
def test_two_processes(trial: Trial, when: str) -> None:
    """By day and, selected by its mark, by night; the rows are those that were computed before on one process."""
    trial.on_ranks()


@pytest.mark.nightly
def test_every_triple_was_computed(trial: Trial) -> None:
    trial.check_complete(3)
