"""The loads of a scene as sums of shapes times amplitudes (see `rotfem.mechanics.loads`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.analysis.equilibrium import gravity_turns
from rotfem.errors import InputError
from rotfem.mechanics.loads import WHOLE, AnyLoad, Load, Loads, PlaceLoad, PointLoads, Shapes, Term, named, replaced
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.mechanics.time_signals import TINY
from rotfem.scene import Scene

Array = npt.NDArray[np.float64]

#: Places along the structure at which a function of the place is sampled to see how it changes with time.
PROBES = 9


def loads_of(scene: Scene, motion: Motion) -> Loads:
    """Return the loads of a scene, under a motion that says how its hub turns."""
    given, structure = scene.loads, scene.structure
    points = []
    for i, point in enumerate(given.at):
        made = {
            name: load_of(f"at.{i}.{name}", load, structure, motion, point.kind_of(load))
            for name, load in (("force", point.force), ("moment", point.moment))
            if load is not None
        }
        points.append(PointLoads(point.x, **made))
    whole: dict[str, Any] = {name: load for name in WHOLE if (load := getattr(given, name)) is not None}
    made = {name: load_of(name, load, structure, motion, load.kind) for name, load in whole.items()}
    return Loads(gravity=given.gravity, at=tuple(points), **made)


def load_of(name: str, given: Any, structure: Any, motion: Motion, kind: str) -> AnyLoad:
    """Return one load.

    Args:
        name: key in [loads].
        given: what the scene has there.
        structure: of the scene.
        motion: of the hub.
        kind: "dead" or "follower".
    """
    key, planar = f"loads.{name}", structure.is_planar
    size = 1 if name == "pressure" or (planar and name.endswith("moment")) else 3
    if (place := given.place_function) is not None:
        timed = given.over_span_and_time is not None
        function = checked(place, key, size, "place and time" if timed else "place", planar)
        at = function if timed else (lambda x, t: function(x))
        return PlaceLoad(kind, at, _probes(structure), constant=not timed)
    terms = [_harmonic(harmonic, motion) for harmonic in given.harmonic]
    if given.value is not None:
        terms.append(Term(Shapes.uniform([given.value])))
    elif given.time_function is not None:
        of_time = checked(given.time_function, key, size, "time", planar)
        each = Shapes.uniform(np.eye(size))
        terms.append(Term(each, lambda t: np.array([of_time(float(s)) for s in t]), linear=False))
    elif (rows := given.time_table) is not None:
        terms.append(Term.table(rows, Shapes.uniform(np.eye(len(rows[0]) - 1))))
    elif getattr(given, "over_span", None) is not None:
        terms.append(Term(Shapes.along_span(given.over_span)))
    elif getattr(given, "over_span_and_time", None) is not None:
        terms.append(Term.both(given.over_span_and_time))
    elif getattr(given, "regions", None) is not None:
        terms += [Term(Shapes(np.array([[[p]]]), region=region)) for region, p in given.regions.items()]
    return Load(kind, tuple(terms))


def _harmonic(harmonic: Any, motion: Motion) -> Term:
    amplitude, per_rev = harmonic.amplitude, harmonic.per_rev
    shapes = Shapes.along_span(amplitude) if isinstance(amplitude[0], tuple) else Shapes.uniform([amplitude])
    if per_rev is None:
        return Term.harmonic(shapes, lambda t: harmonic.frequency * t, harmonic.phase)
    return Term.harmonic(shapes, lambda t: per_rev * np.array([motion.angle(float(s)) for s in t]), harmonic.phase)


def _probes(structure: Any) -> tuple[Any, ...]:
    """Return places along the structure; of a plate from a file one."""
    length = structure.length
    x = np.linspace(0.0, length, PROBES) if length is not None else np.zeros(1)
    return tuple((float(s), 0.0) if structure.type == "plate" else float(s) for s in x)


def frozen_inputs(problem: Problem) -> list[str]:
    """Return warnings where what is computed at one time, as modes are, has pitch, gravity and loads as at t = 0."""
    given = {name: load.unpitched or load for name, load in named(problem.loads).items()}
    names = [f"loads.{name}" for name, load in given.items() if not (load.constant or load.is_zero)]
    said = [f"{', '.join(names)} {'change' if len(names) > 1 else 'changes'} with time: taken as at t = 0"]
    return [*frozen_in_frame(problem), *(said if names else [])]


def frozen_in_frame(problem: Problem) -> list[str]:
    """Return the same of pitch and gravity."""
    found = {
        "structure.root.pitch changes with time": problem.motion.pitch is not None,
        "loads.gravity turns in the rotating frame": gravity_turns(problem),
    }
    return [f"{what}: taken as at t = 0" for what, there in found.items() if there]


#: Times at which swept loads are without what is harmonic, with its part in phase, and with that ahead by a quarter.
SWEPT = (0.0, 1.0, 2.0)


def swept_loads(scene: Scene, motion: Motion) -> Loads:
    """Return the loads of a scene whose harmonic parts at the times SWEPT are 0, cos φ and sin φ times their amplitude.

    So a load Re(f̂ e^{iωt}) of any frequency, f̂ = amplitude e^{iφ}, can be put together.

    Raises:
        InputError: there is no harmonic load, or one that changes with time in another way.
    """
    made = loads_of(scene, motion)
    changing = {name: load for name, load in named(made).items() if not load.constant}
    if not any(term.phase is not None for load in changing.values() for term in getattr(load, "terms", ())):
        why = "a frequency response needs a harmonic load, such as loads.tip_force.harmonic = "
        raise InputError("loads", None, why + "{ amplitude = [0, 1], frequency = 1 }; its frequency is swept")
    swept: dict[str, AnyLoad] = {}
    for name, load in changing.items():
        if isinstance(load, PlaceLoad) or any(t.amplitudes is not None and t.phase is None for t in load.terms):
            raise InputError(f"loads.{name}", None, "must be constant or harmonic in a frequency response")
        swept[name] = replace(load, terms=tuple(map(_swept, load.terms)))
    return replaced(made, swept)


def _swept(term: Term) -> Term:
    if term.phase is None:
        return term
    factors = np.array([0.0, np.cos(term.phase), np.sin(term.phase)])
    return replace(term, amplitudes=lambda t: np.asarray(factors[np.searchsorted(SWEPT, t)][:, None]))


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

    def refused(arguments: tuple[Any, ...], why: str) -> InputError:
        return InputError(key, None, f"the function of {of}, at {', '.join(map(_shown, arguments))}, {why}")

    def at(*arguments: Any) -> Array:
        try:
            given = function(*arguments)
            value: Array = np.array(given, dtype=np.float64, ndmin=1).ravel()
        except (TypeError, ValueError) as error:
            raise refused(arguments, f"must return {size} numbers: {error}") from error
        except Exception as error:
            raise refused(arguments, f"raised {type(error).__name__}: {error}") from error
        if value.size == 2 and size == 3:
            value = np.array([value[0], value[1], 0.0])
        if value.size == 3 and size == 1 and not np.any(value[:2]):  # a moment about axis 3
            value = value[2:]
        if value.size != size:
            raise refused(arguments, f"returned so many numbers: {value.size}; must be {size}")
        if not all(map(math.isfinite, value)):
            raise refused(arguments, f"returned {value}; must return finite numbers")
        if planar and size == 3 and value[2] != 0.0:
            raise refused(arguments, f"returned {value}; the third component must be 0 for a planar_beam")
        return value

    return at


def _shown(argument: Any) -> str:
    """Return an argument of a function as errors show it."""
    if isinstance(argument, tuple):
        return f"({', '.join(map(_shown, argument))})"
    if isinstance(argument, Mapping):
        return "{" + ", ".join(f"{name}: {_shown(value)}" for name, value in argument.items()) + "}"
    return f"{argument if abs(argument) > TINY else 0.0:g}"
