"""Ten scenes more on which explanations are held against the truth, small enough that it takes seconds."""

from __future__ import annotations

from typing import Any

from explain_scenes import ARM, BLADE, PLATE, THIN

#: A tube of aluminium.
TUBE = {"E": 7.0e10, "nu": 0.33, "rho": 2700.0, "shape": "tube", "outer_radius": 0.03, "wall": 0.002}
#: A lamina of carbon fibres along the blade.
LAMINA = {"E1": 1.2e11, "E2": 9.0e9, "nu12": 0.3, "G12": 5.0e9, "rho": 1600.0}

FURTHER: dict[str, dict[str, Any]] = {
    "pitch step": {
        "structure": {
            **{"type": "spatial_beam", "length": 3.0, "hub_radius": 0.3, "section": TUBE, "tip_mass": 0.3},
            "root": {"flap_stiffness": 4000.0, "lag_stiffness": 2.0e4, "pitch": [[0, 0.0], [0.1, 0.0], [0.3, "6 deg"]]},
        },
        "motion": {"type": "constant", "speed": 20.0},
        "loads": {"distributed": [0.0, 5.0, 30.0]},
        "mesh": {"elements": 2},
        "time": {"end": 0.5, "step": 0.005},
    },
    "hub, mass beside the axis": {
        "structure": {
            **{"type": "spatial_beam", "length": 2.5, "hub_radius": 0.2, "section": TUBE, "precone": 0.05},
            **{"tip_mass": 0.5, "tip_offset": [0.0, 0.04, 0.0], "damping": {"rayleigh": [0.0, 5e-4]}},
        },
        "motion": {
            **{"type": "torque", "hub_inertia": 4.0, "speed": 6.0},
            "table": [[0, 0], [0.1, 40.0], [0.5, 40.0], [0.55, -30.0], [0.8, 0.0]],
        },
        "mesh": {"elements": 2},
        "time": {"end": 0.8, "step": 0.01},
    },
    "plate, load near a corner": {
        "structure": {**PLATE, "thickness": 0.01, "hub_radius": 0.15, "damping": {"kelvin_voigt": 2e-4}},
        "motion": {"type": "constant", "speed": 55.0, "axis": [0, 1, 0]},
        "loads": {
            "at": [{"x": [0.9, 0.2], "force": [[0, 0, 0, 0], [0.01, 0, 0, 60.0], [0.06, 0, 0, 60.0], [0.065, 0, 0, 0]]}]
        },
        "mesh": {"elements": [3, 2]},
        "time": {"end": 0.08, "step": 0.001},
    },
    "follower, spin-up": {
        "structure": {"type": "planar_beam", "length": 3.0, "section": THIN | {"EI": 600.0}, "hub_radius": 0.3},
        "motion": {"type": "spin_up", "speed": 8.0, "duration": 0.8},
        "loads": {"tip_force": {"over_time": [[0, 0, 0], [0.4, 0, 25.0], [1.5, 0, 25.0]], "kind": "follower"}},
        "mesh": {"elements": 4},
        "time": {"end": 1.5, "step": 0.005},
    },
    "prebent, once a turn": {
        "structure": {
            **{"type": "spatial_beam", "hub_radius": 0.3, "section": BLADE, "damping": {"modal": 0.03}},
            "line": [[0, 0, 0], [1.5, 0, 0.01], [3.0, 0, 0.08], [4.5, 0.03, 0.2], [6.0, 0.1, 0.4]],
        },
        "motion": {"type": "constant", "speed": 14.0},
        "loads": {"distributed": {"value": [0, 3.0, 15.0], "harmonic": {"amplitude": [0, 1.0, 12.0], "per_rev": 1}}},
        "mesh": {"elements": 4},
        "time": {"end": 0.8, "step": 0.008},
    },
    "lamina spins down": {
        "structure": {**LAMINA, "type": "plate", "length": 0.8, "width": 0.3, "thickness": 0.006, "hub_radius": 0.1},
        "motion": {"type": "table", "table": [[0, 90.0], [0.02, 90.0], [0.12, 30.0], [0.2, 30.0]], "axis": [0, 1, 0]},
        "initial": {"state": "steady"},
        "loads": {"pressure": {"value": 300.0, "kind": "follower"}},
        "mesh": {"elements": [3, 2]},
        "time": {"end": 0.15, "step": 0.0015},
    },
    "shaken, second order": {
        "structure": {
            **{"type": "planar_beam", "length": 5.0, "section": THIN, "hub_radius": 0.1},
            "masses": [{"x": 2.5, "mass": 2.0, "inertia": 0.05}],
        },
        "motion": {
            **{"type": "constant", "speed": 9.0},
            "base_acceleration": [[0, 0, 0], [0.2, 3, 8.0], [0.5, -3, -8.0], [0.8, 2, 5.0], [1.0, 0, 0]],
        },
        "model": {"theory": "second_order"},
        "mesh": {"elements": 4},
        "time": {"end": 2.0, "step": 0.008},
    },
    "linear, without Coriolis": {
        "structure": {"type": "planar_beam", "length": 6.0, "section": THIN, "tip_mass": 0.8, "hub_radius": 0.5},
        "motion": {"type": "table", "table": [[0, 2.0], [0.5, 2.0], [1.3, 7.0], [3.0, 7.0]]},
        "loads": {"gravity": [0.0, -9.81]},
        "model": {
            **{"theory": "consistent_linear"},
            "effects": ["centrifugal", "euler", "gravity", "rotary_inertia", "tip_mass"],
        },
        "mesh": {"elements": 3},
        "time": {"end": 3.0, "step": 0.01},
    },
    "hub with a hinge": {
        "structure": {
            **{"type": "planar_beam", "length": 0.9, "section": ARM, "hub_radius": 0.06},
            "root": {"lag_stiffness": 12.0, "lag_damping": 0.05, "hinge_offset": 0.03},
        },
        "motion": {
            **{"type": "torque", "hub_inertia": 1.5e-2, "hub_damping": 2e-3, "speed": 20.0},
            "pulses": [[0.05, 0.1, 1.5], [0.3, 0.35, -2.0]],
        },
        "mesh": {"elements": 4},
        "time": {"end": 0.6, "step": 0.0015},
    },
    "thin triangles, steady": {
        "structure": {**PLATE, "thickness": 0.012, "hub_radius": 0.3, "point_masses": [[0.9, 0.1, 1.5]]},
        "motion": {"type": "constant", "speed": 45.0, "axis": [0.2, 1, 0]},
        "loads": {"pressure": {"over_span": [[0.3, 400.0], [1.0, 900.0]], "kind": "follower"}},
        "mesh": {"elements": [4, 2], "cell": "triangle"},
        "modes": {"count": 4},
    },
}
