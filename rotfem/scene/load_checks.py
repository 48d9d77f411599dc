"""Checks of the loads of a scene against what they work on, and against what is computed."""

from __future__ import annotations

from typing import Any

from rotfem.scene.loads import Loads, MomentLoad, Pressure
from rotfem.scene.motion import Motion
from rotfem.scene.values import problem

#: Part of the length by which a place may be beside the structure.
NEAR = 1e-9

#: How tables are written that are not mistaken for others.
KEYS = "write over_time = [[t, …], …], over_span = [[x, …], …] or over_span_and_time = [[x, t, …], …]"


def check_loads(structure: Any, motion: Motion, loads: Loads) -> None:
    """Refuse loads that the structure cannot bear."""
    _check_moment("loads.tip_moment", structure, loads.tip_moment)
    for i, point in enumerate(loads.at):
        check_place(f"loads.at.{i}.x", structure, point.x)
        if point.moment is not None and structure.type == "plate":
            why = "is not available on a plate: at a point it turns the director without limit as the mesh is refined"
            raise problem(f"loads.at.{i}.moment", None, why)
        _check_moment(f"loads.at.{i}.moment", structure, point.moment)
    if loads.pressure is not None and structure.type != "plate":
        raise problem("loads.pressure", None, f"needs a plate; on a {structure.type} give loads.distributed")
    for name, load in loads.spread.items():
        _check_span(f"loads.{name}", structure, load.span_rows)
    _check_regions(structure, loads.pressure)
    _check_harmonics(motion, loads)


def doubtful_table(structure: Any, loads: Loads, when: str) -> tuple[str, str] | None:
    """Return (key, what is wrong) of a table without a key that may be over the span; None if there is none.

    Args:
        structure: of the scene.
        loads: on it.
        when: what is computed at one time, as "a steady state"; "" for a history, where such a table is over time
            unless it runs from 0 to the length.
    """
    for name, load in loads.spread.items():
        if load.table is None:
            continue
        if when:
            return f"loads.{name}", f"is a table [[t, …], …] over time, which {when} does not have; {KEYS}"
        if load.table[0][0] == 0.0 and load.table[-1][0] == structure.length:
            what = f"is a table from 0 to {structure.length:g}, the length: it may be one over time or over the span"
            return f"loads.{name}", f"{what}; {KEYS}"
    return None


def check_place(key: str, structure: Any, x: tuple[float, ...]) -> None:
    """Refuse a place that is not on the structure; one on a plate that is a mesh is looked for later."""
    if len(x) != (2 if structure.type == "plate" else 1):
        allowed = "[x, y], m, for a plate" if structure.type == "plate" else f"a number, m, for a {structure.type}"
        raise problem(key, list(x), f"must be {allowed}")
    if structure.length is not None and not -NEAR <= x[0] / structure.length <= 1 + NEAR:
        raise problem(key, x[0] if len(x) == 1 else list(x), f"must be from 0 to the length {structure.length:g}")


def _check_moment(key: str, structure: Any, moment: MomentLoad | None) -> None:
    if moment is None:
        return
    # A function is looked at where it is called; its moment of a planar beam may have one component or three.
    own = [moment.components] if moment.given and moment.time_function is None else []
    sizes = [*own, *(len(h.amplitude) for h in moment.harmonic)]
    if structure.is_planar and any(n != 1 for n in sizes):
        raise problem(key, None, "must have one component, about axis 3, for a planar_beam")
    if not structure.is_planar and any(n != 3 for n in sizes):
        raise problem(key, None, f"must have three components for a {structure.type}")


def _check_span(key: str, structure: Any, rows: tuple[tuple[float, ...], ...]) -> None:
    length = structure.length
    for x, *_ in rows:
        if length is not None and not -NEAR <= x / length <= 1 + NEAR:
            raise problem(key, None, f"x = {x:g} is not on the structure, which runs from 0 to {length:g}")


def _check_regions(structure: Any, pressure: Pressure | None) -> None:
    if pressure is None or pressure.regions is None:
        return
    known = structure.thickness if isinstance(structure.thickness, dict) else {}
    for name in pressure.regions:
        if name not in known:
            has = (
                f"there are {', '.join(known)}" if known else "needs structure.mesh with structure.thickness by region"
            )
            raise problem(f"loads.pressure.regions.{name}", None, f"is no region of the plate; {has}")


def _check_harmonics(motion: Motion, loads: Loads) -> None:
    if not motion.is_free:
        return
    given = {"tip_force": loads.tip_force, "tip_moment": loads.tip_moment, **loads.spread}
    for i, point in enumerate(loads.at):
        given |= {f"at.{i}.force": point.force, f"at.{i}.moment": point.moment}
    for name, load in given.items():
        for h in load.harmonic if load is not None else ():
            if h.per_rev is not None:
                why = 'needs an angle of the hub that is prescribed, not motion.type = "torque"; give frequency'
                raise problem(f"loads.{name}.harmonic.per_rev", h.per_rev, why)
