"""The [loads] table: gravity, and forces and moments at the tip, along the structure, and at places of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PlainValidator, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from rotfem.errors import SceneError
from rotfem.scene.motion import Motion
from rotfem.scene.signals import FORCE, MOMENT, PRESSURE, Harmonic, Kind, Signal, arguments
from rotfem.scene.span_tables import is_path
from rotfem.scene.table import SceneModel, Unit, problem
from rotfem.scene.values import Number, PaddedVector, as_number, as_vector, on_span


class Load(Signal):
    """A force over time (N), components in the rotating frame; vectors of two get a third component, zero.

    Attributes:
        value: constant components, or None.
        table, over_time: rows (t, components), linear between them and constant outside, or None; `over_time` also a
            function.
        function: Python function t (s) ↦ components, or None.
        kind: "dead" (keeps its direction in the rotating frame) or "follower" (turns with the section).
        harmonic: harmonic terms, added to the rest, or alone.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "table", "over_time", "function")
    VECTORS: ClassVar[Kind] = FORCE

    kind: Literal["dead", "follower"] = "dead"
    over_time: Any = None
    harmonic: tuple[Harmonic, ...] = ()

    @field_validator("harmonic", mode="after")
    @classmethod
    def _read_harmonics(cls, given: tuple[Harmonic, ...], info: ValidationInfo) -> tuple[Harmonic, ...]:
        out = []
        for i, part in enumerate(given):
            try:
                out.append(part.model_copy(update={"amplitude": cls._read_amplitude(part.amplitude, info)}))
            except PydanticCustomError as error:
                raise problem(f"{i}.amplitude", part.amplitude, error.message()) from None
        return tuple(out)

    @classmethod
    def _read_amplitude(cls, value: Any, info: ValidationInfo) -> Any:
        return cls._kind(info).vector(value)

    @property
    def span_rows(self) -> Iterator[tuple[float, ...]]:
        """All rows (x, components) of tables over the span, and over span and time."""
        over, given = self.over
        if "x" in over and isinstance(given, tuple):
            yield from ((row[0], *row[len(over) :]) for row in given)
        yield from (row for h in self.harmonic if isinstance(h.amplitude[0], tuple) for row in h.amplitude)

    @property
    def vectors(self) -> Iterator[tuple[float, ...]]:
        """All vectors that are known of it: of the value, of tables and of harmonics."""
        yield from super().vectors
        for h in self.harmonic:
            yield from (row[1:] for row in h.amplitude) if isinstance(h.amplitude[0], tuple) else (h.amplitude,)


class MomentLoad(Load):
    """A moment over time (N·m): one component, about axis 3, for a planar beam and three for a spatial one."""

    VECTORS: ClassVar[Kind] = MOMENT


class SpanLoad(Load):
    """A force along the structure (N/m, or N/m² on a plate), which may vary over the span, over time, and over both.

    Attributes:
        over_span: rows (x, components), linear between them, no load outside, two of one x are a jump; or a function
            of the place; or None.
        over_span_and_time: rows (x, t, components), every t at every x, or a function of place and time; or None.
    """

    WAYS: ClassVar[tuple[str, ...]] = ("value", "over_span", "over_time", "over_span_and_time", "table", "function")

    VECTORS: ClassVar[Kind] = replace(FORCE, unit="N/m")

    over_span: Any = None
    over_span_and_time: Any = None

    @classmethod
    def _kind(cls, info: ValidationInfo) -> Kind:
        on_plate = cls is SpanLoad and (info.context or {}).get("type") == "plate"
        return replace(FORCE, unit="N/m**2") if on_plate else cls.VECTORS

    @classmethod
    def _read_amplitude(cls, value: Any, info: ValidationInfo) -> Any:
        rows = isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
        kind = cls._kind(info)
        return kind.rows(("x",), value, info) if rows or is_path(value) else kind.vector(value)

    @classmethod
    def _read(cls, data: Mapping[str, Any], info: ValidationInfo) -> Mapping[str, Any]:
        """Take a function of two arguments for one of place and time."""
        given = data.get("function")
        if not callable(given) or arguments(given) != 2:
            return data
        return {**{key: value for key, value in data.items() if key != "function"}, "over_span_and_time": given}

    def _check(self) -> None:
        super()._check()
        over, given = self.over
        if "x" in over and callable(given) and self.harmonic:
            raise problem("harmonic", None, "cannot stand beside a function of the place, which can do the same")


class SpanMoment(SpanLoad):
    """A moment per length of a beam (N): one component, about axis 3, for a planar beam and three for a spatial one."""

    VECTORS: ClassVar[Kind] = replace(MOMENT, unit="N")


class Pressure(SpanLoad):
    """A pressure on a plate (N/m²), along direction 3 if dead, along the normal of the deformed surface if follower.

    Attributes:
        regions: name of a surface of the mesh ↦ pressure there, none on the others; or None.
    """

    WAYS: ClassVar[tuple[str, ...]] = (*SpanLoad.WAYS[:-2], "regions", *SpanLoad.WAYS[-2:])
    VECTORS: ClassVar[Kind] = PRESSURE

    regions: dict[str, Annotated[Number, Unit("Pa")]] | None = None


def _as_place(value: Any) -> tuple[float, ...]:
    return as_vector(value, (2,)) if isinstance(value, list | tuple) else (as_number(value),)


