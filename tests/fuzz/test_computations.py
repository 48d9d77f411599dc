"""What is computed of a scene out of all proportion is finite, or the computation fails and says so."""

from __future__ import annotations

from typing import Any

import hypothesis.strategies as st
from hypothesis import given, settings

import rotfem
from tests.fuzz.mutants import misproportioned, mutants
from tests.fuzz.trying import outcome

VERBS = {
    "run": rotfem.run,
    "modes": rotfem.modes,
    "campbell": lambda tables: rotfem.campbell(tables, [0.0, 3.0, 6.0]),
}


@settings(max_examples=8)
@given(st.sampled_from(list(VERBS)), misproportioned("small"))
def test_numbers_of_any_size(verb: str, tables: Any) -> None:
    outcome(lambda: VERBS[verb](tables))


@settings(max_examples=5)
@given(st.sampled_from(list(VERBS)), mutants("small", most=2))
def test_changes_of_any_kind(verb: str, tables: Any) -> None:
    for table, key, most in (("mesh", "elements", 8), ("time", "end", 1.0)):  # allowed, but not tried here
        number = tables[table].get(key) if isinstance(tables.get(table), dict) else None
        if isinstance(number, int | float) and number > most:
            tables[table][key] = most
    step = tables["time"].get("step") if isinstance(tables.get("time"), dict) else None
    if isinstance(step, int | float) and 0.0 < step < 0.01:
        tables["time"]["step"] = 0.01
    outcome(lambda: VERBS[verb](tables))
