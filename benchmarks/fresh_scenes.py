"""Scenes written after those of later_scenes.py, for accuracy_scenes.py --set fresh; no estimate was changed for one.

A tapered and a soft planar beam, a strip, a twisted and tapered blade, a tube, two plates: under gusts, resonances,
their weight, brakes, followers, torque on a free hub, pitch and a shaken base, by all schemes and theories.
"""

from __future__ import annotations

from typing import Any

Tables = dict[str, Any]

CARBON = {"E": 1.3e11, "nu": 0.3, "rho": 1600.0, "shape": "rectangle", "width": 0.08}
STRIP = {"type": "planar_beam", "length": 1.8, "section": {**CARBON, "height": 0.012}, "hub_radius": 0.12}
TAPER = {
    "type": "planar_beam",
    "length": 4.2,
    "hub_radius": 0.3,
    "section": {
        "E": 7e10,
        "nu": 0.33,
        "rho": 2700.0,
        "shape": "rectangle",
        "width": 0.1,
        "height": [[0, 0.04], [4.2, 0.018]],
    },
}
WHIP = {
    "type": "planar_beam",
    "length": 1.1,
    "section": {"EA": 8e4, "GA": 3e4, "EI": 0.9, "mass_per_length": 0.06, "rotary_inertia": 7e-7},
}
VANE = {
    "type": "spatial_beam",
    "length": 4.5,
    "hub_radius": 0.3,
    "pretwist": [[0, 0.35], [2.0, 0.12], [4.5, 0.0]],
    "section": {
        "EA": [[0, 4.5e7], [4.5, 1.8e7]],
        "GA2": 6e6,
        "GA3": 5e6,
        "GJ": [[0, 9e3], [4.5, 3e3]],
        "EI2": [[0, 1.4e4], [4.5, 2.5e3]],
        "EI3": [[0, 1.2e5], [4.5, 3e4]],
        "mass_per_length": [[0, 3.4], [4.5, 1.5]],
        "rotary_inertia2": 1e-3,
        "rotary_inertia3": 9e-3,
    },
}
LANCE = {
    "type": "spatial_beam",
    "length": 2.2,
    "section": {"E": 7.1e10, "nu": 0.33, "rho": 2770.0, "shape": "tube", "outer_radius": 0.02, "wall": 0.002},
    "hub_radius": 0.1,
}
BOARD = {"type": "plate", "length": 0.9, "width": 0.4, "thickness": 0.008, "E": 7.2e10, "nu": 0.31, "rho": 2750.0}
CARD = {
    "type": "plate",
    "length": 0.4,
    "width": 0.16,
    "thickness": [[0, 0.003], [0.4, 0.0015]],
    "E": 2.05e11,
    "nu": 0.3,
    "rho": 7850.0,
}


def _constant(speed: float, **more: Any) -> Tables:
    return {"type": "constant", "speed": speed, **more}


def _fixed(end: float, step: float, scheme: str = "generalised_alpha") -> Tables:
    return {"end": end, "step": step, "scheme": scheme}


def _adaptive(end: float, tolerance: float, scheme: str = "esdirk4", rows: int = 150) -> Tables:
    return {"end": end, "tolerance": tolerance, "scheme": scheme, "output_step": end / rows}


def _scene(
    structure: Tables,
    motion: Tables,
    elements: Any,
    time: Tables | None,
    degree: int | None = None,
    state: str = "undeformed",
    **more: Any,
) -> Tables:
    mesh = {"elements": elements, **({"degree": degree} if degree else {})}
    out = {"structure": structure, "motion": motion, "mesh": mesh, **more}
    if time is not None:
        out["time"] = time
        out["initial"] = {"state": state, **more.get("initial", {})}
    return out


DAMP = {"damping": {"rayleigh": [0.5, 5e-5]}}