class PointLoad(SceneModel):
    """One table of [[loads.at]]: a force and a moment at a place of the structure.

    Attributes:
        x: along a beam (m), or [x, y] on a plate.
        force: force there (N), or None.
        moment: moment there (N·m), of beams only, or None.
        kind: "dead" or "follower", of both where they do not say it themselves.
    """

    x: Annotated[tuple[float, ...], PlainValidator(_as_place), Unit("m")] = Field(
        description="a place along the beam (m), or [x, y] on a plate"
    )
    force: Load | None = None
    moment: MomentLoad | None = None
    kind: Literal["dead", "follower"] = "dead"

    def kind_of(self, load: Load) -> str:
        """Return the kind of one of the two."""
        return load.kind if "kind" in load.model_fields_set else self.kind

    def _check(self) -> None:
        if self.force is None and self.moment is None:
            raise problem("force", None, "give force, moment, or both")


class Loads(SceneModel):
    """The [loads] table.

    Attributes:
        gravity: acceleration (m/s²) in inertial axes, which coincide with the frame's at ψ = 0.
        tip_force: force at the free end (N), or None.
        tip_moment: moment at the free end (N·m), or None.
        distributed: force per length (N/m), for a plate per area (N/m²), or None.
        distributed_moment: moment per length of a beam (N), or None.
        pressure: on a plate (N/m²), or None.
        at: forces and moments at places of the structure.
    """

    gravity: Annotated[PaddedVector, Unit("m/s**2")] = (0.0, 0.0, 0.0)
    tip_force: Load | None = None
    tip_moment: MomentLoad | None = None
    distributed: SpanLoad | None = None
    distributed_moment: SpanMoment | None = None
    pressure: Pressure | None = None
    at: tuple[PointLoad, ...] = ()

    @property
    def named(self) -> dict[str, Load]:
        """All that are given, by name: "tip_force", …, "at.0.force", "at.0.moment"."""
        names = ("tip_force", "tip_moment", "distributed", "distributed_moment", "pressure")
        given = {name: getattr(self, name) for name in names}
        for i, point in enumerate(self.at):
            given |= {f"at.{i}.force": point.force, f"at.{i}.moment": point.moment}
        return {name: load for name, load in given.items() if load is not None}


# --- checks against what the loads work on ------------------------------------------------------------------------


def check_loads(structure: Any, motion: Motion, loads: Loads) -> None:
    """Refuse loads that the structure cannot bear, and what its motion does not have."""
    for i, point in enumerate(loads.at):
        check_place(f"loads.at.{i}.x", structure, point.x)
    if loads.pressure is not None and structure.type != "plate":
        raise problem("loads.pressure", None, f"needs a plate; on a {structure.type} give loads.distributed")
    for name, load in loads.named.items():
        key = f"loads.{name}"
        if load.VECTORS.sizes == MOMENT.sizes:
            _check_moment(key, structure, load)
        for x, *_ in load.span_rows:
            if not on_span(x, structure.length):
                raise problem(
                    key, None, f"x = {x:.10g} is not on the structure, which runs from 0 to {structure.length:g}"
                )
        per_rev = next((h.per_rev for h in load.harmonic if h.per_rev is not None), None)
        if motion.is_free and per_rev is not None:
            why = 'needs an angle of the hub that is prescribed, not motion.type = "torque"; give frequency'
            raise problem(f"{key}.harmonic.per_rev", per_rev, why)
    _check_regions(structure, loads.pressure)


def _check_moment(key: str, structure: Any, moment: Load) -> None:
    if structure.type == "plate" and key != "loads.tip_moment":
        why = "is not available on a plate; give loads.tip_moment, which is spread over the edge"
        if not isinstance(moment, SpanMoment):
            why = "is not available on a plate: at a point it turns the director without limit as the mesh is refined"
        raise problem(key, None, why)
    # A function is checked where it is called; its moment of a planar beam may have one component or three.
    sizes = {len(vector) for vector in moment.vectors}
    if structure.is_planar and sizes - {1}:
        raise problem(key, None, "must have one component, about axis 3, for a planar_beam")
    if not structure.is_planar and sizes - {3}:
        raise problem(key, None, f"must have three components for a {structure.type}")


def _check_regions(structure: Any, pressure: Pressure | None) -> None:
    known = structure.thickness if pressure is not None and isinstance(structure.thickness, dict) else {}
    for name in () if pressure is None else pressure.regions or ():
        if name not in known:
            has = (
                f"there are {', '.join(known)}" if known else "needs structure.mesh with structure.thickness by region"
            )
            raise problem(f"loads.pressure.regions.{name}", None, f"is no region of the plate; {has}")


def check_place(key: str, structure: Any, x: tuple[float, ...]) -> None:
    """Refuse a place that is not on the structure; one on a plate that is a mesh is looked for later."""
    if len(x) != (2 if structure.type == "plate" else 1):
        allowed = "[x, y], m, for a plate" if structure.type == "plate" else f"a number, m, for a {structure.type}"
        raise problem(key, list(x), f"must be {allowed}")
    if not on_span(x[0], structure.length):
        raise problem(key, x[0] if len(x) == 1 else list(x), f"must be from 0 to the length {structure.length:g}")


def check_tables(file: str, structure: Any, loads: Loads, when: str) -> None:
    """Refuse, with a SceneError of the file, tables without a key that may be over the span (see `Scene.check_tables`).

    In a history such a table is over time unless it runs from 0 to the length.
    """
    for name, load in loads.named.items():
        if not isinstance(load, SpanLoad) or load.table is None:
            continue
        why = None
        if when:
            why = f"is a table [[t, …], …] over time, which {when} does not have"
        elif load.table[0][0] == 0.0 and load.table[-1][0] == structure.length:
            why = f"is a table from 0 to {structure.length:g}, the length: it may be one over time or over the span"
        if why is not None:
            how = "over_time = [[t, …], …], over_span = [[x, …], …] or over_span_and_time = [[x, t, …], …]"
            raise SceneError(file, f"loads.{name}", None, f"{why}; write {how}")
