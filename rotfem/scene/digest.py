"""The scene as a summary repeats it: in full, but for tables so long that they are referred to."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

#: Rows up to which a summary repeats a table.
LONGEST = 1000


def abridged(tables: Mapping[str, Any], given: Any) -> dict[str, Any]:
    """Return the tables of a scene with long tables replaced by what identifies them.

    In their place stand the number of `rows` and `columns`, the `sha256` of the numbers (doubles, least byte first, row
    after row), and the `file` that they came from, if there is one.

    Args:
        tables: of the validated scene.
        given: the same tables as the user gave them, where the path of a file may stand for a table.
    """
    return {key: _entry(value, _below(given, key)) for key, value in tables.items()}


def _below(given: Any, key: str) -> Any:
    # A load may be given as the path of its table, without the table around it.
    return given.get(key) if isinstance(given, Mapping) else given


def _entry(value: Any, given: Any) -> Any:
    if isinstance(value, Mapping):
        return abridged(value, given)
    if not isinstance(value, list) or len(value) <= LONGEST or not isinstance(value[0], list):
        return value
    table = np.array([np.concatenate([np.ravel(entry) for entry in row]) for row in value], dtype="<f8")
    note = {"rows": len(table), "columns": table.shape[1], "sha256": hashlib.sha256(table.tobytes()).hexdigest()}
    return {"file": str(given), **note} if isinstance(given, str) else note
