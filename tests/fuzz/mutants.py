"""Strategies: scenes with some values changed for numbers of any size, other types, nothing at all, or each other's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import hypothesis.strategies as st

from tests.fuzz.seeds import SEEDS, Tables, copied

#: Where a number lies in nested tables and lists.
Path = tuple[str | int, ...]

EXTREMES = [0.0, 5e-324, 1e-308, 1e-200, 1e-100, 1e-30, 1e-12, 1.0, 1e12, 1e30, 1e99, 1e100, 1e154, 1e300, 1.8e308]
EXTREMES += [-number for number in EXTREMES] + [math.inf, -math.inf, math.nan]
INTEGERS = [0, 1, -1, 2, 7, 2**31, 2**63, -(2**63), 10**30, 10**400]
numbers = st.one_of(st.sampled_from(EXTREMES), st.sampled_from(INTEGERS), st.floats(), st.integers())
WORDS = ["", "0", "1e3", "auto", "reissner", "nan", "true", "../../etc/passwd", "/dev/zero", ".", "\0", "Ω"]
texts = st.one_of(st.sampled_from(WORDS), st.text(st.characters(codec="utf-8"), max_size=12))
plain = st.one_of(numbers, texts, st.booleans(), st.none())
keys = st.one_of(st.sampled_from(["type", "value", "table", "E", "kind"]), texts)
#: Any value that TOML or a script can put into a scene.
values = st.recursive(
    plain, lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(keys, inner, max_size=3)), max_leaves=8
)


def places(value: Any, here: Path = ()) -> Iterator[Path]:
    """Yield where everything lies in nested tables, the tables and lists themselves too."""
    if here:
        yield here
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in entries:
        yield from places(entry, (*here, key))


def at(tables: Any, place: Path) -> Any:
    """Return what lies there."""
    for key in place:
        tables = tables[key]
    return tables


def _scaled(draw: st.DrawFn, old: Any) -> Any:
    """Return a number of another size, as of a wrong unit or a slip in the exponent; else any number."""
    if isinstance(old, bool) or not isinstance(old, int | float) or abs(old) > 1e308:
        return draw(numbers)
    power = draw(st.one_of(st.integers(-4, 4), st.sampled_from([-60, -30, -16, -12, -9, -6, 6, 9, 12, 16, 30, 60])))
    factor = draw(st.sampled_from([1, 1, 1, 1, 1, 0.3, 2, -1, 0]))
    return old * factor * 10.0**power


def _other_value(draw: st.DrawFn, tables: Tables, place: Path) -> None:
    at(tables, place[:-1])[place[-1]] = draw(values)


def _other_number(draw: st.DrawFn, tables: Tables, place: Path) -> None:
    old = at(tables, place)
    at(tables, place[:-1])[place[-1]] = draw(numbers) if draw(st.integers(0, 9)) == 0 else _scaled(draw, old)


def _nothing(draw: st.DrawFn, tables: Tables, place: Path) -> None:
    del at(tables, place[:-1])[place[-1]]


def _another_entry(draw: st.DrawFn, tables: Tables, place: Path) -> None:
    into = at(tables, place)
    if isinstance(into, dict):
        into[draw(texts)] = draw(values)
    elif isinstance(into, list):
        into.insert(0, draw(values))


def _swapped(draw: st.DrawFn, tables: Tables, place: Path) -> None:
    other = draw(st.sampled_from(list(places(tables))))
    at(tables, place[:-1])[place[-1]] = copied(at(tables, other))


_ANY: list[Callable[[st.DrawFn, Tables, Path], None]]
_ANY = [_other_value, _other_number, _other_number, _nothing, _another_entry, _swapped]


@st.composite
def mutants(draw: st.DrawFn, seeds: str, most: int = 4) -> Tables:
    """Return a scene with one to four changes of any kind."""
    tables = copied(draw(st.sampled_from(SEEDS[seeds])))
    for _ in range(draw(st.integers(1, most))):
        found = list(places(tables))
        if not found:
            break
        draw(st.sampled_from(_ANY))(draw, tables, draw(st.sampled_from(found)))
    return tables


@st.composite
def misproportioned(draw: st.DrawFn, seeds: str, most: int = 3) -> Tables:
    """Return a scene with one to three numbers changed, but not those that say how much is to be computed."""
    tables = copied(draw(st.sampled_from(SEEDS[seeds])))
    found = [p for p in places(tables) if p[0] not in ("mesh", "time", "modes") and type(at(tables, p)) in (int, float)]
    for _ in range(draw(st.integers(1, most))):
        _other_number(draw, tables, draw(st.sampled_from(found)))
    return tables
