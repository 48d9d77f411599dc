"""The [loads] table, and what else is given over time: constant, as a table, a function, or harmonic.

Loads are gravity, and forces and moments at the tip, along the structure, and at places of it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationInfo, field_validator

from rotfem.scene.files import is_path, read_rows
from rotfem.scene.table import LISTED, SceneModel, in_units, problem, problems_at, unit
from rotfem.scene.values import (
    Matrix,
    Number,
    PaddedVector,
    Positive,
    Rows,
    check_on_span,
    check_span,
    check_times,
)


def arguments(function: Callable[..., Any]) -> int:
    """Return how many arguments a function must be given; 1 where that is unknown, or any number will do."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    needed = sum(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty for p in parameters)
    return needed or int(any(p.kind is p.VAR_POSITIONAL for p in parameters))


def function_of(what: str, count: int = 1) -> BeforeValidator:
    """Return what refuses all but Python functions of so many arguments; `what` says of which."""

    def check(value: Any) -> Any:
        if not callable(value) or arguments(value) != count:
            raise problem("", value, f"must be a Python function of {what}")
        return value

    return BeforeValidator(check)


TimeFunction = Annotated[Callable[[float], Any], function_of("the time t (s)")]

#: What reads rows of numbers before these are counted.
_ROWS = TypeAdapter(Rows, config=ConfigDict(defer_build=True))


def are_rows(value: Any) -> bool:
    """Return whether a value is a list of lists, or the path of a file of rows."""
    return is_path(value) or (isinstance(value, list | tuple) and bool(value) and isinstance(value[0], list | tuple))


def check_grid(rows: Matrix) -> Matrix:
    """Return rows (x, t, …) with every t (s) at every x (m): linear between the times of a place, constant outside."""
    places, times = dict[float, list[Any]](), np.unique([row[1] for row in rows])
    for row in sorted(rows):
        places.setdefault(row[0], []).append(row[1:])
    if min(len(places), len(times)) < 2 or len(rows) > len({row[:2] for row in rows}):
        raise problem("", None, "must have at least two x and two t, and none of them together twice")
    of_places = ((x, np.array(at).T) for x, at in places.items())
    filled = ((x, np.array([np.interp(times, at[0], c) for c in at[1:]])) for x, at in of_places)
    return tuple((x, float(t), *map(float, c)) for x, values in filled for t, c in zip(times, values.T, strict=True))


#: Keys of which one says what a quantity is ↦ what its rows are over, and what checks these.
OVER: dict[str, tuple[str, ...]] = {
    "value": (),
    "over_time": ("t",),
    "over_span": ("x",),
    "over_span_and_time": ("x", "t"),
    "regions": (),
}
CHECKS: dict[tuple[str, ...], Callable[[Any], Any]] = {("t",): check_times, ("x",): check_span}
CHECKS |= {("x", "t"): check_grid}


