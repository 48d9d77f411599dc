"""The cases as rotfem computes them; run by `run.py`. Every function returns seconds, and values to be judged."""

from __future__ import annotations

import json
import sys
from time import process_time
from typing import Any

import numpy as np

import rotfem
from rotfem.analysis.march import March, Steps
from rotfem.commands.problem import Problem, first_shape
from rotfem.numerics.newton import Newton
from rotfem.registry import schemes

Values = list[list[float]]

SPIN_UP: dict[str, Any] = {
    "structure": {
        "type": "planar_beam",
        "length": 10.0,
        "section": {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4},
    },
    "motion": {"type": "spin_up", "speed": 6.0, "duration": 15.0},
    "model": {"theory": "reissner"},
}
SECTION = {"EA": 2.8e7, "GA2": 1e10, "GA3": 1e10, "GJ": 1e4, "EI2": 1.4e4, "EI3": 1.4e4, "mass_per_length": 1.2}
SPATIAL = SPIN_UP | {
    "structure": {"type": "spatial_beam", "length": 10.0, "section": SECTION},
    "loads": {"gravity": [0.0, 0.0, -9.81]},
}
#: An arm of 8 m about an inclined axis, and a beam on a free hub; both by a table of rows.
ROUND = {"EA": 2.8e7, "GA2": 1e7, "GA3": 1e7, "GJ": 1.4e4, "EI2": 1.4e4, "EI3": 1.4e4, "mass_per_length": 1.2}
RISING = [(t, t - np.sin(np.pi * t) / np.pi if t < 2.0 else 2.0) for t in np.linspace(0.0, 4.0, 301).tolist()]
ARM = SPIN_UP | {
    "structure": {
        "type": "spatial_beam",
        "length": 8.0,
        "section": ROUND | {"rotary_inertia2": 6e-4, "rotary_inertia3": 6e-4},
    },
    "motion": {"type": "table", "table": [list(map(float, row)) for row in RISING], "axis": [0.0, 0.6, 0.8]},
}
HUB = SPIN_UP | {
    "structure": SPIN_UP["structure"] | {"hub_radius": 0.5},
    "motion": {
        "type": "torque",
        "hub_inertia": 200.0,
        "table": [[t, float(100 * np.sin(2 * t))] for t in np.linspace(0.0, 4.0, 401).tolist()],
    },
}
THIN = {"EA": 1e6, "GA": 1e6, "EI": 1.0, "mass_per_length": 1.0}
PLATE = {"type": "plate", "length": 1.0, "width": 1.0, "thickness": 0.01, "E": 70e9, "nu": 0.3, "rho": 2700.0}


def spin_up(elements: int, steps: int, scheme: str, degree: int) -> tuple[float, Values]:
    """Return seconds of the time loop, and rows of t, u₂ of the tip."""
    seconds, rows = marched(SPIN_UP, elements, steps, scheme, degree)
    return seconds, [[row[0], row[2]] for row in rows]


def spatial(elements: int, steps: int, scheme: str, degree: int) -> tuple[float, Values]:
    """Return seconds of the time loop, and rows of t, u₁, u₂, u₃ of a beam that hangs by its weight and spins up."""
    return marched(SPATIAL, elements, steps, scheme, degree, hanging=True)


def arm(elements: int, steps: int, scheme: str, degree: int, tolerance: float) -> tuple[float, Values]:
    """Return seconds of the time loop, and rows of t, u₁, u₂, u₃ of the tip."""
    return marched(ARM, elements, steps, scheme, degree, end=4.0, tolerance=tolerance)


def hub(elements: int, steps: int, scheme: str, degree: int, tolerance: float) -> tuple[float, Values]:
    """Return seconds of the time loop, and rows of t, u₁, u₂ of the tip."""
    seconds, rows = marched(HUB, elements, steps, scheme, degree, end=4.0, tolerance=tolerance)
    return seconds, [row[:3] for row in rows]


def marched(
    scene: dict[str, Any],
    elements: int,
    steps: int,
    scheme: str,
    degree: int,
    hanging: bool = False,
    end: float = 20.0,
    tolerance: float = 1e-9,
) -> tuple[float, Values]:
    """March; return seconds of the time loop, and rows of t and the displacement of the tip.

    A beam that is hanging begins in its equilibrium at rest, which is not timed.
    """
    tables = {"mesh": {"elements": elements, "degree": degree}, "time": {"end": end, "step": end / steps}}
    problem = Problem.of(scene | tables)
    system, start = problem.system(), problem.steady(speed=0.0) if hanging else None
    march = March(system, schemes[scheme](), Steps(end, end / steps), Newton(tolerance), first_shape(system, start))
    started = process_time()
    rows = [[state.t, *map(float, system.tip(state.q, state.t)[:3])] for state in march]
    return process_time() - started, rows


