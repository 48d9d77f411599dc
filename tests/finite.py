"""Numbers of results that are none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def check_finite(value: Any, where: str = "result", infinite: bool = False) -> None:
    """See that all numbers in nested tables and arrays are finite, or, if they may be infinite, numbers."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            check_finite(entry, f"{where}.{key}", infinite)
    elif isinstance(value, list | tuple):
        for i, entry in enumerate(value):
            check_finite(entry, f"{where}[{i}]", infinite)
    elif isinstance(value, np.ndarray | float | complex):
        assert not np.any(np.isnan(value)), f"{where} is no number"
        assert infinite or np.all(np.isfinite(value)), f"{where} is not finite"