SCENES: dict[str, Tables] = {
    "strip driven at resonance": _scene(
        STRIP,
        _constant(5.0),
        4,
        _fixed(2.0, 0.01),
        loads={"tip_force": {"harmonic": {"amplitude": [0, 3.0], "frequency": 5.4}}},
    ),
    "strip braked, newmark": _scene(
        {**STRIP, "tip_mass": 0.4},
        {"type": "table", "table": [[0, 12], [0.5, 12], [0.9, 2], [1.6, 2]]},
        3,
        _fixed(1.6, 0.004, "newmark"),
        state="steady",
    ),
    "strip braked, inertial": _scene(
        STRIP,
        {"type": "table", "table": [[0, 10], [0.4, 10], [0.8, 3], [1.4, 3]]},
        4,
        _fixed(1.4, 0.004),
        model={"frame": "inertial"},
    ),
    "taper in its weight": _scene(TAPER, _constant(6.5), 5, _fixed(3.0, 0.015), loads={"gravity": [0, -9.81]}),
    "taper in gusts, linear, 30 s": _scene(
        {**TAPER, **DAMP},
        _constant(4.0),
        4,
        _fixed(30.0, 0.03),
        model={"theory": "consistent_linear"},
        loads={"distributed": [[0, 0, 0], [4, 0, 20], [9, 0, -10], [15, 0, 25], [22, 0, 5], [30, 0, 0]]},
    ),
    "taper under load over span, esdirk4": _scene(
        {**TAPER, **DAMP},
        _constant(7.0),
        4,
        _fixed(2.0, 0.02, "esdirk4"),
        loads={
            "distributed": {
                "over_span_and_time": [
                    [x, t, 0, f]
                    for t, g in ((0, 0), (0.5, 1), (1.0, 0.5), (2.0, 0))
                    for x, f in ((0.0, 0.0), (2.0, 20 * g), (4.2, 60 * g))
                ]
            }
        },
    ),
    "whip let go, energy": _scene(
        {**WHIP, "tip_mass": 0.02},
        _constant(3.0),
        4,
        _fixed(1.5, 0.004, "energy_conserving"),
        initial={"tip_displacement": 0.15},
    ),
    "whip, von Karman, harmonic moment": _scene(
        WHIP,
        _constant(8.0),
        4,
        _fixed(1.5, 0.005),
        model={"theory": "von_karman"},
        loads={"tip_moment": {"harmonic": {"amplitude": 0.15, "frequency": 3.0}}},
    ),
    "whip, second order, spun up": _scene(
        WHIP,
        {"type": "spin_up", "speed": 15.0, "duration": 1.0},
        3,
        _fixed(1.4, 0.01),
        model={"theory": "second_order"},
    ),
    "whip, follower, radau5": _scene(
        WHIP,
        _constant(4.0),
        4,
        _fixed(1.2, 0.01, "radau5"),
        loads={
            "tip_force": {"table": [[0, 0, 0], [0.3, -0.1, 0.5], [0.8, -0.1, 0.5], [1.0, 0, 0]], "kind": "follower"}
        },
    ),
    "whip spun to 60, adaptive alpha": _scene(
        WHIP, {"type": "spin_up", "speed": 60.0, "duration": 0.8}, 8, _adaptive(1.0, 1e-3, "generalised_alpha")
    ),
    "strip on a free hub, to 1e-3": _scene(
        {**STRIP, "tip_mass": 0.2},
        {
            "type": "torque",
            "hub_inertia": 1.5,
            "hub_damping": 0.2,
            "table": [[0, 0], [0.2, 20], [0.6, 20], [0.8, -10], [1.4, 0]],
        },
        4,
        _adaptive(1.4, 1e-3),
    ),
    "whip on a free hub, pulses": _scene(
        WHIP,
        {"type": "torque", "hub_inertia": 0.02, "pulses": [[0.0, 0.1, 0.6], [0.5, 0.6, -0.6]]},
        4,
        _fixed(1.0, 0.004),
    ),
    "lag hinge braked, esdirk4": _scene(
        {**STRIP, "root": {"lag_stiffness": 2500.0, "lag_damping": 3.0}},
        {"type": "table", "table": [[0, 8], [0.3, 8], [0.8, 1], [1.5, 1]]},
        3,
        _fixed(1.5, 0.01, "esdirk4"),
        state="steady",
    ),
    "whip linear far from its range": _scene(
        WHIP,
        _constant(2.0),
        4,
        _fixed(1.5, 0.01),
        model={"theory": "linear"},
        loads={"tip_force": [[0, 0, 0], [0.2, 0, 0.3], [1.5, 0, 0.3]]},
    ),
    "strip, quadratic, 1e-4 radau5": _scene(
        {**STRIP, "damping": {"kelvin_voigt": 1e-3}},
        _constant(15.0),
        4,
        _adaptive(1.0, 1e-4, "radau5"),
        degree=2,
        loads={"tip_force": [[0, 0, 0], [0.1, 0, 15], [0.3, 0, 15], [0.4, 0, -10], [1.0, 0, 0]]},
    ),
    "vane in a flap ramp": _scene(
        {**VANE, **DAMP},
        _constant(9.0),
        4,
        _fixed(1.5, 0.01),
        loads={"tip_force": [[0, 0, 0, 0], [0.2, 0, 0, 40], [0.5, 5, 10, 40], [1.5, 0, 0, 0]]},
    ),
    "vane pitched, esdirk4 to 1e-3": _scene(
        {**VANE, "root": {"pitch": [[0, 0], [0.3, 0], [0.8, 0.25], [1.5, 0.1]]}},
        _constant(8.0),
        3,
        _adaptive(0.9, 1e-3),
        loads={"distributed": [0, 0, 15.0]},
    ),
    "lance shaken, tip mass off": _scene(
        {**LANCE, "tip_mass": 0.5, "tip_offset": [0.02, 0.05, 0.0]},
        {**_constant(4.0), "base_acceleration": [[0, 0, 0, 0], [0.1, 3, 0, 12], [0.3, 0, -6, -12], [0.5, 0, 0, 0]]},
        3,
        _fixed(1.2, 0.008),
    ),
    "lance in its weight, linear": _scene(
        {**LANCE, "precone": 0.1},
        _constant(11.0),
        4,
        _fixed(1.5, 0.005),
        model={"theory": "von_karman_linear"},
        loads={"gravity": [0, -9.81, 0]},
    ),
    "lance follower load, newmark": _scene(
        {**LANCE, "damping": {"modal": 0.02}},
        _constant(6.0),
        3,
        _fixed(1.0, 0.005, "newmark"),
        state="steady",
        loads={
            "distributed": {
                "over_time": [[0, 0, 0, 0], [0.2, 0, 2, 25], [0.6, 0, 2, 25], [0.8, 0, 0, 0]],
                "kind": "follower",
            }
        },
    ),
    "vane at rest under load": _scene(VANE, _constant(12.0), 3, None, degree=2, loads={"distributed": [0, 10.0, 80.0]}),
    "lance spun up out of axis": _scene(
        {**LANCE, "tip_mass": 0.3},
        {"type": "spin_up", "speed": 14.0, "duration": 0.8, "axis": [0, 0.6, 0.8]},
        4,
        _fixed(1.1, 0.008),
    ),
    "board pressed, to 1e-3": _scene(
        BOARD,
        _constant(8.0, axis=[0, 1, 0]),
        [6, 3],
        _adaptive(0.3, 1e-3),
        loads={"pressure": [[0, 0], [0.05, 400], [0.12, 0]]},
    ),
    "board spun up, in plane": _scene(
        {**BOARD, "hub_radius": 0.2},
        {"type": "spin_up", "speed": 60.0, "duration": 0.3, "axis": [0, 0, 1]},
        [6, 3],
        _fixed(0.4, 0.002),
        model={"theory": "consistent_linear"},
    ),
    "board on a free hub": _scene(
        {**BOARD, "hub_radius": 0.1},
        {"type": "torque", "hub_inertia": 1.0, "axis": [0, 1, 0], "table": [[0, 0], [0.05, 30], [0.15, 30], [0.2, 0]]},
        [5, 2],
        _fixed(0.3, 0.003),
        model={"theory": "consistent_linear"},
    ),
    "card shaken, radau5, linear": _scene(
        CARD,
        {**_constant(0.0), "base_acceleration": [[0, 0, 0, 0], [0.02, 0, 0, 30], [0.06, 0, 0, -20], [0.1, 0, 0, 0]]},
        [6, 4],
        _fixed(0.2, 0.004, "radau5"),
        model={"theory": "von_karman_linear"},
    ),
    "board at rest under pressure": _scene(
        BOARD, _constant(25.0, axis=[0, 1, 0]), [8, 4], None, loads={"pressure": 300.0}
    ),
}
