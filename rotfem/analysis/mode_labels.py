"""Names of overdamped modes: one that does not vibrate has a slow and a fast eigenvalue, of nearly the same shape."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def with_overdamped(names: list[str], values: Array, energies: tuple[Array, Array]) -> list[str]:
    """Return the names of modes, those of overdamped ones as "lag 4, slow" and "lag 4, fast".

    The number of an overdamped mode is not that of its nodes, which damping can move, but its place in its family: each
    undamped mode becomes one that vibrates, or a slow and a fast one.

    Args:
        names: "kind n" of every mode, in the order of the undamped frequencies of the shapes.
        values: λ, 1/s.
        energies: x^H M x and x^H K x of every mode, over all ranks; a negative K tells of an instability.
    """
    mass, stiffness = (np.real(e) for e in energies)
    over = (values.imag == 0.0) & (values.real < 0.0) & (stiffness > 0.0) & (mass > 0.0)
    if not np.any(over):
        return names
    vibrating, out = Counter[str](), list(names)
    counted: dict[str, Counter[str]] = {"slow": Counter(), "fast": Counter()}
    for j, name in enumerate(names):
        kind, _, _ = name.rpartition(" ")
        if not over[j]:
            vibrating[kind] += 1
            continue
        speed = "slow" if abs(values[j]) ** 2 * mass[j] < stiffness[j] else "fast"
        counted[speed][kind] += 1
        out[j] = f"{kind} {vibrating[kind] + counted[speed][kind]}, {speed}"
    return out
