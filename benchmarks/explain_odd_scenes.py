"""Ten scenes of kinds that the others leave out, on which explanations are held against the truth, all small."""

from __future__ import annotations

from typing import Any

from explain_further_scenes import LAMINA, TUBE
from explain_scenes import ARM, BLADE, PLATE, THICK, THIN

ODD: dict[str, dict[str, Any]] = {
    "pulled and let go": {
        "structure": {"type": "planar_beam", "length": 1.0, "section": THICK, "hub_radius": 0.1, "tip_mass": 0.3},
        "motion": {"type": "constant", "speed": 1.2},
        "loads": {"tip_force": [[0, 0, 0], [0.1, 8.0, 0.02], [0.6, 8.0, 0.02], [0.61, 0, 0]]},
        "mesh": {"elements": 4},
        "time": {"end": 3.0, "step": 0.01},
    },
    "thrown": {
        "structure": {
            **{"type": "planar_beam", "length": 4.0, "section": THIN | {"EI": 2.0e3}, "hub_radius": 0.4},
            "masses": [{"x": 3.0, "mass": 1.0}],
        },
        "motion": {"type": "spin_up", "speed": 12.0, "duration": 0.6},
        "initial": {"velocity": [[0, 0, 0], [2.0, 0, 0.6], [4.0, 0, 2.0]]},
        "mesh": {"elements": 4},
        "time": {"end": 1.2, "step": 0.004},
    },
    "second flap mode": {
        "structure": {
            **{"type": "spatial_beam", "length": 5.0, "hub_radius": 0.25, "section": BLADE},
            **{"pretwist": [[0.0, 0.25], [5.0, 0.0]], "damping": {"kelvin_voigt": 5e-4}},
        },
        "motion": {"type": "constant", "speed": 18.0},
        "initial": {"state": "steady", "mode": 2, "amplitude": 0.05},
        "mesh": {"elements": 3},
        "time": {"end": 0.6, "step": 0.004},
    },
    "von Karman on a spring": {
        "structure": {
            **{"type": "planar_beam", "length": 5.0, "section": THIN, "hub_radius": 0.2},
            "root": {"lag_stiffness": 2.5e4, "lag_damping": 40.0},
        },
        "motion": {"type": "table", "table": [[0, 3.0], [1.0, 9.0], [2.5, 9.0]]},
        "loads": {"gravity": [0.0, -9.81]},
        "model": {"theory": "von_karman"},
        "mesh": {"elements": 3},
        "time": {"end": 2.5, "step": 0.008},
    },
    "plate under a tone": {
        "structure": {**PLATE, "thickness": 0.008, "hub_radius": 0.1, "damping": {"rayleigh": [4.0, 0.0]}},
        "motion": {"type": "constant", "speed": 40.0, "axis": [0, 1, 0]},
        "loads": {"pressure": {"harmonic": {"amplitude": 150.0, "frequency": 70.0}}},
        "mesh": {"elements": [4, 2]},
        "time": {"end": 0.3, "step": 0.002},
    },
    "panel about its length": {
        "structure": {
            **{**LAMINA, "type": "plate", "length": 1.0, "width": 0.4, "thickness": 0.012},
            **{"line_masses": {"tip": 1.5}, "damping": {"kelvin_voigt": 1e-4}},
        },
        "motion": {
            **{"type": "spin_up", "speed": 25.0, "duration": 0.1, "axis": [1, 0.2, 0]},
            "base_acceleration": [[0, 0, 0, 0], [0.01, 0, 0, 20.0], [0.05, 0, 0, 20.0], [0.06, 0, 0, 0]],
        },
        "mesh": {"elements": [4, 2]},
        "time": {"end": 0.2, "step": 0.002},
    },
    "swept blade, steady": {
        "structure": {
            **{"type": "spatial_beam", "length": 6.0, "hub_radius": 0.4, "section": BLADE, "precone": 0.03},
            **{"sweep": [[0, 0.0], [3.0, 0.0], [6.0, 0.35]], "pretwist": [[0.0, 0.2], [6.0, -0.05]]},
        },
        "motion": {"type": "constant", "speed": 15.0},
        "loads": {"distributed": {"over_span": [[0, 0, 0, 10.0], [6.0, 0, 4.0, 60.0]], "kind": "follower"}},
        "mesh": {"elements": 3},
        "modes": {"count": 5},
    },
    "boom on a satellite": {
        "structure": {
            **{"type": "planar_beam", "length": 2.0, "section": ARM | {"EI": 30.0}, "hub_radius": 0.3},
            **{"tip_mass": 0.1, "tip_inertia": 2e-4, "damping": {"modal": 0.01}},
        },
        "motion": {"type": "torque", "hub_inertia": 0.8, "table": [[0, 0], [0.2, 1.5], [0.8, 1.5], [1.0, 0.0]]},
        "loads": {"tip_force": [[0, 0, 0], [1.0, 0, 0], [1.05, 0, 0.15], [1.3, 0, 0.15], [1.35, 0, 0]]},
        "mesh": {"elements": 4},
        "time": {"end": 1.6, "step": 0.004},
    },
    "tube at a tone, Newmark": {
        "structure": {
            **{"type": "spatial_beam", "length": 3.0, "hub_radius": 0.2, "section": TUBE, "precone": 0.05},
            **{"damping": {"modal": 0.02}, "root": {"flap_stiffness": 5000.0}},
        },
        "motion": {"type": "constant", "speed": 15.0},
        "loads": {
            "at": [{"x": 2.0, "force": {"harmonic": {"amplitude": [0.0, 3.0, 10.0], "per_rev": 2}}}],
            "gravity": [0.0, 0.0, -9.81],
        },
        "mesh": {"elements": 3},
        "time": {"end": 0.8, "step": 0.005, "scheme": "newmark"},
    },
    "hub with a lamina": {
        "structure": {**LAMINA, "type": "plate", "length": 1.2, "width": 0.3, "thickness": 0.008, "hub_radius": 0.1},
        "motion": {
            **{"type": "torque", "hub_inertia": 6.0, "axis": [0, 1, 0], "speed": 5.0},
            "table": [[0, 0], [0.05, 60.0], [0.25, 60.0], [0.3, 0.0]],
        },
        "mesh": {"elements": [3, 2]},
        "time": {"end": 0.4, "step": 0.004},
    },
}
