"""How far two histories are apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rotfem.results.columns import described


def difference(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> float:
    """Return the largest difference of any column, relative to the largest value of its unit."""
    assert list(one) == list(other)
    units = {name: described(name)[1] for name in other}
    sizes = {
        unit: max(float(np.abs(x).max(initial=0.0)) for name, x in other.items() if units[name] == unit)
        for unit in units.values()
    }
    return max(float(np.abs(one[name] - x).max(initial=0.0)) / (sizes[units[name]] or 1.0) for name, x in other.items())
