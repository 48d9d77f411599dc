"""Vectors that are constant, tabulated over time or (in Python) a function of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import PlainValidator, ValidationInfo, model_validator

from rotfem.scene.files import as_time_table
from rotfem.scene.values import (
    Array,
    Matrix,
    SceneModel,
    as_padded_vector3,
    problem,
)


def as_function(value: Any) -> Callable[[float], Any]:
    """Return the value; raise if it is not callable."""
    if not callable(value):
        raise problem("", value, "must be a Python function of the time t (s)")
    function: Callable[[float], Any] = value
    return function


def as_rows4(value: Any, info: ValidationInfo) -> Matrix:
    """Return rows (t, a1, a2, a3), the last column zero where it is not given; raise on anything else."""
    rows = as_time_table(value, info, (3, 4), "a table [[t, a1, a2, a3], …] (a3 may be left out)")
    return tuple((*row, 0.0)[:4] for row in rows)


TimeFunction = Annotated[Callable[[float], Any], PlainValidator(as_function)]


class Signal(SceneModel):
    """A vector over time, given by exactly one of value, table and function.

    In a scene it may be written without its table: […] is a value, [[t, …], …] a table, as is the path of a
    CSV file. Vectors with two components get a third one, zero. Ask `at`, which
    covers all three.

    Attributes:
        value: constant components, or None.
        table: rows (t, a1, a2, a3), linear between them and constant outside, or None.
        function: Python function t (s) ↦ 2 or 3 components, or None.
    """

    #: Its keys of which exactly one is given.
    WAYS: ClassVar[tuple[str, ...]] = ("value", "table", "function")

    value: Annotated[tuple[float, ...], PlainValidator(as_padded_vector3)] | None = None
    table: Annotated[Matrix, PlainValidator(as_rows4)] | None = None
    function: TimeFunction | None = None

    @property
    def time_table(self) -> Matrix | None:
        """Its rows over time, None where there are none."""
        return self.table

    @property
    def time_function(self) -> Callable[[float], Any] | None:
        """The function of time that it is, None where it is none."""
        return self.function

    @property
    def constant(self) -> bool:
        """Whether it does not change with time; a function is taken to."""
        return self.time_function is None and len({row[1:] for row in self._rows}) == 1

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times; a function is taken not to be."""
        return self.time_function is None and not any(component for row in self._rows for component in row[1:])

    @property
    def knots(self) -> tuple[float, ...] | None:
        """Times (s) between which it is linear; None of a function."""
        return None if self.time_function is not None else tuple(row[0] for row in self._rows)

    @property
    def linear(self) -> bool:
        """Whether it is linear between its knots."""
        return self.time_function is None

    def many(self, t: Array) -> Array:
        """Return the components at times (n,), shape (n, components)."""
        if self.time_table is None:
            return np.array([self.at(float(s)) for s in t]).reshape(len(t), -1)
        times, *columns = self._columns
        return np.stack([np.interp(t, times, column) for column in columns], axis=1)

    def sizes(self) -> Array | None:
        """Return the largest size of each component at all times; None of a function."""
        return None if self.time_function is not None else np.abs(np.array(self._rows)[:, 1:]).max(axis=0)

    @property
    def components(self) -> int:
        """Number of components; 3, but for a moment 1 or 3."""
        return 3 if self.time_function is not None else len(self._rows[0]) - 1

    def at(self, t: float) -> Array:
        """Return the components at time t (s), shape (components,)."""
        if self.time_function is not None:
            given = np.asarray(self.time_function(t), dtype=np.float64).ravel()
            return np.append(given, 0.0) if given.size == 2 else given
        if self.time_table is not None:
            times, *columns = self._columns
            return np.array([np.interp(t, times, column) for column in columns])
        return np.array(self.value, dtype=np.float64)

    @property
    def is_planar(self) -> bool:
        """Whether the third component is zero at all times; that of a function is taken to be."""
        return self.time_function is not None or not any(row[3] for row in self._rows if len(row) > 3)

    @cached_property
    def _columns(self) -> tuple[Array, ...]:
        """Columns of the table as arrays; kept, because a time history asks for them at every step."""
        return tuple(np.array(self.time_table, dtype=np.float64).T)

    @property
    def _rows(self) -> Matrix:
        """Rows (t, components…); one of them if the value is constant."""
        return self.time_table if self.time_table is not None else ((0.0, *(self.value or ())),)

    @model_validator(mode="before")
    @classmethod
    def _from_bare(cls, data: Any) -> Any:
        if isinstance(data, Mapping | Signal):
            return data
        if callable(data):
            return {"function": data}
        rows = isinstance(data, list | tuple) and bool(data) and isinstance(data[0], list | tuple)
        return {"table" if rows or isinstance(data, str) else "value": data}

    @property
    def given(self) -> tuple[str, ...]:
        """The keys by which it is given."""
        return tuple(name for name in self.WAYS if getattr(self, name) is not None)

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if len(self.given) != 1:
            ways = ", ".join(name for name in self.WAYS if name != "function")
            raise problem("", ", ".join(self.given) or None, f"give exactly one of {ways}")
        return self
