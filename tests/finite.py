"""Numbers of results that are none."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def check_finite(value: Any, where: str = "result") -> None:
    """See that all numbers in nested tables and arrays are finite."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            check_finite(entry, f"{where}.{key}")
    elif isinstance(value, list | tuple):
        for i, entry in enumerate(value):
            check_finite(entry, f"{where}[{i}]")
    elif isinstance(value, np.ndarray | float | complex):
        assert np.all(np.isfinite(value)), f"{where} is not finite"
