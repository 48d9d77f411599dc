"""What hears of a computation while it goes on."""

from __future__ import annotations

from collections.abc import Callable

#: Takes the share of the work done, between 0 and 1.
Progress = Callable[[float], None]

#: Takes one line of advice.
Hint = Callable[[str], None]


def silent(line: str) -> None:
    """Take a hint and say nothing."""
