"""Tables of loads over the span, and over span and time: rows, the path of a CSV file, or, in Python, a function."""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

from pydantic import ValidationInfo

from rotfem.scene.files import as_table
from rotfem.scene.values import Matrix, as_rows, problem

#: A table, or a function in its place.
Over = Matrix | Callable[..., Any]


def arguments(function: Callable[..., Any]) -> int:
    """Return how many arguments a function must be given; 1 where that cannot be told."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    return sum(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty for p in parameters)


def span_rows(
    value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format
) -> Matrix:
    """Return rows (x, …) with x (m) not decreasing, at least two; one x may stand in two of them: a jump."""
    rows = as_rows(value, columns, shape, row_name)
    x = [row[0] for row in rows]
    if len(rows) < 2 or x[0] == x[-1]:
        raise problem("", value, f"must be {shape} with at least two rows at different x")
    for i, (before, after) in enumerate(pairwise(x), start=2):
        if after < before:
            raise problem("", value, f"the first column must not decrease; {row_name(i)}: {after:g} < {before:g}")
    most = max(Counter(x).items(), key=lambda item: item[1])
    if most[1] > 2:
        raise problem("", value, f"x = {most[0]:g} stands in {most[1]} rows; must be in one, or in two, where it jumps")
    return rows


def grid_rows(
    value: Any, columns: Sequence[int], shape: str, row_name: Callable[[int], str] = "row {}".format
) -> Matrix:
    """Return rows (x, t, …), sorted, in which every x (m), at least two, stands with every t (s), at least two."""
    rows = as_rows(value, columns, shape, row_name)
    found: dict[tuple[float, float], int] = {}
    for i, (x, t, *_) in enumerate(rows, start=1):
        if (x, t) in found:
            raise problem("", value, f"{row_name(i)} gives x = {x:g}, t = {t:g} again, after {row_name(found[x, t])}")
        found[x, t] = i
    stations, times = (sorted({pair[k] for pair in found}) for k in (0, 1))
    if len(stations) < 2 or len(times) < 2:
        raise problem("", value, f"must be {shape} with at least two x and two t")
    missing = next(((x, t) for x in stations for t in times if (x, t) not in found), None)
    if missing is not None:
        raise problem("", value, f"has no row for x = {missing[0]:g}, t = {missing[1]:g}; must have every t at every x")
    return tuple(sorted(rows))


def as_over_time(rows: Callable[[Any, ValidationInfo], Matrix]) -> Callable[[Any, ValidationInfo], Over]:
    """Return what reads rows over time, or a function f(t) in their place."""
    return lambda value, info: _function(value, 1, "f(t)") if callable(value) else rows(value, info)


def as_over_span(sizes: Sequence[int], to: int) -> Callable[[Any, ValidationInfo], Over]:
    """Return what reads rows (x, components), or a function f(x) in their place.

    Args:
        sizes: numbers of components that are allowed.
        to: number that they are filled up to with zeros.
    """
    return _reader(("x",), span_rows, sizes, to)


def as_over_both(sizes: Sequence[int], to: int) -> Callable[[Any, ValidationInfo], Over]:
    """Return what reads rows (x, t, components), or a function f(x, t) in their place (see `as_over_span`)."""
    return _reader(("x", "t"), grid_rows, sizes, to)


def _reader(
    over: tuple[str, ...], rows_of: Callable[..., Matrix], sizes: Sequence[int], to: int
) -> Callable[[Any, ValidationInfo], Over]:
    """Return what reads rows (what they are over, components), checked by `rows_of`, or a function of the same."""
    n, names = len(over), ", ".join(over)

    def read(value: Any, info: ValidationInfo) -> Over:
        if callable(value):
            return _function(value, n, f"f({names})")
        rows = as_table(value, info, [n + size for size in sizes], f"a table [[{names}, {_names(sizes)}], …]", rows_of)
        return tuple((*row, *(0.0,) * (n + to - len(row))) for row in rows)

    return read


def _names(sizes: Sequence[int]) -> str:
    return "p" if max(sizes) == 1 else ", ".join(f"f{i}" for i in range(1, max(sizes) + 1))


def _function(value: Callable[..., Any], number: int, call: str) -> Callable[..., Any]:
    if arguments(value) != number:
        raise problem("", value, f"must be a function {call}; it takes {arguments(value)} arguments")
    return value
