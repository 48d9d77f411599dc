"""Three sets of scenes written after the error estimates were finished; no estimate was changed for one of them.

Each is name ↦ tables, for accuracy_scenes.py --set unseen, further or last: a structure, what moves it, a mesh and
steps. There are planar and spatial beams, plates, one of them of a mesh file, free hubs, hinges, pitch, dampers,
follower loads, steady states, all theories and schemes, fixed and adaptive steps.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from held_out_scenes import made

Tables = dict[str, Any]

SLAT = {
    **{"type": "planar_beam", "length": 2.4},
    "section": {"E": 6.9e10, "nu": 0.33, "rho": 2710.0, "shape": "rectangle", "width": 0.06, "height": 0.008},
}
ROD = {"E": 2.1e11, "nu": 0.3, "rho": 7850.0, "shape": "tube", "outer_radius": 0.012, "wall": 0.002}
GLASS = {
    **{"EA": 9.0e6, "GA2": 2.0e6, "GA3": 1.5e6, "GJ": 600.0, "EI2": 900.0, "EI3": 1.2e4},
    **{"mass_per_length": 0.9, "rotary_inertia2": 4.0e-5, "rotary_inertia3": 1.1e-3},
}
WING = {"type": "spatial_beam", "length": 3.5, "hub_radius": 0.25, "section": GLASS, "damping": {"rayleigh": [0.2, 0]}}
SHEET = {"type": "plate", "length": 0.6, "width": 0.25, "thickness": 0.004, "E": 7.0e10, "nu": 0.33, "rho": 2700.0}
OAR = {
    **{"type": "planar_beam", "length": 3.0, "hub_radius": 0.2},
    "section": {"E": 1.2e10, "nu": 0.3, "rho": 600.0, "shape": "circle", "radius": 0.025},
}
FEELER = {
    **{"type": "planar_beam", "length": 0.3},
    "section": {"E": 2.1e11, "nu": 0.3, "rho": 7850.0, "shape": "rectangle", "width": 0.02, "height": 0.001},
}
SPAR = {
    **{"type": "spatial_beam", "length": 8.0, "hub_radius": 0.4, "pretwist": [[0.0, 0.2], [8.0, 0.0]]},
    "section": {
        **{"EA": 5.0e7, "GA2": 1.0e7, "GA3": 8.0e6, "GJ": 2.0e4, "EI2": 3.0e4, "EI3": 3.0e5},
        **{"mass_per_length": 5.0, "rotary_inertia2": 3.0e-3, "rotary_inertia3": 3.0e-2},
    },
}
PANEL = {"type": "plate", "length": 0.8, "width": 0.3, "thickness": 0.006, "E": 7.0e10, "nu": 0.3, "rho": 2700.0}
FOIL = {"type": "plate", "length": 0.7, "width": 0.35, "thickness": 0.005, "E": 71e9, "nu": 0.33, "rho": 2780.0}
CANE = {"EA": 3.0e6, "GA": 9e5, "EI": 900.0, "mass_per_length": 0.55, "rotary_inertia": 1.2e-4}
FLAPPING = {
    "EA": 26000000.0,
    "GA2": 7000000.0,
    "GA3": 6000000.0,
    "GJ": 5000.0,
    "EI2": 7000.0,
    "EI3": 60000.0,
    "mass_per_length": 1.9,
    "rotary_inertia2": 0.0006,
    "rotary_inertia3": 0.005,
}
STILL, SLOW, TURNING = ({"type": "constant", "speed": speed} for speed in (0.0, 6.0, 5.0))
RAMP = {"type": "spin_up", "speed": 12.0, "duration": 1.5}
SPIN_UP = {"type": "spin_up", "speed": 8.0, "duration": 2.0}
HUB = {"type": "torque", "hub_inertia": 0.8, "pulses": [[0.0, 0.3, 4.0], [0.7, 1.0, -4.0]]}
OAR_HUB = {"type": "torque", "hub_inertia": 2.0, "pulses": [[0.0, 0.4, 8.0], [0.8, 1.2, -8.0]]}
DAMPED = {"rayleigh": [0.4, 1e-4]}
LINEAR, KARMAN = {"theory": "consistent_linear"}, {"theory": "von_karman"}


def _push(force: list[float], start: float, rise: float, length: float) -> list[list[float]]:
    """Return rows (t, force) of a push that rises, stays and ends."""
    none = [0.0] * len(force)
    rows = [[0.0, *none], [start, *none], [start + rise, *force], [start + rise + length, *force]]
    return [*rows, [start + 2 * rise + length, *none]]


def _ramp(force: list[float], start: float, rise: float) -> list[list[float]]:
    """Return rows (t, force) of a load that rises and stays."""
    none = [0.0] * len(force)
    return [[0.0, *none], [start, *none], [start + rise, *force], [1e3, *force]]


def _scene(structure: Tables, motion: Tables, elements: Any, time: Tables | None, **more: Any) -> Tables:
    mesh = {} if elements is None else {"mesh": {"elements": elements, **more.pop("mesh", {})}}
    out = {"structure": structure, "motion": motion, **mesh, **more}
    return out if time is None else {**out, "time": time, "initial": {"state": "undeformed", **more.get("initial", {})}}


def _fixed(end: float, step: float, scheme: str = "generalised_alpha") -> Tables:
    return {"end": end, "step": step, "scheme": scheme}


def _adaptive(end: float, tolerance: float, scheme: str, row: float | None = None) -> Tables:
    return {"end": end, "tolerance": tolerance, "scheme": scheme, "output_step": row or end / 100}


PUSHED = {"tip_force": _push([0.0, 4.0], 0.05, 0.1, 0.4)}
PUSHED_UP = {"tip_force": _push([0.0, 0.0, 12.0], 0.05, 0.1, 0.3)}
PULL, FLAP = {"tip_force": _ramp([0.0, 30.0], 0.1, 0.3)}, {"tip_force": _ramp([0.0, 10.0, 80.0], 0.1, 0.3)}

UNSEEN: dict[str, Tables] = {
    "slat pushed": _scene(SLAT, STILL, 4, _fixed(2.0, 0.01), loads=PUSHED),
    "slat pushed, esdirk4": _scene(SLAT, STILL, 4, _fixed(2.0, 0.04, "esdirk4"), loads=PUSHED),
    "slat pushed, radau5": _scene(SLAT, STILL, 4, _fixed(2.0, 0.05, "radau5"), loads=PUSHED),
    "slat pushed, to 1e-3": _scene(SLAT, STILL, 4, _adaptive(2.0, 1e-3, "esdirk4", 0.02), loads=PUSHED),
    "slat pushed, radau5 to 1e-4": _scene(SLAT, STILL, 4, _adaptive(2.0, 1e-4, "radau5", 0.02), loads=PUSHED),
    "slat spun up": _scene(SLAT, RAMP, 6, _fixed(2.5, 0.005)),
    "slat spun up, esdirk4 to 1e-3": _scene(SLAT, RAMP, 6, _adaptive(2.5, 1e-3, "esdirk4", 0.025)),
    "slat spun up, linear elements": _scene(SLAT, RAMP, 12, _fixed(2.5, 0.005), mesh={"degree": 1}),
    "slat on a free hub": _scene(SLAT, HUB, 4, _fixed(1.4, 0.005)),
    "slat on a free hub, to 1e-3": _scene(SLAT, HUB, 4, _adaptive(1.4, 1e-3, "esdirk4", 0.02)),
    "slat with a heavy tip let go": _scene(
        {**SLAT, "tip_mass": 1.5}, STILL, 3, _fixed(4.0, 0.02), initial={"tip_displacement": 0.2}
    ),
    "rod in gravity on a turning hub, von Kármán": _scene(
        {"type": "planar_beam", "length": 3.0, "section": ROD},
        SLOW,
        3,
        _fixed(2.0, 0.01),
        loads={"gravity": [0.0, -9.81]},
        model=KARMAN,
    ),
    "rod in gravity on a turning hub, linear": _scene(
        {"type": "planar_beam", "length": 3.0, "section": ROD},
        SLOW,
        3,
        _fixed(2.0, 0.005),
        loads={"gravity": [0.0, -9.81]},
        model=LINEAR,
    ),
    "wing pushed in flap": _scene(WING, SLOW, 4, _fixed(1.5, 0.01), loads=PUSHED_UP),
    "wing pushed in flap, coarse": _scene(WING, SLOW, 2, _fixed(1.5, 0.005), loads=PUSHED_UP, mesh={"degree": 2}),
    "wing pushed in flap, to 1e-3": _scene(WING, SLOW, 4, _adaptive(1.5, 1e-3, "esdirk4", 0.01), loads=PUSHED_UP),
    "wing with a mass inside, spun up": _scene(
        {**WING, "masses": [{"x": 2.0, "mass": 1.0}]}, RAMP, 5, _fixed(2.0, 0.01), loads={"gravity": [0, 0, -9.81]}
    ),
    "wing energy-conserving": _scene(WING, SLOW, 4, _fixed(1.5, 0.01, "energy_conserving"), loads=PUSHED_UP),
    "sheet pushed at the tip": _scene(
        SHEET, STILL, [4, 2], _fixed(0.3, 0.003), loads={"tip_force": _push([0.0, 0.0, 2.0], 0.01, 0.02, 0.05)}
    ),
    "sheet spun up, linear": _scene(
        {**SHEET, "hub_radius": 0.1},
        {"type": "spin_up", "speed": 20.0, "duration": 0.3, "axis": [0, 1, 0]},
        [4, 2],
        _fixed(0.4, 0.002),
        model=LINEAR,
    ),
    "sheet spun up, von Kármán strains linearised": _scene(
        {**SHEET, "hub_radius": 0.1},
        {"type": "spin_up", "speed": 20.0, "duration": 0.3, "axis": [0, 1, 0]},
        [6, 2],
        _fixed(0.4, 0.004),
        model={"theory": "von_karman_linear"},
    ),
}

FURTHER: dict[str, Tables] = {
    "oar pulled": _scene(OAR, STILL, 4, _fixed(3.0, 0.01), loads=PULL),
    "oar pulled, newmark": _scene(OAR, TURNING, 3, _fixed(3.0, 0.01, "newmark"), loads=PULL),
    "oar pulled, esdirk4": _scene(OAR, STILL, 4, _fixed(3.0, 0.03, "esdirk4"), loads=PULL),
    "oar pulled, radau5": _scene(OAR, STILL, 4, _fixed(3.0, 0.03, "radau5"), loads=PULL),
    "oar spun up, to 1e-4": _scene(OAR, SPIN_UP, 4, _adaptive(3.0, 1e-4, "esdirk4")),
    "oar spun up, von Kármán": _scene(OAR, SPIN_UP, 4, _fixed(3.0, 0.01), model={"theory": "von_karman"}),
    "oar spun up, linear": _scene(OAR, SPIN_UP, 4, _fixed(3.0, 0.01), model={"theory": "consistent_linear"}),
    "oar on a free hub": _scene(OAR, OAR_HUB, 4, _fixed(2.0, 0.01)),
    "oar on a free hub, radau5 to 1e-3": _scene(OAR, OAR_HUB, 4, _adaptive(2.0, 1e-3, "radau5")),
    "oar damped, quadratic elements": _scene(
        {**OAR, "damping": DAMPED}, TURNING, 4, _fixed(3.0, 0.01), loads=PULL, mesh={"degree": 2}
    ),
    "feeler let go": _scene(FEELER, STILL, 4, _fixed(0.6, 0.001), initial={"tip_displacement": 0.05}),
    "feeler seen from outside": _scene(
        FEELER, {"type": "spin_up", "speed": 20.0, "duration": 0.4}, 3, _fixed(0.5, 0.001), model={"frame": "inertial"}
    ),
    "spar in flap": _scene(SPAR, TURNING, 4, _fixed(3.0, 0.02), loads=FLAP),
    "spar in flap, esdirk4 to 1e-3": _scene(SPAR, TURNING, 3, _adaptive(3.0, 1e-3, "esdirk4"), loads=FLAP),
    "spar damped, with a mass": _scene(
        {**SPAR, "damping": DAMPED, "masses": [{"x": 5.0, "mass": 10.0}]}, TURNING, 4, _fixed(3.0, 0.02), loads=FLAP
    ),
    "spar pitched": _scene(
        {**SPAR, "root": {"pitch": [[0.0, 0.0], [0.5, 0.0], [1.0, 0.2], [3.0, 0.2]]}}, TURNING, 4, _fixed(3.0, 0.02)
    ),
    "spar at rest under load": _scene(SPAR, TURNING, 2, None, loads={"tip_force": [0.0, 50.0, 200.0]}),
    "spar energy-conserving": _scene(SPAR, TURNING, 3, _fixed(3.0, 0.02, "energy_conserving"), loads=FLAP),
    "panel pushed": _scene(
        {**PANEL, "damping": DAMPED},
        STILL,
        [6, 2],
        _fixed(0.4, 0.004),
        loads={"tip_force": _ramp([0, 0, 3.0], 0.02, 0.05)},
    ),
    "panel spun up, linear": _scene(
        {**PANEL, "hub_radius": 0.1},
        {"type": "spin_up", "speed": 15.0, "duration": 0.4, "axis": [0, 1, 0]},
        [6, 2],
        _fixed(0.5, 0.002),
        model={"theory": "consistent_linear"},
    ),
    "panel to 1e-3": _scene(
        PANEL, STILL, [4, 2], _adaptive(0.3, 1e-3, "esdirk4"), loads={"tip_force": _ramp([0, 0, 3.0], 0.02, 0.05)}
    ),
    "panel of a mesh file": _scene(
        {
            **{"type": "plate", "mesh": made(Path(tempfile.gettempdir())), "thickness": 0.004},
            **{"E": 7.0e10, "nu": 0.33, "rho": 2700.0},
        },
        {"type": "spin_up", "speed": 20.0, "duration": 0.2, "axis": [0, 1, 0]},
        None,
        _fixed(0.3, 0.002),
        model={"theory": "consistent_linear"},
    ),
}

LAST: dict[str, Tables] = {
    "cane swings by a table": {
        "structure": {"type": "planar_beam", "length": 3.5, "section": CANE, "hub_radius": 0.25, "tip_mass": 0.3},
        "motion": {"type": "table", "table": [[0, 1.0], [0.6, 5.0], [1.3, 5.0], [2.0, 0.5], [2.6, 0.5]]},
        "mesh": {"elements": 5},
        "time": {"end": 2.6, "step": 0.01},
    },
    "pole in a gust, newmark": {
        "structure": {
            "type": "planar_beam",
            "length": 6.0,
            "section": {
                "E": 71000000000.0,
                "nu": 0.33,
                "rho": 2780.0,
                "shape": "tube",
                "outer_radius": 0.05,
                "wall": 0.003,
            },
            "damping": {"rayleigh": [0.3, 0.0001]},
        },
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"distributed": [[0, 0, 0], [0.3, 0, 30.0], [0.5, 0, 10.0], [1.0, 0, 45.0], [2.5, 0, 0]]},
        "mesh": {"elements": 4},
        "time": {"end": 2.5, "step": 0.0125, "scheme": "newmark"},
    },
    "reed, follower, esdirk4": {
        "structure": {
            "type": "planar_beam",
            "length": 0.6,
            "section": {
                "E": 205000000000.0,
                "nu": 0.29,
                "rho": 7840.0,
                "shape": "rectangle",
                "width": 0.025,
                "height": 0.0015,
            },
        },
        "motion": {"type": "constant", "speed": 6.0},
        "loads": {
            "tip_force": {"table": [[0, 0, 0], [0.15, -0.5, 1.2], [0.4, -0.5, 1.2], [0.5, 0, 0]], "kind": "follower"}
        },
        "mesh": {"elements": 4},
        "time": {"end": 0.7, "step": 0.005, "scheme": "esdirk4"},
    },
    "cane on a free hub, radau5": {
        "structure": {"type": "planar_beam", "length": 3.5, "section": CANE, "hub_radius": 0.25},
        "motion": {
            "type": "torque",
            "hub_inertia": 8.0,
            "table": [[0, 0], [0.2, 25.0], [0.5, 25.0], [0.7, -15.0], [1.0, 0.0]],
        },
        "mesh": {"elements": 4},
        "time": {"end": 1.4, "step": 0.01, "scheme": "radau5"},
    },
    "lag hinge, harmonic, energy": {
        "structure": {
            "type": "planar_beam",
            "length": 3.5,
            "section": CANE,
            "hub_radius": 0.25,
            "root": {"lag_stiffness": 900.0, "lag_damping": 4.0, "hinge_offset": 0.1},
        },
        "motion": {"type": "constant", "speed": 4.0},
        "loads": {"tip_force": {"harmonic": {"amplitude": [0.0, 12.0], "frequency": 5.0}}},
        "mesh": {"elements": 4},
        "time": {"end": 2.0, "step": 0.01, "scheme": "energy_conserving"},
    },
    "cane spun up, inertial": {
        "structure": {"type": "planar_beam", "length": 3.5, "section": CANE, "hub_radius": 0.25},
        "motion": {"type": "spin_up", "speed": 7.0, "duration": 1.5},
        "model": {"frame": "inertial"},
        "mesh": {"elements": 4},
        "time": {"end": 2.0, "step": 0.008},
    },
    "wing pitched in its weight": {
        "structure": {
            "type": "spatial_beam",
            "length": 5.5,
            "section": FLAPPING,
            "hub_radius": 0.35,
            "precone": 0.03,
            "root": {"pitch": [[0, 0], [0.2, 0], [0.7, 0.3], [1.6, 0.3]]},
        },
        "motion": {"type": "constant", "speed": 7.0},
        "loads": {"gravity": [0.0, -9.81, 0.0]},
        "mesh": {"elements": 4},
        "time": {"end": 1.6, "step": 0.01},
    },
    "flap hinge, per rev, to 1e-3": {
        "structure": {
            "type": "spatial_beam",
            "length": 5.5,
            "section": FLAPPING,
            "hub_radius": 0.35,
            "root": {"flap_stiffness": 2000.0, "flap_damping": 60.0},
        },
        "motion": {"type": "constant", "speed": 11.0},
        "loads": {"distributed": {"harmonic": {"amplitude": [0.0, 4.0, 25.0], "per_rev": 1}}},
        "mesh": {"elements": 3},
        "time": {"end": 1.6, "tolerance": 0.001, "scheme": "esdirk4", "output_step": 0.016},
    },
    "twisted mast shaken, newmark": {
        "structure": {
            "type": "spatial_beam",
            "length": 3.0,
            "section": {
                "E": 71000000000.0,
                "nu": 0.33,
                "rho": 2780.0,
                "shape": "rectangle",
                "width": 0.08,
                "height": 0.03,
            },
            "pretwist": [[0, 0.5], [3.0, 0.0]],
            "tip_mass": 1.5,
        },
        "motion": {
            "type": "constant",
            "speed": 2.0,
            "base_acceleration": [[0, 0, 0, 0], [0.1, 0, 8.0, 3.0], [0.25, 0, -6.0, 0], [0.4, 0, 0, 0]],
        },
        "mesh": {"elements": 3},
        "time": {"end": 0.8, "step": 0.005, "scheme": "newmark"},
    },
    "wing on a free hub": {
        "structure": {
            "type": "spatial_beam",
            "length": 5.5,
            "section": FLAPPING,
            "hub_radius": 0.35,
            "pretwist": [[0, 0.2], [5.5, 0.0]],
        },
        "motion": {
            "type": "torque",
            "hub_inertia": 25.0,
            "pulses": [[0.05, 0.35, 200.0], [0.7, 0.9, -150.0]],
            "speed": 2.0,
        },
        "mesh": {"elements": 3},
        "time": {"end": 1.2, "step": 0.01},
    },
    "sheet pushed at the tip": {
        "structure": FOIL,
        "motion": {"type": "constant", "speed": 0.0},
        "loads": {"tip_force": [[0, 0, 0, 0], [0.03, 0, 0, 2.0], [0.08, 0, 0, 2.0], [0.1, 0, 0, 0]]},
        "mesh": {"elements": [4, 2]},
        "time": {"end": 0.25, "step": 0.0025},
    },
    "sheet by a table, von Karman": {
        "structure": {**FOIL, "hub_radius": 0.15},
        "motion": {"type": "table", "table": [[0, 5.0], [0.1, 25.0], [0.25, 25.0]], "axis": [0, 1, 0]},
        "model": {"theory": "von_karman"},
        "mesh": {"elements": [5, 3]},
        "time": {"end": 0.3, "step": 0.003},
    },
    "sheet, follower pressure, esdirk4": {
        "structure": {**FOIL, "damping": {"rayleigh": [5.0, 0.0]}},
        "motion": {"type": "constant", "speed": 10.0, "axis": [0, 0, 1]},
        "loads": {"pressure": {"over_time": [[0, 0], [0.06, 40.0], [0.15, 10.0], [0.3, 10.0]], "kind": "follower"}},
        "mesh": {"elements": [4, 3]},
        "time": {"end": 0.25, "step": 0.005, "scheme": "esdirk4"},
    },
    "sheet on a free hub": {
        "structure": {
            "type": "plate",
            "length": 0.7,
            "width": 0.35,
            "thickness": 0.006,
            "E": 71000000000.0,
            "nu": 0.33,
            "rho": 2780.0,
            "hub_radius": 0.1,
        },
        "motion": {
            "type": "torque",
            "hub_inertia": 0.3,
            "axis": [0, 1, 0],
            "pulses": [[0.0, 0.05, 6.0], [0.15, 0.2, -4.0]],
        },
        "mesh": {"elements": [4, 2]},
        "time": {"end": 0.3, "step": 0.003},
    },
    "cane, quadratic, to 1e-4": {
        "structure": {
            "type": "planar_beam",
            "length": 3.5,
            "section": CANE,
            "hub_radius": 0.25,
            "damping": {"kelvin_voigt": 0.0005},
        },
        "motion": {"type": "constant", "speed": 3.0},
        "loads": {"tip_moment": [[0, 0], [0.3, 60.0], [0.9, 60.0], [1.0, 0]]},
        "mesh": {"elements": 4, "degree": 2},
        "time": {"end": 1.5, "tolerance": 0.0001, "output_step": 0.01},
    },
    "cane let go, second order": {
        "structure": {"type": "planar_beam", "length": 3.5, "section": CANE, "hub_radius": 0.0},
        "motion": {"type": "constant", "speed": 0.0},
        "initial": {"tip_displacement": 0.25},
        "model": {"theory": "second_order"},
        "mesh": {"elements": 3},
        "time": {"end": 1.5, "step": 0.005},
    },
}
