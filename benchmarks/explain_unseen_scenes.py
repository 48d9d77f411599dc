"""Eight scenes written after the explanations were settled, some in steps that are too long for their motion."""

from __future__ import annotations

from typing import Any

from explain_further_scenes import LAMINA, TUBE
from explain_scenes import ARM, BLADE, PLATE, THIN

UNSEEN: dict[str, dict[str, Any]] = {
    "crane, gusts": {
        "structure": {
            **{"type": "planar_beam", "length": 7.0, "section": THIN | {"EI": 8.0e3}, "tip_mass": 1.5},
            **{"hub_radius": 0.6, "damping": {"rayleigh": [0.1, 2e-4]}},
        },
        "motion": {"type": "table", "table": [[0, 0], [0.8, 1.5], [2.0, 4.0], [3.0, 4.0], [4.0, 1.0]]},
        "loads": {"distributed": {"over_time": [[0, 0, 0], [1.0, 0, 4.0], [1.4, 0, -3.0], [2.0, 0, 2.0], [5.0, 0, 0]]}},
        "mesh": {"elements": 5},
        "time": {"end": 5.0, "step": 0.01},
    },
    "whip, long steps": {
        "structure": {"type": "planar_beam", "length": 3.0, "section": THIN | {"EI": 900.0}, "hub_radius": 0.2},
        "motion": {"type": "spin_up", "speed": 9.0, "duration": 1.0},
        "loads": {"at": [{"x": 2.0, "force": [[0, 0, 0], [1.2, 0, 0], [1.25, 0, 50.0], [1.3, 0, 0], [3.0, 0, 0]]}]},
        "mesh": {"elements": 4},
        "time": {"end": 3.0, "step": 0.03},
    },
    "arm at a tone, free hub": {
        "structure": {"type": "planar_beam", "length": 0.7, "section": ARM, "hub_radius": 0.04, "tip_mass": 0.015},
        "motion": {
            **{"type": "torque", "hub_inertia": 4e-3, "speed": 12.0},
            "pulses": [[0.1, 0.15, 0.8], [0.3, 0.4, -0.5]],
        },
        "loads": {"tip_force": {"harmonic": {"amplitude": [0.0, 0.3], "frequency": 6.0}}},
        "mesh": {"elements": 4},
        "time": {"end": 0.8, "step": 0.002},
    },
    "twisted blade spins up": {
        "structure": {
            **{"type": "spatial_beam", "length": 4.0, "hub_radius": 0.3, "section": BLADE, "precone": 0.04},
            **{"pretwist": [[0.0, 0.35], [4.0, 0.05]], "tip_mass": 0.4},
        },
        "motion": {"type": "spin_up", "speed": 16.0, "duration": 0.6},
        "loads": {"distributed": [0.0, 4.0, 25.0], "gravity": [0.0, 0.0, -9.81]},
        "mesh": {"elements": 3},
        "time": {"end": 1.0, "step": 0.008},
    },
    "tube, dropped load": {
        "structure": {
            **{"type": "spatial_beam", "length": 2.0, "section": TUBE, "hub_radius": 0.15},
            **{"damping": {"kelvin_voigt": 2e-4}, "root": {"flap_stiffness": 8000.0}},
        },
        "motion": {"type": "constant", "speed": 30.0},
        "initial": {"state": "steady"},
        "loads": {"tip_force": [[0, 0, 5.0, 40.0], [0.02, 0, 5.0, 40.0], [0.021, 0, 0, 0], [1.0, 0, 0, 0]]},
        "mesh": {"elements": 3},
        "time": {"end": 0.3, "step": 0.004},
    },
    "plate by a table": {
        "structure": {**PLATE, "thickness": 0.009, "hub_radius": 0.2, "damping": {"kelvin_voigt": 1e-4}},
        "motion": {"type": "table", "table": [[0, 0], [0.05, 20.0], [0.2, 50.0], [0.3, 50.0]], "axis": [0, 1, 0]},
        "loads": {"pressure": {"over_time": [[0, 0], [0.02, 120.0], [0.15, 120.0], [0.2, 30.0], [0.4, 30.0]]}},
        "mesh": {"elements": [3, 2]},
        "time": {"end": 0.25, "step": 0.002},
    },
    "lamina, long steps": {
        "structure": {**LAMINA, "type": "plate", "length": 0.9, "width": 0.3, "thickness": 0.01, "hub_radius": 0.1},
        "motion": {"type": "constant", "speed": 60.0, "axis": [0, 1, 0.1]},
        "loads": {"tip_force": [[0, 0, 0, 0], [0.01, 0, 0, 15.0], [0.05, 0, 0, 15.0], [0.06, 0, 0, 0]]},
        "mesh": {"elements": [3, 2]},
        "time": {"end": 0.15, "step": 0.004},
    },
    "tilted blade, steady": {
        "structure": {
            **{"type": "spatial_beam", "length": 5.0, "hub_radius": 0.5, "section": BLADE, "precone": 0.08},
            **{"pretwist": [[0.0, 0.3], [5.0, 0.0]], "masses": [{"x": 3.0, "mass": 1.0}]},
        },
        "motion": {"type": "constant", "speed": 11.0},
        "loads": {"tip_force": {"value": [0.0, 5.0, 40.0], "kind": "follower"}},
        "mesh": {"elements": 4},
        "modes": {"count": 5},
    },
}
