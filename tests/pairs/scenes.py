"""Scenes of choices: what a user may choose, factor by factor, and the tables that a row of choices stands for.

All are one blade, or plate, of a size at which every theory holds, in few elements and few steps. The sizes of numbers
are not choices here, and elements of a structure are all of one kind, so that rows share their compiled forms.
"""

from __future__ import annotations

import math
from typing import Any

from tests.pairs.covering import Levels, Row

Tables = dict[str, Any]

#: Factor ↦ level ↦ how often it is chosen where either would do: what takes long is met where it must be.
LEVELS: dict[str, dict[str, float]] = {
    "command": {"run": 8, "modes": 2, "campbell": 1, "response": 1},
    "structure": {"planar": 12, "plate": 1, "spatial": 1},
    "theory": {"consistent_linear": 3, "second_order": 1, "reissner": 2},
    "frame": {"rotating": 1, "inertial": 1},
    "motion": dict.fromkeys(("constant", "rest", "spin_up", "torque", "controller"), 1),
    "loads": dict.fromkeys(("none", "gravity", "tip", "span", "harmonic", "follower", "function"), 1),
    "damping": dict.fromkeys(("none", "viscous", "modal"), 1),
    "root": dict.fromkeys(("clamped", "hinge", "spring", "pitch"), 1),
    "tip_mass": {"no": 1, "yes": 1},
    "time": {
        "generalised_alpha": 3,
        "esdirk4": 2,
        "energy_conserving": 2,
        "tolerance": 1,
        "accuracy": 0.1,
        "steady": 3,
    },
    "output": {"plain": 2, "stations": 2, "fields": 1, "estimated": 1},
    "checkpoint": {"no": 4, "resumed": 1},
    "ranks": {"1": 50, "2": 1},
}
#: The levels of a plain scene.
PLAIN: Row = {factor: next(iter(levels)) for factor, levels in LEVELS.items()} | {"theory": "reissner"}
_LINEARISED = tuple(factor for factor in LEVELS if factor not in ("time", "checkpoint"))
#: Command ↦ factors that it makes use of; a row has all, so that one scene is good for every command.
ACTIVE: Levels = {"run": tuple(LEVELS), **dict.fromkeys(("modes", "campbell", "response"), _LINEARISED)}

#: Time that is computed (s), and the number of fixed steps.
END, STEPS = 0.12, 6
#: Tolerance of adaptive steps.
TOLERANCE = 0.03
#: Highest speed, rad/s; the lowest frequencies of bending are 9 rad/s of beams, 26 rad/s of plates.
SPEED = 3.0
LENGTH, WIDTH = 2.0, 0.6


def brake(t: float, psi: float, psi_dot: float, tip: Tables) -> float:
    """Return a torque that keeps a speed, N·m."""
    return 4.0 * (1.0 - psi_dot) - 0.1 * tip["u2"]


def gust(t: float) -> list[float]:
    """Return a force that comes and goes, N."""
    return [0.0, 0.3 * math.sin(20.0 * t), 0.0]


def tables_of(row: Row) -> Tables:
    """Return the tables of the scene of a row, which has a level of every factor."""
    plate = row["structure"] == "plate"
    tables: Tables = {
        "structure": plate_of(row) if plate else beam_of(row),
        "motion": motion_of(row),
        "model": {"theory": row["theory"], "frame": row["frame"]},
        "mesh": {"elements": [4, 2]} if plate else {"elements": 3, "degree": 3},
        "modes": {"count": 3},
        "output": {} if row["time"] == "accuracy" else {"error": row["output"] == "estimated"},
    }
    if row["loads"] != "none":
        tables["loads"] = loads_of(row)
    # Spin holds a hinge in theories that have its stiffness; else there is no equilibrium to start from. A follower in
    # the plane, -F alpha along the axis, works on what the Coriolis force makes of the bending: undamped, that grows.
    loose = row["root"] == "hinge" and row["motion"] != "constant"
    if loose or (row["loads"] == "follower" and row["damping"] == "none"):
        tables["initial"] = {"state": "undeformed"}
    if row["time"] == "accuracy":
        tables |= {"accuracy": 0.5, "time": {"end": END}}
    elif row["time"] == "tolerance":
        tables["time"] = {"end": END, "tolerance": TOLERANCE}
    elif row["time"] != "steady":
        tables["time"] = {"end": END, "step": END / STEPS, "scheme": row["time"]}
    if row["output"] == "stations":
        tables["output"] |= {"quantities": ["n11", "von_mises"]} if plate else {"stations": 4}
    if row["output"] == "fields":
        tables["output"] |= {"fields": ["xdmf"]}
    return tables


