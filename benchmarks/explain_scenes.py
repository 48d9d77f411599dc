"""Scenes of different character on which estimates are held against the truth: slow and fast, thin and thick, …"""

from __future__ import annotations

from typing import Any

from rotfem.scene import Scene

#: Kane, Ryan & Banerjee (1987) as in Simo & Vu-Quoc (1986).
THIN = {"EA": 2.8e7, "GA": 1.0e7, "EI": 1.4e4, "mass_per_length": 1.2, "rotary_inertia": 6.0e-4}
#: L/r = 20.
THICK = {"EA": 400.0, "GA": 130.0, "EI": 1.0, "mass_per_length": 1.0, "rotary_inertia": 1 / 400}
#: Yigit, Scott & Ulsoy (1988).
ARM = {"EA": 5.0e5, "GA": 1.6e5, "EI": 5.5, "mass_per_length": 0.0858, "rotary_inertia": 9.4e-7}
#: ICCIA (2017).
HUB_BEAM = {"E": 6.8952e10, "nu": 0.3, "rho": 2766.0, "area": 7.2986e-5, "second_moment": 8.2189e-9}
#: A blade that is softer in flap than in lag.
BLADE = {
    **{"EA": 2.0e7, "GA2": 6.0e6, "GA3": 6.0e6, "GJ": 8.0e3, "EI2": 1.0e4, "EI3": 4.0e4},
    **{"mass_per_length": 1.5, "rotary_inertia2": 7.5e-4, "rotary_inertia3": 3.0e-3},
}


def _beam(length: float, section: dict[str, float], **more: Any) -> dict[str, Any]:
    return {"type": "planar_beam", "length": length, "section": section, **more}


def _spin_up(speed: float, duration: float) -> dict[str, Any]:
    return {"type": "spin_up", "speed": speed, "duration": duration}


#: Plates: a thin one that bends out of its plane, a thick one that spins about its normal.
PLATE = {"type": "plate", "length": 1.0, "width": 0.5, "E": 70e9, "nu": 0.3, "rho": 2700.0}

