"""What is given over time, and of loads over the span too: constant, as a table, a function, or harmonic."""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import Field, PlainValidator, ValidationInfo, field_validator

from rotfem.scene.files import Check, as_table
from rotfem.scene.table import SceneModel, Unit, problem
from rotfem.scene.values import Matrix, Number, Positive, as_number, as_vector, check_increasing, such
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


TimeFunction = Annotated[Callable[[float], Any], function_of("the time t (s)")]


#: A table, or a function in its place.
Over: TypeAlias = Matrix | Callable[..., Any]


@dataclass(frozen=True)
class Kind:
    """What the vectors of a signal are.

    Attributes:
        unit: of their components.
        sizes: numbers of components that are allowed.
        columns: how rows of components are written, for messages.
        padded: number of components that vectors are filled up to with zeros.
    """

    unit: str
    sizes: tuple[int, ...]
    columns: tuple[str, ...]
    padded: int = 0

    def vector(self, value: Any) -> tuple[float, ...]:
        """Return components; raise if they are none. A number will do where one is allowed."""
        value = Unit(self.unit).read(value)
        if 1 in self.sizes and not (isinstance(value, list | tuple) and len(self.sizes) > 1):
            return (as_number(value),)
        return self._filled(as_vector(value, self.sizes))

    def rows(self, over: tuple[str, ...], value: Any, info: ValidationInfo) -> Over:
        """Return rows (what they are over, components), or the function of the same that stands in their place."""
        names = ", ".join(over)
        if callable(value):
            if arguments(value) != len(over):
                places = "(x, y)" if (info.context or {}).get("type") == "plate" else "x"
                needed = f"f({names.replace('x', places)})"
                raise problem("", value, f"must be a function {needed}; it takes {arguments(value)} arguments")
            function: Callable[..., Any] = value
            return function
        shape = "a table " + " or ".join(f"[[{names}, {columns}], …]" for columns in self.columns)
        value = Unit(self.unit, tuple(OVER_UNITS[name] for name in over)).read(value)
        table = as_table(value, info, [len(over) + size for size in self.sizes], shape, CHECKS[over])
        return tuple((*row[: len(over)], *self._filled(row[len(over) :])) for row in table)

    def _filled(self, vector: tuple[float, ...]) -> tuple[float, ...]:
        return (*vector, *(0.0,) * (self.padded - len(vector)))


ACCELERATION = Kind("m/s**2", (2, 3), ("a1, a2", "a1, a2, a3"), padded=3)
FORCE = Kind("N", (2, 3), ("f1, f2", "f1, f2, f3"), padded=3)
MOMENT = Kind("N*m", (1, 3), ("m", "m1, m2, m3"))
PRESSURE = Kind("Pa", (1,), ("p",))


def check_span(rows: Matrix, value: Any, shape: str, row_name: Callable[[int], str]) -> None:
    """Refuse rows (x, …) whose x (m) decreases, or does not change; one x may stand in two of them: a jump."""
    x = [row[0] for row in rows]
    if len(rows) < 2 or x[0] == x[-1]:
        raise problem("", value, f"must be {shape} with at least two rows at different x")
    for i, (before, after) in enumerate(pairwise(x), start=2):
        if after < before:
            raise problem("", value, f"the first column must not decrease; {row_name(i)}: {after:g} < {before:g}")
    most = max(Counter(x).items(), key=lambda item: item[1])
    if most[1] > 2:
        raise problem("", value, f"x = {most[0]:g} stands in {most[1]} rows; must be in one, or in two, where it jumps")


def check_grid(rows: Matrix, value: Any, shape: str, row_name: Callable[[int], str]) -> None:
    """Refuse rows (x, t, …) unless every x (m), at least two, stands with every t (s), at least two."""
    found: dict[tuple[float, float], int] = {}
    for i, (x, t, *_) in enumerate(rows, start=1):
        if (x, t) in found:
            raise problem("", value, f"{row_name(i)} gives x = {x:g}, t = {t:g} again, after {row_name(found[x, t])}")
        found[x, t] = i
    stations, times = (sorted({pair[k] for pair in found}) for k in (0, 1))
    if len(stations) < 2 or len(times) < 2:
        raise problem("", value, f"must be {shape} with at least two x and two t")
    missing = next(((x, t) for x in stations for t in times if (x, t) not in found), None)
    if missing is not None:
        raise problem("", value, f"has no row for x = {missing[0]:g}, t = {missing[1]:g}; must have every t at every x")


#: What a table is over ↦ what checks its rows.
CHECKS: dict[tuple[str, ...], Check] = {("t",): check_increasing, ("x",): check_span, ("x", "t"): check_grid}

#: Key of a table ↦ what its rows are over, and the units of that.
OVER = {"table": ("t",), "over_time": ("t",), "over_span": ("x",), "over_span_and_time": ("x", "t")}
OVER_UNITS = {"t": "s", "x": "m"}


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

    def _check(self) -> None:
        if (self.frequency is None) == (self.per_rev is None):
            raise problem("frequency", self.frequency, "give exactly one of frequency and per_rev")


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

    @classmethod
    def _table(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            one = isinstance(data.get("harmonic"), Mapping | Harmonic)
            return {**data, "harmonic": [data["harmonic"]]} if one else data
        if callable(data):
            return {"function": data}
        rows = isinstance(data, list | tuple) and bool(data) and isinstance(data[0], list | tuple)
        path = isinstance(data, str) and not is_quantity(data)
        return {"table" if rows or path else "value": data}

    def _check(self) -> None:
        harmonic = vars(self).get("harmonic")
        if len(self.given) > 1 or not (self.given or harmonic):
            ways = ", ".join(name for name in self.WAYS if name != "function")
            added = "" if harmonic is None else "; harmonic may be given in addition"
            raise problem("", ", ".join(self.given) or None, f"give exactly one of {ways}{added}")


class Signal(Given):
    """A vector over time; one with two components gets a third one, zero.

    Attributes:
        value: constant components, or None.
        table: rows (t, components), linear between them and constant outside, or None.
        function: Python function t (s) ↦ components, or None.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "table", "function")
    VECTORS: ClassVar[Kind] = ACCELERATION

    value: tuple[float, ...] | None = None
    table: Matrix | None = None
    function: TimeFunction | None = None

    @field_validator("value", mode="plain")
    @classmethod
    def _read_value(cls, value: Any, info: ValidationInfo) -> tuple[float, ...] | None:
        return None if value is None else cls._kind(info).vector(value)

    @field_validator(*OVER, mode="plain", check_fields=False)
    @classmethod
    def _read_rows(cls, value: Any, info: ValidationInfo) -> Over | None:
        return None if value is None else cls._kind(info).rows(OVER[str(info.field_name)], value, info)

    @classmethod
    def _kind(cls, info: ValidationInfo) -> Kind:
        return cls.VECTORS

    @property
    def over(self) -> tuple[tuple[str, ...], Any]:
        """What it is over, ("t",), ("x",) or ("x", "t"), () of one value, and that, or rows or a function; or None."""
        name = next(iter(self.given), "value")
        return {"function": ("t",), **OVER}.get(name, ()), getattr(self, name)

    @property
    def vectors(self) -> Iterator[tuple[float, ...]]:
        """The value, or the rows without what they are over; none of a function."""
        over, given = self.over
        if isinstance(given, tuple):
            yield from (row[len(over) :] for row in (given if over else [given]))
