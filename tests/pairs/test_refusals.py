"""What is refused is documented, and refused in the words of the list."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path

import pytest

from rotfem.errors import ComputationError, InputError
from tests.launch import ROOT
from tests.pairs.answers import answer
from tests.pairs.covering import Levels, Row, completed
from tests.pairs.refusals import REFUSALS, WHOLE, Refusal
from tests.pairs.scenes import LEVELS, PLAIN, as_toml, tables_of


def rows_with(choices: Levels) -> list[Row]:
    """Return the plainest rows with these choices that nothing else is said against."""
    levels = {factor: sorted(LEVELS[factor], key=lambda level: level != PLAIN[factor]) for factor in PLAIN}
    others = [listed.choices for listed in REFUSALS if listed.choices != choices] + [*WHOLE]
    meetings = (dict(zip(choices, chosen, strict=True)) for chosen in product(*choices.values()))
    rows = (completed(meeting, levels, others) for meeting in meetings)
    return [row for row in rows if row is not None]


@pytest.mark.parametrize("refusal", REFUSALS, ids=lambda refusal: " × ".join(refusal.choices))
def test_documented_refusals(refusal: Refusal, tmp_path: Path) -> None:
    page = " ".join((ROOT / refusal.page).read_text().split())
    assert refusal.text
    assert " ".join(refusal.text.split()) in page
    rows = rows_with(refusal.choices)
    assert rows
    for row in rows:
        with pytest.raises((InputError, ComputationError)) as caught:
            answer(row, tmp_path)
        assert re.search(refusal.says, str(caught.value)), as_toml(row, tables_of(row, tmp_path))
