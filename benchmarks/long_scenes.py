"""Scenes whose runs take long: large plates, many turns, long gusts, manoeuvres of a free hub.

`SCENES` is name ↦ tables, for accuracy_answers.py --long. They are of sizes at which rotors are computed in earnest:
plates of some thousand unknowns, blades over minutes, two hundred turns.
"""

from __future__ import annotations

import numpy as np
from accuracy_scenes import ARM, BLADE, KRB, PROPELLER, Tables

ALUMINIUM = {"E": 70e9, "nu": 0.3, "rho": 2700.0}
PLATE = {"type": "plate", "length": 1.0, "width": 0.5, "thickness": 0.01, **ALUMINIUM, "hub_radius": 0.2}


def _wind() -> list[list[float]]:
    """Return rows (t, 0, f) of a load along a blade over 100 s, N/m: a mean that rises and gusts of several periods."""
    t = np.arange(0.0, 100.5, 1.0)
    f = 2.0 * np.tanh(t / 20.0) + 0.5 * np.sin(0.9 * t) + 0.3 * np.sin(2.3 * t + 0.4)
    return [[float(s), 0.0, float(round(x, 3))] for s, x in zip(t, f, strict=True)]


def _wind_over_span() -> list[list[float]]:
    """Return rows (x, t, 0, f2, f3) of loads on a blade of 60 m at 20 stations and 2001 times over 100 s, N/m.

    Gusts of several periods, and the sum of independent steps at every station and time, which is rough.
    """
    t, x = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 100.0, 2001), np.linspace(0.0, 60.0, 20), indexing="ij"))
    rough = np.cumsum(np.random.default_rng(3).standard_normal((2001, 20)), axis=0).ravel()
    gust = 1.0 + 0.2 * np.sin(0.7 * t) + 0.1 * np.sin(2.9 * t + 0.3 * x) + 0.01 * rough
    columns = (x, t, 0 * x, 800.0 * x / 60 * gust, 3000.0 * np.sqrt(x / 60) * gust)
    rows: list[list[float]] = np.column_stack(columns).tolist()
    return rows


def _manoeuvres() -> list[list[float]]:
    """Return rows (t, torque) of five turns to and fro with smooth edges, N·m."""
    t = np.linspace(0.0, 10.0, 101)
    return [[float(s), float(round(0.06 * np.sin(np.pi * s) * np.sin(0.1 * np.pi * s) ** 2, 5))] for s in t]


