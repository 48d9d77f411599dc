"""The pitch angle of a blade: a number, or over time a table, harmonics, or (in Python) a function."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Self

from pydantic import Field, PlainValidator, ValidationInfo, model_validator

from rotfem.errors import InputError
from rotfem.scene.files import as_time_table
from rotfem.scene.loads import Harmonic
from rotfem.scene.signals import arguments
from rotfem.scene.values import Matrix, Number, SceneModel, problem

KEY = "structure.root.pitch"


def _as_rows(value: Any, info: ValidationInfo) -> Matrix:
    return as_time_table(value, info, (2,), "a table [[t, angle], …]")


def _as_function(value: Any) -> Callable[[float], float]:
    if not callable(value) or arguments(value) != 1:
        raise problem("", value, "must be a Python function of the time t (s)")
    function: Callable[[float], float] = value
    return function


class HarmonicAngle(Harmonic):
    """A harmonic part of an angle."""

    amplitude: Number = Field(description="a number (rad)")


class PitchAngle(SceneModel):
    """The pitch over time: one of value, table and function, and harmonics beside it or alone.

    In a scene it may be written without its table: a number is a value, [[t, angle], …] or the path of a CSV file a
    table.

    Attributes:
        value: a constant angle (rad), or None.
        table: rows (t, angle) in s and rad, at rest before the first and after the last; or None.
        function: Python function t (s) ↦ angle (rad), or None.
        rate: Python function t (s) ↦ rate of the function's angle (rad/s), or None: differences, whose step follows it.
        harmonic: added to these.
    """

    value: Number | None = None
    table: Annotated[Matrix, PlainValidator(_as_rows)] | None = None
    function: Annotated[Callable[[float], float], PlainValidator(_as_function)] | None = None
    rate: Annotated[Callable[[float], float], PlainValidator(_as_function)] | None = None
    harmonic: tuple[HarmonicAngle, ...] = ()

    @property
    def changes(self) -> bool:
        """Whether it changes with time; a function is taken to."""
        moves = self.table is not None and len({angle for _, angle in self.table}) > 1
        return moves or self.function is not None or any(h.amplitude != 0.0 for h in self.harmonic)

    @property
    def constant(self) -> float:
        """The angle of one that does not change, rad."""
        return (self.value or 0.0) + (self.table[0][1] if self.table is not None else 0.0)

    def at(self, t: float) -> float:
        """Return what the function returns at a time (s), rad.

        Raises:
            InputError: it raises, or returns anything but a finite number.
        """
        return _number(self.function, t, KEY, "rad")

    def rate_at(self, t: float) -> float:
        """Return what the function of the rate returns at a time (s), rad/s, as `at` does."""
        return _number(self.rate, t, f"{KEY}.rate", "rad/s")

    @model_validator(mode="before")
    @classmethod
    def _from_bare(cls, data: Any) -> Any:
        if isinstance(data, PitchAngle):
            return data
        if isinstance(data, Mapping):
            harmonic = data.get("harmonic", ())
            one = isinstance(harmonic, Mapping | Harmonic)
            return {**data, "harmonic": [harmonic]} if one else data
        if callable(data):
            return {"function": data}
        return {"table" if isinstance(data, list | tuple | str) else "value": data}

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        given = [name for name in ("value", "table", "function") if getattr(self, name) is not None]
        if len(given) > 1 or not (given or self.harmonic):
            why = "give exactly one of value, table and function; harmonic may stand beside"
            raise problem("", ", ".join(given) or None, why)
        if self.rate is not None and self.function is None:
            raise problem("rate", None, "is that of a function; tables and harmonics have their own")
        return self


def _number(function: Any, t: float, key: str, unit: str) -> float:
    """Return what a function returns at a time (s), or raise an InputError that names the key."""
    where = f"the function of time, at {t:g},"
    try:
        given: Any = function(t)
    except Exception as error:
        raise InputError(key, None, f"{where} raised {type(error).__name__}: {error}") from error
    try:
        number = float(given)
    except (TypeError, ValueError) as error:
        raise InputError(key, None, f"{where} must return a number ({unit}): {error}") from error
    if not math.isfinite(number):
        raise InputError(key, None, f"{where} returned {number}; must return a finite number ({unit})")
    return number
