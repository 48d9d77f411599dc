"""Places along a structure (m), and which of them are one."""

from __future__ import annotations

from collections.abc import Iterable

#: Part of the length within which two places are one: of a shorter element the stiffness would be round-off to others.
ONE = 1e-7


def apart(places: Iterable[float], length: float) -> tuple[float, ...]:
    """Return places along a line (m) in order, those apart that are its ends or one that is there already."""
    out = list[float]()
    for x in sorted(places):
        if min(x - (out[-1] if out else 0.0), length - x) > ONE * length:
            out.append(x)
    return tuple(out)