def beam_of(row: Row) -> Tables:
    """Return the [structure] of a blade that is symmetric to the plane of rotation."""
    spatial = row["structure"] == "spatial"
    out: Tables = {"type": "spatial_beam" if spatial else "planar_beam", "length": LENGTH, "hub_radius": 0.3}
    out["section"] = spatial_section() if spatial else {"EA": 1e5, "GA": 3e4, "EI": 120.0, "mass_per_length": 0.5}
    if not spatial:
        out["section"]["rotary_inertia"] = 2e-4
    if row["tip_mass"] == "yes":
        out["tip_mass"] = 0.1
    return out | root_of(row) | damping_of(row)


def spatial_section() -> Tables:
    """Return a section that bends and twists in all ways, uncoupled: others are in test_blade_sections."""
    stiffness = {"EA": 1e5, "GA2": 3e4, "GA3": 3e4, "GJ": 40.0, "EI2": 60.0, "EI3": 120.0}
    return {**stiffness, "mass_per_length": 0.5, "rotary_inertia2": 1e-4, "rotary_inertia3": 2e-4}


def plate_of(row: Row) -> Tables:
    """Return the [structure] of a plate."""
    out: Tables = {"type": "plate", "thickness": 0.01, "E": 7e9, "nu": 0.3, "rho": 2700.0, "hub_radius": 0.3}
    out |= {"length": LENGTH, "width": WIDTH}
    if row["tip_mass"] == "yes":
        out["point_masses"] = [[LENGTH, 0.0, 0.5]]
    return out | root_of(row) | damping_of(row)


def root_of(row: Row) -> Tables:
    """Return how a structure is held; out of the plane of rotation by springs of spatial beams alone."""
    flap = {"flap_stiffness": 100.0, "flap_damping": 0.1} if row["structure"] == "spatial" else {}
    kinds: Tables = {
        "hinge": {"lag_stiffness": 0.0, "lag_damping": 0.1},
        "spring": {"lag_stiffness": 200.0, **flap},
        "pitch": {"pitch": [[0.0, 0.05], [END, 0.1]]},
    }
    return {} if row["root"] == "clamped" else {"root": kinds[row["root"]]}


def damping_of(row: Row) -> Tables:
    """Return the damping of a structure; in proportion to the stiffness alone where the frame does not turn."""
    a0 = 0.1 if row["frame"] == "rotating" else 0.0
    viscous, modal = {"kelvin_voigt": 5e-4, "rayleigh": [a0, 5e-4]}, {"modal": [0.01, 0.02]}
    return {"none": {}, "viscous": {"damping": viscous}, "modal": {"damping": modal}}[row["damping"]]


def motion_of(row: Row) -> Tables:
    """Return the [motion]."""
    hub = {"type": "torque", "hub_inertia": 5.0}
    kinds: Tables = {
        "rest": {"type": "constant", "speed": 0.0},
        "constant": {"type": "constant", "speed": SPEED},
        "spin_up": {"type": "spin_up", "speed": SPEED, "duration": 2 * END},
        "torque": {**hub, "pulses": [[0.0, END / 3, 5.0]], "hub_damping": 0.1},
        "controller": {**hub, "function": brake},
    }
    return dict(kinds[row["motion"]])


def loads_of(row: Row) -> Tables:
    """Return the [loads]; a force at the tip, dead or a function, and gravity of a planar beam are in its plane.

    They turn a hinge by no more than the theories of moderate turns hold for.
    """
    planar, plate = row["structure"] == "planar", row["structure"] == "plate"
    part = 0.03 if row["root"] == "hinge" else 1.0
    size = 20.0 if plate else 0.3 * part
    across = [0.0, size] if planar else [0.0, 0.0, size]
    # A beam of the exact theory is bent by a third of its length, so that Newton's way is a long one.
    thrown = 100.0 * size if row["theory"] == "reissner" and not plate else size
    return {
        "gravity": {"gravity": [0.0, -2.0 * part, 0.0] if planar else [0.0, 0.0, -2.0 * part]},
        "tip": {"tip_force": [0.0, thrown]},
        "span": {"distributed": {"over_span": [[0.0, *(0.0 * f for f in across)], [LENGTH, *across]]}},
        "harmonic": {"tip_force": {"harmonic": [{"amplitude": across, "frequency": 5.0}]}},
        "follower": {"tip_force": {"value": across, "kind": "follower"}},
        "function": {"tip_force": gust},
    }[row["loads"]]
