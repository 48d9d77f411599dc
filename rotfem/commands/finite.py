"""Nothing that is not a finite number is a result."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from rotfem.errors import ComputationError

#: What to try where numbers overflow.
ADVICE = "the numbers of the scene are out of all proportion (units?), or the step is too long for the motion"


def check_finite(values: Iterable[tuple[str, Any]], time: float | None = None, where: str = "") -> None:
    """See that all values are finite; what is no number passes.

    Args:
        values: name and value of each.
        time: when they were computed (s), where there is a time.
        where: what they belong to, for the message.

    Raises:
        ComputationError: names those that are not.
    """
    wrong = [name for name, value in values if isinstance(value, float) and not math.isfinite(value)]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise ComputationError(f"not a finite number{where}: {', '.join(wrong[:3])}{more}", time, ADVICE)


def check_rows(rows: Iterable[Mapping[str, Any]]) -> None:
    """See that all numbers of modes, or of branches over speed, are finite.

    Raises:
        ComputationError: names the first mode with one that is not.
    """
    for number, row in enumerate(rows, start=1):
        where = f" at {row['speed']:g} rad/s" if "speed" in row else ""
        check_finite(row.items(), where=f" of mode {row.get('branch', number)}{where}")
