"""The loads of a scene as sums of shapes times amplitudes (see `rotfem.mechanics.loads`)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rotfem.errors import InputError
from rotfem.mechanics.loads import WHOLE, AnyLoad, Load, Loads, PlaceLoad, PointLoads, Shapes, Term
from rotfem.mechanics.motion import Motion
from rotfem.mechanics.problem import Problem
from rotfem.scene import Scene
from rotfem.users_functions import checked

Array = npt.NDArray[np.float64]


def loads_of(scene: Scene, motion: Motion) -> Loads:
    """Return the loads of a scene, under a motion that says how its hub turns."""
    given, structure = scene.loads, scene.structure
    points = []
    for i, point in enumerate(given.at):
        made = {
            name: load_of(f"loads.at.{i}.{name}", load, structure, motion, point.kind_of(load))
            for name, load in (("force", point.force), ("moment", point.moment))
            if load is not None
        }
        points.append(PointLoads(point.x, **made))
    whole: dict[str, Any] = {name: load for name in WHOLE if (load := getattr(given, name)) is not None}
    made = {name: load_of(f"loads.{name}", load, structure, motion, load.kind) for name, load in whole.items()}
    return Loads(gravity=given.gravity, at=tuple(points), **made)


def load_of(key: str, given: Any, structure: Any, motion: Motion | None = None, kind: str = "dead") -> AnyLoad:
    """Return one load, or another signal.

    Args:
        key: of the scene.
        given: what the scene has there.
        structure: of the scene.
        motion: of the hub, which harmonics of its angle need.
        kind: "dead" or "follower".
    """
    planar = structure.is_planar
    size = 1 if key == "loads.pressure" or (planar and key.endswith("moment")) else 3
    over, value = given.over
    if "x" in over and callable(value):
        timed = "t" in over
        function = checked(value, key, size, "place and time" if timed else "place", planar)
        at = function if timed else (lambda x, t: function(x))
        # Places along the structure, of a plate from a file one, that show how the load changes with time.
        probes = np.linspace(0.0, structure.length, 9) if structure.length is not None else np.zeros(1)
        places = tuple((float(x), 0.0) if structure.type == "plate" else float(x) for x in probes)
        return PlaceLoad(kind, at, places, constant=not timed)
    terms = [_harmonic(harmonic, motion) for harmonic in getattr(given, "harmonic", ())]
    if callable(value):
        of_time = checked(value, key, size, "time", planar)
        each = Shapes.uniform(np.eye(size))
        terms.append(Term(each, lambda t: np.array([of_time(float(s)) for s in t]), linear=False))
    elif over == ("t",):
        terms.append(Term.table(value, Shapes.uniform(np.eye(len(value[0]) - 1))))
    elif over:
        terms.append(Term(Shapes.along_span(value)) if over == ("x",) else Term.both(value))
    elif isinstance(value, dict):
        terms += [Term(Shapes(np.array([[[p]]]), region=region)) for region, p in value.items()]
    elif value is not None:
        terms.append(Term(Shapes.uniform([value])))
    return Load(kind, tuple(terms))


def _harmonic(harmonic: Any, motion: Any) -> Term:
    amplitude, per_rev = harmonic.amplitude, harmonic.per_rev
    shapes = Shapes.along_span(amplitude) if isinstance(amplitude[0], tuple) else Shapes.uniform([amplitude])
    if per_rev is None:
        return Term.harmonic(shapes, lambda t: harmonic.frequency * t, harmonic.phase)
    return Term.harmonic(shapes, lambda t: per_rev * np.array([motion.angle(float(s)) for s in t]), harmonic.phase)


def frozen_inputs(problem: Problem) -> list[str]:
    """Return warnings where what is computed at one time, as modes are, has motion, gravity and loads as at t = 0."""
    given = {name: load.unpitched or load for name, load in problem.loads.named.items()}
    names = [f"loads.{name}" for name, load in given.items() if not (load.constant or load.is_zero)]
    said = [f"{', '.join(names)} {'change' if len(names) > 1 else 'changes'} with time: taken as at t = 0"]
    return [*frozen_in_frame(problem), *(said if names else [])]


def frozen_in_frame(problem: Problem) -> list[str]:
    """Return the same of pitch, gravity and base acceleration."""
    motion = problem.motion
    found = {
        "structure.root.pitch changes with time": motion.pitch is not None,
        "loads.gravity turns in the rotating frame": problem.gravity_turns,
        "motion.base_acceleration changes with time": motion.is_accelerated and motion.base_knots != (),
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
    changing = {name: load for name, load in made.named.items() if not load.constant}
    if not any(term.phase is not None for load in changing.values() for term in getattr(load, "terms", ())):
        why = "a frequency response needs a harmonic load, such as loads.tip_force.harmonic = "
        raise InputError("loads", None, why + "{ amplitude = [0, 1], frequency = 1 }; its frequency is swept")
    swept: dict[str, AnyLoad] = {}
    for name, load in changing.items():
        if isinstance(load, PlaceLoad) or any(t.amplitudes is not None and t.phase is None for t in load.terms):
            raise InputError(f"loads.{name}", None, "must be constant or harmonic in a frequency response")
        swept[name] = replace(load, terms=tuple(map(_swept, load.terms)))
    return made.replaced(swept)


def _swept(term: Term) -> Term:
    if term.phase is None:
        return term
    factors = np.array([0.0, np.cos(term.phase), np.sin(term.phase)])
    return replace(term, amplitudes=lambda t: np.asarray(factors[np.searchsorted(SWEPT, t)][:, None]))