class Signal(SceneModel):
    """A vector over time; one with two components gets a third one, zero.

    In a scene it may be written without its table: components, rows or the path of a CSV file of them, or a function.

    Attributes:
        value: constant components, or None.
        over_time: rows (t, components), linear between them and constant outside, or a Python function of t; or None.
    """

    #: Numbers of components that are allowed, and their unit.
    SIZES: ClassVar[tuple[int, ...]] = (2, 3)
    UNIT: ClassVar[str] = "m/s**2"

    value: tuple[float, ...] | None = None
    over_time: Any = None

    @field_validator("value", "over_time", "over_span", "over_span_and_time", mode="plain", check_fields=False)
    @classmethod
    def _read_given(cls, value: Any, info: ValidationInfo) -> Any:
        return None if value is None else cls._components(value, OVER[str(info.field_name)], info)

    @classmethod
    def _unit(cls, info: ValidationInfo) -> str:
        return cls.UNIT

    @classmethod
    def _components(cls, value: Any, over: tuple[str, ...], info: ValidationInfo) -> Any:
        """Return components, rows (what they are over, components), or the function that stands in their place."""
        n, sizes = len(over), " or ".join(map(str, cls.SIZES))
        if over and callable(value):
            if arguments(value) != n:
                places = "(x, y)" if (info.context or {}).get("type") == "plate" else "x"
                needed = f"f({', '.join(over).replace('x', places)})"
                raise problem("", value, f"must be a function {needed}; it takes {arguments(value)} arguments")
            return value
        units = [{"t": "s", "x": "m"}[name] for name in over]
        given = in_units(read_rows(value, info) if over else value, [cls._unit(info)], units)
        if not over:
            given = [given if isinstance(given, list | tuple) else [given]]
        table = _ROWS.validate_python(given)
        for i, row in enumerate(table, start=1):
            if len(row) != len(table[0]) or len(row) - n not in cls.SIZES:
                shape = f"rows [{', '.join(over)}, …] of {sizes} components each; row {i} has {len(row)} entries"
                raise problem("", value, f"must be {shape if over else f'a list of {sizes} numbers'}")
        filled = tuple((*row, 0.0) if len(row) - n == 2 else row for row in table)
        return CHECKS[over](filled) if over else filled[0]

    @classmethod
    def _table(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            return data
        return {"over_time" if callable(data) or are_rows(data) else "value": data}

    def _check(self) -> None:
        keys = [name for name in OVER if name in type(self).model_fields]
        given = [name for name in keys if getattr(self, name) is not None]
        others = [name for name in ("harmonic", "gust") if name in type(self).model_fields]
        if len(given) > 1 or not (given or any(getattr(self, name) for name in others)):
            added = f"; {' and '.join(others)} may be given in addition" if others else ""
            raise problem("", ", ".join(given) or None, f"give exactly one of {', '.join(keys)}{added}")

    @property
    def given(self) -> tuple[str, Any]:
        """The key that it is given by, and what that holds: components, rows or a function; None of harmonics alone."""
        return next(((k, v) for k in OVER if (v := getattr(self, k, None)) is not None), ("value", None))

    @property
    def vectors(self) -> Iterator[tuple[float | None, tuple[float, ...]]]:
        """Place x (None: everywhere) and components of all vectors that it is given by; none of a function."""
        key, given = self.given
        for row in () if not isinstance(given, tuple) else given if OVER[key] else [given]:
            yield row[0] if "x" in OVER[key] else None, row[len(OVER[key]) :]


class Harmonic(SceneModel):
    """amplitude · cos(frequency · t + phase), or cos(per_rev · ψ + phase) with the angle ψ of the hub.

    Attributes:
        amplitude: components, as those of a value; of a load over the span also rows (x, components).
        frequency: angular frequency (rad/s), or `per_rev`.
        per_rev: periods in a revolution of the hub.
        phase: by which it is ahead at t = 0 or ψ = 0 (rad).
    """

    amplitude: Any
    frequency: Annotated[Positive, unit("rad/s")] | None = None
    per_rev: Positive | None = None
    phase: Annotated[Number, unit("rad")] = 0.0

    def _check(self) -> None:
        if (self.frequency is None) == (self.per_rev is None):
            raise problem("frequency", self.frequency, "give exactly one of frequency and per_rev")


class Gust(SceneModel):
    """One gust, ½ amplitude (1 − cos(2π (t − start)/duration)) while it lasts, else 0 (IEC 61400-1, without its dips).

    Attributes:
        amplitude: largest components, as those of a value; of a load over the span also rows (x, components).
        duration: of the gust (s).
        start: its begin (s).
    """

    amplitude: Any
    duration: Annotated[Positive, unit("s")]
    start: Annotated[Number, unit("s")] = 0.0


class Harmonics(Signal):
    """A signal with harmonic parts.

    Attributes:
        harmonic: harmonic terms, added to the rest, or alone.
    """

    harmonic: Annotated[tuple[Harmonic, ...], LISTED] = ()

    @field_validator("harmonic", "gust", mode="after", check_fields=False)
    @classmethod
    def _read_harmonics(cls, given: tuple[Any, ...], info: ValidationInfo) -> tuple[Any, ...]:
        out = []
        for i, part in enumerate(given):
            over = ("x",) if "over_span" in cls.model_fields and are_rows(part.amplitude) else ()
            with problems_at(f"{i}.amplitude", part.amplitude):
                out.append(part.model_copy(update={"amplitude": cls._components(part.amplitude, over, info)}))
        return tuple(out)

    @property
    def vectors(self) -> Iterator[tuple[float | None, tuple[float, ...]]]:
        """The same, with the amplitudes of harmonics."""
        yield from super().vectors
        for h in (*self.harmonic, *getattr(self, "gust", ())):
            spread = isinstance(h.amplitude[0], tuple)
            yield from ((row[0], row[1:]) for row in h.amplitude) if spread else [(None, h.amplitude)]


class LoadTable(Harmonics):
    """A force over time (N), components in the rotating frame; vectors of two get a third component, zero.

    Attributes:
        kind: "dead" (keeps its direction in the rotating frame) or "follower" (turns with the section).
        gust: gusts, added to the rest, or alone.
    """

    UNIT: ClassVar[str] = "N"

    kind: Literal["dead", "follower"] = "dead"
    gust: Annotated[tuple[Gust, ...], LISTED] = ()


class MomentTable(LoadTable):
    """A moment over time (N·m): one component, about axis 3, for a planar beam and three for a spatial one."""

    SIZES: ClassVar[tuple[int, ...]] = (1, 3)
    UNIT: ClassVar[str] = "N*m"


def bare_tables(loads: Any, length: Any) -> Any:
    """Return the tables of loads; rows alone are over time unless they may be over the span, from 0 to the length."""
    if not isinstance(loads, Mapping) or isinstance(length, str):
        return loads
    rows = {key: loads[key] for key in ("distributed", "pressure") if isinstance(loads.get(key), list)}
    whole = {key: t for key, t in rows.items() if t and all(isinstance(row, list) and row for row in t)}
    timed = {key: t for key, t in whole.items() if [t[0][0], t[-1][0]] != [0.0, length]}
    return {**loads, **{key: {"over_time": table} for key, table in timed.items()}}


class SpanLoad(LoadTable):
    """A force along the structure (N/m, or N/m² on a plate), which may vary over the span, over time, and over both.

    Attributes:
        over_span: rows (x, components), linear between them, no load outside, two of one x are a jump; or a function
            of the place; or None.
        over_span_and_time: rows (x, t, components), linear between the times of each x and constant outside, or a
            function of place and time; or None.
    """

    UNIT: ClassVar[str] = "N/m"

    over_span: Any = None
    over_span_and_time: Any = None

    @classmethod
    def _unit(cls, info: ValidationInfo) -> str:
        return "N/m**2" if cls is SpanLoad and (info.context or {}).get("type") == "plate" else cls.UNIT

    @classmethod
    def _table(cls, data: Any) -> Any:
        """Take a function of two arguments for one of place and time; a table alone may be over time or the span."""
        if callable(data) and arguments(data) == 2:
            return {"over_span_and_time": data}
        if are_rows(data):
            how = "over_time = [[t, …], …], over_span = [[x, …], …] or over_span_and_time = [[x, t, …], …]"
            raise problem("", None, f"must say what a table is over; write {how}")
        return super()._table(data)

    def _check(self) -> None:
        super()._check()
        key, given = self.given
        if "x" in OVER[key] and callable(given) and (self.harmonic or self.gust):
            raise problem(
                "harmonic" if self.harmonic else "gust",
                None,
                "cannot stand beside a function of the place, which can do the same",
            )


class SpanMoment(SpanLoad):
    """A moment per length of a beam (N): one component, about axis 3, for a planar beam and three for a spatial one."""

    SIZES: ClassVar[tuple[int, ...]] = (1, 3)
    UNIT: ClassVar[str] = "N"


class Pressure(SpanLoad):
    """A pressure on a plate (N/m²), along direction 3 if dead, along the normal of the deformed surface if follower.

    Attributes:
        regions: name of a surface of the mesh ↦ pressure there, none on the others; or None.
    """

    SIZES: ClassVar[tuple[int, ...]] = (1,)
    UNIT: ClassVar[str] = "Pa"

    regions: dict[str, Annotated[Number, unit("Pa")]] | None = None


#: A place along a beam, or (x, y) on a plate.
Place = Annotated[tuple[Number, ...], Field(max_length=2), LISTED, unit("m")]


class PointLoad(SceneModel):
    """One table of [[loads.at]]: a force and a moment at a place of the structure.

    Attributes:
        x: along a beam (m), or [x, y] on a plate.
        force: force there (N), or None.
        moment: moment there (N·m), of beams only, or None.
        kind: "dead" or "follower", of both where they do not say it themselves.
    """

    x: Place
    force: LoadTable | None = None
    moment: MomentTable | None = None
    kind: Literal["dead", "follower"] = "dead"


class UnbalanceTable(SceneModel):
    """One table of [[loads.unbalance]]: a mass off the axis of a shaft, as mass times distance or as a grade.

    Attributes:
        x: place along the shaft (m).
        kg_m: mass times its distance from the axis (kg·m), or None.
        phase: its angle in the section, from direction 2 towards direction 3 (rad).
        grade: balance quality G of ISO 21940-11 (mm/s), as 6.3, instead of kg_m: distance times service speed.
        mass: that the grade is of (kg).
        speed: service speed of the grade (rad/s).
        start: time after which it pushes (s), as after the loss of a blade.
    """

    x: Annotated[Number, unit("m")]
    kg_m: Annotated[Number, unit("kg*m")] | None = None
    phase: Annotated[Number, unit("rad")] = 0.0
    grade: Annotated[Positive, unit("mm/s")] | None = None
    mass: Annotated[Positive, unit("kg")] | None = None
    speed: Annotated[Positive, unit("rad/s")] | None = None
    start: Annotated[Number, unit("s")] = 0.0

    def _check(self) -> None:
        of_grade = (self.grade, self.mass, self.speed)
        if (self.kg_m is None) == (None in of_grade) or (self.kg_m is not None and any(of_grade)):
            raise problem("kg_m", self.kg_m, "give kg_m, or grade, mass and speed")

    @property
    def moment(self) -> float:
        """Mass times distance, kg·m."""
        if self.grade is None or self.mass is None or self.speed is None:
            return self.kg_m or 0.0
        return self.mass * 1e-3 * self.grade / self.speed


class LoadsTable(SceneModel):
    """The [loads] table.

    Attributes:
        gravity: acceleration (m/s²) in inertial axes, which coincide with the frame's at ψ = 0.
        tip_force: force at the free end (N), or None.
        tip_moment: moment at the free end (N·m), or None.
        distributed: force per length (N/m), for a plate per area (N/m²), or None.
        distributed_moment: moment per length of a beam (N), or None.
        pressure: on a plate (N/m²), or None.
        at: forces and moments at places of the structure.
        unbalance: masses off the axis of a shaft.
    """

    gravity: Annotated[PaddedVector, unit("m/s**2")] = (0.0, 0.0, 0.0)
    tip_force: LoadTable | None = None
    tip_moment: MomentTable | None = None
    distributed: SpanLoad | None = None
    distributed_moment: SpanMoment | None = None
    pressure: Pressure | None = None
    at: tuple[PointLoad, ...] = ()
    unbalance: tuple[UnbalanceTable, ...] = ()

    def named(self) -> Iterator[tuple[str, LoadTable, str]]:
        """Yield name, load and kind of all that are given: "tip_force", …, "at.0.force", "at.0.moment"."""
        for name in type(self).model_fields:
            if isinstance(load := getattr(self, name), LoadTable):
                yield name, load, load.kind
        for i, point in enumerate(self.at):
            for name, load in (("force", point.force), ("moment", point.moment)):
                if load is not None:
                    yield f"at.{i}.{name}", load, load.kind if "kind" in load.model_fields_set else point.kind


# --- checks against what the loads work on ------------------------------------------------------------------------


def check_loads(structure: Any, motion: Any, loads: LoadsTable) -> None:
    """Refuse loads that the structure cannot bear, and what a free hub does not have."""
    for i, point in enumerate(loads.at):
        check_place(f"loads.at.{i}.x", structure, point.x)
    for i, mass in enumerate(loads.unbalance):
        if not getattr(structure, "is_straight", False) or any(motion.axis[1:]):
            raise problem(f"loads.unbalance.{i}", None, "needs a straight spatial_beam that spins about its axis")
        check_place(f"loads.unbalance.{i}.x", structure, (mass.x,))
    if loads.pressure is not None and structure.type != "plate":
        raise problem("loads.pressure", None, f"needs a plate; on a {structure.type} give loads.distributed")
    for name, load, _ in loads.named():
        key, vectors = f"loads.{name}", list(load.vectors)
        if name.endswith("moment"):
            _check_moment(key, structure, load)
        elif structure.is_planar:
            check_in_plane(key, vectors)
        for x in (x for x, _ in vectors if x is not None):
            check_on_span(f"{key}.{load.given[0]}", x, structure.length)
        per_rev = next((h.per_rev for h in load.harmonic if h.per_rev is not None), None)
        if motion.is_free and per_rev is not None:
            why = 'needs an angle of the hub that is prescribed, not motion.type = "torque"; give frequency'
            raise problem(f"{key}.harmonic.per_rev", per_rev, why)
    known = structure.regions if structure.type == "plate" else ()
    for name in () if loads.pressure is None else loads.pressure.regions or ():
        if name not in known:
            has = f"there are {', '.join(known)}" if known else "nothing of structure is by region"
            raise problem(f"loads.pressure.regions.{name}", None, f"is no region of the plate; {has}")


def check_in_plane(key: str, vectors: Iterable[tuple[float | None, tuple[float, ...]]]) -> None:
    """Refuse what would move a planar beam out of its plane."""
    if any(len(vector) > 2 and vector[2] != 0.0 for _, vector in vectors):
        raise problem(key, None, "the third component must be 0 for a planar_beam")


def _check_moment(key: str, structure: Any, moment: LoadTable) -> None:
    if structure.type == "plate" and key != "loads.tip_moment":
        why = "is not available on a plate; give loads.tip_moment, which is spread over the edge"
        if not isinstance(moment, SpanMoment):
            why = "is not available on a plate: at a point it turns the director without limit as the mesh is refined"
        raise problem(key, None, why)
    # A function is checked where it is called; its moment of a planar beam may have one component or three.
    sizes, size = {len(vector) for _, vector in moment.vectors}, 1 if structure.is_planar else 3
    if sizes - {size}:
        count = "one component, about axis 3," if structure.is_planar else "three components"
        raise problem(key, None, f"must have {count} for a {structure.type}")


def check_place(key: str, structure: Any, x: tuple[float, ...]) -> None:
    """Refuse a place that is not on the structure; one on a plate that is a mesh is looked for later."""
    if len(x) != (2 if structure.type == "plate" else 1):
        allowed = "[x, y], m, for a plate" if structure.type == "plate" else f"a number, m, for a {structure.type}"
        raise problem(key, list(x), f"must be {allowed}")
    check_on_span(key, x[0], structure.length)
