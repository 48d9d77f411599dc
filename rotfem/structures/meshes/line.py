"""Nodes along a beam, or along a side of a rectangle."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Part of the length within which a node is an end of the line.
END = 1e-9


def apart(places: Iterable[float], length: float) -> tuple[float, ...]:
    """Return places along a line (m) in order, those apart that are its ends or one that is there already."""
    out: list[float] = []
    for x in sorted(places):
        if min(x - (out[-1] if out else 0.0), length - x) > END * length:
            out.append(x)
    return tuple(out)


def beam_nodes(length: float, elements: int, knots: tuple[float, ...]) -> Array:
    """Return elements + 1 node positions on [0, length], evenly spaced between knots that are all nodes (m)."""
    stations = np.array([0.0, *knots, length])
    if len(stations) - 1 > elements:
        elements = len(stations) - 1
    share = np.diff(stations) / length * elements
    counts = np.maximum(1, np.floor(share).astype(int))
    while counts.sum() < elements:
        counts[np.argmax(share / counts)] += 1
    while counts.sum() > elements:
        counts[np.argmin(np.where(counts > 1, share / counts, np.inf))] -= 1
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(stations[:-1], stations[1:], counts, strict=True)]
    return np.concatenate([*pieces, [length]])
