"""What is computed of a scene out of all proportion is finite, or the computation fails and says so."""

from __future__ import annotations

from typing import Any

import hypothesis.strategies as st

import rotfem
from tests.fuzz.mutants import misproportioned, mutants
from tests.fuzz.trying import outcome, sized

VERBS = {
    "run": rotfem.run,
    "modes": rotfem.modes,
    "campbell": lambda tables: rotfem.campbell(tables, [0.0, 3.0, 6.0]),
}


@sized(st.tuples(st.sampled_from(list(VERBS)), misproportioned("small")), core=25, nightly=1000)
def test_numbers_of_any_size(given: tuple[str, Any]) -> None:
    verb, tables = given
    outcome(lambda: VERBS[verb](tables))


@sized(st.tuples(st.sampled_from(list(VERBS)), mutants("small", most=2)), core=15, nightly=400)
def test_changes_of_any_kind(given: tuple[str, Any]) -> None:
    verb, tables = given
    for table, key, most in (("mesh", "elements", 8), ("time", "end", 1.0)):  # allowed, but not tried here
        given_table = tables.get(table)
        number = given_table.get(key) if isinstance(given_table, dict) else None
        if isinstance(number, int | float) and number > most:
            given_table[key] = most
    step = tables["time"].get("step") if isinstance(tables.get("time"), dict) else None
    if isinstance(step, int | float) and 0.0 < step < 0.01:
        tables["time"]["step"] = 0.01
    outcome(lambda: VERBS[verb](tables))