SCENES: dict[str, dict[str, Any]] = {
    "spin-up": {
        "structure": _beam(10.0, THIN),
        "motion": _spin_up(6.0, 15.0),
        "time": {"end": 20.0, "step": 0.01},
    },
    "slow": {
        "structure": _beam(10.0, THIN),
        "motion": _spin_up(0.5, 20.0),
        "time": {"end": 25.0, "step": 0.02},
    },
    "fast": {
        "structure": _beam(10.0, THIN, hub_radius=2.0),
        "motion": _spin_up(30.0, 20.0),
        "time": {"end": 22.0, "step": 0.01},
    },
    "thick": {
        "structure": _beam(1.0, THICK),
        "motion": _spin_up(2.0, 4.0),
        "time": {"end": 6.0, "step": 0.005},
    },
    "released on a hub": {
        "structure": _beam(8.0, HUB_BEAM, hub_radius=1.0),
        "motion": {"type": "constant", "speed": 4.0},
        "initial": {"tip_displacement": 0.4},
        "time": {"end": 8.0, "step": 0.008},
    },
    "tip mass": {
        "structure": _beam(10.0, THIN, tip_mass=3.0, tip_inertia=0.05),
        "motion": _spin_up(3.0, 15.0),
        "time": {"end": 20.0, "step": 0.02},
    },
    "torque": {
        "structure": _beam(0.5, ARM, hub_radius=0.05),
        "motion": {"type": "torque", "hub_inertia": 2.0e-3, "pulses": [[0.0, 0.1, 0.1], [0.1, 0.2, -0.1]]},
        "time": {"end": 0.5, "step": 0.0005},
    },
    "base": {
        "structure": _beam(10.0, THIN, hub_radius=0.5),
        "motion": {
            **{"type": "constant", "speed": 2.0},
            "base_acceleration": [[0, 0, 0], [0.5, 0, 0.4], [1.5, 0.2, -0.4], [2.0, 0, 0]],
        },
        "time": {"end": 8.0, "step": 0.008},
    },
    "gravity": {
        "structure": _beam(10.0, THIN, tip_mass=0.5),
        "motion": {"type": "constant", "speed": 3.0},
        "loads": {"gravity": [0.0, -0.5]},
        "time": {"end": 8.0, "step": 0.008},
    },
    "damped": {
        "structure": _beam(10.0, THIN, damping={"kelvin_voigt": 2e-3, "rayleigh": [0.05, 0.0]}),
        "motion": {"type": "constant", "speed": 2.0},
        "loads": {"tip_force": [[0, 0, 0], [0.2, 0, 5.0], [3.0, 0, 5.0], [3.2, 0, 0]]},
        "time": {"end": 8.0, "step": 0.008},
    },
    "large deflection": {
        "structure": _beam(10.0, THIN),
        "motion": {"type": "constant", "speed": 1.0},
        "loads": {"tip_force": {"table": [[0, 0, 0], [4.0, 0, 250.0]], "kind": "follower"}},
        "time": {"end": 8.0, "step": 0.008},
    },
    "stretched, steady": {
        "structure": _beam(1.0, THICK, hub_radius=0.3, tip_mass=0.2),
        "motion": {"type": "constant", "speed": 1.5},
        "loads": {"tip_force": [0.0, 0.2]},
    },
    "flap and lag": {
        "structure": {
            **{"type": "spatial_beam", "length": 10.0, "hub_radius": 0.5, "section": BLADE},
            **{"pretwist": [[0.0, 0.3], [10.0, 0.0]], "precone": 0.05},
        },
        "motion": _spin_up(5.0, 5.0),
        "loads": {"tip_force": [[0, 0, 0, 0], [1.0, 0, 0, 30.0]]},
        "mesh": {"elements": 8},
        "time": {"end": 8.0, "step": 0.02},
    },
    "plate, spin-up": {
        "structure": {**PLATE, "thickness": 0.01, "hub_radius": 0.3, "point_masses": [[1.0, 0.0, 2.0]]},
        "motion": {**_spin_up(40.0, 0.5), "axis": [0, 1, 0]},
        "mesh": {"elements": [6, 3]},
        "time": {"end": 0.8, "step": 0.002},
    },
    "thick plate, steady": {
        "structure": {**PLATE, "thickness": 0.08, "hub_radius": 1.0},
        "motion": {"type": "constant", "speed": 150.0, "axis": [0.3, 0, 1]},
        "loads": {"tip_force": [0, 0, 2.0e4]},
        "mesh": {"elements": [6, 3]},
    },
}


#: A turbine blade of steel, flat at the tip, with its mass behind the elastic axis.
STEEL_BLADE = {
    **{"E": 2.1e11, "nu": 0.3, "rho": 7800.0, "shape": "rectangle", "width": 0.12, "height": 0.02},
    "mass_center": [-0.01, 0.0],
}
#: A shaker arm of aluminium whose height halves towards the tip.
TAPERED = {"E": 7.0e10, "nu": 0.33, "rho": 2700.0, "shape": "rectangle", "width": 0.05}

