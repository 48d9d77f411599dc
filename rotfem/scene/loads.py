"""The [loads] table: gravity, and forces and moments at the tip, along the structure, and at places of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, PlainValidator, ValidationInfo, model_validator

from rotfem.scene.files import as_time_table
from rotfem.scene.harmonic import Harmonic, HarmonicForce, HarmonicMoment, HarmonicPressure, HarmonicSpan
from rotfem.scene.load_tables import Over, arguments, as_over_both, as_over_span, as_over_time
from rotfem.scene.signals import Signal, as_rows4
from rotfem.scene.values import Matrix, PaddedVector, SceneModel, as_number, as_vector, problem

Kind = Literal["dead", "follower"]


def _as_moment(value: Any) -> tuple[float, ...]:
    if isinstance(value, list | tuple):
        return as_vector(value, (1, 3))
    return (as_number(value),)


def _as_moment_rows(value: Any, info: ValidationInfo) -> Matrix:
    return as_time_table(value, info, (2, 4), "a table [[t, M], …] or [[t, M1, M2, M3], …]")


def _as_pressure(value: Any) -> tuple[float, ...]:
    return (as_number(value),)


def _as_pressure_rows(value: Any, info: ValidationInfo) -> Matrix:
    return as_time_table(value, info, (2,), "a table [[t, p], …]")


def _one_or_more(value: Any) -> Any:
    """Return a list of tables, where one may be given by itself."""
    return [value] if isinstance(value, Mapping | Harmonic) else value


class Load(Signal):
    """A force over time, components in the rotating frame (N, or N/m if distributed).

    Attributes:
        kind: "dead" (keeps its direction in the rotating frame) or "follower" (turns with the section).
        over_time: rows (t, a1, a2, a3) as `table`, or a function of time, or None.
        harmonic: what varies harmonically, added to the rest; it may be all there is.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "table", "over_time", "function")

    kind: Kind = "dead"
    over_time: Annotated[Over, PlainValidator(as_over_time(as_rows4))] | None = None
    harmonic: tuple[HarmonicForce, ...] = ()

    @property
    def time_table(self) -> Matrix | None:
        """Its rows over time, None where there are none."""
        return self.table if self.table is not None else self.over_time if isinstance(self.over_time, tuple) else None

    @property
    def time_function(self) -> Callable[[float], Any] | None:
        """The function of time that it is, None where it is none."""
        return self.over_time if callable(self.over_time) else self.function

    @property
    def span(self) -> None:
        """How it is spread: it is the same everywhere; `rotfem.commands.loads` makes the other ones."""
        return None

    @property
    def varies_over_span(self) -> bool:
        """Whether it is not the same everywhere."""
        return False

    @property
    def constant(self) -> bool:
        """Whether it does not change with time."""
        return super().constant and not self.harmonic

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times."""
        return super().is_zero and not self.harmonic

    @property
    def is_planar(self) -> bool:
        """Whether the third component is zero at all times and places, as far as that is known."""
        return super().is_planar and all(is_planar(h.amplitude) for h in self.harmonic)

    @model_validator(mode="before")
    @classmethod
    def _list_harmonics(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "harmonic" in data:
            return {**data, "harmonic": _one_or_more(data["harmonic"])}
        return data

    @model_validator(mode="after")
    def _check_one(self) -> Self:
        if len(self.given) > 1 or not (self.given or self.harmonic):
            ways = ", ".join(name for name in self.WAYS if name != "function")
            raise problem("", ", ".join(self.given) or None, f"give exactly one of {ways}; harmonic may stand beside")
        return self


def is_planar(amplitude: Any) -> bool:
    """Return whether the third component of a vector, or of all rows (x, vector), is zero; that of a number is."""
    rows = amplitude if amplitude and isinstance(amplitude[0], tuple) else ((0.0, *amplitude),)
    return not any(row[3] for row in rows if len(row) > 3)


class MomentLoad(Load):
    """A moment over time (N·m): one component, about axis 3, for a planar beam and three for a spatial one."""

    value: Annotated[tuple[float, ...], PlainValidator(_as_moment)] | None = None
    table: Annotated[Matrix, PlainValidator(_as_moment_rows)] | None = None
    over_time: Annotated[Over, PlainValidator(as_over_time(_as_moment_rows))] | None = None
    harmonic: tuple[HarmonicMoment, ...] = ()  # type: ignore[assignment]

    @property
    def components(self) -> int:
        """Number of components; 3 of a function."""
        return super().components if self.given else len(self.harmonic[0].amplitude)

    @property
    def is_planar(self) -> bool:
        """Whether it is about axis 3: it has one component then."""
        return True


class SpanLoad(Load):
    """A load along the structure, which may vary over the span, over time, and over both.

    Attributes:
        over_span: rows (x, f1, f2, f3), linear between them, no load outside, two of one x are a jump; or a function
            of the place; or None.
        over_span_and_time: rows (x, t, f1, f2, f3), every t at every x, or a function of place and time; or None.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "over_span", "over_time", "over_span_and_time", "table", "function")
    SIZE: ClassVar[int] = 3

    over_span: Annotated[Over, PlainValidator(as_over_span((2, 3), 3))] | None = None
    over_span_and_time: Annotated[Over, PlainValidator(as_over_both((2, 3), 3))] | None = None
    harmonic: tuple[HarmonicSpan, ...] = ()  # type: ignore[assignment]

    @property
    def place_function(self) -> Callable[..., Any] | None:
        """The function of place, or of place and time, that it is, None where it is none."""
        given = self.over_span if self.over_span is not None else self.over_span_and_time
        return given if callable(given) else None

    @property
    def span_rows(self) -> Matrix:
        """All rows (x, …) of tables over the span, and over span and time."""
        tables = [t for t in (self.over_span, self.over_span_and_time) if isinstance(t, tuple)]
        tables += [h.amplitude for h in self.harmonic if isinstance(h.amplitude[0], tuple)]
        return tuple(row for table in tables for row in table)

    @property
    def varies_over_span(self) -> bool:
        """Whether it is not the same everywhere."""
        return bool(self.span_rows) or self.place_function is not None

    @property
    def constant(self) -> bool:
        """Whether it does not change with time."""
        return super().constant and self.over_span_and_time is None

    @property
    def is_zero(self) -> bool:
        """Whether it is zero at all times and places."""
        return super().is_zero and not self.varies_over_span

    @property
    def is_planar(self) -> bool:
        """Whether the third component is zero at all times and places, as far as that is known."""
        own = self.over_span_and_time if isinstance(self.over_span_and_time, tuple) else ()
        alone = self.over_span if isinstance(self.over_span, tuple) else ()
        rows = (*(row[2:] for row in own), *(row[1:] for row in alone))
        return super().is_planar and not any(row[2] for row in rows if len(row) > 2)

    @model_validator(mode="before")
    @classmethod
    def _function_of_both(cls, data: Any) -> Any:
        """Take a bare function of two arguments for one of place and time."""
        given = data.get("function") if isinstance(data, Mapping) else data
        if not callable(given) or arguments(given) != 2:
            return data
        rest = {key: value for key, value in data.items() if key != "function"} if isinstance(data, Mapping) else {}
        return {**rest, "over_span_and_time": given}

    @model_validator(mode="after")
    def _check_function(self) -> Self:
        if self.place_function is not None and self.harmonic:
            raise problem("harmonic", None, "cannot stand beside a function of the place, which can do the same")
        return self


