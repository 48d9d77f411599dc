"""Short tables of results, for terminals and notebooks: texts in columns, with a unit wherever there is a number."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from itertools import zip_longest
from textwrap import wrap

from rotfem.results.columns import ZERO, described, label

#: Columns of characters that a table is made for, and fewest that a column of text is given.
WIDTH, NARROWEST = 80, 16

#: Rows that a notebook shows of a table.
SHORT = 12


@dataclass(frozen=True)
class ShortTable:
    """A short table.

    Attributes:
        head: heading of each column, with its unit.
        rows: texts in the order of the headings; fewer where the last ones are empty.
    """

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]

    def lines(self, width: int = WIDTH) -> list[str]:
        """Return the table as lines, numbers to the right; where they are too long the last column is folded."""
        columns = list(zip_longest(self.head, *self.rows, fillvalue=""))
        sizes = [max(map(len, column)) for column in columns]
        left = [not any(map(_is_number, column[1:])) for column in columns]
        room = width - sum(sizes[:-1]) - 2 * (len(sizes) - 1)
        out = []
        for row in (*([self.head] if any(self.head) else []), *self.rows):
            cells = [*row, *[""] * (len(sizes) - len(row))]
            folded = wrap(cells[-1], max(room, NARROWEST)) or [""]
            *most, size = sizes
            one = zip([*cells[:-1], folded[0]], [*most, size if size <= room else 0], left, strict=True)
            out.append("  ".join(text.ljust(n) if to_left else text.rjust(n) for text, n, to_left in one).rstrip())
            out += [" " * (sum(most) + 2 * len(most)) + text for text in folded[1:]]
        return out

    def html(self) -> str:
        """Return the table as HTML, its first rows where there are many."""
        more = len(self.rows) - SHORT
        rows = self.rows if more <= 0 else [*self.rows[:SHORT], (f"… and {more} more",)]
        cells = "".join("<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows)
        head = "".join(f"<th>{escape(text)}</th>" for text in self.head)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{cells}</tbody></table>"


def number(value: float | None, scale: float = 1.0, digits: int = 6) -> str:
    """Return a number as text; 0 if it is below `ZERO` of a scale, and – where there is none."""
    if value is None:
        return "–"
    return "0" if abs(value) <= ZERO * scale else f"{value:.{digits}g}"


def numbers(values: Sequence[float | None], digits: int = 6) -> list[str]:
    """Return the numbers of one column as text, relative to the largest of them."""
    scale = largest(values)
    return [number(value, scale, digits) for value in values]


def largest(values: Iterable[float | None]) -> float:
    """Return the largest size of numbers."""
    return max((abs(value) for value in values if value is not None), default=0.0)


def per_cent(ratio: float | None) -> str:
    """Return a ratio as a number of per cent with two digits, of large ones three."""
    return number(None if ratio is None else 100 * ratio, 100.0, 2 if ratio is None or abs(ratio) < 0.1 else 3)


def named(column: str) -> str:
    """Return what a column is called, with its unit."""
    return label(column).removesuffix(" (–)")


def by_unit(values: dict[str, float]) -> dict[str, float]:
    """Return for every column the largest size among those that have its unit."""
    units = {name: described(name)[1] for name in values}
    return {name: largest(values[other] for other in values if units[other] == units[name]) for name in values}


def _is_number(text: str) -> bool:
    try:
        float(text.lstrip("<"))
    except ValueError:
        return False
    return True