def accuracy(wanted: float) -> tuple[float, Values]:
    """Run with `accuracy` alone, its choice of mesh, scheme and steps included; rows as above."""
    tables = {"time": {"end": 20.0, "step": 0.5}, "accuracy": wanted}
    started = process_time()
    history = rotfem.run(SPIN_UP | tables).history
    rows = [[float(t), float(u)] for t, u in zip(history["t"], history["tip_u2"], strict=True)]
    return process_time() - started, rows


def lag(elements: int, speeds: list[float]) -> tuple[float, Values]:
    """Three frequencies at each speed of a thin beam in its plane, L = EI = ρA = 1."""
    tables = {
        "structure": {"type": "planar_beam", "length": 1.0, "section": THIN},
        "motion": {"type": "constant", "speed": 0.0},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": elements, "degree": 3},
        "modes": {"count": 3},
    }
    return diagram(tables, speeds, 3)


def plate(cells: int, speeds: list[float]) -> tuple[float, Values]:
    """Five frequencies at each speed of a thin square plate that turns in its plane."""
    tables = {
        "structure": PLATE,
        "motion": {"type": "constant", "speed": 0.0, "axis": [0, 0, 1]},
        "model": {"theory": "consistent_linear"},
        "mesh": {"elements": [cells, cells]},
        "modes": {"count": 5},
    }
    return diagram(tables, speeds, 5)


def blade(main: str, elements: int, speeds: list[float]) -> tuple[float, Values]:
    """Five frequencies at each speed of the blade of an ElastoDyn main file, with its precone."""
    stiff = ("EA", "GA2", "GA3", "GJ")
    changes = [f"structure.section.{name}=1e12" for name in stiff]
    scene = rotfem.import_blade(main, changes=changes)
    more = {"model": {"theory": "consistent_linear"}, "mesh": {"elements": elements, "degree": 3}}
    return diagram({**scene.tables, **more, "modes": {"count": 5}}, speeds, 5)


def rotor(elements: int, bearing: dict[str, float]) -> dict[str, Any]:
    """Return ROSS's example rotor with other bearings."""
    matrices = {
        name: [[bearing.get(c + d, 0.0) for d in row] for row in (("xx", "xy"), ("yx", "yy"))]
        for name, c in (("stiffness", "k"), ("damping", "c"))
    }
    disk = {"outer_diameter": 0.28, "inner_diameter": 0.05, "width": 0.07, "rho": 7810.0}
    section = {"shape": "circle", "radius": 0.025, "E": 211e9, "nu": 211e9 / 81.2e9 / 2 - 1, "rho": 7810.0}
    structure = {"type": "spatial_beam", "length": 1.5, "section": section, "root": {"driven": True}}
    structure |= {"supports": [{"x": x, **matrices} for x in (0.0, 1.5)]}
    return {
        "structure": structure | {"masses": [{"x": x, "disk": disk} for x in (0.5, 1.0)]},
        "motion": {"type": "constant", "speed": 0.0, "axis": [1, 0, 0]},
        "loads": {"unbalance": [{"x": 0.5, "kg_m": 1e-3, "phase": 0.5}]},
        "mesh": {"elements": elements, "degree": 3},
        "modes": {"count": 5},
    }


def whirl(elements: int, bearing: dict[str, float], speeds: list[float]) -> tuple[float, Values]:
    """Four frequencies of bending at each speed of a shaft."""
    return diagram(rotor(elements, bearing), speeds, 4, without="1st torsion")


def unbalance(elements: int, bearing: dict[str, float], speeds: list[float]) -> tuple[float, Values]:
    """Amplitudes along both directions at the first disk at each speed, under its unbalance."""
    started = process_time()
    found = rotfem.unbalance(rotor(elements, bearing), speeds).at(0.5)
    return process_time() - started, [list(map(float, row)) for row in zip(found["u2"], found["u3"], strict=True)]


def diagram(tables: dict[str, Any], speeds: list[float], count: int, without: str = "") -> tuple[float, Values]:
    """Return seconds of a Campbell diagram, and its frequencies (rad/s)."""
    started = process_time()
    result = rotfem.campbell(tables, speeds, orders=0)
    seconds = process_time() - started
    kept = [row for row in result.rows if row["label"] != without]
    rows = [[row["frequency"] for row in kept if row["speed"] == speed] for speed in speeds]
    return seconds, [sorted(row)[:count] for row in rows]


if __name__ == "__main__":
    case, arguments = globals()[sys.argv[1]], json.loads(sys.argv[2])
    case(**arguments)  # the first time is not measured
    seconds, values = case(**arguments)
    print(json.dumps({"seconds": seconds, "values": values}))
