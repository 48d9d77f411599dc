"""Scenes of choices: what a user may choose, factor by factor, and the tables that a row of choices stands for.

All are one blade, or plate, of a size at which every theory holds, in few elements and few steps. The sizes of numbers
are not choices here, and elements of a structure are all of one kind, so that rows share their compiled forms.
"""

from __future__ import annotations

import math
import random
from itertools import pairwise
from pathlib import Path
from typing import Any

import tomli_w

from tests.pairs.covering import Levels, Row
from tests.plate_mesh_files import write_msh

Tables = dict[str, Any]

#: Factor ↦ level ↦ how often it is chosen where either would do: what takes long is met where it must be.
LEVELS: dict[str, dict[str, float]] = {
    "command": {"run": 8, "modes": 2, "campbell": 1, "response": 1, "explain": 0.2, "check": 0.5},
    "structure": {"planar": 6, "spatial": 1, "plate": 1, "mesh": 1},
    "theory": {
        "linear": 3,
        "consistent_linear": 3,
        "von_karman_linear": 3,
        "second_order": 1,
        "von_karman": 1,
        "reissner": 2,
    },
    "frame": {"rotating": 1, "inertial": 1},
    "motion": dict.fromkeys(("constant", "rest", "spin_up", "table", "torque", "controller"), 1),
    "loads": dict.fromkeys(
        ("none", "gravity", "weight", "tip", "span", "harmonic", "follower", "pressure", "function"), 1
    ),
    "damping": dict.fromkeys(("none", "kelvin_voigt", "rayleigh", "modal"), 1),
    "root": dict.fromkeys(("clamped", "hinge", "spring", "pitch"), 1),
    "tip_mass": {"no": 1, "yes": 1},
    "time": {
        "generalised_alpha": 3,
        "newmark": 2,
        "esdirk4": 2,
        "energy_conserving": 2,
        "tolerance": 1,
        "accuracy": 0.1,
        "steady": 3,
    },
    "output": {"plain": 2, "stations": 2, "fields": 1, "error off": 2},
    # Of a history: as many as there are, or without those that symmetry keeps at zero, which other choices decide.
    "unknowns": {"any": 3, "left out": 1},
    "checkpoint": {"no": 4, "resumed": 1},
    "ranks": {"1": 8, "2": 1},
}
#: The levels of a plain scene.
PLAIN: Row = {factor: next(iter(levels)) for factor, levels in LEVELS.items()} | {"theory": "reissner"}
_STRUCTURE = ("command", "structure", "root", "tip_mass", "ranks")
_LINEARISED = (*_STRUCTURE, "theory", "frame", "motion", "loads", "damping", "output")
#: Command ↦ factors that it makes use of; a row has all, so that one scene is good for every command.
ACTIVE: Levels = {
    "run": tuple(LEVELS),
    "explain": (*_STRUCTURE, "theory", "frame", "motion", "loads", "damping", "time"),
    **dict.fromkeys(("modes", "campbell", "response"), _LINEARISED),
    "check": _STRUCTURE,
}

LINEAR = ("linear", "consistent_linear", "von_karman_linear")
HISTORIES = ("generalised_alpha", "newmark", "esdirk4", "energy_conserving", "tolerance")
#: What pairs are not enough for: rotations that are counted afresh within a step, of some unknowns only.
_SOME: Levels = {"unknowns": ("left out",)}
ALSO: list[Levels] = [
    {**_SOME, "structure": ("spatial",), "theory": ("second_order", "von_karman", "reissner")},
    {**_SOME, "structure": ("spatial", "plate", "mesh"), "time": HISTORIES},
]
#: Time to compile the forms of a row over that to compute it, by its structure.
COMPILING = {"planar": 1.5, "spatial": 9.0, "plate": 6.0, "mesh": 6.0}

#: Time that is computed (s), and the number of fixed steps.
END, STEPS = 0.12, 6
#: Tolerance of adaptive steps.
TOLERANCE = 0.03
#: Highest speed, rad/s; the lowest frequencies of bending are 9 rad/s of beams, 26 rad/s of plates.
SPEED = 3.0
LENGTH, WIDTH = 2.0, 0.6


