"""The loads of a scene as a problem has them: tables over the span, harmonics and functions made into parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.mechanics.composed_loads import ComposedLoad, LoadOfPlace, Part
from rotfem.mechanics.courses import TINY
from rotfem.mechanics.loads import Load, Loads, PointLoads, named
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.span import FunctionOfPlace, Shapes
from rotfem.scene import Scene

Array = npt.NDArray[np.float64]

#: Places along the structure at which a function of the place is looked at.
PROBES = 9


def loads_of(scene: Scene, motion: Motion, maker: type[LoadsMaker] | None = None) -> Loads:
    """Return the loads of a scene, under a motion that says how its hub turns, by another maker than the usual one."""
    given = scene.loads
    made = (maker or LoadsMaker)(scene.structure, motion)
    points = []
    for i, point in enumerate(given.at):
        pair = {name: getattr(point, name) for name in ("force", "moment")}
        kinds = {n: p.kind if p is not None and "kind" in p.model_fields_set else point.kind for n, p in pair.items()}
        both = {n: made.load(f"at.{i}.{n}", load, kinds[n]) for n, load in pair.items()}
        points.append(PointLoads(point.x, **both))
    names = ("tip_force", "tip_moment", "distributed", "pressure")
    whole: dict[str, Any] = {name: made.load(name, getattr(given, name)) for name in names}
    return Loads(gravity=given.gravity, at=tuple(points), **whole)


def held(problem: Problem) -> list[str]:
    """Return a warning where what is computed at one time, as modes are, takes pitch and loads for those of t = 0."""
    given = {name: getattr(load, "unpitched", load) for name, load in named(problem.loads).items()}
    names = [f"loads.{name}" for name, load in given.items() if not (load.constant or load.is_zero)]
    said = [f"{', '.join(names)} {'change' if len(names) > 1 else 'changes'} with time: taken as at t = 0"]
    return [*held_pitch(problem), *(said if names else [])]


def held_pitch(problem: Problem) -> list[str]:
    """Return the same of the pitch."""
    pitches = problem.motion.pitch is not None
    return ["structure.root.pitch changes with time: taken as at t = 0"] if pitches else []


#: Times at which swept loads are without what is harmonic, with its part in phase, and with that ahead by a quarter.
SWEPT = (0.0, 1.0, 2.0)


def swept_loads(scene: Scene, motion: Motion) -> Loads:
    """Return the loads of a scene whose harmonic parts at the times SWEPT are 0, cos φ and sin φ times their amplitude.

    So a load Re(f̂ e^{iωt}) of any frequency, f̂ = amplitude e^{iφ}, can be put together.

    Raises:
        InputError: there is no harmonic load, or one that changes with time in another way.
    """
    made = loads_of(scene, motion, SweptLoadsMaker)
    swept = named(made)
    if not any(isinstance(part, SweptPart) for load in swept.values() for part in getattr(load, "parts", ())):
        why = "a frequency response needs a harmonic load, such as loads.tip_force.harmonic = "
        raise InputError("loads", None, why + "{ amplitude = [0, 1], frequency = 1 }; its frequency is swept")
    for name, load in swept.items():
        parts = getattr(load, "parts", None)
        still = load.constant if parts is None else all(p.amplitudes is None or isinstance(p, SweptPart) for p in parts)
        if not still:
            raise InputError(f"loads.{name}", None, "must be constant or harmonic in a frequency response")
    return made


class LoadsMaker:
    """Makes loads of those of a scene.

    Args:
        structure: of the scene.
        motion: of the hub.
    """

    def __init__(self, structure: Any, motion: Motion):
        self.structure, self.motion = structure, motion
        self.plate, self.planar = structure.type == "plate", structure.is_planar

    def load(self, name: str, given: Any, kind: str | None = None) -> Load | None:
        """Return a load: that of the scene itself where it is a value or a table over time, else one with parts.

        Args:
            name: key in [loads].
            given: what the scene has there, or None.
            kind: "dead" or "follower"; that of the load if None.
        """
        if given is None:
            return None
        turns: Any = kind or given.kind
        size = getattr(given, "SIZE", 1 if self.structure.is_planar and name.endswith("moment") else 3)
        place = getattr(given, "place_function", None)
        if place is not None:
            timed = given.over_span_and_time is not None
            of = "place and time" if timed else "place"
            function = checked(place, f"loads.{name}", size, of, self.planar)
            at = function if timed else (lambda x, t: function(x))
            span = FunctionOfPlace(at, self.plate)
            return LoadOfPlace(turns, span, self._probes(), constant=not timed)
        if not (given.harmonic or given.varies_over_span) and given.time_function is None and turns == given.kind:
            simple: Load = given
            return simple
        return ComposedLoad(turns, tuple(self._parts(f"loads.{name}", given, size)))

    def _parts(self, key: str, given: Any, size: int) -> list[Part]:
        """Return the parts of a load that is no function of the place."""
        parts = [self._harmonic(h) for h in given.harmonic]
        if given.value is not None:
            parts.append(Part(uniform([given.value])))
        elif given.time_function is not None:
            function = checked(given.time_function, key, size, "time", self.planar)
            each = uniform(np.eye(size))
            parts.append(Part(each, lambda t: np.array([function(float(s)) for s in t]), linear=False))
        elif given.time_table is not None:
            parts.append(Part.table(given.time_table, uniform(np.eye(len(given.time_table[0]) - 1))))
        elif getattr(given, "regions", None) is not None:
            parts += [Part(Shapes(None, np.array([[[p]]]), name)) for name, p in given.regions.items()]
        elif getattr(given, "over_span", None) is not None:
            parts.append(Part(along(given.over_span)))
        elif getattr(given, "over_span_and_time", None) is not None:
            parts.append(over_both(given.over_span_and_time))
        return parts

    def _harmonic(self, harmonic: Any) -> Part:
        shapes, phase, per_rev = shapes_of(harmonic), harmonic.phase, harmonic.per_rev
        if per_rev is None:
            return Part.harmonic(shapes, lambda t: harmonic.frequency * t + phase)
        angle = self.motion.angle
        return Part.harmonic(shapes, lambda t: per_rev * np.array([angle(float(s)) for s in t]) + phase)

    def _probes(self) -> Array:
        """Return points along the structure, shape (n, 3); of a plate from a file one point."""
        length = self.structure.length
        x = np.linspace(0.0, length, PROBES) if length is not None else np.zeros(1)
        return np.column_stack([x, np.zeros((len(x), 2))])


class SweptPart(Part):
    """A harmonic part whose frequency is swept."""


class SweptLoadsMaker(LoadsMaker):
    """Makes loads whose harmonic parts are swept (see `swept_loads`)."""

    def _harmonic(self, harmonic: Any) -> Part:
        shapes, phase = shapes_of(harmonic), harmonic.phase
        factors = np.array([0.0, np.cos(phase), np.sin(phase)])

        def amplitudes(t: Array) -> Array:
            return np.asarray(factors[np.searchsorted(SWEPT, t)][:, None])

        return SweptPart(shapes, amplitudes, linear=False, largest=np.ones(1))


def shapes_of(harmonic: Any) -> Shapes:
    """Return how the amplitude of a harmonic load is spread."""
    amplitude = harmonic.amplitude
    return along(amplitude) if isinstance(amplitude[0], tuple) else uniform([amplitude])


def uniform(vectors: Any) -> Shapes:
    """Return the shapes that are these vectors everywhere."""
    return Shapes(None, np.array(vectors, dtype=float)[:, None, :])


def along(rows: Any) -> Shapes:
    """Return one shape from rows (x, components)."""
    table = np.array(rows, dtype=float)
    return Shapes(table[:, 0], table[None, :, 1:])


def over_both(rows: Any) -> Part:
    """Return the part of rows (x, t, components) in the order of x, then t: a shape for every station and component.

    Those that are zero at all times are left out.
    """
    table = np.array(rows, dtype=float)
    x, t = np.unique(table[:, 0]), np.unique(table[:, 1])
    values = table[:, 2:].reshape(len(x), len(t), -1).transpose(1, 0, 2)  # (t, x, component)
    n = values.shape[2]
    hats = np.eye(len(x) * n).reshape(-1, len(x), n)
    amplitudes = values.reshape(len(t), -1)
    there = np.flatnonzero(np.any(amplitudes != 0.0, axis=0))
    there = there if len(there) else np.arange(1)
    return Part.table(np.column_stack([t, amplitudes[:, there]]), Shapes(x, hats[there]))


def checked(function: Callable[..., Any], key: str, size: int, of: str, planar: bool = False) -> Callable[..., Array]:
    """Return a user's function that returns an array (size,), and refuses to return anything else.

    Two components get a third one, zero, where there are three.

    Args:
        function: of place, time or both.
        key: key of the scene, for errors.
        size: number of components.
        of: what it is a function of, in words.
        planar: whether the third of three components must be zero.

    Returns:
        The function; it raises an InputError that says at what arguments the other one failed, and how.
    """

    def at(*arguments: Any) -> Array:
        where = f"the function of {of}, at {', '.join(map(_shown, arguments))},"
        try:
            value: Array = np.asarray(function(*arguments), dtype=np.float64).ravel()
        except (TypeError, ValueError) as error:
            raise InputError(key, None, f"{where} must return {size} numbers: {error}") from error
        except Exception as error:
            raise InputError(key, None, f"{where} raised {type(error).__name__}: {error}") from error
        if value.size == 2 and size == 3:
            value = np.append(value, 0.0)
        if value.size == 3 and size == 1 and not np.any(value[:2]):  # a moment about axis 3
            value = value[2:]
        if value.size != size:
            raise InputError(key, None, f"{where} returned so many numbers: {value.size}; must be {size}")
        if not np.all(np.isfinite(value)):
            raise InputError(key, None, f"{where} returned {value}; must return finite numbers")
        if planar and size == 3 and value[2] != 0.0:
            raise InputError(key, None, f"{where} returned {value}; the third component must be 0 for a planar_beam")
        return value

    return at


def _shown(argument: Any) -> str:
    """Return an argument of a function as errors show it."""
    if isinstance(argument, tuple):
        return f"({', '.join(map(_shown, argument))})"
    if isinstance(argument, Mapping):
        return "{" + ", ".join(f"{name}: {_shown(value)}" for name, value in argument.items()) + "}"
    return f"{argument if abs(argument) > TINY else 0.0:g}"
