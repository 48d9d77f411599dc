"""Covering arrays: rows of choices in which every pair, or every triple, of choices occurs that can occur together."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from itertools import combinations, product

#: Factor ↦ the level chosen.
Row = dict[str, str]
#: Factor ↦ some of its levels; of a conflict those that no row may have all at once.
Levels = Mapping[str, Collection[str]]
#: Factors with the levels chosen.
Chosen = frozenset[tuple[str, str]]


def met(conflict: Levels, row: Row) -> bool:
    """Return whether a row, or what is chosen of it so far, has all of a conflict."""
    return all(row.get(factor) in levels for factor, levels in conflict.items())


def completed(chosen: Row, levels: Levels, conflicts: Sequence[Levels]) -> Row | None:
    """Return a row without a conflict that has what is chosen, levels in front preferred; None where there is none."""
    if any(met(conflict, chosen) for conflict in conflicts):
        return None
    open_factor = next((factor for factor in levels if factor not in chosen), None)
    if open_factor is None:
        return {factor: chosen[factor] for factor in levels}
    tries = (completed({**chosen, open_factor: level}, levels, conflicts) for level in levels[open_factor])
    return next((row for row in tries if row is not None), None)


def covering(
    strength: int,
    shuffled: Callable[[random.Random], Levels],
    active: Levels,
    conflicts: Sequence[Levels],
    seed: int,
    also: Sequence[Levels] = (),
    made_of: Callable[[Row], tuple[Hashable, float]] = lambda row: (None, 0.0),
) -> Iterator[tuple[Row, int]]:
    """Yield rows until every set of so many choices that can occur has, with how many new ones each row has.

    Greedily: of several random rows with one of the sets that are left, the one with most of them for its price. Source
    of arrays with larger sets of some factors: Cohen, Gibbons, Mugridge & Colbourn, ICSE 2003, p. 38 (variable
    strength).

    Args:
        strength: choices in a set: 2 of pairs, 3 of triples.
        shuffled: random numbers ↦ all levels in a random order, those to be preferred in front.
        active: command ↦ factors that it makes use of; a set of choices counts only where all of its have a use.
        conflicts: what no row may have.
        seed: of the random numbers.
        also: factors and levels of which every row of choices is wanted as well.
        made_of: row ↦ what has to be made for it, once, and its price, that of any row being 1.
    """
    made = set[Hashable]()

    def worth(found: tuple[Row, set[Chosen]]) -> float:
        needed, price = made_of(found[0])
        return len(found[1]) / (1.0 if needed in made else 1.0 + price)

    rng = random.Random(seed)
    sets = sets_wanted(strength, shuffled(rng), also)
    rng.shuffle(sets)
    sets.sort(key=len, reverse=True)
    left = set(sets)
    for wanted in sets:
        if wanted not in left:
            continue
        barred = [*conflicts, idle(wanted, active)]
        rows = (completed(dict(wanted), shuffled(rng), barred) for _ in range(40))
        found = [(row, left.intersection(sets_of(row, strength, active, also))) for row in rows if row is not None]
        row, new = max(found, key=worth, default=(None, {wanted}))
        left -= new
        if row is not None:
            made.add(made_of(row)[0])
            yield row, len(new)


def sets_wanted(strength: int, every: Levels, also: Sequence[Levels]) -> list[Chosen]:
    """Return the sets of so many choices, and those of some factors, whether they can occur or not."""
    pools = [*combinations(every.items(), strength), *(box.items() for box in also)]
    each = (product(*([(factor, level) for level in levels] for factor, levels in pool)) for pool in pools)
    return [frozenset(chosen) for sets in each for chosen in sets]


def sets_of(row: Row, strength: int, active: Levels, also: Sequence[Levels]) -> Iterator[Chosen]:
    """Return the sets of so many choices that a row has and makes use of, and those of some factors."""
    used = [(factor, level) for factor, level in row.items() if factor in active[row["command"]]]
    yield from map(frozenset, combinations(used, strength))
    yield from (frozenset((factor, row[factor]) for factor in box) for box in also)


def idle(chosen: Chosen, active: Levels) -> Levels:
    """Return as a conflict the commands that make no use of all of these choices."""
    return {"command": [c for c, used in active.items() if not {factor for factor, _ in chosen} <= {*used}]}


def missing(
    rows: Sequence[Row],
    strength: int,
    every: Levels,
    active: Levels,
    conflicts: Sequence[Levels],
    also: Sequence[Levels] = (),
) -> list[str]:
    """Return the sets of choices that are wanted, could occur together, and are in none of the rows."""
    there = {chosen for row in rows for chosen in sets_of(row, strength, active, also)}
    absent = [chosen for chosen in sets_wanted(strength, every, also) if chosen not in there]
    possible = [x for x in absent if completed(dict(x), every, [*conflicts, idle(x, active)]) is not None]
    return [", ".join(f"{factor} = {level}" for factor, level in sorted(chosen)) for chosen in possible]
