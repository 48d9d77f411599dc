"""Features that meet: every pair of choices, in scenes that are computed every day.

What is held of every scene is said in `tests.pairs.answers`; one that fails is printed as a file. Source: covering
arrays (Cohen, Dalal, Fredman & Patton, IEEE Trans. Softw. Eng. 23 (1997) 437).
"""

from __future__ import annotations

import pytest

from tests.pairs.covering import Row
from tests.pairs.trying import RANKED, Trial, on_few_ranks, parameters, rows_of

ROWS = on_few_ranks(list(rows_of(2, seed=1)))


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return Trial(ROWS, tmp_path_factory.mktemp("pairs"))


@pytest.mark.parametrize("row", parameters(ROWS))
def test_pairs(trial: Trial, row: Row) -> None:
    trial(row)


@pytest.mark.mpi
@RANKED
def test_two_processes(trial: Trial) -> None:
    trial.on_ranks()


def test_every_pair_was_computed(trial: Trial) -> None:
    trial.check_complete(2)