def shuffled(rng: random.Random) -> Levels:
    """Return all levels in a random order, those to be preferred in front as often as their weights say."""
    return {
        factor: sorted(levels, key=lambda level: rng.expovariate(levels[level])) for factor, levels in LEVELS.items()
    }


def forms_of(row: Row) -> tuple[tuple[str, ...], float]:
    """Return the choices of a row that its compiled forms depend on, and the time to compile them."""
    same = {"modal": "none", "harmonic": "tip", "function": "tip", "weight": "gravity", "rest": "constant"}
    same |= {"table": "spin_up", "controller": "torque", **dict.fromkeys(HISTORIES[:-2], "fixed"), "tolerance": "fixed"}
    same |= dict.fromkeys(("campbell", "response"), "modes")
    parts = ("command", "structure", "theory", "frame", "motion", "damping", "loads", "root", "tip_mass", "time")
    return tuple(same.get(row[part], row[part]) for part in parts), COMPILING[row["structure"]]


def brake(t: float, psi: float, psi_dot: float, tip: Tables) -> float:
    """Return a torque that keeps a speed, N·m."""
    return 4.0 * (1.0 - psi_dot) - 0.1 * tip["u2"]


def gust(t: float) -> list[float]:
    """Return a force that comes and goes, N."""
    return [0.0, 0.3 * math.sin(20.0 * t), 0.0]


def tables_of(row: Row, folder: Path) -> Tables:
    """Return the tables of the scene of a row.

    Args:
        row: a level of every factor.
        folder: where the file of a mesh is, or is written.
    """
    plate = row["structure"] in ("plate", "mesh")
    tables: Tables = {
        "structure": plate_of(row, folder) if plate else beam_of(row),
        "motion": motion_of(row),
        "model": {"theory": row["theory"], "frame": row["frame"]},
        "mesh": {"plate": {"elements": [4, 2]}, "mesh": {}}.get(row["structure"], {"elements": 3, "degree": 3}),
        "modes": {"count": 3},
    }
    if row["loads"] != "none":
        tables["loads"] = loads_of(row)
    # Spin holds a hinge in theories that have its stiffness; else there is no equilibrium to start from. A follower in
    # the plane, -F alpha along the axis, works on what the Coriolis force makes of the bending: undamped, that grows.
    loose = row["root"] == "hinge" and (row["motion"] not in ("constant", "table") or row["theory"] == "linear")
    if loose or (row["loads"] == "follower" and row["damping"] == "none"):
        tables["initial"] = {"state": "undeformed"}
    if row["time"] == "accuracy":
        tables |= {"accuracy": 0.5, "time": {"end": END}}
    elif row["time"] == "tolerance":
        tables["time"] = {"end": END, "tolerance": TOLERANCE}
    elif row["time"] != "steady":
        tables["time"] = {"end": END, "step": END / STEPS, "scheme": row["time"]}
    output: Tables = {"plain": {}, "fields": {"fields": ["xdmf"]}, "error off": {"error": False}}
    output["stations"] = {"quantities": ["n11", "von_mises"]} if plate else {"stations": 4}
    if output[row["output"]]:
        tables["output"] = output[row["output"]]
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
    """Return a section that tapers; its centre of mass is ahead of the axis, and its stretch bends it in the plane."""
    mass, ahead = 0.5, 0.01
    about2, about3 = 1e-4, 2e-4 + mass * ahead**2

    def table(diagonal: list[float], couplings: dict[tuple[int, int], float]) -> list[Any]:
        matrix = [[value * (i == j) for j in range(6)] for i, value in enumerate(diagonal)]
        for (i, j), value in couplings.items():
            matrix[i][j] = matrix[j][i] = value
        return [[0.0, matrix], [LENGTH, [[0.8 * entry for entry in line] for line in matrix]]]

    return {
        "stiffness": table([1e5, 3e4, 3e4, 40.0, 60.0, 120.0], {(0, 5): 100.0}),
        "mass": table([mass] * 3 + [about2 + about3, about2, about3], {(0, 5): -mass * ahead, (2, 3): mass * ahead}),
    }