class Pressure(SpanLoad):
    """A pressure on a plate (N/m²), along direction 3 if dead, along the normal of the deformed surface if follower.

    Attributes:
        regions: name of a surface of the mesh ↦ pressure there, none on the others; or None.
    """

    WAYS: ClassVar[tuple[str, ...]] = (*SpanLoad.WAYS[:-2], "regions", *SpanLoad.WAYS[-2:])
    SIZE: ClassVar[int] = 1

    value: Annotated[tuple[float, ...], PlainValidator(_as_pressure)] | None = None
    table: Annotated[Matrix, PlainValidator(_as_pressure_rows)] | None = None
    over_time: Annotated[Over, PlainValidator(as_over_time(_as_pressure_rows))] | None = None
    over_span: Annotated[Over, PlainValidator(as_over_span((1,), 1))] | None = None
    over_span_and_time: Annotated[Over, PlainValidator(as_over_both((1,), 1))] | None = None
    harmonic: tuple[HarmonicPressure, ...] = ()  # type: ignore[assignment]
    regions: dict[str, Annotated[float, PlainValidator(as_number)]] | None = None

    @property
    def varies_over_span(self) -> bool:
        """Whether it is not the same everywhere."""
        return super().varies_over_span or self.regions is not None

    @property
    def is_planar(self) -> bool:
        """Whether it has no third component: nobody asks a plate."""
        return True


def _as_place(value: Any) -> tuple[float, ...]:
    return as_vector(value, (2,)) if isinstance(value, list | tuple) else (as_number(value),)


class PointLoad(SceneModel):
    """One table of [[loads.at]]: a force and a moment at a place of the structure.

    Attributes:
        x: along a beam (m), or [x, y] on a plate.
        force: N, or None.
        moment: N·m, or None.
        kind: "dead" or "follower", of both where they do not say it themselves.
    """

    x: Annotated[tuple[float, ...], PlainValidator(_as_place)] = Field(
        description="a place along the beam (m), or [x, y] on a plate"
    )
    force: Load | None = None
    moment: MomentLoad | None = None
    kind: Kind = "dead"

    @model_validator(mode="after")
    def _check_any(self) -> Self:
        if self.force is None and self.moment is None:
            raise problem("force", None, "give force, moment, or both")
        return self


class Loads(SceneModel):
    """The [loads] table.

    Attributes:
        gravity: acceleration (m/s²) in inertial axes, which coincide with the frame's at ψ = 0.
        tip_force: force at the free end (N), or None.
        tip_moment: moment at the free end (N·m), or None.
        distributed: force per length (N/m), for a plate per area (N/m²), or None.
        pressure: on a plate (N/m²), or None.
        at: forces and moments at places of the structure.
    """

    gravity: PaddedVector = (0.0, 0.0, 0.0)
    tip_force: Load | None = None
    tip_moment: MomentLoad | None = None
    distributed: SpanLoad | None = None
    pressure: Pressure | None = None
    at: tuple[PointLoad, ...] = ()

    @property
    def spread(self) -> dict[str, SpanLoad]:
        """Those that may vary over the span, by name."""
        given = {"distributed": self.distributed, "pressure": self.pressure}
        return {name: load for name, load in given.items() if load is not None}
