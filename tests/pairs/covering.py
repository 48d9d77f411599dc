"""Covering arrays: rows of choices in which every pair, or every triple, of choices occurs that can occur together."""

from __future__ import annotations

import math
import random
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import combinations, product

#: Factor ↦ the level chosen.
Row = dict[str, str]
#: Factor ↦ some of its levels; of a conflict those that no row may have all at once.
Levels = Mapping[str, Collection[str]]
#: Factor ↦ level ↦ how often it is chosen where either would do.
Weights = Mapping[str, Mapping[str, float]]


def completed(chosen: Row, levels: Levels, conflicts: Sequence[Levels]) -> Row | None:
    """Return a row without a conflict that has what is chosen, levels in front preferred; None where there is none."""
    if any(all(chosen.get(factor) in barred for factor, barred in conflict.items()) for conflict in conflicts):
        return None
    open_factor = next((factor for factor in levels if factor not in chosen), None)
    if open_factor is None:
        return {factor: chosen[factor] for factor in levels}
    tries = (completed({**chosen, open_factor: level}, levels, conflicts) for level in levels[open_factor])
    return next((row for row in tries if row is not None), None)


def covering(
    strength: int, weights: Weights, active: Levels, conflicts: Sequence[Levels], dear: Sequence[str], seed: int
) -> Iterator[Row]:
    """Yield rows until every set of so many choices that can occur has: greedily, the best of some random rows.

    Args:
        strength: choices in a set: 2 of pairs, 3 of triples.
        weights: all levels.
        active: command ↦ factors that it makes use of; a set of choices counts only where all of its have a use.
        conflicts: what no row may have.
        dear: factors whose levels of little weight make a row so dear that it must cover more.
        seed: of the random numbers.
    """
    rng = random.Random(seed)

    def quickness(row: Row) -> float:
        return math.prod(weights[factor][row[factor]] for factor in dear) ** 0.3

    def shuffled() -> Levels:
        return {f: sorted(levels, key=lambda level: rng.expovariate(levels[level])) for f, levels in weights.items()}

    pools = combinations(weights.items(), strength)
    every = [frozenset(s) for pool in pools for s in product(*([(f, level) for level in levels] for f, levels in pool))]
    rng.shuffle(every)
    left = set(every)
    for wanted in every:
        if wanted not in left:
            continue
        factors = {factor for factor, _ in wanted}
        idle = {"command": [command for command, used in active.items() if not factors <= {*used}]}
        rows = (completed(dict(wanted), shuffled(), [*conflicts, idle]) for _ in range(200 // strength))
        found = [(row, left & sets_of(row, strength, active)) for row in rows if row is not None]
        row, new = max(found, key=lambda pair: len(pair[1]) * quickness(pair[0]), default=(None, {wanted}))
        left -= new
        if row is not None:
            yield row


def sets_of(row: Row, strength: int, active: Levels) -> set[frozenset[tuple[str, str]]]:
    """Return the sets of so many choices that a row has and makes use of."""
    used = [(factor, level) for factor, level in row.items() if factor in active[row["command"]]]
    return {frozenset(s) for s in combinations(used, strength)}
