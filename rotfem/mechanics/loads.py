"""Applied loads: f(x, t) = Σ_k a_k(t) s_k(x), shapes over the structure times amplitudes over time.

A value, a table over the span and a harmonic have one shape, a table over time one for every component, a table over
span and time one for every station and component. A linear theory assembles one piece for every shape. A function of
place and time is evaluated at the nodes of the mesh (`PlaceLoad`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from rotfem.mechanics.bodies import Moved
from rotfem.mechanics.pitch import Pitch
from rotfem.short import short_fields
from rotfem.users_functions import checked

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Shapes:
    """Shapes with common stations: linear between them, zero outside.

    Attributes:
        values: of the shapes at the stations, (shapes, stations, components); (shapes, 1, components) without stations.
        x: stations along the span (m), increasing; twice the same is a jump. None: uniform.
        region: name of the region of the mesh where they act; "" everywhere.
    """

    values: Array
    x: Array | None = None
    region: str = ""

    @classmethod
    def uniform(cls, vectors: npt.ArrayLike) -> Shapes:
        """Return the shapes that are these vectors (shapes, components) everywhere."""
        return cls(np.asarray(vectors, dtype=float)[:, None, :])

    @classmethod
    def along_span(cls, rows: npt.ArrayLike) -> Shapes:
        """Return one shape from rows (x, components)."""
        table = np.asarray(rows, dtype=float)
        return cls(table[None, :, 1:], table[:, 0])

    @property
    def is_uniform(self) -> bool:
        """Whether they are the same everywhere."""
        return self.x is None and not self.region

    def along(self, x: Array, towards: Array) -> Array:
        """Return the shapes at places (n,), (shapes, n, components)."""
        if self.x is None:
            return np.repeat(self.values, len(x), axis=1)
        side = x + 1e-6 * (towards - x)
        i = np.searchsorted(self.x, side, side="right") - 1
        there = (i >= 0) & (side <= self.x[-1])
        i = np.clip(i, 0, len(self.x) - 2)
        share = (x - self.x[i]) / np.where(self.x[i + 1] > self.x[i], self.x[i + 1] - self.x[i], 1.0)
        share = np.where(there, share, 0.0)[:, None]
        found = (1.0 - share) * self.values[:, i] + share * self.values[:, i + 1]
        return np.where(there[:, None], found, 0.0)


@dataclass(frozen=True)
class Term:
    """Σ_k a_k(t) s_k(x).

    Attributes:
        shapes: s_k.
        amplitudes: times (n,) ↦ a_k, shape (n, k); None where all are 1 at all times.
        knots: known times (s) between which they are smooth.
        linear: whether they are linear between knots.
        largest: largest absolute value of each; None where unknown, or where all are 1.
        phase: of a harmonic (rad); else None.
    """

    shapes: Shapes
    amplitudes: Callable[[Array], Array] | None = None
    knots: tuple[float, ...] = ()
    linear: bool = True
    largest: Array | None = None
    phase: float | None = None

    @classmethod
    def table(cls, rows: npt.ArrayLike, shapes: Shapes) -> Term:
        """Return the term with amplitudes by rows (t, a…), linear between them and constant outside."""
        table = np.asarray(rows, dtype=float)
        t, values = np.ascontiguousarray(table[:, 0]), np.ascontiguousarray(table[:, 1:])
        if not np.any(np.ptp(values, axis=0)):
            return cls(replace(shapes, values=np.einsum("k,ksc->sc", values[0], shapes.values)[None]))
        lengths = np.where(np.diff(t) > 0.0, np.diff(t), 1.0)

        def amplitudes(s: Array) -> Array:
            i = np.clip(np.searchsorted(t, s, side="right") - 1, 0, len(lengths) - 1)
            share = np.clip((s - t[i]) / lengths[i], 0.0, 1.0)[:, None]
            return np.asarray((1.0 - share) * values[i] + share * values[i + 1])

        return cls(shapes, amplitudes, tuple(t), largest=np.abs(values).max(axis=0))

    @classmethod
    def both(cls, rows: npt.ArrayLike) -> Term:
        """Return the term of rows (x, t, components), every x with every t: a shape for every station and component."""
        table = np.asarray(rows, dtype=float)
        x, t = np.unique(table[:, 0]), np.unique(table[:, 1])
        values = table[np.lexsort((table[:, 1], table[:, 0])), 2:].reshape(len(x), len(t), -1).transpose(1, 0, 2)
        n = values.shape[2]
        hats, amplitudes = np.eye(len(x) * n).reshape(-1, len(x), n), values.reshape(len(t), -1)
        there = np.flatnonzero(np.any(amplitudes != 0.0, axis=0))
        there = there if len(there) else np.arange(1)
        return cls.table(np.column_stack([t, amplitudes[:, there]]), Shapes(hats[there], x))

    def at(self, t: Array) -> Array:
        """Return the amplitudes at times (n,), shape (n, k)."""
        return np.ones((len(t), len(self.shapes.values))) if self.amplitudes is None else self.amplitudes(t)

    def sizes(self) -> Array | None:
        """Return an upper bound of the size of each component at all times and places; None if there is none."""
        most = np.abs(self.shapes.values).max(axis=1)
        largest = np.ones(len(most)) if self.amplitudes is None else self.largest
        return None if largest is None else largest @ most


@dataclass(frozen=True)
class Load:
    """A force or moment, or a density of one: a sum of terms.

    Attributes:
        kind: "dead" keeps its direction in the frame, "follower" turns with the section.
        terms: of the sum.
        seen: time (s) ↦ amplitudes as a march evaluates them (`rotfem.mechanics.time_signals`); None for their values.
        unpitched: the load in the frame of the hub, if this one is in that of a pitching blade.
    """

    kind: str = "dead"
    terms: tuple[Term, ...] = ()
    seen: Callable[[float], Array] | None = None
    unpitched: Load | None = None

    @cached_property
    def is_uniform(self) -> bool:
        """Whether it is uniform; its amplitudes are then its components."""
        return all(term.shapes.is_uniform for term in self.terms)

    @cached_property
    def is_zero(self) -> bool:
        """Whether it is zero at all times and places."""
        sizes = self.sizes()
        return sizes is not None and not np.any(sizes)

    @cached_property
    def constant(self) -> bool:
        """Whether it does not change with time."""
        return all(term.amplitudes is None for term in self.terms)

    @cached_property
    def knots(self) -> tuple[float, ...]:
        """Times (s) between which it is smooth, as far as they are known."""
        return tuple(sorted({t for term in self.terms for t in term.knots}))

    @cached_property
    def linear(self) -> bool:
        """Whether it is linear between its knots."""
        return all(term.linear for term in self.terms)

    def many(self, t: Array) -> Array:
        """Return the components of a uniform load, else all amplitudes, at times (n,), shape (n, components)."""
        if self.is_uniform:
            return np.asarray(sum(term.at(t) @ term.shapes.values[:, 0] for term in self.terms))
        return np.concatenate([term.at(t) for term in self.terms], axis=1)

    def at(self, t: float) -> Array:
        """Return the same at time t (s)."""
        return self.seen(t) if self.seen is not None else np.asarray(self.many(np.array([t]))[0])

    def sizes(self) -> Array | None:
        """Return an upper bound of the size of each component at all times and places; None if there is none."""
        parts = [size for term in self.terms if (size := term.sizes()) is not None]
        return np.sum(parts, axis=0) if len(parts) == len(self.terms) else None


@dataclass(frozen=True, kw_only=True)
class PlaceLoad(Load):
    """A load that is a function of place and time, without terms; its components at places are its amplitudes.

    Attributes:
        function: (place, t) ↦ components (components,); place is x (m) along a beam, (x, y) on a plate.
        probes: places at which it is sampled to find its knots.
        constant: whether it does not change with time.
        knots: times (s) between which it is smooth, as far as they are known.
    """

    function: Callable[[Any, float], Array]
    probes: tuple[Any, ...]
    constant: bool
    knots: tuple[float, ...] = ()
    is_zero = is_uniform = linear = False

    def on(self, places: tuple[Any, ...], t: float) -> Array:
        """Return the components at places, one after the other."""
        return np.concatenate([self.function(place, t) for place in places])

    def many(self, t: Array) -> Array:
        """Return the components at the probes, one after the other, at times (n,), shape (n, components)."""
        return np.array([self.on(self.probes, float(s)) for s in t])

    def sizes(self) -> None:
        """Return None: no bound is known."""
        return


@dataclass(frozen=True)
class Loads:
    """Gravity and the loads on a structure as sums of terms; none by default.

    Attributes:
        gravity: acceleration, m/s², inertial axes.
        named: name ↦ load of all that are given, zero ones too: "tip_force", …, "at.0.force", "at.0.moment".
        places: of the loads "at.0", "at.1", …: (x,) along a beam (m), or (x, y) on a plate.
        unbalance: tables of unbalances (`rotfem.mechanics.unbalance`).
    """

    gravity: tuple[float, ...] = (0.0, 0.0, 0.0)
    named: Mapping[str, Load] = field(default_factory=dict)
    places: tuple[tuple[float, ...], ...] = ()
    unbalance: tuple[Any, ...] = ()
    __repr__ = short_fields

    @classmethod
    def of(cls, given: Any, structure: Any, angle: Callable[[float], float]) -> Loads:
        """Return the loads that a scene or a script gives, as sums."""
        named = {name: load_of(f"loads.{name}", load, structure, angle, kind) for name, load, kind in given.named()}
        return cls(given.gravity, named, tuple(point.x for point in given.at), given.unbalance)

    @property
    def tables(self) -> list[Array]:
        """Stations (m) of all shapes over the span."""
        terms = (term for load in self.named.values() for term in load.terms)
        return [term.shapes.x for term in terms if term.shapes.x is not None]

    @property
    def stations(self) -> set[float]:
        """Places along the structure (m) of kinks, jumps and point loads."""
        return {float(x) for table in self.tables for x in table} | self.jumps

    @property
    def jumps(self) -> set[float]:
        """Places along the structure (m) of point loads, of double stations, and of the first and last."""
        ends = {float(v) for x in self.tables for v in (x[0], *x[1:][np.diff(x) == 0.0], x[-1])}
        return ends | {place[0] for place in self.places if len(place) == 1}

    def replaced(self, changed: Mapping[str, Load]) -> Loads:
        """Return the loads with some of them replaced, by name."""
        return replace(self, named={**self.named, **changed})

    def pitched(self, pitch: Pitch | None) -> Loads:
        """Return the loads in the frame of a blade that pitches; the same without a pitch over time.

        Dead loads keep their direction in the frame of the hub. With φ, e of `rotfem.mechanics.pitch` a vector f of it
        is

            Rᵀ f = e (e·f) + cos φ (f − e (e·f)) − sin φ e×f

        in that of the blade: three linear maps of the shapes with the amplitudes 1, cos φ and −sin φ. Followers turn
        with the blade.
        """
        if pitch is None:
            return self
        dead = {name: load for name, load in self.named.items() if load.kind == "dead" and not load.is_zero}
        return self.replaced({name: _in_blade(load, pitch) for name, load in dead.items()})


def load_of(key: str, given: Any, structure: Any, angle: Callable[[float], float], kind: str = "dead") -> Load:
    """Return one load, or another signal."""
    planar = structure.is_planar
    size = 1 if key == "loads.pressure" or (planar and is_moment(key)) else 3
    name, value = given.given
    timed = name.endswith("time")
    if "span" in name and callable(value):
        function = checked(value, key, size, "place and time" if timed else "place", planar)
        at = function if timed else (lambda x, t: function(x))
        # Places along the structure, of a plate from a file one, that show how the load changes with time.
        probes = np.linspace(0.0, structure.length, 9) if structure.length is not None else np.zeros(1)
        places = tuple((float(x), 0.0) if structure.type == "plate" else float(x) for x in probes)
        return PlaceLoad(kind=kind, function=at, probes=places, constant=not timed)
    terms = [_harmonic(harmonic, angle) for harmonic in getattr(given, "harmonic", ())]
    terms += [_gust(gust) for gust in getattr(given, "gust", ())]
    if callable(value):
        of_time = checked(value, key, size, "time", planar)
        each = Shapes.uniform(np.eye(size))
        terms.append(Term(each, lambda t: np.array([of_time(float(s)) for s in t]), linear=False))
    elif name == "over_time":
        terms.append(Term.table(value, Shapes.uniform(np.eye(len(value[0]) - 1))))
    elif "span" in name:
        terms.append(Term.both(value) if timed else Term(Shapes.along_span(value)))
    elif isinstance(value, dict):
        terms += [Term(Shapes(np.array([[[p]]]), region=region)) for region, p in value.items()]
    elif value is not None:
        terms.append(Term(Shapes.uniform([value])))
    return Load(kind, tuple(terms))


def _harmonic(given: Any, angle: Callable[[float], float]) -> Term:
    """Return one shape with the amplitude cos(α(t) + phase), α = ω t or per_rev · ψ(t)."""
    rate = given.frequency or given.per_rev or 0.0

    def at(t: Array) -> Array:
        turned = t if given.per_rev is None else np.array([angle(float(s)) for s in t])
        return np.asarray(np.cos(rate * turned + given.phase)[:, None])

    return Term(_shapes(given.amplitude), at, linear=False, largest=np.ones(1), phase=given.phase)


def _gust(given: Any) -> Term:
    """Return one shape with the amplitude ½ (1 − cos(2π (t − start)/duration)) while the gust lasts."""

    def at(t: Array) -> Array:
        part = np.clip((t - given.start) / given.duration, 0.0, 1.0)
        return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * part))[:, None]

    ends = (given.start, given.start + given.duration)
    return Term(_shapes(given.amplitude), at, ends, linear=False, largest=np.ones(1))


def _shapes(amplitude: Any) -> Shapes:
    return Shapes.along_span(amplitude) if isinstance(amplitude[0], tuple) else Shapes.uniform([amplitude])


def is_moment(name: str) -> bool:
    """Return whether a named load is a moment."""
    return name.endswith("moment")


def _in_blade(load: Load, pitch: Pitch) -> Load:
    knots = tuple(sorted({*load.knots, *pitch.knots}))
    if isinstance(load, PlaceLoad):
        given = load.function

        def function(place: Any, t: float) -> Array:
            return np.asarray(given(place, t) @ pitch.rotation(t))

        return replace(load, function=function, constant=False, knots=knots, unpitched=load)
    return Load("dead", tuple(new for term in load.terms for new in _turned(term, pitch, knots)), unpitched=load)


def _turned(term: Term, pitch: Pitch, knots: tuple[float, ...]) -> Iterator[Term]:
    e = pitch.axis
    along = np.outer(e, e)
    maps = (along, np.eye(3) - along, np.cross(e, np.eye(3)).T)
    factors: tuple[Callable[[Array], Array] | None, ...] = (None, np.cos, lambda phi: -np.sin(phi))
    for matrix, factor in zip(maps, factors, strict=True):
        shapes = replace(term.shapes, values=term.shapes.values @ matrix.T)
        if factor is None:
            yield replace(term, shapes=shapes, phase=None)
            continue

        def amplitudes(t: Array, factor: Callable[[Array], Array] = factor) -> Array:
            return factor(np.array([pitch.turned(float(s)) for s in t]))[:, None] * term.at(t)

        largest = np.ones(len(shapes.values)) if term.amplitudes is None else term.largest
        yield Term(shapes, amplitudes, knots, linear=False, largest=largest)


# --- in the forms -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class AppliedLoad(Moved):
    """A force (or moment) on a position (or angle) x(q).

    Attributes:
        name: name of its amplitude constant.
        force: vector (or scalar), N, N/m or N·m.
        x: what it works on, an expression of q.
        measure: UFL measure.
        dead: whether its direction does not depend on q.
    """

    name: str
    force: Any
    x: Any
    measure: Any
    dead: bool = True
    #: Whether −force·x is a potential of it, where it is dead.
    conservative: ClassVar[bool] = True
