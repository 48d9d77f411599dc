"""How loads are written: vectors of some kind, and their tables over time, over the span, and over both."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

from pydantic import ValidationInfo

from rotfem.scene.files import Reader, as_table
from rotfem.scene.signals import arguments
from rotfem.scene.values import Matrix, as_increasing_rows, as_number, as_rows, as_vector, problem

#: A table, or a function in its place.
Over: TypeAlias = Matrix | Callable[..., Any]


@dataclass(frozen=True)
class Kind:
    """What the vectors of a load are.

    Attributes:
        sizes: numbers of components that are allowed.
        columns: how rows of components are written, for messages.
        padded: number of components that vectors are filled up to with zeros.
    """

    sizes: tuple[int, ...]
    columns: tuple[str, ...]
    padded: int = 0

    def vector(self, value: Any) -> tuple[float, ...]:
        """Return components; raise if they are none. A number will do where one is allowed."""
        if 1 in self.sizes and not (isinstance(value, list | tuple) and len(self.sizes) > 1):
            return (as_number(value),)
        return self._filled(as_vector(value, self.sizes))

    def rows(self, over: tuple[str, ...], value: Any, info: ValidationInfo) -> Over:
        """Return rows (what they are over, components), or the function of the same that stands in their place."""
        names = ", ".join(over)
        if callable(value):
            if arguments(value) != len(over):
                raise problem("", value, f"must be a function f({names}); it takes {arguments(value)} arguments")
            function: Callable[..., Any] = value
            return function
        shape = "a table " + " or ".join(f"[[{names}, {columns}], …]" for columns in self.columns)
        table = as_table(value, info, [len(over) + size for size in self.sizes], shape, READERS[over])
        return tuple((*row[: len(over)], *self._filled(row[len(over) :])) for row in table)

    def _filled(self, vector: tuple[float, ...]) -> tuple[float, ...]:
        return (*vector, *(0.0,) * (self.padded - len(vector)))


FORCE = Kind((2, 3), ("f1, f2", "f1, f2, f3"), padded=3)
MOMENT = Kind((1, 3), ("m", "m1, m2, m3"))
PRESSURE = Kind((1,), ("p",))


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


#: What a table is over ↦ what reads its rows.
READERS: dict[tuple[str, ...], Reader] = {("t",): as_increasing_rows, ("x",): span_rows, ("x", "t"): grid_rows}