def plate_of(row: Row, folder: Path) -> Tables:
    """Return the [structure] of a plate, a rectangle or the file of one."""
    out: Tables = {"type": "plate", "thickness": 0.01, "E": 7e9, "nu": 0.3, "rho": 2700.0, "hub_radius": 0.3}
    if row["structure"] == "plate":
        out |= {"length": LENGTH, "width": WIDTH}
    else:
        out["mesh"] = str(mesh_file(folder))
    if row["tip_mass"] == "yes":
        out["point_masses"] = [[LENGTH, 0.0, 0.5]]
    return out | root_of(row) | damping_of(row)


def mesh_file(folder: Path) -> Path:
    """Return the file of a rectangle of 4 × 2 quadrilaterals in a folder, written if it is not there."""
    path, nx, ny = folder / "plate.msh", 4, 2
    if not path.exists():
        points = [(LENGTH * i / nx, WIDTH * (j / ny - 0.5)) for i in range(nx + 1) for j in range(ny + 1)]
        at = [[i * (ny + 1) + j for j in range(ny + 1)] for i in range(nx + 1)]
        cells = [[at[i][j], at[i + 1][j], at[i + 1][j + 1], at[i][j + 1]] for i in range(nx) for j in range(ny)]
        ends = {"clamped": at[0], "tip": at[-1]}
        edges = {name: [list(pair) for pair in pairwise(line)] for name, line in ends.items()}
        write_msh(path, points, {**edges, "plate": cells})
    return path


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
    kinds: Tables = {"kelvin_voigt": 1e-3, "rayleigh": [a0, 1e-3], "modal": [0.01, 0.02]}
    return {} if row["damping"] == "none" else {"damping": {row["damping"]: kinds[row["damping"]]}}


def motion_of(row: Row) -> Tables:
    """Return the [motion]."""
    hub = {"type": "torque", "hub_inertia": 5.0}
    kinds: Tables = {
        "rest": {"type": "constant", "speed": 0.0},
        "constant": {"type": "constant", "speed": SPEED},
        "spin_up": {"type": "spin_up", "speed": SPEED, "duration": 2 * END},
        "table": {"type": "table", "table": [[0.0, 1.0], [END / 2, 1.5], [2 * END, 1.2]]},
        "torque": {**hub, "pulses": [[0.0, END / 3, 5.0]], "hub_damping": 0.1},
        "controller": {**hub, "function": brake},
    }
    return dict(kinds[row["motion"]])


def loads_of(row: Row) -> Tables:
    """Return the [loads]; gravity and a force at the tip, dead or a function, are in the plane of rotation.

    They turn a hinge by no more than the theories of moderate turns hold for.
    """
    planar, plate = row["structure"] == "planar", row["structure"] in ("plate", "mesh")
    part = 0.03 if row["root"] == "hinge" else 1.0
    size = 20.0 if plate else 0.3 * part
    across = [0.0, size] if planar else [0.0, 0.0, size]
    # A beam of the exact theory is bent by a third of its length, so that Newton's way is a long one.
    thrown = 100.0 * size if row["theory"] == "reissner" and not plate else size
    return {
        "gravity": {"gravity": [0.0, -2.0 * part, 0.0]},
        "weight": {"gravity": [0.0, 0.0, -2.0 * part]},
        "tip": {"tip_force": [0.0, thrown]},
        "span": {"distributed": {"over_span": [[0.0, *(0.0 * f for f in across)], [LENGTH, *across]]}},
        "harmonic": {"tip_force": {"harmonic": [{"amplitude": across, "frequency": 5.0}]}},
        "follower": {"tip_force": {"value": across, "kind": "follower"}},
        "pressure": {"pressure": {"over_time": [[0.0, 0.0], [END / 2, size], [END, size]]}},
        "function": {"tip_force": gust},
    }[row["loads"]]


def as_toml(row: Row, tables: Tables) -> str:
    """Return a scene as a user would have it in a file, its choices and what only Python can say as comments."""
    said = [f"# rotfem {row['command']} on {row['ranks']} rank(s): {row}"]

    def plain(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            kept = {name: plain(entry, f"{key}.{name}".lstrip(".")) for name, entry in value.items()}
            return {name: entry for name, entry in kept.items() if entry is not None}
        if callable(value):
            said.append(f"# {key} = {value.__module__}.{value.__name__}")
            return None
        return value

    text = tomli_w.dumps(plain(tables))
    return "\n".join([*said, text])
