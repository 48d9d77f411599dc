"""Twenty-one scenes written after the error estimates were finished; no estimate was changed for one of them.

`SCENES` is name ↦ tables, for accuracy_scenes.py --set unseen. Each is a structure, what moves it, a mesh and steps;
schemes of second and of higher order, fixed and adaptive steps, all theories.
"""

from __future__ import annotations

from typing import Any

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
STILL, SLOW = {"type": "constant", "speed": 0.0}, {"type": "constant", "speed": 6.0}
RAMP = {"type": "spin_up", "speed": 12.0, "duration": 1.5}


def _push(force: list[float], start: float, rise: float, length: float) -> list[list[float]]:
    """Return rows (t, force) of a push that rises, stays and ends."""
    none = [0.0] * len(force)
    rows = [[0.0, *none], [start, *none], [start + rise, *force], [start + rise + length, *force]]
    return [*rows, [start + 2 * rise + length, *none]]


def _scene(structure: Tables, motion: Tables, elements: Any, time: Tables, **more: Any) -> Tables:
    mesh = {"elements": elements, **({"degree": more.pop("degree")} if "degree" in more else {})}
    initial = {"state": "undeformed", **more.pop("initial", {})}
    return {"structure": structure, "motion": motion, "mesh": mesh, "time": time, "initial": initial, **more}


def _steps(end: float, step: float, scheme: str | None = None) -> Tables:
    return {"end": end, "step": step, **({} if scheme is None else {"scheme": scheme})}


def _adaptive(end: float, tolerance: float, scheme: str, row: float) -> Tables:
    return {"end": end, "tolerance": tolerance, "scheme": scheme, "output_step": row}


SOFT = {"tip_force": _push([0.0, 4.0], 0.05, 0.1, 0.4)}
FLAP = {"tip_force": _push([0.0, 0.0, 12.0], 0.05, 0.1, 0.3)}
HUB = {"type": "torque", "hub_inertia": 0.8, "pulses": [[0.0, 0.3, 4.0], [0.7, 1.0, -4.0]]}
LINEAR, KARMAN = {"theory": "consistent_linear"}, {"theory": "von_karman"}

SCENES: dict[str, Tables] = {
    "slat pushed": _scene(SLAT, STILL, 4, _steps(2.0, 0.01), loads=SOFT),
    "slat pushed, esdirk4": _scene(SLAT, STILL, 4, _steps(2.0, 0.04, "esdirk4"), loads=SOFT),
    "slat pushed, radau5": _scene(SLAT, STILL, 4, _steps(2.0, 0.05, "radau5"), loads=SOFT),
    "slat pushed, to 1e-3": _scene(SLAT, STILL, 4, _adaptive(2.0, 1e-3, "esdirk4", 0.02), loads=SOFT),
    "slat pushed, radau5 to 1e-4": _scene(SLAT, STILL, 4, _adaptive(2.0, 1e-4, "radau5", 0.02), loads=SOFT),
    "slat spun up": _scene(SLAT, RAMP, 6, _steps(2.5, 0.005)),
    "slat spun up, esdirk4 to 1e-3": _scene(SLAT, RAMP, 6, _adaptive(2.5, 1e-3, "esdirk4", 0.025)),
    "slat spun up, linear elements": _scene(SLAT, RAMP, 12, _steps(2.5, 0.005), degree=1),
    "slat on a free hub": _scene(SLAT, HUB, 4, _steps(1.4, 0.005)),
    "slat on a free hub, to 1e-3": _scene(SLAT, HUB, 4, _adaptive(1.4, 1e-3, "esdirk4", 0.02)),
    "slat with a heavy tip let go": _scene(
        {**SLAT, "tip_mass": 1.5}, STILL, 3, _steps(4.0, 0.02), initial={"tip_displacement": 0.2}
    ),
    "rod in gravity on a turning hub, von Kármán": _scene(
        {"type": "planar_beam", "length": 3.0, "section": ROD},
        SLOW,
        3,
        _steps(2.0, 0.01),
        loads={"gravity": [0.0, -9.81]},
        model=KARMAN,
    ),
    "rod in gravity on a turning hub, linear": _scene(
        {"type": "planar_beam", "length": 3.0, "section": ROD},
        SLOW,
        3,
        _steps(2.0, 0.005),
        loads={"gravity": [0.0, -9.81]},
        model=LINEAR,
    ),
    "wing pushed in flap": _scene(WING, SLOW, 4, _steps(1.5, 0.01), loads=FLAP),
    "wing pushed in flap, coarse": _scene(WING, SLOW, 2, _steps(1.5, 0.005), loads=FLAP, degree=2),
    "wing pushed in flap, to 1e-3": _scene(WING, SLOW, 4, _adaptive(1.5, 1e-3, "esdirk4", 0.01), loads=FLAP),
    "wing with a mass inside, spun up": _scene(
        {**WING, "masses": [{"x": 2.0, "mass": 1.0}]}, RAMP, 5, _steps(2.0, 0.01), loads={"gravity": [0, 0, -9.81]}
    ),
    "wing energy-conserving": _scene(WING, SLOW, 4, _steps(1.5, 0.01, "energy_conserving"), loads=FLAP),
    "sheet pushed at the tip": _scene(
        SHEET, STILL, [4, 2], _steps(0.3, 0.003), loads={"tip_force": _push([0.0, 0.0, 2.0], 0.01, 0.02, 0.05)}
    ),
    "sheet spun up, linear": _scene(
        {**SHEET, "hub_radius": 0.1},
        {"type": "spin_up", "speed": 20.0, "duration": 0.3, "axis": [0, 1, 0]},
        [4, 2],
        _steps(0.4, 0.002),
        model=LINEAR,
    ),
    "sheet spun up, von Kármán strains linearised": _scene(
        {**SHEET, "hub_radius": 0.1},
        {"type": "spin_up", "speed": 20.0, "duration": 0.3, "axis": [0, 1, 0]},
        [6, 2],
        _steps(0.4, 0.004),
        model={"theory": "von_karman_linear"},
    ),
}