#: Scenes of ten further kinds, made after the estimates were settled.
FRESH: dict[str, dict[str, Any]] = {
    "propeller, table": {
        "structure": _beam(1.5, TAPERED | {"height": [[0.0, 0.03], [1.5, 0.012]]}, hub_radius=0.1),
        "motion": {"type": "table", "table": [[0, 0], [0.15, 60.0], [0.4, 60.0], [0.5, 25.0], [0.8, 30.0]]},
        "mesh": {"elements": 6},
        "time": {"end": 1.0, "step": 0.002},
    },
    "once a turn": {
        "structure": _beam(10.0, THIN, tip_mass=1.0, damping={"kelvin_voigt": 5e-3}),
        "motion": {"type": "constant", "speed": 4.2},
        "loads": {"gravity": [0.0, -2.0]},
        "mesh": {"elements": 5},
        "time": {"end": 12.0, "step": 0.02},
    },
    "moment pulse": {
        "structure": _beam(2.0, THICK, hub_radius=0.5),
        "motion": {"type": "constant", "speed": 0.8},
        "loads": {"tip_moment": [[0, 0], [1.0, 0], [1.2, 0.02], [1.4, 0]]},
        "mesh": {"elements": 4, "degree": 2},
        "time": {"end": 20.0, "step": 0.05},
    },
    "hub, table": {
        "structure": _beam(0.8, ARM, hub_radius=0.02, tip_mass=0.01),
        "motion": {
            **{"type": "torque", "hub_inertia": 5.0e-3, "hub_damping": 1.0e-3},
            "table": [[0.0, 0.0], [0.05, 0.4], [0.25, 0.4], [0.3, 0.0]],
        },
        "mesh": {"elements": 6},
        "time": {"end": 0.6, "step": 0.002},
    },
    "spin-down": {
        "structure": _beam(8.0, HUB_BEAM, hub_radius=0.4, damping={"rayleigh": [0.0, 1e-3]}),
        "motion": {"type": "table", "table": [[0, 8.0], [1.0, 8.0], [4.0, 0.5], [6.0, 0.5]]},
        "initial": {"state": "steady"},
        "loads": {"tip_force": [0.0, 0.3]},
        "time": {"end": 8.0, "step": 0.01},
    },
    "gusts on a blade": {
        "structure": {
            **{"type": "spatial_beam", "length": 2.0, "hub_radius": 0.2, "section": STEEL_BLADE},
            **{"pretwist": [[0.0, 0.4], [2.0, 0.1]], "damping": {"kelvin_voigt": 1e-4}},
        },
        "motion": {"type": "constant", "speed": 40.0},
        "loads": {
            "distributed": {
                "over_time": [[0, 0, 0, 0], [0.1, 0, 20.0, 150.0], [0.3, 0, 20.0, 150.0], [0.35, 0, 0, 40.0]]
            }
        },
        "mesh": {"elements": 6},
        "time": {"end": 0.6, "step": 0.001},
    },
    "coned rotor, steady": {
        "structure": {
            **{"type": "spatial_beam", "length": 10.0, "hub_radius": 0.5, "section": BLADE, "precone": 0.1},
            **{"tip_mass": 1.0, "tip_offset": [0.0, 0.05, 0.0]},
        },
        "motion": {"type": "constant", "speed": 8.0},
        "loads": {"distributed": [0.0, 0.0, 12.0]},
        "mesh": {"elements": 4},
        "modes": {"count": 4},
    },
    "plate in its plane": {
        "structure": {**PLATE, "thickness": 0.02, "hub_radius": 0.1},
        "motion": {"type": "table", "table": [[0, 0], [0.02, 150.0], [0.05, 150.0]], "interpolation": "linear"},
        "loads": {"tip_force": [[0, 0, 0, 0], [0.01, 0, 0, 300.0], [0.03, 0, 0, 300.0], [0.035, 0, 0, 0]]},
        "mesh": {"elements": [6, 3]},
        "time": {"end": 0.06, "step": 0.0005},
    },
    "modes of a spinning plate": {
        "structure": {**PLATE, "thickness": 0.015, "hub_radius": 0.25},
        "motion": {"type": "constant", "speed": 90.0, "axis": [0, 1, 0]},
        "mesh": {"elements": [6, 4]},
        "modes": {"count": 5},
    },
    "hub with a plate": {
        "structure": {**PLATE, "length": 2.0, "thickness": 0.01, "hub_radius": 0.2},
        "motion": {"type": "torque", "hub_inertia": 60.0, "axis": [0, 1, 0], "pulses": [[0.0, 0.2, 120.0]]},
        "mesh": {"elements": [6, 2]},
        "time": {"end": 0.8, "step": 0.004},
    },
}


def scene(name: str) -> Scene:
    """Return one of the scenes; beams on 10 elements of degree 3 where they do not say."""
    tables = {"mesh": {"elements": 10}, **(SCENES | FRESH)[name]}
    initial = {"state": "undeformed", **tables.get("initial", {})}  # what the recorded errors are about
    return Scene.from_dict({**tables, "initial": initial}, name.replace(" ", "_"))
