"""Representations of at most a few hundred characters, for prompts and notebooks."""

from __future__ import annotations

import reprlib
from dataclasses import MISSING, fields
from types import FunctionType
from typing import Any

#: Characters of a representation, and of one value in it.
LONGEST, LONGEST_VALUE = 400, 64


class _Short(reprlib.Repr):
    """Repr of values in which arrays are their shapes and functions their names."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxtuple, self.maxlist, self.maxdict = 3, 4, 4, 4
        self.maxstring = self.maxother = LONGEST_VALUE

    def repr_ndarray(self, array: Any, level: int) -> str:
        """Return the shape of an array of more than a few numbers."""
        return f"array{array.shape}" if array.size > self.maxlist else repr(array).replace("\n", "")

    def repr_function(self, function: FunctionType, level: int) -> str:
        """Return the name of a function."""
        return f"<{function.__qualname__.rpartition('.')[2].strip('<>')}>"

    def repr_instance(self, x: Any, level: int) -> str:
        """Return the repr of an object, cut in its middle."""
        return _cut(repr(x), LONGEST_VALUE)


_SHORT = _Short()


def short(name: str, values: dict[str, Any]) -> str:
    """Return `name(key=value, …)` of at most `LONGEST` characters."""
    return _cut(f"{name}({', '.join(f'{key}={_SHORT.repr(value)}' for key, value in values.items())})", LONGEST)


def short_fields(self: Any) -> str:
    """Return the repr of a dataclass: fields that differ from their defaults. For `__repr__` in its body."""
    shown = {}
    for field in (field for field in fields(self) if field.repr):
        value, default = getattr(self, field.name), field.default
        if field.default_factory is not MISSING:
            default = field.default_factory()
        if default is MISSING or type(value) is not type(default) or repr(value) != repr(default):
            shown[field.name] = value
    return short(type(self).__name__, shown)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 2]}…{text[-1]}"
