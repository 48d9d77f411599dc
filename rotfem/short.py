"""Representations of at most a few hundred characters, for prompts and notebooks."""

from __future__ import annotations

import reprlib
from dataclasses import fields
from types import FunctionType
from typing import Any


class _Short(reprlib.Repr):
    """Repr of values in which arrays are their shapes and functions their names."""

    def repr_ndarray(self, array: Any, level: int) -> str:
        return f"array{array.shape}" if array.size > self.maxlist else repr(array).replace("\n", "")

    def repr_function(self, function: FunctionType, level: int) -> str:
        return f"<{function.__qualname__.rpartition('.')[2].strip('<>')}>"


_SHORT = _Short()
vars(_SHORT).update(maxlevel=3, maxtuple=4, maxlist=4, maxdict=4, maxstring=64, maxother=64)


def short(name: str, values: dict[str, Any]) -> str:
    """Return `name(key=value, …)` of at most 400 characters."""
    text = f"{name}({', '.join(f'{key}={_SHORT.repr(value)}' for key, value in values.items())})"
    return text if len(text) <= 400 else f"{text[:398]}…)"


def short_fields(self: Any) -> str:
    """Return the repr of a dataclass, for `__repr__` in its body."""
    return short(type(self).__name__, {field.name: getattr(self, field.name) for field in fields(self)})
