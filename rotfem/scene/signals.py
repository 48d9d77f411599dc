"""Vectors that are constant, tabulated over time or (in Python) a function of time."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field, PlainValidator, ValidationInfo, model_validator

from rotfem.scene.files import as_table
from rotfem.scene.table import SceneModel, Unit, problem
from rotfem.scene.values import Array, Matrix, Number, Positive, as_padded_vector3, check_increasing, such
from rotfem.units import is_quantity


def arguments(function: Callable[..., Any]) -> int:
    """Return how many arguments a function must be given; 1 where that is unknown, or any number will do."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    needed = sum(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty for p in parameters)
    return needed or int(any(p.kind is p.VAR_POSITIONAL for p in parameters))


def function_of(what: str, count: int = 1) -> PlainValidator:
    """Return the validator of a Python function of so many arguments; `what` says which."""
    return such(lambda f: f, lambda f: callable(f) and arguments(f) == count, f"must be a Python function of {what}")


def time_table(column: str) -> PlainValidator:
    """Return the validator of a table [[t, column], …], rows or the path of a CSV file."""
    return PlainValidator(
        lambda value, info: as_table(value, info, (2,), f"a table [[t, {column}], …]", check_increasing)
    )


def _as_rows4(value: Any, info: ValidationInfo) -> Matrix:
    """Return rows (t, a1, a2, a3), the last column zero where it is not given; raise on anything else."""
    rows = as_table(value, info, (3, 4), "a table [[t, a1, a2, a3], …] (a3 may be left out)", check_increasing)
    return tuple((*row, 0.0)[:4] for row in rows)


TimeFunction = Annotated[Callable[[float], Any], function_of("the time t (s)")]


class Harmonic(SceneModel):
    """amplitude · cos(frequency · t + phase), or cos(per_rev · ψ + phase) with the angle ψ of the hub.

    Attributes:
        amplitude: components, as those of the load's value; of a load over the span also rows (x, components).
        frequency: angular frequency (rad/s), or `per_rev`.
        per_rev: periods in a revolution of the hub.
        phase: by which it is ahead at t = 0 or ψ = 0 (rad).
    """

    amplitude: Any = Field(description="given")
    frequency: Annotated[Positive, Unit("rad/s")] | None = None
    per_rev: Positive | None = None
    phase: Annotated[Number, Unit("rad")] = 0.0

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if (self.frequency is None) == (self.per_rev is None):
            raise problem("frequency", self.frequency, "give exactly one of frequency and per_rev")
        return self


class Given(SceneModel):
    """A quantity that is given in one of several ways.

    In a scene it may be written without its table: a value, a table (rows, or the path of a CSV file), or a function.
    """

    #: Its keys of which exactly one is given.
    WAYS: ClassVar[tuple[str, ...]]

    @property
    def given(self) -> tuple[str, ...]:
        """The keys by which it is given."""
        return tuple(name for name in self.WAYS if getattr(self, name) is not None)

    @property
    def vectors(self) -> Iterator[tuple[float, ...]]:
        """All vectors that are known of it."""
        raise NotImplementedError

    @property
    def is_planar(self) -> bool:
        """Whether the third component of all vectors is zero."""
        return not any(vector[2] for vector in self.vectors if len(vector) > 2)

    @model_validator(mode="before")
    @classmethod
    def _from_bare(cls, data: Any) -> Any:
        if isinstance(data, Given):
            return data
        if isinstance(data, Mapping):
            one = isinstance(data.get("harmonic"), Mapping | Harmonic)
            return {**data, "harmonic": [data["harmonic"]]} if one else data
        if callable(data):
            return {"function": data}
        rows = isinstance(data, list | tuple) and bool(data) and isinstance(data[0], list | tuple)
        path = isinstance(data, str) and not is_quantity(data)
        return {"table" if rows or path else "value": data}

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        harmonic = vars(self).get("harmonic")
        if len(self.given) > 1 or not (self.given or harmonic):
            ways = ", ".join(name for name in self.WAYS if name != "function")
            added = "" if harmonic is None else "; harmonic may be given in addition"
            raise problem("", ", ".join(self.given) or None, f"give exactly one of {ways}{added}")
        return self


class Signal(Given):
    """A vector over time; one with two components gets a third one, zero. Ask `at`, which covers all ways.

    Attributes:
        value: constant components, or None.
        table: rows (t, a1, a2, a3), linear between them and constant outside, or None.
        function: Python function t (s) ↦ 2 or 3 components, or None.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "table", "function")

    value: Annotated[tuple[float, ...], PlainValidator(as_padded_vector3), Unit("m/s**2")] | None = None
    table: Annotated[Matrix, PlainValidator(_as_rows4), Unit("m/s**2", ("s",))] | None = None
    function: TimeFunction | None = None

    @property
    def vectors(self) -> Iterator[tuple[float, ...]]:
        """The value, or the rows without their times; none of a function."""
        yield from (row[1:] for row in self.table or ())
        yield from () if self.value is None else (self.value,)

    @property
    def constant(self) -> bool:
        """Whether it does not change with time; a function is taken to."""
        return self.function is None and len(set(self.vectors)) == 1

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times; a function is taken not to be."""
        return self.function is None and not any(any(vector) for vector in self.vectors)

    @property
    def knots(self) -> tuple[float, ...] | None:
        """Times (s) between which it is linear; None of a function."""
        return None if self.function is not None else tuple(row[0] for row in self.table or ())

    def at(self, t: float) -> Array:
        """Return the components at time t (s), shape (components,)."""
        if self.function is not None:
            given = np.asarray(self.function(t), dtype=np.float64).ravel()
            return np.append(given, 0.0) if given.size == 2 else given
        if self.table is not None:
            times, *columns = self._columns
            return np.array([np.interp(t, times, column) for column in columns])
        return np.array(self.value, dtype=np.float64)

    @cached_property
    def _columns(self) -> tuple[Array, ...]:
        """Columns of the table as arrays; kept, because a time history asks for them at every step."""
        return tuple(np.ascontiguousarray(np.array(self.table, dtype=np.float64).T))
