"""Loads that vary harmonically with time, or with the angle of the hub."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, PlainValidator, ValidationInfo, model_validator

from rotfem.scene.load_tables import as_over_span
from rotfem.scene.values import Matrix, Number, Positive, SceneModel, as_number, as_padded_vector3, as_vector, problem


class Harmonic(SceneModel):
    """amplitude · cos(frequency · t + phase), or cos(per_rev · ψ + phase) with the angle ψ of the hub.

    Attributes:
        amplitude: components, as those of the load's value; of a load over the span also rows (x, components).
        frequency: rad/s; or
        per_rev: periods in a revolution of the hub.
        phase: rad.
    """

    amplitude: Any = Field(description="given")
    frequency: Positive | None = None
    per_rev: Positive | None = None
    phase: Number = 0.0

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if (self.frequency is None) == (self.per_rev is None):
            raise problem("frequency", self.frequency, "give exactly one of frequency and per_rev")
        return self


def _spread(sizes: tuple[int, ...], to: int) -> Any:
    read: Any = as_over_span(sizes, to)

    def amplitude(value: Any, info: ValidationInfo) -> tuple[float, ...] | Matrix:
        listed = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
        if listed or isinstance(value, str):
            rows: Matrix = read(value, info)
            return rows
        if to == 1:
            return (as_number(value),)
        return as_padded_vector3(value)

    return amplitude


def _moment(value: Any) -> tuple[float, ...]:
    return as_vector(value, (1, 3)) if isinstance(value, list | tuple) else (as_number(value),)


class HarmonicForce(Harmonic):
    """A harmonic force at a place."""

    amplitude: Annotated[tuple[float, ...], PlainValidator(as_padded_vector3)] = Field(description="a vector")


class HarmonicMoment(Harmonic):
    """A harmonic moment at a place."""

    amplitude: Annotated[tuple[float, ...], PlainValidator(_moment)] = Field(description="a number or a vector")


class HarmonicSpan(Harmonic):
    """A harmonic force over the span."""

    amplitude: Annotated[tuple[float, ...] | Matrix, PlainValidator(_spread((2, 3), 3))] = Field(
        description="a vector, or a table [[x, f1, f2, f3], …]"
    )


class HarmonicPressure(Harmonic):
    """A harmonic pressure."""

    amplitude: Annotated[tuple[float, ...] | Matrix, PlainValidator(_spread((1,), 1))] = Field(
        description="a number, or a table [[x, p], …]"
    )