SCENES: dict[str, Tables] = {
    "plate of 6125 unknowns, spun up gently": {
        "structure": PLATE,
        "motion": {"type": "spin_up", "speed": 15.0, "duration": 0.6, "axis": [0, 1, 0]},
        "mesh": {"elements": [24, 12]},
        "time": {"end": 1.0, "step": 0.005},
    },
    "plate of 6125 unknowns, under pressure": {
        "structure": {**PLATE, "damping": {"rayleigh": [2.0, 0.0]}},
        "motion": {"type": "constant", "speed": 20.0, "axis": [0, 0, 1]},
        "loads": {"pressure": [[0.0, 0.0], [0.1, 150.0], [0.3, -100.0], [0.5, 120.0], [0.8, 0.0], [1.2, 0.0]]},
        "mesh": {"elements": [24, 12]},
        "time": {"end": 1.2, "step": 0.005},
    },
    "plate of 6125 unknowns, pulse at the tip": {
        "structure": PLATE,
        "motion": {"type": "constant", "speed": 10.0, "axis": [0, 1, 0]},
        "loads": {"tip_force": [[0.0, 0, 0, 0], [0.02, 0, 0, 40.0], [0.04, 0, 0, 0.0], [1.0, 0, 0, 0.0]]},
        "mesh": {"elements": [24, 12]},
        "time": {"end": 0.6, "step": 0.005},
    },
    "blade under gravity, 100 s": {
        "structure": {"type": "planar_beam", "length": 10.0, "section": KRB, "hub_radius": 0.5},
        "motion": {"type": "constant", "speed": 2.5},
        "loads": {"gravity": [0.0, -1.0]},
        "mesh": {"elements": 8},
        "time": {"end": 100.0, "step": 0.05},
    },
    "wind on a damped blade, 100 s": {
        "structure": {
            **{"type": "planar_beam", "length": 10.0, "section": KRB, "hub_radius": 1.0},
            "damping": {"rayleigh": [0.1, 0.0]},
        },
        "motion": {"type": "constant", "speed": 4.0},
        "loads": {"distributed": _wind()},
        "mesh": {"elements": 8},
        "time": {"end": 100.0, "step": 0.05},
    },
    "wind over the span of a blade of 60 m, 100 s": {
        "structure": {
            **{"type": "spatial_beam", "length": 60.0, "hub_radius": 1.5, "pretwist": [[0.0, 0.2], [60.0, 0.0]]},
            "section": {
                **{"EA": [[0.0, 1e10], [60.0, 1e9]], "GA2": 2e9, "GA3": 2e9, "GJ": [[0.0, 5e9], [60.0, 5e6]]},
                **{"EI2": [[0.0, 1.8e10], [60.0, 1e7]], "EI3": [[0.0, 1.8e10], [60.0, 1e8]]},
                **{"mass_per_length": [[0.0, 600.0], [60.0, 20.0]], "rotary_inertia2": [[0.0, 300.0], [60.0, 0.5]]},
                "rotary_inertia3": [[0.0, 300.0], [60.0, 5.0]],
            },
            "damping": {"kelvin_voigt": 0.003},
        },
        "motion": {"type": "constant", "speed": 1.2},
        "loads": {"gravity": [0.0, -9.81, 0.0], "distributed": {"over_span_and_time": _wind_over_span()}},
        "mesh": {"elements": 10},
        "time": {"end": 100.0, "step": 0.01},
        "output": {"stations": [float(x) for x in np.linspace(0.0, 60.0, 10)]},
    },
    "pretwisted tapered blade, spun up under gravity": {
        "structure": {
            **{"type": "spatial_beam", "length": 10.0, "hub_radius": 0.5, "precone": 0.03},
            "pretwist": [[0.0, 0.3], [10.0, 0.0]],
            "section": {
                **BLADE,
                **{"EI2": [[0.0, 2.0e4], [10.0, 6.0e3]], "EI3": [[0.0, 9.0e4], [10.0, 3.0e4]]},
                "mass_per_length": [[0.0, 2.5], [10.0, 1.0]],
            },
        },
        "motion": {"type": "table", "table": [[0.0, 0.0], [4.0, 4.0], [8.0, 7.0], [20.0, 7.0]]},
        "loads": {"gravity": [0.0, -2.0, 0.0]},
        "mesh": {"elements": 8},
        "time": {"end": 20.0, "step": 0.02},
    },
    "arm turned to and fro by a free hub, 10 s": {
        "structure": {"type": "planar_beam", "length": 0.5, "section": ARM, "hub_radius": 0.05, "tip_mass": 0.01},
        "motion": {"type": "torque", "hub_inertia": 5.0e-3, "table": _manoeuvres()},
        "mesh": {"elements": 6},
        "time": {"end": 10.0, "step": 0.005},
    },
    "propeller over two hundred turns": {
        "structure": {
            **{"type": "planar_beam", "length": 0.5, "section": PROPELLER, "hub_radius": 0.05},
            "damping": {"rayleigh": [4.0, 0.0]},
        },
        "motion": {"type": "constant", "speed": 150.0},
        "loads": {"gravity": [0.0, -9.81]},
        "mesh": {"elements": 8},
        "time": {"end": 8.4, "step": 0.002},
    },
    "blade slowed down and sped up, 60 s": {
        "structure": {"type": "planar_beam", "length": 10.0, "section": KRB, "damping": {"rayleigh": [0.05, 0.0]}},
        "motion": {
            "type": "table",
            "table": [[0.0, 3.0], [10.0, 3.0], [25.0, 1.0], [35.0, 1.0], [55.0, 5.0], [60.0, 5.0]],
        },
        "loads": {"tip_force": [[0.0, 0.0, 0.0], [5.0, 0.0, 5.0], [60.0, 0.0, 5.0]]},
        "mesh": {"elements": 8},
        "time": {"end": 60.0, "step": 0.05},
    },
}
for _tables in SCENES.values():  # what their recorded errors are about
    _tables.setdefault("initial", {}).setdefault("state", "undeformed")
