"""The [loads] table, and vectors that are constant, tabulated over time or (in Python) a function of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import PlainValidator, ValidationInfo, model_validator

from rotfem.scene.files import as_time_table
from rotfem.scene.values import (
    Array,
    Matrix,
    PaddedVector,
    SceneModel,
    as_number,
    as_padded_vector3,
    as_vector,
    problem,
)


def as_function(value: Any) -> Callable[[float], Any]:
    """Return the value; raise if it is not callable."""
    if not callable(value):
        raise problem("", value, "must be a Python function of the time t (s)")
    function: Callable[[float], Any] = value
    return function


def _as_rows4(value: Any, info: ValidationInfo) -> Matrix:
    rows = as_time_table(value, info, (3, 4), "a table [[t, a1, a2, a3], …] (a3 may be left out)")
    return tuple((*row, 0.0)[:4] for row in rows)


def _as_moment(value: Any) -> tuple[float, ...]:
    if isinstance(value, list | tuple):
        return as_vector(value, (1, 3))
    return (as_number(value),)


def _as_moment_rows(value: Any, info: ValidationInfo) -> Matrix:
    return as_time_table(value, info, (2, 4), "a table [[t, M], …] or [[t, M1, M2, M3], …]")


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

    value: Annotated[tuple[float, ...], PlainValidator(as_padded_vector3)] | None = None
    table: Annotated[Matrix, PlainValidator(_as_rows4)] | None = None
    function: TimeFunction | None = None

    @property
    def constant(self) -> bool:
        """Whether it does not change with time; a function is taken to."""
        return self.function is None and len({row[1:] for row in self._rows}) == 1

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times; a function is taken not to be."""
        return self.function is None and not any(component for row in self._rows for component in row[1:])

    @property
    def knots(self) -> tuple[float, ...] | None:
        """Times (s) between which it is linear; None of a function."""
        return None if self.function is not None else tuple(row[0] for row in self._rows)

    @property
    def components(self) -> int:
        """Number of components; 3, but for a moment 1 or 3."""
        return 3 if self.function is not None else len(self._rows[0]) - 1

    def at(self, t: float) -> Array:
        """Return the components at time t (s), shape (components,)."""
        if self.function is not None:
            given = np.asarray(self.function(t), dtype=np.float64).ravel()
            return np.append(given, 0.0) if given.size == 2 else given
        if self.table is not None:
            times, *columns = self._columns
            return np.array([np.interp(t, times, column) for column in columns])
        return np.array(self.value, dtype=np.float64)

    @property
    def is_planar(self) -> bool:
        """Whether the third component is zero at all times; that of a function is taken to be."""
        return self.function is not None or not any(row[3] for row in self._rows)

    @cached_property
    def _columns(self) -> tuple[Array, ...]:
        """Columns of the table as arrays; kept, because a time history asks for them at every step."""
        return tuple(np.array(self.table, dtype=np.float64).T)

    @property
    def _rows(self) -> Matrix:
        """Rows (t, components…); one of them if the value is constant."""
        return self.table if self.table is not None else ((0.0, *(self.value or ())),)

    @model_validator(mode="before")
    @classmethod
    def _from_bare(cls, data: Any) -> Any:
        if isinstance(data, Mapping | Signal):
            return data
        if callable(data):
            return {"function": data}
        rows = isinstance(data, list | tuple) and bool(data) and isinstance(data[0], list | tuple)
        return {"table" if rows or isinstance(data, str) else "value": data}

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        given = [name for name in ("value", "table", "function") if getattr(self, name) is not None]
        if len(given) != 1:
            raise problem("", ", ".join(given) or None, "give exactly one of value and table")
        return self


class Load(Signal):
    """A force over time, components in the rotating frame (N, or N/m if distributed).

    Attributes:
        kind: "dead" (keeps its direction in the rotating frame) or "follower" (turns with the section).
    """

    kind: Literal["dead", "follower"] = "dead"


class MomentLoad(Load):
    """A moment over time (N·m): one component, about axis 3, for a planar beam and three for a spatial one."""

    value: Annotated[tuple[float, ...], PlainValidator(_as_moment)] | None = None
    table: Annotated[Matrix, PlainValidator(_as_moment_rows)] | None = None


class Loads(SceneModel):
    """The [loads] table.

    Attributes:
        gravity: acceleration (m/s²) in inertial axes, which coincide with the frame's at ψ = 0.
        tip_force: force at the free end (N), or None.
        tip_moment: moment at the free end (N·m), or None.
        distributed: force per length (N/m), for a plate per area (N/m²), or None.
    """

    gravity: PaddedVector = (0.0, 0.0, 0.0)
    tip_force: Load | None = None
    tip_moment: MomentLoad | None = None
    distributed: Load | None = None
